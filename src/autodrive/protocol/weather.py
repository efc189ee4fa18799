"""The weathers that have a name, in the order of the numbers of the AutoDRIVE devkit."""

from __future__ import annotations

from msgspec.structs import astuple

from autodrive.protocol.messages import Weather

LIGHT, HEAVY = 0.3, 0.8
"""Amounts of fog, rain or snow."""

PRESETS = {
    "sunny": Weather(),
    "cloudy": Weather(clouds=0.8),
    "light_fog": Weather(clouds=0.3, fog=LIGHT),
    "heavy_fog": Weather(clouds=0.5, fog=HEAVY),
    "light_rain": Weather(clouds=0.7, rain=LIGHT),
    "heavy_rain": Weather(clouds=1.0, rain=HEAVY),
    "light_snow": Weather(clouds=0.7, snow=LIGHT),
    "heavy_snow": Weather(clouds=1.0, snow=HEAVY),
}
"""Weather by name. The devkit's `Weather` is the number in this order, from 1; its 0 is a weather of the script's
own."""


def is_clear(weather: Weather) -> bool:
    """Whether it is a clear sky over dry ground, without wind."""
    return not any(astuple(weather))
