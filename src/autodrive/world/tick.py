"""The tick of a world in compiled stages, which a World runs one by one, and a batch for all of its worlds.

The order of a tick: the drivers of the traffic write their commands (`drive_traffic`), the bodies move (`move`), the
rules judge what has happened (`judge`), the sensors sample and the radio sends and delivers (`sense`).

A World calls each stage with its `Rows` as a `Pinned` and the number 0. A batch takes them from its `Pinned` once, for
all worlds k, and calls what the stages call.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.base.pinned import Pinned, held
from autodrive.physics.engine import AWAKE
from autodrive.physics.sensors.columns import StatePoses, motion_of
from autodrive.physics.sensors.sampling import sample
from autodrive.physics.state import State
from autodrive.physics.tick import actuate, advance, move_shapes, observe
from autodrive.world.columns import Rows, model_of, state_of
from autodrive.world.rules import collisions, radio, rules
from autodrive.world.rules.traffic import rule as traffic


@inlined
def _drive_traffic(rows: Rows, k: int) -> None:
    """Write what the vehicles of the traffic obey in this tick."""
    worlds = rows.worlds
    traffic.command(
        k,
        int(worlds.tick[k]),
        state_of(k, worlds, rows.thread),
        worlds.rules.lights,
        rows.rules.traffic,
        worlds.rules.traffic,
        worlds.throttle[k],
        worlds.steering[k],
    )


@inlined
def _move(rows: Rows, k: int) -> bool:
    """Move the bodies by a tick; False if the physics has diverged."""
    worlds, thread = rows.worlds, rows.thread
    model, state = model_of(k, rows.model, worlds), state_of(k, worlds, thread)
    if rows.has_rolling_lidar == 1:
        _note_poses(state, model.shapes.n_fixed, thread.sensors.before)
    is_sound = advance(
        model,
        state,
        thread.views,
        thread.contacts,
        thread.scratch,
        worlds.throttle[k],
        worlds.steering[k],
        int(worlds.tick[k]) * rows.substeps,
        rows.substeps,
        rows.always_engine == 1,
    )
    worlds.tick[k] += 1
    return is_sound


@inlined
def _judge(rows: Rows, k: int) -> bool:
    """Let the rules judge the tick that has ended; True if a World has events."""
    worlds, thread, tick = rows.worlds, rows.thread, int(rows.worlds.tick[k])
    return rules.judge(
        k,
        tick,
        _time(rows, tick),
        worlds.wheels[k],
        state_of(k, worlds, thread),
        thread.contacts,
        rows.rules,
        worlds.rules,
        thread.rules,
    )


@inlined
def _sense(rows: Rows, k: int) -> bool:
    """Sample the sensors that are due, and let the radio send and deliver; True if a vehicle heard something."""
    worlds, thread, tick = rows.worlds, rows.thread, int(rows.worlds.tick[k])
    state, now = state_of(k, worlds, thread), tick * rows.substeps
    sample(
        k,
        now,
        rows.substeps,
        motion_of(state),
        rows.model.shapes,
        worlds.noise,
        worlds.readings,
        thread.sensors,
        rows.sensors,
    )
    lights, messages = worlds.rules.lights, thread.rules.radio
    return radio.transmit(k, tick, _time(rows, tick), state, lights, rows.rules.radio, worlds.rules.radio, messages)


@inlined
def _show_lights(rows: Rows, k: int) -> None:
    """Let the traffic lights show what they show now."""
    tick = int(rows.worlds.tick[k])
    rules.show_lights(k, tick, _time(rows, tick), rows.rules, rows.worlds.rules)


@jit_uncounted
def step_worlds(pinned: Pinned[Rows], is_stepped: NDArray[np.bool_], first: int, last: int, ticks: int) -> None:
    """Move the worlds `first` to `last` - 1 by so many ticks, if `is_stepped`, shape (n,).

    A world that has diverged stays still.
    """
    rows = held(pinned)
    worlds, thread = rows.worlds, rows.thread
    for k in range(first, last):
        for i in range(worlds.throttle.shape[1]):
            worlds.rules.collisions.has_collided[k, i] = False
        if worlds.is_unstable[k] or not is_stepped[k]:
            continue
        move_shapes(model_of(k, rows.model, worlds), state_of(k, worlds, thread))
        for _tick in range(ticks):
            for kind in range(thread.views.warnings.shape[0]):
                thread.views.warnings[kind] = 0  # the engine is for all worlds of the thread
            if worlds.rules.traffic.shape[1] > 0:
                _drive_traffic(rows, k)
            if not _move(rows, k):
                collisions.forget(thread.contacts)
                worlds.is_unstable[k] = True
                break
            _judge(rows, k)
            _sense(rows, k)


@jit_uncounted
def begin_worlds(pinned: Pinned[Rows], chosen: Integers) -> None:
    """Complete the reset of the `chosen` worlds, whose rows are at the start: columns of vehicles, first readings."""
    rows = held(pinned)
    for c in range(chosen.shape[0]):
        k = chosen[c]
        state = state_of(k, rows.worlds, rows.thread)
        for b in range(state.asleep.shape[0]):
            state.asleep[b] = AWAKE
        observe(model_of(k, rows.model, rows.worlds), state)
        _show_lights(rows, k)
        _sense(rows, k)


@jit_uncounted
def obey_past(pinned: Pinned[Rows], chosen: Integers, i: int, past: Floats) -> None:
    """Let the actuators of vehicle i of the `chosen` worlds obey the commands of the ticks before the start.

    `past`: throttle and steering, oldest first, shape (m, t, 2).
    """
    rows = held(pinned)
    for c in range(chosen.shape[0]):
        k = chosen[c]
        model, state = model_of(k, rows.model, rows.worlds), state_of(k, rows.worlds, rows.thread)
        for substep in range(-past.shape[1] * rows.substeps, 0):
            t = past.shape[1] + substep // rows.substeps
            actuate(i, model, state, past[c, t, 0], past[c, t, 1], substep)


@jit_uncounted
def drive_traffic(pinned: Pinned[Rows], k: int) -> None:
    """The stage `_drive_traffic`."""
    _drive_traffic(held(pinned), k)


@jit_uncounted
def move(pinned: Pinned[Rows], k: int) -> bool:
    """The stage `_move`."""
    return _move(held(pinned), k)


@jit_uncounted
def judge(pinned: Pinned[Rows], k: int) -> bool:
    """The stage `_judge`."""
    return _judge(held(pinned), k)


@jit_uncounted
def sense(pinned: Pinned[Rows], k: int) -> bool:
    """The stage `_sense`."""
    return _sense(held(pinned), k)


@jit_uncounted
def show_lights(pinned: Pinned[Rows], k: int) -> None:
    """The stage `_show_lights`."""
    _show_lights(held(pinned), k)


@inlined
def _time(rows: Rows, tick: int) -> float:
    """Simulated time of a tick since the reset [s]."""
    numerator, denominator = rows.sensors.substep
    return tick * rows.substeps * numerator / denominator


@inlined
def _note_poses(state: State, n_fixed: int, before: StatePoses) -> None:
    """Copy the poses at the start of a tick."""
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
