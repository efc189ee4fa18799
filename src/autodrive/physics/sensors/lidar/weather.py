"""What the weather does to the scans of a LIDAR: reduced range, lost rays, and false returns of the air."""

from __future__ import annotations

from typing import Protocol

from autodrive.base.arrays import Floats, Integers
from autodrive.base.elementary import exp, log
from autodrive.base.jit import jit_uncounted
from autodrive.physics.sensors.columns import NoiseColumns
from autodrive.physics.sensors.random_stream import Stream, new_stream, uniform
from autodrive.physics.sensors.sensor import random_generator
from autodrive.physics.weather import (
    OVERLAP,
    REFLECTIVITY,
    TARGETS,
    VARIATION,
    backscatter,
    detection_range,
    extinction,
    wet_reflectivity,
)
from autodrive.protocol.messages import Weather

EXTINCTION, BACKSCATTER, THRESHOLD, FIRST = range(4)
"""Places of the figures: extinction [1/m], reflectivity of the air, least power, reflectivities, ranges [m]."""
KINDS = len(TARGETS)
WIDTH = FIRST + 2 * KINDS
"""Number of figures."""
WEATHER = 6
"""Place of the first one in `NoiseColumns.lidar`."""
GROUND = TARGETS["ground"]


class Ranging(Protocol):
    """The parts of a `LidarSpec` that matter in weather."""

    @property
    def range_max(self) -> float:
        """[m]."""
        ...

    @property
    def rated_reflectivity(self) -> float:
        """Reflectivity at which the LIDAR sees as far as `range_max`, see `weather.detection_range`."""
        ...


def figures(weather: Weather, range_max: float, rated: float) -> list[float]:
    """The figures of a LIDAR in `NoiseColumns.lidar`; `range_max` [m] and `rated`: see `weather.detection_range`."""
    wetness = weather.wetness or 0.0
    lost = extinction(weather)
    if lost == 0.0 and wetness == 0.0:
        return [0.0] * WIDTH
    reflectivities = [r + wetness * (wet_reflectivity(r) - r) for r in REFLECTIVITY.values()]
    return [
        lost,
        backscatter(lost),
        rated / (range_max * range_max),
        *reflectivities,
        *(detection_range(r, lost, range_max, rated) for r in reflectivities),
    ]


def set_lidar_weather(
    columns: NoiseColumns, k: int, i: int, name: str, weather: Weather, lidar: Ranging, seed: int
) -> None:
    """Set the weather of the LIDAR of vehicle i of world k, which has this `name`.

    Its random stream depends on `seed` and `name`, and begins when there is weather for the first time.
    """
    columns.lidar[k, i, WEATHER:] = figures(weather, lidar.range_max, lidar.rated_reflectivity)
    stream = columns.stream[k, i, -1]
    if columns.lidar[k, i, WEATHER + THRESHOLD] > 0.0 and not stream.any():
        stream[:] = new_stream(random_generator(seed, name, "weather"))


@jit_uncounted
def pass_weather(inverse_range: Floats, hits: Integers, targets: Integers, figures: Floats, stream: Stream) -> None:
    """Change the inverse ranges [1/m] of a scan: 0 for a ray that is lost, that of the air for a false return.

    `hits`: number of the shape that each ray hits, -1 for the ground; `targets`: its kind, a number of
    `weather.TARGETS`. The air at `OVERLAP` has a mean power, around which the power of one ray is distributed
    exponentially (speckle: Goodman, Statistical Optics, section 6.2). The ray returns from the air if that power is the
    greatest and above the threshold. It comes from a little beyond `OVERLAP`, with the decay of the power there,
    exp(-2 extinction r) / r^2.
    """
    lost, air, least = figures[EXTINCTION], figures[BACKSCATTER], figures[THRESHOLD]
    share = exp(-least / air) if air > 0.0 else 0.0
    decay = 2.0 * lost + 2.0 / OVERLAP
    for n in range(len(inverse_range)):
        w = inverse_range[n]
        kind = GROUND if hits[n] < 0 else targets[hits[n]]
        reach = figures[FIRST + KINDS + kind] * w  # relative to the range of the target
        if w > 0.0 and reach < 1.0 + VARIATION and reach < 1.0 + VARIATION * (2.0 * uniform(stream) - 1.0):
            inverse_range[n] = 0.0
        draw = uniform(stream)
        if draw >= share or w * OVERLAP >= 1.0:
            continue
        echo = figures[FIRST + kind] * w * w * exp(-2.0 * lost / w) if w > 0.0 else 0.0
        if -air * log(draw) > echo * OVERLAP * OVERLAP:
            inverse_range[n] = max(w, 1.0 / (OVERLAP - log(uniform(stream)) / decay))
