"""The example that learns to drive: it improves, its runs can be repeated and resumed, and its policy drives."""

from __future__ import annotations

import dataclasses
import runpy
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.policies import Policy
from autodrive.experiments.policies.policy import Pace, PolicyDrivers
from autodrive.experiments.policies.racer import drive_laps

LEARNING = Path(__file__).parents[3] / "examples" / "learning"
EXAMPLE = str(LEARNING / "ppo.py")


@pytest.fixture(autouse=True, scope="module")
def _compiled_once(pytestconfig: pytest.Config) -> Iterator[None]:
    """Else each trainer compiles the same functions again, in each run of the tests."""
    import jax  # here: each worker collects this file, and the import takes a second

    folder = pytestconfig.rootpath / ".pytest_cache" / "jax"
    names = ("jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs")
    before = [getattr(jax.config, name) for name in names]
    for name, value in zip(names, (str(folder), 0.0), strict=True):
        jax.config.update(name, value)
    yield
    for name, value in zip(names, before, strict=True):
        jax.config.update(name, value)


@pytest.mark.slow
def test_the_return_of_races_rises_and_a_run_can_be_repeated_and_resumed(tmp_path: Path) -> None:
    """Cars crash at first; after 57,000 steps they drive some metres, on tracks without tight curves."""
    import jax.numpy as jnp  # here: each worker collects this file, and the import takes a second

    example: Any = runpy.run_path(EXAMPLE)
    easy = {"tracks": 16, "track_width": (0.9, 1.6), "track_length": (35.0, 60.0), "track_radius": None}
    example["PROBLEMS"]["race"].settings.update(easy)
    trainer = example["Trainer"]
    first = trainer("race", 1)
    first.improve()
    first.improve()
    early = np.mean(first.returns)
    first.save(tmp_path)
    again = trainer("race", 1)
    again.improve()
    again.improve()
    assert again.returns == first.returns
    for ours, theirs in zip(again.policy().layers, first.policy().layers, strict=True):
        assert all(np.array_equal(one, other) for one, other in zip(ours, theirs, strict=True))
    assert -7.0 < np.min(again.rollout()[0].reward) / again.problem.reward < -4.0  # of a collision
    again.steps = again.problem.careful
    assert -102.0 < np.min(again.rollout()[0].reward) / again.problem.reward < -99.0
    for _ in range(4):
        first.improve()
    ended = len(first.returns)
    first.improve()
    assert early < 0.0
    assert np.mean(first.returns[ended:]) > 2.0
    resumed = trainer("race", 1)
    resumed.resume(tmp_path)
    assert resumed.steps == 2 * 64 * 128
    resumed.improve()
    resumed.keep(tmp_path)
    kept = Policy.load(tmp_path / "policy.npz")
    resumed.improve()
    resumed.save(tmp_path)  # of a policy that has not driven clean laps
    again.resume(tmp_path)
    assert again.steps == 4 * 64 * 128
    again.save(tmp_path)
    assert kept.training["steps"] == Policy.load(tmp_path / "policy.npz").training["steps"] == 3 * 64 * 128
    inputs = np.linspace(0.0, 3.0, len(first.inputs))
    expected = first.agent.actor(jnp.asarray(inputs * first.scale, jnp.float32))
    assert first.policy().outputs(inputs) == pytest.approx(np.clip(expected, -1.0, 1.0).tolist(), abs=1e-5)


@pytest.mark.slow
def test_the_return_of_lane_keeping_rises_and_ctrl_c_keeps_what_was_learnt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    example: Any = runpy.run_path(EXAMPLE)
    improve = example["Trainer"].improve

    def improve_six_times(trainer: Any) -> None:
        if trainer.steps == 6 * 64 * 128:
            raise KeyboardInterrupt
        improve(trainer)

    monkeypatch.setattr(example["Trainer"], "improve", improve_six_times)
    monkeypatch.setattr("sys.argv", ["ppo.py", "lane", "--output", str(tmp_path)])
    example["main"]()
    steps, _, mean = np.loadtxt(tmp_path / "curve.csv", delimiter=",", skiprows=1).T
    assert mean[-1] > mean[0] + 0.2
    learner = example["Trainer"]("lane", 1)
    learner.resume(tmp_path)
    assert learner.steps == steps[-1] == 6 * 64 * 128
    assert Policy.load(tmp_path / "policy.npz").task == "lane_keeping"
    assert (tmp_path / "curve.svg").is_file()


