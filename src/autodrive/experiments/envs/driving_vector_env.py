"""The Gymnasium vector environment: many cars, each in a world of its own or some in each, in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.base.suggest import suggest, with_suggestions
from autodrive.experiments.envs.conditions import WEATHER, Conditions, Range, checked_conditions, whole_number_errors
from autodrive.experiments.envs.episodes import Episodes, observation_space
from autodrive.experiments.envs.own_rules import End, Reward
from autodrive.experiments.envs.remade import Remade
from autodrive.experiments.envs.rendered_world import batch_camera
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
from autodrive.experiments.envs.task import OFFENCES, Bools, CarReadings, Ground, Observation, Outcome, Start, Task
from autodrive.protocol.messages import Weather
from autodrive.world.batch import BatchWorld

if TYPE_CHECKING:
    from autodrive.world.batch_camera import BatchCamera


MOST_ENVS, MOST_STEPS = 2**20, 2**53
"""Limits of `num_envs` and `max_episode_steps`."""


class DrivingVectorEnv(Remade, VectorEnv[Any, Any, Any]):
    """Environment k has the bits of a `DrivingEnv` that is reset with its seed and driven with its actions.

    If the scenario of the task has several cars, environment k is car k % cars of world k // cars. The episodes of a
    world begin together and end together: if that of one car ends, the others are truncated.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    drawn_conditions: tuple[str, ...] = WEATHER
    """Names of the `Conditions` that an episode draws."""

    @with_suggestions
    def __init__(
        self,
        num_envs: int = 1,
        task: str | Task = "lane_keeping",
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        observation: Observation | None = None,
        action: Action = "continuous",
        frame_skip: int = 5,
        threads: int | None = None,
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
        """`task`: its name, or one that is already made. `threads`: of the batch; None: one for each core.

        `map`: name or file of one on which lane keeping drives. `reward`, `end`: functions of an `own_rules.Step`,
        instead of the reward and the ends of the task.

        `traffic`: cars that drive themselves in each world, on a map with lanes; each episode has its own places,
        speeds and ways of them. `offence_cost`: subtracted from the reward for each red light and stop sign that is
        run. `fog`, `rain`, `snow`: see `Conditions`.

        Raises `SpecError` for wrong settings, `GlUnavailable` for images without OpenGL.
        """
        name = task if isinstance(task, str) else None
        checked = Settings(
            name, observation, action, frame_skip, render_mode, traffic=traffic, offence_cost=offence_cost
        )
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = {**type(self).metadata, "autoreset_mode": self.autoreset_mode}
        self.task = made_task(task, frame_skip, map, traffic)
        self.settings = replace(checked, choices=self.task.choices)
        self.conditions = Conditions(fog=fog, rain=rain, snow=snow)
        seen = observation or self.task.observation
        self._has_camera = seen == "camera"
        if max_episode_steps == -1:  # as in gymnasium.make
            max_episode_steps = None
        steps = 1 if max_episode_steps is None else max_episode_steps
        limits = {"num_envs": (num_envs, 1, MOST_ENVS), "max_episode_steps": (steps, 1, MOST_STEPS)}
        if errors := whole_number_errors(limits):
            raise SpecError(errors)
        self.num_envs = num_envs = int(num_envs)
        self.car_count = len(self.task.scenario.vehicles)
        """Cars of a world."""
        if num_envs % self.car_count:
            raise SpecError([f"num_envs: with {self.car_count} cars in a world it must be a multiple, not {num_envs}"])
        self.single_observation_space = observation_space(self.task, seen)
        self.single_action_space = action_space(self.settings)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._max_steps = max_episode_steps
        self.batch: BatchWorld = self._worlds(num_envs // self.car_count, threads)
        """The worlds."""
        self._episodes = Episodes(self.task, seen, num_envs, offence_cost, reward, end)
        self._actions = np.zeros((num_envs, 2))
        """Throttle and steering of the last step."""
        self._has_offences = bool(self.batch.map.stop_lines)
        self._rngs: list[np.random.Generator | None] = [None] * self.batch.n
        self.steps = np.zeros(num_envs, np.int64)
        """Of the present episodes; a learning library may write others, so that not all are truncated at once."""
        self._has_ended = np.zeros(num_envs, np.bool_)

    def _worlds(self, count: int, threads: int | None) -> Any:
        """A batch of that number of worlds, or what does its work."""
        if (mode := self.settings.render_mode) is not None:
            raise SpecError(
                [f"render_mode {mode!r}: a vector environment draws no images for people; use gymnasium.make"]
            )
        return BatchWorld(self.task.scenario, count, threads=threads)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode in every world, or in those of `options["reset_mask"]`; world k gets `seed` + k.

        Several seeds: one for each world. Raises `CommandError` for what is no seed.
        """
        mask = self._mask(options)
        seeds = _world_seeds(seed, self.batch.n)
        super().reset(seed=None if np.ndim(seed) else seeds[0])  # pyright: ignore[reportArgumentType]
        for world in np.flatnonzero(self._of_worlds(mask).any(axis=1)).tolist():
            if seeds[world] is not None:
                self._rngs[world] = seeding.np_random(seeds[world])[0]
        self._begin(mask)
        self._has_ended[mask] = False
        return self._observations(), {}

    @property
    def conditions(self) -> Conditions:
        """What the episodes that follow draw: `drawn_conditions`. Setting others raises `SpecError`."""
        return self._conditions

    @conditions.setter
    def conditions(self, conditions: Conditions) -> None:
        self._conditions = checked_conditions(conditions, self.drawn_conditions)

    def set_attr(self, name: str, value: Any) -> None:
        """Set `conditions` of all environments; any other attribute raises `SpecError`."""
        check_changeable(name)
        setattr(self, name, value)

    def step(self, actions: Any) -> tuple[Any, NDArray[np.float64], Bools, Bools, dict[str, Any]]:
        """Drive each car with its action for `frame_skip` ticks; what happens at an end says the autoreset mode."""
        ended = self._has_ended
        if ended.any() and self.autoreset_mode == AutoresetMode.DISABLED:
            raise SpecError([f"environments {np.flatnonzero(ended).tolist()} have ended; reset them with a reset_mask"])
        self._actions = commands = commands_of(actions, self.settings, self.num_envs)
        # those that have ended begin again below
        self._drive(self._of_worlds(commands), ~self._of_worlds(ended)[:, 0])
        outcome = self._judge()
        self.steps += 1
        is_late = np.zeros(self.num_envs, np.bool_) if self._max_steps is None else self.steps >= self._max_steps
        terminated, truncated = self._ends(outcome, is_late)
        reward, values, stepped = outcome.reward, self._values(outcome), np.ones(self.num_envs, np.bool_)
        info: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.NEXT_STEP and ended.any():
            self._begin(ended)
            stepped = ~ended
            reward[ended], terminated[ended], truncated[ended] = 0.0, False, False
        self._has_ended = ended = terminated | truncated
        if self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            self._has_ended = np.zeros(self.num_envs, np.bool_)
            info |= self._final(ended, values)
            self._begin(ended)
            stepped = ~ended
        if stepped.any():
            info |= _masked(values, stepped)
        return self._observations(), reward, terminated, truncated, info

    def render(self) -> None:
        """Nothing: see `autodrive.experiments.envs.driving_env` for images for people."""

    def close_extras(self, **_: Any) -> None:
        """End the threads of the batch, and free the renderer."""
        self.batch.close()
        if self._has_camera and "_camera" in vars(self):
            self._camera.close()

    @cached_property
    def _camera(self) -> BatchCamera:
        """The cameras of all worlds. As late as possible: see `RenderedWorld.world`."""
        return batch_camera(self.task.scenario)

    def _observations(self) -> Any:
        numbers = self._episodes.numbers()
        if not self._has_camera:
            return numbers
        return {"image": self._images(), "state": numbers}

    def _images(self) -> NDArray[np.uint8]:
        """Of the front cameras, shape (num_envs, height, width, 3)."""
        return self._camera.render(self.batch.readings, weather=self.batch.weathers)

    def _of_worlds(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of the environments, shape (num_envs, ...), as those of worlds and cars, shape (worlds, cars, ...)."""
        return values.reshape(-1, self.car_count, *values.shape[1:])

    def _begin(self, mask: Bools) -> None:
        """Start episodes of these environments, which are all of some worlds."""
        worlds = np.flatnonzero(self._of_worlds(mask)[:, 0])
        starts: list[Start] = []
        seeds: list[int] = []
        for world in worlds.tolist():
            rng = self._rngs[world]
            if rng is None:
                rng = self._rngs[world] = seeding.np_random()[0]
            seeds.append(int(rng.integers(2**31)))
            starts += self.task.starts(rng)
        poses: dict[str, list[Ground]] = {}
        for name, pose in (item for start in starts for item in start.poses.items()):
            poses.setdefault(name, []).append(pose)
        self._reset_worlds(worlds, np.array(seeds), {name: np.array(all_) for name, all_ in poses.items()})
        rows = np.flatnonzero(mask)
        self._episodes.begin(rows, starts, self._cars())
        self.steps[rows] = 0

    def _drive(self, commands: NDArray[Any], worlds: Bools) -> None:
        """Run the ticks of one action, shape (worlds, cars, 2), in these worlds, shape (worlds,)."""
        self.batch.step(commands, self.settings.frame_skip, worlds)

    def _judge(self) -> Outcome:
        """What the last action led to."""
        is_unstable = np.repeat(self.batch.readings.is_unstable, self.car_count)
        self._seen = self._cars()
        return self._episodes.advance(self._seen, is_unstable, self._actions)

    def _cars(self) -> CarReadings:
        return CarReadings.of(self.batch.readings, self.car_count)

    def _ends(self, outcome: Outcome, is_late: Bools) -> tuple[Bools, Bools]:
        """Whether each episode ends by the last action, and whether it is truncated; `is_late`: by its time."""
        ended = outcome.has_ended
        if self.car_count == 1:
            return ended, is_late
        is_over = np.repeat(self._of_worlds(ended | is_late).any(axis=1), self.car_count)
        return ended, is_late | (is_over & ~ended)

    def _reset_worlds(self, worlds: NDArray[np.intp], seeds: Integers, poses: dict[str, Floats]) -> None:
        """Return these worlds to the start."""
        self.batch.reset(worlds, seeds, poses=poses, weather=self._weathers(worlds, self.conditions))

    def _weathers(self, worlds: NDArray[np.intp], conditions: Conditions) -> list[Weather] | None:
        """Of new episodes in these worlds; None: that of the scenario."""
        generators = [one for world in worlds.tolist() if (one := self._rngs[world]) is not None]
        return [one for rng in generators if (one := conditions.draw_weather(rng)) is not None] or None

    def _values(self, outcome: Outcome) -> dict[str, NDArray[Any]]:
        """What the infos say after a step."""
        values: dict[str, NDArray[Any]] = {"is_success": outcome.is_success}
        if self._has_offences:
            values |= zip(OFFENCES, self._seen.offences.T, strict=True)
        return values

    def _final(self, ended: Bools, values: dict[str, NDArray[Any]]) -> dict[str, Any]:
        """Observations and infos of the episodes that have just ended."""
        observations = np.full(self.num_envs, None, dtype=object)
        seen = self._observations()
        for row in np.flatnonzero(ended).tolist():
            observations[row] = {k: one[row] for k, one in seen.items()} if isinstance(seen, dict) else seen[row]
        final = _masked(values, ended)
        return {"final_obs": observations, "_final_obs": ended.copy(), "final_info": final, "_final_info": ended.copy()}

    def _mask(self, options: dict[str, Any] | None) -> Bools:
        """The environments to reset."""
        check_options(options, "reset_mask")
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if not isinstance(mask, np.ndarray) or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(f"options['reset_mask'] must be a numpy array of bool of shape ({self.num_envs},)")
        if not mask.any():
            raise ValueError("options['reset_mask'] must have at least one True")
        if (self._of_worlds(mask) != self._of_worlds(mask)[:, :1]).any():
            raise ValueError("options['reset_mask'] must be the same for all cars of a world")
        return mask


def _masked(values: dict[str, NDArray[Any]], mask: Bools) -> dict[str, NDArray[Any]]:
    """An info with these values of the environments of a mask, and the mask of each."""
    masked = values
    if not mask.all():
        masked = {name: np.where(mask, column, np.zeros_like(column)) for name, column in values.items()}
    return masked | {f"_{name}": mask.copy() for name in values}


def _world_seeds(seed: object, count: int) -> list[int | None]:
    """One for each of so many worlds, from one seed or several.

    Raises `CommandError` for what is no seed, `ValueError` for a wrong number of them.
    """
    if seed is None:
        return [None] * count
    if np.ndim(seed) == 0:  # pyright: ignore[reportArgumentType]
        first = whole_seed(seed)
        assert first is not None
        return [first + k for k in range(count)]
    seeds = [whole_seed(one) for one in seed]  # pyright: ignore[reportGeneralTypeIssues]
    if len(seeds) != count:
        raise ValueError(f"there must be {count} seeds, one for each world, not {len(seeds)}")
    return seeds


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """The mode, also by its name or value."""
    known = {text: one for one in AutoresetMode for text in (one.name, one.value)}
    if isinstance(mode, AutoresetMode):
        return mode
    if mode not in known:
        raise SpecError([f"autoreset_mode: {mode!r} is not known. {suggest(str(mode), list(known))}"])
    return known[mode]
