"""Parity of a real drive and the simulator: what policy and vehicle would have done from the same places.

The log is that of a deployed policy (`driver.CarLog`), with poses in the frame of the map. Three questions are
answered one after the other, so that a difference can be found where it begins: does the scan of the map look like the
scan of the car; does the policy command the same; does the vehicle drive the same with these commands.
"""

from __future__ import annotations

import csv
import math
import tempfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.experiments.deployment.deploy import settings_for, write_policy
from autodrive.experiments.deployment.driver import (
    LOG_COLUMNS,
    READINGS,
    CarPolicy,
    CarSettings,
    ScanLayout,
    Sectors,
)
from autodrive.experiments.envs.time_trial import TICK
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world.batch import BatchWorld
from autodrive.world.compile import on_grid
from autodrive.world.factory import make

WORLDS = 128
"""Worlds that are simulated at once."""
PRIMED = 12
"""Steps of the log that the policy reads before it drives the simulated car."""
HORIZON = 2.0
"""Time for which policy and vehicle drive from a place of the log [s]."""
SPACING = 1.0
"""Time between two of these places [s]."""
LAGS = np.arange(0.0, 0.4, 0.005)
"""Times from a command to the motion that are tried [s]."""
ROLLING = 0.5
"""Least speed at which the yaw rate says something of the steering [m/s]."""


@dataclass(frozen=True)
class ParityLog:
    """A log of a deployed policy; arrays have one row for each of n commands."""

    columns: dict[str, Floats]
    """Columns of `driver.LOG_COLUMNS`, shape (n,) each; NaN where a cell is empty."""
    stops: tuple[str, ...]
    """Why the car was stopped; '': it drove."""
    ranges: Floats
    """Ranges of the sectors [m], shape (n, n_sector)."""

    @classmethod
    def read(cls, file: Path) -> ParityLog:
        """Read the CSV file. Raises `SpecError` for another file."""
        try:
            with file.open(encoding="utf-8", newline="") as stream:
                head, *rows = list(csv.reader(stream))
        except (OSError, ValueError) as error:
            raise SpecError([f"{file} is no log of a deployed policy: {error}"]) from None
        bearings = [name for name in head if name.startswith("range_")]
        missing = [name for name in (*LOG_COLUMNS, "stop") if name not in head]
        if missing or not bearings:
            raise SpecError([
                f"{file} is no log of a deployed policy: it has no column '{(missing or ['range_...'])[0]}'. "
                f"Such a log is written by the programs of `autodrive deploy`"
            ])  # fmt: skip
        for line, row in enumerate(rows, start=2):
            if len(row) != len(head):
                raise SpecError([f"{file}, line {line}: there are {len(row)} cells, and {len(head)} columns"])
        places = {name: place for place, name in enumerate(head)}
        try:
            table = {
                name: np.array([float(row[places[name]] or "nan") for row in rows])
                for name in (*LOG_COLUMNS, *bearings)
            }
        except ValueError as error:
            raise SpecError([f"{file}: a cell is not a number: {error}"]) from None
        stops = tuple(row[places["stop"]] for row in rows)
        if sum(not stop for stop in stops) < 2 * PRIMED:
            raise SpecError([f"{file}: the car drove for fewer than {2 * PRIMED} rows, which is too short"])
        return cls({name: table[name] for name in LOG_COLUMNS}, stops, np.column_stack([table[b] for b in bearings]))

    @property
    def time(self) -> Floats:
        """[s], shape (n,)."""
        return self.columns["time"]

    @property
    def poses(self) -> Floats:
        """x, y [m] and yaw [rad], shape (n, 3)."""
        return np.column_stack([self.columns[name] for name in ("x", "y", "yaw")])

    def parts(self, period: float) -> list[range]:
        """The rows of each part in which the policy drove without a gap; it goes on while a wall stops the car."""
        drives = np.array([stop in ("", "wall") for stop in self.stops]) & np.isfinite(self.ranges).all(axis=1)
        is_new = np.r_[True, (np.diff(self.time) > 3.0 * period) | ~drives[:-1]]
        starts = np.flatnonzero(drives & is_new)
        ends = np.flatnonzero(drives & np.r_[is_new[1:] | ~drives[1:], True]) + 1
        return [range(start, end) for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]


