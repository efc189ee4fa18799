"""The Gymnasium vector environment: many cars, each in a world of its own or some in each, in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.base.suggest import check_keywords
from autodrive.experiments.envs.conditions import WEATHER, Conditions, checked_conditions, whole_number_errors
from autodrive.experiments.envs.episodes import Episodes, observation_space
from autodrive.experiments.envs.remade import Remade
from autodrive.experiments.envs.rendered_world import batch_camera, check_cameras
from autodrive.experiments.envs.settings import (
    ALL,
    MOST_ENVS,
    OF_CARS,
    action_space,
    autoreset_mode,
    check_changeable,
    check_options,
    checked_settings,
    commands_of,
    known_arguments,
    made_task,
    whole_seed,
)
from autodrive.experiments.envs.task import OFFENCES, Bools, CarReadings, Ground, Start, StepOutcome, Task
from autodrive.protocol.messages import Weather
from autodrive.world.batch import BatchWorld

if TYPE_CHECKING:
    from autodrive.world.views.batch_camera import BatchCamera


class DrivingVectorEnv(Remade, VectorEnv[Any, Any, Any]):
    """Environment k has the bits of a `DrivingEnv` that is reset with its seed and driven with its actions.

    If the scenario of the task has several cars, environment k is car k % cars of world k // cars. The episodes of a
    world begin together and end together: if that of one car ends, the others are truncated.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    drawn_conditions: tuple[str, ...] = WEATHER
    """Names of the `Conditions` that an episode draws."""

    setting_names: frozenset[str] = ALL - OF_CARS
    """Names of the `EnvSettings` that the environment has."""

    def __init__(self, num_envs: int = 1, task: str | Task = "lane_keeping", **settings: Any) -> None:
        """`task`: its name, or one that is already made. `settings`: see `EnvSettings`.

        Raises `TypeError` for settings that it does not have, `SpecError` for wrong ones, and `GlUnavailable` for
        images without OpenGL.
        """
        checked = checked_settings(type(self), task, settings, self.setting_names)
        if errors := whole_number_errors({"num_envs": (num_envs, 1, MOST_ENVS)}):
            raise SpecError(errors)
        self.autoreset_mode = autoreset_mode(checked)
        self.metadata = {**type(self).metadata, "autoreset_mode": self.autoreset_mode}
        self.task = made_task(task, checked.frame_skip, checked.map, checked.traffic)
        self.settings = replace(checked, choices=self.task.choices)
        self.conditions = checked.conditions
        seen = checked.observation or self.task.observation
        self._has_camera = seen == "camera"
        self.num_envs = num_envs = int(num_envs)
        self.car_count = len(self.task.scenario.vehicles)
        """Cars of a world."""
        if num_envs % self.car_count:
            raise SpecError([f"num_envs: with {self.car_count} cars in a world it must be a multiple, not {num_envs}"])
        self.single_observation_space = observation_space(self.task, seen)
        self.single_action_space = action_space(self.settings)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._max_steps = None if checked.max_episode_steps == -1 else checked.max_episode_steps
        self.batch: BatchWorld = self._worlds(num_envs // self.car_count, checked.threads)
        """The worlds."""
        self._episodes = Episodes(self.task, seen, num_envs, checked.offence_cost, checked.reward, checked.end)
        self._actions = np.zeros((num_envs, 2))
        """Throttle and steering of the last step."""
        self._has_offences = bool(self.batch.map.stop_lines)
        self._rngs: list[np.random.Generator | None] = [None] * self.batch.n
        self.steps = np.zeros(num_envs, np.int64)
        """Steps of the present episodes; a learning library may write others, so that not all are truncated at once."""
        self._has_ended = np.zeros(num_envs, np.bool_)

    def _worlds(self, count: int, threads: int | None) -> Any:
        """A batch of that number of worlds, or what does its work."""
        if (mode := self.settings.render_mode) is not None:
            raise SpecError(
                [f"render_mode {mode!r}: a vector environment draws no images for people; use gymnasium.make"]
            )
        batch = BatchWorld(self.task.scenario, count, threads=threads)
        if self._has_camera:
            check_cameras(batch.compiled, batch.commanded_names, must_be_ideal=True)
        return batch

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
        for camera in self._cameras if "_cameras" in vars(self) else ():
            camera.close()

    @cached_property
    def _cameras(self) -> list[BatchCamera]:
        """The cameras of each car of all worlds. As late as possible: see `RenderedWorld.world`."""
        return [batch_camera(self.batch.compiled, vehicle) for vehicle in self.batch.commanded_names]

    def _observations(self) -> Any:
        numbers = self._episodes.numbers()
        if not self._has_camera:
            return numbers
        return {"image": self._images(), "state": numbers}

    def _images(self) -> NDArray[np.uint8]:
        """Images of the front cameras, shape (num_envs, height, width, 3)."""
        pictures = self.batch.pictures()
        images = [camera.render(pictures) for camera in self._cameras]
        return np.stack(images, axis=1).reshape(self.num_envs, *images[0].shape[1:])

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
        for start in starts:
            for name, pose in start.poses.items():
                poses.setdefault(name, []).append(pose)
        self._reset_worlds(worlds, np.array(seeds), {name: np.array(all_) for name, all_ in poses.items()})
        rows = np.flatnonzero(mask)
        self._episodes.begin(rows, starts, self._cars())
        self.steps[rows] = 0

    def _drive(self, commands: NDArray[Any], worlds: Bools) -> None:
        """Run the ticks of one action, shape (worlds, cars, 2), in these worlds, shape (worlds,)."""
        self.batch.step(commands, self.settings.frame_skip, worlds)

    def _judge(self) -> StepOutcome:
        """What the last action led to."""
        is_unstable = np.repeat(self.batch.readings.is_unstable, self.car_count)
        self._seen = self._cars()
        return self._episodes.advance(self._seen, is_unstable, self._actions)

    def _cars(self) -> CarReadings:
        return CarReadings.of(self.batch.readings, self.car_count)

    def _ends(self, outcome: StepOutcome, is_late: Bools) -> tuple[Bools, Bools]:
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
        """Draw the weather of new episodes in these worlds; None: that of the scenario."""
        generators = [rng for world in worlds.tolist() if (rng := self._rngs[world]) is not None]
        return [drawn for rng in generators if (drawn := conditions.draw_weather(rng)) is not None] or None

    def _values(self, outcome: StepOutcome) -> dict[str, NDArray[Any]]:
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
            observations[row] = (
                {name: part[row] for name, part in seen.items()} if isinstance(seen, dict) else seen[row]
            )
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
    seeds = [whole_seed(world_seed) for world_seed in seed]  # pyright: ignore[reportGeneralTypeIssues]
    if len(seeds) != count:
        raise ValueError(f"there must be {count} seeds, one for each world, not {len(seeds)}")
    return seeds


Vector = TypeVar("Vector", bound=DrivingVectorEnv)


def of_one_world(env: object, kind: type[Vector], cars: int, /, *task: str | Task, **settings: Any) -> Vector:
    """The vector environment of that class with one world of so many cars, which does the work of `env`.

    Raises `TypeError`, which names the class of `env`, for a setting that it does not have.
    """
    known = [*known_arguments(type(env)), *known_arguments(kind, kind.setting_names)]
    of_many_worlds = {"num_envs", "autoreset_mode", "threads"}
    check_keywords(type(env).__name__, settings, [name for name in dict.fromkeys(known) if name not in of_many_worlds])
    return kind(cars, *task, autoreset_mode=AutoresetMode.DISABLED, threads=1, **settings)
