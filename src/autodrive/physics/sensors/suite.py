"""The sensors of all vehicles of a world but the cameras, with the latest reading of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Integers, read_only_copy
from autodrive.base.compile_ahead import compile_ahead
from autodrive.base.jit import resolved
from autodrive.physics.model import ShapeTable
from autodrive.physics.sensors.catalog import NOISY_VALUES, SENSORS, VALUES
from autodrive.physics.sensors.columns import motion_of, working_memory
from autodrive.physics.sensors.lidar import LidarSpec
from autodrive.physics.sensors.lidar_weather import WEATHER, set_lidar_weather
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
from autodrive.protocol.messages import Weather

NEVER = [math.nan] * len(SENSORS)
"""Times of the readings of a vehicle before the first."""


class SensorSuite:
    """Samples the sensors that are due and keeps the latest reading of each."""

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
        self._tables = sensor_tables(self._configured, substep, gravity, targets)
        self._rays, self._rolling_rays = most_rays(self._tables)
        self._noise = noise_columns(1, len(vehicles))
        self._columns = reading_columns(1, len(vehicles), self._rays, self._rolling_rays)
        self._time_column, self._values_column = self._columns.time[0], self._columns.values[0]
        self._working = working_memory(shapes, len(vehicles), self._rays)
        self._motion = motion_of(state)
        self._ratio = substep.numerator, substep.denominator
        self._substeps = substeps
        self._arguments = self._motion, shapes, self._noise, self._columns, self._working
        self._sample: Callable[..., None] | None = None
        self._readers = [[(s, name, self._reader(i, s)) for s, name in self._present(i)] for i in range(len(vehicles))]
        self._latest: list[dict[str, Any]] = [dict.fromkeys(SENSORS) for _ in vehicles]
        self.noise_factors = [1.0] * len(vehicles)
        """Factor of the noise of each vehicle, see `set_noise_factors`."""
        self._times = [list(NEVER) for _ in vehicles]
        """Times of the latest readings of each vehicle [s], see `ReadingColumns.time`."""

    def compile_ahead(self) -> None:
        """Start to compile the sampling in a process of its own, if that is necessary."""
        compile_ahead(sample, 0, 0, self._substeps, *self._arguments, self._tables)

    def set_noise_factors(self, factors: Sequence[float]) -> None:
        """Multiply the noise of each vehicle, from the next reset on."""
        self.noise_factors = list(factors)

    def reset(self, seed: int) -> None:
        """Reset all sensors; the noise depends on `seed`, the name of the vehicle and the name of the sensor."""
        for i, (name, specs) in enumerate(self._specs.items()):
            set_noise(self._noise, 0, i, specs, self.noise_factors[i])
            start_noise(self._noise, 0, i, name, seed)
        self._times = [list(NEVER) for _ in self._times]

    def set_weather(self, weather: Weather, seed: int) -> None:
        """The weather from now on, which ends at a reset; `seed`: that of the last reset."""
        for i, (name, specs) in enumerate(self._specs.items()):
            if isinstance(spec := specs.get("lidar"), LidarSpec):
                set_lidar_weather(self._noise, 0, i, name, weather, spec, seed)

    def sample(self, now: int) -> None:
        """Sample the sensors that are due at `now` [substeps since the reset]; call it at 0 and after each tick."""
        self._run(now, self._tables)

    def continue_from(self, before: SensorSuite, seed: int, now: int) -> None:
        """Continue the sensors of a suite of the same vehicles that have the same settings; start the others `now`."""
        self.reset(seed)
        numerator, denominator = self._ratio
        starting: list[tuple[int, int]] = []
        for i, own in enumerate(self._configured):
            for s, name in self._present(i):
                if before._configured[i].get(name) == own[name]:
                    self._copy(before, i, s, name)
                    continue
                starting.append((i, s))
                self._columns.time[0, i, s] = 0.0  # the bias walks from the reset on
                if isinstance(spec := own[name].spec, LidarSpec) and spec.is_rolling:
                    # the first rolling scan starts with the next period
                    self._columns.sweep[0, i] = math.ceil(now * numerator / denominator * spec.rate - 1e-9) + 1, 0
        self._run(now, starting_only(self._tables, starting))

    def readings(self, vehicle: int) -> dict[str, Any]:
        """The latest reading of each sensor of a vehicle by the sensor's name; None: no such sensor."""
        return self._latest[vehicle]

    def save(self) -> Any:
        """The complete internal state, for `restore`."""
        return [column.copy() for column in self._changing()], [dict(latest) for latest in self._latest]

    def restore(self, saved: Any) -> None:
        """Set the state that `save` returned."""
        columns, latest = saved
        for column, kept in zip(self._changing(), columns, strict=True):
            column[:] = kept
        self._latest = [dict(readings) for readings in latest]
        self._times = self._columns.time[0].tolist()

    # -- parts ---------------------------------------------------------------------------------------------------

    def _present(self, i: int) -> Iterator[tuple[int, str]]:
        """Number and name of the sensors that vehicle i has, and that are on or have a reading in every Frame."""
        for s, name in enumerate(SENSORS):
            if self._tables.vehicles[i]["samples"][s] != ABSENT:
                yield s, name

    def _changing(self) -> list[NDArray[Any]]:
        """The columns that later readings depend on."""
        noise, columns = self._noise, self._columns
        changing = [noise.stream, noise.bias, noise.lidar]
        changing += [columns.time, columns.sweep, columns.sweep_ranges, columns.sweep_hits]
        return [*changing, *self._working.before] if self._rolling_rays else changing

    def _run(self, now: int, tables: SensorTables) -> None:
        if self._sample is None:
            self._sample = resolved(sample, 0, now, self._substeps, *self._arguments, tables)
        self._sample(0, now, self._substeps, *self._arguments, tables)
        if self._rolling_rays:
            m = self._motion
            poses = m.vehicle_position, m.vehicle_orientation, m.shape_position, m.shape_rotation
            for before, pose in zip(self._working.before, poses, strict=True):
                before[:] = pose
        before, self._times = self._times, self._time_column.tolist()
        copies = read_only_copy(self._values_column)
        for i, readers in enumerate(self._readers):
            values, latest, times, times_before = copies[i], self._latest[i], self._times[i], before[i]
            for s, name, read in readers:
                if (time := times[s]) != times_before[s]:
                    latest[name] = read(time, values)

    def _copy(self, before: SensorSuite, i: int, s: int, name: str) -> None:
        """Copy the state of a sensor of vehicle i."""
        noise, its_noise, columns, its_columns = self._noise, before._noise, self._columns, before._columns
        noise.stream[0, i, s] = its_noise.stream[0, i, s]
        columns.time[0, i, s] = its_columns.time[0, i, s]
        if isinstance(spec := self._configured[i][name].spec, LidarSpec):
            noise.lidar[0, i, :WEATHER] = its_noise.lidar[0, i, :WEATHER]
            noise.stream[0, i, -1] = its_noise.stream[0, i, -1]
            columns.sweep[0, i] = its_columns.sweep[0, i]
            if spec.is_rolling:
                columns.sweep_ranges[0, i, : spec.rays] = its_columns.sweep_ranges[0, i, : spec.rays]
                columns.sweep_hits[0, i, : spec.rays] = -1  # the shapes have other numbers
        else:
            noise.bias[0, i, NOISY_VALUES[name]] = its_noise.bias[0, i, NOISY_VALUES[name]]
        self._latest[i][name], self._times[i][s] = before._latest[i][name], before._times[i][s]

    def _reader(self, i: int, s: int) -> Reader:
        """The function that makes the messages of sensor s of vehicle i."""
        return self._configured[i][SENSORS[s]].spec.reader(self._columns, i, VALUES[SENSORS[s]].start)
