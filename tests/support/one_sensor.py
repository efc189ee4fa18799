"""One sensor of a vehicle in a scene of `tests.support.sensor_scenes`, sampled by the code that a World uses."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuSpec
from autodrive.physics.sensors.ips import IpsSpec
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.settings import ConfiguredSensor
from autodrive.physics.sensors.suite import SensorSuite
from tests.support.sensor_scenes import SensorScene

NAMES = {EncoderSpec: "encoders", IpsSpec: "ips", ImuSpec: "imu", LidarSpec: "lidar"}

GRAVITY = 9.81


class OneSensor:
    """Samples one sensor of a vehicle; a LIDAR keeps its rate, the others sample at each call."""

    def __init__(self, spec: Any, where: SensorScene, *, vehicle: int = 0, tick: Fraction = Fraction(1, 1000)) -> None:
        """`tick` [s]: the time between two calls of `sample`."""
        self._name = NAMES.get(type(spec), "range")
        self._vehicle = vehicle
        self.tick = tick
        if not isinstance(spec, LidarSpec):
            spec = spec.model_copy(update={"rate": None})
        sensors = {self._name: ConfiguredSensor(spec, is_on=True, noise="file")}
        vehicles = {f"V{i + 1}": sensors if i == vehicle else {} for i in range(len(where.state.vehicle_position))}
        self._suite = SensorSuite(vehicles, where.shapes, where.state, substep=self.tick, substeps=1, gravity=GRAVITY)
        self.reset()

    def reset(self, seed: int = 0) -> None:
        """Forget all readings; the noise depends on the seed."""
        self._suite.reset(seed)
        self._now = -1

    def sample(self, time: float | Fraction | None = None) -> Any:
        """The reading at a time [s]; None: one tick later."""
        self._now = self._now + 1 if time is None else round(Fraction(time) / self.tick)
        self._suite.sample(self._now)
        return self._suite.readings(self._vehicle)[self._name]
