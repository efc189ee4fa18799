"""The motion of vehicles at the start of a run, and the commands that their actuators have obeyed before it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import CommandError
from autodrive.base.pinned import Pinned
from autodrive.physics.actuators.curve import interpolated
from autodrive.world.columns import Rows, Worlds
from autodrive.world.tick import obey_past

MAX_SPEED = 1000.0
"""Greatest speed [m/s] and yaw rate [rad/s] of a vehicle at its start."""
MOST_PAST = 10_000
"""Most past commands of a vehicle."""


class StartMotion(NamedTuple):
    """How a vehicle starts in m worlds."""

    motion: Floats
    """Forward and left speed [m/s], yaw rate [rad/s], and the throttle and steering of which its actuators are at rest
    before the past commands, shape (m, 5)."""
    past: Floats
    """Throttle and steering of the ticks before the start, oldest first, shape (m, t, 2)."""


def checked_motions(
    motions: Mapping[str, ArrayLike] | None, past: Mapping[str, ArrayLike] | None, m: int
) -> dict[str, StartMotion]:
    """The starts of vehicles in m worlds by name; see `BatchWorld.reset`. Raises `CommandError`."""
    motions, past = motions or {}, past or {}
    for name, values in (("motions", motions), ("past_commands", past)):
        if not isinstance(values, Mapping):
            raise CommandError(f"{name} must be a dictionary with numbers for each vehicle, not {values!r:.100}")
    return {
        name: StartMotion(
            _checked_motion(name, motions.get(name, np.zeros(5)), m),
            _checked_past(name, past.get(name, np.zeros((0, 2))), m),
        )
        for name in {**motions, **past}
    }


def checked_rows(name: str, rows: ArrayLike, shape: tuple[int, ...], columns: str) -> Floats:
    """The rows as numbers in the given shape; a single row is repeated. Raises `CommandError`."""
    try:
        return np.broadcast_to(np.asarray(rows, dtype=np.float64), shape)
    except (TypeError, ValueError):
        raise CommandError(f"{name} must have the shape {shape}: {columns}") from None


def _checked_motion(name: str, motion: ArrayLike, m: int) -> Floats:
    columns = "forward and left speed, yaw rate, throttle, steering"
    values = checked_rows(f"the motions of '{name}'", motion, (m, 5), columns)
    if not (np.abs(values) <= (*(MAX_SPEED,) * 3, 1.0, 1.0)).all():
        raise CommandError(
            f"the speeds of '{name}' must be numbers from {-MAX_SPEED:g} to {MAX_SPEED:g}, its throttle and "
            "steering from -1 to 1"
        )
    return values


def _checked_past(name: str, past: ArrayLike, m: int) -> Floats:
    shape = np.shape(past)  # pyright: ignore[reportArgumentType]
    ticks = shape[-2] if len(shape) in (2, 3) else 0
    values = checked_rows(f"past_commands of '{name}'", past, (m, ticks, 2), "throttle, steering of each tick")
    if ticks > MOST_PAST or not (np.abs(values) <= 1.0).all():
        raise CommandError(f"past_commands of '{name}' must be at most {MOST_PAST} ticks with numbers from -1 to 1")
    return values


def set_motion(rows: Pinned[Rows], worlds: Worlds, chosen: Integers, i: int, start: StartMotion) -> None:
    """Set velocities and actuators of vehicle i in the m chosen `worlds` of the rows; its poses are set."""
    s, vehicles = worlds.state, worlds.vehicles[chosen, i]
    dof, at = int(vehicles["dof"][0]), int(vehicles["qpos"][0])
    forward, left, rate, throttle, steering = start.motion.T
    yaw = 2.0 * np.arctan2(s.qpos[chosen, at + 6], s.qpos[chosen, at + 3])
    s.qvel[chosen, dof] = np.cos(yaw) * forward - np.sin(yaw) * left
    s.qvel[chosen, dof + 1] = np.sin(yaw) * forward + np.cos(yaw) * left
    s.qvel[chosen, dof + 5] = rate
    wheels = worlds.wheels[chosen, 4 * i : 4 * i + 4]
    spin = (forward[:, None] - rate[:, None] * wheels["hub"][..., 1]) / wheels["radius"]
    s.wheel_angular_velocity[chosen, 4 * i : 4 * i + 4] = spin
    throttle = np.where(vehicles["drive_has_reverse"], throttle, np.maximum(throttle, 0.0))
    limits = vehicles["command_limits"]
    angle = np.clip(steering, limits[:, 0], limits[:, 1]) * vehicles["steering_limit"]
    s.throttle[chosen, i] = s.drive_level[chosen, i] = throttle
    s.steering_target[chosen, i] = s.servo_angle[chosen, i] = s.steering_angle[chosen, i] = angle
    s.throttle_queue[chosen, i], s.steering_queue[chosen, i] = throttle[:, None], angle[:, None]
    set_linkage(worlds, chosen)
    if start.past.shape[1]:
        obey_past(rows, chosen, i, np.ascontiguousarray(start.past))


def set_linkage(worlds: Worlds, chosen: Integers) -> None:
    """Set the steering angles of vehicles with a curve, an offset or a trim from the angles of their servos."""
    curves = [worlds.vehicles[f"steering_curve_{part}"] for part in ("points", "servo", "angle")]
    for c, i in np.argwhere(curves[0][chosen]).tolist():
        points, servo, angle = (column[chosen[c], i] for column in curves)
        worlds.state.steering_angle[chosen[c], i] = interpolated(
            points, servo, angle, worlds.state.servo_angle[chosen[c], i]
        )
