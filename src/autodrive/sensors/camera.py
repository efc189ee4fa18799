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
from autodrive.sensors.camera_exposure import Exposure, lens_shading, shutter
from autodrive.sensors.camera_imperfections import PRESETS, CameraImperfections, Hardware
from autodrive.sensors.camera_optics import ideal_pinhole, project, rays, sees_its_whole_picture
from autodrive.sensors.sensor import Mount, Schedule, SensorSpec, random_generator
from autodrive.transforms import Quaternion, Vector, compose, quaternion_from_rotation_vector, rotate
from autodrive.units import DEGREE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["OPTICAL", "Camera", "CameraSpec", "project", "rays", "world_from_camera"]

OPTICAL: Quaternion = (0.5, -0.5, 0.5, -0.5)
"""Body axes (x forward, y left, z up) from the optical frame (x right, y down, z forward), REP 103."""


class CameraSpec(SensorSpec):
    """A pinhole camera, ideal unless it has imperfections; its optical axis is the mount's x axis.

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
    imperfections: CameraImperfections = CameraImperfections()
    """Of lens, shutter and sensor."""
    hardware: Hardware = "raspberry_pi_v1"
    """Whose imperfections it has in a vehicle with realistic sensors."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        needed = ("field_of_view_deg",) if self.fit == "vertical" else ("focal_length", "sensor_size")
        if missing := [name for name in needed if getattr(self, name) is None]:
            raise ValueError(f"a camera with fit '{self.fit}' needs {' and '.join(missing)}")
        if self.far <= self.near:
            raise ValueError(f"far {self.far} must be greater than near {self.near}")
        if not sees_its_whole_picture(self.intrinsics):
            raise ValueError("with this distortion the lens shows nothing in the corners; it is too strong")
        return self

    def realistic(self) -> CameraSpec:
        """With the imperfections of its hardware."""
        return self.model_copy(update={"imperfections": PRESETS[self.hardware]})

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """The pinhole in pixels, and the distortion of its lens."""
        if self.fit == "vertical":
            assert self.field_of_view_deg is not None
            fx = fy = 0.5 * self.height / math.tan(0.5 * self.field_of_view_deg * DEGREE)
        else:
            assert self.focal_length is not None
            assert self.sensor_size is not None
            fx = self.focal_length * self.width / self.sensor_size[0]
            fy = fx if self.fit == "horizontal" else self.focal_length * self.height / self.sensor_size[1]
        return CameraIntrinsics(
            self.width, self.height, fx, fy, 0.5 * self.width, 0.5 * self.height, self.imperfections.distortion
        )


def world_from_camera(position: Vector, orientation: Quaternion, mount: Mount) -> tuple[Vector, Quaternion]:
    """Pose of the optical frame in the map, of a camera mounted on a vehicle in that pose."""
    x, y, z = rotate(orientation, mount.position)
    px, py, pz = position
    return (px + x, py + y, pz + z), compose(compose(orientation, mount.orientation), OPTICAL)


