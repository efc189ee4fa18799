"""The 4-bar steering: knuckles, servo horn, drag link and tie rod, jointed so that their ends stay together.

The steering arms point at the middle of the rear axle, the trapezoid by which the wheels' angles nearly follow
Ackermann's. A joint follows one signal, so the rod is two halves, each led by its own knuckle; the levers fit where the
steering is at 0.9 of its lock, which leaves less than a millimetre elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from autodrive.physics.wheel import ackermann_angle
from autodrive.render.asset import Joint, Node
from autodrive.render.solids import box, cylinder
from autodrive.units import DEGREE
from autodrive.vehicles.mesh_chassis import servo_shaft
from autodrive.vehicles.mesh_materials import ALUMINIUM, BLACK, STEEL, WHITE
from autodrive.vehicles.mesh_pile import Fineness, Pile, made
from autodrive.vehicles.spec import VehicleSpec

FITTED = 0.9
"""Share of the lock at which the levers fit; ours."""
ROD_Z = -0.0045
"""Height of the tie rod [m]."""


def add_knuckle(pile: Pile, spec: VehicleSpec, outside: float, fine: Fineness) -> None:
    """Around the hub: the axle's block, and the arm that the tie rod moves."""
    inside = -outside * (0.5 * spec.wheels.width + 0.0045)
    x, y = _arm(spec, outside)
    pile.add(ALUMINIUM, box((0.010, 0.006, 0.012), (0.0, inside, 0.0)))
    pile.add(STEEL, cylinder(0.0022, 0.008, (0.0, 0.7 * inside, 0.0), "y", fine.around(0.25)))
    pile.add(ALUMINIUM, box((-x, 0.004, 0.003), (0.5 * x, y, -0.001)))
    pile.add(STEEL, cylinder(0.0022, 0.008, (x, y, -0.0035), n=fine.around(0.25)))


def linkage(spec: VehicleSpec) -> Iterator[Node]:
    """What the servo moves."""
    lever, gain, turn = _levers(spec)
    x, z = servo_shaft(spec)
    arm_x, arm_y = _arm(spec, 1.0)
    end, reach = spec.wheelbase + arm_x, 0.5 * spec.track + arm_y
    length = x - lever - end

    def add_horn(pile: Pile, fine: Fineness) -> None:
        pile.add(WHITE, box((lever + 0.005, 0.005, 0.0018), (-0.5 * lever, 0.0, 0.0), 0.0024, fine.around(0.04)))
        pile.add(WHITE, cylinder(0.0034, 0.0030, n=fine.around(0.3)))
        pile.add(STEEL, cylinder(0.0012, 0.0046, (-lever, 0.0, -0.0010), n=fine.around(0.2)))

    def add_link(pile: Pile, fine: Fineness) -> None:
        pile.add(STEEL, cylinder(0.0011, length, (0.5 * length, 0.0, 0.0), "x", fine.around(0.2)))
        for at in (0.0, length):
            pile.add(BLACK, cylinder(0.0028, 0.0034, (at, 0.0, 0.0), n=fine.around(0.25)))

    yield Node(
        "servo_horn", "body", (x, 0.0, z - 0.002), joint=Joint("hinge", "steering", gain=gain), surfaces=made(add_horn)
    )
    crank = Joint("crank", "steering", gain=gain, arm=(-lever, 0.0, 0.0))
    yield Node("drag_link", "body", (end, 0.0, z - 0.0040), joint=crank, surfaces=made(add_link))
    for side, outside in (("left", 1.0), ("right", -1.0)):
        crank = Joint("crank", f"steering_front_{side}", arm=(arm_x, -outside * abs(arm_y), 0.0))
        yield Node(f"tie_rod_{side}_end", "body", (end, outside * reach, ROD_Z), joint=crank)
        hinge = Joint("hinge", "steering", gain=turn)
        yield Node(f"tie_rod_{side}", f"tie_rod_{side}_end", joint=hinge, surfaces=made(_rod(-outside * reach)))


def _rod(way: float) -> Callable[[Pile, Fineness], None]:
    """Half of the tie rod, from its outer end along y."""

    def add(pile: Pile, fine: Fineness) -> None:
        pile.add(STEEL, cylinder(0.0012, abs(way), (0.0, 0.5 * way, 0.0), "y", fine.around(0.2)))
        pile.add(BLACK, cylinder(0.0030, 0.0036, n=fine.around(0.25)))
        pile.add(BLACK, cylinder(0.0019, 0.009, (0.0, 0.10 * way, 0.0), "y", fine.around(0.2)))

    return add


def _arm(spec: VehicleSpec, outside: float) -> tuple[float, float]:
    """Where a steering arm ends, from the hub [m]: behind it, inside the wheel, towards the rear axle's middle."""
    inward = 0.5 * spec.wheels.width + 0.0045
    return -inward * spec.wheelbase / (0.5 * spec.track), -outside * inward


def _levers(spec: VehicleSpec) -> tuple[float, float, float]:
    """Length of the servo's lever [m], and how much it and the tie rod turn for each radian of steering."""
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
    # a lever c that turns by a moves its end by c (1 - cos a) ahead and c sin a aside
    turned_by = 2.0 * math.atan2(ahead, aside)
    return aside / math.sin(turned_by), turned_by / mean, math.atan2(right_x - left_x, left_y - right_y) / mean
