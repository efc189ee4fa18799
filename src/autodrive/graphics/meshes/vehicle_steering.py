"""The 4-bar steering: knuckles, servo horn, drag link and tie rod, whose ends stay connected.

The steering arms point at the centre of the rear axle, so that the wheel angles are nearly those of Ackermann. A joint
follows one signal, so the tie rod has two halves, each moved by its knuckle. The levers fit exactly at 0.9 of the
steering limit; the error elsewhere is less than a millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from autodrive.base.units import DEGREE
from autodrive.graphics.assets.asset import AssetNode, NodeJoint
from autodrive.graphics.meshes.mesh_builder import MeshBuilder, surfaces_by_detail
from autodrive.graphics.meshes.solids import box, cylinder
from autodrive.graphics.meshes.vehicle_chassis import servo_shaft
from autodrive.physics.actuators.steering import ackermann_angle
from autodrive.scenario.vehicles.spec import VehicleSpec

FITTED = 0.9
"""Fraction of the steering limit at which the levers fit exactly; our value."""
ROD_Z = -0.0045
"""Height of the tie rod [m]."""


def add_knuckle(builder: MeshBuilder, spec: VehicleSpec, outside: float) -> None:
    """Steering knuckle: the block of the axle, and the steering arm."""
    inside = -outside * (0.5 * spec.wheels.width + 0.0045)
    x, y = _arm(spec, outside)
    builder.add("aluminium", box((0.010, 0.006, 0.012), (0.0, inside, 0.0)))
    builder.add("steel", cylinder(0.0022, 0.008, (0.0, 0.7 * inside, 0.0), "y", builder.around(0.25)))
    builder.add("aluminium", box((-x, 0.004, 0.003), (0.5 * x, y, -0.001)))
    builder.add("steel", cylinder(0.0022, 0.008, (x, y, -0.0035), n=builder.around(0.25)))


def linkage(spec: VehicleSpec) -> Iterator[AssetNode]:
    """Servo horn, drag link and tie rod."""
    lever, gain, turn = _levers(spec)
    x, z = servo_shaft(spec)
    arm_x, arm_y = _arm(spec, 1.0)
    end, reach = spec.wheelbase + arm_x, 0.5 * spec.track + arm_y
    length = x - lever - end

    def add_horn(builder: MeshBuilder) -> None:
        builder.add(
            "white", box((lever + 0.005, 0.005, 0.0018), (-0.5 * lever, 0.0, 0.0), 0.0024, builder.around(0.04))
        )
        builder.add("white", cylinder(0.0034, 0.0030, n=builder.around(0.3)))
        builder.add("steel", cylinder(0.0012, 0.0046, (-lever, 0.0, -0.0010), n=builder.around(0.2)))

    def add_link(builder: MeshBuilder) -> None:
        builder.add("steel", cylinder(0.0011, length, (0.5 * length, 0.0, 0.0), "x", builder.around(0.2)))
        for at in (0.0, length):
            builder.add("black", cylinder(0.0028, 0.0034, (at, 0.0, 0.0), n=builder.around(0.25)))

    yield AssetNode(
        "servo_horn",
        "body",
        (x, 0.0, z - 0.002),
        joint=NodeJoint("hinge", "steering", gain=gain),
        surfaces=surfaces_by_detail(add_horn),
    )
    crank = NodeJoint("crank", "steering", gain=gain, arm=(-lever, 0.0, 0.0))
    yield AssetNode("drag_link", "body", (end, 0.0, z - 0.0040), joint=crank, surfaces=surfaces_by_detail(add_link))
    for side, outside in (("left", 1.0), ("right", -1.0)):
        crank = NodeJoint("crank", f"steering_front_{side}", arm=(arm_x, -outside * abs(arm_y), 0.0))
        yield AssetNode(f"tie_rod_{side}_end", "body", (end, outside * reach, ROD_Z), joint=crank)
        hinge = NodeJoint("hinge", "steering", gain=turn)
        yield AssetNode(
            f"tie_rod_{side}", f"tie_rod_{side}_end", joint=hinge, surfaces=surfaces_by_detail(_rod(-outside * reach))
        )


def _rod(way: float) -> Callable[[MeshBuilder], None]:
    """One half of the tie rod, from its outer end along y."""

    def add(builder: MeshBuilder) -> None:
        builder.add("steel", cylinder(0.0012, abs(way), (0.0, 0.5 * way, 0.0), "y", builder.around(0.2)))
        builder.add("black", cylinder(0.0030, 0.0036, n=builder.around(0.25)))
        builder.add("black", cylinder(0.0019, 0.009, (0.0, 0.10 * way, 0.0), "y", builder.around(0.2)))

    return add


def _arm(spec: VehicleSpec, outside: float) -> tuple[float, float]:
    """X and y of the end of a steering arm relative to the hub [m]; the arm points at the centre of the rear axle."""
    inward = 0.5 * spec.wheels.width + 0.0045
    return -inward * spec.wheelbase / (0.5 * spec.track), -outside * inward


def _levers(spec: VehicleSpec) -> tuple[float, float, float]:
    """Length of the servo lever [m], and rotation of the lever and of the tie rod per radian of steering."""
    mean = FITTED * spec.steering.limit_deg * DEGREE
    ends: list[tuple[float, float]] = []
    for outside in (1.0, -1.0):
        hub = 0.5 * outside * spec.track
        angle = float(ackermann_angle(mean, spec.wheelbase, hub))
        x, y = _arm(spec, outside)
        c, s = math.cos(angle), math.sin(angle)
        ends.append((c * x - s * y, hub + s * x + c * y))
    (left_x, left_y), (right_x, right_y) = ends
    ahead, aside = 0.5 * (left_x + right_x) - _arm(spec, 1.0)[0], -0.5 * (left_y + right_y)
    # a lever of length c rotated by a moves its end by c (1 - cos a) forward and c sin a sideways
    turned_by = 2.0 * math.atan2(ahead, aside)
    return aside / math.sin(turned_by), turned_by / mean, math.atan2(right_x - left_x, left_y - right_y) / mean
