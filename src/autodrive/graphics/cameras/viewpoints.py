"""Viewpoints of the scene cameras: Driver's Eye, Bird's Eye and God's Eye, for rendered images and the page.

The numbers are those of the original simulator (Unity: x right, y up, z forward, left-handed): position (x, y, z) there
is (z, -x, y) here. Up on the screen of the Bird's Eye is Unity's z axis, the x axis of the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from autodrive.base.transforms import Quaternion, Vector, compose, quaternion_from_euler, rotate
from autodrive.base.units import DEGREE
from autodrive.physics.sensors.camera.camera import OPTICAL
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.messages import CameraIntrinsics

FIELD_OF_VIEW_DEG = 60.0
"""Vertical [degree], of Driver's Eye and Bird's Eye."""
NEAR, FAR = 0.01, 1000.0
"""Nothing nearer or farther is drawn [m]."""

DRIVER_POSITION: Vector = (-0.42, 0.0, 0.2275)
"""Behind and above the centre of the rear axle, in the vehicle frame [m]."""
DRIVER_PITCH_DEG = 15.0
"""Downwards [degree]."""

BIRD_HEIGHT, BIRD_LOWEST, BIRD_HIGHEST, BIRD_STEP = 3.0, 0.5, 5.0, 0.1
"""Height above the ground: initial, minimum, maximum, and change by a click of the mouse wheel [m]."""

GOD_POSITION: Vector = (0.0, 0.0, 2.5)
"""Fixed in the map [m]."""
GOD_FAR = 4000.0
"""Nothing farther is drawn [m]."""
GOD_ZOOM = 5.0
"""Field of view over the angle that half the vehicle's length subtends."""
GOD_TURN_TIME, GOD_ZOOM_TIME = 0.1, 1.0
"""Time constants of direction and field of view [s]: a difference falls to 37 % in that time."""


@dataclass(frozen=True)
class Viewpoint:
    """Position, orientation and field of view, independent of the image size."""

    position: Vector
    """Position in the map [m]."""
    orientation: Quaternion
    """Map from optical frame (x right, y down, z forward)."""
    field_of_view_deg: float = FIELD_OF_VIEW_DEG
    """Vertical [degree]."""
    near: float = NEAR
    """[m]."""
    far: float = FAR
    """[m]."""

    def zoomed(self, zoom: float) -> Viewpoint:
        """A viewpoint at this place with `zoom` times the focal length."""
        half = math.atan(math.tan(0.5 * self.field_of_view_deg * DEGREE) / zoom)
        return self if zoom == 1.0 else replace(self, field_of_view_deg=2.0 * half / DEGREE)

    def view(self, width: int, height: int) -> View:
        """The renderer's view for an image of that size [pixels]."""
        f = 0.5 * height / math.tan(0.5 * self.field_of_view_deg * DEGREE)
        pinhole = CameraIntrinsics(width, height, f, f, 0.5 * width, 0.5 * height)
        return View(self.position, self.orientation, pinhole, self.near, self.far, is_outlined=True)


def drivers_eye(position: Vector, orientation: Quaternion) -> Viewpoint:
    """Behind and above a vehicle with that pose, fixed to it."""
    x, y, z = rotate(orientation, DRIVER_POSITION)
    px, py, pz = position
    ahead = compose(orientation, quaternion_from_euler(0.0, DRIVER_PITCH_DEG * DEGREE, 0.0))
    return Viewpoint((px + x, py + y, pz + z), compose(ahead, OPTICAL))


def birds_eye(position: Vector, height: float = BIRD_HEIGHT) -> Viewpoint:
    """Straight above a vehicle at that position, `height` [m] above z = 0 of the map; does not turn."""
    return Viewpoint((position[0], position[1], height), _looking(0.0, 0.5 * math.pi))


def orbit(
    target: Vector,
    distance: float,
    azimuth_deg: float,
    elevation_deg: float,
    field_of_view_deg: float = FIELD_OF_VIEW_DEG,
) -> Viewpoint:
    """A viewpoint at `distance` [m] from `target`, looking at it.

    Azimuth 0: from +x, 90: from +y; elevation 90: from above [degree].
    """
    azimuth, elevation = azimuth_deg * DEGREE, elevation_deg * DEGREE
    level = distance * math.cos(elevation)
    x, y, z = target
    place = x + level * math.cos(azimuth), y + level * math.sin(azimuth), z + distance * math.sin(elevation)
    return Viewpoint(place, _looking(azimuth + math.pi, elevation), field_of_view_deg)


def fly(position: Vector, azimuth: float, elevation: float) -> Viewpoint:
    """Anywhere in the map; looks along that direction [rad], elevation upwards."""
    return Viewpoint(position, _looking(azimuth, -elevation))


class GodsEye:
    """A camera at a fixed position that turns to follow a vehicle and zooms to keep its size in the image."""

    def __init__(self, half_length: float, place: Vector = GOD_POSITION) -> None:
        """`half_length` [m]: the largest half-extent of the vehicle."""
        self.place = place
        self._half_length = half_length
        self._state: Vector | None = None
        """Pan, tilt [rad] and field of view [degree]."""

    def step(self, target: Vector, dt: float) -> Viewpoint:
        """The viewpoint `dt` [s] after the last one, for a vehicle at `target`; the first looks straight at it."""
        dx, dy, dz = (there - here for there, here in zip(target, self.place, strict=True))
        level = math.hypot(dx, dy)
        before = self._state
        pan = math.atan2(dy, dx) if level > 1e-9 else before[0] if before else 0.0  # straight below: any angle is right
        tilt = math.atan2(-dz, level)
        zoom = GOD_ZOOM * math.atan2(self._half_length, math.hypot(level, dz)) / DEGREE
        zoom = min(zoom, 170.0)
        if before is not None:
            turned, zoomed = -math.expm1(-dt / GOD_TURN_TIME), -math.expm1(-dt / GOD_ZOOM_TIME)
            pan = before[0] + turned * math.remainder(pan - before[0], 2.0 * math.pi)
            tilt = before[1] + turned * (tilt - before[1])
            zoom = before[2] + zoomed * (zoom - before[2])
        self._state = pan, tilt, zoom
        return Viewpoint(self.place, _looking(pan, tilt), zoom, NEAR, GOD_FAR)


def scene_cameras() -> dict[str, dict[str, Any]]:
    """Parameters of all three by name, for a page with its own camera; lengths [m], angles [degree], times [s].

    The order is that of the camera button.
    """
    common = {"near": NEAR, "far": FAR, "field_of_view": FIELD_OF_VIEW_DEG}
    heights = {"height": BIRD_HEIGHT, "lowest": BIRD_LOWEST, "highest": BIRD_HIGHEST, "step": BIRD_STEP}
    times = {"turn_time": GOD_TURN_TIME, "zoom_time": GOD_ZOOM_TIME}
    return {
        "Driver's Eye": {**common, "position": list(DRIVER_POSITION), "pitch": DRIVER_PITCH_DEG},
        "Bird's Eye": {**common, **heights},
        "God's Eye": {"near": NEAR, "far": GOD_FAR, "position": list(GOD_POSITION), "zoom": GOD_ZOOM, **times},
    }


def _looking(yaw: float, pitch: float) -> Quaternion:
    """Orientation of the optical frame for that direction [rad], without roll."""
    return compose(quaternion_from_euler(0.0, pitch, yaw), OPTICAL)
