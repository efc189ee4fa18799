"""Builds the asset of a vehicle from its Spec.

The asset is in the vehicle frame: x forward, y left, z up, origin at the centre of the rear axle. Nodes that move:
hub_<wheel> (suspension), steer_<wheel>, wheel_<wheel>, servo_horn, tie_rod_<side>, drag_link; lamp_<lamp> emits light.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from autodrive.graphics.assets.asset import Asset, AssetNode, Detail, Material, MeshSurface, NodeJoint
from autodrive.graphics.meshes.mesh_builder import MeshBuilder, surfaces_by_detail
from autodrive.graphics.meshes.solids import box, cylinder, lathe, surface
from autodrive.graphics.meshes.vehicle_boards import add_camera, add_computer, add_lidar, add_lidar_head, add_wires
from autodrive.graphics.meshes.vehicle_chassis import add_battery, add_drive, add_platforms, add_servo, add_standoffs
from autodrive.graphics.meshes.vehicle_materials import VEHICLE_MATERIALS
from autodrive.graphics.meshes.vehicle_racer import add_racer, add_racer_lidar_window
from autodrive.graphics.meshes.vehicle_steering import add_knuckle, linkage
from autodrive.graphics.meshes.vehicle_wheel import add_wheel
from autodrive.physics.actuators.lights import LAMPS
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import WHEEL_NAMES
from autodrive.scenario.vehicles.spec import VehicleSpec

LENS = 0.0029
"""Radius of a lamp [m]: 5 mm LEDs with a rim."""
GLOW = {"head": 6.0, "high_beam": 6.0, "front_indicator": 5.0, "rear_indicator": 5.0, "tail": 4.0, "reverse": 4.0}
"""Emission of each lamp when it is on; our values."""


def vehicle_asset(spec: VehicleSpec) -> Asset:
    """The asset of a vehicle in three levels of detail."""
    return Asset("vehicle", tuple(_nodes(spec)))


def _nodes(spec: VehicleSpec) -> Iterator[AssetNode]:
    yield AssetNode(
        "body", surfaces={**surfaces_by_detail(lambda builder: _add_body(builder, spec)), "shadow": _shadow(spec)}
    )
    if spec.sensors.lidar is not None:
        head = add_racer_lidar_window if spec.is_race_car else add_lidar_head
        yield AssetNode("lidar_head", "body", spec.sensors.lidar.mount.position, surfaces=surfaces_by_detail(head))
    wheels = {outside: _wheel(spec, outside) for outside in (1.0, -1.0)}
    for name, hub in zip(WHEEL_NAMES, spec.hubs, strict=True):
        outside, carrier = math.copysign(1.0, hub[1]), f"hub_{name}"
        yield AssetNode(carrier, "body", hub, joint=NodeJoint("slide", f"compression_{name}"))
        if name.startswith("front"):
            knuckle = surfaces_by_detail(lambda builder, out=outside: add_knuckle(builder, spec, out))
            turn = NodeJoint("hinge", f"steering_{name}")
            yield AssetNode(f"steer_{name}", carrier, joint=turn, surfaces=knuckle)
            carrier = f"steer_{name}"
        spin = NodeJoint("hinge", f"spin_{name}", axis=(0.0, 1.0, 0.0))
        yield AssetNode(f"wheel_{name}", carrier, joint=spin, surfaces=wheels[outside])
    yield from linkage(spec)
    for lamp in LAMPS:
        yield _lamp(spec, lamp)


def _add_body(builder: MeshBuilder, spec: VehicleSpec) -> None:
    for bumper in spec.bumpers:
        builder.add("matt_black", box(bumper.size, bumper.position))
    if spec.is_race_car:
        add_racer(builder, spec)
        return
    add_platforms(builder, spec)
    add_standoffs(builder, spec)
    if len(spec.platforms) >= 4:
        add_drive(builder, spec)
        add_battery(builder, spec)
        add_servo(builder, spec)
        add_computer(builder, spec)
        if builder.has_small_parts:
            add_wires(builder, spec)
        add_lidar(builder, spec)
    for camera in spec.cameras.values():
        add_camera(builder, camera, spec)
    _add_lamp_brackets(builder, spec)


def _shadow(spec: VehicleSpec) -> tuple[MeshSurface, ...]:
    """A few closed shapes with nearly the same shadow."""
    parts = [box(platform.size, platform.position) for platform in (*spec.platforms, *spec.bumpers)]
    if spec.sensors.lidar is not None:
        x, y, z = spec.sensors.lidar.mount.position
        parts.append(cylinder(0.034, 0.065, (x, y, z - 0.017), n=14))
    low, high = spec.platforms[0].position, spec.platforms[-1].position
    parts.append(box((0.12, 0.045, high[2] - low[2]), (low[0] + 0.03, 0.0, 0.5 * (low[2] + high[2]))))
    return (surface(parts, VEHICLE_MATERIALS["black"], Label.VEHICLE),)


def _wheel(spec: VehicleSpec, outside: float) -> dict[Detail, tuple[MeshSurface, ...]]:
    radius, width = spec.wheels.radius, spec.wheels.width
    rim = "racer_rim" if spec.is_race_car else "rim"
    details = surfaces_by_detail(lambda builder: add_wheel(builder, radius, width, outside, rim))
    proxy = surface([cylinder(radius, width, axis="y", n=18)], VEHICLE_MATERIALS["rubber"], Label.VEHICLE)
    return {**details, "shadow": (proxy,)}


# -- lamps ------------------------------------------------------------------------------------------------------


def _lamp(spec: VehicleSpec, lamp: str) -> AssetNode:
    """The lens of a lamp: a dome that faces forward or backward."""
    name, side = lamp.rsplit("_", 1)
    own = getattr(spec.lights, name)
    x, y, z = own.position
    ahead = name in {"head", "high_beam", "front_indicator"}
    red, green, blue = own.color
    glow, share, least = GLOW[name], *((0.55, 0.10) if red == blue else (0.45, 0.0))
    glass = Material(
        f"lamp_{name}",
        (least + share * red, least + share * green, least + share * blue),
        roughness=0.2,
        emission=(glow * red, glow * green, glow * blue),
    )

    def add_lens(builder: MeshBuilder) -> None:
        steps = 6 if builder.has_small_parts else 3
        turns = [0.5 * math.pi * i / steps for i in range(steps + 1)]
        dome = [(LENS * math.cos(a), 0.0030 + 0.0030 * math.sin(a)) for a in turns]
        profile = [(0.0, -0.0030), (LENS, -0.0030), *dome[:-1], (0.0, dome[-1][1])]
        builder.add(glass, lathe(profile, axis="x" if ahead else "-x", n=builder.around(0.4)))

    place = (x, y if side == "left" else -y, z)
    return AssetNode(f"lamp_{lamp}", "body", place, lamp=lamp, surfaces=surfaces_by_detail(add_lens))


def _add_lamp_brackets(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """A bar for each group of lamps, held by struts from the platform above."""
    lights = spec.lights
    for members, back in (
        ((lights.head, lights.high_beam, lights.front_indicator), -1.0),
        ((lights.tail, lights.reverse, lights.rear_indicator), 1.0),
    ):
        xs, ys, zs = zip(*(lamp.position for lamp in members), strict=True)
        x, z = (min(xs) if back < 0.0 else max(xs)) + back * 0.0045, sum(zs) / len(zs)
        width = max(ys) - min(ys) + 4.0 * LENS
        above = min((platform.position[2] for platform in spec.platforms if platform.position[2] > z), default=z + 0.01)
        for side in (-1.0, 1.0):
            y = side * 0.5 * (max(ys) + min(ys))
            builder.add("black", box((0.0035, width, 3.6 * LENS), (x, y, z)))
            builder.add("acrylic", box((0.0030, 0.4 * width, above - z), (x + back * 0.003, y, 0.5 * (above + z))))
