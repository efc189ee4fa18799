"""Camera sensors: Spec, pose of the optical frame, and conversion of rendered images to readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.arrays import read_only
from autodrive.base.elementary import tan
from autodrive.base.transforms import Quaternion, Vector, compose, quaternion_from_rotation_vector, rotate
from autodrive.base.units import DEGREE
from autodrive.physics.sensors.camera.exposure import Exposure, lens_shading, shutter
from autodrive.physics.sensors.camera.imperfections import PRESETS, CameraImperfections, Hardware
from autodrive.physics.sensors.camera.optics import covers_whole_image, ideal_pinhole, least_zoom, rays
from autodrive.physics.sensors.camera.view import RenderedImage, View
from autodrive.physics.sensors.sensor import STRONG, Mount, NoisePreset, Schedule, SensorSpec, random_generator
from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray


OPTICAL: Quaternion = (0.5, -0.5, 0.5, -0.5)
"""Rotation from the optical frame (x right, y down, z forward) to body axes (x forward, y left, z up), REP 103."""


MAX_PIXELS = 2**24
"""Most pixels of an image."""

SensorEdge = Annotated[float, Field(ge=1e-5, le=1.0)]


class CameraSpec(SensorSpec):
    """A pinhole camera, ideal unless it has imperfections; its optical axis is the x axis of the mount.

    `fit` selects the parameters of the pinhole. 'vertical': vertical field of view, square pixels, like Unity's
    Camera.fieldOfView. 'horizontal': focal length and sensor width, square pixels, like Unity's physical camera with
    the gate fit of that name. 'sensor': focal length, sensor width and height; pixels are not square if the aspect
    ratios of image and sensor differ.
    """

    NOISE: ClassVar[str] = "imperfections"

    mount: Mount
    width: int = Field(ge=1, le=8192)
    """Image width [pixels]."""
    height: int = Field(ge=1, le=8192)
    """Image height [pixels]."""
    fit: Literal["vertical", "horizontal", "sensor"] = "vertical"
    field_of_view_deg: float | None = Field(default=None, ge=0.01, lt=180)
    """Vertical field of view [deg]."""
    focal_length: float | None = Field(default=None, ge=1e-5, le=10)
    """Focal length [m]."""
    sensor_size: tuple[SensorEdge, SensorEdge] | None = None
    """Width and height of the sensor [m]."""
    near: float = Field(default=0.01, ge=1e-4, le=1e4)
    """Near clipping distance [m]."""
    far: float = Field(default=1000.0, ge=1e-3, le=1e6)
    """Far clipping distance [m]."""
    depth: bool = False
    """Whether images include the depth of each pixel."""
    labels: bool = False
    """Whether images include the label of each pixel."""
    instances: bool = False
    """Whether images include the number of the object that each pixel shows."""
    imperfections: CameraImperfections = CameraImperfections()
    """Imperfections of lens, shutter and sensor."""
    hardware: Hardware = "raspberry_pi_v1"
    """Camera model whose imperfections a vehicle with realistic sensors uses."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        needed = ("field_of_view_deg",) if self.fit == "vertical" else ("focal_length", "sensor_size")
        if missing := [name for name in needed if getattr(self, name) is None]:
            raise ValueError(f"a camera with fit '{self.fit}' needs {' and '.join(missing)}")
        if self.far <= self.near:
            raise ValueError(f"far {self.far} must be greater than near {self.near}")
        if self.width * self.height > MAX_PIXELS:
            raise ValueError(f"an image of {self.width} x {self.height} has more than {MAX_PIXELS} pixels")
        if not covers_whole_image(self.intrinsics):
            raise ValueError(
                f"this distortion is too strong: the lens shows nothing in the corners of the image. {self._way_out()}"
            )
        return self

    def _way_out(self) -> str:
        """Which values the distortion permits."""
        zoom = least_zoom(self.intrinsics)
        if self.fit == "vertical":
            widest = 2.0 * math.atan(0.5 * self.height / (zoom * self.intrinsics.fy)) / DEGREE
            limit = f"field_of_view_deg of at most {math.floor(10.0 * widest) / 10.0:g}"
        else:
            assert self.focal_length is not None
            limit = f"focal_length of at least {1.005 * zoom * self.focal_length:.3g} m"  # the last digit is rounded
        kept = "" if math.isinf(zoom) else f"a {limit}, or "
        return f"Choose {kept}'hardware: rectified' or 'imperfections: rectified', a lens without distortion"

    def realistic(self) -> CameraSpec:
        """A copy with the imperfections of its hardware."""
        return self.model_copy(update={"imperfections": PRESETS[self.hardware]})

    @property
    def noises(self) -> dict[NoisePreset, CameraImperfections]:
        """Presets of imperfections: none, those of the hardware of the camera, and those with stronger noise."""
        real = PRESETS[self.hardware]
        return {"ideal": CameraImperfections(), "realistic": real, "strong": real.scaled(STRONG)}

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """Pinhole parameters in pixels, and lens distortion."""
        if self.fit == "vertical":
            assert self.field_of_view_deg is not None
            fx = fy = 0.5 * self.height / tan(0.5 * self.field_of_view_deg * DEGREE)
        else:
            assert self.focal_length is not None
            assert self.sensor_size is not None
            fx = self.focal_length * self.width / self.sensor_size[0]
            fy = fx if self.fit == "horizontal" else self.focal_length * self.height / self.sensor_size[1]
        return CameraIntrinsics(
            self.width, self.height, fx, fy, 0.5 * self.width, 0.5 * self.height, self.imperfections.distortion
        )


