"""The command `identify`: fits a vehicle to recorded drives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from autodrive.cli.options import (
    ClockOffset,
    Columns,
    Force,
    HeadingOffset,
    Run,
    Steering,
    Topics,
    TrackedPoint,
    argument,
    check_end,
    check_outputs,
    option,
    point,
)
from autodrive.cli.recordings import show_problems

if TYPE_CHECKING:
    from autodrive.recording.drives import LogOptions


def identify(
    files: list[Path] = argument(
        "Recordings (.mcap), or logs: tables with a header (.csv), also compressed by gzip.", ..., metavar="FILE..."
    ),
    vehicle: str = option("Name or file of the vehicle whose parameters are fitted.", ..., metavar="NAME"),
    free: str = option(
        "Parameters to fit to one drive, such as wheels.damping_rate.  [default bounds: half and twice the value]  "
        "[default: a fit in stages of what the vehicle's drivetrain and tyres have]",
        "",
        metavar="A,B=LOW:HIGH",
    ),
    held_out: list[Path] | None = option(
        "Drive that only judges the fit in stages; give it several times for several drives.  [default: the last "
        "fifth of each drive]",
        metavar="FILE",
    ),
    session: str | None = option(
        "Values of each drive that the fit in stages finds besides those of the vehicle: trim, drive, grip, delay, or "
        "none.  [default: trim; without speed control: trim,drive]",
        metavar="A,B",
    ),
    report: Path | None = option(
        "Folder for the report of the fit in stages, an HTML page and JSON.", metavar="FOLDER"
    ),
    design: Path | None = option(
        "Write the next 30 s of driving that would improve the fit in stages most, as a program.", metavar="FILE.py"
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
    """Fit a vehicle to recorded drives; write the vehicle as a file, with a plot or a report.

    With --free: chosen parameters to one drive. Without: in stages, to several drives, with a stated error.
    """
    from autodrive.experiments.identification import identify as fit
    from autodrive.experiments.identification import read_drive
    from autodrive.recording.drives import LogOptions
    from autodrive.recording.plot import check_suffix

    output = output or Path(f"{Path(vehicle).stem}_fitted.yaml")
    check_end("--output", output, ".yaml", ".yml")
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
    if not free:
        if plot is not None:
            raise typer.BadParameter("--plot is for a fit with --free; the fit in stages has --report FOLDER")
        check_end("--design", design, ".py")
        check_outputs(output, design, report and report / "report.html", is_forced=force)
        names = None if session is None else [name.strip() for name in session.split(",") if name.strip() != "none"]
        _fit_in_stages(files, vehicle, options, held_out or [], names, report, design, output, threads, seed)
        return
    if len(files) > 1 or held_out or session is not None or report is not None or design is not None:
        raise typer.BadParameter(
            "--free fits to one file, without --held-out, --session, --report and --design; leave --free out for a fit "
            "in stages"
        )
    picture = plot or output.with_suffix(".png")
    check_suffix(picture)
    check_outputs(output, picture, is_forced=force)
    wanted = [path.strip() for path in free.split(",") if path.strip()]
    drive = read_drive(files[0], options=options)
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


def _fit_in_stages(
    files: list[Path],
    vehicle: str,
    options: LogOptions,
    held_out: list[Path],
    session: list[str] | None,
    report: Path | None,
    design: Path | None,
    output: Path,
    threads: int | None,
    seed: int,
) -> None:
    from autodrive.experiments.identification.design import design as designed
    from autodrive.experiments.identification.design import write_script
    from autodrive.experiments.identification.drive import check_drive
    from autodrive.experiments.identification.fit_report import write_report
    from autodrive.experiments.identification.staged import fit_in_stages
    from autodrive.recording.drives import read_drives

    def progress(text: str) -> None:
        typer.echo(text, err=True)

    drives, held = ([drive for file in group for drive in read_drives(file, options)] for group in (files, held_out))
    for drive in (*drives, *held):
        show_problems(drive)
        check_drive(drive)
    fitted = fit_in_stages(drives, vehicle, held=held, session=session, threads=threads, seed=seed, progress=progress)
    fitted.write(output)
    typer.echo(fitted.table())
    written = [str(output)]
    if report is not None:
        written.append(str(write_report(fitted, report)))
    if design is not None:
        chosen = designed(fitted, threads=threads, progress=progress)
        write_script(chosen, vehicle, design)
        typer.echo("the next drive: " + ", then ".join(manoeuvre.title for manoeuvre in chosen))
        written.append(str(design))
    typer.echo(f"wrote {' and '.join(written)}")
