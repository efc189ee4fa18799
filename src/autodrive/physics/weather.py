"""What the weather does to sight, tyres and LIDARs, in units of physics.

A `Weather` has amounts from 0 to 1. The maps are about a tenth as large as streets, and so are the distances of fog:
its sight is 5 m at most instead of 50 m. Rain and snow have their natural rates.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

from msgspec.structs import replace

from autodrive.base.elementary import exp, log
from autodrive.protocol.messages import Weather
from autodrive.protocol.weather import is_clear

# -- the air ------------------------------------------------------------------------------------------------------

FOG_SIGHT = 5.0
"""Sight in the densest fog [m]; it is inversely proportional to the square of the amount of fog."""
RAIN_RATE = 50.0
"""Rate of the heaviest rain [mm/h]: 'violent' (UK Met Office); it is proportional to the square of the amount."""
SNOW_RATE = 10.0
"""Rate of the heaviest snow, as water [mm/h]; it is proportional to the square of the amount."""
LN_20 = 2.995732273553991
"""Sight is the distance at which a contrast falls to 5 %: ln(20) / extinction (meteorological optical range, WMO)."""
PER_DECIBEL = 2.302585092994046e-4
"""Extinction [1/m] of one decibel per kilometre."""
WAVELENGTH = 905.0
"""Wavelength of the LIDARs [nm]. Drops are much larger: extinction of visible light and of the LIDARs is the same."""


def extinction(weather: Weather) -> float:
    """Share of light that is lost per length [1/m], by fog, rain and snow (Recommendation ITU-R P.1814, section 3.1.2).

    Rain of R mm/h: 1.076 R^0.67 dB/km; dry snow of S mm/h: (5.42e-5 lambda + 5.4958776) S^1.38 dB/km.
    """
    fog = LN_20 / FOG_SIGHT * weather.fog * weather.fog
    rain = 1.076 * power(RAIN_RATE * weather.rain * weather.rain, 0.67)
    snow = (5.42e-5 * WAVELENGTH + 5.4958776) * power(SNOW_RATE * weather.snow * weather.snow, 1.38)
    return fog + PER_DECIBEL * (rain + snow)


def sight(weather: Weather) -> float:
    """Meteorological optical range [m]; infinite in clear air."""
    lost = extinction(weather)
    return LN_20 / lost if lost > 0.0 else float("inf")


def power(base: float, exponent: float) -> float:
    """A power of a number that is not negative, with the same bits on every processor."""
    return exp(exponent * log(base)) if base > 0.0 else 0.0


# -- the ground ---------------------------------------------------------------------------------------------------

SOAKED = 0.5
"""Rain, or snow, from this amount on makes the ground entirely wet, or white."""
WETTING, DRYING = 20.0, 300.0
"""Time constants of the wetness of the ground [s]; our choice, for runs of minutes."""
COVERING, MELTING = 60.0, 300.0
"""Time constants of the snow cover of the ground [s]; our choice, for runs of minutes."""
SETTLED = 1e-3
"""A difference of wetness or snow cover from its steady value that is no longer followed."""


class ChangingWeather(NamedTuple):
    """The weather as a function of simulated time: wetness and snow cover approach what rain and snow maintain."""

    weather: Weather = Weather()
    """The weather as it was set."""
    wetness: float = 0.0
    """Wetness at the simulated time `since`, 0 to 1; the snow cover belongs to that time, too."""
    snow_cover: float = 0.0
    since: float = 0.0
    """[s]."""

    @classmethod
    def settled(cls, weather: Weather) -> ChangingWeather:
        """The weather, with the wetness and snow cover that it has after a long time."""
        return cls(weather, *_steady(weather))

    def following(self, weather: Weather, time: float) -> ChangingWeather:
        """Another weather from that simulated time [s] on."""
        now = self.at(time)
        wetness = now.wetness if weather.wetness is None else weather.wetness
        snow_cover = now.snow_cover if weather.snow_cover is None else weather.snow_cover
        return ChangingWeather(weather, wetness or 0.0, snow_cover or 0.0, time)

    def at(self, time: float) -> Weather:
        """The weather at the simulated time [s], with the values of wetness and snow cover."""
        wet, covered = _steady(self.weather)
        elapsed = time - self.since
        return replace(
            self.weather,
            wetness=_approached(self.wetness, wet, elapsed, WETTING, DRYING),
            snow_cover=_approached(self.snow_cover, covered, elapsed, COVERING, MELTING),
        )

    def is_settled(self, time: float) -> bool:
        """Whether the ground no longer changes."""
        now = self.at(time)
        return (now.wetness, now.snow_cover) == _steady(self.weather)

    @property
    def is_clear(self) -> bool:
        """Whether the weather, as it was set, is clear."""
        return is_clear(self.weather)


def _steady(weather: Weather) -> tuple[float, float]:
    """Wetness and snow cover that rain and snow maintain, or that are held."""
    wet = min(1.0, weather.rain / SOAKED) if weather.wetness is None else weather.wetness
    covered = min(1.0, weather.snow / SOAKED) if weather.snow_cover is None else weather.snow_cover
    return float(wet), float(covered)


def _approached(start: float, end: float, elapsed: float, rising: float, falling: float) -> float:
    """First-order approach with another time constant [s] upwards than downwards."""
    rest = (start - end) * exp(-elapsed / (rising if end > start else falling))
    return end + rest if abs(rest) > SETTLED else end


# -- tyres --------------------------------------------------------------------------------------------------------


class Surface(NamedTuple):
    """What water and snow do to tyres on a surface: factors of the friction of the dry surface."""

    wet_grip: float
    snow_grip: float
    snow_resistance: float
    """Rolling resistance that a full cover of snow adds, per load."""


SNOW_RESISTANCE = 0.037
"""Rolling resistance that snow adds: that of an unpaved road, 0.05, less that of concrete, 0.013 (Wong, Theory of
Ground Vehicles, table 1.2): our choice."""

SURFACES = {
    "asphalt": Surface(0.60 / 0.85, 0.20 / 0.85, SNOW_RESISTANCE),
    "concrete": Surface(0.80 / 0.85, 0.20 / 0.85, SNOW_RESISTANCE),
    "gravel": Surface(1.0, 0.20 / 0.60, SNOW_RESISTANCE),
    "earth": Surface(0.55 / 0.68, 0.20 / 0.68, SNOW_RESISTANCE),
}
"""Factors of each surface by its name in `GroundSpec`: peak values of Wong, table 1.3 (after Taborek), who has no value
of wet gravel."""


class Road(NamedTuple):
    """State of the road for a tyre."""

    grip: float = 1.0
    """Factor of its friction."""
    resistance: float = 0.0
    """Additional rolling resistance per load."""


def road(surface: Surface, weather: Weather) -> Road:
    """Friction changes linearly with wetness and with the part of the ground that is white."""
    wetness, covered = weather.wetness or 0.0, weather.snow_cover or 0.0
    bare = 1.0 + (surface.wet_grip - 1.0) * wetness
    return Road(bare + (surface.snow_grip - bare) * covered, surface.snow_resistance * covered)


# -- LIDARs -------------------------------------------------------------------------------------------------------

REFLECTIVITY = {
    "ground": 0.15,
    "vehicle": 0.2,
    "box": 0.6,
    "wall": 0.5,
    "duct": 0.5,
    "block": 0.4,
    "post": 0.3,
    "plate": 0.8,
    "housing": 0.1,
}
"""Reflectivity of what a LIDAR hits, dry, at 905 nm: our choice, for asphalt, black plastic, cardboard, plaster and
paint."""
TARGETS = {name: number for number, name in enumerate(REFLECTIVITY)}
"""Number of each."""

BACKSCATTER = 0.046 / LN_20
"""Back-scattered per extinction [1/sr]: 0.046 / sight in fog (Rasshofer and others 2011; Hahner and others 2021, (6)).

