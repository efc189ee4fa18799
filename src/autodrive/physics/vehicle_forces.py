"""Forces on one vehicle in a substep: drive, brakes, tyres and air; also advances the spin of its wheels."""

from __future__ import annotations

from math import sqrt
from typing import Any

from autodrive.arrays import Floats
from autodrive.jit import inlined
from autodrive.model import Model
from autodrive.physics.buffers import Scratch
from autodrive.physics.formulas import (
    ackermann_angle,
    braked_spin,
    coasting_spin,
    drive_target,
    drive_torque_limit,
    motor_torque,
    not_zero,
    relaxed,
    slip_angle,
    slip_ratio_denominator,
    tyre_force,
)
from autodrive.physics.free_body import angular_velocity, apply_force, rotated, rotation_at
from autodrive.physics.wheel_contact import find_contact
from autodrive.state import State
from autodrive.transforms import Rotation, Vector


@inlined
def apply_forces(i: int, rotation: Rotation, model: Model, state: State, scratch: Scratch) -> None:
    """Adds the forces of ground and air on vehicle i, and their reactions on the bodies below its wheels, to `scratch`.

    `rotation` is that of the vehicle. Sets steering angle, spin, rotation, slip and force of its wheels in the state.
    """
    v = model.vehicles[i]
    dt = model.dt
    turn = angular_velocity(state, rotation, v["dof"])
    is_braking = state.throttle[i] == 0.0
    driven, sum_coasting, sum_gain = 0, 0.0, 0.0
    for w in range(4):
        wheel = model.wheels[4 * i + w]
        row = 4 * i + w
        angle = 0.0
        if wheel["is_steered"]:
            angle = ackermann_angle(state.steering_angle[i], v["wheelbase"], wheel["hub"][1])
        state.wheel_steering_angle[row] = angle
        find_contact(i, w, angle, rotation, turn, model, state, scratch)
        contact = scratch.wheel_contacts[w]
        v_long = contact["longitudinal_velocity"]
        spin = state.wheel_angular_velocity[row]
        ratio, slip_speed = _slip(wheel, spin, v_long, (is_braking and wheel["is_braked"]) or wheel["is_driven"])
        contact["lateral_velocity"] = not_zero(contact["lateral_velocity"])
        angle_of_slip = slip_angle(contact["lateral_velocity"], v_long, wheel["slip_angle_offset"])
        fx, _ = _tyre_force(wheel, ratio, angle_of_slip, contact["load"])
        coasting, gain = coasting_spin(
            spin, fx, slip_speed, wheel["radius"], wheel["inertia"], wheel["damping_rate"], dt
        )
        contact["slip_angle"], contact["coasting_spin"], contact["spin_gain"] = angle_of_slip, coasting, gain
        if wheel["is_driven"]:
            driven += 1
            sum_coasting += coasting
            sum_gain += gain
    torque = 0.0
    if not is_braking:
        level = state.drive_level[i]
        torque = motor_torque(
            sum_coasting / driven,
            sum_gain / driven,
            drive_target(level, v["drive_is_speed_controlled"], v["drive_speed_limit"]),
            v["drive_servo_gain"],
            drive_torque_limit(level, v["drive_is_speed_controlled"], v["drive_torque_limit"]),
        )
    _apply_drag(v, rotation, turn, state, scratch.applied)
    for w in range(4):
        wheel = model.wheels[4 * i + w]
        row = 4 * i + w
        contact = scratch.wheel_contacts[w]
        spin = contact["coasting_spin"]
        if wheel["is_driven"]:
            spin += contact["spin_gain"] * torque
        if is_braking and wheel["is_braked"]:
            spin = braked_spin(spin, v["brake_torque"], contact["spin_gain"])
        state.wheel_angular_velocity[row] = spin
        state.wheel_rotation[row] += spin * dt
        _apply_wheel_force(i, w, is_braking and wheel["is_braked"], rotation, model, state, scratch)


@inlined
def _slip(wheel: Any, spin: float, longitudinal_velocity: float, is_active: bool) -> tuple[float, float]:
    """Slip ratio, and speed of the tread over the ground [m/s]."""
    tread = wheel["radius"] * spin
    slip_speed = not_zero(tread - longitudinal_velocity)
    denominator = slip_ratio_denominator(
        longitudinal_velocity, tread, is_active, wheel["active_slip_offset"], wheel["passive_slip_minimum"]
    )
    return slip_speed / denominator, slip_speed


@inlined
def _tyre_force(wheel: Any, ratio: float, angle: float, load: float) -> tuple[float, float]:
    f, s = wheel["forward"], wheel["sideways"]
    return tyre_force(ratio, angle, load, f[0], f[1], f[2], f[3], f[4], s[0], s[1], s[2], s[3], s[4])


