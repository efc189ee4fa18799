"""Inertial Measurement Unit: orientation, angular velocity and linear acceleration at its mount (report, table 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from operator import itemgetter
from typing import Any, ClassVar

import numpy as np
from pydantic import model_validator

from autodrive.base.arrays import Floats
from autodrive.base.jit import inlined
from autodrive.base.specs import Offset, Spec
from autodrive.base.transforms import (
    compose,
    cross,
    euler_from_quaternion,
    inverse,
    quaternion_from_rotation_vector,
    rotate,
)
from autodrive.base.units import DEGREE, STANDARD_GRAVITY
from autodrive.physics.sensors.columns import Due, Memory, ReadingColumns, add_noise, mount_orientation
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.sensor import STRONG, Mount, NoisePreset, Reader, Sampled, SensorSpec
from autodrive.protocol.messages import ImuReading


class ImuNoise(Spec):
    """Noise of the three quantities. In a file, `realistic` means `ImuNoise.realistic()`."""

    orientation: NoiseSpec = NoiseSpec()
    """Small rotation about each axis of the sensor [rad]."""
    angular_velocity: NoiseSpec = NoiseSpec()
    """[rad/s]."""
    linear_acceleration: NoiseSpec = NoiseSpec()
    """[m/s^2]."""

    def scaled(self, factor: float) -> ImuNoise:
        """`factor` times the noise; resolutions stay."""
        return ImuNoise(**{name: noise.scaled(factor) for name, noise in self})

    @classmethod
    def realistic(cls) -> ImuNoise:
        """Noise of the MPU-9250 (data sheet InvenSense PS-MPU-9250A-01, revision 1.0, tables 1 and 2).

        White noise: the spectral density after the 92 Hz (94 Hz) low-pass filter: gyroscope 0.01 deg/s/sqrt(Hz),
        accelerometer 300 ug/sqrt(Hz). Offsets: the tolerances of an uncalibrated part, +-5 deg/s and +-60 mg, taken as
        three standard deviations. Resolution: 131 LSB/(deg/s) and 16384 LSB/g. The data sheet has no values for the
        bias walk and the orientation; both are 0.
        """
        return cls(
            angular_velocity=NoiseSpec(
                sigma=0.01 * math.sqrt(92.0) * DEGREE, offset=5.0 / 3.0 * DEGREE, step=DEGREE / 131.0
            ),
            linear_acceleration=NoiseSpec(
                sigma=300e-6 * math.sqrt(94.0) * STANDARD_GRAVITY,
                offset=60e-3 / 3.0 * STANDARD_GRAVITY,
                step=STANDARD_GRAVITY / 16384.0,
            ),
        )

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, value: Any) -> Any:
        return cls.realistic().model_dump() if value == "realistic" else value


@inlined
def sample(due: Due, values: Floats, row: Any, memory: Memory) -> None:
    """Orientation (4), Euler angles (3), angular velocity (3) and linear acceleration (3), with noise."""
    i, motion, gravity = due.i, memory.motion, row["gravity"]
    map_from_vehicle, acceleration = motion.vehicle_orientation[i], motion.vehicle_acceleration[i]
    angular_velocity, lever = motion.vehicle_angular_velocity[i], row["measured_at"]
    map_from_sensor = compose(map_from_vehicle, mount_orientation(due, row))
    sensor_from_vehicle = inverse(mount_orientation(due, row))
    # a = a_origin + alpha x r + omega x (omega x r), in vehicle axes
    euler_term = cross(motion.vehicle_angular_acceleration[i], lever)
    centripetal = cross(angular_velocity, cross(angular_velocity, lever))
    up = rotate(inverse(map_from_vehicle), (0.0, 0.0, 1.0))
    at_mount = (
        acceleration[0] + euler_term[0] + centripetal[0] + gravity * up[0],
        acceleration[1] + euler_term[1] + centripetal[1] + gravity * up[1],
        acceleration[2] + euler_term[2] + centripetal[2] + gravity * up[2],
    )
    errors = memory.working.values
    errors[0] = errors[1] = errors[2] = 0.0
    errors[3], errors[4], errors[5] = rotate(sensor_from_vehicle, angular_velocity)
    errors[6], errors[7], errors[8] = rotate(sensor_from_vehicle, at_mount)
    add_noise(due, memory, errors)
    if memory.noise.is_noisy[due.k, i, due.s]:  # the orientation is turned about the axes of the sensor
        map_from_sensor = compose(map_from_sensor, quaternion_from_rotation_vector(errors[:3]))
    values[0], values[1], values[2], values[3] = map_from_sensor
    values[4], values[5], values[6] = euler_from_quaternion(map_from_sensor)
    for c in range(6):
        values[7 + c] = errors[3 + c]


PARTS = (slice(0, 4), slice(4, 7), slice(7, 10), slice(10, 13))
"""Places of orientation, Euler angles, angular velocity and linear acceleration in the values."""


class ImuSpec(SensorSpec, Sampled):
    """A nine-axis IMU."""

    VALUES: ClassVar[int] = 13
    NOISY_VALUES: ClassVar[int] = 9
    COLUMNS: ClassVar[Mapping[str, Any]] = {
        "gravity": np.float64,
        "measured_at": (np.float64, 3),  # point whose acceleration it measures, in the vehicle frame [m]
    }
    sample: ClassVar[Any] = sample

    mount: Mount = Mount()
    """Point of the measurement and axes of the readings."""
    measured_at: tuple[Offset, Offset, Offset] | None = None
    """Point whose acceleration is measured, in the vehicle frame [m]; left out: that of the mount."""
    measures_specific_force: bool = False
    """False: acceleration without gravity. True: specific force of an accelerometer, +g upward at rest (REP 145)."""
    noise: ImuNoise = ImuNoise()

    @property
    def noises(self) -> dict[NoisePreset, ImuNoise]:
        """The realistic one is that of the MPU-9250."""
        real = ImuNoise.realistic()
        return {"ideal": ImuNoise(), "realistic": real, "strong": real.scaled(STRONG)}

    def parameters(self, gravity: float) -> dict[str, Any]:
        """Values of this sensor's columns in `SensorTables.vehicles`, by name."""
        measured_at = self.mount.position if self.measured_at is None else self.measured_at
        return {"gravity": gravity if self.measures_specific_force else 0.0, "measured_at": measured_at}

    def channel_noise(self) -> list[NoiseSpec]:
        """Noise of each of its channels: the three axes of each quantity have the same one."""
        return [axis_noise for _, noise in self.noise for axis_noise in [noise] * 3]

    def reader(self, readings: ReadingColumns, vehicle: int, first: int) -> Reader:
        """The function that makes an `ImuReading` from time and values, see `Sampled.reader`."""
        parts = [slice(first + part.start, first + part.stop) for part in PARTS]
        motion_of: Callable[[Floats], tuple[Floats, ...]] = itemgetter(*parts)
        return lambda time, values: ImuReading(time, *motion_of(values))
