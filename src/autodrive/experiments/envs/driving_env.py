"""The Gymnasium environment of one car."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.experiments.envs.driving_vector_env import of_one_world
from autodrive.experiments.envs.rendered_world import RenderedWorld
from autodrive.experiments.envs.shown import ShownVectorEnv
from autodrive.experiments.envs.single_env import SingleEnv
from autodrive.experiments.envs.task import Task
from autodrive.protocol.messages import Frame


class DrivingEnv(SingleEnv):
    """One car with one task. `info["is_success"]` says after each step whether the task is accomplished."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 20.0}  # noqa: RUF012
    vector: ShownVectorEnv

    def __init__(self, task: str | Task = "lane_keeping", *, render_mode: str | None = None, **settings: Any) -> None:
        """`settings`: those of `DrivingVectorEnv`. `render_mode`: 'rgb_array' or 'human', the page.

        Raises `SpecError` for wrong settings, `GlUnavailable` for images without OpenGL.
        """
        super().__init__(of_one_world(self, ShownVectorEnv, 1, task, render_mode=render_mode, **settings), render_mode)

    @property
    def rendered(self) -> RenderedWorld:
        """The World, and what shows it."""
        return self.vector.batch

    @property
    def frame(self) -> Frame:
        """The latest Frame of the World, with all that the simulator knows."""
        return self.rendered.world.frame

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The image of Driver's Eye with 'rgb_array'; None with 'human': the page shows the car."""
        return self.rendered.render()