@pytest.mark.slow
def test_only_live_cars_of_the_crossing_are_learnt_from_and_actions_get_calm() -> None:
    import jax.numpy as jnp  # as above

    example: Any = runpy.run_path(EXAMPLE)["main"].__globals__
    problem = dataclasses.replace(example["PROBLEMS"]["crossing"], careful=64 * 128)
    example["PROBLEMS"]["crossing"] = problem
    trainer = example["Trainer"]("crossing", 1)
    rollout, _ = trainer.rollout()
    live, ended = np.array(rollout.is_live, bool), np.array(rollout.has_ended, bool)
    assert 0.2 < live.mean() < 1.0
    assert not ended[~live].any()
    assert ended.sum() == len(trainer.returns) > 30
    # a car that has ended waits with a reward of 0 until its world begins again: one end for each life
    begins = live[1:] & (~live[:-1] | ended[:-1])
    assert abs(int(begins.sum()) - int(ended.sum())) <= 64
    assert not np.array(rollout.reward)[~live].any()

    def change(values: Any) -> Any:  # of cars that have ended
        mask = live.reshape(live.shape + (1,) * (np.ndim(values) - 2))
        return jnp.asarray(np.where(mask, values, 9.0), jnp.float32)

    def loss(these: Any) -> float:
        rows = [jnp.asarray(one).reshape(-1, *np.shape(one)[2:]) for one in these]
        advantage = jnp.where(rows[-1] > 0, rows[4], 7.0 if these is changed else 3.0)
        return float(example["loss"](trainer.agent, (type(rollout)(*rows), advantage, advantage), jnp.asarray(1.0)))

    kept = rollout._replace(is_live=live.astype(np.float32))
    changed = type(rollout)(*(change(one) for one in kept[:-1]), kept.is_live)
    assert loss(changed) == pytest.approx(loss(kept), rel=1e-5)
    trainer.steps = 0
    trainer.improve()
    assert np.exp(np.array(trainer.agent.log_std)) == pytest.approx(np.exp(example["CALM"]), rel=0.1)


@pytest.mark.slow
def test_rivals_drive_and_a_policy_is_the_beginning(tmp_path: Path) -> None:
    import jax  # as above

    example: Any = runpy.run_path(EXAMPLE)
    example["PROBLEMS"]["duel"].settings.update(tracks=2, latency=0.0)
    trainer = example["Trainer"]("duel", 1)
    race = dataclasses.replace(Policy.find("race").slower(0.9), pace=None)  # the network alone is the beginning
    trainer.begin_with("race", 0.9)
    names = [one.name for one in observed(trainer.envs.task, "lidar")]
    drivers, given = PolicyDrivers(race, names, 64), np.random.default_rng(1).uniform(0.0, 3.0, (10, 64, len(names)))
    trainer.past.begin(given[0])
    for k, readings in enumerate(given):  # it reads what it put out in the last steps
        if k:
            trainer.past.add(readings)
        action = jax.vmap(trainer.agent.actor)(trainer.read())
        assert trainer.command(action) == pytest.approx(drivers.act(readings), abs=1e-5)
    trainer.save(tmp_path)
    for go_on in ("begin_with", "resume"):
        other = example["Trainer"]("duel", 1)
        getattr(other, go_on)(tmp_path)
        assert other.policy().throttle == race.throttle
    before = trainer.policy()
    trainer.improve()  # the values only
    assert all(np.array_equal(*pair) for pair in zip(before.layers[0], trainer.policy().layers[0], strict=True))
    commands = np.full((64, 2), np.nan)
    trainer.rivals.drive(commands)
    is_rival = ~trainer.rivals.is_learner
    assert np.isfinite(commands[is_rival]).all()
    assert np.isnan(commands[~is_rival]).all()
    assert is_rival.sum() == sum(trainer.problem.rivals.values())


