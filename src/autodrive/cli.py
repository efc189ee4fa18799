"""The command line: `autodrive run, list, show, check, urdf, doctor`. Heavy imports wait until a command needs them."""

from __future__ import annotations

import logging
import math
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from autodrive import __version__
from autodrive.errors import AutodriveError
from autodrive.protocol.ports import DEVKIT_PORT, PORT

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

    from autodrive.app import Run
    from autodrive.descriptions import Kind
    from autodrive.run_options import DrivingMode, RunOptions

app = typer.Typer(name="autodrive", add_completion=True, rich_markup_mode=None, pretty_exceptions_enable=False)

LOOKS_PER_LOG_LINE = 50
"""Where no live line is possible, only one in so many is printed: one in ten seconds."""
COMPILED_FUNCTIONS = 90
"""As many are compiled on the first start, give or take a few: the length of the progress bar."""


class Mode(StrEnum):
    """Who drives."""

    manual = "manual"
    autonomous = "autonomous"


class Profile(StrEnum):
    """Era of a devkit."""

    y2020 = "2020"
    y2022 = "2022"
    y2023 = "2023"
    y2025 = "2025"


class Shelf(StrEnum):
    """What can be listed."""

    scenarios = "scenarios"
    maps = "maps"
    vehicles = "vehicles"
    modules = "modules"


class KindName(StrEnum):
    """What a file can describe."""

    scenario = "scenario"
    map = "map"
    vehicle = "vehicle"
    module = "module"


