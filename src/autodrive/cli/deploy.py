"""The command `deploy`: a policy for a real car, as a folder."""

from __future__ import annotations

from pathlib import Path

import typer

from autodrive.cli.options import Force, argument, check_outputs, option


def deploy(
    policy: str = argument("Name of an included policy, or a file (.npz, .onnx).", ...),
    vehicle: str = option("Name or file of the vehicle with which the policy was trained.", "roboracer"),
    car: str | None = option(
        "Name or file of the vehicle that describes the car: its sizes, LIDAR and limits.  [default: --vehicle]",
        metavar="NAME",
    ),
    output: Path | None = option("Folder to write.  [default: POLICY_car]", None, "--output", "-o", metavar="FOLDER"),
    changes: list[str] = option("A setting of the car, such as drive_topic=/drive.", [], "--set", metavar="NAME=VALUE"),
    force: Force = False,
) -> None:
    """Write a folder that drives a real car with a policy, by ROS 2, ROS 1 or the devkit."""
    from autodrive.experiments.deployment.deploy import NODES
    from autodrive.experiments.deployment.deploy import deploy as write

    folder = output or Path(f"{Path(policy).stem}_car")
    check_outputs(*(folder / name for name in ("settings.json", "driver.py", *NODES)), is_forced=force)
    write(policy, folder, vehicle=vehicle, car=car, changes=changes)
    typer.echo(f"wrote {folder}. Next, on the car:  python3 {folder.name}/ros2_node.py --dry-run")
