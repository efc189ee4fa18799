"""Policies: their numbers against NumPy, their files, what they read, and how they drive."""

from __future__ import annotations

import io
import itertools
import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.connect.devkit import Server
from autodrive.experiments.envs.episodes import Episodes, observed
from autodrive.experiments.envs.task import CarReadings
from autodrive.experiments.envs.time_trial import TimeTrial
from autodrive.experiments.policies import Policy, PolicyMemory
from autodrive.experiments.policies.policy import GREATEST, Pace, PolicyDrivers
from autodrive.experiments.policies.racer import INPUTS, PERIOD, PolicyRacer, drive_laps, sectors
from autodrive.physics.sensors.settings import SensorSettings
from autodrive.protocol.messages import Command
from autodrive.run.play import responder
from autodrive.run.race import RaceOptions, race
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from tests.support.command_line import call, refused


def random_policy(seed: int = 1, inputs: tuple[str, ...] = INPUTS, width: int = 16) -> Policy:
    rng = np.random.default_rng(seed)
    sizes = (len(inputs), width, width, 2)
    layers = tuple(
        (rng.normal(0.0, 0.4, (out, into)).astype(np.float32), rng.normal(0.0, 0.1, out).astype(np.float32))
        for into, out in itertools.pairwise(sizes)
    )
    return Policy("time_trial", inputs, (0.2,) * len(inputs), (0.0, 0.4), layers, {"seed": seed})


@given(st.integers(0, 1000))
@settings(deadline=None, max_examples=20)
def test_the_outputs_are_those_of_matrices_in_numpy(seed: int) -> None:
    policy = random_policy(seed)
    features = np.random.default_rng(seed).uniform(-10.0, 10.0, len(INPUTS))
    values = 0.2 * features
    for weight, bias in policy.layers[:-1]:
        values = np.tanh(weight.astype(float) @ values + bias)
    weight, bias = policy.layers[-1]
    drive, steer = np.clip(weight.astype(float) @ values + bias, -1.0, 1.0)
    assert policy.outputs(features) == pytest.approx((drive, steer), abs=1e-12)
    assert PolicyDrivers(policy, INPUTS).act(features)[0] == pytest.approx((0.2 * (drive + 1.0), steer), abs=1e-12)


@given(st.floats(0.5, 2.0))
@settings(deadline=None, max_examples=20)
def test_a_slower_policy_does_at_lower_speeds_what_the_policy_does(factor: float) -> None:
    inputs = (*INPUTS, "wheel_speed@2", "yaw_rate@1", "range_2.5@3", "steer@1", "drive@1")
    policy = random_policy(inputs=inputs)
    driver, slower = PolicyDrivers(policy, INPUTS), PolicyDrivers(policy.slower(factor), INPUTS)
    is_speed = np.isin(INPUTS, ("wheel_speed", "yaw_rate"))
    for readings in np.random.default_rng(5).uniform(0.0, 3.0, (6, len(INPUTS))):
        throttle, steering = driver.act(readings)[0]
        slow = slower.act(np.where(is_speed, readings / factor, readings))[0]
        assert slow == pytest.approx((throttle / factor, steering), abs=1e-9)


@pytest.mark.parametrize("factor", [0.0, -1.0, 11.0, float("nan")])
def test_a_policy_is_not_slower_by_any_factor(factor: float) -> None:
    with pytest.raises(AutodriveError, match=r"must be from 0\.1 to 10, not"):
        random_policy().slower(factor)


def test_large_numbers_saturate() -> None:
    policy = random_policy()
    for sign in (-1.0, 1.0):
        throttle, steering = PolicyDrivers(policy, INPUTS).act(np.full(len(INPUTS), sign * 1e30))[0]
        assert 0.0 <= throttle <= 0.4
        assert -1.0 <= steering <= 1.0


def test_a_file_has_everything(tmp_path: Path) -> None:
    policy = random_policy()
    policy.save(tmp_path / "policy.npz")
    loaded = Policy.load(tmp_path / "policy.npz")
    features = np.linspace(-1.0, 1.0, len(INPUTS))
    assert loaded.outputs(features).tolist() == policy.outputs(features).tolist()
    for name in ("task", "inputs", "scale", "throttle", "training"):
        assert getattr(loaded, name) == getattr(policy, name)


