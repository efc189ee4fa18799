"""The sensors that a vehicle can have, by name."""

from __future__ import annotations

from autodrive.base.specs import Spec
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuSpec
from autodrive.physics.sensors.ips import IpsSpec
from autodrive.physics.sensors.lidar import LidarSpec
from autodrive.physics.sensors.range import RangeSpec


class SensorSuiteSpec(Spec):
    """The sensors of a vehicle without the cameras; the throttle and steering sensors have no options."""

    encoders: EncoderSpec = EncoderSpec()
    ips: IpsSpec = IpsSpec()
    imu: ImuSpec = ImuSpec()
    lidar: LidarSpec | None = None
    range: RangeSpec | None = None


ALWAYS_READ = frozenset({"encoders", "ips", "imu"})
"""Sensors that have a reading in every Frame."""
