"""The command `run`: options, signal handling, status line, browser, summary on stdout."""

from __future__ import annotations

import dataclasses
import importlib
import logging
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import typer

from autodrive.base.pace import MAX_SPEED, MIN_SPEED
from autodrive.base.tcp import without_brackets
from autodrive.cli.narrated import narrated
from autodrive.cli.options import Browser, Force, Headless, Host, Port, Record, Token, check_outputs, filled
from autodrive.cli.stopping import StopSignals
from autodrive.cli.weather import environment
from autodrive.protocol.devkit_profile import DevkitKeys, DevkitSettings, Handshake, LidarFormat, Side
from autodrive.protocol.ports import DEVKIT_PORT

if TYPE_CHECKING:
    from autodrive.run.options import RunOptions
    from autodrive.run.runner import Run
    from autodrive.run.summary import Summary


DrivingMode: TypeAlias = Literal["manual", "autonomous"]
"""Whether a person or a script drives."""
Profile: TypeAlias = Literal["2020", "2022", "2023", "2025"]
"""Devkit generation."""


def run(
    scenario: Annotated[
        str, typer.Argument(help="Name of a scenario (see: autodrive list scenarios), or path of its YAML file.")
    ] = "mini_map",
    headless: Headless = False,
    host: Host = "127.0.0.1",
    port: Port = None,
    token: Token = None,
    allow_origin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ORIGIN", help="Let pages of that origin connect, e.g. https://lab.example.org; repeatable."
        ),
    ] = None,
    browser: Browser = True,
    devkit: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Connect to the devkit script at that address.")
    ] = "",
    devkit_profile: Annotated[
        Profile | None, typer.Option(help="Devkit generation of the script.  [default: detected]")
    ] = None,
    devkit_steering: Annotated[
        Side | None,
        typer.Option(help="Where a positive steering command of the script turns.  [default: as in the profile]"),
    ] = None,
    devkit_feedback: Annotated[
        Side | None,
        typer.Option(help="Where a positive steering angle points for the script.  [default: as in the profile]"),
    ] = None,
    devkit_lidar: Annotated[
        LidarFormat | None,
        typer.Option(help="Format of LIDAR scans for the script.  [default: detected from its commands]"),
    ] = None,
    devkit_keys: Annotated[
        DevkitKeys | None,
        typer.Option(help="Keys of the messages: 'Throttle' or 'V1 Throttle'.  [default: as in the profile]"),
    ] = None,
    devkit_handshake: Annotated[
        Handshake | None,
        typer.Option(help="Handshake of the script's server; raw: the C++ devkit.  [default: detected]"),
    ] = None,
    mode: Annotated[
        DrivingMode | None,
        typer.Option(help="Whether a person or a script drives.  [default: autonomous with --devkit, else manual]"),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="Simulated seconds to run.  [default: until Ctrl-C]")
    ] = None,
    speed: Annotated[
        str, typer.Option(metavar="N|max", help="Simulated seconds per second; max: as fast as possible.")
    ] = "1",
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all noise.  [default: seed of the scenario]")] = None,
    weather: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VALUE", help="Weather and time of day, e.g. rain=0.6, heavy_fog, time=18:30; repeatable."
        ),
    ] = None,
    summary: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the summary of the run to that file.")
    ] = None,
    recordings: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder for recordings that are started in the page.")
    ] = Path("recordings"),
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Folder with your own scenarios, maps and tracks, which the page lists and saves."
        ),
    ] = None,
    record: Record = None,
    record_last: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            min=0.1,
            max=86400,
            help="With --record: keep only the last S seconds, and write them to a numbered file at each collision.",
        ),
    ] = None,
    cameras: Annotated[
        bool | None,
        typer.Option(
            "--cameras/--no-cameras",
            help="Render camera images always, or never.  [default: always with --devkit, else while a client shows "
            "them]",
        ),
    ] = None,
    lockstep: Annotated[
        bool | None,
        typer.Option(
            "--lockstep/--no-lockstep",
            help="Render each image in its tick: reproducible, but time waits for it; otherwise asynchronously: images "
            "are dropped if the machine is too slow.  [default: in the tick with --speed max]",
        ),
    ] = None,
    camera_quality: Annotated[
        str, typer.Option(metavar="NAME", help="auto, software, software-fxaa, small or gpu.")
    ] = "auto",
    image_size: Annotated[
        str,
        typer.Option(metavar="WxH", help="Size of the images for the devkit script.  [default: that of the camera]"),
    ] = "",
    image_quality: Annotated[
        int, typer.Option(min=1, max=100, help="JPEG quality of the images for the devkit script.")
    ] = 75,
    force: Force = False,
) -> None:
    """Run a scenario until its duration is over, or until Ctrl-C."""
    arguments = locals()
    if record_last is not None and record is None:
        raise typer.BadParameter("--record-last needs --record FILE.mcap")
    if duration is not None and not math.isfinite(duration):
        raise typer.BadParameter(f"--duration must be a number of seconds, not {duration}")
    # with --record-last the names of the files have numbers that no file has
    check_outputs(summary, None if record_last else record, is_forced=force)
    devkit_arguments = {name.removeprefix("devkit_"): value for name, value in arguments.items()}
    _import_run()
    from autodrive.run.options import PageOptions, RunOptions

    options = filled(
        RunOptions,
        arguments,
        speed=_speed(speed),
        environment=environment(weather) if weather else {},
        devkit=address(devkit) if devkit else None,
        devkit_settings=filled(DevkitSettings, devkit_arguments),
        is_lockstep=lockstep,
        image_size=size_of(image_size) if image_size else None,
        has_page=not headless,
        page=filled(PageOptions, arguments, allowed_origins=tuple(allow_origin or ())),
    )
    _run(options, opens_browser=browser)


