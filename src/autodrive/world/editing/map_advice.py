"""Advice about the map of a World, which may be as it is: lanes that lead nowhere, vehicles beside the road."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from autodrive.protocol.native import MapProblem
from autodrive.scenario.maps.area import is_inside
from autodrive.scenario.maps.module import lane_end

if TYPE_CHECKING:
    from autodrive.world import World


def map_advice(world: World) -> list[MapProblem]:
    """A record for each lane that no car reaches or leaves, and for each vehicle beside the drivable area."""
    return [*_unreachable(world), *_outside(world)]


def _unreachable(world: World) -> Iterator[MapProblem]:
    """Lanes at joined ports that do not continue in the other module."""
    modules = {placed.name: i for i, placed in enumerate(world.map.modules)}
    lanes = world.map.lane_graph.lanes
    reached = {successor for lane in lanes for successor in lane.successors}
    for i, lane in enumerate(lanes):
        part, _, way = lane.name.rpartition(":")
        entry, exit_ = way.split(">")
        for end, is_led, point, wrong in (
            (entry, i in reached, lane.points[0], "no other lane leads to this lane, so no car reaches it"),
            (exit_, bool(lane.successors), lane.points[-1], "no other lane follows this lane, so no car leaves it"),
        ):
            if not is_led and (modules[part], lane_end(end)[0]) in world.map.joins:
                text = f"'{part}': lane from '{entry}' to '{exit_}': {wrong}. Turn or mirror the module."
                yield MapProblem("unreachable", text, float(point[0]), float(point[1]), [part], {})


def _outside(world: World) -> Iterator[MapProblem]:
    for name, vehicle in world.frame.vehicles.items():
        x, y, _ = vehicle.pose.position
        if not is_inside(world.map.drivable_edges, x, y):
            lane = world.map.lane_graph.nearest(float(x), float(y))
            place = (lane.x, lane.y, lane.yaw) if lane else None
            text = f"'{name}' stands beside the road."
            yield MapProblem("outside", text, float(x), float(y), [], {}, name, place)
