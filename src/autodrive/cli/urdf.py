"""The command `urdf`: writes the robot description of vehicles for ROS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from autodrive.base.cache import make_folder, write_file
from autodrive.cli.options import Force, check_outputs


def urdf(
    names: Annotated[list[str], typer.Argument(help="Names of vehicles, or paths of their YAML files.")],
    output: Annotated[Path, typer.Option(help="Folder of a ROS package called autodrive_description.")],
    force: Force = False,
) -> None:
    """Write the robot description of vehicles for ROS: URDF and meshes."""
    from autodrive.graphics.meshes.urdf import package_files
    from autodrive.scenario.vehicles.spec import load_vehicle

    files = package_files({Path(name).stem: load_vehicle(name) for name in names})
    check_outputs(*(output / path for path in files), is_forced=force)
    for path, content in files.items():
        make_folder((output / path).parent)
        write_file(output / path, content)
    typer.echo(f"wrote {len(files)} files to {output}")
