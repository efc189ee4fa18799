"""Settings of all environments: the task, what is observed, the action and how long it lasts."""

from __future__ import annotations

import inspect
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from numbers import Integral
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError, SpecError
from autodrive.base.suggest import check_keywords, suggest
from autodrive.experiments.envs.conditions import Conditions, Range, whole_number_errors
from autodrive.experiments.envs.lane_keeping import LaneKeeping
from autodrive.experiments.envs.navigation import Navigation
from autodrive.experiments.envs.own_rules import End, Reward
from autodrive.experiments.envs.parking import Parking
from autodrive.experiments.envs.task import CHOICES, Observation, Task
from autodrive.experiments.envs.time_trial import TimeTrial
from autodrive.protocol.commands import is_number
from autodrive.scenario.scenario import TrafficSpec

Action: TypeAlias = Literal["continuous", "discrete"]

TASKS: dict[str, type[Task]] = {task.name: task for task in (LaneKeeping, Parking, Navigation, TimeTrial)}

MOST_TICKS = 50
"""Greatest number of ticks of an action: after 0.5 s the command of a vehicle times out."""

MOST_CARS = 8
"""Greatest number of cars of a race, or on one lane."""
MOST_ENVS, MOST_STEPS = 2**20, 2**53
"""Limits of `num_envs` and `max_episode_steps`."""
MOST_TRAFFIC = 50
"""Greatest number of cars of the traffic; see `TrafficSpec`."""
IMAGE_WIDTH, IMAGE_HEIGHT = 128, 96
"""Width and height of the observation 'camera' [pixels]."""


@dataclass(frozen=True, kw_only=True)
class EnvSettings:
    """Checked settings, which are keyword arguments of the environments; raises `SpecError` with all errors."""

    task: str | None = None
    """Name of the task; None: the environment has a task that is already made."""
    observation: Observation | None = None
    """What is observed; None: the default of the task."""
    action: Action = "continuous"
    frame_skip: int = 5
    """Ticks of 10 ms, or 5 ms for the car RoboRacer, that an action lasts."""
    render_mode: str | None = None
    """Render mode of an environment of one world: 'rgb_array' or 'human'."""
    choices: Floats = field(default_factory=lambda: CHOICES)
    """Throttle and steering of each discrete action of the task, shape (n, 2)."""
    map: str | Path | None = None
    """Name or file of a map on which lane keeping drives; None: its own."""
    reward: Reward | None = None
    """Function of an `own_rules.Step`, instead of the reward of the task."""
    end: End | None = None
    """Function of an `own_rules.Step`, instead of the ends of the task."""
    traffic: int = 0
    """Cars that drive themselves in each world, 0 to 50; the map must have lanes for them. Each episode has its own
    places, speeds and ways of them."""
    offence_cost: float = 0.0
    """Cost that each red light and stop sign that is run subtracts from the reward, 0 to 1000."""
    max_episode_steps: int | None = None
    """Steps after which an episode is truncated; None or -1: never."""
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP
    """Mode of Gymnasium, also by its name or value: what happens in a vector environment when an episode has ended."""
    threads: int | None = None
    """Threads of a batch; None: one for each core."""
    friction: Range = 1.0
    """Factor of the friction of the tyres; see `Conditions`."""
    mass: Range = 1.0
    """Factor of the mass and the inertia; see `Conditions`."""
    noise: Range = 0.0
    """Factor of the noise of the sensors; see `Conditions`."""
    latency: Range = 0.0
    """Time from an action until the car obeys it [s]; see `Conditions`."""
    drive: Range = 1.0
    """Factor of the torque of the motors; see `Conditions`."""
    trim: Range = 0.0
    """Angle that is added to that of the steered wheels [rad]; see `Conditions`."""
    fog: Range = 0.0
    """Amount of fog; see `Conditions`."""
    rain: Range = 0.0
    """Amount of rain; see `Conditions`."""
    snow: Range = 0.0
    """Amount of snow; see `Conditions`."""

    @property
    def conditions(self) -> Conditions:
        """What episodes draw. Raises `SpecError`."""
        return Conditions(**{name: getattr(self, name) for name in Conditions.__dataclass_fields__})

    def __post_init__(self) -> None:
        choices: dict[str, list[Any]] = {
            "task": [*TASKS],
            "observation": [*get_args(Observation)],
            "action": [*get_args(Action)],
            "render_mode": ["rgb_array", "human"],
        }
        errors = [
            f"{name}: {value!r} is not known. {suggest(str(value), known)}"
            for name, known in choices.items()
            if (value := getattr(self, name)) not in known and not (value is None and name != "action")
        ]
        ticks = self.frame_skip
        if isinstance(ticks, bool) or not isinstance(ticks, int) or not 1 <= ticks <= MOST_TICKS:
            errors.append(f"frame_skip: must be a whole number of ticks from 1 to {MOST_TICKS}, not {ticks!r}")
        if not (is_number(self.offence_cost) and 0.0 <= self.offence_cost <= 1e3):
            errors.append(f"offence_cost: must be a number from 0 to 1000, not {self.offence_cost!r}")
        errors += whole_number_errors({"traffic": (self.traffic, 0, MOST_TRAFFIC)})
        modes = {text for mode in AutoresetMode for text in (mode.name, mode.value)}
        if not isinstance(self.autoreset_mode, AutoresetMode) and self.autoreset_mode not in modes:
            known = suggest(str(self.autoreset_mode), sorted(modes))
            errors.append(f"autoreset_mode: {self.autoreset_mode!r} is not known. {known}")
        if self.max_episode_steps not in (None, -1):  # -1: as in gymnasium.make
            errors += whole_number_errors({"max_episode_steps": (self.max_episode_steps, 1, MOST_STEPS)})
        if errors:
            raise SpecError(errors)


