"""The same scenario, seed and commands give the same bits in any process, after a reset and after a restore."""

import json
import math
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import autodrive
from autodrive.protocol.messages import Command, Frame
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement, load_scenario
from autodrive.world import World
from tests.support.cars import car_file
from tests.support.frames import bytes_of, digest, digests

ROOT = Path(__file__).parent.parent
TICKS = 150
CASES = ("one car", "eight cars", "roboracers", "pushed boxes", "realistic noise", "tiny town", "rules", "race")


def scenario(case: str, folder: Path) -> ScenarioSpec:
    """The scenario of a case; a vehicle file is written to `folder`."""
    if case == "one car":
        return ScenarioSpec()
    if case == "eight cars":  # close together, so that some collide
        return ScenarioSpec(
            vehicles={
                f"V{i}": VehiclePlacement(x=0.45 * (i % 4), y=0.45 * (i // 4), yaw_deg=20 * i) for i in range(1, 9)
            }
        )
    if case == "roboracers":  # one with each law of the tyres
        return ScenarioSpec(
            vehicles={
                "V1": VehiclePlacement(type="roboracer_f1tenth"),
                "V2": VehiclePlacement(type="roboracer", y=0.6),
            }
        )
    if case == "pushed boxes":
        return load_scenario("boxes").model_copy(update={"vehicles": {"V1": VehiclePlacement(x=0.45)}})
    if case == "tiny town":
        return load_scenario("tiny_town")
    if case == "rules":
        radio = {"rate": 30.0, "delay": 0.05, "jitter": 0.05, "loss": 0.2, "position_noise": 0.1}
        return ScenarioSpec.model_validate(
            {"map": "tiny_town", "traffic": {"cars": 4}, "v2x": radio, "weather": {"rain": 0.6}, "time_of_day": 64800}
        )
    if case == "race":
        car = {"type": "roboracer"}
        return ScenarioSpec.model_validate({"map": "practice", "vehicles": {"V1": car, "V2": car}})
    noisy = car_file(
        folder,
        {
            "sensors.imu.noise": "realistic",
            "sensors.lidar.noise": "realistic",
            "sensors.ips.noise": {"sigma": 0.01},
            "sensors.lidar.rate": 20.0,
        },
    )
    return ScenarioSpec(
        vehicles={"V1": VehiclePlacement(type=noisy), "V2": VehiclePlacement(type=noisy, x=1.0)}, seed=7
    )


def drive(frame: Frame) -> dict[str, Command]:
    """Turns, full throttle, stop and reverse, different for each vehicle."""
    return {
        name: Command(
            throttle=(1.0, 0.8, 0.0, -0.6)[(frame.tick // 50 + i // 3) % 4],
            steering=math.sin(0.03 * frame.tick + i),
            headlights=autodrive.Headlights(frame.tick // 50 % 3),
            indicators=autodrive.Indicators(frame.tick // 60 % 4),
        )
        for i, (name, vehicle) in enumerate(frame.vehicles.items())
        if not vehicle.is_traffic
    }


def films_of_a_new_process(folder: Path, hash_seed: str) -> dict[str, list[str]]:
    program = (
        "import json, sys, pathlib, autodrive\n"
        "from tests.test_determinism import CASES, TICKS, drive, scenario\n"
        "from tests.support.frames import digests\n"
        "folder = pathlib.Path(sys.argv[1])\n"
        "print(json.dumps({c: digests(autodrive.make(scenario(c, folder)), TICKS, drive) for c in CASES}))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(folder)],
        cwd=ROOT,
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return json.loads(done.stdout)


@pytest.fixture
def world(request: pytest.FixtureRequest, tmp_path: Path) -> World:
    return autodrive.make(scenario(request.param, tmp_path))


each_case = pytest.mark.parametrize(
    "world", [CASES[0], *(pytest.param(case, marks=pytest.mark.slow) for case in CASES[1:])], indirect=True
)


@pytest.mark.process
@pytest.mark.slow
def test_two_new_processes_give_the_same_bits(tmp_path: Path) -> None:
    first = films_of_a_new_process(tmp_path, "1")
    second = films_of_a_new_process(tmp_path, "2")
    assert list(first) == list(CASES)
    for case in CASES:
        assert len(set(first[case])) == TICKS + 1, case  # all Frames differ, at least in time
        assert first[case] == second[case], case


@each_case
def test_a_reset_world_repeats_itself(world: World) -> None:
    first = digests(world, TICKS, drive)
    world.reset()
    assert digests(world, TICKS, drive) == first


@each_case
def test_a_restored_world_has_the_same_future_in_each_world_of_its_scenario(world: World) -> None:
    other = autodrive.make(world.spec)
    digests(world, 20, drive)
    world.set_weather(autodrive.Weather(rain=0.3, snow=0.5))
    digests(world, 17, drive)  # not a multiple of the period in which the tyres follow the ground
    saved = world.save()
    future = digests(world, TICKS, drive)
    digests(other, 20, drive)
    for each in (world, world, other):
        each.restore(pickle.loads(pickle.dumps(saved)))
        assert digests(each, TICKS, drive) == future


@each_case
def test_save_does_not_change_the_world(world: World) -> None:
    undisturbed = digests(world, 60, drive)
    world.reset()
    watched = [digest(world.frame)]
    for _ in range(60):
        world.save()
        watched.append(digest(world.step(drive(world.frame))))
    assert watched == undisturbed


@pytest.mark.parametrize("at", [50, 170, 263])  # asleep before contact; about to sleep after it; asleep again
def test_restore_keeps_the_sleep_state_of_a_box(at: int) -> None:
    def push_twice(frame: Frame) -> dict[str, Command]:
        return {"V1": Command(throttle=1.0 if frame.tick < 160 or frame.tick > 280 else 0.0)}

    world = autodrive.make(ScenarioSpec(boxes={"box": BoxSpec(x=0.5, y=0.0)}))
    digests(world, at, push_twice)
    saved = world.save()
    future = digests(world, 300, push_twice)
    world.restore(saved)
    assert digests(world, 300, push_twice) == future


def test_the_seed_changes_the_noise_only(tmp_path: Path) -> None:
    spec = scenario("realistic noise", tmp_path)
    world, other = autodrive.make(spec, seed=1), autodrive.make(spec, seed=2)
    digests(world, 100, drive)
    digests(other, 100, drive)
    a, b = world.frame.vehicles["V1"], other.frame.vehicles["V1"]
    assert digest(a.pose) == digest(b.pose)
    assert digest(a.wheels) == digest(b.wheels)
    assert digest(a.imu) != digest(b.imu)
    assert digest(a.lidar) != digest(b.lidar)
    assert digest(a.ips) != digest(b.ips)


@pytest.mark.parametrize("boxes", [{}, {"box": BoxSpec(x=0.5, y=0.0)}], ids=["alone", "pushing a box"])
def test_distant_vehicles_do_not_change_a_bit(boxes: dict[str, BoxSpec]) -> None:
    alone = autodrive.make(ScenarioSpec(boxes=boxes))
    crowd = {f"V{i}": VehiclePlacement(x=30.0 * i, y=50.0) for i in range(2, 9)}  # beyond the 12 m of the LIDAR
    among = autodrive.make(ScenarioSpec(boxes=boxes, vehicles={"V1": VehiclePlacement(), **crowd}))
    for _ in range(TICKS):
        a = alone.step(drive(alone.frame)).vehicles["V1"]
        b = among.step(drive(among.frame)).vehicles["V1"]
        assert b"".join(bytes_of(a)) == b"".join(bytes_of(b))
