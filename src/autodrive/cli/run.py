"""The command `run`: options, signal handling, status line, browser, summary on stdout."""

from __future__ import annotations

import dataclasses
import importlib
import logging
import math
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import typer

from autodrive.base.pace import MAX_SPEED, MIN_SPEED
from autodrive.base.tcp import without_brackets
from autodrive.cli.narrated import narrated
from autodrive.cli.options import (
    Browser,
    Force,
    Headless,
    Host,
    Port,
    Record,
    Token,
    argument,
    check_outputs,
    filled,
    option,
)
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
    scenario: str | None = argument(
        "Name of a scenario (see: autodrive list scenarios), or path of its YAML file.  [default: chosen in the page, "
        "mini_map without a person who chooses]",
    ),
    headless: Headless = False,
    host: Host = "127.0.0.1",
    port: Port = None,
    token: Token = None,
    allow_origin: list[str] | None = option(
        "Let pages of that origin connect, e.g. https://lab.example.org; repeatable.", metavar="ORIGIN"
    ),
    browser: Browser = True,
    devkit: str = option("Connect to the devkit script at that address.", "", metavar="HOST:PORT"),
    devkit_profile: Profile | None = option("Devkit generation of the script.  [default: detected]"),
    devkit_steering: Side | None = option(
        "Where a positive steering command of the script turns.  [default: as in the profile]"
    ),
    devkit_feedback: Side | None = option(
        "Where a positive steering angle points for the script.  [default: as in the profile]"
    ),
    devkit_lidar: LidarFormat | None = option(
        "Format of LIDAR scans for the script.  [default: detected from its commands]"
    ),
    devkit_keys: DevkitKeys | None = option(
        "Keys of the messages: 'Throttle' or 'V1 Throttle'.  [default: as in the profile]"
    ),
    devkit_handshake: Handshake | None = option(
        "Handshake of the script's server; raw: the C++ devkit.  [default: detected]"
    ),
    mode: DrivingMode | None = option(
        "Whether a person or a script drives.  [default: autonomous with --devkit, else manual]"
    ),
    duration: float | None = option("Simulated seconds to run.  [default: until Ctrl-C]", metavar="S", min=0),
    speed: str = option("Simulated seconds per second; max: as fast as possible.", "1", metavar="N|max"),
    seed: int | None = option("Seed of all noise.  [default: seed of the scenario]", min=0),
    weather: list[str] | None = option(
        "Weather and time of day, e.g. rain=0.6, heavy_fog, time=18:30; repeatable.", metavar="VALUE"
    ),
    summary: Path | None = option("Write the summary of the run to that file.", metavar="FILE.json"),
    recordings: Path = option(
        "Folder for recordings that are started in the page.", Path("recordings"), metavar="FOLDER"
    ),
    folder: Path | None = option(
        "Folder with your own scenarios, maps and tracks, which the page lists and saves.", metavar="FOLDER"
    ),
    record: Record = None,
    record_last: float | None = option(
        "With --record: keep only the last S seconds, and write them to a numbered file at each collision.",
        metavar="S",
        min=0.1,
        max=86400,
    ),
    cameras: bool | None = option(
        "Render camera images always, or never.  [default: always with --devkit, else while a client shows them]",
        None,
        "--cameras/--no-cameras",
    ),
    lockstep: bool | None = option(
        "Render each image in its tick: reproducible, but simulated time waits for the image; otherwise images "
        "are dropped if the machine is too slow.  [default: in the tick with --speed max]",
        None,
        "--lockstep/--no-lockstep",
    ),
    camera_quality: str = option(
        "Quality of camera images: auto, software, software-fxaa, small or gpu.", "auto", metavar="NAME"
    ),
    image_size: str = option(
        "Size of the images for the devkit script.  [default: that of the camera]", "", metavar="WxH"
    ),
    image_quality: int = option("JPEG quality of the images for the devkit script.", 75, min=1, max=100),
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
    from autodrive.scenario import DEFAULT, START

    has_person = not (headless or devkit or record or duration is not None or mode == "autonomous")
    has_start_screen = scenario is None and has_person
    options = filled(
        RunOptions,
        arguments,
        scenario=scenario or (START if has_start_screen else DEFAULT),
        has_start_screen=has_start_screen,
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
    from autodrive.scenario import START

    _run(RunOptions(START, has_start_screen=True), opens_browser=True)


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