We take the same for rain and snow.
"""
PULSE = 0.75
"""Length of air whose back-scatter arrives at the same time [m]: half of the way of light in 5 ns.

That length of the pulse is our choice.
"""
OVERLAP = 1.0
"""Distance from which on the receiver sees the whole beam [m] (Hahner and others 2021: R2 of the Velodyne HDL-64E)."""
VARIATION = 0.1
"""The range at which a ray is lost differs by so much from ray to ray: our choice."""


def wet_reflectivity(reflectivity: float) -> float:
    """Reflectivity of the same surface under a film of water (Lekner and Dorf, Applied Optics 27, 1988, 1278).

    Light that the surface scatters is reflected back to it at the inside of the film with the probability
    p = 1 - (1 - 0.066) / n^2, n = 1.33. 2 % of the incoming light is reflected by the film like by a mirror, and lost.
    """
    inside = 1.0 - (1.0 - 0.066) / (1.33 * 1.33)
    return 0.98 * (1.0 - inside) * reflectivity / (1.0 - inside * reflectivity)


def detection_range(reflectivity: float, lost: float, range_max: float, rated: float) -> float:
    """Greatest range [m] of a target in air with the extinction `lost` [1/m].

    A LIDAR detects a target while P = reflectivity exp(-2 lost R) / R^2 is at least that of a target of reflectivity
    `rated` at `range_max` in clear air (Goodin and others, Electronics 8, 2019, 89: Beer-Lambert law for both ways).
    The solution is W(lost R0) / lost with Lambert's W and R0 = range_max sqrt(reflectivity / rated).
    """
    clear = range_max * sqrt(reflectivity / rated)
    if clear == 0.0:
        return 0.0
    r, c = clear / (1.0 + lost * clear), log(clear)
    for _ in range(50):  # Newton's method for ln r + lost r = c
        before, r = r, r * (1.0 + c - log(r)) / (1.0 + lost * r)
        if abs(r - before) <= 1e-12 * r:
            break
    return r


def backscatter(lost: float) -> float:
    """Reflectivity of a target at `OVERLAP` that sends back as much as the air there, on average.

    Hahner and others 2021, (5): the air is a soft target, whose back-scatter is greatest at R2.
    """
    return pi * BACKSCATTER * lost * PULSE * exp(-2.0 * lost * OVERLAP)
