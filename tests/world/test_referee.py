"""The referee: one collision for each contact; departures from the road compared with shapely."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml

import autodrive
from autodrive.base.transforms import quaternion_from_euler, rotate
from autodrive.physics.tick import place
from autodrive.protocol.messages import BackOnRoad, Collision, CollisionEnded, Command, Event, Frame, OffRoad
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.rules.road import any_wheel_outside

MASS = 1.75
NOSE = 0.23
"""Of the second platform, ahead of the rear axle [m]."""


def drive(world: World, ticks: int, throttle: float = 1.0, steering: float = 0.0) -> list[Frame]:
    return [world.step({"V1": Command(throttle, steering)}) for _ in range(ticks)]


def events(frames: list[Frame]) -> list[Event]:
    """All events but the ends of collisions."""
    return [event for frame in frames for event in frame.events if not isinstance(event, CollisionEnded)]


def ends(frames: list[Frame]) -> list[CollisionEnded]:
    return [event for frame in frames for event in frame.events if isinstance(event, CollisionEnded)]


def only_collision(frames: list[Frame]) -> tuple[int, Collision]:
    """Index of the frame that holds the only event that is no end of a collision, and the event."""
    found = [(i, event) for i, frame in enumerate(frames) for event in events([frame])]
    assert len(found) == 1
    i, event = found[0]
    assert isinstance(event, Collision)
    assert event.time == frames[i].time
    return i, event


# -- collisions --------------------------------------------------------------------------------------------------


def test_pushing_a_box_for_long_is_one_collision() -> None:
    world = autodrive.make(ScenarioSpec(boxes={"box": BoxSpec(x=0.6, y=0.0)}))
    frames = drive(world, 400)
    _, collision = only_collision(frames)
    assert (collision.vehicle, collision.other) == ("V1", "box")
    assert frames[-1].objects["box"].pose.position[0] > 1.5  # it was pushed all the while
    assert frames[-1].vehicles["V1"].collision_count == 1


def test_a_collision_is_reported_in_the_tick_of_contact_at_the_front_of_the_car() -> None:
    world = autodrive.make(ScenarioSpec(boxes={"box": BoxSpec(x=0.6, y=0.02)}))
    frames = drive(world, 250)
    i, collision = only_collision(frames)
    noses = [frame.vehicles["V1"].pose.position[0] + NOSE for frame in frames]
    face = 0.55
    assert noses[i - 1] < face + 1e-3  # a contact may lie this deep when the first substep meets it: 0.44 mm
    assert noses[i] > face - 1e-4
    assert collision.position == pytest.approx((face, 0.02, 0.0565), abs=0.052)  # somewhere on the 0.1 m wide face
    assert collision.position[0] == pytest.approx(face, abs=0.002)
    assert not collision.position.flags.writeable


@pytest.fixture
def slick(tmp_path: Path) -> str:
    """A map with a floor that takes no momentum from a box; it has no road either."""
    path = tmp_path / "slick.yaml"
    path.write_text("{title: Slick, ground: {friction: 0.0}}")
    return str(path)


@pytest.mark.parametrize("tick", [0.01, 0.001])
@pytest.mark.parametrize("mass", [0.1, 0.5])
def test_the_impulse_is_the_momentum_that_the_box_took(slick: str, mass: float, tick: float) -> None:
    world = autodrive.make(ScenarioSpec(map=slick, tick=tick, boxes={"box": BoxSpec(x=0.6, y=0.0, mass=mass)}))
    velocity = world.compiled.state.qvel[world.compiled.engine.body("box")[2] :][:3]
    before, frames = velocity.copy(), drive(world, 1)
    while not frames[-1].events:
        assert world.time < 3.0
        before, frames = velocity.copy(), drive(world, 1)
    _, collision = only_collision(frames)
    taken = mass * (velocity - before)[0]
    assert taken > 0.01  # the blow is felt in this tick
    # a sum of magnitudes is no less than what acts along x; the nose also rubs along the face, with 0.4 at most
    assert taken <= collision.impulse <= taken * math.hypot(1.0, 0.4)


WALLED = """
title: A block and a wall
walls:
  - {name: fence, points: [[-1.0, -2.0], [-1.0, 2.0]], thickness: 0.1, height: 0.3}
blocks:
  - {name: house, x: 1.0, y: 0.0, length: 0.5, width: 1.0, height: 0.3}
