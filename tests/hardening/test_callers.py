"""Hostile callers of the Python API: any calls in any order, with any arguments.

Only documented errors are raised, and the world continues like a new world that got only the accepted calls.
AUTODRIVE_HARDENING=long makes 60 000 calls, and test_simulation_callers.py 40 000 of a Simulation.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

import autodrive
from autodrive.base.errors import AutodriveError, CommandError, EngineError
from autodrive.protocol.messages import Command
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.frames import digest
from tests.support.hardening import cases

SPEC = ScenarioSpec(
    map="mini_map",
    vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(x=0.6)},
    boxes={"box": BoxSpec(x=0.3, y=0.4)},
)

STEPS = 50
EXAMPLES = cases(4, 1500)
"""Of `STEPS` calls each."""

NAMES = st.sampled_from(["V1", "V2", "box", "V9", "", "v1", None, 7, [], ("V1",), b"V1", "V1\0", "x" * 1000])
NUMBERS = st.one_of(
    st.floats(-1.5, 1.5),
    st.sampled_from(
        [0, 1, -1, math.nan, math.inf, -math.inf, 1e300, -1e300, 10**400, 1e5, 5e-324, None, "1", [], 1j, True]
    ),
    st.sampled_from([np.float32(0.5), np.int8(1), np.array(0.5), np.array([0.1, 0.2]), Fraction(1, 3), object()]),
)
LAMPS = st.sampled_from([None, 0, 1, 3, 7, -1, 1.0, "1", [], math.nan])
COMMANDS = st.builds(Command, NUMBERS, NUMBERS, LAMPS, LAMPS)
STEPPED = st.one_of(
    st.none(),
    st.dictionaries(st.sampled_from(["V1", "V2"]), st.builds(Command, st.floats(-1, 1), st.floats(-1, 1))),
    st.dictionaries(st.sampled_from(["V1", "V2", "V9", 7, None]), st.one_of(COMMANDS, NUMBERS)),
    NUMBERS,
    COMMANDS,
)
VECTORS = st.one_of(
    st.none(),
    NUMBERS,
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.03, 0.3)),
    st.lists(NUMBERS, max_size=5).map(tuple),
)
QUATERNIONS = st.one_of(st.just((1.0, 0.0, 0.0, 0.0)), st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS), VECTORS)
POSES = st.one_of(
    NUMBERS,
    VECTORS,
    st.lists(st.floats(-1, 1), min_size=7, max_size=7).map(np.array),
    st.lists(NUMBERS, min_size=7, max_size=7),
)
SEEDS = st.one_of(st.none(), st.integers(0, 3), st.integers(), NUMBERS)
FLAGS = st.one_of(st.booleans(), NUMBERS)


class Caller(RuleBasedStateMachine):
    """Calls of a subject with `frame`, `step`, `reset` and `close`; those that it accepts are kept, and made again with
    a fresh one at the end."""

    calls = 0
    """Of all examples."""

    def __init__(self) -> None:
        super().__init__()
        self.subject = self.started()
        self.accepted: list[Callable[[Any], object]] = []

    def started(self) -> Any:
        """A new subject."""
        raise NotImplementedError

    def call(self, made: Callable[[Any], object]) -> None:
        """Make a call; a refused one changes nothing."""
        type(self).calls += 1
        before, refusal = digest(self.subject.frame), None
        try:
            made(self.subject)
        except EngineError:

            def broken(subject: Any) -> None:
                with pytest.raises(EngineError):
                    made(subject)
                subject.reset()

            self.subject.reset()
            self.accepted.append(broken)
        except AutodriveError as error:
            refusal = str(error)
        else:
            self.accepted.append(made)
        assert refusal is None or (refusal and digest(self.subject.frame) == before), refusal

    def teardown(self) -> None:
        """The same bits as one that has seen the accepted calls only, now and later."""
        fresh = self.started()
        for made in self.accepted:
            made(fresh)
        for _ in range(3):
            assert digest(fresh.step()) == digest(self.subject.step())
        for one in (fresh, self.subject):
            one.close()


def attack(caller: type[Caller], examples: int) -> None:
    """So many examples, each of `STEPS` calls."""
    caller.calls = 0
    run_state_machine_as_test(
        caller,
        settings=settings(
            max_examples=examples,
            stateful_step_count=STEPS,
            deadline=None,
            suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
        ),
    )
    print(f"{caller.calls} calls")
    assert caller.calls >= examples * STEPS // 2


class WorldCaller(Caller):
    """Calls of a World."""

    spec = SPEC

    def __init__(self) -> None:
        super().__init__()
        self.snapshots: list[tuple[Any, int]] = []
        """Each with the number of calls that were accepted before it."""

    def started(self) -> World:
        return autodrive.make(self.spec)

    @rule(commands=STEPPED, ticks=st.integers(1, 5))
    def step(self, commands: Any, ticks: int) -> None:
        for _ in range(ticks):
            self.call(lambda world: world.step(commands))

    @rule(seed=SEEDS)
    def reset(self, seed: Any) -> None:
        self.call(lambda world: world.reset(seed))

    @rule(name=NAMES, x=NUMBERS, y=NUMBERS, yaw=NUMBERS)
    def teleport(self, name: Any, x: Any, y: Any, yaw: Any) -> None:
        self.call(lambda world: world.teleport(name, x, y, yaw))

    @rule(poses=st.one_of(st.dictionaries(st.sampled_from(["V1", "V2", "box", "V9", 7]), POSES), POSES))
    def set_poses(self, poses: Any) -> None:
        self.call(lambda world: world.set_poses(poses))

    @rule(name=NAMES)
    def pose(self, name: Any) -> None:
        self.call(lambda world: world.pose(name))

    @rule(name=NAMES, position=VECTORS, orientation=QUATERNIONS)
    def hold(self, name: Any, position: Any, orientation: Any) -> None:
        self.call(lambda world: world.hold(name, position, orientation))

    @rule(name=NAMES, is_autonomous=FLAGS)
    def set_driving_mode(self, name: Any, is_autonomous: Any) -> None:
        self.call(lambda world: world.set_driving_mode(name, is_autonomous))

    @rule(enabled=FLAGS)
    def set_scene_light(self, enabled: Any) -> None:
        self.call(lambda world: world.set_scene_light(enabled))

    @rule(time=st.one_of(st.none(), st.floats(0, 1e5), NUMBERS), scale=NUMBERS)
    def set_time_of_day(self, time: Any, scale: Any) -> None:
        self.call(lambda world: world.set_time_of_day(time, scale))

    @rule(name=NAMES)
    def vehicle(self, name: Any) -> None:
        self.call(lambda world: world.vehicle(name))

    @rule()
    def save(self) -> None:
        self.snapshots.append((self.subject.save(), len(self.accepted)))

    @precondition(lambda self: self.snapshots)
    @rule(data=st.data(), is_pickled=st.booleans())
    def restore(self, data: st.DataObject, is_pickled: bool) -> None:
        saved, calls = data.draw(st.sampled_from(self.snapshots))
        self.subject.restore(pickle.loads(pickle.dumps(saved)) if is_pickled else saved)
        del self.accepted[calls:]
        self.snapshots = [one for one in self.snapshots if one[1] <= calls]

    @rule(saved=st.one_of(NUMBERS, NAMES, POSES))
    def restore_something_else(self, saved: Any) -> None:
        self.call(lambda world: world.restore(saved))

    @invariant()
    def has_a_frame_of_now(self) -> None:
        assert self.subject.frame.time == self.subject.time


class RaceCaller(WorldCaller):
    """Calls of a World with a race."""

    spec = ScenarioSpec(
        map="practice",
        vehicles=dict.fromkeys(["V1", "V2"], VehiclePlacement(type="roboracer")),
    )

    @rule(name=NAMES, reason=st.sampled_from(["", "x" * 1000, None, 7]), is_disqualified=FLAGS)
    def retire(self, name: Any, reason: Any, is_disqualified: Any) -> None:
        self.call(lambda world: world.retire(name, reason, is_disqualified=is_disqualified))


@pytest.mark.parametrize("caller", [WorldCaller, RaceCaller])
def test_any_calls_in_any_order(caller: type[Caller]) -> None:
    attack(caller, EXAMPLES)


@pytest.mark.parametrize(
    "pose", [(0.1, 0.2, []), ((1.0,), 2.0), np.zeros((7, 7)), np.array(5.0), "1234567", 7 * [np.zeros(2)]], ids=repr
)
def test_a_pose_of_nested_values_is_refused(pose: Any) -> None:
    world = autodrive.make("plane")
    with pytest.raises(CommandError, match="a pose is x, y, z"):
        world.set_poses({"V1": pose})
