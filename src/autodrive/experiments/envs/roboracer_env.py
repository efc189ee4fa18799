"""The Gymnasium environments of the car RoboRacer: time trials and races, on the batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.conditions import WEATHER, CarConditions, DelayedDrive, Range, whole_number_errors
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv, of_one_world
from autodrive.experiments.envs.race_tracks import AREA
from autodrive.experiments.envs.settings import ALL, MOST_CARS
from autodrive.experiments.envs.single_env import SingleEnv
from autodrive.experiments.envs.task import StepOutcome
from autodrive.experiments.envs.time_trial import DRIVEN, LENGTH, WIDTH, TimeTrial, TrackLike
from autodrive.protocol.commands import is_number

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats, Integers
    from autodrive.world.views.batch_camera import BatchCamera

IMAGE_SIZE = 640, 360
"""Width and height of the images of 'rgb_array' [pixels]."""


class RoboRacerVectorEnv(DrivingVectorEnv):
    """Many time trials, or races of several cars: see `autodrive.experiments.envs.time_trial`.

    With `cars` 2 to 8, environment k is car k % cars of world k // cars. The cars start from a grid; if one of them
    collides, the race ends for all. `rivalry` adds to the reward of each step the distance that the car gains on the
    mean of its rivals in that step [m], times this factor.

    `track`: name or file of an own track, or several. Without it there are `tracks` random tracks with the seeds
    `track_seed`, `track_seed` + 1, ..., of `track_width` and `track_length` [m] or each with its own from these ranges;
    `track_radius` is the least of the centre line in curves [m], by default the width of the track and at least 1 m;
    `track_area` is the ground of each track along x and y [m]. Each episode is on one of the tracks, by its seed.
    `reward`, `end`: functions of an `own_rules.Step`, instead of the reward and the ends of the task. `friction`,
    `mass`, `noise`, `latency`, `fog`, `rain`, `snow`: see `Conditions`. `conditions` may be replaced at any time, for
    the episodes that follow. `laps`: after which `info["is_success"]` is true.
    """

    task_type: type[TimeTrial] = TimeTrial
    drawn_conditions = (*CarConditions._fields, *WEATHER)

    setting_names = ALL - {"map", "traffic", "offence_cost"}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        cars: int = 1,
        laps: int = 1,
        rivalry: float = 0.0,
        track: TrackLike | Sequence[TrackLike] | None = None,
        tracks: int = 3,
        track_seed: int = 0,
        track_width: Range = WIDTH,
        track_length: Range = LENGTH,
        track_radius: Range | None = None,
        track_area: tuple[float, float] = AREA,
        frame_skip: int = 5,
        **settings: Any,
    ) -> None:
        """`settings`: see `EnvSettings`. Raises as `DrivingVectorEnv`."""
        errors = whole_number_errors({"cars": (cars, 1, MOST_CARS)})
        if not (is_number(rivalry) and 0.0 <= rivalry <= (10.0 if cars > 1 else 0.0)):
            errors.append(f"rivalry: must be a number from 0 to 10, and 0 for a single car, not {rivalry!r}")
        if errors:
            raise SpecError(errors)
        task = self.task_type(
            frame_skip,
            tracks,
            track_seed,
            int(cars),
            laps,
            width=track_width,
            length=track_length,
            radius=track_radius,
            area=track_area,
            own=track,
        )
        super().__init__(num_envs, task, frame_skip=frame_skip, **settings)
        self._driver = DelayedDrive(self.batch, frame_skip)
        self.drawn = np.ones((num_envs, len(CarConditions._fields)))
        """The conditions of the present episodes, shape (n, 6), in the order of `CarConditions`."""
        self._rivalry = rivalry

    @property
    def distance(self) -> Floats:
        """Distance along the centre line since the start of each episode [m], shape (n,)."""
        return self._episodes.memory[:, DRIVEN].copy()

    def _drive(self, commands: NDArray[Any], worlds: NDArray[np.bool_]) -> None:
        self._driver.step(commands, worlds)

    def _judge(self) -> StepOutcome:
        before = self.distance
        outcome = super()._judge()
        if self._rivalry:
            gain = self._of_worlds(self.distance - before)
            rivals = (gain.sum(axis=1, keepdims=True) - gain) / (self.car_count - 1)
            outcome.reward[:] += self._rivalry * (gain - rivals).ravel()
        return outcome

    def _reset_worlds(self, worlds: NDArray[np.intp], seeds: Integers, poses: dict[str, Floats]) -> None:
        generators = [self._rngs[world] for world in worlds.tolist()]
        drawn = [self.conditions.draw(rng) for rng in generators if rng is not None for _ in range(self.car_count)]
        weathers = self._weathers(worlds, self.conditions)
        self._of_worlds(self.drawn)[worlds] = drawn = self._of_worlds(np.array(drawn))
        friction, mass, noise, latency, drive, trim = drawn.transpose(2, 0, 1)
        factors = {"grip": friction, "mass": mass, "noise": noise, "drive": drive, "trim": trim}
        self.batch.reset(worlds, seeds, poses=poses, weather=weathers, **factors)
        self._driver.reset(worlds, latency)


class RoboRacerEnv(SingleEnv):
    """One time trial. `info["is_success"]` says after each step whether a whole lap is driven."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 40.0}  # noqa: RUF012
    vector: RoboRacerVectorEnv

    def __init__(self, *, render_mode: str | None = None, **settings: Any) -> None:
        """`settings`: those of `RoboRacerVectorEnv`. 'rgb_array' draws the image of the front camera."""
        if render_mode not in (None, "rgb_array"):
            raise SpecError([f"render_mode: {render_mode!r} is not known. Known: rgb_array"])
        super().__init__(of_one_world(self, RoboRacerVectorEnv, 1, **settings), render_mode)
        self._camera: BatchCamera | None = None

    @property
    def distance(self) -> float:
        """Along the centre line since the start of the episode [m]."""
        return float(self.vector.distance[0])

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The image of the front camera with 'rgb_array', shape (360, 640, 3)."""
        if self.render_mode is None:
            return None
        from autodrive.world.views.batch_camera import BatchCamera  # noqa: PLC0415  OpenGL waits until an image is wanted

        if self._camera is None:
            self._camera = BatchCamera(self.vector.batch.compiled, "V1", "front", size=IMAGE_SIZE)
        return self._camera.render(self.vector.batch.pictures())[0]

    def close(self) -> None:
        """End the threads, and free the renderers."""
        super().close()
        if self._camera is not None:
            self._camera.close()
