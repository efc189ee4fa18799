"""The command `identify`: fits parameters of a vehicle to a recorded drive."""

from __future__ import annotations

from pathlib import Path

import typer

from autodrive.cli.options import Force, RecordingOrLog, Steering, check_end, check_outputs, option


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
    from autodrive.recording.plot import check_suffix

    output = output or Path(f"{Path(vehicle).stem}_fitted.yaml")
    picture = plot or output.with_suffix(".png")
    check_suffix(picture)
    check_end("--output", output, ".yaml", ".yml")
    check_outputs(output, picture, is_forced=force)
    wanted = [path.strip() for path in free.split(",") if path.strip()]
    fitted = fit(
        file,
        vehicle,
        wanted,
        name=name,
        is_left_positive=steering == "left",
        trials=trials,
        seed=seed,
        window=window,
        threads=threads,
    )
    fitted.write(output)
    fitted.plot(picture)
    typer.echo(fitted.table())
    typer.echo(f"wrote {output} and {picture}")
