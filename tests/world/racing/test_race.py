"""The scorer of races on closed-form motion, and the published results of the league."""

from __future__ import annotations

import json
import math
from typing import TypeVar

import numpy as np
import pytest
from msgspec.structs import replace

from autodrive.protocol.messages import (
    CheckpointPassed,
    Collision,
    Event,
    LapCompleted,
    RacePenalty,
    RaceStatus,
    RaceStatusChanged,
    SetBack,
    WrongWay,
)
from autodrive.scenario.tracks import Track
from autodrive.world.racing import Move, Race, RaceRules, load_rules
from autodrive.world.racing.race import ROOT
from autodrive.world.racing.results import RaceRecorder, RaceResult
from tests.protocol.devkit_frames import frame, vehicle

T = TypeVar("T")

RADIUS = 5.0
TICK = 0.01
LENGTH = 2.0 * math.pi * RADIUS


def circle(points: int = 2000) -> Track:
    """A circle around the origin, to the left; its start line is on the x axis, its length within 0.1 mm of 2 pi r."""
    angle = 2.0 * np.pi * np.arange(points) / points
    xy = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    return Track("circle", np.column_stack([xy, np.full((points, 2), 0.6)]))


CIRCLE = circle()


class Drive:
    """Points that move on the circle as functions of time say: angle [rad], radius [m]."""

    def __init__(self, rules: RaceRules, *starts: float) -> None:
        self.race = Race([f"V{i}" for i in range(1, len(starts) + 1)], CIRCLE, rules, TICK)
        self.angle = list(starts)
        self.radius = RADIUS
        self.tick = 0
        self.events: list[Event] = []
        self.moves: list[Move] = []
        self.race.reset(self.positions)

    @property
    def positions(self) -> np.ndarray:
        return np.array([[self.radius * math.cos(a), self.radius * math.sin(a), 0.0] for a in self.angle])

    @property
    def time(self) -> float:
        return self.tick * TICK

    def run(self, duration: float, *speeds: float, happened: tuple[Event, ...] = ()) -> None:
        """Drive at these speeds [m/s]; `happened` in the last tick."""
        ticks = round(duration / TICK)
        for k in range(ticks):
            self.tick += 1
            self.angle = [a + v * TICK / RADIUS for a, v in zip(self.angle, speeds, strict=True)]
            events, moves = self.race.judge(self.time, self.positions, happened if k == ticks - 1 else ())
            self.events += events
            self.moves += moves

    def of(self, kind: type[T]) -> list[T]:
        return [event for event in self.events if isinstance(event, kind)]


def hit(vehicle: str, other: str = "wall") -> Collision:
    return Collision(0.0, vehicle, other, 1.0, np.zeros(3))


def test_times_of_a_point_at_constant_speed_are_those_of_the_formula() -> None:
    """At v a lap takes 2 pi r / v; checkpoints divide it equally, and none of these instants is a tick."""
    speed, start = 4.7, 0.3  # starts 0.3 m before the line, which does not count
    drive = Drive(RaceRules(race_laps=3, checkpoint_distance=4.0), -start / RADIUS)
    drive.run(30.0, speed)
    count = round(LENGTH / 4.0)
    assert drive.race.checkpoints == count == 8
    passed = drive.of(CheckpointPassed)
    expected = [(start + LENGTH * (k + 1) / count) / speed for k in range(3 * count)]
    # the chord of a tick is 1.1e-5 m beside the circle, and the line has 2000 corners: well below 0.01 ms
    assert [event.time for event in passed] == pytest.approx(expected, abs=1e-5)
    assert [(event.lap, event.checkpoint) for event in passed] == [
        (lap, number) for lap in (1, 2, 3) for number in range(1, count + 1)
    ]
    assert [event.sector_time for event in passed[1:]] == pytest.approx(
        [LENGTH / count / speed] * (3 * count - 1), abs=1e-5
    )
    laps = drive.of(LapCompleted)
    assert [event.lap_time for event in laps] == pytest.approx(
        [(LENGTH + start) / speed, LENGTH / speed, LENGTH / speed], abs=1e-5
    )
    (end,) = drive.of(RaceStatusChanged)
    assert (end.status, end.time) == (RaceStatus.FINISHED, laps[-1].time)
    (state,) = drive.race.states(drive.time)
    assert state.race_time == pytest.approx((3.0 * LENGTH + start) / speed, abs=1e-5)
    assert (state.best_lap_time, state.last_lap_time) == pytest.approx((LENGTH / speed,) * 2, abs=1e-5)
    assert (state.lap_count, state.rank, state.gap, drive.race.is_over) == (3, 1, 0.0, True)


