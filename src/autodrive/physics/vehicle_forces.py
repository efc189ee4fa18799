"""Forces on one vehicle in a substep: drive, brakes, tyres and air; also advances the spin of its wheels."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from autodrive.base.arrays import Floats
from autodrive.base.elementary import atan
from autodrive.base.jit import inlined
from autodrive.base.transforms import Rotation, Vector
from autodrive.physics.buffers import Scratch
from autodrive.physics.formulas import (
    ackermann_angle,
    bounded_slip,
    braked_spin,
    coasting_spin,
    cornering_stiffness,
    drive_target,
    drive_torque_limit,
    interpolated,
    lagged_slip,
    magic_stiffness,
    motor_torque,
    not_zero,
    peak_friction,
    relaxed,
    secant_stiffness,
    shaft_spin,
    slip_angle,
    slip_ratio_denominator,
    transferred_torque,
    tyre_force,
)
from autodrive.physics.free_body import angular_velocity, apply_force, rotated, rotation_at
from autodrive.physics.model import Model
from autodrive.physics.state import State
from autodrive.physics.wheel_contact import find_contact

AT_REST = 1.0
"""Transport speed [m/s] below which a tyre of the magic formula is damped: its relaxation alone is not, at rest."""


@inlined
def steer_wheels(i: int, model: Model, state: State) -> None:
    """Sets the angles of the wheels of vehicle i from that of its steering actuator."""
    for w in range(4):
        wheel, angle = model.wheels[4 * i + w], 0.0
        if wheel["is_steered"]:
            angle = ackermann_angle(state.steering_angle[i], model.vehicles[i]["wheelbase"], wheel["hub"][1])
        state.wheel_steering_angle[4 * i + w] = angle


@inlined
def apply_forces(i: int, rotation: Rotation, model: Model, state: State, scratch: Scratch) -> None:
    """Adds the forces of ground and air on vehicle i, and their reactions on the bodies below its wheels, to `scratch`.

    `rotation` is that of the vehicle. Sets spin, rotation, slip and force of its wheels in the state.
    """
    v = model.vehicles[i]
    dt = model.dt
    turn = angular_velocity(state, rotation, v["dof"])
    is_braking = state.throttle[i] == 0.0 and not v["drive_coasts"]
    is_off = is_braking or (state.throttle[i] == 0.0 and v["drive_is_speed_controlled"])
    # 1. The contact of each wheel, and the spin that it would have without drive and brake. Its tyre force is taken as
    # linear in the spin, so that the spin is the solution of an implicit step; `gain` is the spin per torque.
    driven, sum_coasting, sum_gain = 0, 0.0, 0.0
    for w in range(4):
        wheel = model.wheels[4 * i + w]
        row = 4 * i + w
        find_contact(i, w, state.wheel_steering_angle[row], rotation, turn, model, state, scratch)
        contact = scratch.wheel_contacts[w]
        v_long = contact["longitudinal_velocity"]
        spin = state.wheel_angular_velocity[row]
        ratio, slip_speed = _slip(wheel, spin, v_long, (is_braking and wheel["is_braked"]) or wheel["is_driven"])
        contact["lateral_velocity"] = not_zero(contact["lateral_velocity"])
        angle_of_slip = slip_angle(contact["lateral_velocity"], v_long, wheel["slip_angle_offset"])
        if wheel["is_magic"]:
            tread, v_lat = wheel["radius"] * spin, contact["lateral_velocity"]
            fx, _, stiffness, _, _ = _magic_force(row, wheel, state, tread, v_long, v_lat, contact["load"], dt)
        else:
            fx, _ = _tyre_force(wheel, ratio, angle_of_slip, contact["load"])
            stiffness = secant_stiffness(fx, slip_speed)
        coasting, gain = coasting_spin(
            spin, fx, stiffness, wheel["radius"], wheel["inertia"], wheel["damping_rate"], dt
        )
        contact["slip_angle"], contact["coasting_spin"], contact["spin_gain"] = angle_of_slip, coasting, gain
        if wheel["is_driven"]:
            driven += 1
            sum_coasting += coasting
            sum_gain += gain
    # 2. The torque of the motor, which the differentials share out; without them all driven wheels get the same.
    torque = 0.0
    if v["has_differentials"]:
        _turn_shafts(i, is_off, model, state, scratch)
    elif not is_off:
        torque = _motor_torque(v, state.drive_level[i], sum_coasting / driven, sum_gain / driven)
    _apply_drag(v, rotation, turn, state, scratch.applied)
    # 3. The new spin of each wheel, with drive, brake and rolling resistance, and the force at that spin.
    for w in range(4):
        wheel = model.wheels[4 * i + w]
        row = 4 * i + w
        contact = scratch.wheel_contacts[w]
        spin = contact["coasting_spin"]
        if wheel["is_driven"]:
            spin += contact["spin_gain"] * torque
        if is_braking and wheel["is_braked"]:
            spin = braked_spin(spin, v["brake_torque"], contact["spin_gain"])
        coefficient = wheel["rolling_resistance"]
        if wheel["steering_resistance"] > 0.0:
            coefficient += wheel["steering_resistance"] * abs(state.wheel_steering_angle[row])
        if coefficient > 0.0:
            spin = braked_spin(spin, coefficient * contact["load"] * wheel["radius"], contact["spin_gain"])
        state.wheel_angular_velocity[row] = spin
        state.wheel_rotation[row] += spin * dt
        _apply_wheel_force(i, w, is_braking and wheel["is_braked"], rotation, model, state, scratch)


@inlined
def _motor_torque(v: Any, level: float, coasting: float, gain: float) -> float:
    """Torque at each driven wheel [N m] at that drive level; `coasting` and `gain`: means of the driven wheels."""
    share = abs(level)
    if v["throttle_curve_points"] > 0:
        share = interpolated(
            v["throttle_curve_points"], v["throttle_curve_throttle"], v["throttle_curve_share"], abs(level)
        )
    limit = drive_torque_limit(share, v["drive_is_speed_controlled"], v["drive_torque_limit"])
    servo_gain = v["drive_servo_gain"]
    if v["drive_is_voltage_controlled"]:
        # T = limit (1 - spin / speed_limit) at the spin after the step: as a servo without a limit of its torque
        servo_gain, limit = limit / v["drive_speed_limit"], inf
    elif v["torque_curve_points"] > 0 and coasting * level > 0.0:
        limit *= interpolated(v["torque_curve_points"], v["torque_curve_speed"], v["torque_curve_share"], abs(coasting))
    target = drive_target(
        level,
        v["drive_is_speed_controlled"],
        v["drive_speed_limit"],
        v["drive_speed_gain"],
        v["drive_speed_offset"],
    )
    return motor_torque(coasting, gain, target, servo_gain, limit)


@inlined
def _turn_shafts(i: int, is_off: bool, model: Model, state: State, scratch: Scratch) -> None:
    """Adds what motor and differentials do to the coasting spins of vehicle i; `is_off`: the motor has no torque."""
    v = model.vehicles[i]
    wheels = scratch.wheel_contacts
    front_lock, centre_lock, rear_lock = v["front_differential"], v["centre_differential"], v["rear_differential"]
    front, front_gain = shaft_spin(
        wheels[0]["coasting_spin"],
        wheels[0]["spin_gain"],
        wheels[1]["coasting_spin"],
        wheels[1]["spin_gain"],
        front_lock[0] + front_lock[1] > 0.0,
    )
    rear, rear_gain = shaft_spin(
        wheels[2]["coasting_spin"],
        wheels[2]["spin_gain"],
        wheels[3]["coasting_spin"],
        wheels[3]["spin_gain"],
        rear_lock[0] + rear_lock[1] > 0.0,
    )
    has_front, has_rear = model.wheels[4 * i]["is_driven"], model.wheels[4 * i + 2]["is_driven"]
    both, both_gain = front, front_gain
    if has_front and has_rear:
        both, both_gain = shaft_spin(front, front_gain, rear, rear_gain, centre_lock[0] + centre_lock[1] > 0.0)
    elif has_rear:
        both, both_gain = rear, rear_gain
    torque, between = 0.0, 0.0
    if not is_off:
        torque = _motor_torque(v, state.drive_level[i], both, both_gain)
    if has_front and has_rear:
        limit = centre_lock[0] + centre_lock[1] * abs(torque)
        between = transferred_torque(front, front_gain, rear, rear_gain, torque, limit)
    if has_front:
        _turn_axle(scratch, 0, torque - between, front_lock[0], front_lock[1])
    if has_rear:
        _turn_axle(scratch, 2, torque + between, rear_lock[0], rear_lock[1])


@inlined
def _turn_axle(scratch: Scratch, first: int, torque: float, constant: float, bias: float) -> None:
    """Adds the torque of a driven axle [N m per wheel] to the spins of its wheels `first` and `first` + 1."""
    left, right = scratch.wheel_contacts[first], scratch.wheel_contacts[first + 1]
    between = transferred_torque(
        left["coasting_spin"],
        left["spin_gain"],
        right["coasting_spin"],
        right["spin_gain"],
        torque,
        constant + bias * abs(torque),
    )
    left["coasting_spin"] += left["spin_gain"] * (torque - between)
    right["coasting_spin"] += right["spin_gain"] * (torque + between)


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
def _magic_force(
    row: int, wheel: Any, state: State, tread: float, v_long: float, v_lat: float, load: float, dt: float
) -> tuple[float, float, float, float, float]:
    """Force by the magic formula [N], its longitudinal stiffness [N s/m], and the lagged slips after `dt`.

    Longitudinal, then lateral; `tread` is the speed of the tread [m/s]. Does not write to the state.
    """
    lags, lengths, peaks, damping = (
        state.wheel_lagged_slip[row],
        wheel["relaxation_length"],
        wheel["peak_slip"],
        wheel["slip_damping"],
    )
    forward, sideways, nominal = wheel["magic_forward"], wheel["magic_sideways"], wheel["nominal_load"]
    slip_speed = tread - v_long
    transport = max(abs(v_long), abs(tread))
    offset = wheel["active_slip_offset"]
    ratio = lagged_slip(lags[0], slip_speed, transport, lengths[0], dt)
    ratio = bounded_slip(ratio, slip_speed, transport, offset, peaks[0])
    aside = lagged_slip(lags[1], v_lat, transport, lengths[1], dt)
    aside = bounded_slip(aside, v_lat, transport, offset, peaks[1])
    fade = max(0.0, 1.0 - transport / AT_REST)
    damped_ratio = ratio + damping[0] * fade * slip_speed
    damped_aside = aside + damping[1] * fade * v_lat
    kx, ky = magic_stiffness(
        damped_ratio,
        damped_aside,
        load,
        peak_friction(forward[0], load, nominal, forward[4]),
        forward[1],
        forward[2],
        forward[3],
        peak_friction(sideways[0], load, nominal, sideways[4]),
        cornering_stiffness(sideways[1], load, nominal, wheel["stiffness_degression"]),
        sideways[2],
        sideways[3],
    )
    stiffness = kx * (dt / (lengths[0] + dt * transport) + damping[0] * fade)
    return kx * damped_ratio, -ky * damped_aside, stiffness, ratio, aside


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
        state.wheel_lagged_slip[row, 0] = state.wheel_lagged_slip[row, 1] = 0.0
        state.wheel_hold[row, 0] = state.wheel_hold[row, 1] = 0.0
        return
    # The force in the contact plane: a braked wheel that stands holds like a spring; otherwise the tyre slips.
    slow = wheel["hold_speed"]
    if is_braking and spin == 0.0 and v_long * v_long + v_lat * v_lat < slow * slow:
        fx, fy = _holding_force(row, wheel, state, v_long, v_lat, load, model.dt)
        state.wheel_lagged_slip[row, 0] = state.wheel_lagged_slip[row, 1] = 0.0
    elif wheel["is_magic"]:
        tread = wheel["radius"] * spin
        fx, fy, _, lagged_ratio, lagged_aside = _magic_force(row, wheel, state, tread, v_long, v_lat, load, model.dt)
        state.wheel_hold[row, 0] = state.wheel_hold[row, 1] = 0.0
        state.wheel_lagged_slip[row, 0], state.wheel_lagged_slip[row, 1] = lagged_ratio, lagged_aside
        state.wheel_slip_ratio[row], state.wheel_slip_angle[row] = lagged_ratio, atan(lagged_aside)
    else:
        state.wheel_hold[row, 0] = state.wheel_hold[row, 1] = 0.0
        fx, fy = _tyre_force(wheel, ratio, contact["slip_angle"], load)
        fx = relaxed(state.wheel_force[row, 0], fx, slip_speed, wheel["effective_mass"], model.dt)
        fy = relaxed(state.wheel_force[row, 1], fy, v_lat, wheel["effective_mass"], model.dt)
    # This force and the load, in map axes, act on the vehicle, and the opposite ones on a body below.
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
    """Drag as in Unity: the body loses a share of its velocity and of its angular velocity in each second.

    And the resistance of the air, with the square of the speed.
    """
    dof = v["dof"]
    c = v["center_of_mass"]
    x, y, z = rotated(rotation, c[0], c[1], c[2])
    wx, wy, wz = turn
    vx = state.qvel[dof] + wy * z - wz * y
    vy = state.qvel[dof + 1] + wz * x - wx * z
    vz = state.qvel[dof + 2] + wx * y - wy * x
    drag = -v["drag"] * v["mass"]
    if v["air_drag"] > 0.0:
        drag -= v["air_drag"] * sqrt(vx * vx + vy * vy + vz * vz)
    apply_force(applied, rotation, dof, x, y, z, drag * vx, drag * vy, drag * vz)
    for axis in range(3):
        applied[dof + 3 + axis] -= v["angular_drag"] * v["inertia"][axis] * state.qvel[dof + 3 + axis]
