"""Vector environments of one World, which can be shown, in the place of a batch of one world."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.rendered_world import RenderedWorld
from autodrive.experiments.envs.several_cars import SeveralCarsVectorEnv


class ShownVectorEnv(DrivingVectorEnv):
    """The vector environment of one World, with the render modes 'rgb_array' and 'human'.

    Images are those of the cameras of the World. An episode that has ended may go on, as in Gymnasium.
    """

    batch: RenderedWorld  # pyright: ignore[reportIncompatibleVariableOverride]

    def _worlds(self, count: int, threads: int | None) -> RenderedWorld:
        assert count == 1
        return RenderedWorld(self.task.scenario, self.settings, has_camera=self._has_camera)

    def _images(self) -> NDArray[np.uint8]:
        return self.batch.images

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Drive each car with its action, also after its episode has ended; see `DrivingVectorEnv.step`."""
        self._has_ended[:] = False
        result = super().step(actions)
        _, _, terminated, truncated, info = result
        self.batch.tell(terminated | truncated, info["is_success"])
        return result


class ShownCarsVectorEnv(ShownVectorEnv, SeveralCarsVectorEnv):  # pyright: ignore[reportIncompatibleVariableOverride]
    """The vector environment of one World with several cars, with the render modes 'rgb_array' and 'human'."""
