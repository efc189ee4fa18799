"""Cameras: what they are, where they look, and how a drawn picture becomes a reading."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Pose
from autodrive.render.view import Picture, View
from autodrive.sensors.sensor import Mount, Schedule, SensorSpec
from autodrive.transforms import Quaternion, Vector, compose, rotate
from autodrive.units import DEGREE

if TYPE_CHECKING:
    from numpy.typing import NDArray

OPTICAL: Quaternion = (0.5, -0.5, 0.5, -0.5)
"""Body axes (x forward, y left, z up) from the optical frame (x right, y down, z forward), REP 103."""


class CameraSpec(SensorSpec):
    """An ideal pinhole camera; its optical axis is the mount's x axis.

    `fit` says which figures make the pinhole. 'vertical': the vertical field of view, with square pixels, as Unity's
    Camera.fieldOfView. 'horizontal': focal length and width of the sensor, with square pixels, as Unity's physical
    camera with the gate fit of that name. 'sensor': focal length, width and height of the sensor; then pixels are not
    square where the picture's proportions differ from the sensor's.
    """

    mount: Mount
    width: int = Field(gt=0, le=8192)
    """[pixels]."""
    height: int = Field(gt=0, le=8192)
    """[pixels]."""
    fit: Literal["vertical", "horizontal", "sensor"] = "vertical"
    field_of_view_deg: float | None = Field(default=None, gt=0, lt=180)
    """Vertical field of view [degree]."""
    focal_length: float | None = Field(default=None, gt=0)
    """[m]."""
    sensor_size: tuple[float, float] | None = None
    """Width and height [m]."""
    near: float = Field(default=0.01, gt=0)
    """Nothing nearer is seen [m]."""
    far: float = Field(default=1000.0, gt=0)
    """Nothing farther is seen [m]."""
    depth: bool = False
    """Whether pictures come with the depth of each pixel."""
    labels: bool = False
    """Whether pictures come with what each pixel shows."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        needed = ("field_of_view_deg",) if self.fit == "vertical" else ("focal_length", "sensor_size")
        if missing := [name for name in needed if getattr(self, name) is None]:
            raise ValueError(f"a camera with fit '{self.fit}' needs {' and '.join(missing)}")
        if self.far <= self.near:
            raise ValueError(f"far {self.far} must be greater than near {self.near}")
        return self

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """The pinhole in pixels."""
        if self.fit == "vertical":
            assert self.field_of_view_deg is not None
            fx = fy = 0.5 * self.height / math.tan(0.5 * self.field_of_view_deg * DEGREE)
        else:
            assert self.focal_length is not None
            assert self.sensor_size is not None
            fx = self.focal_length * self.width / self.sensor_size[0]
            fy = fx if self.fit == "horizontal" else self.focal_length * self.height / self.sensor_size[1]
        return CameraIntrinsics(self.width, self.height, fx, fy, 0.5 * self.width, 0.5 * self.height)


def world_from_camera(position: Vector, orientation: Quaternion, mount: Mount) -> tuple[Vector, Quaternion]:
    """Pose of the optical frame in the map, of a camera mounted on a vehicle in that pose."""
    x, y, z = rotate(orientation, mount.position)
    px, py, pz = position
    return (px + x, py + y, pz + z), compose(compose(orientation, mount.orientation), OPTICAL)


def project(intrinsics: CameraIntrinsics, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where points of the optical frame [m], shape (n, 3), are seen [pixels], shape (n, 2); nan behind the camera."""
    k = intrinsics
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    pixels = np.column_stack([k.cx + k.fx * x, k.cy + k.fy * y])
    pixels[points[:, 2] <= 0.0] = np.nan
    return pixels


class Camera:
    """One camera of one vehicle: says from where pictures are to be drawn, and makes readings of them."""

    def __init__(self, spec: CameraSpec, *, vehicle: str, name: str, substep: Fraction) -> None:
        """`substep` [s] is the unit of the world's clock."""
        self.spec = spec
        self.intrinsics = spec.intrinsics
        self._name = vehicle, name
        self._schedule = None if spec.rate is None else Schedule.of(spec.rate, substep)
        self._sampled_at: int | None = None
        self._substep = substep

    def reset(self, seed: int) -> None:
        """Begin anew; noise follows from `seed`, the vehicle's name and the camera's."""
        self._sampled_at = None

    def is_due(self, now: int) -> bool:
        """Whether a picture is due at that time [substeps]."""
        return self._schedule is None or self._schedule.is_due(now, self._sampled_at)

    def views(self, vehicle: np.void, time: float) -> list[View]:
        """From where to draw for a picture at `time` [s], of a row of `moment.VEHICLE`."""
        position, orientation = self._pose(vehicle)
        return [View(position, orientation, self.intrinsics, self.spec.near, self.spec.far)]

    def develop(self, pictures: Sequence[Picture], vehicle: np.void, now: int) -> CameraImage:
        """The reading of what was drawn for `views`, in that order, at the time `now` [substeps]."""
        self._sampled_at = now
        position, orientation = self._pose(vehicle)
        (picture,) = pictures
        return CameraImage(
            time=now * self._substep.numerator / self._substep.denominator,
            pose=Pose(np.array(position), np.array(orientation)),
            intrinsics=self.intrinsics,
            rgba=picture.rgba,
            depth=picture.depth if self.spec.depth else None,
            labels=picture.labels if self.spec.labels else None,
        )

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return self._sampled_at

    def restore(self, saved: Any) -> None:
        """Go on as from the moment of `save`."""
        self._sampled_at = saved

    def _pose(self, vehicle: np.void) -> tuple[Vector, Quaternion]:
        return world_from_camera(
            tuple(vehicle["position"].tolist()), tuple(vehicle["orientation"].tolist()), self.spec.mount
        )
