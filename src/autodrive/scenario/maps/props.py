"""Traffic signs and traffic lights: their Specs, poses and solid shapes."""

from __future__ import annotations

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
    """The post and the plate (or the housing of the lamps) of a prop."""
    if prop.kind == "traffic_light":
        low, high = min(LAMP_HEIGHTS.values()) - HOUSING_MARGIN, max(LAMP_HEIGHTS.values()) + HOUSING_MARGIN
        yield _post(prop, low)
        yield _plate(prop, "housing", (HOUSING_DEPTH, HOUSING_WIDTH, high - low), (low + high) / 2.0)
    else:
        size = (PLATE_THICKNESS, PLATE_SIZE, PLATE_SIZE)
        yield _post(prop, PLATE_HEIGHT + PLATE_SIZE / 2.0)
        yield _plate(prop, "plate", size, PLATE_HEIGHT)


def _post(prop: Prop, height: float) -> StaticShape:
    x, y, yaw = prop.pose
    size = (POST_RADIUS, height / 2.0, 0.0)
    return StaticShape(f"{prop.name}.post", CYLINDER, size, (x, y, height / 2.0), yaw, "post")


def _plate(prop: Prop, material: str, size: tuple[float, float, float], height: float) -> StaticShape:
    """A box in front of the post, or around its top."""
    x, y, yaw = prop.pose
    ahead = POST_RADIUS + size[0] / 2.0 if material == "plate" else 0.0
    position = (x + ahead * cos(yaw), y + ahead * sin(yaw), height)
    half = (size[0] / 2.0, size[1] / 2.0, size[2] / 2.0)
    return StaticShape(f"{prop.name}.{material}", BOX, half, position, yaw, material)
