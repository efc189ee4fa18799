"""The parameters of the bridge's node: one for each thing that can be chosen of `autodrive.ros.Config`."""

from __future__ import annotations

import ast
import inspect
import textwrap
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from autodrive.ros import Config

OWN = {
    "cmd_vel_is_stamped": (False, "Whether cmd_vel is a TwistStamped, as of Nav2 with enable_stamped_cmd_vel."),
    "services": (True, "Whether the services after simulation_interfaces are offered; direct mode."),
}
"""Those that are the node's and not the bridge's, with their defaults."""


def defaults() -> dict[str, tuple[Any, str]]:
    """All parameters: name -> default and what it is."""
    texts = _texts()
    chosen = {one.name: (one.default, texts.get(one.name, "")) for one in fields(Config) if one.default is not MISSING}
    return chosen | OWN


def declare(node: Node) -> tuple[Config, dict[str, Any]]:
    """What a node was given, as a Config, and the values of `OWN`. Raises AutodriveError if something does not fit."""
    values: dict[str, Any] = {}
    for name, (default, text) in defaults().items():
        descriptor = ParameterDescriptor(description=text, read_only=True, dynamic_typing=True)
        value = node.declare_parameter(name, default, descriptor).value
        values[name] = type(default)(value)
    values["robot_description"] = _urdf(values["robot_description"], values["vehicle_type"], node)
    own = {name: values.pop(name) for name in OWN}
    return Config(**values), own


def _urdf(told: str, vehicle: str, node: Node) -> str:
    """The text that was given, or of the file that was named, or of the package autodrive_description."""
    if told.lstrip().startswith("<"):
        return told
    try:
        file = Path(told or f"{get_package_share_directory('autodrive_description')}/urdf/{vehicle}.urdf")
        return file.read_text()
    except (PackageNotFoundError, OSError) as error:
        node.get_logger().warning(
            f"no robot description, so no frames of sensors and wheels ({error}): build the package "
            "autodrive_description, or name a file by the parameter robot_description"
        )
        return ""


def _texts() -> dict[str, str]:
    """Field of Config -> the sentence below it."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(Config))).body
    assert isinstance(tree, ast.ClassDef)
    texts: dict[str, str] = {}
    for field, below in zip(tree.body, tree.body[1:], strict=False):
        is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and is_text:
            texts[field.target.id] = " ".join(str(below.value.value).split())
    return texts
