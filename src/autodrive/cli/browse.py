"""The commands `list`, `show` and `check`: list, draw and check maps, modules, vehicles and scenarios."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias, cast

import typer

from autodrive.cli.options import Force, argument, check_end, check_outputs, option

if TYPE_CHECKING:
    from autodrive.scenario.kinds import Kind

Collection: TypeAlias = Literal["scenarios", "maps", "tracks", "vehicles", "modules", "rulesets"]
"""What `list` can list."""
KindName: TypeAlias = Literal["scenario", "map", "track", "vehicle", "module", "ruleset"]
"""What a YAML file can describe: `Kind`, without its imports."""


def list_(
    collection: Collection = argument("What to list.", ...),
    folder: Path | None = option(
        "Also list the scenarios, maps or tracks of that folder.", metavar="FOLDER", exists=True, file_okay=False
    ),
) -> None:
    """List the scenarios, maps, tracks, vehicles, modules or rules of races of the package."""
    from autodrive.cli.spec_files import SPECS
    from autodrive.scenario.kinds import titles

    kind = cast("Kind", collection.removesuffix("s"))
    for name, title in titles(kind, SPECS[kind]).items():
        typer.echo(f"{name:<24} {title}".rstrip())
    if folder is not None:
        from autodrive.run.own_files import UserFiles

        for name, file in UserFiles(folder).listed().items():
            if file.kind == kind:
                typer.echo(f"{folder / name!s:<24} {file.title}".rstrip())


def show(
    name: str = argument("Name of a map, track, module, vehicle or scenario, or its file.", ...),
    kind: KindName | None = option("What the name refers to, if several kinds use it."),
    output: Path | None = option(
        "PNG or SVG file of the drawing.  [default: NAME.png]", None, "--output", "-o", metavar="FILE"
    ),
    in_3d: Path | None = option("Render a 3D image; works for all kinds.", None, "--3d", metavar="FILE.png"),
    night: bool = option("With --3d: render the scene at night.", False, "--night"),
    occupancy: Path | None = option(
        "Write an occupancy grid for the ROS map_server: NAME.png and NAME.yaml.", metavar="FOLDER"
    ),
    labels: Path | None = option("Write a top-down semantic label image as PNG.", metavar="FILE.png"),
    yaml: bool = option("Print the YAML file.", False, "--yaml"),
    force: Force = False,
) -> None:
    """Draw a map, track or module; print a vehicle, a scenario or the rules of a race as a table."""
    from autodrive.cli import spec_files

    kind_of_file = kind or spec_files.kind_of_name(name)
    if yaml:
        from autodrive.scenario.kinds import find

        typer.echo(find(kind_of_file, name).read_text(encoding="utf-8"), nl=False)
        return
    rasters = occupancy or labels
    for text, is_wrong in {
        "--output is for images of maps and modules": output and kind_of_file in {"vehicle", "ruleset"},
        "--occupancy and --labels are for maps, modules and scenarios": rasters
        and kind_of_file in {"vehicle", "ruleset"},
        "--3d is not for rules": in_3d and kind_of_file == "ruleset",
    }.items():
        if is_wrong:
            raise typer.BadParameter(f"{text}; '{name}' is a {kind_of_file}")
    check_end("--output", output, ".png", ".svg")
    check_end("--3d", in_3d, ".png")
    check_end("--labels", labels, ".png")
    title = f"{kind_of_file} '{Path(name).stem}'"
    if output is None and kind_of_file in {"map", "track", "module"} and not (in_3d or rasters):
        output = Path(f"{Path(name).stem}.png")
    map_ = spec_files.map_of(kind_of_file, name) if rasters else None
    grid = [occupancy / f"{map_.name}{suffix}" for suffix in (".png", ".yaml")] if map_ and occupancy else []
    check_outputs(output, in_3d, labels, *grid, is_forced=force)
    if in_3d is not None:
        from autodrive.cli.preview import render_preview

        render_preview(kind_of_file, name, in_3d, is_day=not night)
        typer.echo(f"wrote {title} to {in_3d}")
    if map_ is not None:
        from autodrive.scenario.maps import raster

        if occupancy is not None:
            typer.echo(f"wrote the occupancy grid of {title} to {raster.write_occupancy(map_, occupancy)}")
        if labels is not None:
            raster.write_labels(map_, labels)
            typer.echo(f"wrote the labels of {title} to {labels}")
    if output is not None:
        spec_files.draw(kind_of_file, name, output)
        typer.echo(f"wrote {title} to {output}")
        if kind_of_file == "module":
            for line in spec_files.size_and_ports(name):
                typer.echo(line)
    if output or in_3d or rasters:
        return
    rows = list(spec_files.fields(kind_of_file, name))
    width = max(len(field) for field, _ in rows)
    for field, value in rows:
        typer.echo(f"{field:<{width}}  {value}".rstrip())


def check(
    name: str = argument("Name of a scenario, map, track, vehicle or module, or its file.", ...),
    kind: KindName | None = option(
        "What the name refers to.  [default: a scenario; of a file: detected from its keys]"
    ),
) -> None:
    """Check a scenario, map, track, vehicle or module and all files that it refers to; report all errors."""
    from autodrive.cli import spec_files

    kind_of_file, title, warnings = spec_files.check(name, kind)
    for warning in warnings:
        typer.echo(f"autodrive: warning: {warning}", err=True)
    titled = f" '{title}'" if title else ""
    typer.echo(f"{name}: {kind_of_file}{titled} is valid")
