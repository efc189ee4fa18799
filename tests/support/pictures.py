"""Random pictures of Tiny Town, from the rows of a batch and from the Frames of single Worlds."""

from __future__ import annotations

from functools import cache

import numpy as np

import autodrive
from autodrive.graphics.render.render_state import RenderState
from autodrive.protocol.messages import Command, Headlights, Weather
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.scenario import TrafficSpec
from autodrive.world.batch import BatchWorld

WORLDS, MOMENTS, TICKS = 20, 10, 60
SCENARIO = ScenarioSpec(
    map="tiny_town",
    vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(x=0.6)},
    boxes={"parcel": BoxSpec(x=0.9, y=0.25)},
    traffic=TrafficSpec(cars=2),
)
AMOUNTS = "fog", "rain", "snow", "wind", "clouds"


@cache
def random_pictures() -> tuple[RenderState, RenderState]:
    """The same 200 states twice: from a batch, and from Worlds. Each world has its own hour or light and weather.

    It is night in few worlds, the headlights are off or low, and the weather is fog, rain and snow at once, or by day
    clear: each other mixture needs more shaders, which take a fifth of a second to compile.
    """
    rng = np.random.default_rng(1)
    batch, world = BatchWorld(SCENARIO, WORLDS, threads=1), autodrive.make(SCENARIO)
    is_day = np.arange(WORLDS) % 10 > 0
    is_clear = is_day & (rng.random(WORLDS) < 0.5)
    amounts = rng.uniform(0.1, 0.8, (WORLDS, len(AMOUNTS))) * ~is_clear[:, None]
    weathers = [Weather(**dict(zip(AMOUNTS, row.tolist(), strict=True))) for row in amounts]
    hours = np.where(is_day, rng.uniform(6.1, 17.9, WORLDS), rng.uniform(18.1, 24.0, WORLDS))
    hours[::3] = np.nan
    x, yaw = rng.uniform((-1.6, -0.3), (-0.6, 0.3), (WORLDS, 2)).T
    poses = {
        "V1": np.array([x, np.full(WORLDS, -0.15), yaw]).T,
        "V2": np.array([x + rng.uniform(0.6, 0.9, WORLDS), np.full(WORLDS, -0.15), -yaw]).T,
        "parcel": np.array([x + 0.5, rng.uniform(-0.6, -0.45, WORLDS), yaw]).T,
    }
    commands = rng.uniform(-1.0, 1.0, (MOMENTS, WORLDS, 2, 2))
    commands[rng.random((MOMENTS, WORLDS)) < 0.3] = 0.0

    batch.reset(seeds=np.arange(WORLDS), poses=poses, weather=weathers)
    light = batch.worlds.rules.daylight
    light.start[:], light.is_on[:] = 3600.0 * hours, is_day
    of_batch = []
    for moment in range(MOMENTS):
        batch.step(commands[moment], TICKS)
        of_batch.append(batch.pictures(headlights=Headlights(moment % 2)))

    frames = []
    for k in range(WORLDS):
        world.reset(k, poses={name: tuple(pose[k].tolist()) for name, pose in poses.items()}, weather=weathers[k])
        world.set_scene_light(bool(is_day[k]))
        if np.isfinite(hours[k]):
            world.set_time_of_day(3600.0 * hours[k], 0.0)
        for moment in range(MOMENTS):
            given = {
                name: Command(*commands[moment, k, i].tolist(), headlights=Headlights(moment % 2))
                for i, name in enumerate(SCENARIO.vehicles)
            }
            frames.append([world.step(given) for _ in range(TICKS)][-1])
    rows = np.concatenate([state.data for state in of_batch]).reshape(MOMENTS, WORLDS, -1)
    data = np.ascontiguousarray(rows.swapaxes(0, 1)).reshape(WORLDS * MOMENTS, -1)
    return RenderState.from_buffer(data, len(batch.vehicle_names)), RenderState.of_all(frames)
