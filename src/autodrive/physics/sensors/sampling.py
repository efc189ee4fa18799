"""Samples the sensors of all vehicles of a world but the cameras: compiled code for single worlds and for batches."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from autodrive.base.jit import inlined, inlined_part, jit_uncounted
from autodrive.physics.model import ShapeTable
from autodrive.physics.sensors.catalog import KINDS, NOISY_VALUES, SENSORS, VALUES
from autodrive.physics.sensors.columns import Due, Memory, Motion, NoiseColumns, ReadingColumns, SensorTables, Working
from autodrive.physics.sensors.tables import ABSENT


@inlined
def _is_due(row: Any, s: int, now: int, substeps: int) -> bool:
    """`Schedule.is_due` in the tick that ends `now`; at 0, all sensors are due."""
    samples, per = row["samples"][s], row["substeps"][s]
    return samples != ABSENT and (now == 0 or now * samples // per > (now - substeps) * samples // per)


@inlined
def _no_sensor(k: int, i: int, now: int, substeps: int, time: float, row: Any, memory: Memory) -> None:
    """Samples nothing."""


def _followed_by(before: Callable[..., None], s: int) -> Callable[..., None]:
    """The function that samples sensor s of a vehicle, if it is due, after those `before` it."""
    function, values, channels = KINDS[SENSORS[s]].sample, VALUES[SENSORS[s]], NOISY_VALUES[SENSORS[s]]
    first, last, channel, channel_end = values.start, values.stop, channels.start, channels.stop

    def sample_sensors(k: int, i: int, now: int, substeps: int, time: float, row: Any, memory: Memory) -> None:
        before(k, i, now, substeps, time, row, memory)
        if _is_due(row, s, now, substeps):
            due = Due(k, i, s, now, substeps, time, channel, channel_end)
            function(due, memory.readings.values[k, i, first:last], row, memory)

    return inlined_part(sample_sensors)


_sample_vehicle: Callable[..., None] = functools.reduce(_followed_by, range(len(SENSORS)), _no_sensor)


@jit_uncounted
def sample(
    k: int,
    now: int,
    substeps: int,
    motion: Motion,
    shapes: ShapeTable,
    noise: NoiseColumns,
    readings: ReadingColumns,
    working: Working,
    sensors: SensorTables,
) -> None:
    """Samples the sensors of world k that are due at `now` [substeps]; a tick has so many `substeps`."""
    numerator, denominator = sensors.substep
    time = now * numerator / denominator
    memory = Memory(motion, shapes, noise, readings, working, sensors)
    for i in range(motion.vehicle_position.shape[0]):
        _sample_vehicle(k, i, now, substeps, time, sensors.vehicles[i], memory)