def test_a_policy_reads_the_last_moments_and_its_own_outputs() -> None:
    """In a network without layers between, whose outputs are known; at the start the first reading counts for all."""
    weight = np.array([[1.0, -0.5, 0.0], [0.25, 0.0, 0.5]], np.float32)
    policy = Policy(
        "time_trial",
        ("wheel_speed@2", "drive@1", "steer@3"),
        (1.0, 1.0, 1.0),
        (-1.0, 1.0),
        ((weight, np.zeros(2, np.float32)),),
    )
    assert policy.readings == ("wheel_speed",)
    driver = PolicyDrivers(policy, ("yaw_rate", "wheel_speed"))
    for _ in range(2):
        speeds = np.random.default_rng(1).uniform(-0.4, 0.4, 20).tolist()
        drive, steer = [0.0] * 3, [0.0] * 3
        for k, speed in enumerate(speeds):
            then = speeds[max(k - 2, 0)]
            expected = then - 0.5 * drive[-1], 0.25 * then + 0.5 * steer[-3]
            assert driver.act(np.array([9.0, speed]))[0] == pytest.approx(expected, abs=1e-6)
            drive.append(expected[0])
            steer.append(expected[1])
        driver.begin()


def test_cars_have_memories_of_their_own() -> None:
    """Each row is that of a car alone, when episodes begin at different times."""
    inputs, readings = ("a", "b@3", "drive@1", "steer@2"), ("a", "b")
    rng = np.random.default_rng(2)
    together, alone = PolicyMemory(inputs, readings, 4), [PolicyMemory(inputs, readings) for _ in range(4)]
    for k in range(40):
        given, outputs = rng.normal(size=(4, 2)), rng.normal(size=(4, 2))
        begins = rng.random(4) < 0.2 if k else np.ones(4, np.bool_)
        together.add(given)
        together.begin(given[begins], begins)
        for car, one in enumerate(alone):
            (one.begin if begins[car] else one.add)(given[car : car + 1])
            assert one.inputs[0].tolist() == together.inputs[car].tolist()
            one.put_out(outputs[car : car + 1])
        together.put_out(outputs)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("wheel_speed@0", "input 'wheel_speed@0' of the policy: after '@', write how many steps ago, 1 to 100"),
        ("wheel_speed@101", "1 to 100"),
        ("wheel_speed@x", "1 to 100"),
        ("drive", "input 'drive' of the policy is an output of the policy"),
        ("grip@2", "the policy reads grip, which is not among its readings"),
    ],
)
def test_a_moment_that_cannot_be_is_refused(name: str, message: str) -> None:
    with pytest.raises(AutodriveError, match=message):
        PolicyDrivers(random_policy(inputs=(name,)), INPUTS)


def changed(file: Path, change: Callable[[dict[str, Any], dict[str, np.ndarray]], None]) -> None:
    with np.load(file) as archive:
        arrays = dict(archive)
    about = json.loads(str(arrays.pop("about")))
    change(about, arrays)
    np.savez(file, about=np.array(json.dumps(about)), **arrays)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda about, arrays: about.update(format=3), "its format is 3; this version reads 1 and 2"),
        (lambda about, arrays: about.update(format=2), "is not a policy: 'pace'"),
        (lambda about, arrays: about.pop("inputs"), "is not a policy: 'inputs'"),
        (lambda about, arrays: about.update(scale=[1.0]), "57 inputs needs as many scales, not 1"),
        (lambda about, arrays: about.update(throttle=[0.0]), "is not a policy"),
        (
            lambda about, arrays: about.update(throttle=[-1e308, 1e308]),
            "must be two numbers from -10 to 10, not -1e\\+308",
        ),
        (lambda about, arrays: about.update(scale=[1e308] * len(about["scale"])), "scales of a policy must be numbers"),
        (
            lambda about, arrays: arrays["weight_0"].fill(3e38),
            "layer 0 of the policy has numbers that are not from -1e",
        ),
        (lambda about, arrays: arrays.pop("weight_2"), "two outputs, throttle and steering, not 16"),
        (lambda about, arrays: arrays.update(weight_1=np.zeros((16, 3))), r"shape \(16, 3\)"),
    ],
)
def test_a_wrong_file_is_one_line(
    tmp_path: Path, change: Callable[[dict[str, Any], dict[str, np.ndarray]], None], message: str
) -> None:
    file = tmp_path / "policy.npz"
    random_policy().save(file)
    changed(file, change)
    with pytest.raises(AutodriveError, match=message) as error:
        Policy.load(file)
    assert "\n" not in str(error.value)
    assert "policy.npz" in str(error.value)


