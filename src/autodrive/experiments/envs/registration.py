"""Registers the environments with Gymnasium; `import autodrive` calls `register` once Gymnasium is imported."""

from __future__ import annotations

from typing import Any

from gymnasium.envs.registration import register as register_environment

IDS = {
    "NigelLaneKeeping-v0": ("lane_keeping", 1000),
    "NigelParking-v0": ("parking", 400),
    "NigelNavigation-v0": ("navigation", 600),
}
"""Id -> name of the task, and steps after which an episode is truncated."""
ROBORACER, ROBORACER_STEPS = "RoboRacer-v0", 2400
"""The time trial, which has a class of its own, and its steps (60 s)."""

SEVERAL_CARS = {
    "NigelCrossing-v0": ("crossing_env:CrossingVectorEnv", 600),
    "RoboRacerDuel-v0": ("duel_env:DuelVectorEnv", 4800),
}
"""Id -> vector environment of several cars in each world, and its steps; there is no environment of one car."""


def register() -> None:
    """Make the ids known to `gymnasium.make` and `gymnasium.make_vec`. Imports nothing of the simulator."""
    for id_, (task, steps) in IDS.items():
        register_environment(
            id_,
            entry_point="autodrive.experiments.envs.driving_env:DrivingEnv",
            vector_entry_point="autodrive.experiments.envs.driving_vector_env:DrivingVectorEnv",
            max_episode_steps=steps,
            kwargs={"task": task},
        )
    register_environment(
        ROBORACER,
        entry_point="autodrive.experiments.envs.roboracer_env:RoboRacerEnv",
        vector_entry_point="autodrive.experiments.envs.roboracer_env:RoboRacerVectorEnv",
        max_episode_steps=ROBORACER_STEPS,
    )
    for id_, (name, steps) in SEVERAL_CARS.items():
        register_environment(
            id_,
            entry_point=refuse,
            vector_entry_point=f"autodrive.experiments.envs.{name}",
            max_episode_steps=steps,
        )


def refuse(**_: Any) -> Any:
    """Raises `SpecError`: there is no environment of one car."""
    from autodrive.base.errors import SpecError  # noqa: PLC0415  this module imports nothing of the simulator

    raise SpecError(["this environment has several cars: use gymnasium.make_vec, or its class for PettingZoo"])
