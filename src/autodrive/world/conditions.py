"""Conditions of a World that change after it was compiled: factors of its vehicles, the light and the weather."""

from __future__ import annotations

import math
from collections.abc import Mapping

from msgspec.structs import replace

from autodrive.base.errors import CommandError
from autodrive.base.exact_fraction import exact_fraction
from autodrive.physics.model import Table
from autodrive.physics.weather import ChangingWeather, detection_range, extinction, road, sight, wet_reflectivity
from autodrive.protocol.commands import is_number
from autodrive.protocol.messages import Weather, WeatherEffects
from autodrive.protocol.weather import is_clear
from autodrive.scenario import FACTOR_LIMITS, NEUTRAL, ScenarioSpec
from autodrive.scenario.maps.spec import GroundSpec
from autodrive.scenario.vehicles.parameters import set_factors, surface_of, wheel_table
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.compile import CompiledScenario, grip_factors
from autodrive.world.rules import daylight
from autodrive.world.rules.daylight import DaylightColumns, SceneLight

WEATHER_PERIOD = 0.1
"""Tyres and LIDARs follow a ground that becomes wet or dry in steps of this time [s]."""


class WorldConditions:
    """The light and the weather of a World, and the factors of its vehicles."""

    def __init__(self, compiled: CompiledScenario, columns: DaylightColumns) -> None:
        """`columns`: those of the light in the row of the World."""
        self._compiled, self._columns = compiled, columns
        self.spec: ScenarioSpec = compiled.spec
        """The scenario from which a reset starts, with the factors."""
        self.vehicles = compiled.vehicles
        """Specs of the vehicles by name, with the factors."""
        self.light = daylight.light_of(columns)
        self.weather = ChangingWeather()
        self.shown: Weather | None = None
        """The weather with wetness and snow cover of the ground; None: clear, over dry ground."""
        self.effects: WeatherEffects | None = None
        """What the weather means for the first vehicle; None: clear."""
        self.is_changing = False
        """Whether wetness or snow cover of the ground are changing: `follow` is due in each tick."""
        tick = exact_fraction(compiled.spec.tick)
        self._ratio = tick.numerator, tick.denominator
        self._period = max(1, round(WEATHER_PERIOD / compiled.spec.tick))

    def reset(self, weather: Weather | None, seed: int) -> None:
        """Set the light of the scenario, and that weather as after a long time of it; None: that of the scenario."""
        self.light = daylight.light_of(self._columns)
        self.weather = ChangingWeather.settled(self.spec.weather.message if weather is None else weather)
        self._apply(0, seed, is_reset=True)

    def set_light(self, light: SceneLight) -> None:
        """Set the light from now on."""
        self.light = light
        daylight.write(self._columns, 0, light)

    def set_weather(self, weather: Weather, tick: int, seed: int) -> None:
        """Set the weather from that tick on; `seed`: of the last reset."""
        numerator, denominator = self._ratio
        self.weather = self.weather.following(weather, tick * numerator / denominator)
        self._apply(tick, seed)

    def with_kept_ground(self, weather: Weather) -> Weather:
        """The weather with the wetness and the snow cover that are held now, unless it has others."""
        held = {name: getattr(self.weather.weather, name) for name in ("wetness", "snow_cover")}
        return replace(weather, **{name: held[name] for name in held if getattr(weather, name) is None})

    def follow(self, tick: int, seed: int) -> None:
        """Let tyres, LIDARs and Frames follow the ground, once in a `WEATHER_PERIOD`; `seed`: of the last reset."""
        if tick % self._period == 0:
            self._apply(tick, seed)

    def restore(self, weather: ChangingWeather, tick: int, seed: int, *, is_reset: bool = False) -> None:
        """Continue in that weather, with the light of the row; `is_reset`: see `_apply`."""
        self.light, self.weather = daylight.light_of(self._columns), weather
        self._apply(tick, seed, is_reset=is_reset)

    def set_factors(self, factors: Mapping[str, Mapping[str, float]]) -> None:
        """Set the factors with which vehicles start from the next reset on. Raises `CommandError`."""
        c = self._compiled
        for vehicle, vehicle_factors in factors.items():
            for name, factor in vehicle_factors.items():
                least, most = FACTOR_LIMITS.get(name, (math.inf, -math.inf))
                if not (is_number(factor) and least <= factor <= most):
                    raise CommandError(f"factor {name} of vehicle '{vehicle}' cannot be {factor!r}")
        complete = {name: {**NEUTRAL, **factors.get(name, {})} for name in c.vehicles}
        self.vehicles = {
            name: spec.with_factors(*(complete[name][factor] for factor in ("mass", "drive", "trim")))
            for name, spec in c.vehicles.items()
        }
        for row, vehicle in zip(c.model.vehicles, self.vehicles.values(), strict=True):
            set_factors(row, vehicle)
        c.sensors.set_noise_factors([of_vehicle["noise"] for of_vehicle in complete.values()])
        placed = {name: placement.with_factors(complete[name]) for name, placement in c.spec.vehicles.items()}
        self.spec = c.spec.model_copy(update={"vehicles": placed})
        c.model.wheels[:] = self.wheels(Weather())

    def wheels(self, weather: Weather) -> Table:
        """`Model.wheels` in that weather."""
        grips, c = grip_factors(self.spec, self.vehicles), self._compiled
        return wheel_table([*self.vehicles.values()], grips, c.spec.substep, c.map.ground, weather)

    def _apply(self, tick: int, seed: int, *, is_reset: bool = False) -> None:
        """Let tyres, LIDARs and Frames have the weather of the latest multiple of `WEATHER_PERIOD` or change.

        `is_reset`: tyres and LIDARs are as in clear weather.
        """
        numerator, denominator = self._ratio
        time = max((tick - tick % self._period) * numerator / denominator, self.weather.since)
        now = self.weather.at(time)
        self.is_changing = not self.weather.is_settled(time)
        shown = None if is_clear(now) else now
        if shown != self.shown or (is_reset and shown is not None):
            self.shown = shown
            self._compiled.model.wheels[:] = self.wheels(now)
            self._compiled.sensors.set_weather(now, seed)
            first = next(iter(self.vehicles.values()))
            self.effects = None if shown is None else weather_effects(now, self._compiled.map.ground, first)


def weather_effects(weather: Weather, ground: GroundSpec, vehicle: VehicleSpec) -> WeatherEffects:
    """What that weather means for a vehicle; its LIDAR sees no farther than its `range_max`."""
    wetness, lost, lidar = weather.wetness or 0.0, extinction(weather), vehicle.sensors.lidar

    def seen(reflectivity: float) -> float | None:
        if lidar is None:
            return None
        wet = reflectivity + wetness * (wet_reflectivity(reflectivity) - reflectivity)
        return min(lidar.range_max, detection_range(wet, lost, lidar.range_max, lidar.rated_reflectivity))

    return WeatherEffects(road(surface_of(vehicle, ground), weather).grip, sight(weather), seen(0.1), seen(0.8))
