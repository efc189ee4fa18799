"""Traffic lights: what they show at each tick, as their programs say or as requests set them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import CommandError
from autodrive.base.jit import jit_uncounted
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import TrafficLightFrame, TrafficLightState
from autodrive.scenario.maps.light_programs import DARK, FLASHING, MODES, PROGRAM, SET, all_programs, light_cycles
from autodrive.world.compile import CompiledScenario

FLASH_PERIOD = 1.0
"""Period of a flashing light [s]; it is on in the first half."""
NOT_SET = -1
OFF, YELLOW = int(TrafficLightState.OFF), int(TrafficLightState.YELLOW)


class LightTable(NamedTuple):
    """The programs of l lights: c different cycles of p parts in all. What does not change; times in ticks."""

    cycle: Integers
    """Number of the cycle of each light, shape (l,)."""
    length: Integers
    """Length of each cycle, shape (c,)."""
    offset: Integers
    """Tick at which each cycle begins; see `LightCycle`, shape (c,)."""
    first: Integers
    """Where the parts of each cycle begin, and where the last one ends; a light without a program has no parts, shape
    (c + 1,)."""
    start: Integers
    """Place in the cycle at which each part begins, shape (p,)."""
    state: Integers
    """`TrafficLightState` of each part, shape (p,)."""
    flashing: Floats
    """Times of day at which the lights begin and end to flash [s]; not a number: they never flash, shape (c, 2)."""
    half_flash: int
    """Half the period of a flashing light."""
    tick: float
    """Duration of a tick [s]."""


class LightColumns(NamedTuple):
    """n worlds with l lights."""

    state: Integers
    """`TrafficLightState` that each light shows, shape (n, l)."""
    time_to_change: Floats
    """Time until the state changes [s]; not a number: it does not change, shape (n, l)."""
    mode: Integers
    """Number of the mode in `MODES`, shape (n, l)."""
    set_state: Integers
    """State that a request has set; -1: none has, shape (n, l)."""


def table(c: CompiledScenario) -> LightTable:
    """What does not change in a scenario."""
    programs = all_programs(c.map.light_programs, c.spec.light_programs)
    tick = c.spec.tick
    with_program = {
        light: cycle for program in programs.values() for light, cycle in light_cycles(program, tick).items()
    }
    of_lights = [with_program.get(light) for light in c.map.traffic_lights]
    cycles = list(dict.fromkeys(of_lights))
    starts = [cycle.starts if cycle else () for cycle in cycles]
    never = np.nan, np.nan
    return LightTable(
        cycle=np.array([cycles.index(cycle) for cycle in of_lights], np.int64),
        length=np.array([cycle.length if cycle else 1 for cycle in cycles], np.int64),
        offset=np.array([cycle.offset if cycle else 0 for cycle in cycles], np.int64),
        first=np.cumsum([0, *map(len, starts)], dtype=np.int64),
        start=np.array([start for parts in starts for start in parts], np.int64),
        state=np.array([state for cycle in cycles if cycle for state in cycle.states], np.int64),
        flashing=np.array([(cycle.flashing if cycle else None) or never for cycle in cycles]).reshape(-1, 2),
        half_flash=max(1, round(0.5 * FLASH_PERIOD / tick)),
        tick=tick,
    )


def columns(c: CompiledScenario, n: int) -> LightColumns:
    """Columns of n worlds of the scenario, whose lights are dark."""
    shape = n, len(c.map.traffic_lights)
    return LightColumns(
        state=np.zeros(shape, np.int64),
        time_to_change=np.full(shape, np.nan),
        mode=np.zeros(shape, np.int64),
        set_state=np.full(shape, NOT_SET),
    )


def begin(columns: LightColumns, chosen: Integers) -> None:
    """Let all lights of the `chosen` worlds follow their programs; `show` follows."""
    columns.set_state[chosen] = NOT_SET


def take_over(
    c: CompiledScenario, columns: LightColumns, before: CompiledScenario, before_columns: LightColumns
) -> None:
    """Set the lights of a World that were set in another World; `show` follows."""
    columns.set_state[:] = NOT_SET
    for number, name in enumerate(c.map.traffic_lights):
        if name in before.map.traffic_lights:
            columns.set_state[0, number] = before_columns.set_state[0, before.map.traffic_lights.index(name)]


def set_light(
    names: Sequence[str], columns: LightColumns, light: str, state: TrafficLightState | None
) -> TrafficLightState | None:
    """Set a light of a World, or let it follow its program (None); `show` follows. Returns the state.

    Raises `CommandError` for an unknown light and for a value that is no state.
    """
    if light not in names:
        raise CommandError(f"traffic light '{light}' is not known. {suggest(str(light), list(names))}")
    try:
        state = None if state is None else TrafficLightState(state)
    except ValueError:
        known = ", ".join(f"{state.value} {state.name.lower()}" for state in TrafficLightState)
        raise CommandError(f"state of traffic light '{light}' must be None or one of {known}, not {state!r}") from None
    columns.set_state[0, names.index(light)] = NOT_SET if state is None else state
    return state


@jit_uncounted
def show(k: int, tick: int, time_of_day: float, table: LightTable, columns: LightColumns) -> None:
    """Write what the lights of world k show at a tick.

    `time_of_day`: since midnight [s]; not a number: the light of the scene is fixed.
    """
    for light in range(table.cycle.shape[0]):
        state, remaining, mode = OFF, -1, DARK  # remaining: ticks until the state changes
        cycle = table.cycle[light]
        first, parts = table.first[cycle], table.first[cycle + 1] - table.first[cycle]
        if columns.set_state[k, light] != NOT_SET:
            state, mode = columns.set_state[k, light], SET
        elif parts > 0 and _is_within(time_of_day, table.flashing[cycle, 0], table.flashing[cycle, 1]):
            halves = tick // table.half_flash
            state, mode = (OFF if halves % 2 else YELLOW), FLASHING
            remaining = (halves + 1) * table.half_flash - tick
        elif parts > 0:
            place = (tick - table.offset[cycle]) % table.length[cycle]
            begun = 0
            while begun < parts and table.start[first + begun] <= place:
                begun += 1
            state = table.state[first + (begun - 1) % parts]  # 0: the last state lasts beyond the end of the cycle
            mode = PROGRAM
            if parts > 1:
                end = table.start[first + begun] if begun < parts else table.start[first] + table.length[cycle]
                remaining = end - place
        columns.state[k, light] = state
        columns.mode[k, light] = mode
        columns.time_to_change[k, light] = remaining * table.tick if remaining >= 0 else np.nan


@jit_uncounted
def _is_within(time: float, first: float, last: float) -> bool:
    """Whether a time of day is in a window, which may contain midnight; False if one of them is not a number."""
    is_after, is_before = time >= first, time < last
    return (is_after and is_before) if first <= last else (is_after or is_before)


def row_of(columns: LightColumns) -> LightColumns:
    """Views of the row of a World, shape (l,) each."""
    return LightColumns(*(column[0] for column in columns))


def frames(names: Sequence[str], row: LightColumns) -> dict[str, TrafficLightFrame]:
    """What the lights of a World show; `row`: see `row_of`."""
    rows = zip(names, row.state.tolist(), row.time_to_change.tolist(), row.mode.tolist(), strict=True)
    return {
        name: TrafficLightFrame(STATES[state], time if time == time else None, MODES[mode])  # noqa: PLR0124  nan
        for name, state, time, mode in rows
    }


STATES = tuple(TrafficLightState)
"""Traffic light states by number: an index is faster than a call of the class."""