def test_other_files_are_no_policies(tmp_path: Path) -> None:
    file = tmp_path / "policy.npz"
    with pytest.raises(AutodriveError, match="No such file"):
        Policy.load(file)
    random_policy().save(file)
    whole = file.read_bytes()
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as other:
        other.writestr("about.npy", b"no array")
    for data in (b"", b"text", archive.getvalue(), *(whole[: len(whole) * k // 50] for k in range(50))):
        file.write_bytes(data)
        with pytest.raises(AutodriveError, match="is not a policy"):
            Policy.load(file)


PACE_INPUTS = ("yaw_rate", "wheel_speed@3", "steer@1", "throttle@2")


def random_pace(seed: int = 3, keep: float = 0.9) -> Pace:
    rng = np.random.default_rng(seed)
    weight, last = rng.normal(0.0, 0.5, (8, 4)).astype(np.float32), rng.normal(0.0, 0.2, (2, 8)).astype(np.float32)
    layers = (weight, np.zeros(8, np.float32)), (last, np.array([1.1, -1.0], np.float32))
    return Pace(PACE_INPUTS, (0.3, 0.2, 1.0, 4.0), (0.9, 1.3), keep, layers)


def test_a_pace_makes_the_policy_slower_by_the_weighted_mean_of_its_estimates() -> None:
    """Two cars whose episodes begin at different times, against sums of matrices in NumPy, and `Policy.slower`."""
    inputs, pace = (*INPUTS, "wheel_speed@2", "yaw_rate@1", "drive@1"), random_pace()
    policy = random_policy(inputs=inputs)
    drivers = PolicyDrivers(replace(policy, pace=pace), INPUTS, 2)
    rng = np.random.default_rng(7)
    seen: list[list[np.ndarray]] = [[], []]
    done: list[list[tuple[float, ...]]] = [[], []]
    drives: list[list[float]] = [[], []]
    found = []
    for step in range(40):
        readings = rng.uniform(0.0, 4.0, (2, len(INPUTS)))
        if step == 0:
            drivers.begin_episodes(readings)
        else:
            drivers.add(readings)
        if step == 15:
            drivers.begin_episodes(readings[1:], np.array([False, True]))
            seen[1], done[1], drives[1] = [], [], []
        commands = drivers.commands()
        for car in range(2):
            seen[car].append(readings[car])
            total, weights = pace.slowness[1] * pace.keep ** len(seen[car]), pace.keep ** len(seen[car])
            for at in range(len(seen[car])):
                given = np.array(
                    [
                        seen[car][at][INPUTS.index("yaw_rate")],
                        seen[car][max(at - 3, 0)][INPUTS.index("wheel_speed")],
                        done[car][at - 1][1] if at >= 1 else 0.0,
                        done[car][at - 2][0] if at >= 2 else 0.0,
                    ]
                )
                (first, _), (last, bias) = pace.layers
                value, log_weight = last.astype(float) @ np.tanh(first.astype(float) @ (given * pace.scale)) + bias
                weight = np.exp(log_weight) * pace.keep ** (len(seen[car]) - 1 - at)
                total, weights = total + weight * value, weights + weight
            slowness = min(max(total / weights, 0.9), 1.3)
            found.append(slowness)
            assert drivers.slowness[car] == pytest.approx(slowness, rel=1e-9)
            slower = policy.slower(slowness)
            now = dict(zip(INPUTS, readings[car], strict=True))
            now |= {
                "wheel_speed@2": seen[car][max(len(seen[car]) - 3, 0)][INPUTS.index("wheel_speed")],
                "yaw_rate@1": seen[car][max(len(seen[car]) - 2, 0)][INPUTS.index("yaw_rate")],
                "drive@1": drives[car][-1] if drives[car] else 0.0,
            }
            outputs = slower.outputs(np.array([[now[name] for name in inputs]]))
            assert commands[car] == pytest.approx(slower.commands(outputs)[0], abs=1e-9)
            done[car].append(tuple(commands[car].tolist()))
            drives[car].append(float(outputs[0, 0]))
    assert min(found) == 0.9  # a limit
    assert 1.2 < max(found) < 1.3


def test_the_greatest_numbers_that_a_file_may_have_overflow_nowhere() -> None:
    """An infinity in a sum with another one would be no number, which no car can obey."""
    most = GREATEST
    layers = tuple((np.where(weight > 0, most, -most).astype("f4"), bias) for weight, bias in random_policy().layers)
    policy = replace(random_policy(), layers=layers, scale=(most,) * len(INPUTS))
    drivers = PolicyDrivers(policy, INPUTS)
    commands = [drivers.act(np.full((1, len(INPUTS)), reading)) for reading in (1e9, -1e9, 1e9)]
    assert np.isfinite(commands).all()


def test_a_pace_that_keeps_nothing_and_one_without_evidence() -> None:
    """Without weight it stays as it begins; of large numbers the weight is bounded."""
    for bias, expected in ((-1e6, 1.3), (1e6, 1.0)):
        layers = ((np.zeros((2, 4), np.float32), np.array([1.0, bias], np.float32)),)
        pace = Pace(PACE_INPUTS, (1.0,) * 4, (0.9, 1.3), 1.0, layers)
        drivers = PolicyDrivers(replace(random_policy(), pace=pace), INPUTS)
        for _ in range(3):
            drivers.act(np.ones((1, len(INPUTS))))
        assert drivers.slowness[0] == pytest.approx(expected, abs=1e-6)


def test_a_file_has_the_pace(tmp_path: Path) -> None:
    policy = replace(random_policy(), pace=replace(random_pace(), top_throttle=0.3))
    policy.save(tmp_path / "policy.npz")
    loaded = Policy.load(tmp_path / "policy.npz")
    assert loaded.pace is not None
    assert policy.pace is not None
    for name in ("inputs", "scale", "slowness", "keep", "top_throttle"):
        assert getattr(loaded.pace, name) == getattr(policy.pace, name)
    for ours, theirs in zip(loaded.pace.layers, policy.pace.layers, strict=True):
        assert all(np.array_equal(one, other) for one, other in zip(ours, theirs, strict=True))
    assert loaded.readings == policy.readings
    slower = loaded.slower(1.2)
    assert slower.pace is loaded.pace
    assert slower.throttle[1] == pytest.approx(policy.throttle[1] / 1.2)
    changed(tmp_path / "policy.npz", lambda about, arrays: about["pace"].pop("top_throttle"))  # as files were before
    earlier = Policy.load(tmp_path / "policy.npz").pace
    assert earlier is not None
    assert earlier.top_throttle == 1.0


def test_the_top_throttle_of_a_pace_limits_what_is_commanded_and_nothing_else() -> None:
    readings = np.random.default_rng(5).uniform(0.0, 4.0, (200, 1, len(INPUTS)))
    pace = replace(random_pace(), inputs=("yaw_rate", "wheel_speed@3", "steer@1", "steer@2"))  # not what it commanded
    free, limited = (
        PolicyDrivers(replace(random_policy(), pace=replace(pace, top_throttle=top)), INPUTS) for top in (1.0, 0.2)
    )
    commands = [(free.act(one)[0], limited.act(one)[0]) for one in readings]
    for one, other in commands:
        assert other.tolist() == [min(one[0], 0.2), one[1]]
    assert {one[0] > 0.2 for one, _ in commands} == {False, True}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda about, arrays: about["pace"].update(top_throttle=0.0), "top throttle of a pace must be over 0"),
        (lambda about, arrays: about["pace"].update(top_throttle=1.2), "at most 1, not 1.2"),
        (lambda about, arrays: about["pace"].update(slowness=[1.3, 0.9]), "slowness of a pace must be two numbers"),
        (lambda about, arrays: about["pace"].update(slowness=[1.0]), "is not a policy"),
        (lambda about, arrays: about["pace"].update(keep=1.5), "'keep' of a pace must be from 0 to 1, not 1.5"),
        (lambda about, arrays: about["pace"].update(keep=float("nan")), "not finite"),
        (lambda about, arrays: about["pace"].update(scale=[1.0]), "a pace with 4 inputs needs as many scales, not 1"),
        (
            lambda about, arrays: about["pace"].update(inputs=["throttle"] * 4),
            "'throttle' of the policy is an output of the policy",
        ),
        (lambda about, arrays: arrays.pop("pace_weight_1"), "the last layer of a pace has two outputs, slowness"),
        (lambda about, arrays: arrays.update(pace_bias_0=np.full(8, np.nan)), "layer 0 of the pace has numbers"),
    ],
)
def test_a_wrong_pace_is_one_line(
    tmp_path: Path, change: Callable[[dict[str, Any], dict[str, np.ndarray]], None], message: str
) -> None:
    file = tmp_path / "policy.npz"
    replace(random_policy(), pace=random_pace()).save(file)
    changed(file, change)
    with pytest.raises(AutodriveError, match=message) as error:
        Policy.load(file)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("grip", "throttle"), [(1.0, 0.1), (0.3, 1.0)])
