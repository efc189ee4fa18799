"""State: all quantities that change in a tick, as a NamedTuple of flat float64 arrays for compiled code.

Between ticks all values belong to the same instant. `n` is the number of vehicles, `n_wheel` of wheels (four per
vehicle, in the order of `protocol.messages.WHEEL_NAMES`), `n_body` of movable bodies, `n_shape` of collision shapes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError
from autodrive.base.suggest import suggest
from autodrive.physics.model import Model
from autodrive.protocol.messages import WHEEL_NAMES


class State(NamedTuple):
    """Columns of numbers; each row is a vehicle, a wheel or a shape."""

    # movable bodies, in the engine's order: objects, then vehicles
    qpos: Floats
    """Position in the map [m] and quaternion wxyz of each body, shape (7 n_body,)."""
    qvel: Floats
    """Velocity of each body's origin in map axes [m/s], angular velocity in body axes [rad/s], shape (6 n_body,)."""
    qacc: Floats
    """Change of `qvel` per second in the last substep, from which the engine's solver starts, shape (6 n_body,)."""
    asleep: Floats
    """The engine's sleep state of each body: negative while it is awake, shape (n_body,)."""
    # vehicles: the vehicle frame is the centre of the rear axle at wheel-centre height
    vehicle_position: Floats
    """Vehicle frame in the map [m], shape (n, 3)."""
    vehicle_orientation: Floats
    """Quaternion wxyz, map from vehicle, shape (n, 4)."""
    vehicle_velocity: Floats
    """Velocity of the vehicle frame's origin in vehicle axes [m/s], shape (n, 3)."""
    vehicle_angular_velocity: Floats
    """Angular velocity of each vehicle in its own axes [rad/s], shape (n, 3)."""
    vehicle_acceleration: Floats
    """Acceleration of the origin in vehicle axes, mean over the tick, without gravity [m/s^2], shape (n, 3)."""
    vehicle_angular_acceleration: Floats
    """Mean over the tick, vehicle axes [rad/s^2], shape (n, 3)."""
    # actuators
    throttle: Floats
    """Throttle command after the dead time of the drive [-1, 1], shape (n,)."""
    drive_level: Floats
    """First-order response of the drive to that command [-1, 1], shape (n,)."""
    steering_target: Floats
    """Steering command after the dead time of the servo, as an angle [rad], shape (n,)."""
    servo_angle: Floats
    """Angle of the servo, left positive: the command that it has reached, as an angle [rad], shape (n,)."""
    steering_angle: Floats
    """Steering angle at the middle of the steered axle, left positive, behind the linkage [rad], shape (n,)."""
    throttle_queue: Floats
    """Throttle commands of the last substeps (ring buffer), shape (n, longest delay + 1)."""
    steering_queue: Floats
    """Steering commands of the last substeps, as angles [rad], same shape."""
    # wheels
    wheel_angular_velocity: Floats
    """Spin, forward positive [rad/s], shape (n_wheel,)."""
    wheel_rotation: Floats
    """Rotation angle since reset, not wrapped [rad], shape (n_wheel,)."""
    wheel_steering_angle: Floats
    """Left positive [rad], shape (n_wheel,)."""
    wheel_compression: Floats
    """Suspension travel from the target position, compression positive [m], shape (n_wheel,)."""
    wheel_normal_load: Floats
    """Force of the ground along its normal [N], shape (n_wheel,)."""
    wheel_slip_ratio: Floats
    """Shape (n_wheel,)."""
    wheel_slip_angle: Floats
    """[rad], shape (n_wheel,)."""
    wheel_force: Floats
    """Longitudinal and lateral force of the ground on the chassis [N], shape (n_wheel, 2)."""
    wheel_lagged_slip: Floats
    """Slip ratio and tangent of the slip angle that the magic formula gets, behind by the relaxation length; 0 without
    it, shape (n_wheel, 2)."""
    wheel_hold: Floats
    """Longitudinal and lateral deflection of a braked wheel at rest [m], shape (n_wheel, 2)."""
    # collision shapes, which a LIDAR ray, a wheel or another body can hit
    shape_position: Floats
    """Centre in the map [m], shape (n_shape, 3)."""
    shape_rotation: Floats
    """Rotation matrix, map from shape, row-major, shape (n_shape, 9)."""


BODY_COLUMNS = ("qpos", "qvel", "qacc", "asleep")
"""Columns of all movable bodies; their shape depends on the objects of a world."""


def empty_state(model: Model, n_body: int) -> State:
    """A State of zeros for that model and so many movable bodies."""
    n, n_shape = len(model.vehicles), len(model.shapes.kind)
    queue = 1 + int(max(model.vehicles["drive_delay"].max(initial=0), model.vehicles["steering_delay"].max(initial=0)))
    widths: dict[str, tuple[int, ...]] = {
        "qpos": (7 * n_body,),
        "qvel": (6 * n_body,),
        "qacc": (6 * n_body,),
        "asleep": (n_body,),
        **{f"vehicle_{name}": (n, 3) for name in ("position", "velocity", "angular_velocity", "acceleration")},
        "vehicle_angular_acceleration": (n, 3),
        "vehicle_orientation": (n, 4),
        **dict.fromkeys(("throttle", "drive_level", "steering_target", "servo_angle", "steering_angle"), (n,)),
        "throttle_queue": (n, queue),
        "steering_queue": (n, queue),
        "wheel_force": (4 * n, 2),
        "wheel_lagged_slip": (4 * n, 2),
        "wheel_hold": (4 * n, 2),
        "shape_position": (n_shape, 3),
        "shape_rotation": (n_shape, 9),
    }
    shapes = [widths.get(name, (4 * n,)) for name in State._fields]
    return _columns(np.zeros(sum(math.prod(shape) for shape in shapes)), shapes)


def numbers(state: State) -> Floats:
    """All numbers of a State of `empty_state`, column after column: the memory of its columns, shape (n_number,)."""
    flat = state.qpos.base
    assert flat is not None
    return flat


def places(state: State) -> State:
    """A State that has, in place of each number of a State of `empty_state`, its index in `numbers`."""
    return _columns(np.arange(len(numbers(state))), [column.shape for column in state])


def _columns(flat: NDArray[Any], shapes: Sequence[tuple[int, ...]]) -> State:
    """Columns of these shapes that share the memory of `flat`."""
    ends = np.cumsum([math.prod(shape) for shape in shapes]).tolist()
    return State(*(flat[end - math.prod(shape) : end].reshape(shape) for end, shape in zip(ends, shapes, strict=True)))


class VehicleView:
    """Reads a vehicle's columns of the State by name: `view.steering_angle`, `view.wheel("front_left").slip_ratio`."""

    def __init__(self, state: State, index: int) -> None:
        self._state = state
        self._index = index

    def __getattr__(self, name: str) -> Any:
        column = getattr(self._state, f"vehicle_{name}", None)
        if column is None:
            column = getattr(self._state, name)
        return _plain(column[self._index])

    def wheel(self, name: str) -> WheelView:
        """The view of one wheel, a name of `WHEEL_NAMES`."""
        if name not in WHEEL_NAMES:
            raise CommandError(f"wheel '{name}' is not known. {suggest(str(name), [*WHEEL_NAMES])}")
        return WheelView(self._state, 4 * self._index + WHEEL_NAMES.index(name))


class WheelView:
    """Reads a wheel's columns of the State by name, without their prefix `wheel_`."""

    def __init__(self, state: State, index: int) -> None:
        self._state = state
        self._index = index

    def __getattr__(self, name: str) -> Any:
        return _plain(getattr(self._state, f"wheel_{name}")[self._index])


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else value.copy()
