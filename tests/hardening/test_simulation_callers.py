"""Hostile callers of a Simulation: any requests in any order, with any arguments.

Only documented errors are raised, a refused request changes nothing, and at the end the simulation has the bits of a
fresh one that was given the accepted calls alone. With test_callers.py AUTODRIVE_HARDENING=long makes 100 000 calls.
"""

from __future__ import annotations

import pickle
from typing import Any, NamedTuple

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import (
    invariant,
    precondition,
    rule,
)

import autodrive
from autodrive.protocol import messages
from autodrive.protocol.messages import Command, Frame
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.descriptions import Descriptions
from autodrive.world import Snapshot, World
from autodrive.world.simulation import Simulation
from tests.hardening.test_callers import COMMANDS, FLAGS, NAMES, NUMBERS, QUATERNIONS, SEEDS, VECTORS, Caller, attack
from tests.support.hardening import cases
from tests.support.waiting import LIMIT

STEPS = 50
EXAMPLES = cases(3, 800)
"""Each of `STEPS` calls."""

NEW = st.sampled_from(["a", "b", "c"])
KEYS = NAMES.filter(lambda name: not isinstance(name, list))
PLACES = st.floats(-2.0, 2.0)
SCENARIOS = st.sampled_from(
    ["plane", "boxes", "two_cars", "nowhere", "", "../plane", "plane\0", "/etc/passwd", "x.yaml"]
)
SENSORS = st.sampled_from(["lidar", "imu", "ips", "encoders", "front", "rear", "range", "nothing", "", None, 3])
NOISES = st.sampled_from([None, "ideal", "file", "realistic", "strong", "loud", 1])
STEPPED = st.one_of(
    st.dictionaries(st.sampled_from(["V1", "V2"]), st.builds(Command, st.floats(-1, 1), st.floats(-1, 1))),
    st.dictionaries(st.sampled_from(["V1", "V9", 7, None]), st.one_of(COMMANDS, NUMBERS)),
    NUMBERS,
)
REQUESTS: st.SearchStrategy[Any] = st.one_of(
    st.builds(messages.Step, st.one_of(st.integers(1, 5), st.sampled_from([0, -1, None, 2.0, "1"])), STEPPED),
    st.builds(messages.Reset, SEEDS),
    st.builds(messages.Pause),
    st.builds(messages.SetSpeed, st.one_of(st.none(), st.floats(0.1, 10), NUMBERS)),
    st.builds(messages.Teleport, NAMES, NUMBERS, NUMBERS, NUMBERS),
    st.builds(messages.Hold, NAMES, VECTORS, QUATERNIONS),
    st.builds(messages.SetSceneLight, FLAGS),
    st.builds(messages.SetTimeOfDay, st.one_of(st.none(), st.floats(0, 1e5), NUMBERS), NUMBERS),
    st.builds(messages.SetDrivingMode, NAMES, FLAGS),
    st.builds(messages.LoadScenario, st.one_of(SCENARIOS, NAMES)),
    st.builds(messages.SaveScenario),
    st.sampled_from([None, 7, "Reset", {}, messages.Reset, object(), Command()]),
)
PARTS = st.one_of(
    st.builds(
        messages.MapModule, st.sampled_from(["curved_road", "lawn", "construction_box", "", "x.yaml"]), PLACES, PLACES
    ),
    st.builds(messages.MapModule, NAMES, NUMBERS, NUMBERS, NUMBERS, st.one_of(FLAGS, NUMBERS), NUMBERS),
    st.builds(messages.MapWall, st.lists(st.tuples(PLACES, PLACES), max_size=4), NUMBERS, NUMBERS),
    st.builds(messages.MapBlock, PLACES, PLACES, st.floats(0.1, 1.0), st.floats(0.1, 1.0), st.floats(0.1, 1.0)),
    st.builds(messages.MapProp, NAMES, NUMBERS, NUMBERS, NUMBERS),
)
EDITS: st.SearchStrategy[Any] = st.one_of(
    st.builds(messages.Place, st.one_of(NEW, NAMES), PLACES, PLACES, PLACES),
    st.builds(messages.Place, NAMES, NUMBERS, NUMBERS, NUMBERS),
    st.builds(messages.AddBox, NEW, PLACES, PLACES, PLACES),
    st.builds(messages.AddBox, st.one_of(NEW, NAMES), NUMBERS, NUMBERS, NUMBERS, VECTORS, NUMBERS),
    st.builds(messages.RemoveBox, st.one_of(NEW, NAMES)),
    st.builds(messages.RemoveTraffic),
    st.builds(messages.InsertModule, st.one_of(NEW, NAMES), st.one_of(NEW, NAMES), NAMES),
    st.builds(messages.SetSensor, NAMES, SENSORS, FLAGS, st.one_of(st.none(), st.floats(1, 100), NUMBERS), NOISES),
    st.builds(messages.EditMap, st.dictionaries(st.one_of(NEW, KEYS), st.one_of(st.none(), PARTS, NUMBERS))),
    st.builds(messages.UseMap, st.one_of(SCENARIOS, NAMES)),
    st.builds(messages.CloseLoop, st.one_of(NEW, NAMES), NAMES, st.one_of(NEW, NAMES), NAMES),
    st.builds(messages.EditTrack, st.builds(messages.TrackLine, st.lists(st.tuples(PLACES, PLACES), max_size=8))),
    st.builds(messages.Undo),
    st.builds(messages.Redo),
)


