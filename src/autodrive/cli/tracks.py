"""The commands `import track`, `export track` and `generate track`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from autodrive.base.errors import AutodriveError
from autodrive.cli.options import Force, argument, check_end, check_outputs, filled, option

if TYPE_CHECKING:
    from autodrive.scenario.tracks.track import BarrierSpec, Track

importing = typer.Typer(help="Import a file of another program.", no_args_is_help=True, add_completion=False)
exporting = typer.Typer(help="Write a file for another program.", no_args_is_help=True, add_completion=False)
generating = typer.Typer(help="Generate a random map.", no_args_is_help=True, add_completion=False)

Barrier = Annotated[str, typer.Option(metavar="wall|duct", help="What stands along the edges.")]
DuctGap = Annotated[float, typer.Option(metavar="M", help="Gap between two air ducts of 0.33 m [m].", min=0, max=10)]
DuctLength = Annotated[float, typer.Option(metavar="M", help="Length of an air duct [m].", min=0.1, max=100)]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FILE", help="File of the track.  [default: NAME.yaml]")
]
RaceLine = Annotated[bool, typer.Option("--race-line", help="Compute a race line if the files have no race line.")]


@importing.command("track")
def import_track(
    path: Path = argument(
        "Folder of f1tenth_racetracks, YAML file or picture of the ROS map_server, or CSV file of a centre line.", ...
    ),
    output: Output = None,
    name: str = option("Name of the track.  [default: that of the folder or file]", ""),
    tolerance: float = option("Largest distance of a wall from the contour [m].", 0.02, metavar="M", min=0.001, max=1),
    close: float = option("Close openings of the walls that are narrower than M [m].", 0.0, metavar="M", min=0, max=2),
    width: float | None = option("Width, for a centre line without widths [m].", metavar="M", min=0.1, max=100),
    resolution: float | None = option(
        "Edge of a pixel of a picture without a YAML file [m].", metavar="M", min=0.0001, max=10
    ),
    start: str | None = option("A point near the start line [m].", metavar="X,Y"),
    reverse: bool = option("Drive in the other direction.", False, "--reverse"),
    barrier: Barrier = "wall",
    gap: DuctGap = 0.0,
    duct_length: DuctLength = 3.0,
    race_line: RaceLine = False,
    force: Force = False,
) -> None:
    """Import a race track: walls, centre line and race line, with checks."""
    arguments = locals()
    from autodrive.scenario.tracks import importer

    check_end("--output", output, ".yaml", ".yml")
    sources = importer.find_sources(path)
    file = output or Path(f"{name or sources.name}.yaml")
    if any(file.exists() and file.samefile(source) for source in sources.files):
        raise AutodriveError(
            f"the track would replace the file that it is made from: choose another --output  ({file})"
        )
    check_outputs(file, is_forced=force)
    options = filled(
        importer.ImportOptions,
        arguments,
        gap=close,
        barrier=_barrier(barrier, gap, duct_length),
        start=_pair(start, ",", "--start", "X,Y such as 1.5,-2") if start else None,
        is_reversed=reverse,
    )
    track, warnings = importer.import_track(path, options)
    for warning in warnings:
        typer.echo(f"autodrive: warning: {warning}", err=True)
    pieces = sum(map(len, track.walls))
    _save(track, file, f", {len(track.walls)} walls of {pieces} pieces", has_race_line=race_line)


@exporting.command("track")
def export_track(
    name: str = argument("Name of a track, or path of its YAML file.", ...),
    folder: Path | None = option("Where to write.  [default: NAME]", None, "--output", "-o", metavar="FOLDER"),
    resolution: float = option("Edge of a pixel [m].", 0.05, metavar="M", min=0.001, max=1),
    force: Force = False,
) -> None:
    """Write a track as in f1tenth_racetracks: NAME_map.yaml, NAME_map.png, NAME_centerline.csv, NAME_raceline.csv."""
    from autodrive.scenario.tracks import importer
    from autodrive.scenario.tracks.track import Track

    track = Track.load(name)
    folder = folder or Path(track.name)
    check_outputs(*importer.export_files(track, folder), is_forced=force)
    for path in importer.export_track(track, folder, resolution=resolution):
        typer.echo(f"wrote {path}")


@generating.command("track")
def generate_track(
    seed: int = option("The same seed gives the same track.", 0, min=0, max=2**63 - 1),
    length: float = option("Length of the centre line [m], within 5 %.", 60.0, metavar="M"),
    width: float = option("Width between the barriers [m], at least 0.9.", 1.2, metavar="M"),
    area: str = option("Extent along x and y, barriers included [m].", "30x10", metavar="AxB"),
    min_radius: float | None = option("Smallest radius of the centre line [m].  [default: the width]", metavar="M"),
    barrier: Barrier = "duct",
    gap: DuctGap = 0.03,
    duct_length: DuctLength = 3.0,
    race_line: RaceLine = False,
    output: Output = None,
    force: Force = False,
) -> None:
    """Make a random closed track."""
    from autodrive.scenario.tracks import generate

    check_end("--output", output, ".yaml", ".yml")
    track = generate.generate_track(
        seed,
        length=length,
        width=width,
        area=_pair(area, "x", "--area", "AxB such as 30x10"),
        min_radius=min_radius,
        barrier=_barrier(barrier, gap, duct_length),
        name=output.stem if output else "",
    )
    file = output or Path(f"{track.name}.yaml")
    check_outputs(file, is_forced=force)
    _save(track, file, has_race_line=race_line)


def _save(track: Track, file: Path, walls: str = "", *, has_race_line: bool) -> None:
    from autodrive.scenario.tracks.race_line import with_race_line

    if has_race_line and track.race_line is None:
        track = with_race_line(track)
    track.save(file)
    typer.echo(f"wrote {file}: {track.length:.1f} m{walls}. Next:\n  autodrive show {file}")


def _barrier(kind: str, gap: float, length: float) -> BarrierSpec:
    from autodrive.scenario.tracks.track import DUCT, BarrierSpec

    if kind == "wall":
        return BarrierSpec()
    if kind != "duct":
        raise typer.BadParameter(f"--barrier must be wall or duct, not '{kind}'")
    return DUCT.model_copy(update={"gap": gap, "length": length if gap else None})


def _pair(text: str, separator: str, option: str, form: str) -> tuple[float, float]:
    number = r"\s*([-+]?\d+(?:\.\d*)?)\s*"
    match = re.fullmatch(f"{number}{separator}{number}", text)
    if match is None:
        raise typer.BadParameter(f"{option} must be {form}, not '{text}'")
    return float(match[1]), float(match[2])