@pytest.mark.slow
def test_the_lessons_of_a_guarded_driver_change_the_actor_only() -> None:
    import equinox as eqx  # as above
    import jax
    import jax.numpy as jnp

    example: Any = runpy.run_path(EXAMPLE)
    example["PROBLEMS"]["overtake"].settings.update(tracks=2, latency=0.0)
    pupil = example["Overtaker"]("overtake", 1)
    pupil.begin_with("race")
    before, teacher = pupil.agent, pupil.policy()
    pupil.improve()
    read, lesson, weight = (jnp.asarray(one[: pupil.lesson_count]) for one in pupil.lessons)

    def error(agent: Any) -> float:
        return float(jnp.mean(weight * (jax.vmap(agent.actor)(read) - lesson) ** 2))

    assert error(pupil.agent) < 0.8 * error(before)
    assert eqx.tree_equal(before.critic, pupil.agent.critic)
    assert eqx.tree_equal(before.actor, pupil.teacher)
    # alone, the teacher is not changed: outputs of the lesson are those of the policy
    alone = np.asarray(weight)[:, 0] == 1.0
    raw = np.asarray(read, float)[alone] / np.array(pupil.scale)
    assert teacher.outputs(raw) == pytest.approx(np.clip(np.asarray(lesson)[alone], -1.0, 1.0), abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_a_guarded_car_can_brake_behind_its_rival_and_steers_beside_a_slow_one(turn: float) -> None:
    """The rival, at the speed `pace`, is `ahead` of the car and to the `left` of it, at the same heading."""
    example: Any = runpy.run_path(EXAMPLE)

    def guarded(ahead: float, left: float, pace: float, wish: float) -> list[float]:
        c, s = np.cos(turn), np.sin(turn)
        rival = [5.0 + ahead * c - left * s, 3.0 + ahead * s + left * c, 0.0]
        cars = types.SimpleNamespace(
            position=np.array([[5.0, 3.0, 0.0], rival]),
            velocity=np.array([[4.0, 0.0, 0.0], [pace, 0.0, 0.0]]),
            orientation=np.tile([np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)], (2, 1)),
        )
        throttle, swerve, is_near = example["guarded"](np.full(2, wish / example["TOP_SPEED"]), cars)
        is_free = (throttle[1], swerve[1]) == (wish / example["TOP_SPEED"], 0.0)
        assert is_free == (ahead > 0.0)  # the one ahead
        return [float(throttle[0] * example["TOP_SPEED"]), float(swerve[0]), float(is_near[0])]

    gap = example["LENGTH"] + example["DISTANCE"]
    speed, swerve, _ = guarded(gap + 1.2, 0.1, 2.0, 8.0)
    # from that speed it brakes to the pace of the rival within 1.2 m, seen from the rival
    assert (speed - 2.0) ** 2 / (2.0 * example["BRAKING"]) == pytest.approx(1.2)
    assert swerve == 0.0
    assert guarded(gap, 0.1, 2.0, 8.0) == pytest.approx([2.0, -example["SWERVE"], 1.0])
    assert guarded(gap, -0.1, 2.0, 8.0) == pytest.approx([2.0, example["SWERVE"], 1.0])
    assert guarded(gap, 0.1, 5.0, 5.5) == pytest.approx([5.0, 0.0, 1.0])  # it is not much faster
    assert guarded(gap - 0.1, 0.1, 5.0, 5.5) == pytest.approx([4.6, 0.0, 1.0])  # it falls back
    for ahead, left, near in [(gap, 0.5, 1.0), (-1.0, 0.0, 1.0), (4.5, 0.0, 0.0)]:
        assert guarded(ahead, left, 2.0, 8.0) == pytest.approx([8.0, 0.0, near])


@pytest.mark.parametrize(
    ("options", "laps", "kept"),
    [
        ("0.1 --until-clean", [1], []),
        ("1.4 --until-clean", [1], []),
        ("1.5 --until-clean", [1, 2], []),
        ("30 --until-clean", [1, 2, 3], [3]),
        ("0.1", [1], []),
        ("2.6", [2, 3], [3]),
        ("5", [2, 4, 6], [4, 6]),
    ],
)
def test_one_clock_counts_everything_and_the_last_laps_are_driven_once(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: str,
    laps: list[int],
    kept: list[int],
) -> None:
    """With a clock that passes 20 s in the imports, 40 s in each improvement, and 25 s in the laps of a policy."""
    example: Any = runpy.run_path(EXAMPLE)["main"].__globals__
    now, driven, clean = [20.0], [], []

    class Learner:
        steps, seconds, returns = 0, 0.0, (1.0,)

        def __init__(self, name: str, seed: int) -> None: ...

        def improve(self) -> None:
            self.steps += 1
            now[0] += 40.0

        def save(self, folder: Path) -> None: ...

        def keep(self, folder: Path) -> None:
            clean.append(self.steps)

        def policy(self) -> int:
            return self.steps

    def is_clean(steps: int) -> bool:
        driven.append(steps)
        now[0] += 25.0
        return steps >= 3

    time = types.SimpleNamespace(monotonic=lambda: now[0])
    for name, value in {"Trainer": Learner, "is_clean": is_clean, "START": 0.0, "time": time, "TRY_STEPS": 2}.items():
        monkeypatch.setitem(example, name, value)
    monkeypatch.setattr("sys.argv", ["ppo.py", "race", "--output", str(tmp_path), "--minutes", *options.split()])
    example["main"]()
    assert (driven, clean) == (laps, kept)
    message = "clean laps on all tracks after 3.6 min, 3 steps"  # 20 + 3 * 40 + 3 * 25 s
    assert (message in capsys.readouterr().out) == (options == "30 --until-clean")


