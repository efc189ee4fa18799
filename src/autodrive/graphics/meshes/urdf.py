"""URDF and meshes of a vehicle, generated from its Spec and its asset.

base_link is the vehicle frame: the centre of the rear axle at wheel-centre height. The link of a sensor or wheel is the
frame of its readings. Wheels turn in `<wheel>_wheel_joint`, the front ones are steered in `<wheel>_steering_joint`; the
suspension and the steering linkage are fixed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from autodrive.base.transforms import Quaternion, Vector, euler_from_quaternion
from autodrive.graphics.assets.asset import Asset, Material
from autodrive.graphics.meshes.urdf_inertia import Inertia, chassis, knuckle, wheel
from autodrive.graphics.meshes.urdf_mesh import Triangles, meshes_by_link, stl
from autodrive.physics.actuators.steering import ackermann_angle
from autodrive.physics.sensors.camera.camera import OPTICAL
from autodrive.physics.sensors.sensor import Mount
from autodrive.protocol.messages import WHEEL_NAMES
from autodrive.scenario.vehicles.spec import ColliderSpec, VehicleSpec

PACKAGE = "autodrive_description"
"""ROS package that contains the meshes."""
EFFORT = 1000.0
"""Effort limit of the steering joints [N m]. URDF requires it; the Spec does not limit the torque."""
VELOCITY = 1000.0
"""Velocity limit of the steering joints of a car without `SteeringSpec.rate_limit` [rad/s]; URDF requires one."""
NOT_TURNED: Quaternion = (1.0, 0.0, 0.0, 0.0)
SIDEWAYS: Quaternion = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
"""Turns a cylinder of URDF from z to y."""


def vehicle_urdf(spec: VehicleSpec, name: str, asset: Asset) -> tuple[str, dict[str, bytes]]:
    """The URDF of a vehicle with that name and asset, and its meshes: path in the package -> binary STL."""
    meshes = meshes_by_link(asset)
    robot = Element("robot", name=name)
    files: dict[str, bytes] = {}
    for material in sorted(
        {material for parts in meshes.values() for material in parts}, key=lambda material: material.name
    ):
        _add_material(robot, material)
    for element in (*_body(spec), *_wheels(spec), *_sensors(spec)):
        robot.append(element)
        for material, triangles in meshes.get(element.get("name", ""), {}).items() if element.tag == "link" else ():
            _add_visual(element, material, triangles, f"meshes/{name}", files)
    indent(robot, "  ")
    return f'<?xml version="1.0"?>\n{tostring(robot, encoding="unicode")}\n', files


def srgb(linear: float) -> float:
    """Linear to sRGB (IEC 61966-2-1)."""
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1.0 / 2.4) - 0.055


# -- links and joints -------------------------------------------------------------------------------------------


def _body(spec: VehicleSpec) -> Iterator[Element]:
    base = _link("base_link", chassis(spec))
    for box in spec.colliders.values():
        _add_collision_box(base, box)
    yield base


def _wheels(spec: VehicleSpec) -> Iterator[Element]:
    for name, hub in zip(WHEEL_NAMES, spec.hubs, strict=True):
        parent, place = "base_link", hub
        if name.startswith("front"):
            yield _link(f"{name}_steering", knuckle())
            joint = _joint(f"{name}_steering", parent, hub, kind="revolute", axis=(0.0, 0.0, 1.0))
            inner = ackermann_angle(spec.steering.largest_angle, spec.wheelbase, 0.5 * spec.track)
            velocity = VELOCITY if spec.steering.rate_limit is None else spec.steering.rate_limit
            limits = {"lower": -inner, "upper": inner, "effort": EFFORT, "velocity": velocity}
            SubElement(joint, "limit", {key: _text(value) for key, value in limits.items()})
            yield joint
            parent, place = f"{name}_steering", (0.0, 0.0, 0.0)
        link = _link(f"{name}_wheel", wheel(spec))
        collision = SubElement(link, "collision")
        _add_origin(collision, (0.0, 0.0, 0.0), SIDEWAYS)
        size = {"radius": _text(spec.wheels.radius), "length": _text(spec.wheels.width)}
        SubElement(SubElement(collision, "geometry"), "cylinder", size)
        yield link
        yield _joint(f"{name}_wheel", parent, place, kind="continuous", axis=(0.0, 1.0, 0.0))


def _sensors(spec: VehicleSpec) -> Iterator[Element]:
    """Links and joints of all sensors; the encoders are at the rear wheels."""
    sensors = spec.sensors
    mounts: dict[str, Mount] = {name: sensor.mount for name, sensor in sensors if hasattr(sensor, "mount")}
    mounts |= {f"{name}_camera": camera.mount for name, camera in spec.cameras.items()}
    for name, hub in zip(("left_encoder", "right_encoder"), spec.hubs[2:], strict=True):
        yield _link(name)
        yield _joint(name, "base_link", hub)
    for name, mount in mounts.items():
        yield _link(name)
        yield _joint(name, "base_link", mount.position, mount.orientation)
    for name in spec.cameras:
        optical = f"{name}_camera_optical_frame"
        yield _link(optical)
        yield _joint(optical, f"{name}_camera", (0.0, 0.0, 0.0), OPTICAL)


# -- elements --------------------------------------------------------------------------------------------------


def _link(name: str, inertia: Inertia | None = None) -> Element:
    link = Element("link", name=name)
    if inertia is not None:
        inertial = SubElement(link, "inertial")
        _add_origin(inertial, inertia.center)
        SubElement(inertial, "mass", value=_text(inertia.mass))
        moments = {f"i{'xyz'[i]}{'xyz'[j]}": _text(inertia.moments[i, j]) for i in range(3) for j in range(i, 3)}
        SubElement(inertial, "inertia", moments)
    return link


def _joint(
    child: str,
    parent: str,
    position: Vector,
    orientation: Quaternion = NOT_TURNED,
    *,
    kind: str = "fixed",
    axis: Vector | None = None,
) -> Element:
    joint = Element("joint", name=f"{child}_joint", type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    _add_origin(joint, position, orientation)
    if axis is not None:
        SubElement(joint, "axis", xyz=_text(*axis))
    return joint


def _add_origin(element: Element, position: Vector, orientation: Quaternion = NOT_TURNED) -> None:
    SubElement(element, "origin", xyz=_text(*position), rpy=_text(*euler_from_quaternion(orientation)))


def _add_collision_box(link: Element, box: ColliderSpec) -> None:
    collision = SubElement(link, "collision")
    _add_origin(collision, box.position)
    SubElement(SubElement(collision, "geometry"), "box", size=_text(*box.size))


def _add_material(robot: Element, material: Material) -> None:
    red, green, blue = map(srgb, material.color)
    SubElement(SubElement(robot, "material", name=material.name), "color", rgba=f"{red:.4f} {green:.4f} {blue:.4f} 1")


def _add_visual(link: Element, material: Material, mesh: Triangles, folder: str, files: dict[str, bytes]) -> None:
    """Equal meshes share a file, for example front and rear wheel of one side."""
    content = stl(mesh)
    path = next((path for path, known in files.items() if known == content), "")
    if not path:
        path = f"{folder}/{link.attrib['name']}_{material.name}.stl"
        files[path] = content
    visual = SubElement(link, "visual")
    SubElement(SubElement(visual, "geometry"), "mesh", filename=f"package://{PACKAGE}/{path}")
    SubElement(visual, "material", name=material.name)


def _text(*values: float) -> str:
    """Rounded to 12 digits, without -0."""
    return " ".join(f"{round(float(value), 12) + 0.0:.12g}" for value in values)
