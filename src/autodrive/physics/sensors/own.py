"""Sensors of the user: objects with a rate, names of columns and a function that samples, see docs/adding_a_sensor.md.

What a sensor keeps in its attributes belongs to the state of the world: a reset sets it back, a snapshot contains it.
"""

from __future__ import annotations

import copy
import logging
import reprlib
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from autodrive.base.arrays import Floats, read_only_copy
from autodrive.base.errors import SensorError, SnapshotError
from autodrive.physics.model import ShapeTable
from autodrive.physics.sensors.rays import cast_rays
from autodrive.physics.sensors.sensor import Schedule, random_generator
from autodrive.physics.state import State, VehicleView
from autodrive.protocol.messages import OwnReading, Pose

log = logging.getLogger(__name__)

RATES = (1e-3, 1e4)
"""Least and greatest rate [Hz]."""
MAX_COLUMNS = 10_000
MAX_NAME = 100
"""Longest name of a sensor or column [characters]."""
SLOW = 0.5
"""A sensor is slow if a sample takes longer than this part of a tick in wall time."""
TIMED = 10
"""The quickest of so many samples counts, so that a compilation or a busy machine makes no sensor slow."""


class OwnSensor(Protocol):
    """What `World.add_sensor` takes: any object with these three members."""

    @property
    def rate(self) -> float | None:
        """Samples per second [Hz], at most one per tick; None: one per tick."""
        ...

    @property
    def columns(self) -> Sequence[str]:
        """Name of each value, perhaps with its unit: 'distance [m]'."""
        ...

    def sample(self, view: SensorView, random: np.random.Generator) -> ArrayLike:
        """The values at `view.time`, one for each column; of one column, also a number.

        `random`: a random stream that only this sensor draws from. Values need not be finite: infinity where nothing
        is in range (REP 117), NaN without a value.
        """
        ...


class SensorView(VehicleView):
    """What a sensor of the user reads of the world while it samples. Nothing that it returns changes the world.

    Of its vehicle, as numbers or copies of arrays: `position` [m] and `orientation` (quaternion wxyz) in the map,
    `velocity` [m/s], `angular_velocity` [rad/s], `acceleration` [m/s^2] without gravity, and `angular_acceleration`
    [rad/s^2] in vehicle axes, shape (3,); `throttle`, `steering_angle` [rad]. `wheel("front_left")` has
    `angular_velocity`, `rotation`, `steering_angle`, `compression`, `normal_load`, `slip_ratio`, `slip_angle`.
    """

    time: float
    """Simulated time [s]."""

    def __init__(self, state: State, index: int, time: float, shapes: ShapeTable, bodies: Mapping[str, int]) -> None:
        """`bodies`: vehicles and movable objects, name -> index of the pose in `State.qpos`."""
        super().__init__(state, index)
        self.time = time
        self._shapes = shapes
        self._bodies = bodies

    @cached_property
    def poses(self) -> dict[str, Pose]:
        """Poses in the map of all vehicles and movable objects, by name."""
        qpos = self._state.qpos
        return {
            name: Pose(read_only_copy(qpos[k : k + 3]), read_only_copy(qpos[k + 3 : k + 7]))
            for name, k in self._bodies.items()
        }

    def cast(self, origins: ArrayLike, directions: ArrayLike, range_max: float = 100.0) -> Floats:
        """The range [m] of rays to the nearest thing but the own vehicle, shape (n,); infinity beyond `range_max`.

        `origins` [m] and `directions` (of any length), shape (n, 3) or (3,), are in the vehicle frame.
        """
        start = np.atleast_2d(np.asarray(origins, np.float64))
        along = np.atleast_2d(np.asarray(directions, np.float64))
        length = np.linalg.norm(along, axis=1, keepdims=True)
        if start.shape[1:] != (3,) or along.shape[1:] != (3,) or not (np.isfinite(start).all() and (length > 0).all()):
            raise ValueError("a ray needs an origin x, y, z [m] and a direction x, y, z that is not zero")
        start, along = np.broadcast_arrays(start, along / length)
        ranges = np.empty(len(start))
        state, i = self._state, self._index
        cast_rays(
            state.vehicle_position[i],
            state.vehicle_orientation[i],
            np.ascontiguousarray(start),
            np.ascontiguousarray(along),
            float(range_max),
            i,
            self._shapes,
            state.shape_position,
            state.shape_rotation,
            np.empty(len(self._shapes.kind), np.int64),
            ranges,
        )
        return ranges


def problem(name: object, sensor: Any, known: Sequence[str] = ()) -> str:
    """Why a sensor cannot have that name, or is none; empty if it can. `known`: names of the vehicle's sensors."""
    return next(_problems(name, sensor, known), "")


