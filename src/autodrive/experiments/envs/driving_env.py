"""The Gymnasium environment of one car."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from autodrive.base.errors import EngineError
from autodrive.base.suggest import with_suggestions
from autodrive.experiments.envs.conditions import WEATHER, Conditions, Range, checked_conditions
from autodrive.experiments.envs.episodes import Episodes, observation_space
from autodrive.experiments.envs.own_rules import End, Reward
from autodrive.experiments.envs.rendered_world import CAMERA, RenderedWorld
from autodrive.experiments.envs.settings import (
    Action,
    Settings,
    action_space,
    check_changeable,
    check_options,
    commands_of,
    made_task,
    whole_seed,
)
from autodrive.experiments.envs.task import OFFENCES, Observation, Task
from autodrive.protocol.messages import Command, Frame

VEHICLE = "V1"
FIRST = np.zeros(1, np.intp)


class DrivingEnv(gymnasium.Env[Any, Any]):
    """One car with one task. `info["is_success"]` says after each step whether the task is accomplished."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 20.0}  # noqa: RUF012

    @with_suggestions
    def __init__(
        self,
        task: str | Task = "lane_keeping",
        *,
        observation: Observation | None = None,
        action: Action = "continuous",
        frame_skip: int = 5,
        render_mode: str | None = None,
        map: str | Path | None = None,
        reward: Reward | None = None,
        end: End | None = None,
        traffic: int = 0,
        offence_cost: float = 0.0,
        fog: Range = 0.0,
        rain: Range = 0.0,
        snow: Range = 0.0,
    ) -> None:
        """`task`: its name, or one that is already made. `traffic`: cars that drive themselves, on a map with lanes.

        `map`: name or file of one on which lane keeping drives. `reward`, `end`: functions of an `own_rules.Step`,
        instead of the reward and the ends of the task.

        `offence_cost`: subtracted from the reward for each red light and stop sign that is run.
        `fog`, `rain`, `snow`: see `Conditions`.

        Raises `SpecError` for wrong settings, `GlUnavailable` for images without OpenGL.
        """
        name = task if isinstance(task, str) else None
        checked = Settings(
            name, observation, action, frame_skip, render_mode, traffic=traffic, offence_cost=offence_cost
        )
        self.render_mode = render_mode
        self.task = made_task(task, frame_skip, map, traffic)
        self.settings = replace(checked, choices=self.task.choices)
        seen = observation or self.task.observation
        self.observation_space = observation_space(self.task, seen)
        self.action_space = action_space(self.settings)
        self.conditions = Conditions(fog=fog, rain=rain, snow=snow)
        self._has_camera = seen == "camera"
        self._episodes = Episodes(self.task, seen, 1, offence_cost, reward, end)
        self.rendered = RenderedWorld(self.task.scenario, self.settings, has_camera=self._has_camera)
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / self.rendered.step_duration}

    @property
    def frame(self) -> Frame:
        """The latest Frame of the World, with all that the simulator knows."""
        return self.rendered.world.frame

    @property
    def conditions(self) -> Conditions:
        """The weather of the episodes that follow. Setting others raises `SpecError`."""
        return self._conditions

    @conditions.setter
    def conditions(self, conditions: Conditions) -> None:
        self._conditions = checked_conditions(conditions, WEATHER)

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Set `conditions`; any other attribute raises `SpecError`."""
        check_changeable(name)
        return super().set_wrapper_attr(name, value, force=force)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; without a seed the next one of the same random numbers."""
        check_options(options)
        super().reset(seed=whole_seed(seed))
        world_seed = int(self.np_random.integers(2**31))
        start = self.task.start(self.np_random)
        weather = self.conditions.draw_weather(self.np_random)
        frame = self.rendered.reset(world_seed, start.poses, weather)
        self._episodes.begin(FIRST, [start], self.rendered.cars)
        return self._observation(frame), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive with that action for `frame_skip` ticks."""
        commands = commands_of(action, self.settings, 1)
        ((throttle, steering),) = commands.tolist()
        is_unstable = None
        try:
            frame = self.rendered.step({VEHICLE: Command(throttle, steering)})
        except EngineError:
            frame, is_unstable = self.frame, np.array([True])
        cars = self.rendered.cars
        outcome = self._episodes.advance(cars, is_unstable, commands)
        info: dict[str, Any] = {"is_success": bool(outcome.is_success[0])}
        if self.rendered.world.map.stop_lines:
            info |= zip(OFFENCES, cars.offences[0].tolist(), strict=True)
        return self._observation(frame), float(outcome.reward[0]), bool(outcome.has_ended[0]), False, info

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """With 'rgb_array', the image of Driver's Eye; with 'human' the page shows the car."""
        return self.rendered.render()

    def close(self) -> None:
        """Stop the page, and free the renderers."""
        self.rendered.close()

    def _observation(self, frame: Frame) -> Any:
        numbers = self._episodes.numbers()[0]
        if not self._has_camera:
            return numbers
        image = frame.vehicles[VEHICLE].cameras[CAMERA].rgb
        return {"image": np.ascontiguousarray(image), "state": numbers}