def test_only_the_laps_after_the_warm_up_count() -> None:
    rules = load_rules("league_2026")
    drive = Drive(rules, 0.0)
    drive.run(0.9 * LENGTH, 1.0)
    before = drive.race.states(drive.time)[0]
    assert (before.race_time, before.lap_total) == (0.0, 11)
    assert before.lap_time == pytest.approx(drive.time)
    drive.run(0.1 * LENGTH + 12.0 * LENGTH / 5.0, 5.0)
    laps = drive.of(LapCompleted)
    assert [event.is_counted for event in laps] == [False] + 10 * [True]
    (state,) = drive.race.states(drive.time)
    assert state.race_time == pytest.approx(10.0 * LENGTH / 5.0, abs=1e-4)
    assert state.best_lap_time == pytest.approx(LENGTH / 5.0, abs=1e-5)


def test_a_checkpoint_that_was_missed_leaves_the_lap_open() -> None:
    drive = Drive(RaceRules(race_laps=5, checkpoint_distance=4.0), 0.0)
    drive.run(0.3 * LENGTH / 4.0, 4.0)
    drive.radius = 3.0  # 2 m beside the centre line, where the track is 0.6 m wide
    drive.run(0.4 * LENGTH / 4.0, 4.0)
    drive.radius = RADIUS
    drive.run(0.5 * LENGTH / 4.0, 4.0)  # over the finish line
    assert not drive.of(LapCompleted)
    assert drive.race.states(drive.time)[0].distance == pytest.approx(0.375 * LENGTH)  # held at the missed one
    drive.run(LENGTH / 4.0, 4.0)
    assert len(drive.of(LapCompleted)) == 1


def test_a_vehicle_that_is_placed_behind_a_checkpoint_has_not_passed_it() -> None:
    drive = Drive(RaceRules(checkpoint_distance=4.0), 0.0)
    drive.run(0.5, 4.0)
    drive.angle = [drive.angle[0] + 0.5]  # 2.5 m
    drive.run(0.1, 4.0)
    assert not drive.events
    drive.angle = [0.0]
    drive.race.moved(0, drive.positions)
    drive.run(1.0, 4.0)
    assert [event.checkpoint for event in drive.of(CheckpointPassed)] == [1]


def test_collisions_cost_ten_seconds_and_set_back_and_the_eleventh_disqualifies() -> None:
    rules = load_rules("league_2026")
    drive = Drive(rules, 0.0)
    drive.run(0.5, 4.0, happened=(hit("V1"),))  # in the warm-up lap: set back to the start, free of charge
    assert drive.moves.pop().poses[0] == pytest.approx((RADIUS, -ROOT, math.pi / 2))
    assert not drive.of(RacePenalty)
    drive.run(LENGTH / 4.0, 4.0)
    for n in range(1, 11):
        drive.run(0.2, 4.0, happened=(hit("V1"), hit("V1", "box_1")))  # two contacts in a tick are one collision
        state = drive.race.states(drive.time)[0]
        assert (state.collision_count, state.penalty, state.status) == (n, 10.0 * n, RaceStatus.RACING)
    back = drive.of(SetBack)[-1]
    x, y, yaw = drive.moves[-1].poses[0]
    x, y = x + ROOT * math.cos(yaw), y + ROOT * math.sin(yaw)
    at = 2.0 * math.pi * back.checkpoint / drive.race.checkpoints
    assert (x, y) == pytest.approx((RADIUS * math.cos(at), RADIUS * math.sin(at)), abs=1e-4)
    assert yaw == pytest.approx(math.remainder(at + math.pi / 2, math.tau), abs=2e-3)  # of a segment of the line
    drive.run(0.2, 4.0, happened=(hit("V1"),))
    (end,) = drive.of(RaceStatusChanged)
    assert (end.status, end.reason) == (RaceStatus.DISQUALIFIED, "more than 10 collisions")
    throttle = np.ones(1)
    drive.race.restrain(drive.time, throttle)
    assert throttle[0] == 0.0