def main() -> None:
    """Entry point: a fault that the user can mend is one line on stderr and exit code 2."""
    try:
        code = app(standalone_mode=False)
    except AutodriveError as error:
        code = _fail(str(error))
    except typer.exceptions.TyperException as error:
        code = _fail(_usage(error))
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except BrokenPipeError:  # whoever read our output has gone
        sys.stderr.close()
        code = 141
    sys.exit(code if isinstance(code, int) else 0)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Simulate scaled autonomous vehicles and connect them to your driving scripts.

    Without a command: autodrive run, which is the standard scenario with its page in your browser.
    """
    if version:
        typer.echo(f"autodrive {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        _run({})


@app.command()
def run(
    scenario: Annotated[
        str, typer.Argument(help="Name, or path of a YAML file. See: autodrive list scenarios")
    ] = "mini_map",
    headless: Annotated[bool, typer.Option("--headless", help="Serve no page: nothing but the status line.")] = False,
    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Serve the page on that address; 0.0.0.0: on all of this machine.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help=f"Serve the page on that port.  [default: {PORT}, or the next free one]"),
    ] = None,
    token: Annotated[
        str | None,
        typer.Option(help="Who enters needs it.  [default: one is made up where --host is not this machine alone]"),
    ] = None,
    allow_origin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ORIGIN", help="Let pages of that origin connect, e.g. https://lab.example.org; repeatable."
        ),
    ] = None,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser, where there is a screen.")
    ] = True,
    devkit: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Connect to the devkit script that listens there.")
    ] = "",
    devkit_profile: Annotated[
        Profile | None, typer.Option(help="Era of the script's devkit.  [default: recognised]")
    ] = None,
    mode: Annotated[
        Mode | None,
        typer.Option(help="Who drives: a person or a script.  [default: autonomous with --devkit, else manual]"),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="Simulated seconds.  [default: until Ctrl-C]")
    ] = None,
    speed: Annotated[
        str, typer.Option(metavar="N|max", help="Simulated seconds per second; max: as fast as possible.")
    ] = "1",
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all noise.  [default: the scenario's]")] = None,
    summary: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write what happened there at the end.")
    ] = None,
    cameras: Annotated[
        bool | None,
        typer.Option(
            "--cameras/--no-cameras",
            help="Draw the cameras' pictures always, or never.  [default: with --devkit, else while somebody looks]",
        ),
    ] = None,
    lockstep: Annotated[
        bool | None,
        typer.Option(
            "--lockstep/--no-lockstep",
            help="Draw each picture in its tick: exact, the same each run, and time waits for it; else beside the "
            "physics, as fast as the machine can.  [default: with --speed max]",
        ),
    ] = None,
    camera_quality: Annotated[str, typer.Option(metavar="NAME", help="auto, software, software-fxaa or gpu.")] = "auto",
    image_size: Annotated[
        str, typer.Option(metavar="WxH", help="Size of the pictures that the script gets.  [default: the camera's]")
    ] = "",
    image_quality: Annotated[
        int, typer.Option(min=1, max=100, help="JPEG quality of the pictures that the script gets.")
    ] = 75,
) -> None:
    """Run a scenario until its duration is over, or Ctrl-C."""
    options: dict[str, Any] = {
        "scenario": scenario,
        "mode": cast("DrivingMode | None", mode and mode.value),
        "duration": duration,
        "speed": _speed(speed),
        "seed": seed,
        "devkit": _address(devkit) if devkit else None,
        "devkit_profile": devkit_profile and devkit_profile.value,
        "summary": summary,
        "cameras": cameras,
        "is_lockstep": lockstep,
        "camera_quality": camera_quality,
        "image_size": _size(image_size) if image_size else None,
        "image_quality": image_quality,
        "has_page": not headless,
        "host": host,
        "port": port,
        "token": token,
        "allowed_origins": tuple(allow_origin or ()),
    }
    if duration is not None and not math.isfinite(duration):
        raise typer.BadParameter(f"--duration is a number of seconds, not {duration}")
    _run(options, opens_browser=browser)


@app.command("list")
def list_(shelf: Annotated[Shelf, typer.Argument(help="What to list.")]) -> None:
    """List what comes with the simulator."""
    from autodrive.browse import titles

    for name, title in titles(cast("Kind", shelf.value.removesuffix("s"))).items():
        typer.echo(f"{name:<24} {title}".rstrip())


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="Name of a map, module, vehicle or scenario, or path of its YAML file.")],
    kind: Annotated[KindName | None, typer.Option(help="Which of them, where a name is used twice.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="PNG or SVG to draw to.  [default: NAME.png]")
    ] = None,
    in_3d: Annotated[
        Path | None, typer.Option("--3d", metavar="FILE.png", help="Draw it as it looks, whatever it is.")
    ] = None,
    night: Annotated[bool, typer.Option("--night", help="With --3d: without the scene light.")] = False,
    occupancy: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write its occupancy grid for map_server of ROS: NAME.png and NAME.yaml."),
    ] = None,
    labels: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Write what is where, seen from above, as a PNG of labels.")
    ] = None,
) -> None:
    """Draw a map or module as a picture; print a vehicle or scenario as a table."""
    from autodrive import browse

    found = cast("Kind", kind.value) if kind else browse.kind_of_name(name)
    if in_3d is not None:
        _show_3d(found, name, in_3d, is_day=not night)
        return
    if occupancy is not None or labels is not None:
        _write_rasters(found, name, occupancy, labels)
        return
    if found in {"map", "module"} or (found == "scenario" and output):
        path = output or Path(f"{Path(name).stem}.png")
        if path.suffix.lower() not in {".png", ".svg"}:
            raise typer.BadParameter(f"--output ends in .png or .svg, not '{path.suffix}'")
        try:
            browse.draw(found, name, path)
        except OSError as error:
            raise AutodriveError(f"the picture cannot be written: {error.strerror}  ({path})") from None
        typer.echo(f"{found} '{Path(name).stem}' is drawn in {path}")
        return
    if output is not None:
        raise typer.BadParameter(f"--output is for pictures of maps and modules; '{name}' is a {found}")
    rows = list(browse.fields(found, name))
    width = max(len(field) for field, _ in rows)
    for field, value in rows:
        typer.echo(f"{field:<{width}}  {value}".rstrip())


def _write_rasters(kind: Kind, name: str, folder: Path | None, labels: Path | None) -> None:
    from autodrive import browse

    if kind == "vehicle":
        raise typer.BadParameter(f"--occupancy and --labels are for maps, modules and scenarios; '{name}' is a {kind}")
    if labels is not None and labels.suffix.lower() != ".png":
        raise typer.BadParameter(f"--labels ends in .png, not '{labels.suffix}'")
    try:
        if folder is not None:
            path = browse.write_occupancy(kind, name, folder)
            typer.echo(f"the occupancy grid of {kind} '{Path(name).stem}' is in {path}")
        if labels is not None:
            browse.write_labels(kind, name, labels)
            typer.echo(f"the labels of {kind} '{Path(name).stem}' are in {labels}")
    except OSError as error:
        raise AutodriveError(f"it cannot be written: {error.strerror}  ({error.filename})") from None


def _show_3d(kind: Kind, name: str, path: Path, *, is_day: bool) -> None:
    from autodrive.portrait import portrait

    if path.suffix.lower() != ".png":
        raise typer.BadParameter(f"--3d draws to a file that ends in .png, not '{path.suffix}'")
    try:
        portrait(kind, name, path, is_day=is_day)
    except OSError as error:
        raise AutodriveError(f"the picture cannot be written: {error.strerror}  ({path})") from None
    typer.echo(f"{kind} '{Path(name).stem}' is drawn in {path}")


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="YAML file of a scenario, map, vehicle or module.")],
    kind: Annotated[KindName | None, typer.Option(help="What it describes.  [default: told by its content]")] = None,
) -> None:
    """Check a file and all that it names; tell every fault."""
    from autodrive import browse

    found, title = browse.check(file, cast("Kind | None", kind and kind.value))
    typer.echo(f"{file}: {found} '{title}' is in order")


@app.command()
def urdf(
    names: Annotated[list[str], typer.Argument(help="Names of vehicles, or the paths of their files.")],
    output: Annotated[Path, typer.Option(help="Folder of a ROS package called autodrive_description.")],
) -> None:
    """Write the robot description of vehicles for ROS: URDF and meshes."""
    from autodrive.vehicles.spec import load_vehicle
    from autodrive.vehicles.urdf import package_files

    files = package_files({Path(name).stem: load_vehicle(name) for name in names})
    try:
        for path, content in files.items():
            (output / path).parent.mkdir(parents=True, exist_ok=True)
            (output / path).write_bytes(content)
    except OSError as error:
        raise AutodriveError(f"it cannot be written: {error.strerror}  ({error.filename})") from None
    typer.echo(f"{len(files)} files are written to {output}")


@app.command()
def doctor() -> None:
    """Tell what this machine has and lacks, and the line that mends it."""
    from autodrive.doctor import examine

    faults = 0
    for finding in examine():
        typer.echo(f"{'ok  ' if finding.is_well else 'BAD '} {finding.subject:<14} {finding.says}")
        if not finding.is_well:
            faults += 1
            typer.echo(f"     mend it with:  {finding.mend}" if finding.mend else "")
    typer.echo("All is well." if not faults else f"{faults} to mend.")
    raise typer.Exit(1 if faults else 0)


# -- run --------------------------------------------------------------------------------------------------------


def _run(options: dict[str, Any], *, opens_browser: bool = True) -> None:
    from rich.console import Console
    from rich.logging import RichHandler

    from autodrive.app import run as run_app
    from autodrive.run_options import RunOptions

    console = Console(stderr=True, highlight=False)
    handler = RichHandler(console=console, show_path=False) if console.is_terminal else logging.StreamHandler()
    logging.basicConfig(level=logging.INFO, format="%(message)s", handlers=[handler])
    wanted = RunOptions(**options)
    with console.status("preparing the world") as line:
        summary = run_app(wanted, _Screen(console, line, wanted, opens_browser=opens_browser))
    _tell(summary)


class _Screen:
    """A status line: live on a terminal, every ten seconds elsewhere."""

    def __init__(self, console: Console, line: Status, options: RunOptions, *, opens_browser: bool) -> None:
        self._console = console
        self._line = line
        self._title = f"running '{options.scenario}', {options.driving_mode}"
        self._opens_browser = opens_browser
        self._compiled = 0
        self._looks = 0

    def compiled(self, function: str) -> None:
        if not self._compiled:
            self._console.print("compiling the physics for this machine: half a minute, on the first start only")
        self._compiled += 1
        share = min(1.0, self._compiled / COMPILED_FUNCTIONS)
        bar = "█" * round(30 * share) + "░" * (30 - round(30 * share))
        self._line.update(f"{bar} {self._compiled}/{COMPILED_FUNCTIONS} {function}")

    def prepared(self, run: Run) -> None:
        if self._compiled:
            self._console.print(f"compiled {self._compiled} functions")
        self._console.print(f"{self._title}; Ctrl-C ends it")
        if run.link:
            self._tell_link(run.link)

    def _tell_link(self, link: str) -> None:
        from autodrive.browser import has_screen, open_page, tunnel

        is_opened = self._opens_browser and self._console.is_terminal and has_screen() and open_page(link)
        self._console.print(f"{'opened' if is_opened else 'open'} in a browser:  {link}", soft_wrap=True)
        if line := tunnel(link):
            self._console.print(f"from your own machine, first:  {line}", soft_wrap=True)

    def show(self, run: Run) -> None:
        self._looks += 1
        if self._console.is_terminal:
            self._line.update(run.status())
        elif self._looks % LOOKS_PER_LOG_LINE == 0:
            self._console.print(run.status(), soft_wrap=True)


def _tell(summary: dict[str, Any]) -> None:
    """The summary in a few lines on stdout."""
    typer.echo(
        f"{summary['simulated_time']:.2f} s simulated in {summary['wall_time']:.2f} s "
        f"(x{summary['real_time_factor']:.2f}), {summary['ticks']} ticks, {summary['late_ticks']} late; "
        f"ended by {summary['ended_by']}"
    )
    for name, vehicle in summary["vehicles"].items():
        x, y, _ = vehicle["pose"]["position"]
        typer.echo(
            f"{name}: {vehicle['distance']:.2f} m driven, {vehicle['collisions']} collisions, "
            f"at ({x:.3f}, {y:.3f}) m, heading {math.degrees(vehicle['pose']['yaw']):.1f} degrees"
        )
    if cameras := summary["cameras"]:
        typer.echo(_pictures_told(cameras))
    if bridge := summary["bridge"]:
        trip = bridge["round_trip"]
        typer.echo(
            f"devkit at {bridge['address']}: {bridge['telemetry_sent']} telemetry, "
            f"{bridge['commands_received']} commands"
            + (f", round trip {1e3 * trip:.1f} ms (median)" if trip is not None else "")
        )


def _pictures_told(cameras: dict[str, Any]) -> str:
    """What the cameras took, in a line; why there is nothing was said when it was found."""
    if cameras["fault"]:
        return "cameras: unavailable"
    took = [
        f"{vehicle} {camera} {one['count']} pictures ({one['rate']:.1f} Hz)"
        for vehicle, its in cameras["pictures"].items()
        for camera, one in its.items()
    ]
    median = "" if cameras["draw_time"] is None else f", {1e3 * cameras['draw_time']:.1f} ms (median)"
    return f"cameras: {', '.join(took) or 'no pictures'}; drawn by {cameras['renderer']}{median}"


# -- words of the command line ----------------------------------------------------------------------------------


def _speed(text: str) -> float | None:
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not (math.isfinite(speed) and speed > 0):
        raise typer.BadParameter(f"--speed is a positive number or max, not '{text}'")
    return speed


def _size(text: str) -> tuple[int, int]:
    """Width and height of 'WxH'."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and 0 < int(width) <= 8192 and 0 < int(height) <= 8192):
        raise typer.BadParameter(f"--image-size is WxH in pixels, for example 640x480, not '{text}'")
    return int(width), int(height)


def _address(text: str) -> tuple[str, int]:
    """Host and port of 'HOST:PORT', 'HOST', ':PORT' or '[IPV6]:PORT'."""
    host, colon, port = text.rpartition(":")
    if not colon or text.endswith("]"):
        host, port = text, str(DEVKIT_PORT)
    if not (port.isdecimal() and 0 < int(port) < 65536):
        raise typer.BadParameter(f"--devkit is HOST:PORT, for example 127.0.0.1:{DEVKIT_PORT}, not '{text}'")
    return host.removeprefix("[").removesuffix("]") or "127.0.0.1", int(port)


def _usage(error: Any) -> str:
    """A fault in the command line, in one line."""
    text = error.format_message() if hasattr(error, "format_message") else str(error)
    return f"{' '.join(text.split()).replace('Value error, ', '')}  (see: autodrive --help)"


def _fail(text: str) -> int:
    typer.echo(f"autodrive: {text}", err=True)
    return 2
