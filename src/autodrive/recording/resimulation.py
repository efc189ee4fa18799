"""Simulates a recording again and compares every Frame, bit by bit."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from msgspec.structs import replace

from autodrive.base.errors import SnapshotError, SpecError
from autodrive.protocol.messages import Command, Event, Frame, LoadScenario, Pause, Resume, SetSpeed
from autodrive.protocol.native import ContactForces
from autodrive.recording import records
from autodrive.recording.about import about_here
from autodrive.recording.errors import RecordingError
from autodrive.recording.recording import Recording
from autodrive.recording.records import CommandsRecord, RequestRecord, ScenarioRecord
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.descriptions import Descriptions
from autodrive.scenario.files import described
from autodrive.world import OwnSensor, World, saved_world
from autodrive.world.factory import new_world
from autodrive.world.observer import Request, ResetTo, Restored, SensorAdded, SetPoses
from autodrive.world.simulation import Simulation


@dataclass(frozen=True)
class Difference:
    """The first difference between a recording and the simulation of it."""

    time: float
    """Time of the difference in the recording [s]."""
    tick: int
    signal: str
    """Path in the Frame, such as 'vehicles.V1.imu.euler[2]'."""
    recorded: Any
    simulated: Any

    def __str__(self) -> str:
        return (
            f"different at tick {self.tick} ({self.time:g} s): {self.signal} was {self.recorded} in the recording and "
            f"is {self.simulated} now"
        )


@dataclass(frozen=True)
class Resimulation:
    """Result of `resimulate`."""

    frames: int
    """Frames that were compared."""
    difference: Difference | None
    """The first difference; None: both are identical."""
    made_by: str
    """Versions that made the recording, if they are not those of this installation; empty if they are."""

    def __str__(self) -> str:
        """'identical' or the difference."""
        return "identical" if self.difference is None else str(self.difference)


OwnSensors: TypeAlias = Mapping[str, Mapping[str, Callable[[], OwnSensor]]]
"""The class of each sensor of the user, by vehicle and name: `{"V1": {"radar": Radar}}`."""


def resimulate(recording: Recording, own_sensors: OwnSensors | None = None) -> Resimulation:
    """Run the scenario again with the recorded commands and requests, and compare every Frame.

    `own_sensors`: the sensors of the user, whose code a recording does not contain. Raises `RecordingError` if one of
    them is missing, if the recording does not begin at the start of a World, or if it is not whole. Images are not
    compared: JPEG is not the same on every machine.
    """
    count, now, difference = 0, 0.0, None
    try:
        with closing(simulated_again(recording, own_sensors=own_sensors or {})) as pairs:
            for now, recorded, simulated in pairs:
                count += 1
                difference = first_difference(recorded, simulated, now)
                if difference is not None:
                    break
    except SpecError as error:
        made_by = _other_versions(recording)
        versions = f"; it was made by {made_by}" if made_by else ""
        raise RecordingError(f"this version cannot simulate the scenario of the recording: {error}{versions}") from None
    problems = recording.problems
    if difference is None and problems:
        raise RecordingError(
            f"identical up to {now:g} s ({count} Frames), but the recording is not complete: {problems[0]}"
        )
    return Resimulation(count, difference, _other_versions(recording))


def simulated_again(
    recording: Recording,
    changed: Callable[[ScenarioSpec], ScenarioSpec] = lambda spec: spec,
    own_sensors: OwnSensors | None = None,
) -> Generator[tuple[float, Frame, Frame]]:
    """Run a recording again: time [s], recorded and simulated Frame of each recorded tick.

    `changed` returns the scenario that is simulated in the place of a recorded one. `own_sensors`: see `resimulate`,
    which raises the same. None: they are left out.
    """
    for time, recorded, again in _each_frame(recording, changed, own_sensors):
        yield time, recorded, again.frame(recorded.tick)


def forces_again(recording: Recording) -> Generator[tuple[float, dict[str, ContactForces]]]:
    """Run a recording again: time [s] and contact forces of each recorded tick; see `World.contact_forces`.

    Raises `RecordingError` as `resimulate`, and where vehicles are not where they were.
    """
    for time, recorded, again in _each_frame(recording, lambda spec: spec, None, watches_contacts=True):
        simulated = again.frame(recorded.tick)
        for name, vehicle in recorded.vehicles.items():
            if vehicle.pose.position.tobytes() != simulated.vehicles[name].pose.position.tobytes():
                raise RecordingError(f"the simulation differs from the recording: {name} is at another position")
        yield time, again.contact_forces


def _each_frame(
    recording: Recording,
    changed: Callable[[ScenarioSpec], ScenarioSpec],
    own_sensors: OwnSensors | None,
    *,
    watches_contacts: bool = False,
) -> Generator[tuple[float, Frame, _Again]]:
    """Time [s] and recorded Frame of each recorded tick, and the simulation, which has all that came before it."""
    is_start = recording.scenario.is_start and not recording.start_tick
    if not is_start and records.STATE not in recording.attachments:
        raise RecordingError(
            f"the recording begins at tick {recording.start_tick}, not at the start of a run, so it cannot be "
            "simulated again: it has no state to begin with, because it contains the last seconds only, a race, or "
            "sensors of the user; record those from the start, without --record-last"
        )
    with ExitStack() as stack:
        again = _Again(recording, stack, changed, own_sensors, watches_contacts=watches_contacts)
        if not is_start:
            again.begin(recording.attachment(records.STATE), recording.frame_at(recording.start))
        for time, record in recording.sequence():
            if isinstance(record, Frame):
                yield time, record, again
            else:
                again.take(record)


class _Again:
    """The simulation that repeats a recording."""

    def __init__(
        self,
        recording: Recording,
        stack: ExitStack,
        changed: Callable[[ScenarioSpec], ScenarioSpec],
        own_sensors: OwnSensors | None,
        *,
        watches_contacts: bool = False,
    ) -> None:
        self._watches_contacts = watches_contacts
        self._recording = recording
        self._stack = stack
        self._changed = changed
        self._own_sensors = own_sensors
        self._scenario = recording.scenario
        self._simulation = Simulation(self._load(""), is_paused=True, load=self._load)
        stack.callback(lambda: self._simulation.world.close())  # noqa: PLW0108  another one by then
        stack.enter_context(self._simulation)
        self._commands: dict[str, Command] = {}
        self._events: tuple[Event, ...] = ()

    def _load(self, scenario: str | Descriptions) -> World:
        """The World of the latest scenario of the recording, or of an edited one."""
        known = None if isinstance(scenario, str) else scenario
        if known:
            recorded = known.specs.scenario
        else:
            recorded = self._stack.enter_context(self._recording.scenario_spec(self._scenario))
        spec = self._changed(recorded)
        if spec.tick != recorded.tick:
            raise RecordingError(
                f"the scenario has a tick of {spec.tick} s; that of the recording is {recorded.tick} s"
            )
        world = new_world(described(spec, known=known))
        if known is None:  # the World of an edit takes over the sensors of the one before
            for vehicle, names in self._scenario.own_sensors.items():
                for name in names:
                    self._add_sensor(world, vehicle, name)
        return world

    def _add_sensor(self, world: World, vehicle: str, name: str) -> None:
        if self._own_sensors is None:
            return
        kind = self._own_sensors.get(vehicle, {}).get(name)
        if kind is None:
            raise RecordingError(
                f"the recording has the sensor '{name}' of the user on vehicle '{vehicle}', whose code is not in the "
                f"recording: give its class, resimulate(recording, {{'{vehicle}': {{'{name}': CLASS}}}}), or on the "
                f"command line --sensor {vehicle}/{name}=FILE.py:CLASS"
            )
        world.add_sensor(vehicle, name, kind())

    def begin(self, state: bytes, frame: Frame) -> None:
        """Begin in the middle of a run, with that state and the first Frame of the recording."""
        try:
            saved_world.restore(self._simulation.world, state, frame)
        except SnapshotError as error:
            raise RecordingError(f"the recording cannot be simulated again from its start: {error}") from None
        self._events = frame.events

    def take(self, record: object) -> None:
        """A scenario, commands or a request."""
        match record:
            case CommandsRecord(tick=tick, commands=commands):
                self._run_to(tick)
                self._commands = commands
            case RequestRecord(tick=tick, request=request):
                self._run_to(tick)
                self._execute(request)
            case ScenarioRecord():
                pass  # those of edits follow from the edits; `_execute` reads those of loaded scenarios

    @property
    def contact_forces(self) -> dict[str, ContactForces]:
        """Contact forces of the latest tick."""
        return self._simulation.world.contact_forces

    def frame(self, tick: int) -> Frame:
        """The Frame of that tick, with all events since the one before."""
        self._run_to(tick)
        events, self._events = self._events, ()
        return replace(self._simulation.world.frame, events=events)

    def _run_to(self, tick: int) -> None:
        """A recording at a lower rate does not have each tick."""
        world = self._simulation.world
        if self._watches_contacts and not world.watches_contacts:
            world.watch_contacts()
        while world.frame.tick < tick:
            commands, self._commands = self._commands, {}
            self._events += world.step(commands).events

    def _execute(self, request: Request) -> None:
        world = self._simulation.world
        before = world.frame
        match request:
            case Pause() | Resume() | SetSpeed():
                pass  # they change when a tick runs, not what it does
            case SetPoses() | ResetTo():
                world.apply(request)
            case SensorAdded(vehicle=vehicle, name=name):
                self._add_sensor(world, vehicle, name)
            case Restored():
                raise RecordingError(
                    f"after tick {world.frame.tick} the World was restored from a snapshot, which is not in the "
                    "recording: the recording cannot be simulated again"
                )
            case _:
                if isinstance(request, LoadScenario):
                    self._scenario = next(self._loaded)
                self._simulation.request(request).result()
        if (frame := self._simulation.world.frame) is not before:
            self._events += frame.events

    @cached_property
    def _loaded(self) -> Iterator[ScenarioRecord]:
        """The scenarios that were loaded, in order: each follows its request."""
        is_next = False
        for _, record in self._recording.records_of(records.REQUESTS, records.SCENARIO):
            if isinstance(record, RequestRecord):
                is_next = isinstance(record.request, LoadScenario)
            elif is_next and isinstance(record, ScenarioRecord):
                yield record


def first_difference(recorded: Frame, simulated: Frame, time: float) -> Difference | None:
    """The first signal of two Frames that differs; images are not compared."""
    for path, recorded_value, simulated_value in _differences(recorded, simulated, ""):
        return Difference(time, recorded.tick, path, recorded_value, simulated_value)
    return None


def _differences(a: Any, b: Any, path: str) -> Iterator[tuple[str, Any, Any]]:
    a, b = _plain(a), _plain(b)
    if type(a) is not type(b):
        yield path, a, b
    elif isinstance(a, np.ndarray):
        if a.tobytes() != b.tobytes():
            yield from _in_arrays(a, b, path)
    elif hasattr(a, "__struct_fields__"):
        for field in a.__struct_fields__:
            if field != "cameras":
                yield from _differences(getattr(a, field), getattr(b, field), f"{path}.{field}" if path else field)
    elif isinstance(a, dict | tuple):
        keys = [*a] if isinstance(a, dict) else range(len(a))
        others = [*b] if isinstance(b, dict) else range(len(b))
        if [*keys] != [*others]:
            yield path, _short(a), _short(b)
            return
        for key in keys:
            yield from _differences(a[key], b[key], f"{path}.{key}")
    elif a != b and repr(a) != repr(b):  # NaN is NaN
        yield path, a, b


def _plain(value: Any) -> Any:
    """A value without the types that do not matter: a number of numpy, a dictionary with errors of its own."""
    if isinstance(value, dict):
        return dict(value)
    return value.item() if isinstance(value, np.generic) else value


def _in_arrays(a: Any, b: Any, path: str) -> Iterator[tuple[str, Any, Any]]:
    if a.shape != b.shape:
        yield path, f"of shape {a.shape}", f"of shape {b.shape}"
        return
    for i in range(len(a)):
        if a[i].tobytes() != b[i].tobytes():
            yield f"{path}[{i}]", a[i].item(), b[i].item()


def _short(value: Any) -> Any:
    return [*value] if isinstance(value, dict) else value


def _other_versions(recording: Recording) -> str:
    """Versions in which the recording and this installation differ."""
    here = about_here()
    versions = recording.about
    return ", ".join(
        f"{name} {versions.get(name, 'unknown')} (here {here[name]})"
        for name in here
        if versions.get(name, "unknown") != here[name]
    )