def test_the_risk_of_known_rates_is_found() -> None:
    """8000 episodes whose times until a collision are drawn with known coefficients."""
    example: Any = runpy.run_path(str(LEARNING / "pace.py"))
    rng, known = np.random.default_rng(1), np.array([-6.0, 1.5, 1.0, 2.0, 5.0, 0.0, 0.2, -15.0])
    drawn = rng.uniform((0.7, 0.75, 0.0, 0.0, 0.95), (1.25, 1.25, 2.0, 0.055, 1.3), (8000, 5))
    until = rng.exponential(np.exp(5.0 - example["quantities"](drawn) @ known))
    risk = example["fit"](np.column_stack([drawn, np.minimum(until, 60.0), until < 60.0]))
    assert np.all(np.abs(risk.coefficients - known) < 4.0 * risk.errors)
    assert np.all(risk.errors < (1.0, 1.0, 0.5, 3.0, 5.0, 0.4, 0.1, 1.0))
    slowness = risk.slowness(np.array([[1.0, 1.0, 0.3, 0.0], [0.8, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.04]]))
    expected = [1.0, np.exp((-6.0 * np.log(0.8) + 2.0 * np.log(0.8) ** 2) / 15.0), np.exp(1.0 / 15.0)]
    assert slowness == pytest.approx(expected, abs=0.02)


@pytest.mark.slow
def test_what_learns_a_pace_estimates_as_the_policy_does() -> None:
    import jax  # as above

    example: Any = runpy.run_path(str(LEARNING / "pace.py"))["estimates"].__globals__
    example["STRIDE"] = 1
    network = example["eqx"].nn.MLP(len(example["INPUTS"]), 2, 16, 2, jax.numpy.tanh, key=jax.random.PRNGKey(2))
    layers = tuple((np.asarray(one.weight), np.asarray(one.bias)) for one in network.layers)
    scale, keep, slowest = example["SCALE"], example["KEEP"], example["SLOWEST"]
    pace = Pace(example["INPUTS"], tuple(scale.tolist()), (0.5, slowest), keep, layers)
    felt = np.random.default_rng(3).uniform(-4.0, 4.0, (30, len(scale)))
    sums, expected = np.array([[slowest, 1.0]]), []
    for row in felt:
        sums = keep * sums + pace.evidence(row[None])
        expected.append(sums[0, 0] / sums[0, 1])
    found = example["estimates"](network, jax.numpy.asarray(felt * scale, jax.numpy.float32))
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-4)  # float32


def test_the_beginning_of_a_pace_counts_as_much_as_a_part_of_a_drive() -> None:
    import jax  # as above

    example: Any = runpy.run_path(str(LEARNING / "pace.py"))
    network = example["eqx"].nn.MLP(len(example["INPUTS"]), 2, 16, 2, jax.numpy.tanh, key=jax.random.PRNGKey(2))
    felt = np.random.default_rng(3).uniform(-4.0, 4.0, (300, 4, len(example["INPUTS"])))
    pace = example["pace"](network, felt, 7.0)
    value, weight = pace.evidence(felt[::2].reshape(-1, len(example["INPUTS"]))).T  # those that it takes
    steps = example["START"] / 0.025
    assert weight.mean() * steps == pytest.approx(1.0, rel=1e-3)  # float32; the beginning has the weight 1
    expected = np.array(jax.vmap(network)(jax.numpy.asarray(felt[0] * example["SCALE"], jax.numpy.float32)))[:, 0]
    assert value[:4] / weight[:4] == pytest.approx(expected, abs=1e-4)
    assert pace.top_throttle * 25.252 == pytest.approx(7.0)


@pytest.mark.slow
def test_a_policy_gets_a_pace_and_drives_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    example: Any = runpy.run_path(str(LEARNING / "pace.py"))["main"].__globals__
    small = {"CARS": 4, "WINDOW": 5, "UPDATES": 3, "TRACKS": (({"tracks": 2}, 1.0),)}
    for name, value in small.items():
        monkeypatch.setitem(example, name, value)
    file = tmp_path / "runs" / "policy.npz"
    monkeypatch.setattr("sys.argv", ["pace.py", "race", "--minutes", "0.05", "--output", str(file)])
    example["main"]()
    policy = Policy.load(file)
    assert policy.pace is not None
    assert policy.training["pace"]["minutes"] == 0.05
    assert policy.pace.top_throttle == pytest.approx(7.0 / 25.252)
    before = Policy.find("race")
    assert all(np.array_equal(*pair) for pair in zip(before.layers[0], policy.layers[0], strict=True))
    assert drive_laps(policy, "practice", 1, limit=2.0).status
