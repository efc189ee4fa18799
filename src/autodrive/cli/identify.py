"""The command `identify`: fits parameters of a vehicle to a recorded drive."""

from __future__ import annotations

from pathlib import Path

import typer

from autodrive.cli.options import (
    ClockOffset,
    Columns,
    Force,
    HeadingOffset,
    RecordingOrLog,
    Run,
    Steering,
    Topics,
    TrackedPoint,
    check_end,
    check_outputs,
    option,
    point,
)
from autodrive.cli.recordings import show_problems


def identify(
    file: RecordingOrLog,
    vehicle: str = option("Name or file of the vehicle whose parameters are fitted.", ..., metavar="NAME"),
    free: str = option(
        "Parameters to fit, such as wheels.damping_rate.  [default bounds: half and twice the value]",
        ...,
        metavar="A,B=LOW:HIGH",
    ),
    name: str = option("Vehicle of the recording.  [default: the first]", "", metavar="NAME"),
    steering: Steering = "left",
    columns: Columns = "",
    topics: Topics = "",
    run: Run = "",
    tracked_point: TrackedPoint = "0,0",
    heading_offset: HeadingOffset = 0.0,
    clock_offset: ClockOffset = 0.0,
    output: Path | None = option(
        "Vehicle file to write.  [default: VEHICLE_fitted.yaml]", None, "--output", "-o", metavar="FILE"
    ),
    plot: Path | None = option("PNG or SVG file.  [default: beside the vehicle file]", metavar="FILE"),
    trials: int = option("Simulations of the global search.", 24, metavar="N", min=1),
    seed: int = option("Seed of the search; the same seed gives the same result.", 0, metavar="N", min=0),
    window: float = option(
        "After this time, the simulation starts again from the state of the drive.", 2.0, metavar="S", min=0.5
    ),
    threads: int | None = option("Number of threads.  [default: as many as processors]", metavar="N", min=1),
    force: Force = False,
) -> None:
    """Fit parameters of a vehicle to a recorded drive; write the vehicle as a file, and a plot."""
    from autodrive.experiments.identification import identify as fit
    from autodrive.experiments.identification import read_drive
    from autodrive.recording.drives import LogOptions
    from autodrive.recording.plot import check_suffix

    output = output or Path(f"{Path(vehicle).stem}_fitted.yaml")
    picture = plot or output.with_suffix(".png")
    check_suffix(picture)
    check_end("--output", output, ".yaml", ".yml")
    check_outputs(output, picture, is_forced=force)
    wanted = [path.strip() for path in free.split(",") if path.strip()]
    options = LogOptions(
        name=name,
        run=run,
        is_left_positive=steering == "left",
        columns=columns,
        topics=topics,
        tracked_point=point(tracked_point, "--tracked-point"),
        heading_offset=heading_offset,
        clock_offset=clock_offset,
    )
    drive = read_drive(file, options=options)
    show_problems(drive)
    fitted = fit(
        drive,
        vehicle,
        wanted,
        trials=trials,
        seed=seed,
        window=window,
        threads=threads,
    )
    fitted.write(output)
    fitted.plot(picture)
    typer.echo(fitted.table())
    typer.echo(f"wrote {output} and {picture}")