"""


@pytest.fixture
def walled(tmp_path: Path) -> World:
    path = tmp_path / "walled.yaml"
    path.write_text(WALLED)
    return autodrive.make(ScenarioSpec(map=str(path)))


def test_running_into_a_block_and_then_backwards_into_a_wall_are_two_collisions(walled: World) -> None:
    _, collision = only_collision(drive(walled, 400))
    assert collision.other == "house"
    assert collision.position[0] == pytest.approx(0.75, abs=0.002)  # its face
    _, second = only_collision(drive(walled, 600, throttle=-1.0))
    assert second.other.startswith("fence")
    assert second.position[0] == pytest.approx(-0.95, abs=0.002)
    assert walled.frame.vehicles["V1"].collision_count == 2
    walled.reset()
    assert walled.frame.vehicles["V1"].collision_count == 0


def test_a_wall_takes_the_momentum_that_the_car_loses(walled: World) -> None:
    frames = drive(walled, 400)
    i, collision = only_collision(frames)
    before, after = (frames[k].vehicles["V1"].speed for k in (i - 1, i))
    # the tyres push on with at most the grip of the rear wheels (mu 1, half the weight, and what pitching adds)
    tyres = 1.0 * MASS * 9.81 * 0.01
    lost = MASS * (before - after)
    assert lost > 0.05
    assert lost * 0.9 - tyres < collision.impulse < (lost + tyres) * math.hypot(1.0, 0.6)


def test_two_cars_report_one_collision_each_with_the_same_impulse() -> None:
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(x=0.8)}))
    frames = drive(world, 300)
    first, second = events(frames)
    assert isinstance(first, Collision)
    assert isinstance(second, Collision)
    assert {(first.vehicle, first.other), (second.vehicle, second.other)} == {("V1", "V2"), ("V2", "V1")}
    assert first.time == second.time
    assert first.impulse == pytest.approx(second.impulse, rel=1e-12)  # Newton's third law; the order of sums differs
    assert [vehicle.collision_count for vehicle in frames[-1].vehicles.values()] == [1, 1]


@pytest.mark.parametrize(("apart", "count"), [(10, 1), (60, 2)])
def test_a_touch_is_a_new_collision_only_after_a_fifth_of_a_second_apart(apart: int, count: int) -> None:
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(x=0.35)}))
    frames = drive(world, 80)
    assert len(events(frames)) == 2  # one each
    world.teleport("V1", -3.0, 0.0)
    assert not events(drive(world, apart, throttle=0.0))
    behind = world.frame.vehicles["V2"].pose.position[0]
    world.teleport("V1", behind - 0.3001, 0.0)
    drive(world, 8)
    assert world.frame.vehicles["V1"].collision_count == count


@pytest.mark.parametrize("pieces", [1, 30, None], ids=["straight", "parts", "round"])
def test_a_scrape_along_a_wall_is_one_collision_whatever_the_wall_is_made_of(
    tmp_path: Path, pieces: int | None
) -> None:
    """It was counted once for each part that the car touched."""
    if pieces is None:
        points = [[6.0 * math.sin(a), 6.55 - 6.0 * math.cos(a)] for a in np.linspace(-0.3, 1.5, 200).tolist()]
    else:
        points = [[12.0 / pieces * k - 1.0, 0.55] for k in range(pieces + 1)]
    path = tmp_path / "wall.yaml"
    wall = {"name": "left", "points": points, "thickness": 0.04, "height": 0.3}
    path.write_text(yaml.safe_dump({"title": "Wall", "is_draft": True, "ground": {}, "walls": [wall]}))
    world = autodrive.make(ScenarioSpec(map=str(path), vehicles={"V1": VehiclePlacement(type="roboracer", y=0.37)}))
    world.compiled.state.qvel[int(world.compiled.model.vehicles[0]["dof"])] = 3.0
    frames = [world.step({"V1": Command(0.15, 0.15 if k < 150 else -0.3)}) for k in range(300)]
    _, collision = only_collision(frames)
    assert collision.other.startswith("left_")
    (end,) = ends(frames)
    assert (end.vehicle, end.other) == (collision.vehicle, collision.other)
    assert end.duration > 0.5
    assert end.impulse > 3.0 * collision.impulse
    assert end.time - end.duration - collision.time == pytest.approx(0.2)


@pytest.mark.parametrize("x", [0.1, 0.0963, 0.0919])
def test_the_end_of_a_crash_has_its_impulse_whatever_the_phase_of_the_tick_is(tmp_path: Path, x: float) -> None:
    """A car that flies at a wall, without wheels on the ground: the impulse is what stops its mass, and friction."""
    path = tmp_path / "wall.yaml"
    wall = {"name": "end", "points": [[0.5, -2.0], [0.5, 2.0]], "thickness": 0.04, "height": 2.0}
    path.write_text(yaml.safe_dump({"title": "Wall", "is_draft": True, "ground": {}, "walls": [wall]}))
    world = autodrive.make(ScenarioSpec(map=str(path), vehicles={"V1": VehiclePlacement(x=x)}))
    c = world.compiled
    dof, qpos = (int(c.model.vehicles[0][key]) for key in ("dof", "qpos"))
    c.state.qvel[dof], c.state.qpos[qpos + 2] = 3.0, 0.5
    place(c.model, c.state, c.views)
    before = MASS * 3.0
    frames = [world.step({"V1": Command()}) for _ in range(15)]
    assert isinstance(events(frames)[0], Collision)
    after = MASS * float(c.state.qvel[dof])
    frames += [world.step({"V1": Command()}) for _ in range(25)]
    (end,) = [event for event in ends(frames) if event.other == "end_1"]
    assert end.impulse == pytest.approx(before - after, rel=0.05)


def test_driving_and_standing_on_the_ground_is_no_collision() -> None:
    world = autodrive.make("plane")
    assert not events(drive(world, 300, steering=1.0) + drive(world, 100, throttle=0.0))
    assert world.frame.vehicles["V1"].collision_count == 0


# -- the road ----------------------------------------------------------------------------------------------------


def wheels_on_the_ground(world: World, position: Any, orientation: Any) -> Any:
    """The four hubs [m] seen from above, as shapely points."""
    hubs = [rotate(orientation, hub) for hub in world.vehicle_specs["V1"].hubs]
    return shapely.points(np.array(hubs)[:, :2] + np.asarray(position)[:2])


def is_outside(world: World, frame: Frame) -> bool:
    pose = frame.vehicles["V1"].pose
    return not shapely.covers(world.map.drivable, wheels_on_the_ground(world, pose.position, pose.orientation)).all()


def test_leaving_the_road_and_returning_are_reported_where_shapely_finds_them() -> None:
    world = autodrive.make("mini_map")
    shapely.prepare(world.map.drivable)
    assert not is_outside(world, world.frame)
    frames = [world.frame, *drive(world, 900), *drive(world, 400, throttle=-1.0), *drive(world, 300, steering=1.0)]
    outside = [is_outside(world, frame) for frame in frames]
    expected = [
        (frame.time, OffRoad if now else BackOnRoad)
        for before, now, frame in zip(outside, outside[1:], frames[1:], strict=False)
        if before != now
    ]
    found = [event for event in events(frames) if isinstance(event, OffRoad | BackOnRoad)]
    assert [(event.time, type(event)) for event in found] == expected
    assert expected[0][1] is OffRoad
    assert BackOnRoad in {kind for _, kind in expected}
    by_time = {frame.time: frame for frame in frames}
    for event in found:
        assert event.position.tolist() == by_time[event.time].vehicles["V1"].pose.position.tolist()
        assert event.vehicle == "V1"


def test_driving_straight_leaves_the_road_where_a_wheel_meets_its_edge() -> None:
    world = autodrive.make("mini_map")
    off = next(event for event in events(drive(world, 900)) if isinstance(event, OffRoad))
    corners = wheels_on_the_ground(world, off.position, (1.0, 0.0, 0.0, 0.0))
    beyond = max(shapely.distance(world.map.drivable, corners))
    assert 0.0 <= beyond < 0.01 * 0.45  # the way of one tick at full speed, 0.44 m/s


def test_a_start_off_the_road_and_a_teleport_back_are_reported_in_the_next_tick() -> None:
    world = autodrive.make(ScenarioSpec(map="mini_map", vehicles={"V1": VehiclePlacement(x=10.0)}))
    frames = drive(world, 20, throttle=0.0)
    assert [type(event) for event in frames[0].events] == [OffRoad]
    assert not events(frames[1:])
    world.teleport("V1", 0.0, 0.0)
    assert [type(event) for event in events(drive(world, 5, throttle=0.0))] == [BackOnRoad]


def test_on_a_map_without_a_road_no_vehicle_leaves_it(slick: str) -> None:
    world = autodrive.make(ScenarioSpec(map=slick))
    assert world.map.drivable.is_empty
    world.teleport("V1", 50.0, -50.0)
    assert not events(drive(world, 100))


def test_driving_on_the_pavement_of_the_plane_does_not_leave_it() -> None:
    world = autodrive.make("plane")
    world.teleport("V1", 9.0, -9.0, math.pi)
    assert not events(drive(world, 300, steering=0.1))


@pytest.mark.parametrize("scenario", ["mini_map", "tiny_town"])
def test_any_wheel_outside_agrees_with_shapely_at_random_poses(scenario: str) -> None:
    world = autodrive.make(scenario)
    drivable, wheels = world.map.drivable, world.compiled.model.wheels
    shapely.prepare(drivable)
    x0, y0, x1, y1 = drivable.bounds
    random = np.random.default_rng(3)
    answers = []
    for _ in range(3000):
        position = np.array([random.uniform(x0 - 0.2, x1 + 0.2), random.uniform(y0 - 0.2, y1 + 0.2), 0.0325])
        roll, pitch = random.normal(0.0, 0.1, 2)
        orientation = np.array(quaternion_from_euler(roll, pitch, random.uniform(-math.pi, math.pi)))
        points = wheels_on_the_ground(world, position, orientation)
        if shapely.distance(drivable.boundary, points).min() < 1e-9:
            continue  # on the very edge both answers are right
        expected = not shapely.contains(drivable, points).all()
        assert any_wheel_outside(world.map.drivable_edges, wheels, 0, position, orientation) == expected
        answers.append(expected)
    assert 0.05 < np.mean(answers) < 0.98  # both answers are asked for
