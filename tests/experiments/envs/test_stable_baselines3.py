"""Stable-Baselines3 learns, in the environment of scripts/stable-baselines3."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PYTHON = ROOT / ".venv-sb3/bin/python"

pytestmark = pytest.mark.toolchain


def run(*arguments: str, folder: Path) -> str:
    if not PYTHON.exists():
        pytest.skip("Stable-Baselines3 is not installed: scripts/stable-baselines3")
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [str(PYTHON), *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_example_learns_its_own_reward_on_a_track(tmp_path: Path) -> None:
    """A car that stands has 0; at the full speed that is rewarded, 40. Measured after so many steps: 5.8."""
    output = run(str(ROOT / "examples/learning/own_task.py"), "practice", "--steps", "20480", folder=tmp_path)
    found = re.search(r"mean return (-?[\d.]+) before, (-?[\d.]+) after", output)
    assert found, output
    before, after = map(float, found.groups())
    assert before < 0.5
    assert after > 1.5


def test_the_adapter_has_environments_of_several_cars_own_tasks_and_refuses_what_changes_nothing(
    tmp_path: Path,
) -> None:
    page = (ROOT / "docs/own_task.md").read_text(encoding="utf-8")
    (own_task,) = (block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "(Task)" in block)
    program = f"""
import gymnasium
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor
from autodrive.base.errors import SpecError
from autodrive.experiments.envs.adapters.stable_baselines3 import NigelVecEnv
{own_task}
for id_, count in (("NigelCrossing-v0", 8), ("RoboRacerDuel-v0", 4), (ReachTheFlag(frame_skip=5), 4)):
    envs = VecMonitor(NigelVecEnv(id_, count, max_episode_steps=12))
    model = PPO("MlpPolicy", envs, n_steps=16, batch_size=16 * count, n_epochs=1, seed=7, device="cpu")
    model.learn(32 * count)
    assert len(model.ep_info_buffer) >= count, id_
    envs.seed(7)
    starts = envs.reset()
    if isinstance(id_, str):
        print((starts == gymnasium.make_vec(f"autodrive:{{id_}}", count).reset(seed=7)[0]).all())
for call in (
    lambda: envs.set_attr("friction", 0.5),
    lambda: envs.set_attr("conditions", envs.get_attr("conditions")[0], indices=[0]),
    lambda: envs.env_method("foo"),
    lambda: (envs.set_options({{"place": 1}}), envs.reset()),
):
    try:
        call()
    except SpecError as error:
        print(str(error).partition(":")[0])
"""
    printed = run("-c", program, folder=tmp_path).split()
    assert printed == ["True", "True", "friction", "conditions", "foo", "options"]