def run_default() -> None:
    """`autodrive run` without arguments."""
    _import_run()
    from autodrive.run.options import RunOptions

    _run(RunOptions(), opens_browser=True)


def _import_run() -> None:
    """Import all that a run needs, which takes seconds at the first start."""
    with narrated("starting the simulator"):
        for module in ("autodrive.cli.status", "autodrive.run.options"):
            importlib.import_module(module)


def _run(options: RunOptions, *, opens_browser: bool) -> None:
    from rich.logging import RichHandler

    from autodrive.base.cache import check_writable
    from autodrive.cli.status import StatusDisplay
    from autodrive.run.runner import StopRequest, simulate

    if options.summary is not None:
        check_writable(options.summary)
    stop = StopRequest()
    runs: list[Run] = []

    def begin(run: Run) -> None:
        runs.append(run)
        signals.catch()

    title = f"running '{options.scenario}', {options.driving_mode}"
    display = StatusDisplay("loading the world", title, opens_browser=opens_browser, on_start=begin)
    handler = RichHandler(console=display.console, show_path=False) if display.console.is_terminal else None
    logging.basicConfig(level=logging.INFO, format="%(message)s", handlers=[handler or logging.StreamHandler()])
    signals = StopSignals(stop.set, lambda: _report(runs[0].summary(stop.reason), options.summary))
    with signals, display:
        summary = simulate(dataclasses.replace(options, summary=None), stop=stop, observer=display)
    code = _report(summary, options.summary)
    signals.end(code)
    if code:
        raise typer.Exit(code)


RECORDING_FAILED = 3
"""Exit code of a run whose recording ended early."""


def _report(summary: Summary, path: Path | None) -> int:
    """Write the summary, then print it, also if the disk is full. The exit code."""
    from autodrive.base.cache import write_file
    from autodrive.cli.status import print_summary

    try:
        if path is not None:
            write_file(path, summary.to_json())
    finally:
        print_summary(summary)
    return RECORDING_FAILED if summary.recording is not None and summary.recording.error else 0


# -- values of options ------------------------------------------------------------------------------------------


def _speed(text: str) -> float | None:
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not MIN_SPEED <= speed <= MAX_SPEED:
        raise typer.BadParameter(f"--speed must be a number from {MIN_SPEED:g} to {MAX_SPEED:g} or max, not '{text}'")
    return speed


def size_of(text: str, option: str = "--image-size") -> tuple[int, int]:
    """Width and height of 'WxH'."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and 0 < int(width) <= 8192 and 0 < int(height) <= 8192):
        raise typer.BadParameter(f"{option} must be WxH in pixels, for example 640x480, not '{text}'")
    return int(width), int(height)


def address(text: str) -> tuple[str, int]:
    """Host and port of 'HOST:PORT', ':PORT' or '[IPV6]:PORT'."""
    host, _, port = text.rpartition(":")
    if not (port.isdecimal() and 0 < int(port) < 65536):
        raise typer.BadParameter(f"--devkit must be HOST:PORT, for example 127.0.0.1:{DEVKIT_PORT}, not '{text}'")
    return without_brackets(host) or "127.0.0.1", int(port)
