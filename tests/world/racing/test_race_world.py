"""Races in a World: set-backs, snapshots, and what ends the race of a vehicle."""

from __future__ import annotations

import math

import pytest

import autodrive
from autodrive.base.errors import CommandError, SnapshotError, SpecError
from autodrive.base.transforms import euler_from_quaternion
from autodrive.protocol.messages import (
    CheckpointPassed,
    Collision,
    Command,
    Event,
    Frame,
    RacePenalty,
    RaceStatus,
    RaceStatusChanged,
    SetBack,
)
from autodrive.scenario import RaceSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.frames import digest, digests


def spec(vehicles: int = 1, rules: str = "league_2026") -> ScenarioSpec:
    cars = {f"V{i}": VehiclePlacement(type="roboracer") for i in range(1, vehicles + 1)}
    return ScenarioSpec(map="practice", vehicles=cars, race=RaceSpec(rules=rules), tick=0.025)


@pytest.fixture(scope="module")
def shared() -> World:
    return autodrive.make(spec())


@pytest.fixture
def world(shared: World) -> World:
    shared.reset()
    return shared


def straight(frame: Frame) -> dict[str, Command]:
    return {name: Command(throttle=0.2) for name in frame.vehicles}


def test_a_car_that_hits_the_wall_stands_at_its_last_checkpoint_in_the_frame_of_the_collision(world: World) -> None:
    events: list[Event] = []
    while not any(isinstance(event, SetBack) for event in events):
        events += world.step(straight(world.frame)).events
    frame = world.frame
    assert [type(event) for event in events] == [CheckpointPassed, Collision, SetBack]  # no penalty in the warm-up
    car = frame.vehicles["V1"]
    assert world.race is not None
    x, y, yaw = world.race.track.pose_at(world.race.track.length / world.race.checkpoints)
    root = x - 0.16 * math.cos(yaw), y - 0.16 * math.sin(yaw)
    assert car.pose.position[:2] == pytest.approx(root, abs=1e-4)  # of the direction at a corner of the line
    assert math.cos(euler_from_quaternion(car.pose.orientation)[2] - yaw) == pytest.approx(1.0)
    assert not car.velocity.any()
    assert car.race is not None
    assert car.race.lap_time == frame.time  # the lap timer goes on
    assert (car.race.collision_count, car.collision_count) == (0, 1)


def test_two_cars_that_touch_stand_side_by_side_at_the_checkpoint_of_the_leading_car() -> None:
    """V1 passes checkpoint 1 and stands, to the left of the centre line; V2 drives into it from behind."""
    world = autodrive.make(spec(vehicles=2))
    assert world.race is not None
    track = world.race.track
    length = track.length / world.race.checkpoints
    world.teleport("V1", *track.pose_at(length - 0.3, 0.1))
    world.teleport("V2", *track.pose_at(length - 2.0))
    for _ in range(40):
        world.step({"V1": Command(throttle=0.05), "V2": Command()})
    backs: list[SetBack] = []
    while not backs:
        events = world.step({"V1": Command(), "V2": Command(throttle=0.05)}).events
        backs = [event for event in events if isinstance(event, SetBack)]
    assert [event.checkpoint for event in backs] == [1, 1]
    for name, side in (("V1", 0.236), ("V2", -0.236)):
        car = world.frame.vehicles[name]
        at, lateral = track.project(*car.pose.position[:2])
        assert (at - length, lateral) == pytest.approx((-0.16, side), abs=0.01), name
        assert not car.velocity.any()
        assert car.race is not None
        assert car.collision_count == 1


def test_a_snapshot_in_the_middle_of_a_race_has_the_same_future(world: World) -> None:
    digests(world, 70, straight)
    saved = world.save()
    future = digests(world, 60, straight)  # with a collision and a set-back
    world.restore(saved)
    assert digests(world, 60, straight) == future
    other = autodrive.make(spec())
    other.restore(saved)
    assert digests(other, 60, straight) == future
    with pytest.raises(SnapshotError, match="another world"):
        autodrive.make(spec(rules="practice")).restore(saved)


def test_a_race_changes_no_bit_of_the_drive_until_it_moves_a_car(world: World) -> None:
    practice = autodrive.make(spec(rules="practice"))
    for _ in range(70):
        world.step(straight(world.frame))
        practice.step(straight(practice.frame))
    one, other = world.frame, practice.frame
    for name in ("pose", "wheels", "lidar", "imu"):
        assert digest(getattr(one.vehicles["V1"], name)) == digest(getattr(other.vehicles["V1"], name))


def test_a_car_that_retires_is_parked_beside_the_track_and_obeys_nobody() -> None:
    world = autodrive.make(spec(vehicles=2))
    world.retire("V2", "its script died")
    (event,) = world.frame.events
    assert isinstance(event, RaceStatusChanged)
    assert (event.vehicle, event.reason) == ("V2", "its script died")
    place = world.frame.vehicles["V2"].pose.position
    for _ in range(60):
        world.step(straight(world.frame))
    first, second = world.frame.vehicles.values()
    assert first.race is not None
    assert second.race is not None
    assert (first.race.rank, second.race.rank, second.race.status) == (1, 2, RaceStatus.RETIRED)
    assert second.pose.position == pytest.approx(place, abs=1e-3)
    assert first.speed > 1.0
    world.retire("V2", "again")
    assert second.race.status == RaceStatus.RETIRED


def test_after_a_set_back_a_car_waits_for_its_restart_and_laps_are_timed_on_every_track() -> None:
    world = autodrive.make(spec(rules="head_to_head"))
    command = {"V1": Command(throttle=0.2)}  # the same all the time, which must not keep it from driving off
    while world.time < 3.0 - 1e-9:
        world.step(command)  # the cars stand before the start
    assert abs(world.frame.vehicles["V1"].speed) < 0.01
    frame = world.step(command)
    while not any(isinstance(event, RacePenalty) for event in frame.events):
        frame = world.step(command)
    back = frame.time
    while world.time < back + 1.9:
        frame = world.step(command)
        assert abs(frame.vehicles["V1"].speed) < 0.01
    for _ in range(20):
        frame = world.step(command)
    assert frame.vehicles["V1"].speed > 0.5
    bare = ScenarioSpec(map="practice", vehicles={"V1": VehiclePlacement(type="roboracer")})
    state = autodrive.make(bare).frame.vehicles["V1"].race
    assert state is not None
    assert state.lap_total == 0


def test_wrong_races_are_refused() -> None:
    with pytest.raises(SpecError, match=r"race: map 'plane' is not a track"):
        autodrive.make(ScenarioSpec(race=RaceSpec()))
    with pytest.raises(SpecError, match="ruleset 'leage_2026' is not known"):
        autodrive.make(ScenarioSpec(map="practice", race=RaceSpec(rules="leage_2026")))
    with pytest.raises(CommandError, match="no race"):
        autodrive.make("plane").retire("V1")
