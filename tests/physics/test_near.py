"""The slots of the engine hold all that the bodies can touch: the same bits as with the whole map in the engine."""

import math
import os
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import autodrive
from autodrive import Command
from autodrive.base.transforms import quaternion_from_euler
from autodrive.physics.clearance import distance
from autodrive.physics.grid import most_within
from autodrive.physics.model import ShapeTable
from autodrive.physics.near import SLACK, Slots
from autodrive.physics.tick import place
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.physics.test_grid import solids
from tests.support.cars import car_file
from tests.support.sensor_scenes import shapes_of
from tests.support.whole_map import whole_map_world

IS_LONG = os.environ.get("AUTODRIVE_HARDENING") == "long"
CASES = 10_000 if IS_LONG else 200
SECONDS = 60.0 if IS_LONG else 4.0
RACER = VehiclePlacement(type="roboracer")
FAST = 22.0


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Path of a map: a corridor of 1.2 m between walls of many parts, with signs and a block, and far away 400 blocks.

    The left wall is straight, the right one bends.
    """
    far = [{"x": 100.0 + k % 20, "y": 50.0 + k // 20, "length": 0.3, "width": 0.3, "height": 0.3} for k in range(400)]
    tree = {
        "title": "Hall",
        "ground": {"length": 300.0, "width": 300.0},
        "walls": [
            {"name": "left", "points": [[0.4 * k, 0.6] for k in range(60)], "thickness": 0.04, "height": 0.3},
            {
                "name": "right",
                "points": [[0.4 * k, -0.6 - 0.05 * math.sin(k)] for k in range(60)],
                "thickness": 0.04,
                "height": 0.3,
            },
        ],
        "blocks": [
            {"x": 20.2, "y": 0.0, "length": 0.4, "width": 0.6, "height": 0.01, "name": "plate"},
            {"x": 10.0, "y": -0.3, "yaw_deg": 20.0, "length": 0.2, "width": 0.1, "height": 0.2},
            *far,
        ],
        "props": [
            {"kind": "stop", "x": 5.0 + 3.0 * k, "y": -0.35, "yaw_deg": 40.0 * k, "name": f"sign_{k}"} for k in range(5)
        ],
    }
    file = tmp_path_factory.mktemp("hall") / "hall.yaml"
    file.write_text(yaml.safe_dump(tree), encoding="utf-8")
    return str(file)


def corridor(hall: str, **boxes: BoxSpec) -> ScenarioSpec:
    vehicles = {"V1": RACER.model_copy(update={"x": 1.0}), "V2": VehiclePlacement(type="nigel", x=8.0)}
    return ScenarioSpec(map=hall, vehicles=vehicles, boxes=boxes)


def throw(world: World, rng: np.random.Generator) -> None:
    """Lets the bodies fly at a fixed shape, at the corner between two, or at each other."""
    c = world.compiled
    s = int(rng.integers(c.model.shapes.n_fixed - 400))  # not one of the far part
    target = c.model.shapes.position[s] + rng.uniform(-0.3, 0.3, 3) * [1.0, 1.0, 0.3]
    for b, reach in enumerate(c.views.slots.reach.tolist()):
        bearing, away = rng.uniform(-math.pi, math.pi), reach * rng.uniform(0.6, 1.6)
        direction = np.array([math.cos(bearing), math.sin(bearing), 0.0])
        tilt = rng.uniform(-math.pi, math.pi, 2) if rng.random() < 0.2 else np.zeros(2)
        height = rng.choice([0.06, rng.uniform(0.05, 0.4)])
        c.state.qpos[7 * b : 7 * b + 3] = (*(target - away * direction)[:2], height)
        c.state.qpos[7 * b + 3 : 7 * b + 7] = quaternion_from_euler(tilt[0], tilt[1], rng.uniform(-math.pi, math.pi))
        speed = rng.choice([0.5, 3.0, FAST]) * rng.random()
        c.state.qvel[6 * b : 6 * b + 3] = speed * direction + rng.normal(0.0, 0.2, 3)
        c.state.qvel[6 * b + 3 : 6 * b + 6] = rng.normal(0.0, rng.choice([0.1, 5.0]), 3)
    place(c.model, c.state, c.views)


def assert_same(world: World, other: World, where: Any) -> None:
    """The same bits of all numbers of the State, and the same events with the same impulses."""
    for name, column, its in zip(world.compiled.state._fields, world.compiled.state, other.compiled.state, strict=True):
        np.testing.assert_array_equal(column, its, err_msg=f"{name}, {where}")
    events = [
        [(type(e), getattr(e, "other", ""), getattr(e, "impulse", 0.0)) for e in w.frame.events] for w in (world, other)
    ]
    assert events[0] == events[1], where


def steps(world: World) -> bool:
    """Makes a tick; False if the bodies began so deep in each other that the physics became unstable."""
    try:
        world.step()
    except autodrive.EngineError:
        return False
    return True


def test_random_contacts_have_the_bits_of_an_engine_with_the_whole_map(hall: str) -> None:
    """No bound is needed: the engine finds the same contacts in the same order, so that it computes the same."""
    spec = corridor(hall, box=BoxSpec(x=3.0, y=0.2, yaw_deg=20.0), light=BoxSpec(x=4.0, y=-0.2, size=(0.1, 0.3, 0.2)))
    near, whole = autodrive.make(spec), whole_map_world(spec)
    assert near.compiled.engine.model.ngeom < whole.compiled.engine.model.ngeom - 350
    touched: Counter[str] = Counter()
    for seed in range(CASES):
        for world in (near, whole):
            world.reset()
            throw(world, np.random.default_rng(seed))
        for tick in range(6):
            are_sound = [steps(world) for world in (near, whole)]
            assert_same(near, whole, (seed, tick))
            assert are_sound[0] == are_sound[1]
            if not are_sound[0]:
                break
            for event in near.frame.events:
                if isinstance(event, autodrive.Collision):
                    touched[re.sub(r"[_\d.].*", "", event.other)] += 1
    assert touched.total() > CASES
    assert {"left", "right", "block", "sign", "box", "light", "V", "ground"} <= {*touched}


@pytest.mark.parametrize("speed", [0.5, 3.0, 10.0])
def test_a_car_that_scrapes_along_a_wall(hall: str, speed: float, tmp_path: Path) -> None:
    tree = yaml.safe_load(Path(hall).read_text(encoding="utf-8"))
    tree["ground"]["friction"] = 0.0
    smooth = tmp_path / "smooth.yaml"
    smooth.write_text(yaml.safe_dump(tree), encoding="utf-8")
    spec = corridor(str(smooth))  # friction would turn a fast car round
    smooth_car = car_file(tmp_path, {"wheels.side_friction": 0.0}, "roboracer")
    vehicles = spec.vehicles | {"V1": spec.vehicles["V1"].model_copy(update={"type": smooth_car})}
    spec = spec.model_copy(update={"vehicles": vehicles})
    near, whole = autodrive.make(spec), whole_map_world(spec)
    dof = int(near.compiled.model.vehicles[0]["dof"])
    way = touching = 0.0
    ticks = round(SECONDS / near.tick_duration)
    for tick in range(ticks):
        car = near.frame.vehicles["V1"]
        if tick == 0 or car.pose.position[0] > 21.0:  # back to the beginning of the wall
            for world in (near, whole):
                world.set_poses({"V1": np.array([0.3, 0.41, 0.06, 1.0, 0.0, 0.0, 0.0])})
                world.compiled.state.qvel[dof] = speed
                world.compiled.state.wheel_angular_velocity[:4] = speed / world.compiled.model.wheels["radius"][0]
        command = {"V1": Command(throttle=speed / 22.0 + 0.2 * (speed - car.speed), steering=0.15)}
        near.step(command)
        whole.step(command)
        assert_same(near, whole, tick)
        y = near.frame.vehicles["V1"].pose.position[1]
        assert abs(y) < 0.6
        way += near.frame.vehicles["V1"].speed * near.tick_duration
        touching += y > 0.35
    assert way > 0.5 * speed * SECONDS
    assert touching > 0.7 * ticks


def test_two_cars_side_by_side_that_press_against_each_other_and_the_walls(hall: str) -> None:
    vehicles = {"V1": VehiclePlacement(type="nigel", x=1.0, y=0.2), "V2": VehiclePlacement(type="nigel", x=1.0, y=-0.2)}
    spec = ScenarioSpec(map=hall, vehicles=vehicles)
    near, whole = autodrive.make(spec), whole_map_world(spec)
    for tick in range(round(SECONDS / near.tick_duration)):
        throttle = 1.0 if tick // 150 % 2 == 0 else -1.0
        command = {name: Command(throttle=throttle, steering=side) for name, side in (("V1", -0.5), ("V2", 0.5))}
        near.step(command)
        whole.step(command)
        assert_same(near, whole, tick)
    assert sum(car.collision_count for car in near.frame.vehicles.values()) > 3


def test_a_pile_of_boxes_against_a_wall(hall: str) -> None:
    boxes = {
        f"box_{k}": BoxSpec(x=9.0 + 0.21 * (k % 3), y=0.49, z=0.1 + 0.2 * (k // 3), size=(0.2, 0.15, 0.2))
        for k in range(9)
    }
    spec = ScenarioSpec(map=hall, vehicles={"V1": VehiclePlacement(x=8.2, y=0.4)}, boxes=boxes)
    near, whole = autodrive.make(spec), whole_map_world(spec)
    asleep = 0
    for tick in range(500):
        command = {"V1": Command(throttle=1.0 if tick > 200 else 0.0, steering=0.1)}
        near.step(command)
        whole.step(command)
        assert_same(near, whole, tick)
        asleep += bool((near.compiled.state.asleep[: len(boxes)] >= 0).all())
    assert asleep > 50
    moved = [abs(near.pose(name)[0] - box.x) for name, box in boxes.items()]
    assert max(moved) > 0.1
    assert max(near.pose(name)[1] for name in boxes) < 0.6


def test_nothing_passes_through_anything_at_22_metres_per_second(hall: str) -> None:
    """The walls are 4 cm thick and a substep is 2.2 cm long: a car that is thrown at them stays in the corridor."""
    world = autodrive.make(ScenarioSpec(map=hall, vehicles={"V1": RACER}, boxes={"box": BoxSpec(x=3.0, y=0.0)}))
    c = world.compiled
    q, dof = int(c.model.vehicles[0]["qpos"]), int(c.model.vehicles[0]["dof"])
    bounced = 0
    for seed in range(CASES // 2):
        rng = np.random.default_rng(seed)
        world.reset()
        yaw, bearing = rng.uniform(-math.pi, math.pi, 2)
        c.state.qpos[q : q + 3] = rng.uniform(4.0, 18.0), 0.0, 0.06
        c.state.qpos[q + 3 : q + 7] = quaternion_from_euler(0.0, 0.0, yaw)
        c.state.qvel[dof : dof + 2] = FAST * math.cos(bearing), FAST * math.sin(bearing)
        place(c.model, c.state, c.views)
        for _ in range(30):
            x, y, z = world.step().vehicles["V1"].pose.position.tolist()
            if not 1.0 < x < 22.0 or z > 0.2:  # it has left the corridor at an end, or flies over the wall
                break
            assert abs(y) < 0.65, (seed, world.frame.tick)
        bounced += world.frame.vehicles["V1"].collision_count > 0
    assert bounced > 0.3 * CASES


def distances(shapes: ShapeTable, count: int, x: float, y: float, z: float) -> list[float]:
    """Of a point to the first shapes [m]."""
    kinds = shapes.kind.tolist()
    return [
        distance(kinds[s], shapes.size[s], shapes.position[s], shapes.rotation[s], float(x), float(y), float(z))
        for s in range(count)
    ]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(0, 60), radius=st.floats(0.05, 3.0))
def test_no_place_has_more_shapes_within_reach_than_there_are_slots(seed: int, count: int, radius: float) -> None:
    shapes = shapes_of(solids(seed, count, extent=4.0), n_fixed=count)
    most = most_within(shapes, radius)
    rng = np.random.default_rng(seed)
    for x, y in (*rng.uniform(-6.0, 6.0, (20, 2)), *shapes.position[:20, :2]):
        assert sum(distance <= radius for distance in distances(shapes, count, x, y, 0.2)) <= most
    assert most <= count


def test_the_slots_hold_what_a_body_can_touch(hall: str) -> None:
    world = autodrive.make(corridor(hall, box=BoxSpec(x=3.0, y=0.0)))
    c = world.compiled
    slots, shapes = c.views.slots, c.model.shapes
    assert 0 < len(slots.shape) < 80 < shapes.n_fixed
    rng = np.random.default_rng(1)
    most = 0
    for _ in range(100):
        places = rng.uniform((0.0, -0.6, 0.0), (24.0, 0.6, 0.3), (3, 3))
        places[0] = places[rng.integers(3)] + rng.uniform(-0.07, 0.07, 3)  # often less than the slack from where it was
        c.state.qpos.reshape(3, 7)[:, :3] = places
        place(c.model, c.state, c.views)
        far = [distances(shapes, shapes.n_fixed, x, y, z) for x, y, z in places.tolist()]
        near = {s for s in range(shapes.n_fixed) if any(far[b][s] <= slots.reach[b] for b in range(3))}
        geoms = [geom for geom in slots.tree_geom[: slots_in_tree(slots)].tolist() if geom > 0]
        held = [int(slots.solid[geom]) - 1 for geom in sorted(geoms)]
        assert held == sorted(set(held))
        assert near <= {*held}
        assert all(min(far[b][s] - slots.reach[b] for b in range(3)) <= 2.0 * SLACK for s in held)
        most = max(most, len(held))
    assert 3 < most < 40


def test_wheels_find_the_ground_that_a_car_is_thrown_to_within_a_tick(hall: str) -> None:
    """As in short ticks: after a tick the car is where it would never have come with twice its speed."""
    spec = ScenarioSpec(map=hall, vehicles={"V1": VehiclePlacement(x=18.9)})
    poses = []
    for ticks in (1, 10):
        world = autodrive.make(spec.model_copy(update={"tick": 0.1 / ticks}), engine="always")
        world.compiled.engine.model.opt.gravity[0] = 260.0
        for _ in range(ticks):
            world.step()
        poses.append(world.compiled.state.qpos.copy())
    assert world.pose("V1")[0] > 19.9
    assert world.pose("V1")[2] > 0.04  # the edge of the plate has lifted it
    np.testing.assert_array_equal(*poses)


def slots_in_tree(slots: Slots) -> int:
    """Number of nodes of the tree below its root."""
    nodes, seen = [0], 0
    while nodes:
        node = nodes.pop()
        seen += 1
        nodes += [child for child in slots.tree_children[node].tolist() if child >= 0]
    return seen


def test_a_map_with_more_shapes_than_slots_keeps_its_overlaps(hall: str) -> None:
    world = autodrive.make(corridor(hall))
    with pytest.raises(autodrive.CommandError, match="it would overlap 'left_3'"):
        world.teleport("V1", 1.0, 0.6)
    with pytest.raises(autodrive.CommandError, match="it would overlap"):
        world.teleport("V1", 105.0, 55.0)
