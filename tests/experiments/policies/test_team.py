"""Policies that were trained here drive all cars of the tasks of several cars."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.cli.app import app
from autodrive.experiments.envs.rendered_world import RenderedWorld
from autodrive.experiments.envs.task import CarReadings
from autodrive.experiments.policies import Policy
from autodrive.experiments.policies.racer import PolicyRacer
from autodrive.experiments.policies.team import Act, Team, drive, duel_team, learnt_team, program, show
from tests.support.command_line import refused
from tests.support.waiting import free_port


@pytest.mark.slow
def test_the_included_policy_drives_four_cars_through_the_crossing() -> None:
    """The share that the documentation states over 1,000 episodes, less three standard deviations of 100 episodes."""
    team = learnt_team(Policy.find("crossing"))
    results = drive(team, 100, seed=0)
    assert results.is_success.mean() > 0.95
    assert results.is_success.all(axis=1).mean() > 0.91
    assert (results.has_collided == results.is_at_fault).all()
    alone = show(team, 1, seed=3, mode=None)
    assert all(np.array_equal(one[3:4], other) for one, other in zip(results, alone, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("rival", "wins", "collisions"), [("race", 0.46, 0.02), ("follow_the_gap", 0.95, 0.05)])
def test_the_included_policy_races_in_duels_as_documented(rival: str, wins: float, collisions: float) -> None:
    """In the first 40 of the races that the documentation counts: with one more loss or two, it fails."""
    examples = Path(__file__).parents[3] / "examples" / "racing"
    other = Policy.find("race") if rival == "race" else program(examples / f"{rival}.py")
    results = drive(duel_team(Policy.find("head_to_head"), other, has_noise=True), 40, seed=0)
    assert results.is_success[:, 0].mean() >= wins
    assert results.has_collided.any(axis=1).mean() <= collisions


def test_two_policies_race_with_the_same_bits_in_one_world_and_in_many() -> None:
    policy = Policy.find("race")
    team = duel_team(policy, policy, laps=1, has_noise=True)
    results = drive(team, 2, seed=5)
    assert np.array_equal(results, show(team, 2, seed=5, mode=None))
    assert (results.is_success.sum(axis=1) == ~results.has_collided.any(axis=1)).all()  # one wins, unless they collide


def test_the_car_that_drives_into_one_ahead_is_at_fault() -> None:
    """V1 stands; V2, which starts behind it with these seeds, drives to it."""
    task = duel_team(Policy.find("race"), Policy.find("race")).task

    def start(_: int) -> Act:
        def act(_: np.ndarray, cars: CarReadings) -> Floats:
            (x, y, _), (w, _, _, z) = cars.position[0] - cars.position[1], cars.orientation[1]
            angle = np.arctan2(y, x) - 2.0 * np.arctan2(z, w)
            return np.array([[0.0, 0.0], [0.05, np.clip(np.sin(angle) * 2.0, -1.0, 1.0)]])

        return act

    results = show(Team(task, start), 3, seed=1, mode=None)
    assert results.has_collided.all()
    assert results.is_at_fault.tolist() == [[False, True]] * 3
    assert not results.is_success.any()


def test_an_unstable_physics_ends_the_episode_of_both_cars(monkeypatch: pytest.MonkeyPatch) -> None:
    """No driver sees numbers that are not finite."""
    seen: list[np.ndarray] = []

    def start(_: int) -> Act:
        def act(observations: np.ndarray, _: CarReadings) -> Floats:
            seen.append(observations)
            return np.zeros((2, 2))

        return act

    def diverge(rendered: RenderedWorld, *step: Any) -> Any:
        if len(seen) == 3:
            rendered.world.compiled.state.qvel[0] = math.nan
        return move(rendered, *step)

    move = RenderedWorld.step
    monkeypatch.setattr(RenderedWorld, "step", diverge)
    results = show(Team(duel_team(Policy.find("race"), Policy.find("race")).task, start), 1, mode=None)
    assert len(seen) == 3
    assert np.isfinite(seen).all()
    assert not results.is_success.any()


def test_a_policy_of_another_task_is_refused() -> None:
    with pytest.raises(SpecError, match="the policy was trained for 'time_trial', not for 'crossing'"):
        learnt_team(Policy.find("race"))
    with pytest.raises(SpecError, match="the policy was trained for 'crossing', not for a race"):
        duel_team(Policy.find("race"), Policy.find("crossing"))


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ("crossing --laps 3", "--laps has no meaning in the task 'crossing'"),
        ("crossing --noise", "--noise has no meaning in the task 'crossing'"),
        ("crossing --rival race", "--rival has no meaning in the task 'crossing'"),
        ("crossing --headless --port 8730", "--port has no meaning in the task 'crossing' without the page"),
        ("duel -o folder", "--output has no meaning in the task 'duel'"),
        ("duel network.onnx --laps 3", "--laps has no meaning in the task 'duel'"),
        ("duel network.onnx --rival race", "--rival: a network (.onnx) drives in the published task, against another"),
        ("duel --rival network.onnx", "--rival: a network (.onnx) drives in the published task, against another"),
        ("duel crossing", "the policy was trained for 'crossing', not for a race"),
        ("duel --rival none.py", "none.py does not exist, or has no function command(ranges, angles)"),
        ("race practice --episodes 2", "--episodes has no meaning on a track"),
        ("race --laps 2", "--laps has no meaning for a policy without a track"),
    ],
)
def test_an_option_without_a_meaning_is_refused(arguments: str, error: str) -> None:
    assert error in refused("play", *arguments.split())


def test_the_page_of_a_crossing_is_on_its_port_and_need_not_run_in_real_time() -> None:
    port = free_port()
    command = ["play", "crossing", "--port", str(port), "--lockstep", "--episodes", "1", "--seed", "3"]
    output = CliRunner().invoke(app, command, catch_exceptions=False).output
    assert f":{port}" in output
    assert re.search(r"episode 1: \d of 4 cars succeeded\n1 episode: [\d.]+% of the cars", output)


def test_a_duel_has_laps_and_noise() -> None:
    policy, seen = Policy.find("race"), []

    def ranges(laps: int, has_noise: bool) -> list[Floats]:
        racer = PolicyRacer(policy)

        def act(observations: np.ndarray, cars: CarReadings) -> Floats:
            seen[-1].append(cars.lidar_ranges[0].copy())
            return racer.act_all(observations, cars)

        seen.append([])
        show(duel_team(act, policy, laps=laps, has_noise=has_noise), 1, mode=None)
        return seen[-1]

    exact, noisy, longer = ranges(1, False), ranges(1, True), ranges(2, False)
    assert 1.7 < len(longer) / len(exact) < 2.3
    error = noisy[0] - exact[0]
    assert 0.003 < np.std(error[np.isfinite(error)]) < 0.03  # 10 mm, see docs/learning.md


def test_the_command_says_who_won() -> None:
    command = ["play", "duel", "--headless", "--episodes", "2", "--laps", "1", "--rival", "race"]
    output = CliRunner().invoke(app, command, catch_exceptions=False).output
    cars = r"V\d won [\d.]+%, collided in [\d.]+%, by its own fault in [\d.]+%"
    assert re.fullmatch(rf"2 episodes: {cars}; {cars}\n", output)
