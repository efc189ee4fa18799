"""The PettingZoo environment: 2 to 8 cars keep the lane in one world, and must not hit each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.experiments.envs.driving_vector_env import of_one_world
from autodrive.experiments.envs.lane_keeping import LaneKeeping
from autodrive.experiments.envs.rendered_world import RenderedWorld
from autodrive.experiments.envs.settings import checked_cars
from autodrive.experiments.envs.several_cars import SeveralCarsParallelEnv
from autodrive.experiments.envs.shown import ShownCarsVectorEnv
from autodrive.experiments.envs.task import Observation
from autodrive.protocol.messages import Frame


class DrivingParallelEnv(SeveralCarsParallelEnv):
    """The task of lane keeping (`envs.lane_keeping`) for several cars at equal distances on the same lane."""

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "nigel_lane_keeping_v0",
        "render_modes": ["rgb_array", "human"],
        "render_fps": 20.0,
        "is_parallelizable": True,
    }
    vector: ShownCarsVectorEnv

    def __init__(
        self,
        cars: int = 4,
        *,
        max_episode_steps: int | None = 1000,
        observation: Observation = "lidar",
        frame_skip: int = 5,
        **settings: Any,
    ) -> None:
        """`settings`: those of `DrivingVectorEnv`. `render_mode`: 'rgb_array' or 'human', the page.

        Raises `SpecError` for wrong settings, `GlUnavailable` for images without OpenGL.
        """
        count = checked_cars(cars)
        settings |= {"max_episode_steps": max_episode_steps, "observation": observation, "frame_skip": frame_skip}
        task = LaneKeeping(frame_skip, count)
        super().__init__(of_one_world(self, ShownCarsVectorEnv, count, task, **settings))
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / self.rendered.step_duration}

    @property
    def rendered(self) -> RenderedWorld:
        """The World, and what shows it."""
        return self.vector.batch

    @property
    def frame(self) -> Frame:
        """The latest Frame of the World, with all that the simulator knows."""
        return self.rendered.world.frame

    def render(self) -> NDArray[np.uint8] | None:
        """The image of Driver's Eye behind the first car with 'rgb_array'; None with 'human': the page shows it."""
        return self.rendered.render()
