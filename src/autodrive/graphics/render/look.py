"""Lights of the scene: sun and sky by day and by night, and the beam of each vehicle lamp.

Units are those of glTF's KHR_lights_punctual (irradiance for the sun, candela for lamps), with one exposure for day and
another for night. All values were chosen by eye. The page draws with the same table (`light_table`).
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from autodrive.base.transforms import Vector
from autodrive.base.units import DEGREE
from autodrive.physics.weather import extinction
from autodrive.protocol.messages import Weather

LEAST_EXTINCTION = 0.005
"""Clearer air is not drawn: in 10 m it takes less than 5 % of the light [1/m]."""


class Air(NamedTuple):
    """The weather of a picture."""

    clouds: float = 0.0
    """Share of the sky that hides the sun."""
    extinction: float = 0.0
    """[1/m]."""
    rain: float = 0.0
    snow: float = 0.0
    wind: float = 0.0
    wetness: float = 0.0
    snow_cover: float = 0.0

    @property
    def effects(self) -> tuple[str, ...]:
        """What surfaces show of it, as flags of the shaders; see `LEAST_EXTINCTION`."""
        effects = {"AIR": self.extinction > LEAST_EXTINCTION, "WET": self.wetness > 0.0, "SNOW": self.snow_cover > 0.0}
        return tuple(flag for flag, is_set in effects.items() if is_set)


@dataclass(frozen=True)
class Daylight:
    """Sun (or moon), sky and exposure."""

    sun_direction: Vector
    """Unit vector towards the sun."""
    sun_color: Vector
    """Irradiance of a surface that faces the sun."""
    zenith: Vector
    """Irradiance by a sky that has the colour of the zenith everywhere."""
    horizon: Vector
    """Irradiance by a sky that has the colour of the horizon everywhere."""
    floor_glow: Vector
    """Light reflected from below, as irradiance."""
    exposure: float
    """Factor for all reflected light."""
    glow: float
    """Factor for light that lamps and other surfaces emit."""
    sun_place: Vector
    """Unit vector towards the sun or moon in the sky; `sun_direction` is never so low."""
    dusk: float
    """How dark it is for people, from 0 by day to 1 by night: lamps are lit from `LAMPS_LIT` on, and windows one after
    another."""
    dawn: Vector = (0.0, 0.0, 0.0)
    """Light of the sky near the horizon below a low sun."""
    air: Air = Air()  # noqa: RUF009  it is constant

    @property
    def are_lamps_lit(self) -> bool:
        """Whether the traffic drives with headlights, and the light of lamps is seen on what they illuminate."""
        return self.dusk >= LAMPS_LIT

    @property
    def effects(self) -> tuple[str, ...]:
        """What surfaces show of weather and dusk, as flags of the shaders."""
        return (*self.air.effects, "WINDOWS") if self.dusk > WINDOWS_LIT else self.air.effects


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
    sun_place=_towards(118, 44),
    dusk=0.0,
)
NIGHT = Daylight(
    sun_direction=_towards(118, 60),
    sun_color=(0.030, 0.033, 0.042),
    zenith=(0.020, 0.025, 0.042),
    horizon=(0.045, 0.050, 0.066),
    floor_glow=(0.014, 0.014, 0.016),
    exposure=1.7,
    glow=0.36,
    sun_place=_towards(118, 60),
    dusk=1.0,
)


DAY_LENGTH = 86400.0
"""[s]."""
NOON_AZIMUTH, NOON_ELEVATION = 118 * DEGREE, 44 * DEGREE
"""Direction towards the sun at noon: that of `DAY`."""
LEAST_ELEVATION = 8 * DEGREE
"""The sun is drawn no lower, because shadows become longer than maps."""
FULL_DAY_ELEVATION = 20 * DEGREE
"""The light is that of `DAY` above this elevation."""
LAMPS_LIT = 0.5
"""`Daylight.dusk` from which on lamps are lit: a clear sky with the sun at `LEAST_ELEVATION`."""
WINDOWS_LIT = 0.45
"""`Daylight.dusk` above which the first windows can be lit; `WINDOWS_LIT` in shaders/light.glsl."""
CLOUD_DUSK = 0.65
"""`Daylight.dusk` by clouds that hide the whole sky: lamps are lit under more than three quarters of them at noon."""
DAWN: tuple[tuple[float, Vector], ...] = (
    (-9 * DEGREE, (0.0, 0.0, 0.0)),
    (-4 * DEGREE, (0.08, 0.03, 0.025)),
    (0.0, (0.50, 0.20, 0.08)),
    (4 * DEGREE, (0.85, 0.40, 0.15)),
    (10 * DEGREE, (0.55, 0.33, 0.16)),
    (22 * DEGREE, (0.0, 0.0, 0.0)),
)
"""`Daylight.dawn` by the elevation of the sun."""


def sun_at(time_of_day: float) -> Vector:
    """Unit vector towards the sun at an equinox: it rises at 6:00, is highest at noon and sets at 18:00."""
    hour_angle = 2.0 * math.pi * (time_of_day / DAY_LENGTH - 0.5)
    along, up = math.cos(NOON_ELEVATION) * math.cos(hour_angle), math.sin(NOON_ELEVATION) * math.cos(hour_angle)
    across = -math.sin(hour_angle)  # positive in the morning: to the left of the direction of noon
    c, s = math.cos(NOON_AZIMUTH), math.sin(NOON_AZIMUTH)
    return along * c - across * s, along * s + across * c, up


def is_day_at(time_of_day: float) -> bool:
    """Whether the sun is above the horizon."""
    return sun_at(time_of_day)[2] > 1e-9


def look_at(time_of_day: float) -> Daylight:
    """Sun, sky and exposure at a time of day [s since midnight], in steps of a minute."""
    return _look_at_minute(math.floor(time_of_day / 60.0) % 1440)


@lru_cache(maxsize=64)
def _look_at_minute(minute: int) -> Daylight:
    time = 60.0 * minute
    x, y, z = sun_at(time)
    if math.asin(z) <= DAWN[0][0]:
        return NIGHT
    dawn = _dawn(math.asin(z))
    if not is_day_at(time):
        return replace(NIGHT, sun_place=(x, y, z), dawn=dawn)
    elevation = max(math.asin(z), LEAST_ELEVATION)
    flat = math.cos(elevation) / math.hypot(x, y)
    share = min(math.asin(z) / FULL_DAY_ELEVATION, 1.0)

    def mixed(night: Vector, day: Vector) -> Vector:
        a, b, c = (n + share * (d - n) for n, d in zip(night, day, strict=True))
        return a, b, c

    red, green, blue = mixed(NIGHT.sun_color, DAY.sun_color)
    return Daylight(
        sun_direction=(x * flat, y * flat, math.sin(elevation)),
        sun_color=(red, green * (0.75 + 0.25 * share), blue * (0.5 + 0.5 * share)),  # a low sun is red
        zenith=mixed(NIGHT.zenith, DAY.zenith),
        horizon=mixed(NIGHT.horizon, DAY.horizon),
        floor_glow=mixed(NIGHT.floor_glow, DAY.floor_glow),
        exposure=NIGHT.exposure + share * (DAY.exposure - NIGHT.exposure),
        glow=NIGHT.glow + share * (DAY.glow - NIGHT.glow),
        sun_place=(x, y, z),
        dusk=min(max(LAMPS_LIT * (2.0 - math.asin(z) / LEAST_ELEVATION), 0.0), 1.0),
        dawn=dawn,
    )


def needs_lamps(is_day: bool, time_of_day: float | None, weather: Weather | None) -> bool:
    """`Daylight.are_lamps_lit` in that light [s since midnight, None: fixed] and weather (None: clear)."""
    look = fixed_look(is_day) if time_of_day is None else look_at(time_of_day)
    return look.dusk + CLOUD_DUSK * clouds_of(weather or Weather()) >= LAMPS_LIT


def fixed_look(is_day: bool) -> Daylight:
    """Sun, sky and exposure without a time of day."""
    return DAY if is_day else NIGHT


def _dawn(elevation: float) -> Vector:
    elevations, colors = [elevation for elevation, _ in DAWN], np.array([color for _, color in DAWN])
    red, green, blue = (float(np.interp(elevation, elevations, channel)) for channel in colors.T)
    return red, green, blue


@dataclass(frozen=True)
class Beam:
    """The light cone of a lamp: brightest within the inner angle, dark outside the outer one."""

    intensity: float
    """Intensity on the axis of the beam [cd], at the scale of the vehicle."""
    inner: float
    """Half angle [rad]."""
    outer: float
    """Half angle [rad]."""
    pitch: float
    """Downwards [rad]."""
    is_forward: bool
    cutoff: float = 0.0
    """Sharpness of a low beam's upper edge, at the height of the axis (1 / sine of the soft edge); 0: no edge."""


