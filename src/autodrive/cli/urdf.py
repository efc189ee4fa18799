"""The command `urdf`: writes the robot description of vehicles for ROS."""

from __future__ import annotations

from pathlib import Path

import typer

from autodrive.base.cache import make_folder, write_file
from autodrive.cli.options import Force, argument, check_outputs, option


def urdf(
    output: Path = option("Folder of a ROS package called autodrive_description.", ...),
    names: list[str] | None = argument(
        "Names of vehicles, or paths of their YAML files.  [default: all vehicles of the simulator]"
    ),
    force: Force = False,
) -> None:
    """Write the robot description of vehicles for ROS: URDF and meshes."""
    from autodrive.graphics.meshes.store import description
    from autodrive.scenario.kinds import names as names_of
    from autodrive.scenario.vehicles.spec import load_vehicle

    described = [description(load_vehicle(name), Path(name).stem) for name in names or names_of("vehicle")]
    files = {path: content for content_of in described for path, content in content_of.items()}
    check_outputs(*(output / path for path in files), is_forced=force)
    for path, content in files.items():
        make_folder((output / path).parent)
        write_file(output / path, content)
    typer.echo(f"wrote {len(files)} files to {output}")