@pytest.mark.parametrize(
    ("race_time", "collisions", "adjusted"),
    [(128.63, 10, 228.63), (110.27, 0, 110.27), (78.19, 0, 78.19)],
    ids=["classified with ten collisions", "ICRA 2026", "CDC 2025"],
)
def test_published_results_of_the_league(race_time: float, collisions: int, adjusted: float) -> None:
    rules = load_rules("league_2026")
    assert rules.adjusted_time(race_time, collisions) == pytest.approx(adjusted, abs=1e-9)
    assert not rules.is_disqualified_by(collisions)
    assert rules.is_disqualified_by(11)
    drive = Drive(rules, 0.0)
    speed = 10.0 * LENGTH / race_time
    drive.run(LENGTH / speed + 0.02, speed)  # the warm-up lap
    for _ in range(collisions):
        drive.run(0.1, speed, happened=(hit("V1"),))
    drive.run(race_time, speed)
    (state,) = drive.race.states(drive.time)
    assert state.status == RaceStatus.FINISHED
    assert state.race_time + state.penalty == pytest.approx(adjusted, abs=1e-3)


def test_ranks_and_gaps_of_a_race_of_two() -> None:
    drive = Drive(RaceRules(race_laps=2, checkpoint_distance=4.0, start_delay=1.0), 0.0, -0.2)
    throttle = np.ones(2)
    drive.race.restrain(0.0, throttle)
    assert not throttle.any()
    drive.run(1.0, 0.0, 0.0)
    assert [event.status for event in drive.of(RaceStatusChanged)] == [RaceStatus.RACING] * 2
    drive.run(LENGTH / 4.0, 4.0, 5.0)
    first, second = drive.race.states(drive.time)
    assert (first.rank, second.rank) == (2, 1)
    # at its last checkpoint, 7 of 8, V1 was behind by the difference of the times for that distance
    at = 7.0 / 8.0 * LENGTH
    assert first.gap == pytest.approx(at / 4.0 - (at + 0.2 * RADIUS) / 5.0, abs=1e-4)
    drive.run(LENGTH, 4.0, 5.0)
    first, second = drive.race.states(drive.time)
    assert first.race_time == pytest.approx(2.0 * LENGTH / 4.0, abs=1e-4)
    assert second.race_time == pytest.approx((2.0 * LENGTH + 0.2 * RADIUS) / 5.0, abs=1e-4)
    assert first.gap == pytest.approx(first.race_time - second.race_time, abs=1e-9)


@pytest.mark.parametrize(("behind", "guilty"), [(0.5, ["V2"]), (0.1, ["V1", "V2"])])
def test_the_vehicle_behind_pays_for_a_contact(behind: float, guilty: list[str]) -> None:
    rules = RaceRules(race_laps=2, collision_penalty=10.0)
    drive = Drive(rules, 0.0, -behind / RADIUS)
    drive.run(0.3, 4.0, 4.0, happened=(hit("V1", "V2"), hit("V2", "V1")))
    assert [event.vehicle for event in drive.of(RacePenalty)] == guilty


def test_the_wrong_way_is_reported_once_and_disqualifies_after_the_limit() -> None:
    drive = Drive(RaceRules(wrong_way_limit=3.0, checkpoint_distance=4.0), 0.0)
    drive.run(1.0, 2.0)
    drive.run(0.2, -2.0)
    assert not drive.of(WrongWay)
    drive.run(0.5, -2.0)
    assert len(drive.of(WrongWay)) == 1
    assert drive.race.states(drive.time)[0].is_wrong_way
    drive.run(0.3, 2.0)
    assert not drive.race.states(drive.time)[0].is_wrong_way
    drive.run(1.6, -2.0)
    assert [event.reason for event in drive.of(RaceStatusChanged)] == ["more than 3 m the wrong way"]


def test_a_vehicle_that_stands_or_is_too_slow_retires_and_is_parked_beside_the_track() -> None:
    drive = Drive(RaceRules(race_laps=9, standstill_limit=5.0, time_limit=20.0), 0.0, -0.3)
    drive.run(6.0, 4.0, 0.0)
    (end,) = drive.of(RaceStatusChanged)
    assert (end.vehicle, end.status, end.time) == ("V2", RaceStatus.RETIRED, pytest.approx(5.0))
    ((vehicle, poses),) = drive.moves
    assert vehicle == 1
    assert math.hypot(*poses[0][:2]) > RADIUS + 0.6
    drive.run(15.0, 4.0, 0.0)
    assert drive.of(RaceStatusChanged)[-1].reason == "not finished after 20 s"
    assert drive.race.is_over


