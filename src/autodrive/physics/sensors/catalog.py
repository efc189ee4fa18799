"""The table of the sensors that a vehicle can have: one field of `SensorSuiteSpec` for each.

The Spec of a sensor says what its values and its noise are, and which function samples it (`sensor.Sampled`).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import accumulate, pairwise
from typing import Any, get_args

from autodrive.base.specs import Spec
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuSpec
from autodrive.physics.sensors.ips import IpsSpec
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.range import RangeSpec
from autodrive.physics.sensors.sensor import Sampled


class SensorSuiteSpec(Spec):
    """The sensors of a vehicle without the cameras; the throttle and steering sensors have no options."""

    encoders: EncoderSpec = EncoderSpec()
    ips: IpsSpec = IpsSpec()
    imu: ImuSpec = ImuSpec()
    lidar: LidarSpec | None = None
    range: RangeSpec | None = None


def _kinds() -> Iterator[tuple[str, type[Sampled]]]:
    for name, field in SensorSuiteSpec.model_fields.items():
        annotation: Any = field.annotation
        yield (
            name,
            next(
                type_
                for type_ in (*get_args(annotation), annotation)
                if isinstance(type_, type) and issubclass(type_, Sampled)
            ),
        )


KINDS: dict[str, type[Sampled]] = dict(_kinds())
"""The Spec of each sensor by its name."""
SENSORS = tuple(KINDS)
"""Names of the sensors, in the order of all arrays with an axis of sensors."""
NUMBERS = {name: s for s, name in enumerate(SENSORS)}
"""Place of each sensor in that axis."""
ALWAYS_READ = frozenset(name for name, field in SensorSuiteSpec.model_fields.items() if field.default is not None)
"""Sensors that have a reading in every Frame."""


def _places(counts: list[int]) -> dict[str, slice]:
    return {
        name: slice(first, last)
        for name, (first, last) in zip(SENSORS, pairwise(accumulate(counts, initial=0)), strict=True)
    }


VALUES = _places([kind.VALUES for kind in KINDS.values()])
"""Places of the values of each sensor in `ReadingColumns.values`."""
NOISY_VALUES = _places([kind.NOISY_VALUES for kind in KINDS.values()])
"""Places of its channels of noise."""
