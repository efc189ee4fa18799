"""The functions of a vehicle, compiled by NVIDIA Warp for its CPU device from the same source, give the bits of Numba.

Both compilers keep the order of the operations and fuse none of them, and IEEE 754 fixes the result of each; therefore
all comparisons here are exact. `scripts/second-backend` installs Warp and runs this file.
"""

from __future__ import annotations

import importlib
import inspect
import math
import os
import random
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
import pytest

import autodrive
from autodrive import elementary, transforms
from autodrive.actuators import drivetrain, steering
from autodrive.arrays import Floats
from autodrive.compile import Compiled
from autodrive.jit import jit, jit_uncounted
from autodrive.model import BOX, CYLINDER, SPHERE, Model
from autodrive.physics import formulas, ray, tick, wheel
from autodrive.physics.buffers import Scratch, VehicleContacts, scratch
from autodrive.physics.clearance import find_nearby
from autodrive.physics.engine import has_diverged, load
from autodrive.physics.free_body import rotation_at, step_free_body
from autodrive.physics.vehicle_forces import apply_forces, steer_wheels
from autodrive.physics.wheel_edge import edge_support
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.sensors import fan, lidar, outline, sweep
from autodrive.state import State, copied
from autodrive.transforms import quaternion_from_euler, rotation_from_quaternion
from autodrive.world import World
from tests.support.sensor_scenes import Solid, scene
from tests.support.warp_source import Entry, Program, plain
from tests.test_elementary import FUNCTIONS

pytestmark = pytest.mark.slow

CALLS = 300
"""Of each function, with random arguments."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For what Warp generates. The tests need Warp and compile for a minute or two, so that others do not run them."""
    if not os.environ.get("AUTODRIVE_SECOND_BACKEND"):
        pytest.skip("only scripts/second-backend runs this: it installs Warp and sets AUTODRIVE_SECOND_BACKEND")
    warp = importlib.import_module("warp")
    path = tmp_path_factory.mktemp("warp")
    warp.config.kernel_cache_dir = str(path)
    warp.config.quiet = True
    return path


# -- functions of numbers ---------------------------------------------------------------------------------------


class Case(NamedTuple):
    """A function as Numba compiles it, its plain source, and random arguments."""

    compiled: Callable[..., Any]
    source: Callable[..., Any]
    arguments: Callable[[random.Random], Iterator[tuple[Any, ...]]]


def number(rng: random.Random) -> float:
    """Of the sizes that occur; sometimes 0."""
    return rng.choice((0.0, rng.uniform(-1.0, 1.0), rng.uniform(-30.0, 30.0), 10.0 ** rng.uniform(-9.0, 3.0)))


def unit_quaternion(rng: random.Random) -> tuple[float, ...]:
    q = [rng.gauss(0.0, 1.0) for _ in range(4)]
    length = math.sqrt(sum(x * x for x in q))
    return tuple(x / length for x in q)


def axes(rng: random.Random) -> tuple[tuple[float, ...], ...]:
    """Three unit vectors of a tilted sensor, or of any rotation."""
    tilted = quaternion_from_euler(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), rng.uniform(-4.0, 4.0))
    m = rotation_from_quaternion(np.array(rng.choice((tilted, unit_quaternion(rng)))))
    return m[0:3], m[3:6], m[6:9]


def positive(rng: random.Random, count: int) -> tuple[float, ...]:
    return tuple(10.0 ** rng.uniform(-2.0, 0.5) for _ in range(count))


def point(rng: random.Random, reach: float = 3.0) -> tuple[float, ...]:
    return tuple(rng.uniform(-reach, reach) for _ in range(3))


def drawn(hint: Any, rng: random.Random) -> Any:
    """A random argument for a type hint: of alternatives the first, and of four numbers a unit quaternion."""
    if get_origin(hint) is tuple:
        count = len(get_args(hint))
        return unit_quaternion(rng) if count == 4 else tuple(number(rng) for _ in range(count))
    if get_args(hint):
        return drawn(get_args(hint)[0], rng)
    return {bool: lambda: rng.random() < 0.5, float: partial(number, rng)}[hint]()