@pytest.mark.parametrize("rules", ["league_2026", "head_to_head"])
def test_after_restore_the_same_motion_gives_the_same_events(rules: str) -> None:
    drive = Drive(load_rules(rules), 0.0, -0.2)
    drive.run(9.0, 4.0, 4.5, happened=(hit("V1"),))
    saved, angle, tick = drive.race.save(), list(drive.angle), drive.tick
    results = []
    for _ in range(2):
        drive.race.restore(saved)
        drive.angle, drive.tick, drive.events = list(angle), tick, []
        drive.run(0.1, 4.0, 4.5, happened=(hit("V1", "V2"), hit("V2", "V1")))
        drive.run(30.0, 4.0, 4.5, happened=(hit("V2"),))
        results.append((repr(drive.events), repr(drive.race.states(drive.time))))
    assert results[0] == results[1]
    assert "LapCompleted" in results[0][0]


@pytest.mark.parametrize("seed", range(8))
def test_a_missed_checkpoint_is_made_good_as_in_the_program_of_the_league(seed: int) -> None:
    """Random checkpoints are missed, against the published rule of the program, written here once more.

    Entering checkpoint n sets the count to n if the checkpoint left last was n - 1; entering the finish line with a
    count of at least (number - 1) counts a lap.
    """
    rng = np.random.default_rng(seed)
    drive = Drive(RaceRules(race_laps=0, checkpoint_distance=4.0, missed_checkpoint="made_good"), 0.0)
    number = drive.race.checkpoints
    drive.run(0.1, 1.0)
    count = left = laps = 0
    for step in range(1, 12 * number):
        is_missed = bool(rng.random() < 0.2)
        drive.radius = 3.0 if is_missed else RADIUS
        drive.run(LENGTH / number, 1.0)  # over the next checkpoint, 0.1 m beyond
        checkpoint = step % number
        if not is_missed:
            if checkpoint == 0:
                laps, count = (laps + 1, 0) if count >= number - 1 else (laps, count)
            elif left == checkpoint - 1:
                count = checkpoint
            left = checkpoint
        state = drive.race.states(drive.time)[0]
        assert (state.lap_count, state.checkpoint) == (laps, count)
    assert 0 < laps < 11  # some laps counted, and some did not


def test_the_next_two_checkpoints_make_a_missed_one_good_and_its_sector_has_no_time() -> None:
    drive = Drive(load_rules("league_2026"), 0.0)
    speed, number = 4.0, drive.race.checkpoints
    drive.run(2.5 / number * LENGTH / speed, speed)
    drive.radius = 3.0
    drive.run(1.0 / number * LENGTH / speed, speed)  # beside checkpoint 3
    drive.radius = RADIUS
    drive.run(1.0 / number * LENGTH / speed, speed)
    assert drive.race.states(drive.time)[0].checkpoint == 2  # one after the missed one is not enough
    drive.run(1.0 / number * LENGTH / speed, speed)
    assert drive.race.states(drive.time)[0].checkpoint == 5
    drive.run(0.6 * LENGTH / speed, speed)
    assert [event.checkpoint for event in drive.of(CheckpointPassed)][:6] == [1, 2, 5, 6, 7, 8]
    (lap,) = drive.of(LapCompleted)
    assert lap.lap_time == pytest.approx(LENGTH / speed, abs=1e-5)
    recorder = RaceRecorder()
    state = drive.race.states(drive.time)[0]
    sent = replace(frame(), vehicles={"V1": vehicle(race=state)}, events=tuple(drive.events))
    recorder.publish(sent)
    (standing,) = recorder.standings(["a team"])
    sectors = standing.laps[0].sectors
    assert (sectors[2:4], sectors[4]) == ([None, None], pytest.approx(3.0 / number * LENGTH / speed, abs=1e-5))
    result = RaceResult("1", "circle", LENGTH, "league_2026", "", True, 0, 9.0, 9.0, "", [standing])
    assert result.laps_csv().splitlines()[1].split(",")[6:12] == [
        *("" if value is None else f"{value:.4f}" for value in sectors[:6]),
    ]
    lap, best = (json.loads(result.to_json())["standings"][0][key] for key in ("laps", "best_lap"))
    assert (lap[0]["sectors"][2], best) == (None, None)  # the lap of the warm-up is no best lap


