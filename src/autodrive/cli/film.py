"""The command `film`: makes a film of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from autodrive.cli.options import RecordingFile


def film(
    file: RecordingFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The film: .mp4 (AV1), .webm (VP9) or .mkv (AV1).")
    ],
    camera: Annotated[
        str,
        typer.Option(
            help='"Driver\'s Eye", "Bird\'s Eye", "God\'s Eye", Orbit, or a camera of a vehicle: front, V2/front.'
        ),
    ] = "Driver's Eye",
    vehicle: Annotated[str | None, typer.Option(help="The vehicle that is followed.  [default: the first one]")] = None,
    start: Annotated[
        float, typer.Option("--from", metavar="S", min=0, help="First time of the recording that is shown.")
    ] = 0.0,
    end: Annotated[
        float | None, typer.Option("--to", metavar="S", min=0, help="Last time that is shown.  [default: the end]")
    ] = None,
    speed: Annotated[float, typer.Option(metavar="N", help="Recorded seconds per second of the film.")] = 1.0,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Images per second of the film.")] = 30.0,
    size: Annotated[
        str, typer.Option(metavar="WxH", help="Size of the film.  [default: 1280x720, or that of the sensor camera]")
    ] = "",
    light: Annotated[
        str | None,
        typer.Option(help="day, night, or a time of day in hours, such as 18.5.  [default: the recorded light]"),
    ] = None,
    overlay: Annotated[bool, typer.Option("--overlay", help="Show speed and steering.")] = False,
    height: Annotated[float, typer.Option(metavar="M", help="Height of the Bird's Eye.")] = 3.0,
    azimuth: Annotated[float, typer.Option(metavar="DEG", help="Direction of the Orbit, from the x axis.")] = 0.0,
    elevation: Annotated[float, typer.Option(metavar="DEG", help="Elevation of the Orbit.")] = 30.0,
    distance: Annotated[float, typer.Option(metavar="M", help="Distance of the Orbit.")] = 1.0,
    codec: Annotated[str | None, typer.Option(help="av1 or vp9.  [default: as the end of the file name says]")] = None,
    quality: Annotated[
        str, typer.Option(metavar="NAME", help="Of the images: auto, software, software-fxaa, small or gpu.")
    ] = "auto",
) -> None:
    """Make a film of a recording, with any camera, by day or at night."""
    from rich.console import Console
    from rich.progress import Progress

    from autodrive.base.units import DEGREE
    from autodrive.cli.run import size_of
    from autodrive.protocol.native import SetCamera
    from autodrive.recording.film import FilmOptions
    from autodrive.recording.film import film as make_film
    from autodrive.recording.replay.tape import Tape

    options = FilmOptions(
        camera=camera,
        vehicle=vehicle,
        start=start,
        end=end,
        speed=speed,
        rate=rate,
        size=size_of(size, "--size") if size else None,
        light=light,
        overlay=overlay,
        codec=codec,
        quality=quality,
        view=SetCamera(None, height=height, azimuth=azimuth * DEGREE, elevation=elevation * DEGREE, distance=distance),
    )
    with Tape(file) as tape, Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("filming")
        images = make_film(
            tape, output, options, lambda done, total: progress.update(task, completed=done, total=total)
        )
    typer.echo(f"{output}: {images} images, {images / rate:.1f} s")
