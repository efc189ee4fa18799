"""Checks a sensor on a vehicle that drives."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from autodrive.physics.sensors.sensor import Sensor, random_generator
from autodrive.protocol.codec import encode
from autodrive.protocol.messages import Command
from autodrive.run.testing.conformance import ConformanceError
from autodrive.world import World
from autodrive.world.compile import CompiledScenario
from autodrive.world.factory import compile_scenario


def check_sensor(
    make: Callable[[], Sensor[Any]],
    *,
    scenario: str | Path = "mini_map",
    ticks: int = 100,
    command: Command | None = None,
) -> None:
    """Check a sensor on the first vehicle of a scenario while that vehicle drives. Raises `ConformanceError`.

    `make` returns a new sensor. `ticks` is the number of ticks of each of the runs; the sensor is sampled after each.
    `command` is what the vehicle obeys, by default half throttle in a left turn. The rules:

    - `sample` does not change the State or the shapes.
    - Every reading has a `time` [s], which is not later than the time of the sample and never decreases.
    - Arrays of a reading are read-only, and later samples do not change them.
    - A reading can be encoded for the native protocol.
    - The same seed gives the same readings, in a new sensor and after `reset`.
    - `restore` of what `save` returned gives the same readings as the first time.
    - A sensor returns a reading, not always None.
    """
    run = _SensorRun(scenario, command or Command(throttle=0.5, steering=0.3))
    errors: list[str] = []
    sensor = make()
    first = run.readings(sensor, ticks, seed=1, errors=errors)
    if not any(reading is not None for reading in first):
        errors.append(f"it returns no reading in {ticks} ticks")
    if run.readings(sensor, ticks, seed=1, errors=errors) != first:
        errors.append("after `reset` with the same seed its readings differ: `reset` must forget everything")
    if run.readings(make(), ticks, seed=1, errors=errors) != first:
        errors.append("a new sensor with the same seed has other readings: draw noise from the generator of `reset`")
    if run.resumed(make(), ticks, seed=1, errors=errors) != first:
        errors.append("after `restore` its readings differ: `save` must return all that later readings depend on")
    if errors:
        raise ConformanceError(type(sensor).__name__, list(dict.fromkeys(errors)))


class _SensorRun:
    """Drives the first vehicle of a scenario and samples one sensor on it."""

    def __init__(self, scenario: str | Path, command: Command) -> None:
        self._compiled: CompiledScenario = compile_scenario(scenario)
        self._world = World(self._compiled)
        self._vehicle = self._world.vehicle_names[0]
        self._commands = {self._vehicle: command}

    def readings(self, sensor: Sensor[Any], ticks: int, *, seed: int, errors: list[str]) -> list[bytes | None]:
        """Each reading as bytes, None where there is none."""
        self._start(sensor, seed)
        return list(self._sampled(sensor, ticks, errors))

    def resumed(self, sensor: Sensor[Any], ticks: int, *, seed: int, errors: list[str]) -> list[bytes | None]:
        """The same; half-way the second half is run once, undone by `restore`, and run again."""
        self._start(sensor, seed)
        half = ticks // 2
        before = list(self._sampled(sensor, half, errors))
        world, saved = self._world.save(), sensor.save()
        list(self._sampled(sensor, ticks - half, errors))
        self._world.restore(world)
        sensor.restore(saved)
        return before + list(self._sampled(sensor, ticks - half, errors))

    def _start(self, sensor: Sensor[Any], seed: int) -> None:
        self._world.reset(seed)
        sensor.reset(random_generator(seed, self._vehicle, "sensor under test"))

    def _sampled(self, sensor: Sensor[Any], ticks: int, errors: list[str]) -> Iterator[bytes | None]:
        model, state = self._compiled.model, self._compiled.state
        newest = -np.inf
        kept: list[tuple[Any, bytes]] = []
        for _ in range(ticks):
            now = self._world.step(self._commands).time
            before = _digest(*state, *model.shapes, *model.shapes.grid)
            reading = sensor.sample(model.shapes, state, 0, now)
            if _digest(*state, *model.shapes, *model.shapes.grid) != before:
                errors.append("`sample` changes the State or the shapes")
            if reading is None:
                yield None
                continue
            sensor.latest = reading
            newest = _check_reading(reading, now, newest, errors)
            code = _encoded(reading, errors)
            kept.append((reading, code))
            yield code
        if any(_encoded(reading, errors) != code for reading, code in kept):
            errors.append("later samples change an earlier reading: return new arrays")


def _check_reading(reading: Any, now: float, newest: float, errors: list[str]) -> float:
    """The time of a reading, after a look at its time and its arrays."""
    at = getattr(reading, "time", None)
    if not isinstance(at, float):
        errors.append("a reading has no `time`, a float [s]")
        return newest
    if at > now:
        errors.append("the `time` of a reading is later than the sample")
    if at < newest:
        errors.append("the `time` of a reading is earlier than that of the reading before")
    for name in getattr(reading, "__struct_fields__", ()):
        value = getattr(reading, name)
        if isinstance(value, np.ndarray) and value.flags.writeable:
            errors.append(f"`{name}` of a reading is writable: call `setflags(write=False)`")
    return at


def _encoded(reading: Any, errors: list[str]) -> bytes:
    try:
        return encode(reading)
    except (TypeError, NotImplementedError, ValueError) as error:
        errors.append(f"a reading cannot be encoded for the native protocol: {error}")
        return repr(reading).encode()


def _digest(*columns: object) -> bytes:
    """Of the arrays among the columns."""
    digest = hashlib.blake2b()
    for column in columns:
        if isinstance(column, np.ndarray):
            digest.update(np.ascontiguousarray(column).data)
    return digest.digest()
