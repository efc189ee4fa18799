"""Trains for a short time with a learning library: steps a second of wall time, and the mean return before and after.

    PYTHON benchmarks/adapters.py LIBRARY [--steps 200000]

PYTHON: an environment with that library and this package: stable_baselines3, rsl_rl, pufferlib or rllib.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import gymnasium
import numpy as np

ID, COUNT = "NigelLaneKeeping-v0", 64


def mean_return(act: Any) -> float:
    """Mean return of the first episode of each of 32 cars, driven by a function of the observations."""
    envs = gymnasium.make_vec(f"autodrive:{ID}", 32, autoreset_mode="SameStep")
    observations, _ = envs.reset(seed=100)
    total, is_open = np.zeros(32), np.ones(32, np.bool_)
    while is_open.any():
        observations, rewards, terminated, truncated, _ = envs.step(act(observations))
        total += rewards * is_open
        is_open &= ~(terminated | truncated)
    return float(total.mean())


def stable_baselines3(steps: int) -> tuple[Any, Any, Any]:
    from stable_baselines3 import PPO  # noqa: PLC0415  # pyright: ignore[reportMissingImports]

    from autodrive.experiments.envs.adapters.stable_baselines3 import NigelVecEnv  # noqa: PLC0415

    model = PPO("MlpPolicy", NigelVecEnv(ID, COUNT), n_steps=64, batch_size=1024, seed=1, device="cpu")
    model.set_random_seed(1)

    def act(observations: Any) -> Any:
        return model.predict(observations, deterministic=True)[0]

    return act, lambda: model.learn(steps), steps


def rsl_rl(steps: int) -> tuple[Any, Any, Any]:
    import torch  # noqa: PLC0415  # pyright: ignore[reportMissingImports]
    from rsl_rl.runners import OnPolicyRunner  # noqa: PLC0415  # pyright: ignore[reportMissingImports]
    from tensordict import TensorDict  # noqa: PLC0415  # pyright: ignore[reportMissingImports]

    from autodrive.experiments.envs.adapters.rsl_rl import NigelVecEnv  # noqa: PLC0415

    network = {"class_name": "MLPModel", "hidden_dims": [64, 64], "activation": "tanh"}
    gaussian = {"class_name": "GaussianDistribution", "init_std": 1.0}
    settings = {
        "num_steps_per_env": 64,
        "save_interval": 10**9,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": {**network, "distribution_cfg": gaussian},
        "critic": network,
        "algorithm": {"class_name": "PPO", "learning_rate": 3e-4, "num_mini_batches": 4, "num_learning_epochs": 5},
    }
    runner = OnPolicyRunner(NigelVecEnv(ID, COUNT), settings, log_dir=None, device="cpu")
    iterations = steps // (64 * COUNT)

    def act(observations: Any) -> Any:
        with torch.inference_mode():
            groups = TensorDict({"policy": torch.as_tensor(observations)}, batch_size=[len(observations)])
            return runner.get_inference_policy("cpu")(groups).numpy()

    return act, lambda: runner.learn(iterations), iterations * 64 * COUNT


def rllib(steps: int) -> tuple[Any, Any, Any]:
    from ray.rllib.algorithms.ppo import PPOConfig  # noqa: PLC0415  # pyright: ignore[reportMissingImports]

    from autodrive.experiments.envs.adapters.rllib import register  # noqa: PLC0415

    register()
    config = PPOConfig().environment(ID).env_runners(num_env_runners=0, num_envs_per_env_runner=4)
    algorithm = config.training(train_batch_size_per_learner=4000).debugging(seed=1).build_algo()
    rounds = max(1, steps // 4000)

    def learn() -> None:
        for _ in range(rounds):
            algorithm.train()

    return None, learn, rounds * 4000


def pufferlib(steps: int) -> tuple[Any, Any, Any]:
    import pufferlib.vector  # noqa: PLC0415  # pyright: ignore[reportMissingImports]

    from autodrive.experiments.envs.adapters.pufferlib import NigelPufferEnv  # noqa: PLC0415

    settings = {"id_": ID, "num_envs": COUNT}
    env = pufferlib.vector.make(NigelPufferEnv, env_kwargs=settings, backend=pufferlib.PufferEnv)
    rounds = steps // COUNT

    def run() -> None:  # its trainer needs its compiled extension; this is what the trainer calls
        env.async_reset(1)
        for _ in range(rounds):
            env.recv()
            env.send(env.action_space.sample())

    return None, run, rounds * COUNT


LIBRARIES = {one.__name__: one for one in (stable_baselines3, rsl_rl, pufferlib, rllib)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", choices=LIBRARIES)
    parser.add_argument("--steps", type=int, default=200_000)
    options = parser.parse_args()
    act, learn, steps = LIBRARIES[options.library](options.steps)
    before = mean_return(act) if act else None
    start, cpu = time.perf_counter(), time.process_time()
    learn()
    wall, cpu = time.perf_counter() - start, time.process_time() - cpu
    print(f"{options.library}: {steps} steps in {wall:.1f} s, {steps / wall:,.0f} steps/s ({cpu:.1f} s of CPU time)")
    if act:
        print(f"mean return {before:.2f} before, {mean_return(act):.2f} after")


if __name__ == "__main__":
    main()