def test_reversing_over_the_finish_line_and_coming_back_is_no_lap() -> None:
    """The last two checkpoints and the finish line are crossed in order, but the car has not been around the track."""
    drive = Drive(load_rules("league_2026"), 0.0)
    drive.run(LENGTH / 4.0 + 0.1, 4.0)
    drive.run(3.0, -4.0)
    drive.run(3.0, 4.0)
    assert len(drive.of(LapCompleted)) == 1
    drive.run(LENGTH / 4.0, 4.0)
    assert len(drive.of(LapCompleted)) == 2


def test_there_is_no_last_and_no_best_lap_until_there_is_one() -> None:
    drive = Drive(load_rules("league_2026"), 0.0)
    drive.run(1.0, 4.0)
    state = drive.race.states(drive.time)[0]
    assert (state.last_lap_time, state.best_lap_time) == (math.inf, math.inf)
    drive.run(LENGTH / 4.0, 4.0)
    state = drive.race.states(drive.time)[0]
    assert state.last_lap_time == pytest.approx(LENGTH / 4.0, abs=1e-4)
    assert state.best_lap_time == math.inf  # the lap of the warm-up does not count


def test_a_car_that_was_set_back_crosses_its_checkpoint_again_without_passing_it_twice() -> None:
    drive = Drive(load_rules("league_2026"), 0.0)
    drive.run(1.2 * LENGTH / 8 / 4.0, 4.0, happened=(hit("V1"),))
    ((_, poses),) = drive.moves
    drive.angle = [math.atan2(poses[0][1], poses[0][0])]
    assert drive.angle[0] == pytest.approx(math.tau / 8 - ROOT / RADIUS, abs=1e-4)
    drive.race.moved(0, drive.positions)
    drive.run(1.2 * LENGTH / 8 / 4.0, 4.0)
    assert [event.checkpoint for event in drive.of(CheckpointPassed)] == [1, 2]


def test_collisions_with_boxes_count_only_where_the_rules_say_so() -> None:
    for name, count in (("league_2026", 0), ("head_to_head", 0), ("practice", 1)):
        rules = load_rules(name).model_copy(update={"warm_up_laps": 0, "start_delay": 0.0})
        race = Race(["V1"], CIRCLE, rules, TICK, boxes=["box_1"])
        positions = np.array([[RADIUS, 0.0, 0.0]])
        race.reset(positions)
        race.judge(TICK, positions, [hit("V1", "box_1")])
        assert race.states(TICK)[0].collision_count == count
        race.judge(2 * TICK, positions, [hit("V1", "wall_1_1")])
        assert race.states(TICK)[0].collision_count == count + 1


def test_two_cars_that_touch_are_set_side_by_side_and_touch_again_only_after_they_were_apart() -> None:
    rules = load_rules("league_2026").model_copy(update={"warm_up_laps": 0})
    drive = Drive(rules, 0.0, -0.3 / RADIUS)
    touch = hit("V1", "V2"), hit("V2", "V1")
    drive.run(1.1 * LENGTH / 8 / 4.0, 4.0, 4.0)  # V1 has passed checkpoint 1, V2 has it 0.1 m behind it
    drive.run(TICK, 4.0, 4.0, happened=touch)
    assert [(event.vehicle, event.checkpoint) for event in drive.of(SetBack)] == [("V1", 1), ("V2", 1)]
    at = math.tau / 8
    sides = []
    for _, poses in drive.moves:
        x, y, yaw = poses[0]
        assert yaw == pytest.approx(at + math.pi / 2, abs=2e-3)
        away = np.array([x, y]) - RADIUS * np.array([math.cos(at), math.sin(at)])
        assert away @ [-math.sin(at), math.cos(at)] == pytest.approx(-ROOT, abs=1e-3)
        sides.append(-away @ [math.cos(at), math.sin(at)])
    assert sorted(sides) == pytest.approx([-0.236, 0.236], abs=1e-3)
    counts = [state.collision_count for state in drive.race.states(drive.time)]
    assert counts == [1, 1]
    assert [event.duration for event in drive.of(RacePenalty)] == [10.0, 10.0]  # of the written rules
    drive.run(0.5, 4.0, 4.0, happened=touch)  # 0.3 m apart
    drive.run(TICK, 4.0, 4.0, happened=touch)
    assert [state.collision_count for state in drive.race.states(drive.time)] == [1, 1]
    drive.run(1.0, 4.0, 3.3)  # 1.0 m apart, more than 4 track widths
    drive.run(TICK, 4.0, 3.3, happened=touch)
    assert [state.collision_count for state in drive.race.states(drive.time)] == [2, 2]
