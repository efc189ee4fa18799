"""Conditions of a World that change after it was compiled: factors of its vehicles, and the weather."""

from __future__ import annotations

from collections.abc import Mapping

from autodrive.physics.model import Table
from autodrive.physics.weather import detection_range, extinction, road, sight, wet_reflectivity
from autodrive.protocol.messages import Weather, WeatherEffects
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.spec import GroundSpec
from autodrive.scenario.vehicles.parameters import surface_of, wheel_table
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.compile import CompiledScenario


def set_factors(
    c: CompiledScenario, factors: Mapping[str, Mapping[str, float]]
) -> tuple[ScenarioSpec, dict[str, VehicleSpec]]:
    """Set the tables of the Model and the noise of the sensors in place; see `World.set_factors`.

    Returns scenario and vehicles with these factors.
    """
    of = {name: {"mass": 1.0, "grip": 1.0, "noise": 1.0, **factors.get(name, {})} for name in c.vehicles}
    vehicles = {name: vehicle.with_mass_factor(of[name]["mass"]) for name, vehicle in c.vehicles.items()}
    for row, vehicle in zip(c.model.vehicles, vehicles.values(), strict=True):
        row["mass"], row["inertia"] = vehicle.body.mass, vehicle.body.inertia
    grips = [c.spec.vehicles[name].grip_factor * its["grip"] for name, its in of.items()]
    c.model.wheels[:] = wheel_table([*vehicles.values()], grips, c.spec.substep, c.map.ground, Weather())
    c.sensors.set_noise_factors([its["noise"] for its in of.values()])
    placed = {
        name: place.model_copy(
            update={f"{kind}_factor": getattr(place, f"{kind}_factor") * one for kind, one in of[name].items()}
        )
        for name, place in c.spec.vehicles.items()
    }
    return c.spec.model_copy(update={"vehicles": placed}), vehicles


def weather_effects(weather: Weather, ground: GroundSpec, vehicle: VehicleSpec) -> WeatherEffects:
    """What that weather means for a vehicle; its LIDAR sees no farther than its `range_max`."""
    wetness, lost, lidar = weather.wetness or 0.0, extinction(weather), vehicle.sensors.lidar

    def seen(reflectivity: float) -> float | None:
        if lidar is None:
            return None
        wet = reflectivity + wetness * (wet_reflectivity(reflectivity) - reflectivity)
        return min(lidar.range_max, detection_range(wet, lost, lidar.range_max, lidar.rated_reflectivity))

    return WeatherEffects(road(surface_of(vehicle, ground), weather).grip, sight(weather), seen(0.1), seen(0.8))


def wheels_in(c: CompiledScenario, spec: ScenarioSpec, vehicles: Mapping[str, VehicleSpec], weather: Weather) -> Table:
    """`Model.wheels` in that weather, as `set_weather` sets it."""
    grips = [placement.grip_factor for placement in spec.vehicles.values()]
    return wheel_table([*vehicles.values()], grips, c.spec.substep, c.map.ground, weather)


def set_weather(
    c: CompiledScenario, spec: ScenarioSpec, vehicles: Mapping[str, VehicleSpec], weather: Weather, seed: int
) -> None:
    """Set the tyres and the LIDARs for that weather; `spec`, `vehicles`: with the factors of `set_factors`.

    `seed`: of the last reset.
    """
    c.model.wheels[:] = wheels_in(c, spec, vehicles, weather)
    c.sensors.set_weather(weather, seed)
