"""The commands `list`, `show` and `check`: list, draw and check maps, modules, vehicles and scenarios."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

if TYPE_CHECKING:
    from autodrive.base.yaml_files import Kind


class Collection(StrEnum):
    """What `list` can list."""

    scenarios = "scenarios"
    maps = "maps"
    tracks = "tracks"
    vehicles = "vehicles"
    modules = "modules"
    rulesets = "rulesets"


class KindName(StrEnum):
    """What a YAML file can describe."""

    scenario = "scenario"
    map = "map"
    track = "track"
    vehicle = "vehicle"
    module = "module"
    ruleset = "ruleset"


def list_(collection: Annotated[Collection, typer.Argument(help="What to list.")]) -> None:
    """List the scenarios, maps, tracks, vehicles, modules or rules of races of the package."""
    from autodrive.base.yaml_files import titles
    from autodrive.cli.spec_files import SPECS

    kind = cast("Kind", collection.value.removesuffix("s"))
    for name, title in titles(kind, SPECS[kind]).items():
        typer.echo(f"{name:<24} {title}".rstrip())


def show(
    name: Annotated[str, typer.Argument(help="Name of a map, track, module, vehicle or scenario, or its file.")],
    kind: Annotated[KindName | None, typer.Option(help="What the name refers to, if several kinds use it.")] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="PNG or SVG file of the drawing.  [default: NAME.png]"),
    ] = None,
    in_3d: Annotated[
        Path | None, typer.Option("--3d", metavar="FILE.png", help="Render a 3D image; works for all kinds.")
    ] = None,
    night: Annotated[bool, typer.Option("--night", help="With --3d: render the scene at night.")] = False,
    occupancy: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write an occupancy grid for the ROS map_server: NAME.png and NAME.yaml."),
    ] = None,
    labels: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Write a top-down semantic label image as PNG.")
    ] = None,
    yaml: Annotated[bool, typer.Option("--yaml", help="Print the YAML file.")] = False,
) -> None:
    """Draw a map, track or module; print a vehicle, a scenario or the rules of a race as a table."""
    from autodrive.cli import spec_files

    found = cast("Kind", kind.value) if kind else spec_files.kind_of_name(name)
    if yaml:
        from autodrive.base.yaml_files import find

        typer.echo(find(found, name).read_text(encoding="utf-8"), nl=False)
        return
    if output is not None and found in {"vehicle", "ruleset"}:
        raise typer.BadParameter(f"--output is for images of maps and modules; '{name}' is a {found}")
    path = output or Path(f"{Path(name).stem}.png")
    if path.suffix.lower() not in {".png", ".svg"}:
        raise typer.BadParameter(f"--output must end in .png or .svg, not '{path.suffix}'")
    if in_3d is not None:
        _show_3d(found, name, in_3d, is_day=not night)
    if occupancy is not None or labels is not None:
        _write_rasters(found, name, occupancy, labels)
    if output is None and not (in_3d is None and occupancy is None and labels is None):
        return
    if found in {"map", "track", "module"} or output is not None:
        spec_files.draw(found, name, path)
        typer.echo(f"wrote {found} '{Path(name).stem}' to {path}")
        if found == "module":
            for line in spec_files.size_and_ports(name):
                typer.echo(line)
        return
    rows = list(spec_files.fields(found, name))
    width = max(len(field) for field, _ in rows)
    for field, value in rows:
        typer.echo(f"{field:<{width}}  {value}".rstrip())


def check(
    name: Annotated[str, typer.Argument(help="Name of a scenario, map, track, vehicle or module, or its file.")],
    kind: Annotated[
        KindName | None,
        typer.Option(help="What the name refers to.  [default: a scenario; of a file: detected from its keys]"),
    ] = None,
) -> None:
    """Check a scenario, map, track, vehicle or module and all files that it refers to; report all errors."""
    from autodrive.cli import spec_files

    found, title, warnings = spec_files.check(name, cast("Kind | None", kind and kind.value))
    for warning in warnings:
        typer.echo(f"autodrive: warning: {warning}", err=True)
    typer.echo(f"{name}: {found} '{title}' is valid")


def _write_rasters(kind: Kind, name: str, folder: Path | None, labels: Path | None) -> None:
    from autodrive.cli import spec_files

    if kind in {"vehicle", "ruleset"}:
        raise typer.BadParameter(f"--occupancy and --labels are for maps, modules and scenarios; '{name}' is a {kind}")
    if labels is not None and labels.suffix.lower() != ".png":
        raise typer.BadParameter(f"--labels must end in .png, not '{labels.suffix}'")
    if folder is not None:
        path = spec_files.write_occupancy(kind, name, folder)
        typer.echo(f"wrote the occupancy grid of {kind} '{Path(name).stem}' to {path}")
    if labels is not None:
        spec_files.write_labels(kind, name, labels)
        typer.echo(f"wrote the labels of {kind} '{Path(name).stem}' to {labels}")


def _show_3d(kind: Kind, name: str, path: Path, *, is_day: bool) -> None:
    from autodrive.cli.preview import render_preview

    if kind == "ruleset":
        raise typer.BadParameter(f"--3d is not for rules; '{name}' is a {kind}")
    if path.suffix.lower() != ".png":
        raise typer.BadParameter(f"--3d must end in .png, not '{path.suffix}'")
    render_preview(kind, name, path, is_day=is_day)
    typer.echo(f"wrote {kind} '{Path(name).stem}' to {path}")
