"""The contact engine rests while nothing can touch: the same motion as with the engine, and no contact is missed."""

import math
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive.base.transforms import quaternion_from_euler
from autodrive.experiments.policies import Policy
from autodrive.experiments.policies.racer import PERIOD, PolicyRacer
from autodrive.physics.tick import observe, place
from autodrive.protocol.messages import Command, Frame
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.frames import digest

CASES = 10_000 if os.environ.get("AUTODRIVE_HARDENING") == "long" else 250
YARD = ScenarioSpec(
    map="tiny_town",
    vehicles={"V1": VehiclePlacement(x=-1.1, y=-0.15), "V2": VehiclePlacement(type="nigel_2023", x=1.1, y=0.15)},
    boxes={"box": BoxSpec(x=0.0, y=0.0), "low": BoxSpec(x=0.6, y=0.0, size=(0.3, 0.3, 0.01), mass=1.0)},
)

TRACK = ScenarioSpec(
    map="practice",
    vehicles={"V1": VehiclePlacement(type="roboracer"), "V2": VehiclePlacement(type="roboracer_f1tenth")},
    boxes={"box": BoxSpec(x=0.0, y=0.0)},
)


def slalom(frame: Frame) -> dict[str, Command]:
    return {
        name: Command(
            throttle=0.35 + 0.3 * math.sin(0.011 * frame.tick + i), steering=math.sin(0.023 * frame.tick + 2 * i)
        )
        for i, name in enumerate(frame.vehicles)
    }


def engine_is_at(world: World) -> bool:
    """Whether the engine holds the present state, because it has moved the bodies in the last substep."""
    return bool((world.compiled.views.qpos == world.compiled.state.qpos).all())


@pytest.mark.parametrize("map_", ["plane", "mini_map", "tiny_town"])
def test_a_drive_without_contact_agrees_with_the_engine_in_every_substep(map_: str) -> None:
    spec = ScenarioSpec(map=map_, vehicles={"V1": VehiclePlacement(x=0.0, y=-0.15)})
    auto, always = autodrive.make(spec), autodrive.make(spec, engine="always")
    without_engine = 0
    for tick in range(6000):
        # circles: a drive of a minute that stays where it began
        command = {"V1": Command(throttle=0.25 + 0.05 * math.sin(0.02 * tick), steering=0.9)}
        events = auto.step(command).events, always.step(command).events
        assert not any(isinstance(event, autodrive.Collision) for event in (*events[0], *events[1]))
        without_engine += not engine_is_at(auto)
    assert without_engine > 4000
    assert_same_state(auto, always)


@pytest.mark.parametrize("track", ["fast", "practice", "technical"])
def test_a_race_drive_without_contact_agrees_with_the_engine(track: str) -> None:
    """A minute with up to 9 m/s; a policy that keeps off the walls drives both cars by the readings of the first."""
    spec = ScenarioSpec(map=track, vehicles={"V1": VehiclePlacement(type="roboracer_physical")}, tick=PERIOD)
    auto, always = autodrive.make(spec), autodrive.make(spec, engine="always")
    racer = PolicyRacer(Policy.load(Path(__file__).with_name("race_drive.npz")))
    with_engine = 0
    for _ in range(2400):
        command = {"V1": racer.act(auto.frame.vehicles["V1"])}
        auto.step(command)
        always.step(command)
        with_engine += engine_is_at(auto)  # a wall is nearer than the way of a substep
    assert with_engine < 50
    assert auto.frame.vehicles["V1"].collision_count == always.frame.vehicles["V1"].collision_count == 0
    assert_same_state(auto, always)


def assert_same_state(one: World, other: World) -> None:
    for name in ("qpos", "qvel", "vehicle_acceleration", "wheel_normal_load", "wheel_rotation"):
        difference = np.abs(getattr(one.compiled.state, name) - getattr(other.compiled.state, name)).max()
        assert difference < (1e-12 if name == "qpos" else 1e-9), name