def by_hints(function: Callable[..., Any], rng: random.Random) -> Iterator[tuple[Any, ...]]:
    hints = [hint for name, hint in get_type_hints(function).items() if name != "return"]
    return (tuple(drawn(hint, rng) for hint in hints) for _ in range(CALLS))


def functions_of(module: ModuleType) -> Iterator[FunctionType]:
    return (f for f in vars(module).values() if isinstance(f, FunctionType) and f.__module__ == module.__name__)


def repeated(draw: Callable[[random.Random], tuple[Any, ...]]) -> Callable[[random.Random], Iterator[tuple[Any, ...]]]:
    return lambda rng: (draw(rng) for _ in range(CALLS))


def any_kind(rng: random.Random) -> int:
    return rng.choice((BOX, CYLINDER, SPHERE))


CASES = {
    **{name: Case(jit(getattr(elementary, name)), getattr(elementary, name), FUNCTIONS[name]) for name in FUNCTIONS},
    **{f.__name__: Case(jit(f), f, partial(by_hints, f)) for f in functions_of(transforms)},
    **{
        f.__name__: Case(formulas._functions[f.__name__], f, partial(by_hints, f))
        for module in (wheel, drivetrain, steering)
        for f in functions_of(module)
    },
    **{
        name: Case(getattr(module, name), plain(getattr(module, name)), partial(by_hints, plain(getattr(module, name))))
        for module, name in (
            (ray, "misses_sphere"),
            (outline, "view_of_sphere"),
            (outline, "bearings"),
            (outline, "bearings_of_disc"),
            (outline, "approximate_bearing"),
        )
    },
    "inverse_distance": Case(
        ray.inverse_distance,
        plain(ray.inverse_distance),
        repeated(lambda rng: (any_kind(rng), positive(rng, 3), point(rng), axes(rng)[0])),
    ),
    "view_of_box": Case(
        outline.view_of_box,
        plain(outline.view_of_box),
        repeated(lambda rng: (positive(rng, 3), point(rng), *axes(rng))),
    ),
    "view_of_cylinder": Case(
        outline.view_of_cylinder,
        plain(outline.view_of_cylinder),
        repeated(lambda rng: (*positive(rng, 2), point(rng), *axes(rng))),
    ),
}


def cast(rng: random.Random) -> tuple[Any, ...]:
    """A ray that passes near the centre of a shape."""
    start, centre = point(rng), point(rng, 1.0)
    aim = [c + rng.gauss(0.0, 0.2) - s for c, s in zip(centre, start, strict=True)]
    length = math.sqrt(sum(x * x for x in aim))
    m = rotation_from_quaternion(np.array(unit_quaternion(rng)))
    arrays = np.array(positive(rng, 3)), np.array(centre), np.array(m)
    return any_kind(rng), *arrays, *start, *(x / length for x in aim)


def wheel_at_box(rng: random.Random) -> tuple[Any, ...]:
    """A wheel in the axes of a box, near its upper edges."""
    size, radius = np.array(positive(rng, 3)), 10.0 ** rng.uniform(-2.0, 0.0)
    corner = [rng.choice((-x, x)) + rng.uniform(-radius, radius) for x in size[:2]]
    forward, _, up = axes(rng)
    return size, (*corner, float(size[2]) + rng.uniform(0.7, 1.0) * radius), forward, up, radius


ONE_BY_ONE = {"cast_ray": (ray.cast_ray, cast), "edge_support": (edge_support, wheel_at_box)}
"""Functions with arrays among their arguments."""


@pytest.mark.parametrize("name", CASES)
def test_a_function_of_numbers_has_the_same_bits(entries: dict[str, Entry], name: str) -> None:
    case = CASES[name]
    calls = list(case.arguments(random.Random(name)))
    expected = [tuple(np.atleast_1d(np.array(case.compiled(*call), float)).tolist()) for call in calls]
    assert len(set(expected)) > 1
    np.testing.assert_array_equal(np.array(entries[name].map(calls), float), np.array(expected))


@pytest.mark.parametrize("name", ONE_BY_ONE)
def test_rays_and_edges_have_the_same_bits(entries: dict[str, Entry], name: str) -> None:
    function, draw = ONE_BY_ONE[name]
    rng = random.Random(name)
    calls = [draw(rng) for _ in range(CALLS)]
    expected = [function(*call) for call in calls]
    assert len({result[0] for result in expected}) > CALLS / 5  # most miss
    np.testing.assert_array_equal(np.array([entries[name](*call) for call in calls]), np.array(expected))