def world_from_camera(position: Vector, orientation: Quaternion, mount: Mount) -> tuple[Vector, Quaternion]:
    """Pose of the optical frame in the map frame, given the pose of the vehicle and the mount of the camera."""
    x, y, z = rotate(orientation, mount.position)
    px, py, pz = position
    return (px + x, py + y, pz + z), compose(compose(orientation, mount.orientation), OPTICAL)


class Camera:
    """One camera of one vehicle: provides the views to render and converts the rendered images to a reading.

    A shutter with an exposure or readout time needs several views. They follow the motion of the camera, extrapolated
    from the velocity of the vehicle; everything else stays where it is at the time of the image.
    """

    def __init__(self, spec: CameraSpec, *, vehicle: str, name: str, substep: Fraction) -> None:
        """`substep` [s] is the unit of simulated time."""
        self.spec = spec
        self.intrinsics = spec.intrinsics
        self._name = vehicle, name
        self._schedule = None if spec.rate is None else Schedule.of(spec.rate, substep)
        self._sampled_at: int | None = None
        self._substep = substep
        self._formation = None if spec.imperfections.is_none else ImageFormation(spec)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Restart; the noise depends on `seed`, the vehicle's name and the camera's name."""
        self._sampled_at = None
        vehicle, name = self._name
        self._rng = random_generator(seed, vehicle, f"camera {name}")

    def is_due(self, now: int) -> bool:
        """Whether an image is due at `now` [substeps]."""
        return self._schedule is None or self._schedule.is_due(now, self._sampled_at)

    def views(self, vehicle: np.void, time: float) -> list[View]:
        """Views to render for an image at `time` [s]; `vehicle` is a row of `render_state.VEHICLE`."""
        if self._formation is None:
            return [View(*self._pose(vehicle), self.intrinsics, self.spec.near, self.spec.far)]
        ideal = self._formation.ideal
        times = self._formation.times.tolist()
        return [View(*self._pose(vehicle, later), ideal, self.spec.near, self.spec.far) for later in times]

    def image_from(self, rendered: Sequence[RenderedImage], vehicle: np.void, now: int) -> CameraImage:
        """The reading at `now` [substeps] from the images that were rendered for `views`, in the same order.

        Pose, depth, labels and instances belong to the time of the reading, which is the middle of the exposure.
        """
        self._sampled_at = now
        position, orientation = self._pose(vehicle)
        middle = rendered[len(rendered) // 2]
        if self._formation is not None:
            middle = self._formation.apply(rendered, self._rng)
        return CameraImage(
            time=now * self._substep.numerator / self._substep.denominator,
            pose=Pose(read_only(np.array(position)), read_only(np.array(orientation))),
            intrinsics=self.intrinsics,
            rgba=read_only(middle.rgba),
            depth=read_only(middle.depth) if self.spec.depth and middle.depth is not None else None,
            labels=read_only(middle.labels) if self.spec.labels and middle.labels is not None else None,
            instances=read_only(middle.instances) if self.spec.instances and middle.instances is not None else None,
        )

    def save(self) -> Any:
        """The complete internal state, for `restore`."""
        return self._sampled_at, self._rng.bit_generator.state

    def restore(self, saved: Any) -> None:
        """Set the state that `save` returned."""
        self._sampled_at, self._rng.bit_generator.state = saved

    def _pose(self, vehicle: np.void, later: float = 0.0) -> tuple[Vector, Quaternion]:
        """Pose of the optical frame, extrapolated by `later` [s] with the velocity of the vehicle."""
        position, orientation = tuple(vehicle["position"].tolist()), tuple(vehicle["orientation"].tolist())
        if later:
            x, y, z = rotate(orientation, tuple((later * vehicle["velocity"]).tolist()))
            position = position[0] + x, position[1] + y, position[2] + z
            turn = quaternion_from_rotation_vector((later * vehicle["angular_velocity"]).tolist())
            orientation = compose(orientation, turn)
        return world_from_camera(position, orientation, self.spec.mount)


class ImageFormation:
    """Model of lens, shutter and sensor: converts ideal images to the image that the camera reports."""

    def __init__(self, spec: CameraSpec) -> None:
        imperfections = spec.imperfections
        self.ideal, places = spec.intrinsics, None
        """Intrinsics of the ideal camera of the rendered images."""
        if any(imperfections.distortion):
            self.ideal, places = ideal_pinhole(spec.intrinsics)
        self.times, self._shares = shutter(imperfections, spec.height)
        self._shading = lens_shading(imperfections, rays(spec.intrinsics))
        self._noise = imperfections.white_electrons, imperfections.read_noise
        self._exposure = Exposure(spec.intrinsics, places)
        self._nearest = None if places is None else np.round(places).astype(np.intp)

    def apply(self, rendered: Sequence[RenderedImage], rng: np.random.Generator) -> RenderedImage:
        """The reported image, given images rendered at `times`; the rest of it is that of the middle one."""
        self._exposure.begin()
        for image, shares in zip(rendered, self._shares, strict=True):
            self._exposure.add(image.rgba, shares)
        middle = rendered[len(rendered) // 2]
        return RenderedImage(
            rgba=self._exposure.read(self._shading, *self._noise, rng),
            depth=self._distort(middle.depth),
            labels=self._distort(middle.labels),
            instances=self._distort(middle.instances),
        )

    def _distort(self, values: NDArray[Any] | None) -> NDArray[Any] | None:
        """Resample to the distorted image by nearest neighbour; depths and labels cannot be interpolated."""
        if values is None or self._nearest is None:
            return values
        return values[self._nearest[..., 1], self._nearest[..., 0]]
