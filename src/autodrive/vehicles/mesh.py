"""How a vehicle looks, from the numbers that it is driven, hit and sensed by.

The vehicle frame is the asset's: x forward, y left, z up from the middle of the rear axle. Nodes that move: hub_<wheel>
(with the suspension), steer_<wheel>, wheel_<wheel>, servo_horn, tie_rod_<side>, drag_link; lamp_<lamp> gives off light.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from autodrive.actuators.lights import LAMPS
from autodrive.render.asset import Asset, Detail, Joint, Label, Material, Node, Surface
from autodrive.render.solids import box, cylinder, lathe, surface
from autodrive.vehicles.mesh_boards import add_camera, add_computer, add_lidar, add_lidar_head, add_wires
from autodrive.vehicles.mesh_chassis import add_battery, add_drive, add_platforms, add_servo, add_standoffs
from autodrive.vehicles.mesh_materials import ACRYLIC, BLACK, RUBBER
from autodrive.vehicles.mesh_pile import FINENESS, Fineness, Pile, made
from autodrive.vehicles.mesh_steering import add_knuckle, linkage
from autodrive.vehicles.mesh_wheel import wheel
from autodrive.vehicles.spec import VehicleSpec

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
LENS = 0.0029
"""Radius of a lamp: LEDs of 5 mm with a rim [m]."""
GLOW = {"head": 6.0, "high_beam": 6.0, "front_indicator": 5.0, "rear_indicator": 5.0, "tail": 4.0, "reverse": 4.0}
"""How much light a lamp shows when it is lit; ours."""


def vehicle_asset(spec: VehicleSpec) -> Asset:
    """The car in three levels of detail."""
    return Asset("vehicle", tuple(_nodes(spec)))


def _nodes(spec: VehicleSpec) -> Iterator[Node]:
    yield Node("body", surfaces={**made(lambda pile, fine: _add_body(pile, spec, fine)), "shadow": _shadow(spec)})
    if spec.sensors.lidar is not None:
        place = spec.sensors.lidar.mount.position
        yield Node("lidar_head", "body", place, surfaces=made(lambda pile, fine: add_lidar_head(pile, spec, fine)))
    wheels = {outside: _wheel(spec, outside) for outside in (1.0, -1.0)}
    for name, hub in zip(WHEELS, spec.hubs, strict=True):
        outside = math.copysign(1.0, hub[1])
        yield Node(f"hub_{name}", "body", hub, joint=Joint("slide", f"compression_{name}"))
        if name.startswith("front"):
            knuckle = made(lambda pile, fine, out=outside: add_knuckle(pile, spec, out, fine))
            yield Node(f"steer_{name}", f"hub_{name}", joint=Joint("hinge", f"steering_{name}"), surfaces=knuckle)
        carrier = f"steer_{name}" if name.startswith("front") else f"hub_{name}"
        spin = Joint("hinge", f"spin_{name}", axis=(0.0, 1.0, 0.0))
        yield Node(f"wheel_{name}", carrier, joint=spin, surfaces=wheels[outside])
    yield from linkage(spec)
    for lamp in LAMPS:
        yield _lamp(spec, lamp)


def _add_body(pile: Pile, spec: VehicleSpec, fine: Fineness) -> None:
    add_platforms(pile, spec, fine)
    add_standoffs(pile, spec, fine)
    if len(spec.platforms) >= 4:
        add_drive(pile, spec, fine)
        add_battery(pile, spec, fine)
        add_servo(pile, spec, fine)
        add_computer(pile, spec, fine)
        if fine.has_small:
            add_wires(pile, spec)
        add_lidar(pile, spec, fine)
    for camera in spec.cameras.values():
        add_camera(pile, camera, spec, fine)
    _add_lamp_brackets(pile, spec)


def _shadow(spec: VehicleSpec) -> tuple[Surface, ...]:
    """Few closed boxes that throw nearly the same shadow."""
    parts = [box(one.size, one.position) for one in spec.platforms]
    if spec.sensors.lidar is not None:
        x, y, z = spec.sensors.lidar.mount.position
        parts.append(cylinder(0.034, 0.065, (x, y, z - 0.017), n=14))
    low, high = spec.platforms[0].position, spec.platforms[-1].position
    parts.append(box((0.12, 0.045, high[2] - low[2]), (low[0] + 0.03, 0.0, 0.5 * (low[2] + high[2]))))
    return (surface(parts, BLACK, Label.VEHICLE),)


def _wheel(spec: VehicleSpec, outside: float) -> dict[Detail, tuple[Surface, ...]]:
    radius, width = spec.wheels.radius, spec.wheels.width

    def add(pile: Pile, fine: Fineness) -> None:
        parts = wheel(radius, width, outside, fine.around(0.9), has_small=fine.has_small)
        for material, meshes in parts.items():
            pile.add(material, *meshes)

    proxy = surface([cylinder(radius, width, axis="y", n=18)], RUBBER, Label.VEHICLE)
    return {**made(add), "shadow": (proxy,)}


# -- lamps ------------------------------------------------------------------------------------------------------


def _lamp(spec: VehicleSpec, lamp: str) -> Node:
    """The glass of a lamp, a dome that looks ahead or back."""
    name, side = lamp.rsplit("_", 1)
    own = getattr(spec.lights, name)
    x, y, z = own.position
    ahead = name in {"head", "high_beam", "front_indicator"}
    red, green, blue = own.color
    glow = GLOW[name]
    glass = Material(
        f"lamp_{name}",
        (0.10 + 0.55 * red, 0.10 + 0.55 * green, 0.10 + 0.55 * blue)
        if red == blue
        else (0.45 * red, 0.45 * green, 0.45 * blue),
        roughness=0.2,
        emission=(glow * red, glow * green, glow * blue),
    )
    surfaces: dict[Detail, tuple[Surface, ...]] = {}
    for detail, fine in FINENESS.items():
        steps = 6 if fine.has_small else 3
        dome = [
            (LENS * math.cos(a), 0.0030 + 0.0030 * math.sin(a))
            for a in (0.5 * math.pi * i / steps for i in range(steps + 1))
        ]
        profile = [(0.0, -0.0030), (LENS, -0.0030), *dome[:-1], (0.0, dome[-1][1])]
        surfaces[detail] = (
            surface([lathe(profile, axis="x" if ahead else "-x", n=fine.around(0.4))], glass, Label.VEHICLE),
        )
    return Node(f"lamp_{lamp}", "body", (x, y if side == "left" else -y, z), lamp=lamp, surfaces=surfaces)


def _add_lamp_brackets(pile: Pile, spec: VehicleSpec) -> None:
    """A bar for each group of lamps, on a strut from the platform above."""
    lights = spec.lights
    for members, back in (
        ((lights.head, lights.high_beam, lights.front_indicator), -1.0),
        ((lights.tail, lights.reverse, lights.rear_indicator), 1.0),
    ):
        ys, zs, xs = zip(*((one.position[1], one.position[2], one.position[0]) for one in members), strict=True)
        x, z = (min(xs) if back < 0.0 else max(xs)) + back * 0.0045, sum(zs) / len(zs)
        width = max(ys) - min(ys) + 4.0 * LENS
        above = min((one.position[2] for one in spec.platforms if one.position[2] > z), default=z + 0.01)
        for side in (-1.0, 1.0):
            y = side * 0.5 * (max(ys) + min(ys))
            pile.add(BLACK, box((0.0035, width, 3.6 * LENS), (x, y, z)))
            pile.add(ACRYLIC, box((0.0030, 0.4 * width, above - z), (x + back * 0.003, y, 0.5 * (above + z))))
