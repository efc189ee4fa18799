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

INDICATORS = Indicators.OFF, Indicators.LEFT, Indicators.RIGHT
"""Indicators by the `signal` of a driver: 0, 1 and -1, which is the last one."""


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


def switch_lamps(table: TrafficTable, columns: Table, vehicles: Sequence[VehicleControls], *, is_dark: bool) -> None:
    """Switch the lamps of the traffic among all `vehicles` of a World: headlights, brake lamps, indicators.

    `is_dark`: see `headlights_in`.
    """
    names = "signal", "signal_since", "is_braking"
    for row, signal, since, is_braking in zip(
        table.rows.tolist(), *(columns[name][0].tolist() for name in names), strict=True
    ):
        vehicle = vehicles[row]
        vehicle.headlights, vehicle.is_braking = headlights_in(is_dark), is_braking
        vehicle.indicators, vehicle.indicators_since = INDICATORS[signal], since


def headlights_in(is_dark: bool) -> Headlights:
    """The headlights of the traffic; `is_dark`: see `look.needs_lamps`."""
    return Headlights.LOW if is_dark else Headlights.OFF
