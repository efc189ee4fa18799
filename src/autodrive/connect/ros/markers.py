"""Markers of ROS (visualization_msgs) as drawings in the view of the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.errors import CommandError
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.protocol.messages import Draw, Drawing, Pose

ARROW, CUBE, SPHERE, CYLINDER, LINE_STRIP, LINE_LIST, CUBE_LIST, SPHERE_LIST, POINTS, TEXT = range(10)
DELETE, DELETE_ALL = 2, 3
"""Types and actions of visualization_msgs/Marker."""

KINDS: dict[int, Any] = {ARROW: "path", LINE_STRIP: "path", LINE_LIST: "lines", TEXT: "text"}
"""The drawing of a marker; all other markers are drawn as points."""


def drawings(array: Any, frame: Callable[[str], Pose]) -> Draw:
    """One request for all markers of a visualization_msgs/MarkerArray of ROS 1 or ROS 2.

    The drawing of a marker has the name 'namespace/id', and the first of its colours. `frame(name)` is the pose in the
    map of a TF frame. A cube, sphere or cylinder is a point of its width, an arrow a line. Raises `CommandError` for
    markers that cannot be drawn.
    """
    drawn: dict[str, Drawing | None] = {}
    is_cleared = False
    for marker in array.markers:
        name = f"{marker.ns}/{marker.id}"
        if marker.action not in (DELETE, DELETE_ALL) and not ARROW <= marker.type <= TEXT:
            raise CommandError(f"the marker '{name}' has the type {marker.type}; types {ARROW} to {TEXT} are drawn")
        if marker.action == DELETE_ALL:
            drawn, is_cleared = {}, True
        elif marker.action == DELETE or not (points := _points(marker, frame(marker.header.frame_id.lstrip("/")))):
            drawn[name] = None
        else:
            drawn[name] = _drawing(marker, name, points)
    return Draw(drawn, clears=is_cleared)


def _points(marker: Any, frame: Pose) -> list[list[float]]:
    """The points of a marker in the map [m]."""
    if marker.type in (CUBE, SPHERE, CYLINDER, TEXT):
        points = [(0.0, 0.0, 0.0)]
    elif marker.type == ARROW and not marker.points:
        points = [(0.0, 0.0, 0.0), (marker.scale.x, 0.0, 0.0)]
    else:
        points = [(point.x, point.y, point.z) for point in marker.points]
    at, turn = marker.pose.position, marker.pose.orientation
    own = (turn.w, turn.x, turn.y, turn.z)
    if not any(own):  # nobody has set it
        own = (1.0, 0.0, 0.0, 0.0)
    in_frame = np.reshape(points, (-1, 3)) @ _rotation(own).T + (at.x, at.y, at.z)
    return (in_frame @ _rotation(frame.orientation).T + frame.position).tolist()


def _rotation(quaternion: Any) -> NDArray[np.float64]:
    return np.reshape(rotation_from_quaternion(quaternion), (3, 3))


def _drawing(marker: Any, name: str, points: list[list[float]]) -> Drawing:
    color = marker.colors[0] if marker.colors else marker.color
    size = marker.scale.z if marker.type == TEXT else marker.scale.x
    if marker.type == ARROW and not marker.points:
        size = marker.scale.y
    time = marker.lifetime
    lifetime = time.sec + 1e-9 * time.nanosec if hasattr(time, "sec") else time.to_sec()
    return Drawing(
        KINDS.get(marker.type, "points"),
        tuple((x, y, z) for x, y, z in points),
        marker.text if marker.type == TEXT else "",
        (color.r, color.g, color.b, color.a),
        size,
        lifetime or None,
    )