def test_a_racer_reads_what_the_environment_shows(grip: float, throttle: float) -> None:
    """From encoders, gyroscope and LIDAR, at the same time in the same world; also while the wheels spin."""
    task = TimeTrial(5)
    car = VehiclePlacement(type="roboracer", sensors={"lidar": SensorSettings(noise="realistic")}, grip_factor=grip)
    world = autodrive.make(ScenarioSpec(map="practice", vehicles={"V1": car}, tick=PERIOD))
    names = [one.name for one in observed(task, "lidar")]
    places = [names.index(name) for name in INPUTS]
    episodes = Episodes(task, "lidar", 1)
    seen: list[np.ndarray] = []

    class Spy(Policy):
        def outputs(self, inputs: np.ndarray) -> np.ndarray:
            seen.extend(inputs)
            return np.zeros((len(inputs), 2))

    racer = PolicyRacer(Spy("time_trial", INPUTS, (1.0,) * 57, (0.0, 1.0), random_policy().layers))
    for _ in range(60 if grip == 1.0 else 8):
        episodes.advance(CarReadings.of(world.row.readings, 1))
        racer.act(world.frame.vehicles["V1"])
        expected = episodes.numbers()[0, places]
        assert seen[-1][[0, *range(2, 57)]] == pytest.approx(expected[[0, *range(2, 57)]], abs=1e-5)  # float32
        assert seen[-1][1] == pytest.approx(expected[1], abs=0.05)  # yaw rate, of a gyroscope
        world.step({"V1": Command(throttle, 0.05)})
    wheel_speed, speed = seen[-1][0], episodes.numbers()[0, names.index("speed")]
    assert speed > 0.2
    if grip == 1.0:
        assert wheel_speed == pytest.approx(speed, rel=0.03)  # the tyres slip
    else:
        assert wheel_speed > 1.5 * speed


