"""Time trial of the car RoboRacer: drive as far as possible along a random race track without a collision.

- Start: at rest on one of the tracks, anywhere, up to 0.1 m beside its centre line and up to 0.2 rad off its direction.
- Reward of a step: the distance along the centre line in the step [m]; -5 if the episode ends by a collision.
- End: a collision, or more than 90 degrees off the direction of the track.
- Success: a whole lap; the episode continues.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.base.jit import jit
from autodrive.experiments.envs import path
from autodrive.experiments.envs.conditions import Range, range_errors, whole_number_errors
from autodrive.experiments.envs.path import beside, follow, look_ahead
from autodrive.experiments.envs.race_tracks import AREA, SPACING, OwnTracks, RaceTracks
from autodrive.experiments.envs.task import CarReadings, Feature, ScanView, Start, StepOutcome, Task, uniform, wrapped
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.tracks.track import Track

TrackLike: TypeAlias = str | Path | Track
"""Name or file of a track, or a track."""
TICK = 0.005
"""Duration of a tick [s]: an action of five ticks lasts as long as a scan."""
PREVIEW = (0.5, 1.0, 2.0, 4.0)
"""Distances along the track of the points ahead that are observed [m]."""
TOP_SPEED = 24.0
"""A car is not faster [m/s]."""
START_ANGLE = 0.2
"""Largest angle of a start from the direction of the track [rad]; see also `race_tracks.MOST_ASIDE`."""
GRID_STEP, GRID_SIDE = 1.0, 0.3
"""Distance of the places of a grid along the track, and from the centre line [m]."""
FAILURE = -5.0
"""Reward of a step that ends an episode."""
MOST_TRACKS = 64
WIDTH, LEAST_WIDTH, MOST_WIDTH = 1.4, 0.8, 2.0
"""Width of a track [m]: if nothing is chosen, least and greatest."""
LENGTH, LEAST_LENGTH, MOST_LENGTH = 40.0, 30.0, 120.0
"""Length of a track [m]: if nothing is chosen, least and greatest."""
LEAST_RADIUS, MOST_RADIUS = 0.6, 4.0
"""Least and greatest radius of curves [m]: the car turns with 0.59 m."""
LEAST_AREA, MOST_AREA = 6.0, 60.0
"""Least and greatest side of the ground of a track [m]."""

WHEEL_RADIUS = 0.059
"""Radius of the wheels [m]: vehicles/roboracer.yaml."""
WHEEL_SPEEDS = -5.0, 25.0
"""Limits of the speed from the encoders [m/s]; beyond them a reading was lost."""
KNOWN = 5
TRACK, PLACE, DRIVEN, ANGLE = 0, 1, 1 + path.DRIVEN, 4
"""Columns of the memory: number of the track, from `PLACE` on the memory of `path.follow`, and the mean angle of the
rear wheels [rad], which begins with zero; `DRIVEN` is from the start line of the episode."""


class TimeTrial(Task):
    """The time trial on race tracks, which the text of the module describes."""

    name = "time_trial"
    features = (
        Feature("speed", -10.0, 25.0, "forward speed [m/s]"),
        Feature("side_speed", -10.0, 10.0, "speed to the left [m/s]"),
        Feature("yaw_rate", -20.0, 20.0, "[rad/s], left positive"),
        Feature("steering", -1.0, 1.0, "angle of the steering actuator [rad], left positive"),
        Feature("wheel_speed", *WHEEL_SPEEDS, "mean speed of the rear wheels in the step, from the encoders [m/s]"),
        *path.line_features(PREVIEW, "track", 5.0, most_offset=2.0),
    )
    known = KNOWN
    observation = "lidar"
    memory_size = 5
    scan = ScanView(first_degree=-135.0, degrees=5.0, sectors=54, range_max=10.0)

    def __init__(
        self,
        frame_skip: int,
        tracks: int = 3,
        track_seed: int = 0,
        cars: int = 1,
        laps: int = 1,
        width: Range = WIDTH,
        length: Range = LENGTH,
        radius: Range | None = None,
        area: tuple[float, float] = AREA,
        own: TrackLike | Sequence[TrackLike] | None = None,
        vehicle: str = "roboracer",
        tick: float = TICK,
    ) -> None:
        """`laps`: after which the task is accomplished. `width`, `length`, `radius`, `area`: see `RaceTracks` [m].

        `own`: a track or several, instead of random ones. `vehicle`: name or file. `tick`: duration of a tick [s].
        Raises `SpecError`.
        """
        errors = whole_number_errors(
            {"tracks": (tracks, 1, MOST_TRACKS), "track_seed": (track_seed, 0, 2**31), "laps": (laps, 1, 1000)}
        )
        ranges: dict[str, tuple[object, float, float]] = {
            "track_width": (width, LEAST_WIDTH, MOST_WIDTH),
            "track_length": (length, LEAST_LENGTH, MOST_LENGTH),
        }
        if radius is not None:
            ranges["track_radius"] = radius, LEAST_RADIUS, MOST_RADIUS
        errors += range_errors(ranges) + _area_errors(area)
        if errors:
            raise SpecError(errors)
        if own is None:
            curves = None if radius is None else _ends(radius)
            self.tracks = RaceTracks(int(tracks), int(track_seed), _ends(width), _ends(length), curves, area)
        else:
            random = tracks, track_seed, width, length, radius, area
            if random != (3, 0, WIDTH, LENGTH, None, AREA):
                raise SpecError(
                    ["track: the settings of random tracks (tracks, track_seed, ...) do not apply to a given track"]
                )
            self.tracks = OwnTracks([own] if isinstance(own, str | Path | Track) else [*own])
        self._laps = int(laps)
        self.scenario = ScenarioSpec(
            map=str(self.tracks.file),
            vehicles={
                name: VehiclePlacement(
                    type=vehicle,
                    x=x,
                    y=y,
                    yaw_deg=math.degrees(yaw),
                    sensors={"lidar": SensorSettings(noise="realistic")},
                )
                for name, (x, y, yaw) in self._grid(0, int(self.tracks.starts[0][0]), cars).items()
            },
            tick=tick,
        )
        self._preview = np.array([round(distance / SPACING) for distance in PREVIEW])
        self._duration = tick * frame_skip
        self._reach = math.ceil(TOP_SPEED * self._duration / SPACING) + 2

    def start(self, rng: np.random.Generator) -> Start:
        """A place on one of the tracks."""
        track = int(rng.integers(len(self.tracks.count)))
        starts = self.tracks.starts[track]
        place = int(starts[rng.integers(len(starts))])
        aside, turn = uniform(rng, (float(self.tracks.room[track][place]), START_ANGLE))
        x, y, yaw = self.tracks.pose(track, place, aside)
        return Start({"V1": (x, y, wrapped(yaw + turn))}, (float(track), float(place), 0.0, 0.0, 0.0))

    def starts(self, rng: np.random.Generator) -> list[Start]:
        """A grid of all cars behind a start line anywhere on one of the tracks, in a random order. One car: `start`."""
        if len(self.scenario.vehicles) == 1:
            return [self.start(rng)]
        track = int(rng.integers(len(self.tracks.count)))
        line = int(rng.integers(self.tracks.count[track]))
        names = list(self.scenario.vehicles)
        grid = list(self._grid(track, line, len(names)).values())
        starts = []
        for name, place in zip(names, rng.permutation(len(names)).tolist(), strict=True):
            back = _steps_back(place)
            memory = (float(track), float((line - back) % self.tracks.count[track]), 0.0, -back * SPACING, 0.0)
            starts.append(Start({name: grid[place]}, memory))
        return starts

    def _grid(self, track: int, line: int, cars: int) -> dict[str, tuple[float, float, float]]:
        side = GRID_SIDE if cars > 1 else 0.0
        return {
            f"V{k + 1}": self.tracks.pose(track, line - _steps_back(k), side if k % 2 == 0 else -side)
            for k in range(cars)
        }

    def measures(self, cars: CarReadings, memory: Floats) -> dict[str, Floats]:
        """`distance`, `offset` and `angle` of each car; see `Task.measures` and `path.beside`."""
        track, place = (memory[:, column].astype(np.int64) for column in (TRACK, PLACE))
        return {"distance": memory[:, DRIVEN].copy(), **beside(cars, self.tracks.lines[track, place])}

    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
        """Judge the last step; see `Task.evaluate`.

        The nearest point is sought around the last one: parts of a track may be near.
        """
        t = self.tracks
        track = t.lines, t.count, t.length
        _judge(cars, *track, self._laps, self._reach, self._duration, self._preview, memory, features, outcome)


def _area_errors(area: object) -> list[str]:
    """What is no ground of a track."""
    sides: tuple[object, ...] = area if isinstance(area, tuple) else ()
    limits = LEAST_AREA, MOST_AREA
    if len(sides) == 2 and not any(isinstance(side, tuple) or range_errors({"": (side, *limits)}) for side in sides):
        return []
    return [f"track_area: must be two numbers from {LEAST_AREA:g} to {MOST_AREA:g}, along x and y, not {area!r}"]


def _ends(limits: Range) -> tuple[float, float]:
    return limits if isinstance(limits, tuple) else (limits, limits)


def _steps_back(place: int) -> int:
    """Points of the centre line from the start line back to a place of the grid, from 0."""
    return round((1 + place) * GRID_STEP / SPACING)


@jit
def wheel_speed(turned: float, duration: float) -> float:
    """Speed of wheels that turned by this angle [rad] in the time `duration` [s], within `WHEEL_SPEEDS` [m/s]."""
    return min(max(WHEEL_RADIUS * turned / duration, WHEEL_SPEEDS[0]), WHEEL_SPEEDS[1])


@jit
def _judge(
    cars: CarReadings,
    lines: Floats,
    counts: Integers,
    lengths: Floats,
    laps: int,
    reach: int,
    duration: float,
    preview: Integers,
    memory: Floats,
    features: Floats,
    outcome: StepOutcome,
) -> None:
    """`lines`, `counts`, `lengths`: see `RaceTracks`."""
    for i in range(len(memory)):
        track = int(memory[i, TRACK])
        line, count, length = lines[track], counts[track], lengths[track]
        progress, offset, direction_cos, direction_sin = follow(
            cars, i, line, count, length / count, reach, memory[i, PLACE:]
        )
        features[i, 0], features[i, 1] = cars.velocity[i, 0], cars.velocity[i, 1]
        features[i, 2], features[i, 3] = cars.angular_velocity[i, 2], cars.steering[i]
        angle = 0.5 * (cars.encoder_angles[i, 0] + cars.encoder_angles[i, 1])
        features[i, 4] = wheel_speed(angle - memory[i, ANGLE], duration)
        memory[i, ANGLE] = angle
        if features.shape[1] > KNOWN:
            features[i, 5], features[i, 6], features[i, 7] = offset, direction_cos, direction_sin
            look_ahead(cars, i, line, count, int(memory[i, PLACE]), preview, features[i, 8:])
        has_ended = direction_cos < 0.0 or cars.collision_count[i] > 0
        outcome.has_ended[i] = has_ended
        outcome.reward[i] = FAILURE if has_ended else progress
        outcome.is_success[i] = memory[i, DRIVEN] >= laps * length
