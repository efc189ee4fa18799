"""The sensors of a vehicle by name: their specs, construction and sampling."""

from __future__ import annotations

from collections.abc import Callable, Collection
from fractions import Fraction
from typing import Any

from autodrive.model import Shapes
from autodrive.sensors.encoder import Encoders, EncoderSpec
from autodrive.sensors.imu import Imu, ImuSpec
from autodrive.sensors.ips import Ips, IpsSpec
from autodrive.sensors.lidar import Lidar, LidarSpec, RollingLidar
from autodrive.sensors.range import Range, RangeSpec
from autodrive.sensors.sensor import Schedule, Sensor, SensorSpec, random_generator
from autodrive.specs import Spec
from autodrive.state import State


class SensorSuiteSpec(Spec):
    """The sensors of a vehicle without the cameras; the throttle and steering sensors have no options."""

    encoders: EncoderSpec = EncoderSpec()
    ips: IpsSpec = IpsSpec()
    imu: ImuSpec = ImuSpec()
    lidar: LidarSpec | None = None
    range: RangeSpec | None = None


class SensorSuite:
    """The sensors of one vehicle; each holds its latest reading."""

    def __init__(
        self,
        spec: SensorSuiteSpec,
        *,
        vehicle: int,
        name: str,
        substep: Fraction,
        gravity: float,
        frozen: Collection[str] = (),
    ) -> None:
        """Sensors of the vehicle with index `vehicle` and this `name`.

        `substep` [s] is the unit of simulated time; `gravity` [m/s^2] is positive downward. `frozen`: names of sensors
        that sample once at the start and keep that reading.
        """
        self._vehicle = vehicle
        self._name = name
        self._ratio = substep.numerator, substep.denominator
        specs: dict[str, Any] = {sensor: its for sensor, its in spec if its is not None}
        self._settings = {sensor: (its, sensor in frozen) for sensor, its in specs.items()}
        self._sensors: dict[str, Sensor[Any]] = {
            sensor: Imu(its, gravity) if isinstance(its, ImuSpec) else _SENSORS[type(its)](its)
            for sensor, its in specs.items()
        }
        self._absent = dict.fromkeys(set(SensorSuiteSpec.model_fields) - set(specs))
        self._schedules = [ONCE if sensor in frozen else _schedule(its, substep) for sensor, its in specs.items()]
        self._sampled_at: int | None = None

    def reset(self, seed: int) -> None:
        """Reset all sensors; the noise depends on `seed`, the vehicle's name and the sensor's name."""
        self._sampled_at = None
        for name, sensor in self._sensors.items():
            sensor.reset(random_generator(seed, self._name, name))

    def sample(self, shapes: Shapes, state: State, substeps: int) -> None:
        """Sample the sensors that are due at `substeps` since reset; call it at 0 and after each tick."""
        numerator, denominator = self._ratio
        time = substeps * numerator / denominator
        for sensor, schedule in zip(self._sensors.values(), self._schedules, strict=True):
            if schedule is None or schedule.is_due(substeps, self._sampled_at):
                sensor.latest = sensor.sample(shapes, state, self._vehicle, time)
        self._sampled_at = substeps

    def continue_from(self, before: SensorSuite, seed: int, shapes: Shapes, state: State, substeps: int) -> None:
        """Continue the sensors of another suite that have the same settings; start the others at `substeps`."""
        self.reset(seed)
        numerator, denominator = self._ratio
        time = substeps * numerator / denominator
        for name, sensor in self._sensors.items():
            if before._settings.get(name) == self._settings[name]:
                sensor.restore(before._sensors[name].save())
            else:
                sensor.latest = sensor.sample(shapes, state, self._vehicle, time)
        self._sampled_at = substeps

    def readings(self) -> dict[str, Any]:
        """The latest reading of each sensor by its name in the Spec; None: no reading yet, or no such sensor."""
        readings = {name: sensor.latest for name, sensor in self._sensors.items()}
        readings.update(self._absent)
        return readings

    def save(self) -> Any:
        """The complete internal state, for `restore`."""
        return self._sampled_at, [sensor.save() for sensor in self._sensors.values()]

    def restore(self, saved: Any) -> None:
        """Set the state that `save` returned."""
        self._sampled_at, sensors = saved
        for sensor, one in zip(self._sensors.values(), sensors, strict=True):
            sensor.restore(one)


ALWAYS_READ = frozenset({"encoders", "ips", "imu"})
"""Sensors that have a reading in every Frame."""

ONCE = Schedule(samples=0, substeps=1)
"""One sample at the start."""


def _schedule(spec: SensorSpec | LidarSpec, substep: Fraction) -> Schedule | None:
    """None: one sample per tick."""
    if isinstance(spec, LidarSpec):
        return None if spec.is_rolling else Schedule.of(spec.rate, substep)
    return None if spec.rate is None else Schedule.of(spec.rate, substep)


def _lidar(spec: LidarSpec) -> Lidar:
    return RollingLidar(spec) if spec.is_rolling else Lidar(spec)


_SENSORS: dict[type[Spec], Callable[[Any], Sensor[Any]]] = {
    EncoderSpec: Encoders,
    IpsSpec: Ips,
    LidarSpec: _lidar,
    RangeSpec: Range,
}
"""Constructors by Spec; the IMU also needs gravity and is not listed."""
