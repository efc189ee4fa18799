"""The command `film`: makes a film of a recording."""

from __future__ import annotations

from pathlib import Path

import typer

from autodrive.cli.options import Force, RecordingFile, check_outputs, filled, option


def film(
    file: RecordingFile,
    output: Path = option("The film: .mp4 (AV1), .webm (VP9) or .mkv (AV1).", ..., "--output", "-o", metavar="FILE"),
    camera: str = option(
        '"Driver\'s Eye", "Bird\'s Eye", "God\'s Eye", Orbit, Fly (stays at a position), or a camera of a '
        "vehicle: front, V2/front.",
        "Driver's Eye",
    ),
    vehicle: str | None = option("The vehicle that is followed.  [default: the first one]"),
    start: float = option("First time of the recording that is shown.", 0.0, "--from", metavar="S", min=0),
    end: float | None = option("Last time that is shown.  [default: the end]", None, "--to", metavar="S", min=0),
    speed: float = option("Recorded seconds per second of the film.", 1.0, metavar="N"),
    rate: float = option("Images per second of the film.", 30.0, metavar="HZ"),
    size: str = option("Size of the film.  [default: 1280x720, or that of the sensor camera]", "", metavar="WxH"),
    light: str | None = option("day, night, or a time of day in hours, such as 18.5.  [default: the recorded light]"),
    overlay: bool = option("Show speed and steering.", False, "--overlay"),
    height: float = option("Height of the Bird's Eye.", 3.0, metavar="M"),
    azimuth: float = option(
        "Direction from the x axis: of the position of the Orbit, or in which Fly looks.", 0.0, metavar="DEG"
    ),
    elevation: float | None = option(
        "Elevation of the Orbit, or of the direction in which Fly looks.  [default: 30, Fly: 0]", metavar="DEG"
    ),
    distance: float = option("Distance of the Orbit.", 1.0, metavar="M"),
    position: str = option("Position of Fly in the map [m].", "0,0,1", metavar="X,Y,Z"),
    codec: str | None = option("av1 or vp9.  [default: from the end of the file name]"),
    quality: str = option(
        "Quality of the images: auto, software, software-fxaa, small or gpu.", "auto", metavar="NAME"
    ),
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
