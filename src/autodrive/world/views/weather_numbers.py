"""What a weather means in numbers, as text: grip, stopping distances, ranges of LIDARs, sight."""

from __future__ import annotations

from functools import cache

import numpy as np

from autodrive.physics.weather import sight
from autodrive.protocol.messages import Weather
from autodrive.scenario.maps.spec import GroundSpec
from autodrive.scenario.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.vehicles.parameters import surface_of
from autodrive.scenario.vehicles.spec import TyreWeatherSpec, VehicleSpec
from autodrive.world.batch import BatchWorld
from autodrive.world.conditions import weather_effects

BRAKING = {"nigel": 0.4, "roboracer": 8.0}
"""Vehicles whose stopping distances are given, and their speeds [m/s]."""
LONGEST = 60.0
"""A vehicle has stopped after this time [s]."""
PERIOD = 0.2
"""Simulated time between two checks whether it stands [s]."""
STANDS = 1e-3
"""A vehicle that is slower stands [m/s]."""
FAR = 1000.0
"""A longer sight is not given [m]."""


def weather_numbers(weather: Weather, ground: GroundSpec, *, is_day: bool | None = None) -> str:
    """Lines of text; `is_day`: whether there is daylight at the time of day, None: the light is left out.

    One thread at a time: it keeps a batch of each vehicle.
    """
    lines = [f"ground         wetness {weather.wetness or 0.0:.2f}, snow cover {weather.snow_cover or 0.0:.2f}"]
    for name, speed in BRAKING.items():
        distance = _stopping_distance(name, speed, weather, ground)
        effects = weather_effects(weather, ground, _batch(name).compiled.vehicles["V1"])
        lines += [
            f"{name:<14} grip {effects.grip:.2f}, stops from {speed:g} m/s in {distance:.3g} m",
            f"{'':<14} LIDAR {effects.lidar_dark:.1f} m at 10 % and {effects.lidar_bright:.1f} m at 80 % reflectivity",
        ]
    far = sight(weather)
    lines.append("sight          " + (f"{far:.0f} m" if far < FAR else f"more than {FAR:.0f} m"))
    if is_day is not None:
        lines.append(f"light          {'day' if is_day else 'night'}")
    return "\n".join(lines)


@cache
def _batch(vehicle: str) -> BatchWorld:
    spec = ScenarioSpec(map="plane", vehicles={"V1": VehiclePlacement(type=vehicle)})
    return BatchWorld(spec, 1, threads=1)


def _stopping_distance(vehicle: str, speed: float, weather: Weather, ground: GroundSpec) -> float:
    """Distance that a vehicle at that speed [m/s] needs to stop with its brake on that ground [m], simulated."""
    batch = _batch(vehicle)
    spec = batch.compiled.vehicles["V1"]
    before = (
        batch.reset(motions={"V1": (speed, 0.0, 0.0, 0.0, 0.0)}, vehicles={"V1": [_on(ground, spec)]}, weather=weather)
        .position[0, 0]
        .copy()
    )
    ticks, brake = round(PERIOD / batch.tick_duration), np.zeros((1, 1, 2))
    readings, time = batch.step(brake, ticks), PERIOD
    while np.linalg.norm(readings.velocity[0, 0]) > STANDS and time < LONGEST:
        readings, time = batch.step(brake, ticks), time + PERIOD
    return float(np.linalg.norm(readings.position[0, 0, :2] - before[:2]))


def _on(ground: GroundSpec, vehicle: VehicleSpec) -> VehicleSpec:
    """The vehicle with tyres that behave on every ground as on that ground."""
    table = TyreWeatherSpec(**surface_of(vehicle, ground)._asdict())
    return vehicle.model_copy(update={"wheels": vehicle.wheels.model_copy(update={"weather": table})})
