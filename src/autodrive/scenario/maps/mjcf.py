"""MJCF of a world: the floor, and boxes and vehicles that can be pushed; the engine gets the static shapes itself."""

from __future__ import annotations

from collections.abc import Iterable

from autodrive.base.transforms import quaternion_from_yaw
from autodrive.scenario.maps.map import BoxPlacement, Map

CLASSES = """
<default>
  <geom solref="1e-6 2" solimp="0.99 0.99 0.001 0.5 2" margin="1e-9" condim="3"/>
  <default class="floor"><geom contype="1" conaffinity="0" solref="0.005 1" solmix="1e6"/></default>
  <default class="static"><geom contype="2" conaffinity="0" solref="1e-6 1"/></default>
  <default class="movable"><geom contype="4" conaffinity="7" solref="0.005 2" solmix="0"/></default>
  <default class="chassis"><geom contype="8" conaffinity="31" mass="0"/></default>
  <default class="wheel">
    <geom contype="16" conaffinity="30" mass="0" type="cylinder" quat="0.70710678118654757 0.70710678118654757 0 0"/>
  </default>
</default>
"""
"""Which classes collide: a wheel collides with everything but the floor, because its suspension ray carries it.

Solref: time constant [s] and damping ratio of a contact. A critically damped contact gives 0.7 to 2.1 % of the energy
of an impact back, depending on how deep the first substep finds it; with the ratio 1.5 (the mean of a car and a wall)
0.6 %, with 2 (two cars or boxes) 0.2 %. A box (solmix 0) has the stiffer contact of the floor or wall that it touches.
"""

COLLISION = 'cone="elliptic" ccd_tolerance="1e-9" ccd_iterations="500"'
"""Options for precise contacts of cylinders. With MuJoCo's own settings, and with its `multiccd`, wheels that graze
each other are up to 79 mm deep in each other for one substep, and the cars fly apart."""

UNUSED = " ".join(
    f'{part}="disable"' for part in ("actuation", "equality", "frictionloss", "limit", "spring", "damper", "sensor")
)
"""Features of the engine that a world of free bodies does not need."""


def text(numbers: Iterable[float]) -> str:
    """Numbers for an MJCF attribute, exact to the last bit."""
    return " ".join(f"{number:.17g}" for number in numbers)


def friction(coefficient: float) -> str:
    """The attribute of a geom for a Coulomb friction coefficient: contacts have no torsion and no rolling friction."""
    return f'friction="{coefficient:.17g} 0 0"'


def world_mjcf(map_: Map, boxes: Iterable[BoxPlacement], vehicles: Iterable[str], dt: float, gravity: float) -> str:
    """MJCF of a world without its static shapes. Bodies at rest sleep until they are touched and then cost no time."""
    ground = friction(map_.ground.friction)
    return (
        f'<mujoco><option timestep="{dt:.17g}" gravity="0 0 {-gravity:.17g}" integrator="Euler" {COLLISION}>'
        f'<flag sleep="enable" multiccd="disable" {UNUSED}/></option><size memory="16M"/>{CLASSES}<worldbody>'
        f'<geom name="ground" class="floor" type="plane" size="100 100 1" {ground}/>'
        f"{''.join(_movable(box, ground) for box in boxes)}"
        f"{''.join(vehicles)}</worldbody></mujoco>"
    )


def _movable(box: BoxPlacement, ground: str) -> str:
    half = tuple(length / 2 for length in box.size)
    return (
        f'<body name="{box.name}" pos="{text(box.position)}" quat="{text(quaternion_from_yaw(box.yaw))}">'
        f'<freejoint name="{box.name}"/><geom name="{box.name}" class="movable" type="box" size="{text(half)}" '
        f'mass="{box.mass:.17g}" {ground}/></body>'
    )