BEAMS = {
    "head": Beam(2.2, 6 * DEGREE, 36 * DEGREE, 2.0 * DEGREE, True, cutoff=14.0),
    "high_beam": Beam(6.0, 2 * DEGREE, 15 * DEGREE, 0.5 * DEGREE, True),
    "front_indicator": Beam(0.012, 35 * DEGREE, 85 * DEGREE, 10 * DEGREE, True),
    "rear_indicator": Beam(0.012, 35 * DEGREE, 85 * DEGREE, 10 * DEGREE, False),
    "tail": Beam(0.014, 35 * DEGREE, 85 * DEGREE, 10 * DEGREE, False),
    "reverse": Beam(0.06, 20 * DEGREE, 60 * DEGREE, 15 * DEGREE, False),
}
"""Beams by the lamp names of `LightsSpec`."""


def clouds_of(weather: Weather) -> float:
    """Share of the sky that clouds hide: rain, snow and fog come with clouds."""
    return max(weather.clouds, 0.8 * weather.rain, 0.7 * weather.snow, 0.7 * weather.fog)


def air_of(weather: Weather) -> Air:
    """The weather of a picture."""
    clouds = clouds_of(weather)
    wetness, snow_cover = weather.wetness or 0.0, weather.snow_cover or 0.0
    return Air(clouds, extinction(weather), weather.rain, weather.snow, weather.wind, wetness, snow_cover)


