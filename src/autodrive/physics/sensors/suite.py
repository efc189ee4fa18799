"""The sensors of all vehicles of a World but the cameras: their columns, and messages with the latest readings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from autodrive.base.arrays import Integers, read_only_copy
from autodrive.base.jit import resolved
from autodrive.physics.model import ShapeTable
from autodrive.physics.sensors.catalog import NOISY_VALUES, SENSORS, VALUES
from autodrive.physics.sensors.columns import motion_of, working_memory
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.lidar.weather import WEATHER, set_lidar_weather
from autodrive.physics.sensors.sampling import sample
from autodrive.physics.sensors.sensor import Reader
from autodrive.physics.sensors.settings import ConfiguredSensor
from autodrive.physics.sensors.tables import (
    ABSENT,
    SensorTables,
    most_rays,
    noise_columns,
    reading_columns,
    sensor_tables,
    set_noise,
    start_noise,
    starting_only,
)
from autodrive.physics.state import State
from autodrive.protocol.messages import VehicleFrame, Weather

NEVER = [math.nan] * len(SENSORS)
"""Times of the readings of a vehicle before the first."""


class SensorSuite:
    """The columns of the sensors of a World, and the latest reading of each sensor as a message."""

    def __init__(
        self,
        vehicles: Mapping[str, Mapping[str, ConfiguredSensor]],
        shapes: ShapeTable,
        state: State,
        targets: Integers | None = None,
        *,
        substep: Fraction,
        substeps: int,
        gravity: float,
    ) -> None:
        """`vehicles`: the sensors by name of the vehicle and of the sensor. `shapes`, `state`: those of the world.

        `targets`: see `SensorTables`; left out: all shapes are like the ground.

        `substep` [s] is the unit of simulated time, and a tick has so many `substeps`. `gravity` [m/s^2] is positive
        downward.
        """
        self._configured = list(vehicles.values())
        self._specs = {
            name: {sensor: configured.spec for sensor, configured in sensors.items()}
            for name, sensors in vehicles.items()
        }
        targets = np.zeros(len(shapes.kind), np.int64) if targets is None else targets
        self.tables = sensor_tables(self._configured, substep, gravity, targets)
        rays, rolling_rays = most_rays(self.tables)
        self.has_rolling_lidar = rolling_rays > 0
        self.noise = noise_columns(1, len(vehicles))
        self.columns = reading_columns(1, len(vehicles), rays, rolling_rays)
        self.working = working_memory(shapes, len(vehicles), rays)
        self._time_column, self._values_column = self.columns.time[0], self.columns.values[0]
        self._motion, self._shapes = motion_of(state), shapes
        self._ratio = substep.numerator, substep.denominator
        self._substeps = substeps
        self._sample: Callable[..., None] | None = None
        self._readers = [[(s, name, self._reader(i, s)) for s, name in self._present(i)] for i in range(len(vehicles))]
        self._latest: list[dict[str, Any]] = [dict.fromkeys(SENSORS) for _ in vehicles]
        self.noise_factors = [1.0] * len(vehicles)
        """Factor of the noise of each vehicle, see `set_noise_factors`."""
        self._times = [list(NEVER) for _ in vehicles]
        """Times of the latest readings of each vehicle [s], see `ReadingColumns.time`."""

    def set_noise_factors(self, factors: Sequence[float]) -> None:
        """Multiply the noise of each vehicle, from the next reset on."""
        self.noise_factors = list(factors)

    def reset(self, seed: int) -> None:
        """Reset all sensors; the noise depends on `seed`, the name of the vehicle and the name of the sensor."""
        for i, (name, specs) in enumerate(self._specs.items()):
            set_noise(self.noise, 0, i, specs, self.noise_factors[i])
            start_noise(self.noise, 0, i, name, seed)
        self._times = [list(NEVER) for _ in self._times]

    def set_weather(self, weather: Weather, seed: int) -> None:
        """The weather from now on, which ends at a reset; `seed`: that of the last reset."""
        for i, (name, specs) in enumerate(self._specs.items()):
            if isinstance(spec := specs.get("lidar"), LidarSpec):
                set_lidar_weather(self.noise, 0, i, name, weather, spec, seed)

    def sample(self, now: int) -> None:
        """Sample the sensors that are due at `now` [substeps since the reset] without a World, and `read` them."""
        arguments = self._motion, self._shapes, self.noise, self.columns, self.working, self.tables
        if self._sample is None:
            self._sample = resolved(sample, 0, now, self._substeps, *arguments)
        self._sample(0, now, self._substeps, *arguments)
        m = self._motion
        poses = m.vehicle_position, m.vehicle_orientation, m.shape_position, m.shape_rotation
        for before, pose in zip(self.working.before, poses, strict=True):
            before[:] = pose
        self.read()

    def read(self) -> None:
        """Make messages of the readings that are new in the columns."""
        before, self._times = self._times, self._time_column.tolist()
        copies = read_only_copy(self._values_column)
        for i, readers in enumerate(self._readers):
            values, latest, times, times_before = copies[i], self._latest[i], self._times[i], before[i]
            for s, name, read in readers:
                if (time := times[s]) != times_before[s]:
                    latest[name] = read(time, values)

    def restore(self, vehicles: Iterable[VehicleFrame]) -> None:
        """Take the messages of the readings in the columns from the Frames of the vehicles, in their order."""
        self._latest = [{name: getattr(vehicle, name) for name in SENSORS} for vehicle in vehicles]
        self._times = self._time_column.tolist()

    def take_over(self, before: SensorSuite, seed: int, now: int) -> SensorTables:
        """Continue the sensors of a suite of the same vehicles that have the same settings.

        Returns tables with which the others sample `now` [substeps since the reset] for the first time; `read` follows.
        """
        self.reset(seed)
        numerator, denominator = self._ratio
        starting: list[tuple[int, int]] = []
        for i, own in enumerate(self._configured):
            for s, name in self._present(i):
                if before._configured[i].get(name) == own[name]:
                    self._copy(before, i, s, name)
                    continue
                starting.append((i, s))
                self.columns.time[0, i, s] = 0.0  # the bias walks from the reset on
                if isinstance(spec := own[name].spec, LidarSpec) and spec.is_rolling:
                    # the first rolling scan starts with the next period
                    self.columns.sweep[0, i] = math.ceil(now * numerator / denominator * spec.rate - 1e-9) + 1, 0
        return starting_only(self.tables, starting)

    def readings(self, vehicle: int) -> dict[str, Any]:
        """The latest reading of each sensor of a vehicle by the sensor's name; None: no such sensor."""
        return self._latest[vehicle]

    # -- parts ---------------------------------------------------------------------------------------------------

    def _present(self, i: int) -> Iterator[tuple[int, str]]:
        """Number and name of the sensors that vehicle i has, and that are on or have a reading in every Frame."""
        for s, name in enumerate(SENSORS):
            if self.tables.vehicles[i]["samples"][s] != ABSENT:
                yield s, name

    def _copy(self, before: SensorSuite, i: int, s: int, name: str) -> None:
        """Copy the state and the latest reading of a sensor of vehicle i."""
        noise, columns = self.noise, self.columns
        self._latest[i][name], self._times[i][s] = before._latest[i][name], before._times[i][s]
        noise.stream[0, i, s] = before.noise.stream[0, i, s]
        columns.time[0, i, s] = before.columns.time[0, i, s]
        columns.values[0, i, VALUES[name]] = before.columns.values[0, i, VALUES[name]]
        if isinstance(spec := self._configured[i][name].spec, LidarSpec):
            noise.lidar[0, i, :WEATHER] = before.noise.lidar[0, i, :WEATHER]
            noise.stream[0, i, -1] = before.noise.stream[0, i, -1]
            columns.lidar_ranges[0, i, : spec.rays] = before.columns.lidar_ranges[0, i, : spec.rays]
            columns.sweep[0, i] = before.columns.sweep[0, i]
            if spec.is_rolling:
                columns.sweep_ranges[0, i, : spec.rays] = before.columns.sweep_ranges[0, i, : spec.rays]
                columns.sweep_hits[0, i, : spec.rays] = -1  # the shapes have other numbers
            return
        noise.bias[0, i, NOISY_VALUES[name]] = before.noise.bias[0, i, NOISY_VALUES[name]]
        if isinstance(spec, EncoderSpec):
            columns.encoder_ticks[0, i] = before.columns.encoder_ticks[0, i]

    def _reader(self, i: int, s: int) -> Reader:
        """The function that makes the messages of sensor s of vehicle i."""
        return self._configured[i][SENSORS[s]].spec.reader(self.columns, i, VALUES[SENSORS[s]].start)
