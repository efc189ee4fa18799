"""Head-to-head racing: two cars RoboRacer on the same track.

Variant "published": the benchmark of the AutoDRIVE Ecosystem (arXiv 2309.10007).

- Car, track and starts: see `porto`. With random tracks, the start is that of the variant "own".
- Observation, 55 numbers: for each of 27 rays 0 for a hit or 1 for none, and the distance as a part of the range of
  10 m; then the absolute forward speed [m/s], rounded to 0.01. The first ray points forward, the next ones by turns to
  the right and to the left, 10.385 degrees farther each.
- Actions: throttle 0.1, 0.5 or 1 with steering 1, 0 or -1, for 4 ms.
- Reward of a step: 0.01 times the absolute forward speed; instead of it 0.01 at one of 21 checkpoints, 0.1 for a lap,
  0.7 for a lap faster than all laps of the car since the last reset with a seed, -1 for a collision.
- End of a car's episode: a collision, or a lap from its start, which is the success.

The places of the checkpoints are choices: they are at equal distances.

Variant "own".

- Observation: motion and the shortest ranges in sectors of 5 degrees, all about -1 to 1 (`OWN`).
- Actions: throttle and steering, or the discrete choices of the other tasks.
- Reward of a step: the distance along the track that the car gains on its rival [m], plus 0.2 times its own; 5 for the
  winner, -5 for the loser, -5 for a collision.
- End: a collision ends the episode of the car, `laps` laps of one car end that of both; success is to win.
- Start: at rest behind the start line, which is anywhere on one of several tracks, 1 m behind each other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.base.jit import jit
from autodrive.experiments.envs import porto
from autodrive.experiments.envs.conditions import whole_number_errors
from autodrive.experiments.envs.path import follow
from autodrive.experiments.envs.settings import MOST_TICKS
from autodrive.experiments.envs.task import CarReadings, Feature, Start, StepOutcome
from autodrive.experiments.envs.time_trial import DRIVEN, PLACE, TICK, TRACK, TimeTrial
from autodrive.experiments.envs.variants import Variant, choices, is_published
from autodrive.scenario.tracks.track import Pose

CHECKPOINTS = 21
"""Number of checkpoints of a lap, at equal distances."""
OWN_GAIN, WIN = 0.2, 5.0
"""Factor of the own distance in the reward of a step, and the reward of the end, of the variant "own"."""
LIDAR = TimeTrial.scan
"""Sectors of the variant "own"."""
BEST, MARK = TimeTrial.memory_size, TimeTrial.memory_size + 1
"""More columns of the memory: best time of a lap before this episode [s], and the checkpoints that are passed."""

TICKS = 5
"""Ticks of an action, unless something else is chosen."""
PUBLISHED_TICK, PUBLISHED_TICKS = 0.001, 4
"""Duration of a tick of the variant "published" [s], and ticks of an action, unless something else is chosen."""

SIDES = [(k + 1) // 2 * (-1 if k % 2 else 1) for k in range(porto.RAYS)]
"""Number of each ray of the variant "published" to the left of that ahead; the order is that of ML-Agents."""
RAYS = np.array(SIDES) + max(SIDES)
"""Number of each ray in the scan, from right to left."""
BEARINGS = [side * porto.LAST_DEGREES / max(SIDES) for side in SIDES]
"""Bearings of the rays [deg], left positive."""
PUBLISHED = (
    *(
        feature
        for bearing in BEARINGS
        for feature in (
            Feature(f"miss_{bearing:g}", 0.0, 1.0, f"1 if the ray at {bearing:g} degrees, left positive, hits nothing"),
            Feature(
                f"distance_{bearing:g}",
                0.0,
                1.0,
                f"distance at which the ray at {bearing:g} degrees hits something / (10 m)",
            ),
        )
    ),
    Feature("speed", 0.0, 25.0, "absolute forward speed [m/s], rounded to 0.01"),
)
OWN = (
    Feature("speed", -2.5, 2.5, "forward speed / (10 m/s)"),
    Feature("side_speed", -1.0, 1.0, "speed to the left / (10 m/s)"),
    Feature("yaw_rate", -2.0, 2.0, "/ (10 rad/s), left positive"),
    Feature("steering", -2.0, 2.0, "angle of the steering actuator / (0.5 rad), left positive"),
    *(
        Feature(f"range_{bearing:g}", 0.0, 1.0, f"shortest range near a bearing of {bearing:g} degrees / (10 m)")
        for bearing in LIDAR.bearings
    ),
)


class Duel(TimeTrial):
    """The task of the duel in one of its variants, which the text of the module describes."""

    name = "duel"
    observation = "state"
    memory_size = TimeTrial.memory_size + 2

    def __init__(
        self,
        frame_skip: int | None = None,
        variant: Variant = "own",
        tracks: int | None = None,
        track_seed: int = 0,
        laps: int = 2,
    ) -> None:
        """`frame_skip`: ticks of an action; None: 4 of 1 ms if published, else 5 of 5 ms.

        `tracks`: number of random tracks, with the seeds from `track_seed` on; None: 3, or the track `porto` if
        published. Raises `SpecError`.
        """
        self.is_published = is_published(variant)
        usual = PUBLISHED_TICKS if self.is_published else TICKS
        self.frame_skip = usual if frame_skip is None else frame_skip
        if errors := whole_number_errors({"frame_skip": (self.frame_skip, 1, MOST_TICKS)}):
            raise SpecError(errors)
        self._has_published_starts = self.is_published and tracks is None
        super().__init__(
            self.frame_skip,
            3 if tracks is None else tracks,
            track_seed,
            cars=2,
            laps=laps,
            own=porto.track() if self._has_published_starts else None,
            vehicle=str(porto.car()) if self.is_published else "roboracer",
            tick=PUBLISHED_TICK if self.is_published else TICK,
        )
        self.features = PUBLISHED if self.is_published else OWN
        self.known = len(self.features)
        if self.is_published:
            self.choices = choices((0.1, 0.5, 1.0))
            # a little more than one scan in each step: rounded down, it would be a tick too late
            self.set_lidar(rate=(1.0 + 1e-9) / self._duration)

    def starts(self, rng: np.random.Generator) -> list[Start]:
        """Draw the starts of both cars; see `TimeTrial.starts`."""
        starts = super().starts(rng)
        if self._has_published_starts:
            poses = zip(self.scenario.vehicles, porto.starts(), strict=True)
            starts = [self._start(name, pose) for name, pose in poses]
        return [start._replace(memory=(*start.memory, math.inf, 0.0)) for start in starts]

    def _start(self, name: str, pose: Pose) -> Start:
        """A lap from a pose on the first track."""
        line = self.tracks.lines[0, : self.tracks.count[0], :2]
        place = np.hypot(*(line - pose[:2]).T).argmin()
        return Start({name: pose}, (0.0, float(place), 0.0, 0.0, 0.0))

    def set_lidar(self, **settings: Any) -> None:
        """Change these `SensorSettings` of the LIDARs of both cars."""
        vehicles = {
            name: car.model_copy(update={"sensors": {"lidar": car.sensors["lidar"].model_copy(update=settings)}})
            for name, car in self.scenario.vehicles.items()
        }
        self.scenario = self.scenario.model_copy(update={"vehicles": vehicles})

    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
        """Judge the last step; see `Task.evaluate`. The two cars of a world follow each other."""
        t = self.tracks
        gains = np.zeros(len(memory))
        _follow(cars, t.lines, t.count, t.length, self._reach, memory, gains)
        if self.is_published:
            _see_rays(cars, RAYS, features)
            _judge_published(cars, t.length, memory, outcome)
        else:
            _see_sectors(cars, features)
            _judge(cars, t.length, self._laps, gains, memory, outcome)


@jit
def _follow(
    cars: CarReadings, lines: Floats, counts: Integers, lengths: Floats, reach: int, memory: Floats, gains: Floats
) -> None:
    """Write the distance of each car along its track in the step [m] into `gains`."""
    for i in range(len(memory)):
        track = int(memory[i, TRACK])
        count = counts[track]
        gains[i] = follow(cars, i, lines[track], count, lengths[track] / count, reach, memory[i, PLACE:])[0]


@jit
def _see_rays(cars: CarReadings, rays: Integers, features: Floats) -> None:
    """Write the features `PUBLISHED`."""
    for i in range(len(features)):
        for k in range(len(rays)):
            distance = cars.lidar_ranges[i, rays[k]]
            features[i, 2 * k] = 1.0 if distance >= LIDAR.range_max else 0.0
            features[i, 2 * k + 1] = min(max(distance, 0.0), LIDAR.range_max) / LIDAR.range_max
        features[i, 2 * len(rays)] = np.rint(100.0 * abs(cars.velocity[i, 0])) / 100.0


@jit
def _judge_published(cars: CarReadings, lengths: Floats, memory: Floats, outcome: StepOutcome) -> None:
    for i in range(len(memory)):
        length = lengths[int(memory[i, TRACK])]
        has_collided, has_lapped = cars.collision_count[i] > 0, memory[i, DRIVEN] >= length
        reward = 0.01 * abs(cars.velocity[i, 0])
        passed = math.floor(memory[i, DRIVEN] * CHECKPOINTS / length)
        if passed > memory[i, MARK]:
            memory[i, MARK] = passed
            reward = 0.01
        if has_lapped:
            reward = 0.7 if cars.time[i] < memory[i, BEST] else 0.1
        if has_collided:
            reward = -1.0
        outcome.reward[i] = reward
        outcome.has_ended[i] = has_collided or has_lapped
        outcome.is_success[i] = has_lapped and not has_collided
        if outcome.is_success[i]:
            memory[i, BEST] = min(memory[i, BEST], cars.time[i])


@jit
def _see_sectors(cars: CarReadings, features: Floats) -> None:
    """Write the features `OWN`."""
    for i in range(len(features)):
        features[i, 0], features[i, 1] = 0.1 * cars.velocity[i, 0], 0.1 * cars.velocity[i, 1]
        features[i, 2], features[i, 3] = 0.1 * cars.angular_velocity[i, 2], 2.0 * cars.steering[i]
        each = cars.lidar_ranges.shape[1] // LIDAR.sectors
        for sector in range(LIDAR.sectors):
            shortest = LIDAR.range_max
            for ray in range(sector * each, (sector + 1) * each):
                shortest = min(shortest, cars.lidar_ranges[i, ray])
            features[i, 4 + sector] = max(shortest, 0.0) / LIDAR.range_max


@jit
def _judge(cars: CarReadings, lengths: Floats, laps: int, gains: Floats, memory: Floats, outcome: StepOutcome) -> None:
    for i in range(len(memory)):
        rival = i + 1 if i % 2 == 0 else i - 1
        goal = laps * lengths[int(memory[i, TRACK])]
        has_collided = cars.collision_count[i] > 0
        lead = memory[i, DRIVEN] - memory[rival, DRIVEN]
        is_ahead = lead > 0.0 or (lead == 0.0 and i < rival)
        has_won = memory[i, DRIVEN] >= goal and is_ahead and not has_collided
        has_lost = memory[rival, DRIVEN] >= goal and not is_ahead and cars.collision_count[rival] == 0
        reward = gains[i] - gains[rival] + OWN_GAIN * gains[i]
        if has_collided or has_lost:
            reward -= WIN
        elif has_won:
            reward += WIN
        outcome.reward[i] = reward
        outcome.has_ended[i] = has_collided or has_won or has_lost
        outcome.is_success[i] = has_won
