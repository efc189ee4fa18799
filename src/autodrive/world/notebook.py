"""A World in a notebook: the map from above with vehicles and objects where they are, and the Frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from autodrive.base.transforms import yaw_from_quaternion
from autodrive.protocol.messages import Frame
from autodrive.scenario.maps.map import BoxPlacement, Map

DRAWING_WIDTH = 400.0
"""Width of the map [pixels]."""


def html_of(map_: Map, boxes: Mapping[str, BoxPlacement], frame: Frame) -> str:
    """A World with that Frame as HTML; `boxes`: its movable objects."""
    from autodrive.scenario.maps.draw import to_svg  # noqa: PLC0415  its libraries are needed only here

    poses = {name: placed.pose for name, placed in frame.objects.items()}
    moved = [
        dataclasses.replace(
            box,
            position=tuple(poses[name].position.tolist()),
            yaw=yaw_from_quaternion(poses[name].orientation),
        )
        for name, box in boxes.items()
    ]
    x0, _, x1, _ = map_.bounds
    drawing = to_svg(
        dataclasses.replace(map_, boxes=tuple(moved)),
        pixels_per_metre=DRAWING_WIDTH / (x1 - x0),
        starts=[
            (*vehicle.pose.position.tolist()[:2], yaw_from_quaternion(vehicle.pose.orientation))
            for vehicle in frame.vehicles.values()
        ],
    )
    return drawing + frame._repr_html_()
