"""The numbers of worlds: a row for each, in arrays that compiled code reads and writes. A World is one row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined
from autodrive.physics.buffers import Scratch, VehicleContacts, scratch, vehicle_contacts
from autodrive.physics.engine import Engine, Views
from autodrive.physics.model import Model, Table
from autodrive.physics.sensors.columns import NoiseColumns, ReadingColumns, SensorTables, Working, working_memory
from autodrive.physics.sensors.tables import most_rays, noise_columns, reading_columns
from autodrive.physics.state import State
from autodrive.world.compile import CompiledScenario
from autodrive.world.rules import rules
from autodrive.world.rules.rules import RuleColumns, RuleMemory, RuleTables


class Worlds(NamedTuple):
    """All numbers of n worlds with v vehicles."""

    state: State
    """Columns with n rows; in a batch without the poses of shapes, which follow from those of the bodies: shape
    (n, 0, ...)."""
    vehicles: Table
    """`Model.vehicles` of each world, shape (n, v)."""
    wheels: Table
    """`Model.wheels` of each world, shape (n, 4 v)."""
    tick: Integers
    """Ticks since the reset of each world, shape (n,)."""
    is_unstable: NDArray[np.bool_]
    """Whether the physics of a world has diverged, shape (n,)."""
    throttle: Floats
    """Commands in [-1, 1], shape (n, v)."""
    steering: Floats
    """Commands in [-1, 1], left positive, shape (n, v)."""
    rules: RuleColumns
    noise: NoiseColumns
    readings: ReadingColumns


class Thread(NamedTuple):
    """Working memory of one thread. Nothing in it is read after a world."""

    views: Views
    contacts: VehicleContacts
    scratch: Scratch
    shape_position: Floats
    """`State.shape_position`; the fixed shapes are always there."""
    shape_rotation: Floats
    """`State.shape_rotation`; the fixed shapes are always there."""
    sensors: Working
    rules: RuleMemory


class Rows(NamedTuple):
    """All that the tick reads and writes."""

    model: Model
    """Model of the scenario. The tables of its vehicles and wheels are not read: each world has tables of its own."""
    worlds: Worlds
    thread: Thread
    sensors: SensorTables
    rules: RuleTables
    substeps: int
    """Physics steps in a tick."""
    always_engine: int
    """1: the engine moves the bodies in every substep."""
    has_rolling_lidar: int
    """1: a LIDAR needs the poses at the start of the tick."""


def rows_of_batch(c: CompiledScenario, n: int, engines: Sequence[Engine], engine: str) -> list[Rows]:
    """The columns of n worlds of the scenario, with the memory of a thread for each of the engines.

    `engine`: see `autodrive.make`.
    """
    rays, rolling_rays = most_rays(c.sensors.tables)
    v, model, shapes = len(c.vehicles), c.model, c.model.shapes
    columns = c.state._replace(shape_position=np.zeros((0, 3)), shape_rotation=np.zeros((0, 9)))
    worlds = Worlds(
        state=State(*(np.zeros((n, *column.shape)) for column in columns)),
        vehicles=np.tile(model.vehicles, (n, 1)),
        wheels=np.tile(model.wheels, (n, 1)),
        tick=np.zeros(n, np.int64),
        is_unstable=np.zeros(n, np.bool_),
        throttle=np.zeros((n, v)),
        steering=np.zeros((n, v)),
        rules=rules.new_columns(c, n),
        noise=noise_columns(n, v),
        readings=reading_columns(n, v, rays, rolling_rays),
    )
    threads = [
        Thread(
            views=thread_engine.views(),
            contacts=vehicle_contacts(model),
            scratch=scratch(model, thread_engine.body_count),
            shape_position=shapes.position.copy(),
            shape_rotation=shapes.rotation.copy(),
            sensors=working_memory(shapes, v, rays),
            rules=rules.new_memory(c),
        )
        for thread_engine in engines
    ]
    tables = rules.new_tables(c)
    return [_rows(c, worlds, thread, tables, engine) for thread in threads]


def rows_of_world(c: CompiledScenario, throttle: Floats, steering: Floats, engine: str) -> Rows:
    """One row, which shares the memory of Model, State and sensors of the scenario and of the commands, shape (v,)."""
    worlds = Worlds(
        state=State(*(column[None] for column in c.state)),
        vehicles=c.model.vehicles[None],
        wheels=c.model.wheels[None],
        tick=np.zeros(1, np.int64),
        is_unstable=np.zeros(1, np.bool_),
        throttle=throttle[None],
        steering=steering[None],
        rules=rules.new_columns(c, 1),
        noise=c.sensors.noise,
        readings=c.sensors.columns,
    )
    thread = Thread(
        views=c.views,
        contacts=c.contacts,
        scratch=c.scratch,
        shape_position=c.state.shape_position,
        shape_rotation=c.state.shape_rotation,
        sensors=c.sensors.working,
        rules=rules.new_memory(c),
    )
    return _rows(c, worlds, thread, rules.new_tables(c), engine)


def _rows(c: CompiledScenario, worlds: Worlds, thread: Thread, tables: RuleTables, engine: str) -> Rows:
    return Rows(
        model=c.model,
        worlds=worlds,
        thread=thread,
        sensors=c.sensors.tables,
        rules=tables,
        substeps=c.spec.substeps,
        always_engine=int(engine == "always"),
        has_rolling_lidar=int(c.sensors.has_rolling_lidar),
    )


def each_column(function: Callable[..., Any], *tables: Any) -> Any:
    """The result of the function for each array of NamedTuples of one kind, in such a NamedTuple."""
    if not isinstance(tables[0], tuple):
        return function(*tables)
    kind: Any = type(tables[0])
    parts = [each_column(function, *columns) for columns in zip(*tables, strict=True)]
    return kind(*parts) if parts else ()


def columns_of(tables: Any) -> Iterator[Any]:
    """Each array of a NamedTuple of arrays and such NamedTuples."""
    if isinstance(tables, tuple):
        for part in tables:
            yield from columns_of(part)
    else:
        yield tables


def without_tables(worlds: Worlds) -> Worlds:
    """What a snapshot holds: all but the tables of vehicles and wheels, which follow from factors and weather."""
    return worlds._replace(vehicles=(), wheels=())


def saved_row(worlds: Worlds) -> Worlds:
    """A copy of the row of a World, for `restore_row`."""
    return each_column(np.copy, without_tables(worlds))


def restore_row(worlds: Worlds, saved: Worlds) -> None:
    """Write what `saved_row` has copied."""
    each_column(np.copyto, without_tables(worlds), saved)


@inlined
def model_of(k: int, model: Model, worlds: Worlds) -> Model:
    """The Model of world k."""
    return Model(model.dt, model.gravity, worlds.vehicles[k], worlds.wheels[k], model.shapes)


@inlined
def state_of(k: int, worlds: Worlds, thread: Thread) -> State:
    """The State of world k; the poses of its shapes are those of the thread's last world."""
    s = worlds.state
    return State(
        qpos=s.qpos[k],
        qvel=s.qvel[k],
        qacc=s.qacc[k],
        asleep=s.asleep[k],
        vehicle_position=s.vehicle_position[k],
        vehicle_orientation=s.vehicle_orientation[k],
        vehicle_velocity=s.vehicle_velocity[k],
        vehicle_angular_velocity=s.vehicle_angular_velocity[k],
        vehicle_acceleration=s.vehicle_acceleration[k],
        vehicle_angular_acceleration=s.vehicle_angular_acceleration[k],
        throttle=s.throttle[k],
        drive_level=s.drive_level[k],
        steering_target=s.steering_target[k],
        servo_angle=s.servo_angle[k],
        steering_angle=s.steering_angle[k],
        throttle_queue=s.throttle_queue[k],
        steering_queue=s.steering_queue[k],
        wheel_angular_velocity=s.wheel_angular_velocity[k],
        wheel_rotation=s.wheel_rotation[k],
        wheel_steering_angle=s.wheel_steering_angle[k],
        wheel_compression=s.wheel_compression[k],
        wheel_normal_load=s.wheel_normal_load[k],
        wheel_slip_ratio=s.wheel_slip_ratio[k],
        wheel_slip_angle=s.wheel_slip_angle[k],
        wheel_force=s.wheel_force[k],
        wheel_lagged_slip=s.wheel_lagged_slip[k],
        wheel_hold=s.wheel_hold[k],
        shape_position=thread.shape_position,
        shape_rotation=thread.shape_rotation,
    )
