"""The example that learns to drive: it improves, its runs can be repeated and resumed, and its policy drives."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.experiments.policies import Policy

EXAMPLE = str(Path(__file__).parents[3] / "examples" / "learning" / "ppo.py")


@pytest.mark.slow
def test_the_return_of_races_rises_and_a_run_can_be_repeated_and_resumed(tmp_path: Path) -> None:
    """Cars crash at first; after 50,000 steps they drive some metres, on tracks without tight curves."""
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
    for _ in range(4):
        first.improve()
    assert early < 0.0
    assert np.mean(first.returns[-100:]) > 2.0
    resumed = trainer("race", 1)
    resumed.resume(tmp_path)
    assert resumed.steps == 2 * 64 * 128
    resumed.improve()
    features = np.linspace(0.0, 3.0, len(first.inputs))
    expected = first.agent.actor(jnp.asarray(features * first.scale, jnp.float32))
    throttle, steering = first.policy().act(features)
    outputs = 2.0 * (throttle - 0.03) / 0.37 - 1.0, steering
    assert outputs == pytest.approx(np.clip(expected, -1.0, 1.0).tolist(), abs=1e-5)


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
