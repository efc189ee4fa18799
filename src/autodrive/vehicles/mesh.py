"""How a vehicle looks, from the numbers that it is driven, hit and sensed by.

The vehicle frame is the asset's: x forward, y left, z up from the middle of the rear axle. Nodes that move: hub_<wheel>
(with the suspension), steer_<wheel>, wheel_<wheel>, servo_horn, tie_rod_<side>, drag_link; lamp_<lamp> gives off light.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from autodrive.actuators.lights import LAMPS
from autodrive.render.asset import Asset, Detail, Joint, Label, Material, Node, Surface
from autodrive.render.solids import box, cylinder, lathe, surface
from autodrive.units import DEGREE
from autodrive.vehicles.mesh_boards import add_camera, add_computer, add_lidar, add_lidar_head, add_wires
from autodrive.vehicles.mesh_chassis import add_battery, add_drive, add_platforms, add_servo, add_standoffs, servo_shaft
from autodrive.vehicles.mesh_materials import ACRYLIC, ALUMINIUM, BLACK, RUBBER, STEEL, WHITE
from autodrive.vehicles.mesh_pile import Fineness, Pile
from autodrive.vehicles.mesh_wheel import wheel
from autodrive.vehicles.spec import VehicleSpec

FINENESS: dict[Detail, Fineness] = {"full": Fineness(72, has_small=True), "reduced": Fineness(20, has_small=False)}
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
ARM = 0.022
"""Length of the steering arms and of the servo's horn [m]: equal, so that they turn alike."""
LENS = 0.0029
"""Radius of a lamp: LEDs of 5 mm with a rim [m]."""
GLOW = {"head": 6.0, "high_beam": 6.0, "front_indicator": 5.0, "rear_indicator": 5.0, "tail": 4.0, "reverse": 4.0}
"""How much light a lamp shows when it is lit; ours."""

Build = Callable[[Pile, Fineness], None]


def vehicle_asset(spec: VehicleSpec) -> Asset:
    """The car in three levels of detail."""
    return Asset("vehicle", tuple(_nodes(spec)))


def _nodes(spec: VehicleSpec) -> Iterator[Node]:
    yield Node("body", surfaces={**_made(lambda pile, fine: _add_body(pile, spec, fine)), "shadow": _shadow(spec)})
    if spec.sensors.lidar is not None:
        place = spec.sensors.lidar.mount.position
        yield Node("lidar_head", "body", place, surfaces=_made(lambda pile, fine: add_lidar_head(pile, spec, fine)))
    for name, hub in zip(WHEELS, spec.hubs, strict=True):
        outside = math.copysign(1.0, hub[1])
        yield Node(f"hub_{name}", "body", hub, joint=Joint("slide", f"compression_{name}"))
        if name.startswith("front"):
            knuckle = _made(lambda pile, fine, out=outside: _add_knuckle(pile, spec, out, fine))
            yield Node(f"steer_{name}", f"hub_{name}", joint=Joint("hinge", f"steering_{name}"), surfaces=knuckle)
        carrier = f"steer_{name}" if name.startswith("front") else f"hub_{name}"
        spin = Joint("hinge", f"spin_{name}", axis=(0.0, 1.0, 0.0))
        yield Node(f"wheel_{name}", carrier, joint=spin, surfaces=_wheel(spec, outside))
    yield from _linkage(spec)
    for lamp in LAMPS:
        yield _lamp(spec, lamp)


def _made(build: Build) -> dict[Detail, tuple[Surface, ...]]:
    """The same thing finely and coarsely."""
    details: dict[Detail, tuple[Surface, ...]] = {}
    for detail, fine in FINENESS.items():
        pile = Pile()
        build(pile, fine)
        details[detail] = pile.surfaces()
    return details


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
    return {**_made(add), "shadow": (proxy,)}


# -- steering ---------------------------------------------------------------------------------------------------


def _arm_end(spec: VehicleSpec, outside: float) -> tuple[float, float]:
    """Where a steering arm ends, from the hub [m]: behind it, inside the wheel."""
    return -ARM, -outside * (0.5 * spec.wheels.width + 0.006)


def _add_knuckle(pile: Pile, spec: VehicleSpec, outside: float, fine: Fineness) -> None:
    """Around the hub: the axle's block, and the arm that the tie rod moves."""
    inside = -outside * (0.5 * spec.wheels.width + 0.0045)
    x, y = _arm_end(spec, outside)
    pile.add(ALUMINIUM, box((0.010, 0.006, 0.012), (0.0, inside, 0.0)))
    pile.add(STEEL, cylinder(0.0022, 0.008, (0.0, 0.7 * inside, 0.0), "y", fine.around(0.25)))
    pile.add(ALUMINIUM, box((-x, 0.004, 0.003), (0.5 * x, y, -0.003)))
    pile.add(STEEL, cylinder(0.0022, 0.007, (x, y, -0.003), n=fine.around(0.25)))


def _linkage(spec: VehicleSpec) -> Iterator[Node]:
    """Servo horn, drag link and two tie rods: a 4-bar linkage on each side."""
    x, z = servo_shaft(spec)
    horn = ("servo_horn", (x, 0.0, z - 0.002), Joint("hinge", "steering"))
    yield _node(*horn, lambda pile, fine: pile.add(WHITE, box((ARM + 0.004, 0.005, 0.0018), (-0.5 * ARM, 0.0, 0.0))))
    end = spec.wheelbase - ARM
    length = x - ARM - end
    link = ("drag_link", (end, 0.0, z - 0.0035), Joint("crank", "steering", arm=(-ARM, 0.0, 0.0)))

    def add_link(pile: Pile, fine: Fineness) -> None:
        pile.add(STEEL, cylinder(0.0011, length, (0.5 * length, 0.0, 0.0), "x", fine.around(0.2)))
        for at in (0.0, length):
            pile.add(BLACK, cylinder(0.0028, 0.0034, (at, 0.0, 0.0), n=fine.around(0.25)))

    yield _node(*link, add_link)
    for side, outside in (("left", 1.0), ("right", -1.0)):
        arm_x, arm_y = _arm_end(spec, outside)
        hub_y = outside * 0.5 * spec.track
        signal = f"steering_front_{side}"
        reach = hub_y + arm_y  # from the middle, where the drag link ends, to the arm's end
        crank = Joint("crank", signal, arm=(arm_x, arm_y, 0.0))
        yield Node(f"tie_rod_{side}_end", "body", (end, reach, -0.0045), joint=crank)

        def add_rod(pile: Pile, fine: Fineness, way: float = -reach) -> None:
            pile.add(STEEL, cylinder(0.0011, abs(way), (0.0, 0.5 * way, 0.0), "y", fine.around(0.2)))
            pile.add(BLACK, cylinder(0.0028, 0.0034, n=fine.around(0.25)))

        gain = _rod_gain(spec, outside, reach)
        yield Node(
            f"tie_rod_{side}", f"tie_rod_{side}_end", joint=Joint("hinge", signal, gain=gain), surfaces=_made(add_rod)
        )


def _rod_gain(spec: VehicleSpec, outside: float, reach: float) -> float:
    """How much a tie rod turns for each radian of steering, so that its inner end stays at the drag link's."""
    angle = spec.steering.limit_deg * DEGREE
    _, arm_y = _arm_end(spec, outside)
    # how far the outer end goes ahead of the inner one, over the rod's length
    return math.asin(max(-1.0, min(1.0, arm_y * math.sin(angle) / reach))) / angle


def _node(name: str, place: tuple[float, float, float], joint: Joint, build: Build) -> Node:
    return Node(name, "body", place, joint=joint, surfaces=_made(build))


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