def test_what_a_racer_cannot_read_is_refused() -> None:
    with pytest.raises(AutodriveError, match="reads offset, which no script can read in a race"):
        PolicyRacer(random_policy(inputs=("offset",)))
    with pytest.raises(AutodriveError, match=r"reads speed, which no script can read in a race; .* wheel_speed"):
        PolicyRacer(random_policy(inputs=("speed",)))
    with pytest.raises(AutodriveError, match="a scan of 1080 or 1081 rays, not of 361"):
        sectors(np.ones(361))


@pytest.mark.slow
@pytest.mark.parametrize("track", ["fast", "practice", "technical"])
def test_the_included_policy_drives_laps_on_tracks_that_it_has_not_seen(track: str) -> None:
    result = drive_laps(Policy.find("race"), track, laps=4)
    assert (len(result.laps), result.collisions, result.status) == (4, 0, "finished")


def test_an_unknown_policy_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(AutodriveError, match=r"policy 'rice' is not known\. .*race"):
        Policy.find("rice")
    with pytest.raises(AutodriveError, match=r"nothing\.npz is not a policy"):
        Policy.find("nothing.npz")


@pytest.mark.process
def test_the_command_plays_in_a_race_and_as_a_devkit_script(tmp_path: Path) -> None:
    for policy, name in (("mine/policy.npz", "mine"), ("race", "race")):  # each training writes a `policy.npz`
        if policy != name:
            (tmp_path / name).mkdir()
            Policy.find("race").save(tmp_path / policy)
        arguments = ("play", policy, "practice", "--laps", "1", "--lockstep", "--headless", "-o", name)
        done = call(*arguments, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert f"| 1 | {name} |" in done.stdout
    played = json.loads((tmp_path / name / "result.json").read_text())
    with Server(responder(Policy.find("race")), port=0) as server:
        options = RaceOptions("practice", (("127.0.0.1", server.port),), rules="practice", laps=1)
        raced = race(replace(options, is_lockstep=True, has_page=False))
    assert raced.standings[0].laps[0].time == played["standings"][0]["laps"][0]["time"]
    assert "policy 'none' is not known" in refused("play", "none", "practice", cwd=tmp_path)