# -- stages of the tick -----------------------------------------------------------------------------------------


class NoEngine(NamedTuple):
    """In place of `Views`: what the tick function reads from the engine, and how often it would have stepped it."""

    warmstart: Floats
    asleep: Floats
    steps: Floats


def is_never_diverged(views: NoEngine) -> bool:
    return False


def count_step(model: Model, state: State, views: NoEngine, contacts: VehicleContacts, scratch: Scratch) -> None:
    views.steps[0] += 1.0


def forces(model: Model, state: State, scratch: Scratch) -> None:
    """Contacts and forces of the first car."""
    find_nearby(0, model, state, scratch, model.dt)
    steer_wheels(0, model, state)
    apply_forces(0, rotation_at(state.qpos, model.vehicles[0]["qpos"] + 3), model, state, scratch)


def free_step(model: Model, state: State, scratch: Scratch) -> None:
    """A step of the first car under the forces in `scratch`."""
    v = model.vehicles[0]
    rotation = rotation_at(state.qpos, v["qpos"] + 3)
    step_free_body(v, rotation, model.gravity, model.dt, scratch.applied, state.qpos, state.qvel, state.qacc)


BOXES = {
    f"box_{k}": BoxSpec(x=0.25 * k - 1.2, y=-0.1 * (k % 3), size=(0.12, 0.2, 0.004 + 0.004 * k), mass=1.0 + k)
    for k in range(10)
}


@pytest.fixture(scope="module")
def worlds() -> dict[str, World]:
    two = {"V1": VehiclePlacement(x=-1.1, y=-0.15), "V2": VehiclePlacement(x=0.5, y=-0.15)}
    around = {name: box.model_copy(update={"y": box.y + 1.5}) for name, box in BOXES.items()}
    worlds = {
        "plane": autodrive.make("plane"),
        "tiny_town": autodrive.make(ScenarioSpec(map="tiny_town", vehicles=two)),
        "roboracers": autodrive.make(
            ScenarioSpec(
                vehicles={
                    "V1": VehiclePlacement(type="roboracer_f1tenth"),
                    "V2": VehiclePlacement(type="roboracer", y=1.0),
                }
            )
        ),
        "boxes": autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement()}, boxes=around)),
        "plates": autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(y=3.0)}, boxes=BOXES)),
    }
    while worlds["boxes"]._compiled.state.asleep[:-1].min() < 0.0:  # until the boxes have come to rest
        worlds["boxes"].step()
    return worlds


Numbers = list[Floats]


def numbers_of(*tables: Any) -> Numbers:
    """Copies of all columns."""
    found: Numbers = []
    for table in tables:
        for column in table:
            if column.dtype.names is None:
                found.append(column.astype(float))
            else:
                found += [column[name].astype(float) for name in column.dtype.names]
    return found


def assert_same(a: Numbers, b: Numbers) -> None:
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(one, other)


def new_scratch(c: Compiled) -> Scratch:
    return scratch(c.model, len(c.state.asleep))


def random_state(c: Compiled, rng: np.random.Generator) -> State:
    """The first car anywhere between the plates, in any motion; some of its wheels are in the air."""
    state = copied(c.state)
    v = c.model.vehicles[0]
    at, dof = v["qpos"], v["dof"]
    state.qpos[at : at + 3] = rng.uniform((-1.4, -0.3, 0.02), (1.3, 0.2, 0.07))
    state.qpos[at + 3 : at + 7] = quaternion_from_euler(*rng.normal(0.0, (0.05, 0.05, 2.0)).tolist())
    state.qvel[:] = rng.normal(0.0, 0.01, len(state.qvel))
    state.qvel[dof : dof + 6] = rng.normal(0.0, 1.0, 6)
    state.throttle[0] = rng.choice([0.0, rng.uniform(-1.0, 1.0)])
    state.drive_level[0], state.steering_angle[0] = rng.uniform(-1.0, 1.0), rng.uniform(-0.5, 0.5)
    for column in (state.wheel_angular_velocity, state.wheel_force, state.wheel_lagged_slip, state.wheel_hold):
        column[:4] = rng.choice([0.0, 0.001, 1.0, 10.0]) * rng.normal(0.0, 1.0, column[:4].shape)
    return state


