"""What cameras show of worlds: their rows as one `RenderState`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from autodrive.graphics.render.look import air_of, needs_lamps
from autodrive.graphics.render.render_state import RenderState
from autodrive.physics.actuators.lights import lit_levels
from autodrive.protocol.messages import Headlights, Weather
from autodrive.world.columns import Worlds
from autodrive.world.compile import CompiledScenario
from autodrive.world.frames import braking_and_reversing
from autodrive.world.readings import Readings
from autodrive.world.rules.daylight import SceneLight, light_of
from autodrive.world.rules.traffic.rule import INDICATORS, headlights_in


def pictures_of(
    compiled: CompiledScenario,
    worlds: Worlds,
    readings: Readings,
    weathers: Sequence[Weather],
    *,
    is_day: bool | None = None,
    headlights: Headlights = Headlights.OFF,
) -> RenderState:
    """The pictures of n worlds, equal to `RenderState.of` the Frames of single Worlds in the same state.

    `readings`: views of `worlds`; `weathers`: with wetness and snow cover; `is_day`: instead of the light of the
    scenario; `headlights`: of the vehicles that obey commands.
    """
    n, v = readings.throttle.shape
    fixed = None if is_day is None else SceneLight(is_day)
    lights = [(fixed or light_of(worlds.rules.daylight, k)).at(time) for k, time in enumerate(readings.time.tolist())]
    are_dark = [needs_lamps(*light, weather) for light, weather in zip(lights, weathers, strict=True)]
    state = RenderState.empty(v, readings.object_pose.shape[1], n)
    state.write(
        {
            "time": readings.time,
            "is_day": [is_lit for is_lit, _ in lights],
            "time_of_day": [np.nan if time is None else time for _, time in lights],
            "air": [air_of(weather) for weather in weathers],
            "traffic_lights": readings.light_state,
        },
        {
            "position": readings.position,
            "orientation": readings.orientation,
            "velocity": readings.velocity,
            "angular_velocity": readings.angular_velocity,
            "steering": readings.wheel_steering_angle,
            "spin": readings.wheel_rotation_angle,
            "compression": readings.wheel_compression,
            "lamps": _lamps(compiled, worlds, readings, are_dark, headlights),
        },
        {"position": readings.object_pose[..., :3], "orientation": readings.object_pose[..., 3:]},
    )
    return state


def _lamps(
    compiled: CompiledScenario, worlds: Worlds, readings: Readings, are_dark: Sequence[bool], headlights: Headlights
) -> np.ndarray:
    """Brightness of each lamp, shape (n, v, lamps); the indicators of vehicles that obey commands are off."""
    shape, drivers, rows = readings.throttle.shape, worlds.rules.traffic, compiled.fleet.table.rows
    heads, indicators, since = np.full(shape, headlights), np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    brakes = np.zeros(shape, np.bool_)
    if len(rows):
        heads[:, rows] = np.array([headlights_in(is_dark) for is_dark in are_dark])[:, None]
        indicators[:, rows] = np.array(INDICATORS)[drivers["signal"]]
        since[:, rows], brakes[:, rows] = drivers["signal_since"], drivers["is_braking"]
    spin = 0.5 * readings.wheel_angular_velocity[..., 2:].sum(axis=-1)
    coasts = np.array([vehicle.drivetrain.coasts for vehicle in compiled.vehicles.values()])
    is_braking, is_reversing = braking_and_reversing(readings.throttle, spin, brakes, coasts)
    periods = np.array([vehicle.lights.blink_period for vehicle in compiled.vehicles.values()])
    phase = (readings.tick[:, None] - since) * compiled.spec.tick / periods % 1.0
    return lit_levels(heads, indicators, phase, is_braking, is_reversing)
