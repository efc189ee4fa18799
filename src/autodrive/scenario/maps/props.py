"""Traffic signs and traffic lights: their Specs, poses and solid shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from autodrive.base.elementary import cos, sin
from autodrive.base.specs import Coordinate, Degrees, Name, Spec
from autodrive.base.units import DEGREE
from autodrive.physics.model import BOX, CYLINDER
from autodrive.scenario.maps.shapes import Pose
from autodrive.scenario.maps.solids import StaticShape

Sign: TypeAlias = Literal[
    "stop",
    "give_way",
    "dead_end",
    "parking",
    "no_parking",
    "left_curve",
    "right_curve",
    "side_road_left",
    "side_road_right",
]
PropKind: TypeAlias = Sign | Literal["traffic_light"]
SIGNS: tuple[str, ...] = get_args(Sign)

# Original scene: plates are centred 0.18 m above ground; lamps at 0.19, 0.175 and 0.16 m. The other sizes are ours: a
# plate of 1 m and a post of 0.1 m at scale 1:14. The plate's upper edge is above the plane of the LIDAR (0.208 m).
PLATE_HEIGHT, PLATE_SIZE, PLATE_THICKNESS = 0.18, 0.07, 0.003
POST_RADIUS = 0.0035


@dataclass(frozen=True)
class PlatePart:
    """A rectangle of the plate of a sign; lengths in sizes of the plate."""

    z: float
    """Height of its middle above that of the plate."""
    width: float
    height: float
    tilt: float = 0.0
    """Turn about the x axis [rad], before the yaw, as for a `StaticShape`."""


def _octagon(apothem: float) -> tuple[PlatePart, ...]:
    """A regular octagon is the union of the rectangles between its opposite sides."""
    side = 2.0 * apothem * (math.sqrt(2.0) - 1.0)
    return tuple(PlatePart(0.0, 2.0 * apothem, side, k * math.pi / 4.0) for k in range(4))


def _triangle(low: float, high: float, width: float, count: int) -> tuple[PlatePart, ...]:
    """A triangle on its tip, as level strips that are as wide as it is in their middle."""
    step = (high - low) / count
    return tuple(PlatePart(low + (k + 0.5) * step, width * (k + 0.5) / count, step) for k in range(count))


_SQUARE = (PlatePart(0.0, 1.0, 1.0),)
_DIAMOND = (PlatePart(0.0, math.sqrt(0.5), math.sqrt(0.5), math.pi / 4.0),)
PLATES: dict[str, tuple[PlatePart, ...]] = {
    "stop": _octagon(0.5),
    "give_way": _triangle(-0.5, 0.4, 1.0, 4),
    "no_parking": _octagon(0.47),
    **dict.fromkeys(("left_curve", "right_curve", "side_road_left", "side_road_right"), _DIAMOND),
}
"""What LIDARs and vehicles hit of a plate, at most 4.4 mm from its outline; all others are square."""
LAMP_HEIGHTS = {"red": 0.19, "yellow": 0.175, "green": 0.16}
"""Heights of the centres of the lamps of a traffic light above the ground [m]."""
HOUSING_WIDTH, HOUSING_DEPTH, HOUSING_MARGIN = 0.02, 0.02, 0.0125


class PropSpec(Spec):
    """A fixed traffic sign or traffic light. Its face looks along x of its pose."""

    kind: PropKind
    name: Name = ""
    x: Coordinate
    y: Coordinate
    yaw_deg: Degrees

    @property
    def pose(self) -> Pose:
        """Pose of the foot of the post."""
        return self.x, self.y, self.yaw_deg * DEGREE


@dataclass(frozen=True)
class Prop:
    """A placed sign or traffic light: what a renderer needs in addition to its solid shapes."""

    name: str
    kind: PropKind
    pose: Pose
    """x, y of the foot [m], yaw of the direction of the face [rad]."""


def prop_shapes(prop: Prop) -> Iterator[StaticShape]:
    """The post and the parts of the plate (or the housing of the lamps) of a prop.

    Names: NAME.post, NAME.housing, NAME.plate; the other parts of the plate are NAME.plate/2, NAME.plate/3 ...
    """
    x, y, yaw = prop.pose
    if prop.kind == "traffic_light":
        low, high = min(LAMP_HEIGHTS.values()) - HOUSING_MARGIN, max(LAMP_HEIGHTS.values()) + HOUSING_MARGIN
        yield _post(prop, low)
        half = (HOUSING_DEPTH / 2.0, HOUSING_WIDTH / 2.0, (high - low) / 2.0)
        yield StaticShape(f"{prop.name}.housing", prop.name, BOX, half, (x, y, (low + high) / 2.0), yaw, "housing")
        return
    yield _post(prop, PLATE_HEIGHT + PLATE_SIZE / 2.0)
    x, y, z = plate_position(prop)
    for number, part in enumerate(PLATES.get(prop.kind, _SQUARE), 1):
        name = f"{prop.name}.plate" if number == 1 else f"{prop.name}.plate/{number}"
        half = (PLATE_THICKNESS / 2.0, part.width * PLATE_SIZE / 2.0, part.height * PLATE_SIZE / 2.0)
        yield StaticShape(name, prop.name, BOX, half, (x, y, z + part.z * PLATE_SIZE), yaw, "plate", part.tilt)


def plate_position(prop: Prop) -> tuple[float, float, float]:
    """Centre of the plate of a sign [m]: in front of its post."""
    x, y, yaw = prop.pose
    ahead = POST_RADIUS + PLATE_THICKNESS / 2.0
    return x + ahead * cos(yaw), y + ahead * sin(yaw), PLATE_HEIGHT


def _post(prop: Prop, height: float) -> StaticShape:
    x, y, yaw = prop.pose
    size = (POST_RADIUS, height / 2.0, 0.0)
    return StaticShape(f"{prop.name}.post", prop.name, CYLINDER, size, (x, y, height / 2.0), yaw, "post")