class FromPlaces(NamedTuple):
    """What policy and vehicle did from k places of the log, for s steps each; shape (k, s), NaN after the log."""

    rows: Integers
    """Row of the log at each step."""
    across: Floats
    """Distance of the simulated car from the path of the real one, left positive [m]."""
    speed: Floats
    """Speed of the wheels of the simulated car [m/s]: a car measures that of its wheels."""
    curvature: Floats
    """Yaw rate over speed of the simulated car [1/m]."""
    commands: Floats
    """Speed [m/s] and steering angle [rad] that the policy commanded, shape (k, s, 2)."""
    touched: int
    """Places from which the simulated car touched a wall."""


@dataclass(frozen=True)
class Parity:
    """Car and simulator, side by side."""

    log: ParityLog
    settings: CarSettings
    used: Integers
    """Numbers of the rows in which the car drove, shape (m,)."""
    on_scan: Floats
    """Speed [m/s] and steering angle [rad] that the policy commands with the readings of the car, shape (m, 2)."""
    on_map: Floats | None
    """Speed and steering angle with the scan of the map instead of that of the car; None: without a map."""
    residuals: Floats | None
    """Range of each sector in the log less that in the map [m], NaN where one has no return, shape (m, n_sector)."""
    places: FromPlaces | None
    """What policy and vehicle did from places of the log; None: without a map."""
    delays: dict[str, float]
    """Time from a steering command to the yaw rate [s], of the car and of the simulated vehicle."""


def compare_with_simulator(
    log: ParityLog, *, vehicle: str, policy: str, trained_with: str = "roboracer", track: str | None = None
) -> Parity:
    """Compare a drive with what policy and vehicle would have done. `track`: the map, in whose frame the poses are.

    Raises `SpecError` if a file is wrong, or if the log has no poses for a map.
    """
    car = load_vehicle(vehicle)
    settings = settings_for(load_vehicle(trained_with), car)
    if log.ranges.shape[1] != settings.sectors:
        raise SpecError([f"the log has {log.ranges.shape[1]} sectors, and the policy {settings.sectors}"])
    parts = log.parts(settings.period)
    used = np.concatenate([np.array(part) for part in parts])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "policy.npz"
        write_policy(policy, file)
        on_scan = _replayed(log, settings, file, parts, log.ranges)
        delays = {"car": steering_delay(*_steered(log, parts))}
        on_map, residuals, places = None, None, None
        if track is not None:
            if not np.isfinite(log.poses[used]).all():
                raise SpecError(["the log has no poses, so no map can be compared with it: set pose_topic on the car"])
            seen = np.full(log.ranges.shape, np.nan)
            seen[used] = _scans(vehicle, settings, track, log.poses[used])
            on_map = _replayed(log, settings, file, parts, seen)
            is_return = (log.ranges < 0.99 * settings.sector_range) & (seen < 0.99 * settings.sector_range)
            residuals = np.where(is_return, log.ranges - seen, np.nan)[used]
            places = _driven(log, vehicle, settings, file, track, parts)
            delays["simulated vehicle"] = steering_delay(*_of_places(log, places))
    return Parity(log, settings, used, on_scan, on_map, residuals, places, delays)


def _readings(log: ParityLog, row: int, ranges: Floats) -> Floats:
    columns = log.columns
    speed = columns["wheel_speed"][row]
    own = [speed, 0.0, columns["yaw_rate"][row], columns["policy_angle"][row], speed, columns["scan_age"][row]]
    return np.array([*own, *ranges])


def _names(settings: CarSettings) -> list[str]:
    bearings = [settings.first_degree + (k + 0.5) * settings.sector_degrees for k in range(settings.sectors)]
    return [*READINGS, *(f"range_{bearing:g}" for bearing in bearings)]


def _slower(settings: CarSettings, policy: CarPolicy, cap: float) -> float:
    """The factor by which a policy is slower with a speed cap [m/s]; see `CarDriver`."""
    return min(max(policy.top_throttle * settings.full_speed / cap, 1.0), 10.0)