def _problems(name: object, sensor: Any, known: Sequence[str]) -> Iterator[str]:
    """What is wrong with a sensor of the user. The first text counts: each check relies on those before it."""
    if not isinstance(name, str) or not name.isidentifier() or len(name) > MAX_NAME:
        yield f"the name of a sensor is letters, digits and '_', such as radar, not {reprlib.repr(name)}"
    if name in known:
        yield f"the vehicle has a sensor '{name}' already; choose another name"
    if isinstance(sensor, type) or not all(hasattr(sensor, attribute) for attribute in ("rate", "columns", "sample")):
        description = f"the class {sensor.__name__}" if isinstance(sensor, type) else type(sensor).__name__
        yield f"a sensor is an object with `rate`, `columns` and the function `sample(view, random)`, not {description}"
    rate, columns = sensor.rate, sensor.columns
    is_number = isinstance(rate, int | float) and not isinstance(rate, bool)
    if rate is not None and not (is_number and RATES[0] <= rate <= RATES[1]):
        yield f"`rate` must be a number from {RATES[0]:g} to {RATES[1]:g} Hz, or None, not {reprlib.repr(rate)}"
    if isinstance(columns, str) or not isinstance(columns, Sequence) or not 0 < len(columns) <= MAX_COLUMNS:
        yield f"`columns` must be 1 to {MAX_COLUMNS} names, such as ('distance [m]', 'speed [m/s]')"
    for column in columns:
        if not isinstance(column, str) or not column.strip() or len(column) > MAX_NAME:
            yield f"a name in `columns` is a text of 1 to {MAX_NAME} characters, not {reprlib.repr(column)}"
    for column, count in Counter(columns).items():
        if count > 1:
            yield f"`columns` has the name '{column}' twice"


@dataclass
class _Placed:
    """A sensor on vehicle `index`."""

    vehicle: str
    index: int
    name: str
    sensor: Any
    columns: tuple[str, ...]
    schedule: Schedule | None
    start: dict[str, Any]
    """The attributes of the sensor when it was added."""
    random: np.random.Generator
    latest: OwnReading | None = None
    durations: list[float] = field(default_factory=list)
    """Durations of the last samples [s of wall time]; see `OwnSensors.clock`."""

    @property
    def title(self) -> str:
        """The sensor and its vehicle, for messages."""
        return f"sensor '{self.name}' of vehicle '{self.vehicle}'"


