"""The sensors that a vehicle has, by name, and how they are built and sampled together."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from autodrive.descriptions import Spec
from autodrive.model import Shapes
from autodrive.sensors.encoder import Encoders, EncoderSpec
from autodrive.sensors.imu import Imu, ImuNoise, ImuSpec
from autodrive.sensors.ips import Ips, IpsSpec
from autodrive.sensors.lidar import Lidar, LidarSpec, RollingLidar
from autodrive.sensors.lidar_noise import LidarNoise
from autodrive.sensors.sensor import Schedule, Sensor, SensorSpec, random_generator
from autodrive.state import State


class SensorSuiteSpec(Spec):
    """The sensors of a vehicle (cameras apart); the throttle and steering sensors need no description."""

    encoders: EncoderSpec = EncoderSpec()
    ips: IpsSpec = IpsSpec()
    imu: ImuSpec = ImuSpec()
    lidar: LidarSpec | None = None

    def realistic(self) -> SensorSuiteSpec:
        """The same sensors with the noise of the parts that the report names (table 1)."""
        imu = self.imu.model_copy(update={"noise": ImuNoise.realistic()})
        lidar = self.lidar and self.lidar.model_copy(update={"noise": LidarNoise.realistic()})
        return self.model_copy(update={"imu": imu, "lidar": lidar})


class SensorSuite:
    """The sensors of one vehicle; each holds its latest reading."""

    def __init__(self, spec: SensorSuiteSpec, *, vehicle: int, name: str, substep: Fraction, gravity: float) -> None:
        """Sensors of vehicle number `vehicle`, called `name`.

        `substep` [s] is the unit of the world's clock; `gravity` [m/s^2] points down.
        """
        self.encoders = Encoders(spec.encoders)
        self.ips = Ips(spec.ips)
        self.imu = Imu(spec.imu, gravity)
        self.lidar = None if spec.lidar is None else _lidar(spec.lidar)
        self._vehicle = vehicle
        self._name = name
        self._substep = substep
        self._sensors: dict[str, Sensor[Any]] = {"encoders": self.encoders, "ips": self.ips, "imu": self.imu}
        self._schedules = [_schedule(s, substep) for s in (spec.encoders, spec.ips, spec.imu)]
        if self.lidar is not None and spec.lidar is not None:
            self._sensors["lidar"] = self.lidar
            schedule = None if spec.lidar.is_rolling else Schedule.of(spec.lidar.rate, substep, first=1)
            self._schedules.append(schedule)
        self._sampled_at: int | None = None

    def reset(self, seed: int) -> None:
        """Forget everything; the noise of each sensor follows from `seed`, the vehicle's name and its own."""
        self._sampled_at = None
        for name, sensor in self._sensors.items():
            sensor.reset(random_generator(seed, self._name, name))

    def sample(self, shapes: Shapes, state: State, substeps: int) -> None:
        """Let every sensor that is due at that time [substeps since reset] measure; call it at 0, then each tick."""
        time = substeps * self._substep.numerator / self._substep.denominator
        for sensor, schedule in zip(self._sensors.values(), self._schedules, strict=True):
            if schedule is None or schedule.is_due(substeps, self._sampled_at):
                sensor.latest = sensor.sample(shapes, state, self._vehicle, time)
        self._sampled_at = substeps

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return self._sampled_at, [sensor.save() for sensor in self._sensors.values()]

    def restore(self, saved: Any) -> None:
        """Go on as from the moment of `save`."""
        self._sampled_at, sensors = saved
        for sensor, one in zip(self._sensors.values(), sensors, strict=True):
            sensor.restore(one)


def _schedule(spec: SensorSpec, substep: Fraction) -> Schedule | None:
    return None if spec.rate is None else Schedule.of(spec.rate, substep)


def _lidar(spec: LidarSpec) -> Lidar:
    return RollingLidar(spec) if spec.is_rolling else Lidar(spec)
