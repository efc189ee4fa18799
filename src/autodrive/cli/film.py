"""The command `film`: makes a film of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from autodrive.cli.options import Force, RecordingFile, check_outputs, filled


def film(
    file: RecordingFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The film: .mp4 (AV1), .webm (VP9) or .mkv (AV1).")
    ],
    camera: Annotated[
        str,
        typer.Option(
            help='"Driver\'s Eye", "Bird\'s Eye", "God\'s Eye", Orbit, Fly (stays at a position), or a camera of a '
            "vehicle: front, V2/front."
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
    azimuth: Annotated[
        float, typer.Option(metavar="DEG", help="Where the Orbit is, or Fly looks, from the x axis.")
    ] = 0.0,
    elevation: Annotated[
        float | None, typer.Option(metavar="DEG", help="Of the Orbit, or of where Fly looks.  [default: 30, Fly: 0]")
    ] = None,
    distance: Annotated[float, typer.Option(metavar="M", help="Distance of the Orbit.")] = 1.0,
    position: Annotated[str, typer.Option(metavar="X,Y,Z", help="Of Fly, in the map [m].")] = "0,0,1",
    codec: Annotated[str | None, typer.Option(help="av1 or vp9.  [default: as the end of the file name says]")] = None,
    quality: Annotated[
        str, typer.Option(metavar="NAME", help="Of the images: auto, software, software-fxaa, small or gpu.")
    ] = "auto",
    force: Force = False,
) -> None:
    """Make a film of a recording, with any camera, by day or at night."""
    arguments = locals()
    from rich.console import Console
    from rich.progress import Progress

    from autodrive.base.units import DEGREE
    from autodrive.cli.run import size_of
    from autodrive.protocol.native import SetCamera
    from autodrive.recording.film import FilmOptions
    from autodrive.recording.film import film as make_film
    from autodrive.recording.replay.tape import Tape

    check_outputs(output, is_forced=force)
    up = elevation if elevation is not None else 0.0 if camera == "Fly" else 30.0
    view = SetCamera(
        None,
        height=height,
        azimuth=azimuth * DEGREE,
        elevation=up * DEGREE,
        distance=distance,
        position=_position(position),
    )
    options = filled(FilmOptions, arguments, size=size_of(size, "--size") if size else None, view=view)
    with Tape(file) as tape, Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("filming")
        images = make_film(
            tape, output, options, lambda done, total: progress.update(task, completed=done, total=total)
        )
    typer.echo(f"{output}: {images} images, {images / rate:.1f} s")


def _position(text: str) -> tuple[float, float, float]:
    """The position 'X,Y,Z' [m]."""
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        raise typer.BadParameter(f"--position must be X,Y,Z in metres, for example 1.5,0,0.8, not '{text}'") from None
    return x, y, z
