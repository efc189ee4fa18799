"""The environments of cooperative crossing: four cars Nigel, see `autodrive.experiments.envs.crossing`."""

from __future__ import annotations

from typing import Any

from autodrive.experiments.envs.crossing import Crossing
from autodrive.experiments.envs.driving_vector_env import of_one_world
from autodrive.experiments.envs.settings import ALL, OF_CARS, OF_TASKS, Action
from autodrive.experiments.envs.several_cars import SeveralCarsParallelEnv, SeveralCarsVectorEnv
from autodrive.experiments.envs.variants import Variant, action_of

STEPS = 600
"""Steps of an episode, unless something else is chosen: half a minute."""


class CrossingVectorEnv(SeveralCarsVectorEnv):
    """Many crossings of four cars: see `autodrive.experiments.envs.crossing`."""

    setting_names = ALL - OF_TASKS - OF_CARS

    def __init__(
        self,
        num_envs: int = 4,
        *,
        variant: Variant = "own",
        loss: float = 0.1,
        delay: float = 0.0,
        rate: float | None = None,
        max_episode_steps: int | None = STEPS,
        action: Action | None = None,
        frame_skip: int = 5,
        **settings: Any,
    ) -> None:
        """`loss`, `delay`, `rate`: of the radio of the variant "own", see `Crossing`. `num_envs`: a multiple of 4.

        `settings`: see `EnvSettings`; without `action`, that of the variant. Raises as `DrivingVectorEnv`.
        """
        settings |= {"max_episode_steps": max_episode_steps, "action": action_of(variant, action)}
        task = Crossing(frame_skip, variant, loss, delay, rate)
        super().__init__(num_envs, task, frame_skip=frame_skip, **settings)


class CrossingParallelEnv(SeveralCarsParallelEnv):
    """One crossing of four cars for PettingZoo; it has the bits of a world of `CrossingVectorEnv`."""

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "nigel_crossing_v0",
        "render_modes": [],
        "is_parallelizable": True,
    }

    def __init__(self, **settings: Any) -> None:
        """`settings`: of `CrossingVectorEnv`. Raises `SpecError`."""
        super().__init__(of_one_world(self, CrossingVectorEnv, 4, **settings))
