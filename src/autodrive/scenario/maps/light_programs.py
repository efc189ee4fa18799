"""Programs of traffic lights: phases of groups of lights, and which light shows what at which tick of the cycle."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, model_validator

from autodrive.base.specs import Name, Rule, RuleError, Spec, TimeOfDay
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import TrafficLightState

MAX_PROGRAMS = 100
"""Most programs of a map or a scenario."""
MAX_LIGHTS = 32
"""Traffic lights of a map."""
MAX_DURATION = 1e4
"""Longest part of a program [s]."""
OFF, RED, YELLOW, GREEN = TrafficLightState
MODES: tuple[Literal["off", "program", "flashing", "set"], ...] = ("off", "program", "flashing", "set")
"""`TrafficLightFrame.mode` by its number."""
DARK, PROGRAM, FLASHING, SET = range(4)


class LightPhase(Spec):
    """A part of the cycle in which some groups have green and all others have red."""

    green: tuple[str, ...] = ()
    """Names of groups; none: all have red."""
    duration: float = Field(ge=0.1, le=MAX_DURATION)
    """Duration of the green light [s]; yellow and all-red follow."""


class LightProgramSpec(Spec):
    """The program of the traffic lights of an intersection: its phases follow each other without end."""

    groups: Annotated[dict[str, tuple[Name, ...]], Field(min_length=1, max_length=MAX_LIGHTS)]
    """Traffic lights that always show the same, by the name of their group."""
    phases: Annotated[tuple[LightPhase, ...], Field(min_length=1, max_length=100)]
    yellow: float = Field(default=1.0, ge=0.0, le=MAX_DURATION)
    """Duration of yellow after the green of a group that has red in the next phase [s]."""
    all_red: float = Field(default=1.0, ge=0.0, le=MAX_DURATION)
    """Time after such a yellow in which no other group gets green [s]."""
    offset: float = Field(default=0.0, ge=-MAX_DURATION, le=MAX_DURATION)
    """Simulated time at which the first phase begins [s]; other offsets along a road make a green wave."""
    flashing: tuple[TimeOfDay, TimeOfDay] | None = None
    """Times of day from which and to which the lights flash yellow instead; left out: never."""

    @model_validator(mode="after")
    def _names_are_known(self) -> LightProgramSpec:
        errors: list[Rule] = [
            (("phases", i, "green"), f"group '{name}' is not known. {suggest(name, list(self.groups))}")
            for i, phase in enumerate(self.phases)
            for name in phase.green
            if name not in self.groups
        ]
        lights = self.lights
        errors += [
            (("groups",), f"light '{name}' is in several groups")
            for name in dict.fromkeys(lights)
            if lights.count(name) > 1
        ]
        if errors:
            raise RuleError(errors)
        return self

    @property
    def lights(self) -> list[str]:
        """Names of the lights of all groups."""
        return [name for group in self.groups.values() for name in group]

    def without(self, names: set[str]) -> LightProgramSpec:
        """The program without these lights, which are no longer in the map."""
        groups = {
            group: tuple(light for light in lights if light not in names) for group, lights in self.groups.items()
        }
        return self.model_copy(update={"groups": groups})


@dataclass(frozen=True)
class LightCycle:
    """What a traffic light shows in the course of the cycle of its program; all times in ticks."""

    length: int
    offset: int
    starts: tuple[int, ...]
    """Where in the cycle each state begins, ascending."""
    states: tuple[TrafficLightState, ...]
    flashing: tuple[float, float] | None
    """Times of day between which the light flashes, see `LightProgramSpec.flashing`."""

    def at(self, tick: int) -> tuple[TrafficLightState, int | None]:
        """The state at a tick, and the number of ticks until it changes; None: it never changes."""
        place = (tick - self.offset) % self.length
        k = bisect_right(self.starts, place) - 1  # -1: the last state lasts beyond the end of the cycle
        if len(self.states) == 1:
            return self.states[0], None
        end = self.starts[k + 1] if k + 1 < len(self.starts) else self.starts[0] + self.length
        return self.states[k], end - place


def light_cycles(spec: LightProgramSpec, tick: float) -> dict[str, LightCycle]:
    """The cycle of each light of a program, for ticks of that duration [s]; each part has at least one tick."""
    parts: dict[str, list[tuple[int, TrafficLightState]]] = {group: [] for group in spec.groups}
    now = 0
    for i, phase in enumerate(spec.phases):
        following = spec.phases[(i + 1) % len(spec.phases)].green
        ending = [group for group in phase.green if group not in following]
        green = now + max(1, round(phase.duration / tick))
        yellow = green + (round(spec.yellow / tick) if ending else 0)
        for group in spec.groups:
            parts[group].append((now, GREEN if group in phase.green else RED))
            if group in ending:
                parts[group] += [(green, YELLOW), (yellow, RED)]
        now = yellow + (round(spec.all_red / tick) if ending else 0)
    offset = round(spec.offset / tick)
    cycles: dict[str, LightCycle] = {}
    for group, names in spec.groups.items():
        starts, states = zip(*_changes(parts[group], now), strict=True)
        cycles |= dict.fromkeys(names, LightCycle(now, offset, starts, states, spec.flashing))
    return cycles


def _changes(parts: list[tuple[int, TrafficLightState]], length: int) -> Iterator[tuple[int, TrafficLightState]]:
    """The parts that differ from the one before, in a cycle; the first one if all are equal."""
    ends = [start for start, _ in parts[1:]] + [length]
    lasting = [part for part, end in zip(parts, ends, strict=True) if end > part[0]]
    changes = [part for before, part in zip([lasting[-1], *lasting], lasting, strict=False) if part[1] != before[1]]
    yield from changes or lasting[:1]


def all_programs(
    of_map: Mapping[str, LightProgramSpec], of_scenario: Mapping[str, LightProgramSpec | None]
) -> dict[str, LightProgramSpec]:
    """The programs of a map, changed by those of a scenario."""
    return {name: program for name, program in {**of_map, **of_scenario}.items() if program is not None}


def program_problems(programs: Mapping[str, LightProgramSpec], lights: list[str]) -> Iterator[tuple[str, str]]:
    """The name of each program that does not fit traffic lights of these names, and what is wrong."""
    owners: dict[str, str] = {}
    for name, program in programs.items():
        for light in program.lights:
            if light not in lights:
                yield name, f"the map has no traffic light '{light}'. {suggest(light, lights)}"
            elif light in owners:
                yield name, f"light '{light}' is also in the program '{owners[light]}'"
            owners[light] = name