def test_contacts_and_forces_of_a_car_have_the_same_bits(entries: dict[str, Entry], worlds: dict[str, World]) -> None:
    compiled, rng = jit_uncounted(forces), np.random.default_rng(7)
    c = worlds["plates"]._compiled
    found = []
    for _ in range(CALLS):
        one = random_state(c, rng)
        other, memory, other_memory = copied(one), new_scratch(c), new_scratch(c)
        compiled(c.model, one, memory)
        entries["forces"](c.model, other, other_memory)
        assert_same(numbers_of(one, memory), numbers_of(other, other_memory))
        found.append(memory.wheel_contacts.copy())
    contacts = np.concatenate(found)
    on_ground = contacts[~contacts["is_airborne"]]
    assert len(on_ground) < len(contacts)
    assert {-1, *range(len(BOXES))} <= set(on_ground["shape"].tolist())
    # on an edge the normal is neither the floor's nor that of a face of the boxes, which lie flat
    assert ((on_ground["shape"] >= 0) & (np.abs(on_ground["normal"]).max(axis=1) < 0.99)).sum() > 5


def test_a_step_of_a_free_body_has_the_same_bits(entries: dict[str, Entry], worlds: dict[str, World]) -> None:
    compiled, rng = jit_uncounted(free_step), np.random.default_rng(8)
    c = worlds["plates"]._compiled
    for _ in range(CALLS):
        one, memory = random_state(c, rng), new_scratch(c)
        memory.applied[:] = rng.normal(0.0, 10.0, memory.applied.shape)
        other, before = copied(one), one.qpos.copy()
        compiled(c.model, one, memory)
        entries["free_step"](c.model, other, memory)
        assert_same(numbers_of(one), numbers_of(other))
        assert not np.array_equal(one.qpos, before)


@pytest.mark.parametrize("name", ["plane", "roboracers", "tiny_town", "boxes"])
def test_substeps_have_the_same_bits(entries: dict[str, Entry], worlds: dict[str, World], name: str) -> None:
    """The whole tick function: one substep, then ticks of 1 to 100 substeps; the engine rests in all of them."""
    c = worlds[name]._compiled
    one, other, memory, other_memory = copied(c.state), copied(c.state), new_scratch(c), new_scratch(c)
    n = len(c.model.vehicles)
    nothing = NoEngine(np.zeros_like(one.qacc), np.zeros_like(one.asleep), np.zeros(1))
    first = 0
    for count in (1, 1, 100, 20, 20, 100):
        throttle = np.full(n, 0.8 if first < 130 else 0.0)
        side = np.linspace(-1.0, 1.0, n) if first < 60 else np.full(n, 0.4)
        commands = throttle, side, first, count, False
        assert tick.advance(c.model, one, c.views, c.contacts, memory, *commands)
        assert entries["advance"](c.model, other, nothing, np.zeros(1), other_memory, *commands)
        assert nothing.steps[0] == 0.0
        assert_same(numbers_of(one, memory), numbers_of(other, other_memory))
        first += count
    assert np.linalg.norm(one.vehicle_position - c.state.vehicle_position, axis=1).min() > 0.005


# -- LIDAR ------------------------------------------------------------------------------------------------------


SOLIDS = 24
TIMING = sweep.Timing(rate=7.0, time_increment=1.0 / (7.0 * 360))


