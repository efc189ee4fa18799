"""Traffic: drivers of the simulator that command vehicles in each tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit_uncounted
from autodrive.physics.sensors.random_stream import new_stream
from autodrive.physics.sensors.sensor import random_generator
from autodrive.physics.state import State
from autodrive.protocol.messages import Headlights, Indicators
from autodrive.scenario.maps.roads import Roads
from autodrive.world.compile import CompiledScenario
from autodrive.world.controls import VehicleControls
from autodrive.world.rules.lights import PROGRAM, SET, LightColumns
from autodrive.world.rules.traffic.drive import (
    NONE,
    UNREGULATED,
    Bodies,
    Drivers,
    Seen,
    TrafficPlan,
    drive,
    drivers_of,
    new_drivers,
    new_plan,
)

INDICATORS = {1: Indicators.LEFT, 0: Indicators.OFF, -1: Indicators.RIGHT}


class TrafficTable(NamedTuple):
    """What does not change."""

    roads: Roads
    """Roads on which the traffic drives."""
    bodies: Bodies
    """What the drivers know of all vehicles."""
    tick: float
    """Duration of a tick [s]."""


class TrafficMemory(NamedTuple):
    """Working memory of a tick."""

    plan: TrafficPlan
    lights: Integers
    """What the drivers see of each traffic light, shape (l,)."""


def table(c: CompiledScenario) -> TrafficTable:
    """What does not change in a scenario."""
    return TrafficTable(c.fleet.roads, c.fleet.bodies, c.spec.tick)


def columns(c: CompiledScenario, n: int) -> Drivers:
    """Columns of n worlds of the scenario, whose drivers are on no road."""
    return new_drivers((n, len(c.fleet.names)))


def memory(c: CompiledScenario) -> TrafficMemory:
    """Working memory for one world of the scenario."""
    return TrafficMemory(new_plan(len(c.fleet.names)), np.zeros(len(c.map.traffic_lights), np.int64))


def begin(c: CompiledScenario, columns: Drivers, chosen: Integers, seeds: Sequence[int]) -> None:
    """Let the drivers of the `chosen` worlds begin anew, with the random numbers of these `seeds`."""
    if not c.fleet.names:
        return
    for column in (columns.link, columns.route, columns.behind, columns.granted, columns.asked):
        column[chosen] = NONE
    for column in (columns.at, columns.speed, columns.has_stopped, columns.signal, columns.is_braking):
        column[chosen] = 0
    for k, seed in zip(chosen.tolist(), seeds, strict=True):
        for driver, name in enumerate(c.fleet.names):
            random = random_generator(seed, name, "route")
            columns.desired[k, driver] = c.fleet.desired_speed(driver, random)
            columns.stream[k, driver] = new_stream(random)


def take_over(c: CompiledScenario, columns: Drivers, before: CompiledScenario, before_columns: Drivers) -> None:
    """Go on from the traffic of another World, whose map may differ: each driver looks for its place on the roads."""
    is_same_map = all(map(np.array_equal, c.fleet.roads, before.fleet.roads))
    if c.fleet.names and before.fleet.names:
        for name in Drivers._fields if is_same_map else ("speed", "desired", "stream"):
            getattr(columns, name)[:] = getattr(before_columns, name)


@jit_uncounted
def command(
    k: int,
    tick: int,
    state: State,
    lights: LightColumns,
    table: TrafficTable,
    columns: Drivers,
    memory: TrafficMemory,
    throttle: Floats,
    steering: Floats,
) -> None:
    """Write what the vehicles of the traffic of world k obey in this tick, shape (v,)."""
    for light in range(memory.lights.shape[0]):
        is_regulating = lights.mode[k, light] == PROGRAM or lights.mode[k, light] == SET
        memory.lights[light] = lights.state[k, light] if is_regulating else UNREGULATED
    drive(
        table.roads,
        table.bodies,
        drivers_of(k, columns),
        memory.plan,
        Seen(state.qpos, state.vehicle_position, state.vehicle_orientation, state.vehicle_velocity),
        memory.lights,
        tick,
        table.tick,
        throttle,
        steering,
    )


def switch_lamps(
    table: TrafficTable, columns: Drivers, vehicles: Sequence[VehicleControls], tick: int, *, is_day: bool
) -> None:
    """Switch the lamps of the traffic among all `vehicles` of a World: headlights by night, brake lamps, indicators."""
    headlights = Headlights.OFF if is_day else Headlights.LOW
    rows, signals, brakes = table.bodies.row.tolist(), columns.signal[0].tolist(), columns.is_braking[0].tolist()
    for row, signal, is_braking in zip(rows, signals, brakes, strict=True):
        vehicle = vehicles[row]
        vehicle.headlights, vehicle.is_braking = headlights, is_braking == 1
        vehicle.switch_indicators(INDICATORS[signal], tick)
