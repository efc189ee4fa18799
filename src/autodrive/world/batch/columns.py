"""The numbers of all worlds of a batch: one row for each world, in arrays that compiled code reads and writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined
from autodrive.physics.buffers import Scratch, VehicleContacts, scratch, vehicle_contacts
from autodrive.physics.engine import Engine, Views
from autodrive.physics.model import Model, Table
from autodrive.physics.sensors.columns import NoiseColumns, ReadingColumns, Working, working_memory
from autodrive.physics.sensors.tables import noise_columns, reading_columns
from autodrive.physics.state import State
from autodrive.scenario.maps.roads import Roads
from autodrive.world.compile import CompiledScenario
from autodrive.world.referee import NEVER
from autodrive.world.traffic.drive import Bodies, Drivers, Plan, new_drivers, new_plan
from autodrive.world.traffic_lights import LightTable, StopLineTable
from autodrive.world.v2x import Channel, RadioColumns, new_messages, radio_columns


class Worlds(NamedTuple):
    """All numbers of n worlds with v vehicles."""

    state: State
    """Columns with n rows; without the poses of shapes, which follow from those of the bodies: shape (n, 0, ...)."""
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
    """Likewise."""
    # referee
    last_contact: Integers
    """Tick of the last contact of each vehicle with each object, shape (n, v, n_object)."""
    collision_count: Integers
    """Since the reset, shape (n, v)."""
    has_collided: NDArray[np.bool_]
    """Whether there was a new collision in the last call, shape (n, v)."""
    is_off_road: NDArray[np.bool_]
    """Shape (n, v)."""
    ahead: Floats
    """From the front of each vehicle to each stop line [m]; see `StopLineReferee`, shape (n, v, m)."""
    has_stopped: NDArray[np.bool_]
    """Before a stop sign, shape (n, v, m)."""
    red_light_count: Integers
    """Events `RedLight` since the reset, shape (n, v)."""
    stop_sign_count: Integers
    """Likewise `StopSign`."""
    light_state: Integers
    """`TrafficLightState` of each light, shape (n, l)."""
    light_time: Floats
    """Time until it changes [s], shape (n, l)."""
    radio: RadioColumns
    drivers: Drivers
    """Of the traffic, with n rows in each column."""
    noise: NoiseColumns
    readings: ReadingColumns


class Rules(NamedTuple):
    """What is the same in all worlds and does not change, beside the Model."""

    owners: Integers
    """Number of the object of each solid; see `VehicleContacts`."""
    edges: Floats
    """See `referee.any_wheel_outside`."""
    separation: float
    """Ticks between two collisions with the same object."""
    lights: LightTable
    stop_lines: StopLineTable
    roads: Roads
    """On which the traffic drives."""
    bodies: Bodies
    """What the drivers of the traffic know of all vehicles."""
    channel: Channel
    """Of the radio; if nobody sends, it means nothing."""


class Thread(NamedTuple):
    """Working memory of one thread. Nothing in it is read after a world."""

    views: Views
    contacts: VehicleContacts
    scratch: Scratch
    shape_position: Floats
    """`State.shape_position`; the fixed shapes are always there."""
    shape_rotation: Floats
    """Likewise."""
    sensors: Working
    messages: Floats
    """Of the radio: see `v2x.new_messages`."""
    plan: Plan
    has_crossed: NDArray[np.bool_]
    """Which vehicle has crossed which stop line, shape (v, m)."""
    seen_lights: Integers
    """What drivers of the traffic see of each traffic light, shape (l,)."""


def empty_worlds(compiled: CompiledScenario, n: int, rays: int, rolling_rays: int) -> Worlds:
    """Worlds of zeros with the Model of the scenario; LIDARs, and rolling ones, have at most so many rays."""
    v, model = len(compiled.vehicles), compiled.model
    lights, lines = len(compiled.map.traffic_lights), len(compiled.map.stop_lines)
    columns = State(*(np.zeros((n, *column.shape)) for column in compiled.state._replace(**_NO_SHAPES)))
    return Worlds(
        state=columns,
        vehicles=np.tile(model.vehicles, (n, 1)),
        wheels=np.tile(model.wheels, (n, 1)),
        tick=np.zeros(n, np.int64),
        is_unstable=np.zeros(n, np.bool_),
        throttle=np.zeros((n, v)),
        steering=np.zeros((n, v)),
        last_contact=np.full((n, v, len(set(compiled.owners))), NEVER),
        collision_count=np.zeros((n, v), np.int64),
        has_collided=np.zeros((n, v), np.bool_),
        is_off_road=np.zeros((n, v), np.bool_),
        ahead=np.full((n, v, lines), np.nan),
        has_stopped=np.zeros((n, v, lines), np.bool_),
        red_light_count=np.zeros((n, v), np.int64),
        stop_sign_count=np.zeros((n, v), np.int64),
        light_state=np.zeros((n, lights), np.int64),
        light_time=np.full((n, lights), np.nan),
        radio=radio_columns(compiled.spec.v2x, n, v, lights, compiled.spec.tick),
        drivers=new_drivers((n, compiled.spec.traffic.cars)),
        noise=noise_columns(n, v),
        readings=reading_columns(n, v, rays, rolling_rays),
    )


_NO_SHAPES = {"shape_position": np.zeros((0, 3)), "shape_rotation": np.zeros((0, 9))}


def new_thread(compiled: CompiledScenario, engine: Engine, rays: int) -> Thread:
    """Working memory with that engine, for LIDARs of at most so many rays."""
    shapes = compiled.model.shapes
    return Thread(
        views=engine.views(),
        contacts=vehicle_contacts(compiled.model),
        scratch=scratch(compiled.model, engine.body_count),
        shape_position=shapes.position.copy(),
        shape_rotation=shapes.rotation.copy(),
        sensors=working_memory(shapes, len(compiled.vehicles), rays),
        messages=new_messages(len(compiled.vehicles), compiled.map.light_poses),
        has_crossed=np.zeros((len(compiled.vehicles), len(compiled.map.stop_lines)), np.bool_),
        plan=new_plan(compiled.spec.traffic.cars),
        seen_lights=np.zeros(len(compiled.map.traffic_lights), np.int64),
    )


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