def lidar_arguments(seed: int) -> dict[str, Any]:
    """A sensor anywhere among solids of all kinds, some of them fixed; by name of the argument."""
    rng = random.Random(seed)
    solids = [
        Solid(any_kind(rng), positive(rng, 3), point(rng), rotation_from_quaternion(np.array(unit_quaternion(rng))))
        for _ in range(SOLIDS // 2)
    ]
    solids += [Solid(BOX, positive(rng, 3), point(rng)) for _ in range(SOLIDS // 2)]
    level = quaternion_from_euler(rng.gauss(0.0, 0.02), rng.gauss(0.0, 0.02), rng.uniform(-3.0, 3.0))
    moved = [rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), rng.uniform(0.0, 0.3)]
    shapes, state = scene(solids, 1, 16, vehicle_position=[moved], vehicle_orientation=[level])
    rays, angle_min = 360, rng.uniform(-3.0, 0.0)
    angles = (angle_min + 2.0 * math.pi / rays * np.arange(rays)).tolist()
    directions = np.array([[turn(angle) for angle in angles] for turn in (elementary.cos, elementary.sin)])
    yaw = transforms.quaternion_from_yaw(rng.gauss(0.0, 0.05))
    return {
        "vehicle_position": state.vehicle_position[0],
        "vehicle_orientation": state.vehicle_orientation[0],
        "position": state.vehicle_position[0],
        "orientation": state.vehicle_orientation[0],
        "position_before": state.vehicle_position[0] - 0.01,
        "orientation_before": np.array(transforms.compose(state.vehicle_orientation[0], yaw)),
        "shape_position_before": state.shape_position + 0.01,
        "shape_rotation_before": state.shape_rotation,
        "mount_position": (0.1, 0.0, 0.1),
        "mount_orientation": quaternion_from_euler(0.01, -0.02, 0.3),
        "cosines": directions[0],
        "sines": directions[1],
        "near": np.zeros(SOLIDS, np.int64),
        "angle_min": angle_min,
        "angle_increment": 2.0 * math.pi / rays,
        "range_max": 12.0,
        "vehicle": 0,
        "shapes": shapes,
        "shape_position": state.shape_position,
        "shape_rotation": state.shape_rotation,
        "timing": TIMING,
        "scan": 3,
        "first": rays // 10,
        "time_before": 3.0 / TIMING.rate - 0.9 * rays * TIMING.time_increment,
        "time": 3.0 / TIMING.rate - 0.1 * rays * TIMING.time_increment,
        "views": np.full((len(shapes.kind), 10), math.inf),
        "inverse_range": np.full(rays, -math.inf),
    }


def arguments_of(function: Callable[..., Any], seed: int) -> list[Any]:
    known = lidar_arguments(seed)
    return [known[name] for name in inspect.signature(plain(function)).parameters]


LIDAR = {"fan": fan.cast_fan, "sweep": sweep.cast_sweep}


@pytest.mark.parametrize("name", LIDAR)
def test_a_scan_has_the_same_bits(entries: dict[str, Entry], name: str) -> None:
    hits = 0
    for seed in range(40):
        one, other = arguments_of(LIDAR[name], seed), arguments_of(LIDAR[name], seed)
        next_ray = LIDAR[name](*one)
        assert entries[name](*other) == (() if next_ray is None else next_ray)
        np.testing.assert_array_equal(one[-1], other[-1])
        ranges, other_ranges = np.full((2, 360), np.nan)
        lidar.measure(one[-1], 0.15, 12.0, ranges)
        entries["ranges"](other[-1], 0.15, 12.0, other_ranges)
        np.testing.assert_array_equal(ranges, other_ranges)
        hits += np.isfinite(ranges).sum()
    assert hits > 1000


# -- the program ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def entries(folder: Path, worlds: dict[str, World]) -> dict[str, Entry]:
    """All functions of these tests by name, compiled together: each function that they share is compiled once."""
    program = Program({has_diverged: is_never_diverged, load: None, tick._step_engine: count_step})
    rng = random.Random(1)
    entries = {name: program.add(case.source, *next(case.arguments(rng))) for name, case in CASES.items()}
    entries |= {name: program.add(function, *draw(rng)) for name, (function, draw) in ONE_BY_ONE.items()}
    c = worlds["plane"]._compiled
    here = c.model, c.state, new_scratch(c)
    entries |= {function.__name__: program.add(function, *here) for function in (forces, free_step)}
    nothing = NoEngine(np.zeros(6), np.zeros(1), np.zeros(1))
    commands = np.zeros(1), np.zeros(1), 0, 1, False
    entries["advance"] = program.add(tick.advance, c.model, c.state, nothing, np.zeros(1), new_scratch(c), *commands)
    entries |= {name: program.add(function, *arguments_of(function, 0)) for name, function in LIDAR.items()}
    entries["ranges"] = program.add(lidar.measure, np.zeros(1), 0.15, 12.0, np.zeros(1))
    program.build(folder)
    return entries
