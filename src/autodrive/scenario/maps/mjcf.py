"""MJCF of a world: the floor, and boxes and vehicles that can be pushed; the engine gets the static shapes itself."""

from __future__ import annotations

from collections.abc import Iterable

from autodrive.base.transforms import quaternion_from_yaw
from autodrive.scenario.maps.map import BoxPlacement, Map

CLASSES = """
<default>
  <geom solref="1e-6 3" solimp="0.99 0.99 0.001 0.5 2" margin="1e-9" condim="3"/>
  <default class="floor"><geom contype="1" conaffinity="0" solref="0.005 1" solmix="1e6"/></default>
  <default class="static"><geom contype="2" conaffinity="0"/></default>
  <default class="movable"><geom contype="4" conaffinity="7" solref="0.005 2" solmix="0"/></default>
  <default class="chassis"><geom contype="8" conaffinity="31" mass="0"/></default>
  <default class="wheel">
    <geom contype="16" conaffinity="30" mass="0" type="cylinder" quat="0.70710678118654757 0.70710678118654757 0 0"/>
  </default>
</default>
"""
"""Which classes collide: a wheel collides with everything but the floor, because its suspension ray carries it.

What each class sets, and why:

- Solref: time constant [s] and damping ratio of a contact. A time constant below two steps becomes two steps
  (refsafe), the stiffest contact that is stable: what meets at any speed is less than 3 mm deep in each other, because
  a fast substep is divided (`physics/engine_contacts.py`). With the damping ratio 3 an impact gives back less than
  0.5 % of the energy. On the floor, whose solmix decides alone, 5 ms and 1: there bodies rest on four corners, which
  would chatter otherwise. A box (solmix 0) has the contact of the floor, wall or vehicle that it touches.
- Solimp: the constraint keeps 99 % of what it asks for, at each depth. With the engine's 90 to 95 % a box that slides
  on the floor turns by 3 degrees.
- Margin: bodies that are placed exactly on each other touch at all corners, whatever the last bit of their heights is.
- Condim: friction in two directions; no friction against spin about the normal and against rolling.
- Friction: of the ground, of the body of a vehicle, of the sides of its wheels. A contact has the mean of both sides
  (`physics/engine_contacts.py`).
"""

COLLISION = 'cone="elliptic" ccd_tolerance="1e-9" ccd_iterations="500"'
"""The friction of an elliptic cone is the same in every direction; with the engine's pyramid a box slides 41 % farther
between the axes of the map than along them. The other options are for precise contacts of cylinders: with MuJoCo's own
settings, and with its `multiccd`, wheels that graze each other are up to 79 mm deep in each other for one substep, and
the cars fly apart."""

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