def random_start(world: World, rng: np.random.Generator) -> None:
    """Sets the vehicles, flying, flipped or driving, at random near something, without waking the boxes."""
    c = world.compiled
    shapes = c.model.shapes
    for i, row in enumerate(c.model.vehicles):
        targets = [s for s in range(len(shapes.kind)) if shapes.vehicle[s] != i]
        target = rng.choice(targets)
        bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(0.1, 0.9) + shapes.size[target, :2].max()
        position = c.state.shape_position[target] + distance * np.array([math.cos(bearing), math.sin(bearing), 0.0])
        position[2] = rng.choice([c.model.wheels[4 * i]["radius"], rng.uniform(0.02, 0.5)])
        tilt = rng.uniform(-math.pi, math.pi, 2) if rng.random() < 0.2 else np.zeros(2)
        q, dof = int(row["qpos"]), int(row["dof"])
        c.state.qpos[q : q + 3] = position
        c.state.qpos[q + 3 : q + 7] = quaternion_from_euler(tilt[0], tilt[1], rng.uniform(-math.pi, math.pi))
        c.state.qvel[dof : dof + 3] = rng.normal(0.0, rng.choice([0.5, 3.0]), 3) * [1.0, 1.0, 0.2]
        c.state.qvel[dof + 3 : dof + 6] = rng.normal(0.0, rng.choice([0.1, 5.0]), 3)
    observe(c.model, c.state)


@pytest.mark.parametrize("scenario", [YARD, TRACK], ids=["yard", "track"])
def test_no_contact_is_missed(scenario: ScenarioSpec) -> None:
    auto, always = autodrive.make(scenario), autodrive.make(scenario, engine="always")
    for world in (auto, always):
        for _ in range(50):
            world.step()
    settled = auto.save(), always.save()
    assert (auto.compiled.state.asleep[: len(scenario.boxes)] >= 0).all()
    collisions = without_engine = cases = 0
    for seed in range(CASES):
        for world, saved in zip((auto, always), settled, strict=True):
            world.restore(saved)
            random_start(world, np.random.default_rng(seed))
        c = always.compiled
        asleep = c.state.asleep.copy()
        place(c.model, c.state, c.views)
        c.state.asleep[:] = asleep
        if any({c.owners[a], c.owners[b]} & {*scenario.vehicles} for a, b in c.engine.overlapping(depth=0.0)):
            continue
        cases += 1
        for _ in range(15):
            one, other = auto.step(), always.step()
            without_engine += not engine_is_at(auto)
            kinds = [[(type(e), e.vehicle, getattr(e, "other", "")) for e in frame.events] for frame in (one, other)]
            assert kinds[0] == kinds[1], (seed, one.tick)
            if any(kind is autodrive.Collision for kind, _, _ in kinds[0]):
                collisions += 1
                break
    assert cases > 0.2 * CASES
    assert collisions > 0.05 * CASES
    assert without_engine > CASES


def pushes(frame: Frame) -> dict[str, Command]:
    """Over the low box and against the other one, back, and again."""
    forward = frame.tick // 150 % 3 != 2
    return {"V1": Command(throttle=0.9 if forward else -0.9, steering=0.12), "V2": slalom(frame)["V2"]}


def test_the_engine_has_no_state_of_its_own() -> None:
    spec = YARD.model_copy(update={"vehicles": YARD.vehicles | {"V1": VehiclePlacement(x=-0.6, y=-0.02)}})
    world, other, fresh = (autodrive.make(spec) for _ in range(3))
    with_engine = without_engine = touched = 0
    for tick in range(900):
        other.compiled.views.qpos[:] += 1.0  # something else was in the engine
        if tick % 10 == 0:
            fresh = autodrive.make(spec) if tick % 300 == 0 else fresh
            fresh.restore(pickle.loads(pickle.dumps(world.save())))
        frame = world.step(pushes(world.frame))
        touched += len(frame.events)
        expected = digest(frame)
        assert digest(other.step(pushes(other.frame))) == expected, tick
        assert digest(fresh.step(pushes(fresh.frame))) == expected, tick
        resting = not engine_is_at(world)
        without_engine += resting
        with_engine += not resting
    assert min(with_engine, without_engine) > 50
    assert touched > 2


def test_a_parked_fleet_needs_no_engine() -> None:
    world = autodrive.make("four_cars")
    for _ in range(10):
        world.step()  # the boxes come to rest
    for _ in range(20):
        world.step()
        assert not engine_is_at(world)


def test_an_unknown_choice_of_engine_is_refused() -> None:
    with pytest.raises(autodrive.CommandError, match="'auto' or 'always'"):
        autodrive.make("plane", engine="never")  # pyright: ignore[reportArgumentType]