def _command(settings: CarSettings, throttle: float, steering: float, cap: float) -> tuple[float, float]:
    limit = settings.steering_limit
    return (
        min(max(throttle * settings.full_speed, 0.0), cap),
        min(max(steering * settings.full_angle, -limit), limit),
    )


def _replayed(log: ParityLog, settings: CarSettings, file: Path, parts: Sequence[range], ranges: Floats) -> Floats:
    """Speed and steering angle that the policy commands in the rows of the parts, with these ranges."""
    policy, commands, caps = CarPolicy(file, _names(settings)), [], log.columns["speed_cap"]
    for part in parts:
        policy.begin()
        for row in part:
            outputs = policy.act(_readings(log, row, ranges[row]), _slower(settings, policy, caps[row]))
            commands.append(_command(settings, *outputs, caps[row]))
    return np.array(commands)


def _batch(vehicle: str, track: str, n: int) -> tuple[BatchWorld, ScanLayout]:
    """Worlds with an ideal scanner on a map, and the layout of the scanner."""
    placement = VehiclePlacement(type=vehicle, noise_factor=0.0)
    spec = on_grid(ScenarioSpec(map=track, vehicles={"V1": placement}, tick=TICK), load_map(track))
    with closing(make(spec)) as world:
        scan = world.frame.vehicles["V1"].lidar
        assert scan is not None  # `settings_for` refuses a vehicle without a LIDAR
        layout = ScanLayout(scan.angle_min, scan.angle_increment, len(scan.ranges), scan.range_min, scan.range_max)
    return BatchWorld(spec, n, threads=1), layout


def _scans(vehicle: str, settings: CarSettings, track: str, poses: Floats) -> Floats:
    """Ranges of the sectors [m] that the vehicle would see from these poses in the map, shape (n, n_sector)."""
    batch, layout = _batch(vehicle, track, min(WORLDS, len(poses)))
    sectors, seen = Sectors(layout, settings), []
    with closing(batch):
        for first in range(0, len(poses), batch.n):
            some = poses[first : first + batch.n]
            filled = np.vstack([some, np.repeat(some[-1:], batch.n - len(some), axis=0)])
            readings = batch.reset(poses={"V1": filled})
            seen += [sectors(ranges)[0] for ranges in readings.lidar_ranges[: len(some), 0]]
    return np.array(seen)


def _driven(
    log: ParityLog, vehicle: str, settings: CarSettings, file: Path, track: str, parts: Sequence[range]
) -> FromPlaces | None:
    """Let policy and vehicle drive from places of the log; None if no part is long enough."""
    steps, between = round(HORIZON / settings.period), round(SPACING / settings.period)
    starts = [row for part in parts for row in range(part[0] + PRIMED, part[-1] + 1 - steps, between)]
    if not starts:
        return None
    shape = (len(starts), steps)
    across, speed, curvature = (np.full(shape, np.nan) for _ in range(3))
    commands = np.full((*shape, 2), np.nan)
    columns, touched, ticks = log.columns, 0, round(settings.period / TICK)
    batch, layout = _batch(vehicle, track, min(WORLDS, len(starts)))
    sectors = Sectors(layout, settings)
    with closing(batch):
        for first in range(0, len(starts), batch.n):
            some = starts[first : first + batch.n]
            policies = [_primed(log, settings, file, row) for row in some]
            rows = np.array([*some, *[some[-1]] * (batch.n - len(some))])
            before = np.column_stack([columns["throttle"][rows - 1], columns["steering"][rows - 1]])
            motions = np.column_stack(
                [
                    columns["wheel_speed"][rows],
                    np.zeros(len(rows)),
                    columns["yaw_rate"][rows],
                    np.clip(before, -1.0, 1.0),
                ]
            )
            readings = batch.reset(poses={"V1": log.poses[rows]}, motions={"V1": motions})
            angles = readings.encoder_angles[:, 0].mean(axis=1)
            told = np.zeros((batch.n, 1, 2))
            for step in range(steps):
                turned = readings.encoder_angles[:, 0].mean(axis=1) - angles
                angles = angles + turned
                for k, row in enumerate(some):
                    place, cap = (first + k, step), columns["speed_cap"][row]
                    velocity, rate = readings.velocity[k, 0], float(readings.angular_velocity[k, 0, 2])
                    wheels = settings.wheel_radius * float(turned[k]) / settings.period if step else float(velocity[0])
                    own = [velocity[0], velocity[1], rate, readings.steering[k, 0], wheels, 0.0]
                    seen = np.array([*own, *sectors(readings.lidar_ranges[k, 0])[0]])
                    outputs = policies[k].act(seen, _slower(settings, policies[k], cap))
                    commands[place] = _command(settings, *outputs, cap)
                    across[place] = _beside(log.poses[row : row + steps], readings.position[k, 0])
                    speed[place] = wheels
                    curvature[place] = rate / velocity[0] if velocity[0] > ROLLING else np.nan
                    told[k, 0] = commands[place] / (settings.car_full_speed, settings.steering_limit)
                readings = batch.step(np.clip(told, -1.0, 1.0), ticks)
            touched += int((readings.collision_count[: len(some), 0] > 0).sum())
    return FromPlaces(np.array(starts)[:, None] + np.arange(steps), across, speed, curvature, commands, touched)


