"""The command `weather`: what a weather does to tyres, LIDARs and sight, in numbers; and the values of `--weather`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import typer

BRAKING = {"nigel": 0.4, "roboracer": 8.0}
"""Vehicles whose stopping distances are printed, and their speeds [m/s]."""
LONGEST = 60.0
"""A vehicle has stopped after this time [s]."""
FAR = 1000.0
"""A longer sight is not printed [m]."""


def weather(
    values: Annotated[
        list[str],
        typer.Argument(
            metavar="VALUE...",
            help="A name (sunny, cloudy, light_fog, heavy_fog, light_rain, heavy_rain, light_snow, heavy_snow), "
            "amounts from 0 to 1 such as rain=0.6, and a time of day such as time=18:30.",
        ),
    ],
) -> None:
    """Print what a weather means in numbers on asphalt: grip, stopping distances, ranges of the LIDARs, sight."""
    from autodrive.protocol.messages import Weather
    from autodrive.world.compile import weather_effects
    from autodrive.world.factory import make

    start = environment(values)
    world = make(_plane([*BRAKING], start))
    now = world.weather or Weather()
    typer.echo(f"ground         wetness {now.wetness or 0.0:.2f}, snow cover {now.snow_cover or 0.0:.2f}")
    far = math.inf
    for (name, speed), spec in zip(BRAKING.items(), world.vehicle_specs.values(), strict=True):
        effects = weather_effects(now, world.map.ground, spec)
        stopping = f"stops from {speed:g} m/s in {_stopping_distance(name, speed, start):.3g} m"
        typer.echo(f"{name:<14} grip {effects.grip:.2f}, {stopping}")
        typer.echo(
            f"{'':<14} LIDAR {effects.lidar_dark:.1f} m at 10 % and {effects.lidar_bright:.1f} m at 80 % reflectivity"
        )
        far = effects.sight
    typer.echo("sight          " + (f"{far:.0f} m" if far < FAR else f"more than {FAR:.0f} m"))
    if world.time_of_day is not None:
        typer.echo(f"light          {'day' if world.scene_light else 'night'}")


def environment(values: Sequence[str]) -> dict[str, Any]:
    """Fields of a scenario for values such as 'heavy_fog', 'rain=0.6' and 'time=18:30'; commas also separate them.

    Raises `SpecError`.
    """
    from autodrive.base.errors import SpecError
    from autodrive.base.specs import checked
    from autodrive.base.suggest import suggest
    from autodrive.protocol.weather import PRESETS
    from autodrive.scenario.scenario import ScenarioSpec, WeatherSpec

    amounts: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for text in (part.strip() for value in values for part in value.split(",")):
        name, is_amount, amount = text.partition("=")
        if not is_amount:
            if name not in PRESETS:
                raise SpecError([f"the weather '{name}' is not known. {suggest(name, [*PRESETS])}"])
            amounts |= WeatherSpec.model_validate(name).model_dump()
        elif name == "time":
            found["time_of_day"] = amount
        else:
            amounts[name] = amount
    spec = checked({**found, "weather": amounts}, ScenarioSpec)
    return {name: getattr(spec, name) for name in (*found, *(["weather"] if amounts else []))}


def _plane(vehicles: Sequence[str], start: dict[str, Any]) -> Any:
    from autodrive.scenario import ScenarioSpec, VehiclePlacement

    placed = {f"V{n}": VehiclePlacement(type=name, y=2.0 * n) for n, name in enumerate(vehicles, 1)}
    return ScenarioSpec(map="plane", vehicles=placed, **start)


def _stopping_distance(vehicle: str, speed: float, start: dict[str, Any]) -> float:
    """Of a vehicle that rolls at that speed and brakes [m], simulated."""
    import numpy as np

    from autodrive.world.batch import BatchWorld

    batch = BatchWorld(_plane([vehicle], start), 1, threads=1)
    before = batch.reset(motions={"V1": (speed, 0.0, 0.0, 0.0, 0.0)}).position[0, 0].copy()
    readings = batch.step(np.zeros((1, 1, 2)), round(LONGEST / batch.tick_duration))
    batch.close()
    return float(np.linalg.norm(readings.position[0, 0, :2] - before[:2]))
