"""Where a client's scene camera is, from the client's `SetCamera` and the Frame to draw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError
from autodrive.base.suggest import suggest
from autodrive.base.transforms import Quaternion, Vector, rotate
from autodrive.base.units import DEGREE
from autodrive.graphics.cameras.viewpoints import (
    BIRD_HIGHEST,
    BIRD_LOWEST,
    GodsEye,
    Viewpoint,
    birds_eye,
    drivers_eye,
    fly,
    orbit,
    scene_cameras,
)
from autodrive.physics.sensors.camera.camera import world_from_camera
from autodrive.physics.sensors.camera.view import View

if TYPE_CHECKING:
    from collections.abc import Mapping

    from autodrive.graphics.cameras.rig import CameraSlot
    from autodrive.protocol.messages import Frame, Pose
    from autodrive.protocol.native import SetCamera, ViewSensor
    from autodrive.scenario.vehicles.spec import VehicleSpec

CAMERAS = (*scene_cameras(), "Orbit", "Fly")

ORBIT_TARGET: Vector = (0.07, 0.0, 0.05)
"""Target of the orbit in the vehicle frame: the middle of the car [m]."""
ORBIT_NEAREST, ORBIT_FARTHEST = 0.15, 12.0
"""Limits of its distance [m]."""

LEAST_ZOOM, MOST_ZOOM = 0.1, 20.0
"""Limits of the focal length, relative to the standard one."""

WIDTH_STEP, LEAST_STEPS, MOST_STEPS = 160, 1, 12
"""Image sizes are multiples of 160 x 90 pixels: few sizes, each exactly 16:9."""


def check_view(view: SetCamera, vehicles: Sequence[str]) -> None:
    """Raises `AutodriveError` if the camera or vehicle is not known, or a number is not finite."""
    if view.camera not in CAMERAS:
        raise AutodriveError(f"scene camera '{view.camera}' is not known. {suggest(str(view.camera), [*CAMERAS])}")
    if view.vehicle is not None and view.vehicle not in vehicles:
        raise AutodriveError(f"vehicle '{view.vehicle}' is not known. {suggest(view.vehicle, list(vehicles))}")
    if view.vehicle is None and not vehicles and view.camera != "Fly":
        raise AutodriveError("a scene camera follows a vehicle, and this scenario has no vehicle")
    for name in ("height", "azimuth", "elevation", "distance", "position", "force_scale"):
        value = getattr(view, name)
        if not all(map(math.isfinite, value if name == "position" else (value,))):
            raise AutodriveError(f"{name} of a scene camera must be finite, not {value}")
    if not LEAST_ZOOM <= view.zoom <= MOST_ZOOM:
        raise AutodriveError(f"zoom of a scene camera must be {LEAST_ZOOM:g} to {MOST_ZOOM:g}, not {view.zoom}")
    if not 0.0 <= view.force_scale <= 1e9:
        raise AutodriveError(f"force_scale of a scene camera must be 0 to 1e9 N, not {view.force_scale}")


def check_sensor(view: ViewSensor, slots: Sequence[CameraSlot]) -> CameraSlot:
    """The camera of that view. Raises `AutodriveError` if there is none, or a number is wrong."""
    vehicle = view.vehicle or (slots[0].vehicle if slots else "")
    known = {slot.camera: slot for slot in slots if slot.vehicle == vehicle}
    if view.camera not in known:
        raise AutodriveError(f"camera '{view.camera}' of '{vehicle}' is not on. {suggest(str(view.camera), [*known])}")
    if not 0.01 <= view.farthest <= 1e6:
        raise AutodriveError(f"farthest of a ViewSensor must be 0.01 to 1e6 m, not {view.farthest}")
    if view.width < 16:
        raise AutodriveError(f"the width of a ViewSensor must be 16 pixels or more, not {view.width}")
    return known[view.camera]


def sensor_view(view: ViewSensor, slot: CameraSlot, frame: Frame) -> View:
    """What that camera sees in that Frame, without the distortion of its lens."""
    spec = slot.spec
    width = min(view.width, spec.width)
    height = max(1, round(width / spec.width * spec.height))
    place = world_from_camera(*_place(frame.vehicles[slot.vehicle].pose), spec.mount)
    return View(*place, spec.intrinsics.resized(width, height), spec.near, spec.far)


def image_size(width: int) -> tuple[int, int]:
    """Width and height [pixels] of the image for a requested width: the nearest size, 160 to 1920 wide."""
    steps = min(max(round(width / WIDTH_STEP), LEAST_STEPS), MOST_STEPS)
    return WIDTH_STEP * steps, WIDTH_STEP * steps * 9 // 16


class SceneCamera:
    """The scene camera of one client. Only God's Eye depends on the previous images."""

    def __init__(self, vehicles: Mapping[str, VehicleSpec]) -> None:
        self._vehicles = vehicles
        self._god: GodsEye | None = None
        self._followed = ""
        self._time = self._at = 0.0

    def viewpoint(self, view: SetCamera, frame: Frame, now: float) -> Viewpoint:
        """Viewpoint for that Frame at wall time `now` [s]; `view` has passed `check_view`."""
        return self._standard(view, frame, now).zoomed(view.zoom)

    def _standard(self, view: SetCamera, frame: Frame, now: float) -> Viewpoint:
        """The viewpoint with the standard focal length."""
        if view.camera == "Fly":
            self._god = None
            return fly(view.position, view.azimuth, view.elevation)
        name = view.vehicle or next(iter(frame.vehicles))
        pose = frame.vehicles[name].pose
        if view.camera == "God's Eye":
            return self._gods_eye(name, frame, now)
        self._god = None
        if view.camera == "Driver's Eye":
            return drivers_eye(*_place(pose))
        if view.camera == "Bird's Eye":
            return birds_eye(_place(pose)[0], min(max(view.height, BIRD_LOWEST), BIRD_HIGHEST))
        return _orbit(view, pose)

    def _gods_eye(self, name: str, frame: Frame, now: float) -> Viewpoint:
        """Turns to follow the vehicle; jumps to another vehicle, and after a reset."""
        if self._god is None or name != self._followed or frame.time < self._time:
            self._god = GodsEye(0.5 * max(self._vehicles[name].size))
            self._at = now
        viewpoint = self._god.step(_place(frame.vehicles[name].pose)[0], now - self._at)
        self._followed, self._time, self._at = name, frame.time, now
        return viewpoint


def _orbit(view: SetCamera, pose: Pose) -> Viewpoint:
    """Around the middle of the vehicle, along the axes of the map: it does not turn with the vehicle."""
    (x, y, z), orientation = _place(pose)
    dx, dy, dz = rotate(orientation, ORBIT_TARGET)
    distance = min(max(view.distance, ORBIT_NEAREST), ORBIT_FARTHEST)
    elevation = min(max(view.elevation, -0.5 * math.pi), 0.5 * math.pi)
    return orbit((x + dx, y + dy, z + dz), distance, view.azimuth / DEGREE, elevation / DEGREE)


def _place(pose: Pose) -> tuple[Vector, Quaternion]:
    """Position [m] and orientation."""
    (x, y, z), (w, i, j, k) = pose.position.tolist(), pose.orientation.tolist()
    return (x, y, z), (w, i, j, k)