def _primed(log: ParityLog, settings: CarSettings, file: Path, row: int) -> CarPolicy:
    """The policy after it has read the rows of the log before that row."""
    policy, caps = CarPolicy(file, _names(settings)), log.columns["speed_cap"]
    for earlier in range(row - PRIMED, row):
        policy.act(_readings(log, earlier, log.ranges[earlier]), _slower(settings, policy, caps[earlier]))
    return policy


def _beside(path: Floats, position: Floats) -> float:
    """How far a position is to the left of the nearest pose of a path [m]; path: shape (n, 3)."""
    nearest = path[np.argmin(np.hypot(path[:, 0] - position[0], path[:, 1] - position[1]))]
    dx, dy = float(position[0] - nearest[0]), float(position[1] - nearest[1])
    return math.cos(nearest[2]) * dy - math.sin(nearest[2]) * dx


def _steered(log: ParityLog, parts: Sequence[range]) -> tuple[list[Floats], list[Floats], list[Floats]]:
    """Times [s], commanded steering angle [rad] and curvature [1/m] of the real car, for each part."""
    speed = log.columns["wheel_speed"]
    curvature = np.where(speed > ROLLING, log.columns["yaw_rate"] / np.maximum(speed, ROLLING), np.nan)
    rows = [np.array(part) for part in parts]
    return [log.time[r] for r in rows], [log.columns["command_angle"][r] for r in rows], [curvature[r] for r in rows]


def _of_places(log: ParityLog, places: FromPlaces | None) -> tuple[list[Floats], list[Floats], list[Floats]]:
    """Values as of `_steered`, of the simulated car."""
    if places is None:
        return [], [], []
    times = [log.time[rows] for rows in places.rows]
    return times, [*places.commands[:, :, 1]], [*places.curvature]


def steering_delay(times: Sequence[Floats], commands: Sequence[Floats], responses: Sequence[Floats]) -> float:
    """The time by which the response follows the command [s]: that with the greatest correlation; NaN: none."""
    best, delay = 0.0, math.nan
    for lag in LAGS.tolist():
        pairs = [
            (np.interp(time - lag, time, command), response, time - time[0] >= LAGS[-1])
            for time, command, response in zip(times, commands, responses, strict=True)
        ]
        told = np.concatenate([told[late] for told, _, late in pairs]) if pairs else np.empty(0)
        followed = np.concatenate([response[late] for _, response, late in pairs]) if pairs else np.empty(0)
        is_known = np.isfinite(told) & np.isfinite(followed)
        if is_known.sum() < 20 or np.ptp(told[is_known]) < 1e-3 or np.ptp(followed[is_known]) < 1e-3:
            continue
        correlation = float(np.corrcoef(told[is_known], followed[is_known])[0, 1])
        if correlation > best:
            best, delay = correlation, lag
    return delay
