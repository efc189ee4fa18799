"""The command `replay`: shows a recording in the page."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import typer

from autodrive.cli.options import Browser, Host, Port, RecordingFile, Token, filled, option
from autodrive.cli.stopping import StopSignals

if TYPE_CHECKING:
    from autodrive.recording.replay import Replay


def replay(
    file: RecordingFile,
    host: Host = "127.0.0.1",
    port: Port = None,
    token: Token = None,
    browser: Browser = True,
    speed: float = option("Recorded seconds per second.", 1.0, metavar="N"),
    paused: bool = option("Wait until somebody presses Play.", False, "--paused"),
    resimulate: bool = option(
        "Simulate the recording again instead, and compare every Frame: the last line is 'identical' (exit code 0), or "
        "the first difference (exit code 1).",
        False,
        "--resimulate",
    ),
    sensor: list[str] | None = option(
        "With --resimulate: the class of a sensor of the user, which is not in the recording; repeatable.",
        metavar="V1/NAME=FILE.py:CLASS",
    ),
    camera_quality: str = option(
        "Quality of camera images that were not recorded; see: autodrive run --help.", "auto", metavar="NAME"
    ),
) -> None:
    """Show a recording in the page, until Ctrl-C."""
    arguments = locals()
    if resimulate:
        from autodrive.cli.recordings import simulate_again

        raise typer.Exit(simulate_again(file, sensor or []))
    from autodrive.connect.server.served import PageOptions
    from autodrive.recording.replay import ReplayOptions
    from autodrive.recording.replay import replay as show
    from autodrive.run.browser import has_screen, open_page, tunnel

    stop = threading.Event()

    def started(replay: Replay) -> None:
        signals.catch()
        for problem in replay.tape.problems:
            typer.echo(f"autodrive: {problem}", err=True)
        url = replay.server.url
        typer.echo(f"replaying '{replay.tape.name}', {replay.tape.duration:.1f} s; press Ctrl-C to stop", err=True)
        typer.echo(f"page: {url}", err=True)
        if command := tunnel(url):
            typer.echo(f"to open the page from another machine, run there: {command}", err=True)
        if browser and has_screen():
            open_page(url)

    options = filled(ReplayOptions, arguments, is_paused=paused, page=filled(PageOptions, arguments))
    with StopSignals(lambda _: stop.set()) as signals:
        show(file, options, stop=stop, on_start=started)
    signals.end()
