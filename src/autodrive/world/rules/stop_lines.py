"""Stop lines: reports vehicles that cross one at red, or at a stop sign without a stop.

A vehicle crosses a line when the middle of its front passes from before the line to behind it, within the width of the
lanes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.jit import jit_uncounted
from autodrive.physics.state import State
from autodrive.protocol.messages import Event, RedLight, StopSign, TrafficLightState
from autodrive.world.compile import CompiledScenario

STOP_SPEED = 0.05
"""A slower vehicle has stopped [m/s]."""
STOP_REACH = 1.0
"""Lengths of a vehicle before a stop line within which its front must have stopped."""
RED = int(TrafficLightState.RED)


class StopLineTable(NamedTuple):
    """m stop lines and v vehicles: what does not change."""

    lines: Floats
    """x, y of the middle [m], cosine and sine of the heading, width [m], whether a stop sign has it, shape (m, 6)."""
    light: Integers
    """Number of the traffic light of each line; -1: it belongs to a stop sign, shape (m,)."""
    fronts: Floats
    """Distance from the origin of each vehicle to its front [m], shape (v,)."""
    reach: Floats
    """Distance before a line within which a vehicle must have stopped [m], shape (v,)."""


class StopLineColumns(NamedTuple):
    """n worlds with v vehicles and m stop lines."""

    ahead: Floats
    """Distance from the front of each vehicle to each line, along the heading of the line [m]; not a number: not
    known, shape (n, v, m)."""
    has_stopped: NDArray[np.bool_]
    """Whether the vehicle has stopped since it came near to the line of a stop sign, shape (n, v, m)."""
    red_light_count: Integers
    """Events `RedLight` since the reset, shape (n, v)."""
    stop_sign_count: Integers
    """Events `StopSign` since the reset, shape (n, v)."""


class StopLineMemory(NamedTuple):
    """Working memory of a tick."""

    is_offence: NDArray[np.bool_]
    """Whether the vehicle has crossed the line wrongly, shape (v, m)."""


def table(c: CompiledScenario) -> StopLineTable:
    """What does not change in a scenario."""
    lines, vehicles = c.map.stop_lines, c.vehicles.values()
    rows = [
        (*line.pose[:2], math.cos(line.pose[2]), math.sin(line.pose[2]), line.width, line.kind == "stop")
        for line in lines
    ]
    lights = [-1 if line.kind == "stop" else c.map.traffic_lights.index(line.prop) for line in lines]
    return StopLineTable(
        lines=np.array(rows, np.float64).reshape(-1, 6),
        light=np.array(lights, np.int64),
        fronts=np.array([vehicle.front for vehicle in vehicles]),
        reach=np.array([STOP_REACH * vehicle.size[0] for vehicle in vehicles]),
    )


def columns(c: CompiledScenario, n: int) -> StopLineColumns:
    """Columns of n worlds of the scenario, in which no vehicle was seen."""
    v, m = len(c.vehicles), len(c.map.stop_lines)
    return StopLineColumns(
        ahead=np.full((n, v, m), np.nan),
        has_stopped=np.zeros((n, v, m), np.bool_),
        red_light_count=np.zeros((n, v), np.int64),
        stop_sign_count=np.zeros((n, v), np.int64),
    )


def memory(c: CompiledScenario) -> StopLineMemory:
    """Working memory for one world of the scenario."""
    return StopLineMemory(np.zeros((len(c.vehicles), len(c.map.stop_lines)), np.bool_))


def begin(columns: StopLineColumns, chosen: Integers) -> None:
    """Forget all vehicles of the `chosen` worlds, as before the first tick."""
    columns.ahead[chosen], columns.has_stopped[chosen] = np.nan, False
    columns.red_light_count[chosen] = columns.stop_sign_count[chosen] = 0


def forget(columns: StopLineColumns, vehicle: int) -> None:
    """Forget where a vehicle of a World was: one that is moved by hand crosses no line."""
    columns.ahead[0, vehicle], columns.has_stopped[0, vehicle] = np.nan, False


def take_over(
    c: CompiledScenario, columns: StopLineColumns, before: CompiledScenario, before_columns: StopLineColumns
) -> None:
    """Set the columns of a World to those of another World with the same vehicles; other lines start anew."""
    begin(columns, np.zeros(1, np.int64))
    columns.red_light_count[:], columns.stop_sign_count[:] = (
        before_columns.red_light_count,
        before_columns.stop_sign_count,
    )
    if c.map.stop_lines == before.map.stop_lines:
        columns.ahead[:], columns.has_stopped[:] = before_columns.ahead, before_columns.has_stopped


@jit_uncounted
def judge(
    k: int,
    table: StopLineTable,
    state: State,
    light_state: Integers,
    columns: StopLineColumns,
    memory: StopLineMemory,
) -> bool:
    """Count who has crossed a stop line of world k wrongly in this tick; True if anyone has.

    `light_state`: `TrafficLightState` of the lights at the end of the tick, shape (l,).
    """
    if table.lines.shape[0] == 0 or not _note_crossings(
        table,
        state.vehicle_position,
        state.vehicle_orientation,
        state.vehicle_velocity,
        columns.ahead[k],
        columns.has_stopped[k],
        memory.is_offence,
    ):
        return False
    is_any_offence = False
    for i in range(memory.is_offence.shape[0]):
        for line in range(memory.is_offence.shape[1]):
            if not memory.is_offence[i, line]:
                continue
            if table.light[line] >= 0:
                memory.is_offence[i, line] = light_state[table.light[line]] == RED
                columns.red_light_count[k, i] += memory.is_offence[i, line]
            else:
                memory.is_offence[i, line] = not columns.has_stopped[k, i, line]
                columns.stop_sign_count[k, i] += memory.is_offence[i, line]
                columns.has_stopped[k, i, line] = False
            is_any_offence |= memory.is_offence[i, line]
    return is_any_offence


def events(c: CompiledScenario, memory: StopLineMemory, time: float) -> Iterator[Event]:
    """Events of a World in the tick that `judge` has judged."""
    names = list(c.vehicles)
    for i, number in np.argwhere(memory.is_offence).tolist():
        line = c.map.stop_lines[number]
        kind = StopSign if line.kind == "stop" else RedLight
        yield kind(time, names[i], line.prop, read_only_copy(c.state.vehicle_position[i]))


@jit_uncounted
def _note_crossings(
    table: StopLineTable,
    position: Floats,
    orientation: Floats,
    velocity: Floats,
    ahead: Floats,
    has_stopped: NDArray[np.bool_],
    has_crossed: NDArray[np.bool_],
) -> bool:
    """Write which vehicle has crossed which line, and has stopped before it; True if any has crossed one."""
    any_crossed = False
    lines, fronts, reach = table.lines, table.fronts, table.reach
    for i in range(fronts.shape[0]):
        # the middle of the front: from the origin along the x axis of the vehicle
        w, x, y, z = orientation[i, 0], orientation[i, 1], orientation[i, 2], orientation[i, 3]
        front_x = position[i, 0] + fronts[i] * (1.0 - 2.0 * (y * y + z * z))
        front_y = position[i, 1] + fronts[i] * (2.0 * (x * y + w * z))
        is_slow = abs(velocity[i, 0]) < STOP_SPEED
        for k in range(lines.shape[0]):
            # the line in its own axes: how far it is ahead of the front, and how far its middle is beside it
            dx, dy = lines[k, 0] - front_x, lines[k, 1] - front_y
            now = dx * lines[k, 2] + dy * lines[k, 3]
            aside = dy * lines[k, 2] - dx * lines[k, 3]
            before = ahead[i, k]
            is_beside = abs(aside) <= 0.5 * lines[k, 4]
            has_crossed[i, k] = is_beside and before > 0.0 and now <= 0.0  # nan: False
            any_crossed |= has_crossed[i, k]
            ahead[i, k] = now
            if lines[k, 5] > 0.0 and not has_crossed[i, k]:
                is_near = is_beside and now > 0.0 and now <= reach[i]
                has_stopped[i, k] = is_near and (has_stopped[i, k] or is_slow)
    return any_crossed
