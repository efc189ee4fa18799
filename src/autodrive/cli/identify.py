"""The command `identify`: fits parameters of a vehicle to a recorded drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from autodrive.cli.options import Force, RecordingOrLog, Steering, check_end, check_outputs


def identify(
    file: RecordingOrLog,
    vehicle: Annotated[str, typer.Option(metavar="NAME", help="Name or file of the vehicle whose parameters to fit.")],
    free: Annotated[
        str,
        typer.Option(
            metavar="A,B=LOW:HIGH",
            help="Parameters to fit, such as wheels.damping_rate.  [default bounds: half and twice the value]",
        ),
    ],
    name: Annotated[str, typer.Option(metavar="NAME", help="Vehicle of the recording.  [default: the first]")] = "",
    steering: Steering = "left",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Vehicle file to write.  [default: VEHICLE_fitted.yaml]"),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="PNG or SVG file.  [default: beside the vehicle file]")
    ] = None,
    trials: Annotated[int, typer.Option(metavar="N", min=1, help="Simulations of the global search.")] = 24,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the search: same seed, same result.")] = 0,
    window: Annotated[
        float, typer.Option(metavar="S", min=0.5, help="The simulation starts again from the drive after this time.")
    ] = 2.0,
    threads: Annotated[int | None, typer.Option(metavar="N", min=1, help="[default: as many as processors]")] = None,
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
