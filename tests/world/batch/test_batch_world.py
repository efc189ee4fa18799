"""Each world of a batch has the bits of a single World; the other axioms of a batch."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from autodrive import Command, Frame, make
from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError, SpecError
from autodrive.protocol.messages import Collision, RedLight, StopSign, Weather
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement, load_scenario
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world.batch import BatchWorld, Readings
from tests.support.cars import car_file

CARS: dict[str, Any] = {
    "V1": {"type": "nigel", "has_realistic_sensors": True, "sensors": {"range": {"noise": "strong"}}},
    "V2": {"type": "nigel_2023", "x": 1.0, "yaw_deg": 90, "sensors": {"lidar": {"rate": 30}, "imu": {"rate": 12.5}}},
}
"""Two different cars, with noise and different rates."""

TWO_CARS = ScenarioSpec(
    map="mini_map",
    vehicles={
        "V1": {**CARS["V1"], "sensors": {"ips": {"noise": "strong"}, "encoders": {"is_on": False}}},
        "V2": CARS["V2"],
    },  # pyright: ignore[reportArgumentType]
    boxes={"box": {"x": 0.5, "y": 0.1}},  # pyright: ignore[reportArgumentType]
)
DOCS = Path(__file__).parents[3] / "docs"
FORWARD = np.array([1.0, 0.0])


def random_commands(n: int, v: int, steps: int, seed: int = 0) -> Floats:
    """First straight on at full throttle, then turning, so that cars hit boxes, walls and each other.

    Shape (steps, n, v, 2).
    """
    rng = np.random.default_rng(seed)
    commands = np.empty((steps, n, v, 2))
    commands[..., 0] = rng.choice([1.0, 1.0, 0.5, 0.0, -1.0], (1 + steps // 40, n, v)).repeat(40, axis=0)[:steps]
    commands[..., 1] = rng.uniform(-1.5, 1.5, (1 + steps // 20, n, v)).repeat(20, axis=0)[:steps]
    commands[:80] = FORWARD
    return commands


def as_commands(names: Sequence[str], values: Floats) -> dict[str, Command]:
    return {name: Command(*pair) for name, pair in zip(names, values.tolist(), strict=True)}


def assert_same(readings: Readings, k: int, frame: Frame) -> None:
    """World k of the batch shows what the Frame shows, bit by bit."""
    r = readings
    assert (r.time[k], r.tick[k]) == (frame.time, frame.tick)
    for o, box in enumerate(frame.objects.values()):
        np.testing.assert_array_equal(r.object_pose[k, o, :3], box.pose.position)
        np.testing.assert_array_equal(r.object_pose[k, o, 3:], box.pose.orientation)
    for i, car in enumerate(frame.vehicles.values()):
        pairs = {
            "position": car.pose.position,
            "orientation": car.pose.orientation,
            "velocity": car.velocity,
            "angular_velocity": car.angular_velocity,
            "throttle": car.throttle,
            "steering": car.steering,
            **{f"wheel_{name}": getattr(car.wheels, name) for name in car.wheels.__struct_fields__},
            "encoder_time": car.encoders.time,
            "ips_time": car.ips.time,
            "imu_time": car.imu.time,
            "encoder_ticks": car.encoders.ticks,
            "encoder_angles": car.encoders.angles,
            "ips_position": car.ips.position,
            "imu_orientation": car.imu.orientation,
            "imu_euler": car.imu.euler,
            "imu_angular_velocity": car.imu.angular_velocity,
            "imu_linear_acceleration": car.imu.linear_acceleration,
            "collision_count": car.collision_count,
        }
        if car.lidar is not None:
            np.testing.assert_array_equal(r.lidar_ranges[k, i, : len(car.lidar.ranges)], car.lidar.ranges)
            pairs["lidar_time"] = car.lidar.time
        if car.range is not None:
            pairs |= {"range_distance": car.range.range, "range_time": car.range.time}
        for name, expected in pairs.items():
            np.testing.assert_array_equal(getattr(r, name)[k, i], expected, err_msg=name)
        if car.v2x is not None:
            assert_heard(r, k, i, frame)
    lights = frame.traffic_lights.values()
    assert r.light_state[k].tolist() == [light.state for light in lights]
    times = [light.time_to_change for light in lights]
    np.testing.assert_array_equal(r.light_time_to_change[k], np.array(times, np.float64))


def assert_heard(readings: Readings, k: int, i: int, frame: Frame) -> None:
    """Vehicle i has heard what it has in the Frame, and of no other sender."""
    reading = [*frame.vehicles.values()][i].v2x
    assert reading is not None
    assert reading.vehicles.keys() <= frame.vehicles.keys()
    for row, name in zip(readings.heard_vehicles[k, i], frame.vehicles, strict=True):
        car = reading.vehicles.get(name)
        expected = [np.nan] * 8
        if car is not None:
            expected = [car.sent, car.received, *car.position, car.yaw, car.speed, car.steering]
        np.testing.assert_array_equal(row, expected)
    for row, name in zip(readings.heard_lights[k, i], frame.traffic_lights, strict=True):
        light = reading.lights.get(name)
        expected = [np.nan] * 4
        if light is not None:
            change = np.nan if light.time_to_change is None else light.time_to_change
            expected = [light.sent, light.received, light.state, change]
        np.testing.assert_array_equal(row[[0, 1, 4, 5]], expected)


def copies(readings: Readings) -> list[Any]:
    return [column.copy() for column in readings]


@pytest.mark.slow
def test_each_world_has_the_bits_of_a_single_world() -> None:
    """With contacts, noise, two cars, and resets of single worlds with other seeds."""
    steps, n = 200, 3
    batch = BatchWorld(TWO_CARS, n, seed=5)
    worlds = [make(TWO_CARS, seed=5 + k) for k in range(n)]
    for k, world in enumerate(worlds):
        assert_same(batch.readings, k, world.frame)
    off_road: list[set[str]] = [set() for _ in range(n)]
    seen: set[str] = set()
    for t, commands in enumerate(random_commands(n, 2, steps)):
        if t == 110:
            batch.reset([2, 0], [9, 2**62])
            worlds[2].reset(9)
            worlds[0].reset(2**62)
            off_road[0], off_road[2] = set(), set()
        if t == 140:
            batch.reset(np.array([False, True, False]))
            worlds[1].reset()
            off_road[1] = set()
        readings = batch.step(commands)
        for k, world in enumerate(worlds):
            frame = world.step(as_commands(batch.vehicle_names, commands[k]))
            assert_same(readings, k, frame)
            happened = {name: {e.vehicle for e in frame.events if type(e).__name__ == name} for name in NAMES}
            off_road[k] = (off_road[k] | happened["OffRoad"]) - happened["BackOnRoad"]
            assert happened["Collision"] == vehicles_of(batch, readings.has_collided[k])
            assert off_road[k] == vehicles_of(batch, readings.is_off_road[k])
            seen |= {name for name, vehicles in happened.items() if vehicles}
    assert {"Collision", "OffRoad"} <= seen


NAMES = ("Collision", "OffRoad", "BackOnRoad")


def vehicles_of(batch: BatchWorld, mask: Any) -> set[str]:
    return {name for name, is_meant in zip(batch.vehicle_names, mask.tolist(), strict=True) if is_meant}


RADIOS: dict[str, dict[str, Any]] = {
    "ideal": {"range": 1.3, "rate": 100.0},
    "real": {"rate": 30.0, "delay": 0.037, "jitter": 0.05, "loss": 0.3, "position_noise": 0.1},
    "late": {"range": 2.0, "rate": 7.5, "delay": 0.9, "loss": 0.1},
}


def radio_town(radio: str) -> ScenarioSpec:
    """Three cars and four lights, of which two have a program and one flashes."""
    cars = {f"V{i}": {"x": -1.9 + 0.6 * i, "y": -0.15, "yaw_deg": 30.0 * i} for i in range(3)}
    program = {"groups": {"all": ["traffic_light_1", "traffic_light_2"]}, "phases": [{"duration": 0.4}], "offset": 0.3}
    program["phases"] += [{"green": ["all"], "duration": 0.3}]
    flash = {"groups": {"a": ["traffic_light_3"]}, "phases": [{"duration": 1.0}], "flashing": [0, 9000]}
    programs = {"crossing": None, "some": program, "night": flash}
    return ScenarioSpec.model_validate(
        {"map": "crossing", "vehicles": cars, "v2x": RADIOS[radio], "light_programs": programs, "time_of_day": 3600}
    )


TOWNS: dict[str, dict[str, Any]] = {
    "oval": {"map": "oval", "vehicles": {"V1": {"y": 1.15}}, "boxes": {"box": {"x": 0.5, "y": 0.9}}},
    "tiny_town": {"map": "tiny_town", "vehicles": {"V1": {"x": -1.1, "y": -0.15}, "V2": {"x": 2.5, "y": 4.2}}},
}


def traffic(town: str, cars: int) -> ScenarioSpec:
    """Lights, signs, a box and cars of the user in the way of the traffic."""
    return ScenarioSpec.model_validate(TOWNS[town] | {"traffic": {"cars": cars}, "v2x": {"loss": 0.2}})


RACERS = {"V1": {"type": "roboracer_f1tenth"}, "V2": {"type": "roboracer", "y": 1.0}}


def lidars(folder: Path, *, is_rolling: bool, direction: int) -> ScenarioSpec:
    """Two cars with a noisy LIDAR that turns in that direction."""
    angles = {"angle_min_deg": -135.0 * direction, "angle_increment_deg": 1.35 * direction}
    lidar = {"rays": 200, "rate": 40, "is_rolling": is_rolling, "noise": "realistic", **angles}
    car = car_file(folder, {f"sensors.lidar.{name}": value for name, value in lidar.items()})
    return ScenarioSpec.model_validate(
        {"map": "mini_map", "vehicles": {"V1": {"type": car}, "V2": {"x": 1.0, "type": car}}}
    )


class Case(NamedTuple):
    """A scenario that a batch and single worlds run, and how."""

    spec: Callable[[Path], ScenarioSpec]
    """The scenario, whose files may be in the folder."""
    ticks: int = 1
    """Ticks of an action."""
    steps: int = 60
    poses: dict[str, Any] | None = None
    """Start poses after a reset."""
    engine: Any = "auto"


CASES = {
    "tyres and differentials": Case(lambda _: ScenarioSpec.model_validate({"vehicles": RACERS}), steps=90),
    "collisions": Case(lambda _: load_scenario("boxes"), ticks=7, steps=40),
    "collisions, engine": Case(lambda _: load_scenario("boxes"), ticks=7, steps=40, engine="always"),
    "ideal radio": Case(lambda _: radio_town("ideal"), ticks=3),
    "real radio": Case(lambda _: radio_town("real"), ticks=3),
    "late radio": Case(lambda _: radio_town("late"), ticks=3),
    "traffic on an oval": Case(lambda _: traffic("oval", 3), 20, 40, {"V1": (0.5, 1.15, 0.3)}),
    "traffic in a town": Case(
        lambda _: traffic("tiny_town", 12), 20, 40, {"V2": (2.5, 4.1, 0.1), "traffic_3": (2.5, 3.1, 0.0)}
    ),
    "LIDARs": Case(lambda folder: lidars(folder, is_rolling=False, direction=-1)),
    "rolling LIDARs": Case(lambda folder: lidars(folder, is_rolling=True, direction=1)),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_two_worlds_of_a_batch_have_the_bits_of_single_worlds(case: Case, tmp_path: Path) -> None:
    """Also after resets with another seed and other poses, and with the same seeds."""
    spec = case.spec(tmp_path)
    batch = BatchWorld(spec, 2, seed=3, engine=case.engine)
    worlds = [make(spec, seed=3 + k, engine=case.engine) for k in range(2)]
    assert batch.vehicle_names == worlds[0].vehicle_names
    for t, commands in enumerate(random_commands(2, len(batch.commanded_names), case.steps)):
        if t == case.steps // 2:
            batch.reset([1], [77], poses=case.poses)
            worlds[1].reset(77, poses=case.poses)
            assert_same(batch.readings, 1, worlds[1].frame)
        if t == 3 * case.steps // 4:
            batch.reset()
            for world in worlds:
                world.reset()
        readings = batch.step(commands, ticks=case.ticks)
        for k, world in enumerate(worlds):
            frames = [world.step(as_commands(batch.commanded_names, commands[k])) for _ in range(case.ticks)]
            assert_same(readings, k, frames[-1])
            hit = {event.vehicle for frame in frames for event in frame.events if isinstance(event, Collision)}
            assert hit == vehicles_of(batch, readings.has_collided[k])


@pytest.mark.slow
@pytest.mark.parametrize("spec", [load_scenario("tiny_town"), traffic("oval", 3), radio_town("real")])
def test_the_number_of_threads_does_not_matter(spec: ScenarioSpec) -> None:
    batches = [BatchWorld(spec, 40, seed=1, threads=threads) for threads in (1, 2, 3)]
    for commands in random_commands(40, len(spec.vehicles), 60):
        alone, *others = (batch.step(commands, ticks=5) for batch in batches)
        for other in others:
            for name, expected, column in zip(Readings._fields, alone, other, strict=True):
                np.testing.assert_array_equal(column, expected, err_msg=name)


def test_the_offences_of_each_world_are_the_events_of_a_single_world() -> None:
    """Cars cross stop lines of lights at red and at green, and of a stop sign with and without a stop."""
    line = next(line for line in load_map("tiny_town").stop_lines if line.kind == "stop")
    light = next(line for line in load_map("tiny_town").stop_lines if line.kind == "traffic_light")
    places = {"V1": line, "V2": light}
    cars = {
        name: {
            "x": line.pose[0] - 0.8 * math.cos(line.pose[2]),
            "y": line.pose[1] - 0.8 * math.sin(line.pose[2]),
            "yaw_deg": math.degrees(line.pose[2]),
        }
        for name, line in places.items()
    }
    program = {"groups": {"a": [light.prop]}, "phases": [{"green": ["a"], "duration": 2}, {"duration": 1}]}
    fields = {"map": "tiny_town", "vehicles": cars, "light_programs": {"intersection": None, "own": program}}
    spec = ScenarioSpec.model_validate(fields)
    n = 4
    batch, worlds = BatchWorld(spec, n), [make(spec, seed=k) for k in range(n)]
    counts = np.zeros((n, 2, 2), int)
    for step in range(120):
        if step == 80:
            batch.reset([0, 3])
            for k in (0, 3):
                worlds[k].reset()
                counts[k] = 0
        commands = np.zeros((n, 2, 2))
        for k in range(n):  # they start one after the other; in two worlds they stop just before the line
            driving = step % 80 - 15 * k
            is_waiting = driving < 0 or (k in (1, 2) and 17 <= driving < 30)
            commands[k, :, 0] = 0.0 if is_waiting else 1.0
        readings = batch.step(commands, ticks=5)
        for k, world in enumerate(worlds):
            for _ in range(5):
                for event in world.step(as_commands(batch.vehicle_names, commands[k])).events:
                    if isinstance(event, RedLight | StopSign):
                        counts[k, batch.vehicle_names.index(event.vehicle), int(isinstance(event, StopSign))] += 1
        np.testing.assert_array_equal(readings.red_light_count, counts[..., 0])
        np.testing.assert_array_equal(readings.stop_sign_count, counts[..., 1])
    assert counts[:, 0, 1].tolist() == [1, 0, 0, 0]  # world 3 has not started again yet
    assert counts[:, 1, 0].tolist() == [0, 0, 1, 0]


def test_the_traffic_has_the_weather_and_the_factors_of_each_world() -> None:
    spec = ScenarioSpec.model_validate(TOWNS["oval"] | {"traffic": {"cars": 2}, "weather": {"rain": 0.5}})
    batch, world = BatchWorld(spec, 2, seed=3), make(spec, seed=4)
    for is_changed in (False, True):
        if is_changed:
            batch.reset([1], mass=1.3, grip=0.7, weather=Weather(snow=1.0))
            world.set_factors({name: {"mass": 1.3, "grip": 0.7} for name in world.vehicle_names})
            world.reset(weather=Weather(snow=1.0))
        for _ in range(60):
            world.step({"V1": Command(0.3, 0.1)})
        assert_same(batch.step(np.full((2, 1, 2), (0.3, 0.1)), ticks=60), 1, world.frame)


def test_a_batch_without_a_channel_hears_nothing() -> None:
    batch = BatchWorld(radio_town("ideal").model_copy(update={"v2x": None}), 2)
    assert batch.readings.heard_vehicles.shape == (2, 3, 0, 8)
    assert batch.readings.heard_lights.shape == (2, 3, 0, 6)


def test_mass_and_noise_are_multiplied() -> None:
    """At rest the springs carry the weight; the same random numbers make twice the error."""
    noisy = {"V1": {"sensors": {"ips": {"noise": "strong"}}}}
    batch = BatchWorld(ScenarioSpec(vehicles=noisy, seed=4), 3)  # pyright: ignore[reportArgumentType]
    batch.reset(seeds=[4, 4, 4], mass=[1.0, 2.0, 1.0], noise=[1.0, 1.0, 2.0])
    errors = batch.readings.ips_position[:, 0] - batch.readings.position[:, 0]
    np.testing.assert_allclose(errors[2], 2.0 * errors[0], rtol=1e-9)
    for _ in range(200):
        batch.step(np.zeros((3, 1, 2)))
    loads = batch.readings.wheel_normal_load[:, 0].sum(axis=1)
    mass = batch.compiled.vehicles["V1"].body.mass
    np.testing.assert_allclose(loads, np.array([1.0, 2.0, 1.0]) * mass * 9.81, rtol=1e-3)  # the springs are damped


def test_a_reset_world_is_a_new_world_and_leaves_the_others_alone() -> None:
    batch = BatchWorld(TWO_CARS, 3)
    for commands in random_commands(3, 2, 60):
        batch.step(commands, ticks=2)
    before = copies(batch.readings)
    batch.reset([1], [77])
    new = BatchWorld(TWO_CARS, 1, seed=77)
    for step in range(30):
        for name, column, old, fresh in zip(Readings._fields, batch.readings, before, new.readings, strict=True):
            np.testing.assert_array_equal(column[1], fresh[0], err_msg=name)
            if step == 0:
                np.testing.assert_array_equal(column[[0, 2]], old[[0, 2]], err_msg=name)
        commands = random_commands(1, 2, 1, seed=step)[0]
        batch.step(np.broadcast_to(commands, (3, 2, 2)))
        new.step(commands)


@pytest.mark.parametrize("worlds", [[3, 1], [False, True, False, True]])
def test_some_worlds_move_and_the_others_stay_as_they_are(worlds: Any) -> None:
    some, all_ = BatchWorld(TWO_CARS, 4), BatchWorld(TWO_CARS, 4)
    for commands in random_commands(4, 2, 60):
        some.step(commands)
        all_.step(commands)
    before = copies(some.readings)
    for commands in random_commands(4, 2, 60, seed=1):
        some.step(commands, worlds=worlds)
        all_.step(commands)
    for column, old, moved in zip(some.readings, before, all_.readings, strict=True):
        np.testing.assert_array_equal(column[[0, 2]], old[[0, 2]])
        np.testing.assert_array_equal(column[[1, 3]], moved[[1, 3]])
    assert (some.readings.tick == [60, 120, 60, 120]).all()
    with pytest.raises(CommandError, match="worlds must be a mask"):
        some.step(np.zeros((4, 2, 2)), worlds=[4])


def test_poses_that_overlap_are_refused_and_nothing_changes() -> None:
    batch = BatchWorld(TWO_CARS, 3)
    batch.step(random_commands(3, 2, 1)[0], ticks=20)
    before = copies(batch.readings)
    with pytest.raises(CommandError, match="world 2 cannot start: 'V1' and 'V2' would overlap"):
        batch.reset([0, 2], [1, 2], poses={"V1": [[0.0, 0.0, 0.0], [0.9, 0.0, 0.0]]})
    for column, old in zip(batch.readings, before, strict=True):
        np.testing.assert_array_equal(column, old)


def test_a_world_that_diverges_waits_for_its_reset() -> None:
    spec = ScenarioSpec()
    batch = BatchWorld(spec, 3)
    batch.step(np.broadcast_to(FORWARD, (3, 1, 2)), ticks=50)
    batch.worlds.state.qvel[1, 0] = np.nan
    batch.step(np.broadcast_to(FORWARD, (3, 1, 2)), ticks=50)
    assert batch.readings.is_unstable.tolist() == [False, True, False]
    assert batch.step(np.broadcast_to(FORWARD, (3, 1, 2))).tick.tolist() == [101, 51, 101]
    world = make(spec)
    for _ in range(101):
        world.step({"V1": Command(throttle=1.0)})
    assert_same(batch.readings, 0, world.frame)
    batch.reset([1])
    assert not batch.readings.is_unstable.any()
    assert_same(batch.readings, 1, make(spec, seed=1).frame)


def test_a_world_needs_less_than_64_kib() -> None:
    """Of `tiny_town` with a LIDAR of 1080 rays: all arrays with a row for each world."""
    n = 8
    batch = BatchWorld("tiny_town", n)
    rows = 0
    pending: list[Any] = [batch.worlds]
    while pending:
        columns = pending.pop()
        if isinstance(columns, tuple):
            pending += columns
        else:
            assert len(columns) == n
            rows += columns.nbytes
    rays = batch.readings.lidar_ranges.shape[-1]
    assert rows / n + 8 * (1080 - rays) < 64 * 1024


def test_the_example_of_the_documentation_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (DOCS / "batch.md").read_text(), flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    assert names["batch"].readings.tick[:3].tolist() == [0, 0, 5]
    assert len(capsys.readouterr().out.split("\n")) > 5


def test_readings_cannot_be_written() -> None:
    batch = BatchWorld("plane", 2)
    for column in batch.readings:
        with pytest.raises(ValueError, match="read-only"):
            column[:] = 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n must be a whole number from 1 on, not 0"),
        ({"n": 2.5}, "n must be a whole number"),
        ({"threads": 0}, "threads must be a whole number"),
        ({"engine": "fast"}, "engine must be 'auto' or 'always'"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(CommandError, match=message):
        BatchWorld("plane", **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"worlds": [2]}, "numbers from 0 to 1"),
        ({"worlds": [0, 0]}, "different numbers"),
        ({"worlds": [0.5]}, "worlds must be a mask"),
        ({"seeds": [1]}, "a seed for each of the 2 worlds"),
        ({"mass": 20.0}, "mass is a factor from 0.1 to 10"),
        ({"grip": np.nan}, "grip is a factor"),
        ({"noise": [1.0, 2.0, 3.0]}, r"noise must be one number, or have the shape \(2,\) or \(2, 1\)"),
        ({"weather": [Weather()]}, "each of the 2 worlds"),
        ({"weather": Weather(rain=2.0)}, "rain"),
        ({"poses": {"V1": [0, 0]}}, r"the poses of 'V1' must have the shape \(2, 3\)"),
    ],
)
def test_wrong_resets_are_refused(arguments: dict[str, Any], message: str) -> None:
    batch = BatchWorld("plane", 2)
    batch.step(np.broadcast_to(FORWARD, (2, 1, 2)), ticks=3)
    with pytest.raises(CommandError, match=message):
        batch.reset(**arguments)
    assert batch.readings.tick.tolist() == [3, 3]


def test_all_errors_of_a_scenario_are_reported() -> None:
    with pytest.raises(SpecError, match="map"):
        BatchWorld(ScenarioSpec(map="no_such_map"), 2)


def test_other_parameters_of_a_vehicle_are_those_of_its_file(tmp_path: Path) -> None:
    changes = {"wheels.damping_rate": 0.4, "steering.limit_deg": 20.0, "body.mass": 2.5, "steering.dead_time": 0.02}
    spec = ScenarioSpec(vehicles={"V1": VehiclePlacement(type=car_file(tmp_path, changes, "nigel_2023"))})
    own = load_vehicle(spec.vehicles["V1"].type)
    others = {**changes, "wheels.damping_rate": 0.2, "steering.dead_time": 0.03}
    (tmp_path / "other").mkdir()
    other = ScenarioSpec(vehicles={"V1": VehiclePlacement(type=car_file(tmp_path / "other", others, "nigel_2023"))})
    batch = BatchWorld(other, 3)
    batch.reset([1], vehicles={"V1": [own]})
    commands = random_commands(1, 1, 60)
    world, unchanged = make(spec, seed=1), make(other, seed=0)
    for command in commands:
        batch.step(np.tile(command, (3, 1, 1)))
        world.step(as_commands(["V1"], command[0]))
        unchanged.step(as_commands(["V1"], command[0]))
    assert_same(batch.readings, 1, world.frame)
    assert_same(batch.readings, 0, unchanged.frame)
    batch.reset([1])
    batch.step(np.tile(FORWARD, (3, 1, 1)))
    assert batch.readings.wheel_angular_velocity[1, 0, 2] != world.frame.vehicles["V1"].wheels.angular_velocity[2]
    with pytest.raises(CommandError, match=r"the longest dead time of the vehicles of the scenario is 0\.03 s"):
        batch.reset([1], vehicles={"V1": [load_vehicle(car_file(tmp_path, {"steering.dead_time": 0.04}))]})
    with pytest.raises(CommandError, match="a Spec of 'V1' for each of the 3 worlds"):
        batch.reset(vehicles={"V1": [own]})
    with pytest.raises(CommandError, match="vehicle 'V2' is not in these worlds"):
        batch.reset(vehicles={"V2": [own] * 3})


def test_a_vehicle_that_starts_in_motion_goes_on_as_one_that_has_driven() -> None:
    """The suspension and the slip at the start are those at rest, so that the speed differs for some ticks."""
    commands = np.tile([0.7, 0.3], (2, 1, 1))
    batch = BatchWorld(ScenarioSpec(), 2)
    readings = batch.step(commands, ticks=200)
    speed, rate = readings.velocity[0, 0, 0], readings.angular_velocity[0, 0, 2]
    position, angle = readings.position[0, 0].copy(), readings.steering[0, 0]
    batch.reset([1], poses={"V1": [1.0, 2.0, 0.5]}, motions={"V1": [speed, 0.0, rate, 0.7, 0.3]})
    assert readings.velocity[1, 0] == pytest.approx([speed, 0.0, 0.0])
    assert readings.steering[1, 0] == pytest.approx(angle)
    batch.step(commands, ticks=50)
    way = [math.dist(readings.position[0, 0, :2], position[:2]), math.dist(readings.position[1, 0, :2], (1.0, 2.0))]
    assert way[1] == pytest.approx(way[0], rel=0.01)
    assert readings.angular_velocity[1, 0, 2] == pytest.approx(rate, rel=0.01)
    with pytest.raises(CommandError, match="throttle and steering from -1 to 1"):
        batch.reset(motions={"V1": [0.0, 0.0, 0.0, 2.0, 0.0]})
    with pytest.raises(CommandError, match=r"the motions of 'V1' must have the shape \(2, 5\)"):
        batch.reset(motions={"V1": [0.0, 0.0]})


def test_seeds_of_a_batch_are_plain_integers() -> None:
    """200 + 99 is more than a uint8 holds."""
    car = VehiclePlacement(type="roboracer", sensors={"lidar": SensorSettings(noise="realistic")})
    scenario, small = ScenarioSpec(map="practice", vehicles={"V1": car}), np.uint8(200)
    noisy, usual = (BatchWorld(scenario, n=100, seed=seed, threads=1).readings.lidar_ranges for seed in (small, 200))  # pyright: ignore[reportArgumentType]
    assert noisy.tobytes() == usual.tobytes()
    assert (noisy[0] != noisy[1]).any()
    with pytest.raises(CommandError, match="not 9223372036854775808"):
        BatchWorld("plane", n=2, seed=2**63 - 1)
    with pytest.raises(CommandError, match="a seed must be a whole number"):
        BatchWorld("plane", n=1, seed=True)
