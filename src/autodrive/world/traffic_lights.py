"""The traffic lights of a world: what they show at a tick, and who crosses their stop lines at red."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.errors import CommandError
from autodrive.base.jit import jit_uncounted, resolved
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import Event, RedLight, StopSign, TrafficLightFrame, TrafficLightState
from autodrive.scenario.maps.light_programs import LightCycle, LightProgramSpec, light_cycles
from autodrive.scenario.maps.stop_lines import StopLine

FLASH_PERIOD = 1.0
"""Of a flashing light [s]; it is on in the first half."""
STOP_SPEED = 0.05
"""A slower vehicle has stopped [m/s]."""
STOP_REACH = 1.0
"""It must have stopped with its front within so many of its lengths before the stop line."""
OFF, RED, YELLOW, GREEN = TrafficLightState
RED_STATE = int(RED)
_Phase: TypeAlias = tuple[TrafficLightState, int | None, Literal["off", "program", "flashing"]]
"""What a light shows, the tick at which that changes (None: never), and its mode."""


class LightTable(NamedTuple):
    """What l lights show at any tick while nobody sets them: c different cycles of p parts in all; times in ticks."""

    cycle: Integers
    """Number of the cycle of each light, shape (l,)."""
    is_regulating: NDArray[np.bool_]
    """Whether it is neither dark nor flashing, shape (l,)."""
    length: Integers
    """Of each cycle, shape (c,); likewise the offset: see `LightCycle`."""
    offset: Integers
    first: Integers
    """Where the parts of each cycle begin, and where the last one ends, shape (c + 1,)."""
    start: Integers
    """Place in the cycle at which each part begins, shape (p,)."""
    state: Integers
    """`TrafficLightState`, shape (p,)."""
    tick: float
    """Its duration [s]."""


class TrafficLights:
    """The traffic lights of a map by name, as their programs or requests set them."""

    def __init__(self, names: Sequence[str], programs: Mapping[str, LightProgramSpec], tick: float) -> None:
        """`tick`: duration of a tick [s]."""
        cycles = {name: cycle for one in programs.values() for name, cycle in light_cycles(one, tick).items()}
        of_lights = {name: cycles.get(name) for name in names}
        self._cycles = list(dict.fromkeys(of_lights.values()))
        """The different ones: a tick looks once for all lights of a group. None: without a program."""
        self._cycle_of = {name: self._cycles.index(cycle) for name, cycle in of_lights.items()}
        self._tick = tick
        self._half_flash = max(1, round(0.5 * FLASH_PERIOD / tick))
        self.set_states: dict[str, TrafficLightState] = {}
        """States that were set by a request."""
        self._phases: list[_Phase] = []
        """Of the cycles, from one tick on and until another one, while there is no time of day."""
        self._since, self._until = 0, 0.0

    def __len__(self) -> int:
        return len(self._cycle_of)

    def set(self, light: str, state: TrafficLightState | None) -> None:
        """See `SetTrafficLight`. Raises `CommandError`."""
        if light not in self._cycle_of:
            raise CommandError(f"traffic light '{light}' is not known. {suggest(str(light), list(self._cycle_of))}")
        if state is None:
            self.set_states.pop(light, None)
            return
        try:
            self.set_states[light] = TrafficLightState(state)
        except ValueError:
            known = ", ".join(f"{one.value} {one.name.lower()}" for one in TrafficLightState)
            raise CommandError(
                f"state of traffic light '{light}' must be None or one of {known}, not {state!r}"
            ) from None

    def restore(self, states: Mapping[str, TrafficLightState]) -> None:
        """Go back to these `set_states`, which may be those of a world with other lights."""
        self.set_states = {light: state for light, state in states.items() if light in self._cycle_of}

    def at(self, tick: int, time_of_day: float | None) -> dict[str, TrafficLightFrame]:
        """What they show. `time_of_day` [s since midnight]; None: the light of the scene is fixed."""
        if time_of_day is not None or not self._since <= tick < self._until:
            self._phases = [self._phase(cycle, tick, time_of_day) for cycle in self._cycles]
            ends = [end for _, end, _ in self._phases if end is not None]
            self._since, self._until = tick, min(ends, default=math.inf) if time_of_day is None else tick
        shown = [
            TrafficLightFrame(state, None if end is None else (end - tick) * self._tick, mode)
            for state, end, mode in self._phases
        ]
        frames = {name: shown[k] for name, k in self._cycle_of.items()}
        for name, state in self.set_states.items():
            frames[name] = TrafficLightFrame(state, None, "set")
        return frames

    def table(self, time_of_day: float | None) -> LightTable:
        """What all lights show at that time of day without requests; see `show_lights`."""
        half = self._half_flash
        flash, dark = LightCycle(2 * half, 0, (0, half), (YELLOW, OFF), None), LightCycle(1, 0, (0,), (OFF,), None)
        shown = [dark if one is None else flash if one.flashes(time_of_day) else one for one in self._cycles]
        cycle = np.array([*self._cycle_of.values()], np.int64)
        return LightTable(
            cycle=cycle,
            is_regulating=np.array([one not in (flash, dark) for one in shown], np.bool_)[cycle],
            length=np.array([one.length for one in shown], np.int64),
            offset=np.array([one.offset for one in shown], np.int64),
            first=np.cumsum([0, *(len(one.starts) for one in shown)]),
            start=np.array([start for one in shown for start in one.starts], np.int64),
            state=np.array([state for one in shown for state in one.states], np.int64),
            tick=self._tick,
        )

    def _phase(self, cycle: LightCycle | None, tick: int, time_of_day: float | None) -> _Phase:
        if cycle is None:
            return OFF, None, "off"
        if cycle.flashes(time_of_day):
            halves = tick // self._half_flash
            return OFF if halves % 2 else YELLOW, (halves + 1) * self._half_flash, "flashing"
        state, ticks = cycle.at(tick)
        return state, None if ticks is None else tick + ticks, "program"


@jit_uncounted
def show_lights(table: LightTable, tick: int, state: Integers, time_to_change: Floats) -> None:
    """Write state and time to change [s] of all lights at a tick, shape (l,) each; the time is nan if it is None."""
    for light in range(table.cycle.shape[0]):
        cycle = table.cycle[light]
        first, parts = table.first[cycle], table.first[cycle + 1] - table.first[cycle]
        place = (tick - table.offset[cycle]) % table.length[cycle]
        begun = 0
        while begun < parts and table.start[first + begun] <= place:
            begun += 1
        state[light] = table.state[first + (begun - 1) % parts]  # 0: the last state lasts beyond the end of the cycle
        end = table.start[first + begun] if begun < parts else table.start[first] + table.length[cycle]
        time_to_change[light] = np.nan if parts == 1 else (end - place) * table.tick


class StopLineTable(NamedTuple):
    """m stop lines and v vehicles for compiled code."""

    lines: Floats
    """x, y, cosine and sine of the heading, width, whether it belongs to a stop sign, shape (m, 6)."""
    light: Integers
    """Number of its traffic light; -1: it belongs to a stop sign, shape (m,)."""
    fronts: Floats
    """From the origin of each vehicle to its front [m], shape (v,)."""
    reach: Floats
    """Distance before a line within which a vehicle must have stopped [m], shape (v,)."""


def stop_line_table(
    lines: Sequence[StopLine], lengths: Sequence[tuple[float, float]], lights: Sequence[str]
) -> StopLineTable:
    """`lengths`: from the origin to the front of each vehicle, and its length [m]; `lights`: names of all lights."""
    rows = [(*one.pose[:2], math.cos(one.pose[2]), math.sin(one.pose[2]), one.width) for one in lines]
    return StopLineTable(
        lines=np.array([(*row, one.kind == "stop") for row, one in zip(rows, lines, strict=True)]).reshape(-1, 6),
        light=np.array([-1 if one.kind == "stop" else lights.index(one.prop) for one in lines], np.int64),
        fronts=np.array([front for front, _ in lengths]),
        reach=np.array([STOP_REACH * length for _, length in lengths]),
    )


class StopLineReferee:
    """Makes events of vehicles that cross a stop line at red, or at a stop sign without a stop.

    A vehicle crosses a line when the middle of its front passes from before the line to behind it, within the width of
    the lanes.
    """

    def __init__(self, names: Sequence[str], lines: Sequence[StopLine], table: StopLineTable) -> None:
        """`table`: of these vehicles and lines."""
        self._names, self._lines, self._table = list(names), list(lines), table
        n, m = len(self._names), len(self._lines)
        self._ahead = np.full((n, m), np.nan)
        """From the front of each vehicle to each line, along the heading of the line [m]; nan: not known."""
        self._has_stopped = np.zeros((n, m), np.bool_)
        """Since it came near."""
        self._has_crossed = np.zeros((n, m), np.bool_)
        self._note: Any = None

    def reset(self, vehicle: int | None = None) -> None:
        """Forget where a vehicle was, or all of them: a vehicle that is moved by hand crosses no line."""
        rows = slice(None) if vehicle is None else vehicle
        self._ahead[rows], self._has_stopped[rows] = np.nan, False

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return self._ahead.copy(), self._has_stopped.copy()

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`; one of a map with other stop lines is forgotten."""
        self.reset()
        if saved is not None and saved[0].shape == self._ahead.shape:
            self._ahead[:], self._has_stopped[:] = saved

    def judge(
        self,
        time: float,
        position: Floats,
        orientation: Floats,
        velocity: Floats,
        lights: Callable[[], Mapping[str, TrafficLightFrame]],
    ) -> list[Event]:
        """What happened in the tick that ended at `time` [s]; `lights`: what they show at its end."""
        arguments = (
            self._table,
            position,
            orientation,
            velocity,
            self._ahead,
            self._has_stopped,
            self._has_crossed,
        )
        if self._note is None:
            self._note = resolved(note_stop_lines, *arguments)
        if not self._note(*arguments):
            return []
        events: list[Event] = []
        for i, k in np.argwhere(self._has_crossed).tolist():
            line, place = self._lines[k], read_only_copy(position[i])
            if line.kind == "stop":
                if not self._has_stopped[i, k]:
                    events.append(StopSign(time, self._names[i], line.prop, place))
                self._has_stopped[i, k] = False
            elif lights()[line.prop].state is RED:
                events.append(RedLight(time, self._names[i], line.prop, place))
        return events


@jit_uncounted
def note_stop_lines(
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
        w, x, y, z = orientation[i, 0], orientation[i, 1], orientation[i, 2], orientation[i, 3]
        front_x = position[i, 0] + fronts[i] * (1.0 - 2.0 * (y * y + z * z))
        front_y = position[i, 1] + fronts[i] * (2.0 * (x * y + w * z))
        is_slow = abs(velocity[i, 0]) < STOP_SPEED
        for k in range(lines.shape[0]):
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


@jit_uncounted
def count_offences(
    table: StopLineTable,
    light_state: Integers,
    has_stopped: NDArray[np.bool_],
    has_crossed: NDArray[np.bool_],
    red_light_count: Integers,
    stop_sign_count: Integers,
) -> None:
    """Count the events `RedLight` and `StopSign` of each vehicle; see `note_stop_lines`."""
    for i in range(has_crossed.shape[0]):
        for k in range(has_crossed.shape[1]):
            if not has_crossed[i, k]:
                continue
            if table.light[k] >= 0:
                red_light_count[i] += light_state[table.light[k]] == RED_STATE
            else:
                stop_sign_count[i] += not has_stopped[i, k]
                has_stopped[i, k] = False
