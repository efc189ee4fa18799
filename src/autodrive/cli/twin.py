"""The command `twin`: shows a measured car beside the car that the simulator predicts."""

from __future__ import annotations

from pathlib import Path

import typer

from autodrive.cli.options import (
    Browser,
    ClockOffset,
    Columns,
    Force,
    HeadingOffset,
    Host,
    Port,
    Run,
    Steering,
    Token,
    Topics,
    TrackedPoint,
    check_end,
    check_outputs,
    option,
    point,
)
from autodrive.cli.recordings import show_problems


def twin(
    replay: Path = option(
        "Log of the measured car: a recording, a log of the data recorder, a table, or a ROS bag.", ..., metavar="LOG"
    ),
    vehicle: str = option("Name or file of the vehicle that predicts.", ..., metavar="NAME"),
    restart: float = option("After this time, the prediction starts again as measured.", 5.0, metavar="S", min=0.1),
    steering: Steering = "left",
    columns: Columns = "",
    topics: Topics = "",
    run: Run = "",
    tracked_point: TrackedPoint = "0,0",
    heading_offset: HeadingOffset = 0.0,
    clock_offset: ClockOffset = 0.0,
    output: Path | None = option(
        "Recording to write.  [default: LOG_twin.mcap here]", None, "--output", "-o", metavar="FILE.mcap"
    ),
    show: bool = option("Show the recording in the page, until Ctrl-C.", True, "--show/--no-show"),
    host: Host = "127.0.0.1",
    port: Port = None,
    token: Token = None,
    browser: Browser = True,
    force: Force = False,
) -> None:
    """Show a measured car beside the car that the simulator predicts from the same commands.

    The gap is a signal of the plots. Nothing is sent to a car.
    """
    import numpy as np

    from autodrive.cli.replay import replay as show_recording
    from autodrive.experiments.identification import read_drive
    from autodrive.recording.drives import LogOptions
    from autodrive.recording.exports.twin import record_twin

    path = output or Path(f"{replay.name.partition('.')[0]}_twin.mcap")
    check_end("--output", path, ".mcap")
    check_outputs(path, is_forced=force)
    options = LogOptions(
        run=run,
        is_left_positive=steering == "left",
        columns=columns,
        topics=topics,
        tracked_point=point(tracked_point, "--tracked-point"),
        heading_offset=heading_offset,
        clock_offset=clock_offset,
    )
    drive = read_drive(replay, options=options)
    show_problems(drive)
    distances = record_twin(drive, vehicle, path, restart=restart)
    middle, most = np.quantile(distances, (0.5, 0.95))
    typer.echo(f"gap of the positions within {restart:g} s: median {middle:.3f} m, 95 % below {most:.3f} m")
    typer.echo(f"wrote {path}")
    if show:
        show_recording(
            path,
            host=host,
            port=port,
            token=token,
            browser=browser,
            speed=1.0,
            paused=False,
            resimulate=False,
            sensor=None,
            camera_quality="auto",
        )
