"""Parameters of the bridge node: one for each field of `autodrive.ros.Config`."""

from __future__ import annotations

import ast
import inspect
import textwrap
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from autodrive.ros import Config

OWN = {
    "cmd_vel_is_stamped": (False, "Whether cmd_vel is a TwistStamped, as in Nav2 with enable_stamped_cmd_vel."),
    "services": (True, "Whether the services of simulation_interfaces are offered; direct mode without `race`."),
}
"""Parameters of the node that are not in Config: name -> default and description."""


def defaults() -> dict[str, tuple[Any, str]]:
    """All parameters: name -> default and description."""
    texts = _texts()
    chosen = {one.name: (one.default, texts.get(one.name, "")) for one in fields(Config) if one.default is not MISSING}
    return chosen | OWN


def declare(node: Node) -> tuple[Config, dict[str, Any]]:
    """Declare the parameters; the Config, and the values of `OWN`. Raises AutodriveError for an invalid value."""
    values: dict[str, Any] = {}
    for name, (default, text) in defaults().items():
        descriptor = ParameterDescriptor(description=text, read_only=True, dynamic_typing=True)
        value = node.declare_parameter(name, default, descriptor).value
        values[name] = type(default)(value)
    own = {name: values.pop(name) for name in OWN}
    config = Config(**values)
    return replace(config, robot_description=_urdf(config, node)), own


def _urdf(config: Config, node: Node) -> str:
    """The given text, or the content of the given file; in devkit mode else the URDF of autodrive_description."""
    given = config.robot_description
    if given.lstrip().startswith("<") or (not given and config.mode == "direct"):
        return given
    try:
        own = given or f"{get_package_share_directory('autodrive_description')}/urdf/{config.car.name}.urdf"
        return Path(own).read_text(encoding="utf-8")
    except (PackageNotFoundError, OSError) as error:
        node.get_logger().warning(
            f"no robot description, so no frames of sensors and wheels ({error}). Build the package "
            "autodrive_description, or set the parameter robot_description to a URDF file"
        )
        return ""


def _texts() -> dict[str, str]:
    """Field of Config -> its docstring."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(Config))).body
    assert isinstance(tree, ast.ClassDef)
    texts: dict[str, str] = {}
    for field, below in zip(tree.body, tree.body[1:], strict=False):
        if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
            continue
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            texts[field.target.id] = " ".join(str(below.value.value).split())
    return texts
