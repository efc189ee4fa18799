"""2D LIDAR: ranges in one plane of the sensor's own frame, against everything but the own vehicle (report, table 7)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.descriptions import Spec
from autodrive.jit import jit, resolved
from autodrive.model import Shapes
from autodrive.protocol.messages import LidarScan
from autodrive.sensors.fan import cast_fan
from autodrive.sensors.lidar_noise import LidarErrors, LidarNoise, classify
from autodrive.sensors.sensor import Mount, Sensor
from autodrive.sensors.sweep import Moment, cast_sweep
from autodrive.state import Floats, State


class LidarSpec(Spec):
    """A scanning range finder; by default the RPLIDAR A1 of the report.

    The rays spread over one revolution, or from `angle_min_deg` to `angle_max_deg`, or by `angle_increment_deg`. Ray 0
    looks along `angle_min_deg`, where 0 is straight ahead; the index grows to the left, or to the right where
    angle_max is below angle_min or the increment is negative.
    """

    mount: Mount = Mount()
    """Centre and axes of the scan."""
    rate: float = Field(default=7.0, gt=0.0)
    """Scans a second [Hz]; the first is complete one period after the start."""
    rays: int = Field(default=360, ge=1)
    """Ranges in a scan."""
    angle_min_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    """Bearing of the first ray [deg], left positive."""
    angle_max_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Bearing of the last ray [deg]."""
    angle_increment_deg: float | None = None
    """From a ray to the next [deg]; instead of `angle_max_deg`."""
    range_min: float = Field(default=0.15, ge=0.0)
    """What is nearer [m] is reported as -inf (REP 117)."""
    range_max: float = Field(default=12.0, gt=0.0)
    """What is farther [m] is reported as +inf (REP 117)."""
    intensity: float = 47.0
    """Reported for every ray."""
    is_rolling: bool = False
    """False: all rays at one instant. True: each ray at its own time, while the head turns once a period."""
    noise: LidarNoise = LidarNoise()

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.range_max <= self.range_min:
            raise ValueError(f"range_max {self.range_max:g} m must be above range_min {self.range_min:g} m")
        if self.angle_max_deg is not None and self.angle_increment_deg is not None:
            raise ValueError("the rays spread up to angle_max_deg or by angle_increment_deg, not by both")
        if self.angle_max_deg is not None and self.rays == 1:
            raise ValueError("one ray looks along angle_min_deg and needs no angle_max_deg")
        if self.angle_increment == 0.0:
            raise ValueError("the rays must spread: their increment is 0")
        if abs(self.angle_increment) * (self.rays - 1) > 2.0 * math.pi * (1.0 + 1e-9):
            spread = math.degrees(abs(self.angle_increment) * (self.rays - 1))
            raise ValueError(f"the rays spread over {spread:g} deg; a scan spans 360 at most")
        return self

    @property
    def angle_min(self) -> float:
        """Bearing of ray 0 [rad]."""
        return math.radians(self.angle_min_deg)

    @property
    def angle_increment(self) -> float:
        """From a ray to the next [rad]."""
        if self.angle_max_deg is not None:
            return math.radians(self.angle_max_deg - self.angle_min_deg) / (self.rays - 1)
        if self.angle_increment_deg is not None:
            return math.radians(self.angle_increment_deg)
        return 2.0 * math.pi / self.rays

    @property
    def time_increment(self) -> float:
        """From a ray to the next [s]: the head turns once a period."""
        return abs(self.angle_increment) / (2.0 * math.pi * self.rate) if self.is_rolling else 0.0


