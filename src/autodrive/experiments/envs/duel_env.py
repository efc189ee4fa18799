"""The environments of head-to-head racing: two cars RoboRacer, see `autodrive.experiments.envs.duel`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from autodrive.experiments.envs.conditions import WEATHER
from autodrive.experiments.envs.driving_vector_env import of_one_world
from autodrive.experiments.envs.duel import BEST, DRIVEN, Duel
from autodrive.experiments.envs.settings import ALL, OF_CARS, OF_TASKS, Action
from autodrive.experiments.envs.several_cars import SeveralCarsParallelEnv, SeveralCarsVectorEnv
from autodrive.experiments.envs.variants import Variant, action_of

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats, Integers
    from autodrive.experiments.envs.task import Bools

STEPS = 4800
"""Steps of an episode, unless something else is chosen: two minutes."""


class DuelVectorEnv(SeveralCarsVectorEnv):
    """Many races of two cars: see `autodrive.experiments.envs.duel`."""

    task: Duel
    drawn_conditions = ("noise", *WEATHER)

    setting_names = ALL - OF_TASKS - OF_CARS | {"noise"}

    def __init__(
        self,
        num_envs: int = 2,
        *,
        variant: Variant = "own",
        tracks: int | None = None,
        track_seed: int = 0,
        laps: int = 2,
        max_episode_steps: int | None = STEPS,
        action: Action | None = None,
        frame_skip: int | None = None,
        **settings: Any,
    ) -> None:
        """`tracks`, `track_seed`, `frame_skip`: see `Duel`.

        `laps`: of a race of the variant "own". `num_envs`: an even number. `settings`: see `EnvSettings`; without
        `action`, that of the variant. Raises as `DrivingVectorEnv`.
        """
        settings |= {"max_episode_steps": max_episode_steps, "action": action_of(variant, action)}
        task = Duel(frame_skip, variant, tracks, track_seed, laps)
        super().__init__(num_envs, task, frame_skip=task.frame_skip, **settings)
        self._episodes.memory[:, BEST] = np.inf

    @property
    def distance(self) -> Floats:
        """Distance of each car along the centre line since the start line [m], shape (num_envs,)."""
        return self._episodes.memory[:, DRIVEN].copy()

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start all episodes; see `DrivingVectorEnv.reset`. With a seed, the best laps are forgotten, too."""
        if seed is not None:
            self._episodes.memory[:, BEST] = np.inf
        return super().reset(seed=seed, options=options)

    def _begin(self, mask: Bools) -> None:
        best = self._episodes.memory[:, BEST].copy()
        super()._begin(mask)
        self._episodes.memory[:, BEST] = best

    def _reset_worlds(self, worlds: NDArray[np.intp], seeds: Integers, poses: dict[str, Floats]) -> None:
        generators = [rng for world in worlds.tolist() if (rng := self._rngs[world]) is not None]
        noise = np.array([[self.conditions.draw(rng).noise for _ in range(self.car_count)] for rng in generators])
        weathers = self._weathers(worlds, self.conditions)
        self.batch.reset(worlds, seeds, poses=poses, noise=noise, weather=weathers)


class DuelParallelEnv(SeveralCarsParallelEnv):
    """One race of two cars for PettingZoo; it has the bits of a world of `DuelVectorEnv`."""

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "roboracer_duel_v0",
        "render_modes": [],
        "is_parallelizable": True,
    }
    vector: DuelVectorEnv

    def __init__(self, **settings: Any) -> None:
        """`settings`: of `DuelVectorEnv`. Raises `SpecError`."""
        super().__init__(of_one_world(self, DuelVectorEnv, 2, **settings))
