"""How the scene is lit: sun and sky by day and by night, and what each lamp of a vehicle throws.

The units are those of glTF's KHR_lights_punctual (irradiance of a sun, candela of a lamp), at one exposure for day and
another for night; all values are ours, chosen by eye. A page draws with the same table (`light_table`).
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from autodrive.transforms import Vector
from autodrive.units import DEGREE


@dataclass(frozen=True)
class Daylight:
    """Sun (or moon), sky and exposure."""

    sun_direction: Vector
    """Unit vector towards it."""
    sun_color: Vector
    """Irradiance of a surface that faces it."""
    zenith: Vector
    """Irradiance by a sky all of this colour; likewise the next two."""
    horizon: Vector
    floor_glow: Vector
    """What comes back from below."""
    exposure: float
    """Factor of all light that is thrown back."""
    glow: float
    """Factor of the light that lamps show themselves."""


def _towards(azimuth_deg: float, elevation_deg: float) -> Vector:
    azimuth, elevation = azimuth_deg * DEGREE, elevation_deg * DEGREE
    flat = math.cos(elevation)
    return flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)


DAY = Daylight(
    sun_direction=_towards(118, 44),
    sun_color=(4.1, 3.85, 3.45),
    zenith=(1.35, 1.75, 2.35),
    horizon=(2.15, 2.3, 2.5),
    floor_glow=(0.75, 0.72, 0.66),
    exposure=0.92,
    glow=0.30,
)
NIGHT = Daylight(
    sun_direction=_towards(118, 60),
    sun_color=(0.030, 0.033, 0.042),
    zenith=(0.020, 0.025, 0.042),
    horizon=(0.045, 0.050, 0.066),
    floor_glow=(0.014, 0.014, 0.016),
    exposure=1.7,
    glow=0.36,
)


@dataclass(frozen=True)
class Beam:
    """What a lamp throws: a cone, brightest within the inner angle, nothing outside the outer one."""

    intensity: float
    """On its axis [cd], at scale."""
    inner: float
    """Half angle [rad]."""
    outer: float
    """Half angle [rad]."""
    pitch: float
    """Downwards [rad]."""
    is_forward: bool
    cutoff: float = 0.0
    """How sharply it ends at the height of its axis, as a low beam does (1 / sine of the soft edge); 0: not at all."""


BEAMS = {
    "head": Beam(2.2, 6 * DEGREE, 36 * DEGREE, 2.0 * DEGREE, True, cutoff=14.0),
    "high_beam": Beam(6.0, 2 * DEGREE, 15 * DEGREE, 0.5 * DEGREE, True),
    "front_indicator": Beam(0.012, 35 * DEGREE, 85 * DEGREE, 10 * DEGREE, True),
    "rear_indicator": Beam(0.012, 35 * DEGREE, 85 * DEGREE, 10 * DEGREE, False),
    "tail": Beam(0.014, 35 * DEGREE, 85 * DEGREE, 10 * DEGREE, False),
    "reverse": Beam(0.06, 20 * DEGREE, 60 * DEGREE, 15 * DEGREE, False),
}
"""By the lamp names of `LightsSpec`."""


def light_table() -> dict[str, Any]:
    """All of this as plain data."""
    return {"day": asdict(DAY), "night": asdict(NIGHT), "beams": {name: asdict(beam) for name, beam in BEAMS.items()}}