@lru_cache(maxsize=64)
def in_air(look: Daylight, air: Air) -> Daylight:
    """The light in that weather: clouds take most of the sun, which fades shadows, and make the sky grey.

    A camera exposes snow for a shorter time.
    """
    c = air.clouds

    def grey(colour: Vector, factor: float) -> Vector:
        mean = factor * (0.3 * colour[0] + 0.5 * colour[1] + 0.2 * colour[2])
        red, green, blue = (part + c * (mean - part) for part in colour)
        return red, green, blue

    red, green, blue = look.sun_color
    sun = 1.0 - 0.93 * c
    dark = max(0.0, 1.0 - 2.0 * look.zenith[1])
    return replace(
        look,
        sun_color=(sun * red, sun * green, sun * blue),
        zenith=grey(look.zenith, 0.95),
        horizon=grey(look.horizon, 0.9),
        floor_glow=grey(look.floor_glow, 0.8),
        dawn=grey(look.dawn, 0.3),
        dusk=min(look.dusk + CLOUD_DUSK * c, 1.0),
        # white ground is bright, most of all before headlights
        exposure=look.exposure * (1.0 - air.snow_cover * (0.15 + 0.4 * dark)),
        air=air,
    )


def light_table() -> dict[str, Any]:
    """The tables of light of this module as plain data; 'minutes': the look at every tenth minute of a day."""
    return {
        "day": _plain(DAY),
        "night": _plain(NIGHT),
        "minutes": [_plain(look_at(60.0 * minute)) for minute in range(0, 1440, 10)],
        "beams": {name: asdict(beam) for name, beam in BEAMS.items()},
    }


def _plain(look: Daylight) -> dict[str, Any]:
    return {name: value for name, value in asdict(look).items() if name != "air"}