class OwnSensors:
    """The sensors of the user in one world, with the latest reading of each."""

    def __init__(
        self,
        vehicles: Mapping[str, Sequence[str]],
        bodies: Mapping[str, int],
        shapes: ShapeTable,
        state: State,
        *,
        substep: Fraction,
        substeps: int,
    ) -> None:
        """`vehicles`: names of the other sensors of each. `bodies`: see `SensorView`. The others: see `SensorSuite`."""
        self.placed: list[_Placed] = []
        """The sensors in the order in which they were added."""
        self.clock: Callable[[], float] | None = None
        """Wall time [s]: if there is one, a slow sensor is logged once."""
        self._vehicles = vehicles
        self._indices = {name: i for i, name in enumerate(vehicles)}
        self._view = bodies, shapes, state
        self._substep, self._substeps = substep, substeps
        self._reported: set[tuple[str, str]] = set()

    def names(self, vehicle: str) -> list[str]:
        """Names of all sensors of a vehicle."""
        return [*self._vehicles[vehicle], *(sensor.name for sensor in self.placed if sensor.vehicle == vehicle)]

    def add(self, vehicle: str, name: str, sensor: Any, seed: int = 0, now: int | None = None) -> None:
        """Add a sensor that has no `problem`, and sample it `now` [substeps]; None: at the reset that follows.

        Raises `SensorError`; then nothing has changed.
        """
        placed = _Placed(
            vehicle=vehicle,
            index=self._indices[vehicle],
            name=name,
            sensor=sensor,
            columns=tuple(sensor.columns),
            schedule=None if sensor.rate is None else Schedule.of(sensor.rate, self._substep),
            start={},
            random=random_generator(seed, vehicle, name),
        )
        placed.start = _attributes(placed)
        if now is not None:
            self._take(placed, now)
        self.placed.append(placed)

    def reset(self, seed: int) -> None:
        """Start all sensors again; `sample` follows."""
        for sensor in self.placed:
            _set_attributes(sensor, sensor.start)
            sensor.random = random_generator(seed, sensor.vehicle, sensor.name)
            sensor.latest = None

    def sample(self, now: int) -> None:
        """Sample the sensors that are due at `now` [substeps], at 0 and after each tick. Raises `SensorError`."""
        before = now - self._substeps if now > 0 else None
        for sensor in self.placed:
            if sensor.latest is None or sensor.schedule is None or sensor.schedule.is_due(now, before):
                self._take(sensor, now)

    def readings(self, index: int) -> dict[str, OwnReading]:
        """The latest reading of each sensor of a vehicle, by name."""
        return {
            sensor.name: sensor.latest for sensor in self.placed if sensor.index == index and sensor.latest is not None
        }

    def continue_from(self, before: OwnSensors) -> None:
        """Take over the sensors of another world of the same vehicles, as they are; others of that name end."""
        kept = {(sensor.vehicle, sensor.name) for sensor in before.placed}
        own = [sensor for sensor in self.placed if (sensor.vehicle, sensor.name) not in kept]
        self.placed = [*before.placed, *own]
        self.clock = before.clock

    def save(self) -> Any:
        """The complete state, for `restore`."""
        return {
            (sensor.vehicle, sensor.name): (
                sensor.columns,
                sensor.latest,
                sensor.random.bit_generator.state,
                _attributes(sensor),
            )
            for sensor in self.placed
        }

    def check(self, saved: Any) -> None:
        """Raises `SnapshotError` unless a world with the same sensors has `saved` it."""
        kept = {key: columns for key, (columns, *_) in saved.items()}
        here = {(sensor.vehicle, sensor.name): sensor.columns for sensor in self.placed}
        for vehicle, name in sorted({key for key in kept.keys() | here.keys() if kept.get(key) != here.get(key)}):
            raise SnapshotError(
                f"sensor '{name}' of vehicle '{vehicle}' is not the same in the snapshot and in this world: "
                "add the same sensors to both worlds with add_sensor()"
            )

    def restore(self, saved: Any) -> None:
        """Set the state that `save` returned."""
        for sensor in self.placed:
            _, sensor.latest, random, attributes = saved[sensor.vehicle, sensor.name]
            sensor.random.bit_generator.state = random
            _set_attributes(sensor, attributes)

    def _take(self, placed: _Placed, now: int) -> None:
        """Take a sample."""
        bodies, shapes, state = self._view
        time = now * self._substep.numerator / self._substep.denominator
        view = SensorView(state, placed.index, time, shapes, bodies)
        began = self.clock() if self.clock else 0.0
        try:
            values = placed.sensor.sample(view, placed.random)
        except Exception as error:
            raise SensorError(f"{placed.title} raised {type(error).__name__}: {error}{_place(error)}") from error
        if self.clock and (placed.vehicle, placed.name) not in self._reported:
            self._watch(placed, self.clock() - began)
        placed.latest = OwnReading(time, _checked(placed, values), placed.columns)

    def _watch(self, placed: _Placed, duration: float) -> None:
        """Log a sensor that is slow, once."""
        placed.durations.append(duration)
        if len(placed.durations) < TIMED:
            return
        least, tick = min(placed.durations), float(self._substep * self._substeps)
        placed.durations.clear()
        if least > SLOW * tick:
            self._reported.add((placed.vehicle, placed.name))
            log.warning(
                "%s takes %.3g ms per sample; a tick of %g ms may come late in real time: make the sensor faster or "
                "lower its rate",
                placed.title,
                1e3 * least,
                1e3 * tick,
            )


def _checked(placed: _Placed, sample: Any) -> Floats:
    """The values of a sample, read-only, shape (n_column,). Raises `SensorError`."""
    count = len(placed.columns)
    expected = f"`sample` must return {count} number{'s' if count > 1 else ''}, for {', '.join(placed.columns[:10])}"
    try:
        values = np.atleast_1d(np.asarray(sample))  # one number will do for one column
    except ValueError:  # lists of different lengths
        raise SensorError(f"{placed.title} returned no array: {expected}") from None
    if values.dtype.kind not in "biuf":
        raise SensorError(
            f"{placed.title} returned {reprlib.repr(sample)}, which is not an array of numbers: {expected}"
        )
    if values.shape != (count,):
        raise SensorError(f"{placed.title} returned an array of shape {values.shape}: {expected}")
    return read_only_copy(values.astype(np.float64))


def _attributes(placed: _Placed) -> dict[str, Any]:
    """A copy of the attributes of a sensor. Raises `SensorError`."""
    try:
        return copy.deepcopy(getattr(placed.sensor, "__dict__", {}))
    except Exception as error:
        raise SensorError(
            f"{placed.title} cannot be reset and saved, because its attributes cannot be copied ({error}): keep values "
            "that never change in the class or module, not in the object"
        ) from None


def _set_attributes(placed: _Placed, attributes: dict[str, Any]) -> None:
    if hasattr(placed.sensor, "__dict__"):
        own = placed.sensor.__dict__
        own.clear()
        own.update(copy.deepcopy(attributes))


def _place(error: BaseException) -> str:
    """Where an error comes from: the last place that is not in this file."""
    places = [place for place in traceback.extract_tb(error.__traceback__) if place.filename != __file__]
    return f"  ({places[-1].filename}, line {places[-1].lineno})" if places else ""
