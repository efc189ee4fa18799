"""The command `weather`: what a weather does to tyres, LIDARs and sight, in numbers; and the values of `--weather`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import typer

from autodrive.cli.options import argument


def weather(
    values: list[str] = argument(
        "A name (sunny, cloudy, light_fog, heavy_fog, light_rain, heavy_rain, light_snow, heavy_snow), "
        "amounts from 0 to 1 such as rain=0.6, and a time of day such as time=18:30.",
        ...,
        metavar="VALUE...",
    ),
) -> None:
    """Print what a weather means in numbers on asphalt: grip, stopping distances, ranges of the LIDARs, sight."""
    from autodrive.protocol.messages import Weather
    from autodrive.scenario import ScenarioSpec
    from autodrive.world.factory import make
    from autodrive.world.views.weather_numbers import weather_numbers

    world = make(ScenarioSpec(map="plane", **environment(values)))
    is_day = None if world.time_of_day is None else world.scene_light
    typer.echo(weather_numbers(world.weather or Weather(), world.map.ground, is_day=is_day))


def environment(values: Sequence[str]) -> dict[str, Any]:
    """Fields of a scenario for values such as 'heavy_fog', 'rain=0.6' and 'time=18:30'; commas also separate them.

    Raises `SpecError`.
    """
    from autodrive.base.errors import SpecError
    from autodrive.base.specs import checked
    from autodrive.scenario.scenario import ScenarioSpec, WeatherSpec

    amounts: dict[str, Any] = {}
    settings: dict[str, Any] = {}
    for value in values:
        if found_comma := re.search(r"(\w+=\d*),(\d+)", value):
            decimal = f"{found_comma[1]}.{found_comma[2]}"
            raise SpecError([f"a comma separates values; write {decimal}, with a decimal point, not '{value}'"])
    for text in (part.strip() for value in values for part in value.split(",")):
        name, is_amount, amount = text.partition("=")
        if not is_amount:
            amounts |= checked(name, WeatherSpec).model_dump()
        elif name == "time":
            settings["time_of_day"] = amount
        else:
            amounts[name] = amount
    spec = checked({**settings, "weather": amounts}, ScenarioSpec)
    return {name: getattr(spec, name) for name in (*settings, *(["weather"] if amounts else []))}
