"""The list of the rules, in the order in which a tick applies them.

A rule is a module with functions of these names: `columns` makes what changes, in rows for n worlds, `table` what does
not change, `memory` the working memory of a tick; `begin` writes rows at a reset; `take_over` continues a World in
another one; `judge` is the compiled part of a tick; `events` makes the events of a World. A rule has those that it
needs. A new rule is a module and its lines here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit_uncounted
from autodrive.physics.buffers import VehicleContacts
from autodrive.physics.model import Table
from autodrive.physics.state import State
from autodrive.protocol.messages import Event
from autodrive.world.compile import CompiledScenario
from autodrive.world.rules import collisions, daylight, lights, radio, road, stop_lines
from autodrive.world.rules.traffic import rule as traffic

FIRST = np.zeros(1, np.int64)
"""The row of a World."""


class RuleColumns(NamedTuple):
    """What changes, in rows for n worlds."""

    collisions: collisions.CollisionColumns
    road: road.RoadColumns
    daylight: daylight.DaylightColumns
    lights: lights.LightColumns
    stop_lines: stop_lines.StopLineColumns
    radio: radio.RadioColumns
    traffic: Table
    """Columns `traffic.DRIVER`, shape (n, drivers)."""


class RuleTables(NamedTuple):
    """What does not change, and is the same in all worlds."""

    collisions: collisions.CollisionTable
    edges: Floats
    """Edges of the drivable area; see `road.judge`."""
    lights: lights.LightTable
    stop_lines: stop_lines.StopLineTable
    radio: radio.RadioChannel
    traffic: traffic.TrafficTable


class RuleMemory(NamedTuple):
    """Working memory of a tick, one for each thread."""

    collisions: collisions.CollisionMemory
    road: road.RoadMemory
    stop_lines: stop_lines.StopLineMemory
    radio: radio.RadioMemory


def new_columns(c: CompiledScenario, n: int) -> RuleColumns:
    """Columns of n worlds of the scenario; `begin` follows."""
    rules = (collisions, road, daylight, lights, stop_lines, radio, traffic)
    return RuleColumns(*(rule.columns(c, n) for rule in rules))


def new_tables(c: CompiledScenario) -> RuleTables:
    """The tables of the scenario."""
    return RuleTables(
        collisions=collisions.table(c),
        edges=c.map.drivable_edges,
        lights=lights.table(c),
        stop_lines=stop_lines.table(c),
        radio=radio.table(c),
        traffic=traffic.table(c),
    )


def new_memory(c: CompiledScenario) -> RuleMemory:
    """Working memory for worlds of the scenario."""
    return RuleMemory(*(rule.memory(c) for rule in (collisions, road, stop_lines, radio)))


def begin(c: CompiledScenario, columns: RuleColumns, chosen: Integers, seeds: Sequence[int]) -> None:
    """Write the rows of the `chosen` worlds as before the first tick; `seeds`: of these worlds."""
    collisions.begin(columns.collisions, chosen)
    road.begin(columns.road, chosen)
    daylight.begin(c, columns.daylight, chosen)
    lights.begin(columns.lights, chosen)
    stop_lines.begin(columns.stop_lines, chosen)
    radio.begin(columns.radio, chosen, seeds)
    traffic.begin(c, columns.traffic, chosen, seeds)


def take_over(
    c: CompiledScenario, columns: RuleColumns, before: CompiledScenario, before_columns: RuleColumns, seed: int
) -> None:
    """Continue a World, whose columns these are, from another World; of its radio messages none is left."""
    collisions.take_over(c, columns.collisions, before, before_columns.collisions)
    columns.road.is_off_road[:] = before_columns.road.is_off_road
    daylight.write(columns.daylight, 0, daylight.light_of(before_columns.daylight))
    lights.take_over(c, columns.lights, before, before_columns.lights)
    stop_lines.take_over(c, columns.stop_lines, before, before_columns.stop_lines)
    radio.begin(columns.radio, FIRST, [seed])
    traffic.take_over(c, columns.traffic, before, before_columns.traffic)


@jit_uncounted
def show_lights(k: int, tick: int, time: float, tables: RuleTables, columns: RuleColumns) -> None:
    """Let the traffic lights of world k show what they show at a tick; `time` [s] is that of the tick."""
    lights.show(k, tick, daylight.time_of_day(k, time, columns.daylight), tables.lights, columns.lights)


@jit_uncounted
def judge(
    k: int,
    tick: int,
    time: float,
    wheels: Table,
    state: State,
    contacts: VehicleContacts,
    tables: RuleTables,
    columns: RuleColumns,
    memory: RuleMemory,
) -> bool:
    """Judge the tick of world k that ended at `time` [s], and clear the contacts; True if there are `events`."""
    show_lights(k, tick, time, tables, columns)
    has_collided = collisions.judge(k, tick, contacts, tables.collisions, columns.collisions, memory.collisions)
    has_left = road.judge(k, tables.edges, wheels, state, columns.road, memory.road)
    has_crossed = stop_lines.judge(
        k, tables.stop_lines, state, columns.lights.state[k], columns.stop_lines, memory.stop_lines
    )
    return has_collided or has_left or has_crossed


def events(c: CompiledScenario, columns: RuleColumns, memory: RuleMemory, time: float) -> Iterator[Event]:
    """Events of a World in the tick that `judge` has judged."""
    names = list(c.vehicles)
    yield from collisions.events(c, memory.collisions, time)
    yield from road.events(names, columns.road, memory.road, c.state.vehicle_position, time)
    yield from stop_lines.events(c, memory.stop_lines, time)
