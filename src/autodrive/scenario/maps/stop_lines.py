"""Stop lines of a map that belong to a traffic light, a stop sign or a give-way sign."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import shapely

from autodrive.base.units import DEGREE
from autodrive.scenario.maps.placing import PlacedModule
from autodrive.scenario.maps.props import Prop
from autodrive.scenario.maps.shapes import Pose

SAME_WAY = 45.0 * DEGREE
"""Largest angle between the view of a driver at a stop line and the direction against the face of its light or sign."""


LineKind: TypeAlias = Literal["traffic_light", "stop", "give_way"]


@dataclass(frozen=True)
class StopLine:
    """A stop line across the lanes of one direction, in the map frame."""

    prop: str
    """Name of the traffic light or sign."""
    kind: LineKind
    pose: Pose
    """Middle of the line [m] and the heading of a driver who crosses it [rad]."""
    width: float
    """Across the road [m]."""


def stop_lines(placed: Sequence[PlacedModule], props: Sequence[Prop], *kinds: LineKind) -> Iterator[StopLine]:
    """The stop line that each traffic light or sign of these kinds faces.

    Of the lines that drivers cross with the light or sign before them, it is the nearest one of a module that is not
    farther away than half the module's size. A light or sign without such a line belongs to none.
    """
    lines = list(_lines(placed))
    for prop in props:
        kind: LineKind | None = next((line_kind for line_kind in kinds if line_kind == prop.kind), None)
        if kind is None:
            continue
        x, y, yaw = prop.pose
        foot = shapely.Point(x, y)
        near: list[tuple[float, Pose, float]] = []
        for module, pose, width in lines:
            turn = math.remainder(pose[2] - yaw - math.pi, 2.0 * math.pi)
            ahead = (x - pose[0]) * math.cos(pose[2]) + (y - pose[1]) * math.sin(pose[2])
            reach = 0.5 * max(module.size[:2])
            if abs(turn) <= SAME_WAY and ahead > -0.5 * width and module.footprint.distance(foot) <= reach:
                near.append((math.hypot(x - pose[0], y - pose[1]), pose, width))
        if near:
            _, pose, width = min(near)
            yield StopLine(prop.name, kind, pose, width)


def _lines(placed: Sequence[PlacedModule]) -> Iterator[tuple[PlacedModule, Pose, float]]:
    """Module, pose and width of each stop line."""
    for part in placed:
        x0, y0, turn = part.placement.pose
        for line in part.module.spec.stop_lines:
            port = part.module.spec.ports[line.port]
            x, y, yaw = port.line_in()
            x, y = x + line.distance * math.cos(yaw), y + line.distance * math.sin(yaw)
            x, y = x0 + math.cos(turn) * x - math.sin(turn) * y, y0 + math.sin(turn) * x + math.cos(turn) * y
            yield part, (x, y, math.remainder(yaw + turn, 2.0 * math.pi)), port.width / 2.0
