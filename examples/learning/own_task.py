"""Learn to drive slowly and smoothly on your own track, with your own reward, with Stable-Baselines3.

    pip install stable-baselines3
    python examples/learning/own_task.py [TRACK] [--steps 200000] [--output policy.zip]

TRACK: name of a track, or its file, for example from `autodrive import track`. See docs/own_task.md.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]

from autodrive.experiments.envs.adapters.stable_baselines3 import NigelVecEnv
from autodrive.experiments.envs.own_rules import Step

TOP_SPEED = 2.0
"""What is faster than this is not rewarded [m/s]."""


def reward(step: Step) -> Any:
    """Progress along the track [m] up to a speed, less for jerky steering, and -2 for a collision."""
    progress = np.minimum(step.progress, TOP_SPEED * 0.025)  # a step lasts 0.025 s
    jerk = np.abs(step.actions[:, 1] - step.last_actions[:, 1])
    return progress - 0.002 * jerk - 2.0 * step.has_collided


def end(step: Step) -> Any:
    """As the task, and when the car is more than 0.5 m beside the centre line."""
    return step.has_ended | (np.abs(step.offset) > 0.5)


def mean_return(model: PPO, track: str) -> float:
    """Of the first episode of each of 16 cars, without random actions."""
    envs = NigelVecEnv("RoboRacer-v0", 16, track=track, reward=reward, end=end, max_episode_steps=800)
    envs.seed(100)
    observations, total, is_open = envs.reset(), np.zeros(16), np.ones(16, np.bool_)
    while is_open.any():
        actions, _ = model.predict(observations, deterministic=True)
        observations, rewards, dones, _ = envs.step(actions)
        total += rewards * is_open
        is_open &= ~dones
    envs.close()
    return float(total.mean())


def main() -> None:
    """Learn, and print the mean return before and after."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("track", nargs="?", default="practice")
    parser.add_argument("--steps", type=int, default=200_000)
    parser.add_argument("--output", help="File of the policy.")
    options = parser.parse_args()
    torch.set_num_threads(1)  # more are slower for such a small network
    envs = NigelVecEnv("RoboRacer-v0", 32, track=options.track, reward=reward, end=end, max_episode_steps=800)
    model = PPO("MlpPolicy", envs, n_steps=64, batch_size=512, gamma=0.98, learning_rate=1e-3, seed=1, device="cpu")
    before = mean_return(model, options.track)
    model.learn(options.steps)
    print(f"mean return {before:.2f} before, {mean_return(model, options.track):.2f} after")
    if options.output:
        model.save(options.output)


if __name__ == "__main__":
    main()
