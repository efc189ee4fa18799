"""Traffic: drivers of the simulator that command vehicles in each tick."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit_uncounted
from autodrive.physics.model import Table
from autodrive.physics.sensors.random_stream import new_stream
from autodrive.physics.sensors.sensor import random_generator
from autodrive.physics.state import State
from autodrive.protocol.messages import Headlights, Indicators
from autodrive.world.compile import CompiledScenario
from autodrive.world.controls import VehicleControls
from autodrive.world.rules.lights import LightColumns
from autodrive.world.rules.traffic.drive import DRIVER, NONE, Traffic, TrafficTable, drive

INDICATORS = {1: Indicators.LEFT, 0: Indicators.OFF, -1: Indicators.RIGHT}


def table(c: CompiledScenario) -> TrafficTable:
    """What does not change in a scenario."""
    return c.fleet.table


def columns(c: CompiledScenario, n: int) -> Table:
    """Drivers of n worlds of the scenario, columns `DRIVER`; `begin` follows."""
    return np.zeros((n, len(c.fleet.names)), DRIVER)


def begin(c: CompiledScenario, columns: Table, chosen: Integers, seeds: Sequence[int]) -> None:
    """Let the drivers of the `chosen` worlds begin anew, on no road, with the random numbers of these `seeds`."""
    if not c.fleet.names:
        return
    columns[chosen] = 0
    for name in ("link", "route", "behind", "granted", "asked"):
        columns[name][chosen] = NONE
    for k, seed in zip(chosen.tolist(), seeds, strict=True):
        for driver, name in enumerate(c.fleet.names):
            random = random_generator(seed, name, "route")
            columns["desired"][k, driver] = c.fleet.desired_speed(driver, random)
            columns["stream"][k, driver] = new_stream(random)


def take_over(c: CompiledScenario, columns: Table, before: CompiledScenario, before_columns: Table) -> None:
    """Go on from the traffic of another World, whose map may differ: each driver looks for its place on the roads."""
    if c.fleet.names and before.fleet.names:
        is_same_map = all(map(np.array_equal, c.fleet.table.roads, before.fleet.table.roads))
        for name in DRIVER.names or () if is_same_map else ("speed", "desired", "stream"):
            columns[name] = before_columns[name]


@jit_uncounted
def command(
    k: int,
    tick: int,
    state: State,
    lights: LightColumns,
    table: TrafficTable,
    columns: Table,
    throttle: Floats,
    steering: Floats,
) -> None:
    """Write what the vehicles of the traffic of world k obey in this tick, shape (v,)."""
    drive(Traffic(table, columns[k], state, lights.mode[k], lights.state[k], tick), throttle, steering)


def switch_lamps(
    table: TrafficTable, columns: Table, vehicles: Sequence[VehicleControls], tick: int, *, is_day: bool
) -> None:
    """Switch the lamps of the traffic among all `vehicles` of a World: headlights by night, brake lamps, indicators."""
    headlights = Headlights.OFF if is_day else Headlights.LOW
    rows, signals, brakes = table.rows.tolist(), columns["signal"][0].tolist(), columns["is_braking"][0].tolist()
    for row, signal, is_braking in zip(rows, signals, brakes, strict=True):
        vehicle = vehicles[row]
        vehicle.headlights, vehicle.is_braking = headlights, is_braking
        vehicle.switch_indicators(INDICATORS[signal], tick)