class Camera:
    """One camera of one vehicle: says from where pictures are to be drawn, and makes readings of them.

    A shutter that takes its time has several pictures drawn. They show the camera at several places of its way, as it
    follows from the vehicle's velocity, but all other things where they are at the picture's time.
    """

    def __init__(self, spec: CameraSpec, *, vehicle: str, name: str, substep: Fraction) -> None:
        """`substep` [s] is the unit of the world's clock."""
        self.spec = spec
        self.intrinsics = spec.intrinsics
        self._name = vehicle, name
        self._schedule = None if spec.rate is None else Schedule.of(spec.rate, substep)
        self._sampled_at: int | None = None
        self._substep = substep
        self._development = None if spec.imperfections.is_none else Development(spec)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Begin anew; noise follows from `seed`, the vehicle's name and the camera's."""
        self._sampled_at = None
        vehicle, name = self._name
        self._rng = random_generator(seed, vehicle, f"camera {name}")

    def is_due(self, now: int) -> bool:
        """Whether a picture is due at that time [substeps]."""
        return self._schedule is None or self._schedule.is_due(now, self._sampled_at)

    def views(self, vehicle: np.void, time: float) -> list[View]:
        """From where to draw for a picture at `time` [s], of a row of `moment.VEHICLE`."""
        if self._development is None:
            return [View(*self._pose(vehicle), self.intrinsics, self.spec.near, self.spec.far)]
        ideal = self._development.ideal
        times = self._development.times.tolist()
        return [View(*self._pose(vehicle, later), ideal, self.spec.near, self.spec.far) for later in times]

    def develop(self, pictures: Sequence[Picture], vehicle: np.void, now: int) -> CameraImage:
        """The reading of what was drawn for `views`, in that order, at the time `now` [substeps].

        Pose, depth and labels are those of the reading's time, in the middle of its exposure.
        """
        self._sampled_at = now
        position, orientation = self._pose(vehicle)
        middle = pictures[len(pictures) // 2]
        if self._development is not None:
            middle = self._development.develop(pictures, self._rng)
        return CameraImage(
            time=now * self._substep.numerator / self._substep.denominator,
            pose=Pose(np.array(position), np.array(orientation)),
            intrinsics=self.intrinsics,
            rgba=middle.rgba,
            depth=middle.depth if self.spec.depth else None,
            labels=middle.labels if self.spec.labels else None,
        )

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return self._sampled_at, self._rng.bit_generator.state

    def restore(self, saved: Any) -> None:
        """Go on as from the moment of `save`."""
        self._sampled_at, self._rng.bit_generator.state = saved

    def _pose(self, vehicle: np.void, later: float = 0.0) -> tuple[Vector, Quaternion]:
        """Of the optical frame, `later` [s] than the row's time if the vehicle goes on as it does."""
        position, orientation = tuple(vehicle["position"].tolist()), tuple(vehicle["orientation"].tolist())
        if later:
            x, y, z = rotate(orientation, tuple((later * vehicle["velocity"]).tolist()))
            position = position[0] + x, position[1] + y, position[2] + z
            turn = quaternion_from_rotation_vector((later * vehicle["angular_velocity"]).tolist())
            orientation = compose(orientation, turn)
        return world_from_camera(position, orientation, self.spec.mount)


class Development:
    """What is between the ideal pictures of a camera and its reading."""

    def __init__(self, spec: CameraSpec) -> None:
        of = spec.imperfections
        self.ideal, places = spec.intrinsics, None
        """The camera that the pictures are drawn with."""
        if any(of.distortion):
            self.ideal, places = ideal_pinhole(spec.intrinsics)
        self.times, self._shares = shutter(of, spec.height)
        self._shading = lens_shading(of, rays(spec.intrinsics))
        self._noise = of.white_electrons, of.read_noise
        self._exposure = Exposure(spec.intrinsics, places)
        self._nearest = None if places is None else np.round(places).astype(np.intp)

    def develop(self, pictures: Sequence[Picture], rng: np.random.Generator) -> Picture:
        """What the sensor reports of pictures drawn at `times`; depth and labels are those of the middle one."""
        self._exposure.begin()
        for picture, shares in zip(pictures, self._shares, strict=True):
            self._exposure.add(picture.rgba, shares)
        middle = pictures[len(pictures) // 2]
        return Picture(
            rgba=self._exposure.read(self._shading, *self._noise, rng),
            depth=self._bent(middle.depth),
            labels=self._bent(middle.labels),
        )

    def _bent(self, values: NDArray[Any] | None) -> NDArray[Any] | None:
        """As the lens shows it: the nearest pixel of the ideal picture, since depths and labels have no mean."""
        if values is None or self._nearest is None:
            return values
        return values[self._nearest[..., 1], self._nearest[..., 0]]
