"""The command `race`: a race of devkit scripts, with its results."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import typer

from autodrive.cli.narrated import narrated
from autodrive.cli.options import (
    Force,
    Headless,
    Host,
    Noise,
    Port,
    Record,
    ResultsFolder,
    argument,
    check_outputs,
    filled,
    option,
    results_folder,
)
from autodrive.cli.run import address
from autodrive.cli.stopping import StopSignals

if TYPE_CHECKING:
    from autodrive.run.race import RaceOptions
    from autodrive.run.runner import Run, RunObserver, StopRequest
    from autodrive.world.racing.results import RaceResult


def race(
    track: str = argument("Name of a track, or path of its file.", ...),
    devkit: list[str] | None = option(
        "Address of a devkit script; once for each vehicle, 1 to 8 in all.", metavar="HOST:PORT"
    ),
    script: list[str] | None = option(
        "Command line with {port} of a script that the race starts, for the vehicles after those of --devkit.",
        metavar="COMMAND",
    ),
    team: list[str] | None = option("Name of the team of each script, in the same order.", metavar="NAME"),
    rules: str = option("Name of rules (see: autodrive list rulesets), or path of their YAML file.", "league_2026"),
    laps: int | None = option("Laps that count.  [default: those of the rules]", min=1, max=1000),
    vehicle: str = option("Name or file of the vehicles.", "roboracer"),
    noise: Noise = False,
    lockstep: bool = option(
        "Each tick waits for the command of each script, so that the speed of the race is that of the scripts.",
        False,
        "--lockstep/--real-time",
    ),
    pace: float | None = option(
        "With --lockstep: greatest number of simulated seconds per second.  [default: no limit; 1 for a "
        "script that answers before its driver has a new command, as ROS bridges do]",
        metavar="FACTOR",
    ),
    seed: int = option("Seed of all noise.", 0, min=0),
    output: ResultsFolder = None,
    record: Record = None,
    cameras: bool = option("Render camera images; otherwise camera images are black.", False, "--cameras/--no-cameras"),
    start_limit: float = option(
        "Wall time within which each script must send its first command.", 60.0, metavar="S", min=0.1
    ),
    headless: Headless = False,
    host: Host = "127.0.0.1",
    port: Port = None,
    force: Force = False,
) -> None:
    """Run a race against one devkit script, or against several on one track.

    Writes result.json, result.md, laps.csv and lines.png, and prints the standings.
    """
    arguments = locals()
    with narrated("starting the simulator"):  # at the first start, this takes seconds
        from autodrive.connect.server.served import PageOptions
        from autodrive.run.race import RaceOptions
        from autodrive.run.race import race as run_race

    options = filled(
        RaceOptions,
        arguments,
        devkits=tuple(address(text) for text in devkit or ()),
        scripts=tuple(script or ()),
        teams=tuple(team or ()),
        has_realistic_sensors=noise,
        is_lockstep=lockstep,
        output=results_folder(output),
        has_page=not headless,
        page=filled(PageOptions, arguments),
    )
    show_race(options, force, lambda stop, display: run_race(options, stop=stop, observer=display))


def show_race(options: RaceOptions, is_forced: bool, start: Callable[[StopRequest, RunObserver], RaceResult]) -> None:
    """Start a race, show its status until it has ended, and print the standings."""
    from autodrive.cli.status import StatusDisplay
    from autodrive.connect.bridge.script_process import close_all
    from autodrive.run.runner import StopRequest

    check_outputs(*options.outputs, is_forced=is_forced)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[logging.StreamHandler()])
    stop = StopRequest()
    begun: list[Run] = []
    results: list[RaceResult] = []

    def end(reason: str) -> None:
        stop.set(reason)
        if not begun:
            raise KeyboardInterrupt

    def report() -> int:
        """Print the results of a race that still closes its connections."""
        while begun and not results:
            time.sleep(0.01)
        close_all()
        for result in results:
            _report(result, options)
        return 0 if begun else 130

    title = f"race on '{options.track}' by the rules '{options.rules}'"
    display = StatusDisplay("loading the track", title, on_start=begun.append, on_result=results.append)
    with StopSignals(end, report) as signals, display:
        signals.catch()
        result = start(stop, display)
    _report(result, options)
    signals.end()


def _report(result: RaceResult, options: RaceOptions) -> None:
    typer.echo(result.to_markdown().rstrip())
    typer.echo(f"\nresults: {options.output}")
