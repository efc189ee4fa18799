"""The compiled tick of many worlds, world after world: that of `World.step`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Integers
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.physics.buffers import VehicleContacts
from autodrive.physics.engine import AWAKE
from autodrive.physics.model import Model
from autodrive.physics.sensors.columns import SensorTables, StatePoses, motion_of
from autodrive.physics.sensors.sampling import sample
from autodrive.physics.state import State
from autodrive.physics.tick import advance, move_shapes, observe
from autodrive.world.batch.columns import Rules, Thread, Worlds, model_of, state_of
from autodrive.world.referee import any_wheel_outside, begins_collision
from autodrive.world.traffic.drive import UNREGULATED, Seen, drive, drivers_of
from autodrive.world.traffic_lights import count_offences, note_stop_lines, show_lights
from autodrive.world.v2x import LIGHT_STATE, TIME_TO_CHANGE, transmit, write_vehicles


@jit_uncounted
def step_worlds(
    model: Model,
    worlds: Worlds,
    is_stepped: NDArray[np.bool_],
    thread: Thread,
    sensors: SensorTables,
    rules: Rules,
    first: int,
    last: int,
    ticks: int,
    substeps: int,
    always_engine: bool,
    has_rolling_lidar: bool,
) -> None:
    """Moves the worlds `first` to `last` - 1 by `ticks` of so many `substeps`, if `is_stepped`, shape (n,).

    A world that has diverged stays still.
    """
    for k in range(first, last):
        for i in range(model.vehicles.shape[0]):
            worlds.has_collided[k, i] = False
        if worlds.is_unstable[k] or not is_stepped[k]:
            continue
        own = model_of(k, model, worlds)
        state = state_of(k, worlds, thread)
        move_shapes(own, state)
        for _tick in range(ticks):
            for kind in range(thread.views.warnings.shape[0]):
                thread.views.warnings[kind] = 0  # the engine is for all worlds of the thread
            if rules.bodies.row.shape[0] > 0:
                _drive_traffic(k, worlds, state, thread, rules)
            if has_rolling_lidar:
                _note_poses(state, own.shapes.n_fixed, thread.sensors.before)
            is_sound = advance(
                own,
                state,
                thread.views,
                thread.contacts,
                thread.scratch,
                worlds.throttle[k],
                worlds.steering[k],
                worlds.tick[k] * substeps,
                substeps,
                always_engine,
            )
            worlds.tick[k] += 1
            _judge(
                worlds.tick[k],
                thread.contacts,
                rules.owners,
                rules.separation,
                worlds.last_contact[k],
                worlds.collision_count[k],
                worlds.has_collided[k],
            )
            if not is_sound:
                worlds.is_unstable[k] = True
                break
            if rules.edges.shape[0] > 0:  # a map without roads has none
                for i in range(model.vehicles.shape[0]):
                    worlds.is_off_road[k, i] = any_wheel_outside(
                        rules.edges, own.wheels, i, state.vehicle_position[i], state.vehicle_orientation[i]
                    )
            now = int(worlds.tick[k]) * substeps
            sample(
                k, now, substeps, motion_of(state), own.shapes, worlds.noise, worlds.readings, thread.sensors, sensors
            )
            _signal(k, worlds, state, thread, sensors, rules, now)
            if rules.stop_lines.lines.shape[0] > 0:
                _judge_stop_lines(k, worlds, state, thread, rules)


@jit_uncounted
def begin_worlds(
    model: Model,
    worlds: Worlds,
    thread: Thread,
    sensors: SensorTables,
    rules: Rules,
    chosen: Integers,
    substeps: int,
) -> None:
    """Completes the reset of the `chosen` worlds, whose rows are at the start: columns of vehicles, first readings."""
    for c in range(chosen.shape[0]):
        k = chosen[c]
        own = model_of(k, model, worlds)
        state = state_of(k, worlds, thread)
        for b in range(state.asleep.shape[0]):
            state.asleep[b] = AWAKE
        observe(own, state)
        now = int(worlds.tick[k]) * substeps
        sample(k, now, substeps, motion_of(state), own.shapes, worlds.noise, worlds.readings, thread.sensors, sensors)
        _signal(k, worlds, state, thread, sensors, rules, now)


@inlined
def _drive_traffic(k: int, worlds: Worlds, state: State, thread: Thread, rules: Rules) -> None:
    """Write the commands of the traffic of world k in this tick."""
    for light in range(thread.seen_lights.shape[0]):
        is_regulating = rules.lights.is_regulating[light]
        thread.seen_lights[light] = worlds.light_state[k, light] if is_regulating else UNREGULATED
    drive(
        rules.roads,
        rules.bodies,
        drivers_of(k, worlds.drivers),
        thread.plan,
        Seen(state.qpos, state.vehicle_position, state.vehicle_orientation, state.vehicle_velocity),
        thread.seen_lights,
        int(worlds.tick[k]),
        rules.lights.tick,
        worlds.throttle[k],
        worlds.steering[k],
    )


@inlined
def _judge_stop_lines(k: int, worlds: Worlds, state: State, thread: Thread, rules: Rules) -> None:
    """Count who crossed a stop line of world k at red, or at a stop sign without a stop."""
    if note_stop_lines(
        rules.stop_lines,
        state.vehicle_position,
        state.vehicle_orientation,
        state.vehicle_velocity,
        worlds.ahead[k],
        worlds.has_stopped[k],
        thread.has_crossed,
    ):
        count_offences(
            rules.stop_lines,
            worlds.light_state[k],
            worlds.has_stopped[k],
            thread.has_crossed,
            worlds.red_light_count[k],
            worlds.stop_sign_count[k],
        )


@inlined
def _signal(
    k: int, worlds: Worlds, state: State, thread: Thread, sensors: SensorTables, rules: Rules, now: int
) -> None:
    """Show the traffic lights of world k `now` [substeps], and let the radio send and deliver."""
    tick, radio, messages = int(worlds.tick[k]), worlds.radio, thread.messages
    show_lights(rules.lights, tick, worlds.light_state[k], worlds.light_time[k])
    if radio.heard.shape[2] > 0:
        vehicles = state.vehicle_position.shape[0]
        write_vehicles(
            state.vehicle_position, state.vehicle_orientation, state.vehicle_velocity, state.steering_angle, messages
        )
        for light in range(worlds.light_state.shape[1]):
            messages[vehicles + light, LIGHT_STATE] = worlds.light_state[k, light]
            messages[vehicles + light, TIME_TO_CHANGE] = worlds.light_time[k, light]
        numerator, denominator = sensors.substep
        transmit(k, rules.channel, radio, messages, tick, now * numerator / denominator)


@inlined
def _note_poses(state: State, n_fixed: int, before: StatePoses) -> None:
    for i in range(state.vehicle_position.shape[0]):
        for axis in range(3):
            before.position[i, axis] = state.vehicle_position[i, axis]
        for axis in range(4):
            before.orientation[i, axis] = state.vehicle_orientation[i, axis]
    for s in range(n_fixed, state.shape_position.shape[0]):
        for axis in range(3):
            before.shape_position[s, axis] = state.shape_position[s, axis]
        for axis in range(9):
            before.shape_rotation[s, axis] = state.shape_rotation[s, axis]


@inlined
def _judge(
    tick: int,
    contacts: VehicleContacts,
    owners: Integers,
    separation: float,
    last_contact: Integers,
    collision_count: Integers,
    has_collided: NDArray[np.bool_],
) -> None:
    """Counts the new collisions of a tick, as `referee.Referee`, and clears the contacts."""
    for p in range(contacts.pair_count[0]):
        vehicle, solid = contacts.pairs[p, 0], contacts.pairs[p, 1]
        contacts.impulse[vehicle, solid] = 0.0
        if begins_collision(last_contact, vehicle, int(owners[solid]), tick, separation):
            collision_count[vehicle] += 1
            has_collided[vehicle] = True
    contacts.pair_count[0] = 0
