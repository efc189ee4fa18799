"""Tests of the traffic: lanes are followed, distances kept, lights and signs obeyed, and nobody is blocked."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

import autodrive
from autodrive.base.errors import CommandError, SpecError
from autodrive.base.transforms import yaw_from_quaternion
from autodrive.experiments.campaigns.parameters import applied, errors
from autodrive.experiments.campaigns.sampling import ParameterRange
from autodrive.protocol.messages import Command, Frame, Headlights, Indicators, TailLights, TrafficLightState, Weather
from autodrive.scenario.files import read_scenario
from autodrive.scenario.maps.spec import MapSpec
from autodrive.world import World
from autodrive.world.rules.traffic.drive import (
    ACCELERATION,
    BRAKING,
    HEADWAY,
    JAM_GAP,
    LOOK,
    STOP_MARGIN,
    idm_acceleration,
)

SIZE, WHEELBASE, WIDTH = 0.3, 0.14154, 0.175
FRONT = 0.5 * (WHEELBASE + SIZE)
LOT = {"V1": {"x": 2.5, "y": 4.2, "yaw_deg": 0.0}}
"""In a bay of the parking lot of Tiny Town, out of the way."""
INNER = {"V1": {"x": 0.0, "y": 1.15}}
"""In the middle of the oval, off the road."""


def world_of(map_: str = "tiny_town", cars: int = 12, seed: int = 0, **fields: Any) -> World:
    vehicles = fields.pop("vehicles", LOT if map_ == "tiny_town" else INNER)
    traffic = {"cars": cars} | fields.pop("traffic", {})
    return make(map=map_, vehicles=vehicles, traffic=traffic, seed=seed, **fields)


def make(**fields: Any) -> World:
    return autodrive.make(autodrive.Scenario(**fields))


def run(world: World, ticks: int) -> Frame:
    """The Frame after so many ticks."""
    for _ in range(ticks):
        world.step()
    return world.frame


def drivers_of(world: World) -> Any:
    """The columns of the drivers of the traffic."""
    return world.row.rules.traffic[0].view(np.recarray)


def place_on_link(world: World, name: str, link: int, at: float) -> None:
    """Place a car with its front axle there, in the direction of the link."""
    roads = world.compiled.fleet.table.roads
    first = int(roads.point_first[link])
    x, y, tx, ty = roads.points[first + round(at / roads.spacing[link])].tolist()
    world.teleport(name, x - WHEELBASE * tx, y - WHEELBASE * ty, math.atan2(ty, tx))


def front_axle(frame: Frame, name: str) -> np.ndarray:
    pose = frame.vehicles[name].pose
    yaw = 2.0 * math.atan2(pose.orientation[3], pose.orientation[0])
    return pose.position[:2] + WHEELBASE * np.array([math.cos(yaw), math.sin(yaw)])


def distance_to_lanes(world: World, point: np.ndarray) -> float:
    nearest = world.map.lane_graph.nearest(float(point[0]), float(point[1]))
    assert nearest is not None
    return abs(nearest.offset)


# -- distance ------------------------------------------------------------------------------------------------------


def test_the_model_has_the_equilibrium_gap_of_its_paper() -> None:
    """Treiber, Hennecke, Helbing (2000), (6): s_e(v) = (s0 + v T) / sqrt(1 - (v / v0)^4)."""
    for speed in (0.05, 0.2, 0.35):
        gap = (JAM_GAP + speed * HEADWAY) / math.sqrt(1.0 - (speed / 0.4) ** 4)
        assert idm_acceleration(speed, 0.4, gap, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert idm_acceleration(0.0, 0.4, math.inf, 0.0) == ACCELERATION
    assert idm_acceleration(0.4, 0.4, math.inf, 0.0) == 0.0
    # who comes near a standing vehicle needs v^2 / (2 s): the model brakes with its square over b (section II.B)
    needed = 3.0**2 / (2.0 * 10.0)
    assert idm_acceleration(3.0, 1e9, 10.0, 3.0) == pytest.approx(-(needed**2) / BRAKING, rel=0.2)


def test_cars_behind_a_slow_leader_keep_the_gap_of_the_model() -> None:
    world = world_of("oval", cars=2)
    place_on_link(world, "traffic_1", 0, 1.0)
    place_on_link(world, "traffic_2", 0, 0.4)
    drivers = drivers_of(world)
    drivers.desired[:] = 0.2, 0.4
    run(world, 6000)
    speed = world.compiled.state.vehicle_velocity[1:, 0]
    assert speed == pytest.approx([0.2, 0.2], abs=0.004)
    length = world.compiled.fleet.table.roads.length[drivers.link[0]]
    gap = (drivers.at[0] - drivers.at[1]) % length - SIZE
    expected = (JAM_GAP + 0.2 * HEADWAY) / math.sqrt(1.0 - (0.2 / 0.4) ** 4)
    assert gap == pytest.approx(expected, abs=0.01)


def test_a_car_stops_behind_a_standing_car_of_the_user_and_goes_on_when_it_has_left() -> None:
    world = world_of("oval", cars=1)
    place_on_link(world, "traffic_1", 0, 0.5)
    place_on_link(world, "V1", 0, 2.0)
    desired = float(drivers_of(world).desired[0])
    gap = math.dist(front_axle(world.frame, "V1"), front_axle(world.frame, "traffic_1")) - SIZE
    frame = run(world, 3000)
    assert frame.vehicles["traffic_1"].speed == pytest.approx(0.0, abs=0.003)
    speed, dt = 0.0, 1e-3  # the equations of the paper; a car that comes too fast stops a little nearer than s0
    for _ in range(30_000):
        wished = JAM_GAP + speed * HEADWAY + speed**2 / (2.0 * math.sqrt(ACCELERATION * BRAKING))
        speed = max(0.0, speed + dt * ACCELERATION * (1.0 - (speed / desired) ** 4 - (wished / gap) ** 2))
        gap -= dt * speed
    between = math.dist(front_axle(frame, "V1"), front_axle(frame, "traffic_1")) - SIZE
    assert between == pytest.approx(gap, abs=0.01)  # delay of the drive
    assert frame.vehicles["traffic_1"].collision_count == 0
    world.teleport("V1", 0.0, 1.15)
    frame = run(world, 500)
    assert frame.vehicles["traffic_1"].speed > 0.2


def test_a_car_stops_behind_a_box_and_waits() -> None:
    world = world_of("oval", cars=1, boxes={"crate": {"x": 1.9, "y": 0.0}})
    place_on_link(world, "traffic_1", 0, 0.5)
    frame = run(world, 1500)
    gap = 1.9 - 0.05 * math.sqrt(2.0) - (front_axle(frame, "traffic_1")[0] + FRONT - WHEELBASE)
    assert frame.vehicles["traffic_1"].speed == pytest.approx(0.0, abs=0.003)
    assert gap == pytest.approx(JAM_GAP, abs=0.03)
    assert frame.vehicles["traffic_1"].collision_count == 0


@pytest.mark.parametrize("seed", range(6))
def test_a_car_that_appears_within_reach_of_the_brakes_is_not_hit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = world_of("oval", cars=1, seed=seed)
    run(world, int(rng.integers(200, 900)))
    drivers = drivers_of(world)
    roads = world.compiled.fleet.table.roads
    link = int(drivers.link[0])
    ahead = SIZE + rng.uniform(0.12, LOOK)  # 0.4 m/s and tyres that hold 5 m/s^2 stop within 2 cm
    place_on_link(world, "V1", link, float((drivers.at[0] + ahead) % roads.length[link]))
    frame = run(world, 2000)
    assert frame.vehicles["traffic_1"].collision_count == 0
    assert frame.vehicles["traffic_1"].speed == pytest.approx(0.0, abs=0.003)


# -- lanes ---------------------------------------------------------------------------------------------------------


def test_a_car_follows_line_and_circle_and_steers_as_the_bicycle_model() -> None:
    """On a circle of radius R of the front axle the steering angle is asin(wheelbase / R)."""
    world = world_of("oval", cars=1)
    errors, angles = [], []
    frame = world.frame
    for tick in range(6000):
        frame = world.step()
        if tick > 300:
            errors.append(distance_to_lanes(world, front_axle(frame, "traffic_1")))
            angles.append(abs(frame.vehicles["traffic_1"].steering))
    assert max(errors) < 0.02
    radius = {0.55: "inner", 0.85: "outer"}
    expected = [math.asin(WHEELBASE / r) for r in radius]
    turning = np.median([angle for angle in angles if angle > 0.1])
    assert min(abs(turning - r) / r for r in expected) < 0.05  # slip of the tyres


@pytest.mark.parametrize("seed", [0, 1])
def test_cars_start_apart_on_lanes_in_their_direction_and_the_seed_decides_where(seed: int) -> None:
    world = world_of(cars=20, seed=seed)
    names = [name for name in world.vehicle_names if name != "V1"]
    points = [front_axle(world.frame, name) for name in names]
    for i, point in enumerate(points):
        pose = world.frame.vehicles[names[i]].pose
        yaw = 2.0 * math.atan2(pose.orientation[3], pose.orientation[0])
        nearest = world.map.lane_graph.nearest(float(point[0]), float(point[1]), yaw)
        assert nearest is not None
        assert abs(nearest.offset) < 2e-3
        assert abs(math.remainder(nearest.yaw - yaw, 2 * math.pi)) < 0.1
        assert all(math.dist(point, other) > SIZE for other in points[:i])
    again, other = world_of(cars=20, seed=seed).frame, world_of(cars=20, seed=seed + 7).frame
    assert all((again.vehicles[n].pose.position == world.frame.vehicles[n].pose.position).all() for n in names)
    assert any((other.vehicles[n].pose.position != world.frame.vehicles[n].pose.position).any() for n in names)
    at_other_seed = world.reset(seed + 7)
    assert all((other.vehicles[n].pose.position == at_other_seed.vehicles[n].pose.position).all() for n in names)


def test_a_car_that_is_pushed_or_placed_elsewhere_finds_its_way() -> None:
    world = world_of(cars=1)
    run(world, 100)
    world.teleport("traffic_1", 2.0, 2.45, 0.1)
    start = world.frame.vehicles["traffic_1"].pose.position.copy()
    frame = run(world, 600)
    assert math.dist(frame.vehicles["traffic_1"].pose.position, start) > 0.8
    assert distance_to_lanes(world, front_axle(frame, "traffic_1")) < 0.02
    world.teleport("traffic_1", 2.1, 4.4, 0.0)  # across the lanes of the parking lot
    frame = run(world, 200)
    assert frame.vehicles["traffic_1"].speed == pytest.approx(0.0, abs=1e-3)


# -- intersections -------------------------------------------------------------------------------------------------


class Drive(NamedTuple):
    """What twelve cars of a town did in each tick."""

    world: World
    """At the end."""
    events: list[Any]
    speed: np.ndarray
    """[m/s], shape (n_tick, 12), as the others."""
    link: np.ndarray
    at: np.ndarray
    """On the link [m]."""
    yaw: np.ndarray
    indicators: np.ndarray


@pytest.fixture(scope="module")
def town() -> Drive:
    """90 s."""
    world = world_of()
    names, drivers = world.compiled.fleet.names, drivers_of(world)
    events: list[Any] = []
    rows = []
    for _ in range(9000):
        frame = world.step()
        events += frame.events
        cars = [frame.vehicles[name] for name in names]
        yaw = [yaw_from_quaternion(car.pose.orientation) for car in cars]
        speed = world.compiled.state.vehicle_velocity[1:, 0].copy()
        rows.append((speed, drivers.link.copy(), drivers.at.copy(), yaw, [car.lights.indicators for car in cars]))
    return Drive(world, events, *(np.array(column) for column in zip(*rows, strict=True)))


def test_traffic_of_a_town_has_no_collisions_obeys_lights_and_moves_on(town: Drive) -> None:
    stands, longest = np.zeros(12), np.zeros(12)
    for speed in town.speed:
        stands = np.where(speed < 0.02, stands + 0.01, 0.0)
        longest = np.maximum(longest, stands)
    assert town.events == []
    way = town.speed.sum(axis=0) * 0.01
    assert way.min() > 5.0
    assert longest.max() < 60.0  # two cycles of the lights, with patience


def test_a_car_waits_at_the_line_of_a_red_light_and_drives_when_it_is_green() -> None:
    world = world_of(cars=1)
    for light in world.map.traffic_lights:
        world.set_traffic_light(light, TrafficLightState.RED)
    place_on_link(world, "traffic_1", *_link_to(world, (-0.7, -0.15), 0.3))
    frame = run(world, 1500)
    yaw_free_front = front_axle(frame, "traffic_1")[0] + FRONT - WHEELBASE
    assert frame.vehicles["traffic_1"].speed == pytest.approx(0.0, abs=0.003)
    assert -0.67 - 2 * STOP_MARGIN - 0.02 < yaw_free_front < -0.67
    for light in world.map.traffic_lights:
        world.set_traffic_light(light, TrafficLightState.GREEN)
    frame = world.frame
    for _ in range(800):
        frame = world.step()
        assert not frame.events
    assert front_axle(frame, "traffic_1")[0] > -0.4


def test_a_car_stops_at_a_stop_sign() -> None:
    world = world_of(cars=1, vehicles={"V1": {"x": -1.1, "y": -0.15}})
    world.teleport("traffic_1", 2.05, 4.3, -math.pi / 2)
    slowest = 1.0
    frame = world.frame
    for _ in range(1500):
        frame = world.step()
        assert not frame.events  # not even StopSign
        y = front_axle(frame, "traffic_1")[1] - (FRONT - WHEELBASE)
        if 3.38 < y < 3.6:
            slowest = min(slowest, frame.vehicles["traffic_1"].speed)
    assert slowest < 0.03
    assert front_axle(frame, "traffic_1")[1] < 3.3


def test_a_car_gives_way_to_a_car_of_the_user_on_the_major_road() -> None:
    """At the give-way sign of Tiny Town: it waits while the user comes, and goes when the user has passed."""
    world = world_of(cars=1, vehicles={"V1": {"x": 4.05, "y": 1.6, "yaw_deg": -90.0}})
    place_on_link(world, "traffic_1", *_link_to(world, (3.5, -0.15), 0.3))
    frame = world.frame
    for _ in range(900):
        near = world.frame.vehicles["V1"].pose.position[1] > -0.6
        frame = world.step({"V1": Command(throttle=0.7 if near else 0.0)})
        front = front_axle(frame, "traffic_1")[0] + FRONT - WHEELBASE
        if frame.vehicles["V1"].pose.position[1] > 0.0:
            assert front < 3.56  # the line is at 3.53
    assert frame.vehicles["traffic_1"].collision_count == 0


def _link_to(world: World, end: tuple[float, float], before: float) -> tuple[int, float]:
    """The link that ends there, and the place so far before its end."""
    roads = world.compiled.fleet.table.roads
    for link in range(roads.link_count):
        if math.dist(roads.points[roads.point_first[link + 1] - 1, :2], end) < 1e-6:
            return link, float(roads.length[link]) - before
    raise AssertionError(end)


# -- the world -----------------------------------------------------------------------------------------------------


def test_the_car_of_the_user_has_the_bits_that_it_has_alone() -> None:
    alone = make(map="tiny_town", vehicles=LOT)
    among = world_of(cars=3)
    for _ in range(100):
        command = {"V1": Command(throttle=0.3, steering=0.2)}
        a, b = alone.step(command).vehicles["V1"], among.step(command).vehicles["V1"]
        assert a.pose.position.tobytes() == b.pose.position.tobytes()


def test_traffic_is_marked_and_obeys_no_commands() -> None:
    world = world_of(cars=2)
    assert [vehicle.is_traffic for vehicle in world.frame.vehicles.values()] == [False, True, True]
    with pytest.raises(CommandError, match=r"'traffic_2' belongs to the traffic and drives itself; command V1"):
        world.step({"traffic_2": Command()})
    with pytest.raises(CommandError, match="drives itself"):
        world.set_driving_mode("traffic_1", is_autonomous=False)
    with autodrive.Simulation(world) as simulation, pytest.raises(CommandError, match="drives itself"):
        simulation.submit("traffic_1", Command())


def test_headlights_of_the_traffic_are_on_by_night() -> None:
    world = world_of("oval", cars=2)

    def headlights() -> list[Headlights]:
        return [vehicle.lights.headlights for vehicle in world.frame.vehicles.values()]

    assert headlights() == [Headlights.OFF] * 3
    world.set_scene_light(False)
    world.step()
    assert headlights() == [Headlights.OFF, Headlights.LOW, Headlights.LOW]
    assert world.frame.vehicles["traffic_1"].lights.tail_lights > TailLights.OFF
    night = world_of("oval", cars=1, scene_light=False)
    assert night.frame.vehicles["traffic_1"].lights.headlights == Headlights.LOW  # from the first Frame on


@pytest.mark.parametrize(
    ("time_of_day", "clouds", "expected"),
    [
        (17.1, 0.0, Headlights.OFF),
        (17.3, 0.0, Headlights.LOW),
        (12.0, 0.7, Headlights.OFF),
        (12.0, 0.8, Headlights.LOW),
    ],
)
def test_headlights_of_the_traffic_are_on_below_a_sun_of_8_degrees_and_under_thick_clouds(
    time_of_day: float, clouds: float, expected: Headlights
) -> None:
    """At an equinox with 44 degrees at noon, the sun is at 8 degrees at 17:14."""
    world = world_of("oval", cars=1)
    world.set_time_of_day(time_of_day * 3600.0, 0.0)
    world.set_weather(Weather(clouds=clouds))
    world.step()
    assert world.scene_light
    assert world.frame.vehicles["traffic_1"].lights.headlights == expected


def test_brake_lamps_are_on_while_a_car_brakes_or_stands() -> None:
    """A car comes to a standing car of the user, which then drives away; the lamps against the change of its speed."""
    world = world_of("oval", cars=1)
    place_on_link(world, "traffic_1", 0, 0.4)
    run(world, 600)

    def is_lit() -> bool:
        return world.frame.vehicles["traffic_1"].lights.tail_lights is TailLights.BRIGHT

    free = [world.step() and is_lit() for _ in range(100)]
    assert not any(free)
    place_on_link(world, "V1", 0, float(drivers_of(world).at[0]) + 1.2)
    speed, lit = [], []
    for _ in range(900):
        speed.append(world.step().vehicles["traffic_1"].speed)
        lit.append(is_lit())
    change = (np.array(speed[20:]) - np.array(speed[:-20])) / 0.2  # [m/s^2] in the last 0.2 s: the drive lags behind
    brakes = change < -0.8 / 14.0
    assert brakes.sum() > 100
    assert np.array(lit[20:])[brakes].all()
    assert abs(speed[-1]) < 0.001
    assert lit[-1]
    world.teleport("V1", 0.0, 1.15)
    later = [world.step() and is_lit() for _ in range(200)]
    assert not any(later[10:])
    assert world.frame.vehicles["traffic_1"].speed > 0.1


def test_indicators_say_where_a_car_turns(town: Drive) -> None:
    """From 2.1 m before a turn until its end; against the heading before and after, and without a turn none."""
    turned = {Indicators.LEFT: 0, Indicators.RIGHT: 0}
    roads = town.world.compiled.fleet.table.roads
    for c in range(12):
        before, first, shown = -1, 0.0, set[int]()
        for tick, (link, at, yaw) in enumerate(zip(town.link[:, c], town.at[:, c], town.yaw[:, c], strict=True)):
            gate = link if link >= 0 and roads.is_gate[link] else -1
            if gate != before:
                if before >= 0:
                    ahead = roads.points[roads.point_first[before + 1] - 1, 2:]
                    angle = math.remainder(math.atan2(ahead[1], ahead[0]) - first, 2.0 * math.pi)
                    want = Indicators.LEFT if angle > 0.8 else Indicators.RIGHT if angle < -0.8 else Indicators.OFF
                    assert shown == {want}, (c, angle, shown)
                    turned[want] = turned.get(want, 0) + 1
                before, first, shown = gate, yaw, set()
            elif gate >= 0 and at < 0.9 * roads.length[gate]:
                shown.add(town.indicators[tick, c])
    assert turned[Indicators.LEFT] > 2
    assert turned[Indicators.RIGHT] > 2
    assert turned[Indicators.OFF] > 2


def test_the_lidar_sees_the_traffic() -> None:
    world = world_of("oval", cars=1)
    place_on_link(world, "traffic_1", 0, 1.0)
    place_on_link(world, "V1", 0, 0.3)
    while world.frame.vehicles["V1"].lidar is None or world.time < 0.3:
        world.step()
    lidar = world.frame.vehicles["V1"].lidar
    assert lidar is not None
    ahead = np.nanmin(np.where(np.isfinite(lidar.ranges), lidar.ranges, np.nan))
    assert ahead < 0.8


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"map": "practice"}, r"traffic: map 'practice' is a race track; traffic needs a map with roads"),
        ({"map": "oval", "cars": 50}, r"traffic: map 'oval' has room for \d+ cars; the traffic has 50 cars"),
        ({"type": "nigel_2023"}, r"traffic: the throttle of 'nigel_2023' must set a speed"),
        ({"type": "nigle"}, r"traffic\.type: .*nigel"),
        ({"cars": 51}, r"traffic\.cars"),
        ({"map": "plane"}, r"traffic: map 'plane' has no closed way of lanes"),
        ({"own": "traffic_1"}, r"vehicles\.traffic_1: this name belongs to the traffic; choose another name"),
    ],
)
def test_traffic_that_is_not_possible_is_an_error(fields: dict[str, Any], text: str) -> None:
    fields = dict(fields)
    map_, name = fields.pop("map", "tiny_town"), fields.pop("own", "V1")
    with pytest.raises(SpecError, match=text):
        make(map=map_, vehicles={name: LOT["V1"]}, traffic={"cars": 2} | fields)


def test_a_map_with_dead_ends_only_is_no_place_for_traffic() -> None:
    ends = [{"module": "dead_end", "x": -0.3, "yaw_deg": 180.0}, {"module": "dead_end", "x": 0.3}]
    ends = [{"y": 0.0} | end for end in ends]
    street = MapSpec.model_validate({"title": "Street", "placements": ends})
    with pytest.raises(SpecError, match="has no closed way of lanes; the traffic has 1 cars"):
        make(map=street, traffic={"cars": 1})


def test_a_campaign_varies_the_traffic() -> None:
    town = read_scenario("tiny_town")
    assert not errors(town, "traffic.cars", ParameterRange(choice=(0, 4)))
    spec = applied(town, {"traffic.cars": 4}).specs.scenario
    assert len(autodrive.make(spec).vehicle_names) == 5