@inlined
def _apply_wheel_force(
    i: int, w: int, is_braking: bool, rotation: Rotation, model: Model, state: State, scratch: Scratch
) -> None:
    """Applies the ground's force on wheel w, at the wheel's new spin, and its reaction on a body below."""
    v = model.vehicles[i]
    wheel = model.wheels[4 * i + w]
    row = 4 * i + w
    contact = scratch.wheel_contacts[w]
    spin = state.wheel_angular_velocity[row]
    load, v_long, v_lat = contact["load"], contact["longitudinal_velocity"], contact["lateral_velocity"]
    ratio, slip_speed = _slip(wheel, spin, v_long, is_braking or wheel["is_driven"])
    state.wheel_slip_ratio[row], state.wheel_slip_angle[row] = ratio, contact["slip_angle"]
    if contact["is_airborne"]:
        state.wheel_force[row, 0] = state.wheel_force[row, 1] = 0.0
        state.wheel_hold[row, 0] = state.wheel_hold[row, 1] = 0.0
        return
    slow = wheel["hold_speed"]
    if is_braking and spin == 0.0 and v_long * v_long + v_lat * v_lat < slow * slow:
        fx, fy = _holding_force(row, wheel, state, v_long, v_lat, load, model.dt)
    else:
        state.wheel_hold[row, 0] = state.wheel_hold[row, 1] = 0.0
        fx, fy = _tyre_force(wheel, ratio, contact["slip_angle"], load)
        fx = relaxed(state.wheel_force[row, 0], fx, slip_speed, wheel["effective_mass"], model.dt)
        fy = relaxed(state.wheel_force[row, 1], fy, v_lat, wheel["effective_mass"], model.dt)
    state.wheel_force[row, 0], state.wheel_force[row, 1] = fx, fy
    longitudinal, lateral, normal = contact["longitudinal_axis"], contact["lateral_axis"], contact["normal"]
    x = fx * longitudinal[0] + fy * lateral[0] + load * normal[0]
    y = fx * longitudinal[1] + fy * lateral[1] + load * normal[1]
    z = fx * longitudinal[2] + fy * lateral[2] + load * normal[2]
    arm, point = contact["lever_arm"], contact["point"]
    apply_force(scratch.applied, rotation, v["dof"], arm[0], arm[1], arm[2], x, y, z)
    shape = int(contact["shape"])
    if shape >= 0 and model.shapes.dof[shape] >= 0:
        q = model.shapes.qpos[shape]
        apply_force(
            scratch.applied,
            rotation_at(state.qpos, q + 3),
            model.shapes.dof[shape],
            point[0] - state.qpos[q],
            point[1] - state.qpos[q + 1],
            point[2] - state.qpos[q + 2],
            -x,
            -y,
            -z,
        )


@inlined
def _holding_force(
    row: int, wheel: Any, state: State, v_long: float, v_lat: float, load: float, dt: float
) -> tuple[float, float]:
    """Force on a locked wheel at rest: a damped spring from where it stopped, up to the friction limit; then it slips.

    PhysX uses a velocity constraint ("sticky tyre"), with which a car on a slope creeps.
    """
    k, c = wheel["hold_stiffness"], wheel["hold_damping"]
    x = state.wheel_hold[row, 0] + v_long * dt
    y = state.wheel_hold[row, 1] + v_lat * dt
    fx, fy = -k * x - c * v_long, -k * y - c * v_lat
    ux, uy = fx / (load * wheel["forward"][1] + 1e-12), fy / (load * wheel["sideways"][1] + 1e-12)
    excess = sqrt(ux * ux + uy * uy)
    if excess > 1.0:
        fx, fy = fx / excess, fy / excess
        x, y = (-fx - c * v_long) / k, (-fy - c * v_lat) / k
    state.wheel_hold[row, 0], state.wheel_hold[row, 1] = x, y
    return fx, fy


@inlined
def _apply_drag(v: Any, rotation: Rotation, turn: Vector, state: State, applied: Floats) -> None:
    """Drag as in Unity: the body loses a share of its velocity and of its angular velocity in each second."""
    dof = v["dof"]
    c = v["center_of_mass"]
    x, y, z = rotated(rotation, c[0], c[1], c[2])
    wx, wy, wz = turn
    vx = state.qvel[dof] + wy * z - wz * y
    vy = state.qvel[dof + 1] + wz * x - wx * z
    vz = state.qvel[dof + 2] + wx * y - wy * x
    drag = -v["drag"] * v["mass"]
    apply_force(applied, rotation, dof, x, y, z, drag * vx, drag * vy, drag * vz)
    for axis in range(3):
        applied[dof + 3 + axis] -= v["angular_drag"] * v["inertia"][axis] * state.qvel[dof + 3 + axis]