ALL = frozenset(EnvSettings.__dataclass_fields__) - {"task", "choices"}
OF_CARS = frozenset({"friction", "mass", "noise", "latency"})
"""Conditions that only the environments of the car RoboRacer draw."""
OF_TASKS = frozenset({"map", "reward", "end", "traffic", "offence_cost", "observation"})
"""Settings that environments with a task of their own do not have."""


OTHER_ARGUMENTS = frozenset({"self", "task", "settings", "arguments"})


def known_arguments(kind: Any, names: Collection[str] = ()) -> list[str]:
    """Names of the arguments of an environment of that class. `names`: its settings besides its own arguments."""
    own = [name for name in inspect.signature(kind.__init__).parameters if name not in OTHER_ARGUMENTS]
    return [*own, *sorted(set(names).difference(own))]


def checked_settings(kind: Any, task: str | Task, settings: dict[str, Any], names: Collection[str]) -> EnvSettings:
    """Settings of an environment of that class. `names`: settings that it has besides its own arguments.

    Raises `TypeError` for another one, and `SpecError` for wrong values.
    """
    check_keywords(kind.__name__, settings, known_arguments(kind, names))
    return EnvSettings(task=task if isinstance(task, str) else None, **settings)


def autoreset_mode(settings: EnvSettings) -> AutoresetMode:
    """The mode, which the settings may have by its name or value."""
    chosen = settings.autoreset_mode
    return next(mode for mode in AutoresetMode if chosen in (mode, mode.name, mode.value))


def made_task(task: str | Task, frame_skip: int, map: str | Path | None, traffic: int) -> Task:
    """The task of that name on that map (None: its own), or one that is already made, with traffic.

    Raises `SpecError` for a map where the task has none.
    """
    if map is None:
        made = TASKS[task](frame_skip) if isinstance(task, str) else task
    elif task == LaneKeeping.name:
        made = LaneKeeping(frame_skip, map=map)
    else:
        raise SpecError(
            ["map: only lane keeping accepts another map; for another task on that map, write a Task of your own"]
        )
    return with_traffic(made, traffic)


def with_traffic(task: Task, cars: int) -> Task:
    """The task with so many cars that drive themselves in its scenario, behind its own vehicles."""
    if cars:
        task.scenario = task.scenario.model_copy(update={"traffic": TrafficSpec(cars=cars)})
    return task


def whole_seed(seed: object) -> int | None:
    """The seed of an episode as Gymnasium needs it, which refuses the integers of numpy. Raises `CommandError`."""
    if seed is None:
        return None
    if isinstance(seed, bool) or not isinstance(seed, Integral) or int(seed) < 0:
        raise CommandError(f"a seed must be a whole number from 0 on, not {seed!r}")
    return int(seed)


CHANGEABLE = "conditions"
"""The only attribute of an environment that may be set."""


def check_changeable(name: str) -> None:
    """Raises `SpecError` for an attribute that nothing reads after the environment was made."""
    if name != CHANGEABLE:
        raise SpecError(
            [f"{name}: a change would have no effect. Make a new environment with other settings, or set {CHANGEABLE}"]
        )


def checked_cars(cars: int) -> int:
    """The number of cars of a world. Raises `SpecError`."""
    if errors := whole_number_errors({"cars": (cars, 2, MOST_CARS)}):
        raise SpecError(errors)
    return int(cars)


def check_options(options: Mapping[str, Any] | None, *known: str) -> None:
    """Raises `SpecError` for an option of `reset` that is not known."""
    errors = [
        f"options: {name!r} is not known. {suggest(str(name), [*known]) if known else 'This environment has none.'}"
        for name in options or {}
        if name not in known
    ]
    if errors:
        raise SpecError(errors)


def action_space(settings: EnvSettings) -> spaces.Space[Any]:
    """Throttle and steering from -1 to 1 (left is positive), or the number of one of the choices."""
    if settings.action == "discrete":
        return spaces.Discrete(len(settings.choices))
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def commands_of(actions: Any, settings: EnvSettings, count: int) -> NDArray[Any]:
    """Throttle and steering of that number of actions, shape (count, 2); the world limits them to [-1, 1]."""
    shape = (count,) if settings.action == "discrete" else (count, 2)
    try:
        values = np.asarray(actions)
    except ValueError:  # rows of different lengths
        values = np.empty(0, object)
    kinds = "iu" if settings.action == "discrete" else "fiu"
    if values.dtype.kind not in kinds or values.shape not in (shape, shape[1:] if count == 1 else shape):
        number = "whole numbers" if settings.action == "discrete" else "throttle and steering as numbers"
        wanted = (2,) if shape == (1, 2) else shape
        raise CommandError(f"actions must be {number} of the shape {wanted}, not {_described(values)}")
    if settings.action == "continuous":
        return values.reshape(shape)
    if not ((values >= 0) & (values < len(settings.choices))).all():
        raise CommandError(f"actions must be from 0 to {len(settings.choices) - 1}, not {values.tolist()}")
    return settings.choices[values.reshape(shape)]


def _described(values: NDArray[Any]) -> str:
    return f"{values.dtype} of the shape {values.shape}" if values.dtype != object else "a list of other things"