class Lidar(Sensor[LidarScan]):
    """Casts a whole scan at one instant."""

    def __init__(self, spec: LidarSpec) -> None:
        self._noise = None if spec.noise == LidarNoise() else LidarErrors(spec.noise, spec.rays)
        super().__init__(self._noise)
        self._spec = spec
        self._mount = spec.mount.position, spec.mount.orientation
        angles = spec.angle_min + spec.angle_increment * np.arange(spec.rays)
        self._directions = np.stack([np.cos(angles), np.sin(angles)])
        self._inverse_range = np.zeros(spec.rays)
        self._constants = _constants(spec)
        # a fan is cast from right to left, and turned over afterwards where the index grows to the right
        self._is_clockwise = spec.angle_increment < 0.0
        self._fan = np.ascontiguousarray(self._directions[:, ::-1]) if self._is_clockwise else self._directions
        self._cast_fan: Callable[..., None] | None = None
        self._fan_start, self._fan_increment = float(angles.min()), abs(spec.angle_increment)

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> LidarScan | None:
        """The scan as of now."""
        self._cast(shapes, state, vehicle)
        if self._is_clockwise:
            self._inverse_range = self._inverse_range[::-1].copy()
        return self._scan(time)

    def _cast(self, shapes: Shapes, state: State, vehicle: int) -> None:
        arguments = (
            state.vehicle_position[vehicle],
            state.vehicle_orientation[vehicle],
            *self._mount,
            self._fan,
            self._fan_start,
            self._fan_increment,
            self._spec.range_max,
            vehicle,
            shapes.kind,
            shapes.size,
            shapes.bounding_radius,
            shapes.vehicle,
            state.shape_position,
            state.shape_rotation,
            self._inverse_range,
        )
        if self._cast_fan is None:
            self._cast_fan = resolved(cast_fan, *arguments)
        self._cast_fan(*arguments)

    def _scan(self, time: float) -> LidarScan:
        """The reading made of the inverse ranges."""
        spec = self._spec
        ranges = np.empty(spec.rays)
        if self._noise is None:
            _measure(self._inverse_range, spec.range_min, spec.range_max, ranges)
        else:
            self._noise.measure(self._inverse_range, spec.range_min, spec.range_max, ranges)
        ranges.flags.writeable = False
        return LidarScan(time=time, ranges=ranges, **self._constants)


class RollingLidar(Lidar):
    """Casts each ray at its own time: `sample` it every tick. Between ticks the pose is interpolated.

    The last ray of scan n leaves at n / rate, the ones before it each `time_increment` earlier.
    """

    def __init__(self, spec: LidarSpec) -> None:
        super().__init__(spec)
        self._time = 0.0
        self._moment: Moment | None = None
        self._scan_number = 1
        self._next_ray = 0

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything, and draw all noise from `rng` from now on."""
        super().reset(rng)
        self._moment = None
        self._scan_number, self._next_ray = 1, 0

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> LidarScan | None:
        """The newest complete scan."""
        newest = self.latest
        moment = Moment.of(state, vehicle)
        while self._moment is not None:
            ray_times = self._ray_times()
            due = int(np.searchsorted(ray_times, time + 1e-9, side="right"))  # a clock's rounding error is no delay
            fractions = np.clip((ray_times - self._time) / max(time - self._time, 1e-12), 0.0, 1.0)
            cast_sweep(
                self._moment,
                moment,
                self._mount,
                self._directions,
                range(self._next_ray, due),
                fractions,
                self._spec.range_max,
                vehicle,
                shapes,
                self._inverse_range,
            )
            self._next_ray = due
            if due < self._spec.rays:
                break
            newest = self._scan(float(ray_times[-1]))
            self._scan_number, self._next_ray = self._scan_number + 1, 0
        self._time, self._moment = time, moment
        return newest

    def _ray_times(self) -> Floats:
        """When each ray of the scan in progress leaves [s], shape (n_ray,)."""
        rays_to_go = np.arange(self._spec.rays - 1, -1, -1, dtype=np.float64)
        return self._scan_number / self._spec.rate - self._spec.time_increment * rays_to_go

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        progress = self._time, self._moment, self._scan_number, self._next_ray, self._inverse_range.copy()
        return super().save(), progress

    def restore(self, saved: Any) -> None:
        """Go on as from the moment of `save`."""
        sensor, (self._time, self._moment, self._scan_number, self._next_ray, inverse_range) = saved
        super().restore(sensor)
        self._inverse_range[:] = inverse_range


def _constants(spec: LidarSpec) -> dict[str, Any]:
    """What every scan of that LIDAR has in common."""
    intensities = np.full(spec.rays, spec.intensity)
    intensities.flags.writeable = False
    return {
        "intensities": intensities,
        "angle_min": spec.angle_min,
        "angle_increment": spec.angle_increment,
        "range_min": spec.range_min,
        "range_max": spec.range_max,
        "scan_rate": spec.rate,
        "scan_time": 1.0 / spec.rate,
        "time_increment": spec.time_increment,
    }


@jit
def _measure(inverse_range: Floats, range_min: float, range_max: float, ranges: Floats) -> None:
    for i in range(len(ranges)):
        ranges[i] = classify(1.0 / inverse_range[i], range_min, range_max)
