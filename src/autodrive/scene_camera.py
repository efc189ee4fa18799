"""A viewer's scene camera: where it is, for the wish that the viewer sent and the Frame that is to be drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from autodrive.descriptions import suggest
from autodrive.errors import AutodriveError
from autodrive.render.viewpoints import (
    BIRD_HIGHEST,
    BIRD_LOWEST,
    GodsEye,
    Viewpoint,
    birds_eye,
    drivers_eye,
    orbit,
    scene_cameras,
)
from autodrive.transforms import Vector, rotate
from autodrive.units import DEGREE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from autodrive.protocol.messages import Frame, Pose
    from autodrive.protocol.native import SetCamera
    from autodrive.vehicles.spec import VehicleSpec

CAMERAS = (*scene_cameras(), "Orbit")

ORBIT_TARGET: Vector = (0.07, 0.0, 0.05)
"""What the orbit looks at, in the vehicle frame: the middle of the car [m]."""
ORBIT_NEAREST, ORBIT_FARTHEST = 0.15, 12.0
"""Its distance [m]."""

STEP, FEWEST, MOST = 160, 1, 12
"""Pictures are so many times 160 x 90 pixels: few sizes, each exactly 16:9."""


def check_wish(wish: SetCamera, vehicles: Sequence[str]) -> None:
    """Raises `AutodriveError` where the wish names what is not there, or has a figure that is none."""
    if wish.camera not in CAMERAS:
        raise AutodriveError(f"scene camera '{wish.camera}' is not known. {suggest(str(wish.camera), [*CAMERAS])}")
    if wish.vehicle is not None and wish.vehicle not in vehicles:
        raise AutodriveError(f"vehicle '{wish.vehicle}' is not known. {suggest(wish.vehicle, list(vehicles))}")
    if wish.vehicle is None and not vehicles:
        raise AutodriveError("a scene camera follows a vehicle, and there is none here")
    for name in ("height", "azimuth", "elevation", "distance"):
        if not math.isfinite(value := getattr(wish, name)):
            raise AutodriveError(f"{name} of a scene camera must be a finite number, not {value}")


def picture_size(width: int) -> tuple[int, int]:
    """Width and height [pixels] of the picture that is drawn where that width is wished: near it, 160 to 1920."""
    times = min(max(round(width / STEP), FEWEST), MOST)
    return STEP * times, STEP * times * 9 // 16


class SceneCamera:
    """Remembers where a God's Eye looked last; the others are where they have to be."""

    def __init__(self, vehicles: Mapping[str, VehicleSpec]) -> None:
        self._vehicles = vehicles
        self._god: GodsEye | None = None
        self._followed = ""
        self._time = self._at = 0.0

    def viewpoint(self, wish: SetCamera, frame: Frame, now: float) -> Viewpoint:
        """From where to draw that Frame, at wall time `now` [s]; the wish was checked."""
        name = wish.vehicle or next(iter(frame.vehicles))
        pose = frame.vehicles[name].pose
        if wish.camera == "God's Eye":
            return self._gods_eye(name, frame, now)
        self._god = None
        if wish.camera == "Driver's Eye":
            return drivers_eye(_vector(pose), _orientation(pose))
        if wish.camera == "Bird's Eye":
            return birds_eye(_vector(pose), min(max(wish.height, BIRD_LOWEST), BIRD_HIGHEST))
        return _orbit(wish, pose)

    def _gods_eye(self, name: str, frame: Frame, now: float) -> Viewpoint:
        """Turns after the vehicle; at once to another one, and after a reset."""
        if self._god is None or name != self._followed or frame.time < self._time:
            self._god = GodsEye(0.5 * max(self._vehicles[name].size))
            self._at = now
        viewpoint = self._god.step(_vector(frame.vehicles[name].pose), now - self._at)
        self._followed, self._time, self._at = name, frame.time, now
        return viewpoint


def _orbit(wish: SetCamera, pose: Pose) -> Viewpoint:
    """Around the middle of the vehicle, in the directions of the map: it does not turn with the vehicle."""
    target = _sum(_vector(pose), rotate(_orientation(pose), ORBIT_TARGET))
    distance = min(max(wish.distance, ORBIT_NEAREST), ORBIT_FARTHEST)
    elevation = min(max(wish.elevation, -0.5 * math.pi), 0.5 * math.pi)
    return orbit(target, distance, wish.azimuth / DEGREE, elevation / DEGREE)


def _sum(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _vector(pose: Pose) -> Vector:
    x, y, z = pose.position.tolist()
    return x, y, z


def _orientation(pose: Pose) -> tuple[float, float, float, float]:
    w, x, y, z = pose.orientation.tolist()
    return w, x, y, z