class Running(NamedTuple):
    """A paused simulation in its thread, and the snapshots of its worlds."""

    simulation: Simulation
    saved: list[Snapshot]

    @property
    def frame(self) -> Frame:
        return self.simulation.frame

    def step(self) -> Frame:
        return self.simulation.request(messages.Step()).result(LIMIT)

    def reset(self) -> None:
        self.simulation.request(messages.Reset()).result(LIMIT)

    def close(self) -> None:
        self.simulation.stop()
        self.simulation.world.close()


class Operator(Caller):
    """Requests and calls of a Simulation."""

    def started(self) -> Running:
        vehicles = {"V1": VehiclePlacement(), "V2": VehiclePlacement(x=0.6)}
        world = autodrive.make(ScenarioSpec(vehicles=vehicles, boxes={"box": BoxSpec(x=0.3, y=0.4)}))
        simulation = Simulation(world, is_paused=True, speed=None, load=autodrive.make, pause_on_error=True)
        simulation.start()
        return Running(simulation, [])

    @rule(request=REQUESTS, is_here=st.booleans())
    def request(self, request: Any, is_here: bool) -> None:
        self.call(lambda running: running.simulation.request(request, here=is_here).result(LIMIT))

    @rule(edit=EDITS)
    def edit(self, edit: Any) -> None:
        self.call(lambda running: running.simulation.request(edit).result(LIMIT))

    @rule(name=NAMES, command=st.one_of(COMMANDS, NUMBERS), source=st.sampled_from(["script", "person", "", None, []]))
    def submit(self, name: Any, command: Any, source: Any) -> None:
        self.call(lambda running: running.simulation.submit(name, command, source))

    @rule(ticks=st.integers(1, 10), throttle=st.floats(-1, 1), steering=st.floats(-1, 1))
    def drive(self, ticks: int, throttle: float, steering: float) -> None:
        step = messages.Step(ticks, {"V1": Command(throttle, steering)})
        self.call(lambda running: running.simulation.request(step).result(LIMIT))

    @rule()
    def save(self) -> None:
        self.call(lambda running: running.saved.append(running.simulation.world.save()))

    @precondition(lambda self: self.subject.saved)
    @rule(data=st.data(), is_pickled=st.booleans())
    def restore(self, data: st.DataObject, is_pickled: bool) -> None:
        """Of this world, or of one before an edit, which may be refused."""
        number = data.draw(st.integers(0, len(self.subject.saved) - 1))

        def made(running: Running) -> None:
            saved = running.saved[number]
            running.simulation.world.restore(pickle.loads(pickle.dumps(saved)) if is_pickled else saved)

        self.call(made)

    @invariant()
    def is_running(self) -> None:
        assert self.subject.simulation.is_running
        assert self.subject.simulation.is_paused


def test_any_calls_in_any_order() -> None:
    attack(Operator, EXAMPLES)


def test_a_request_that_fails_unexpectedly_is_logged_and_the_run_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    def load(scenario: str | ScenarioSpec | Descriptions) -> World:
        raise ZeroDivisionError(f"in {scenario}")

    with Simulation(autodrive.make("plane"), is_paused=True, load=load, pause_on_error=True) as simulation:
        with pytest.raises(ZeroDivisionError, match="in mini_map"):
            simulation.request(messages.LoadScenario("mini_map")).result(LIMIT)
        frame: Frame = simulation.request(messages.Step(3)).result(LIMIT)
    assert frame.tick == 3
    (record,) = caplog.records
    assert record.message == "a request failed: LoadScenario(name='mini_map')"
    assert record.exc_info
