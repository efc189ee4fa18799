"""The wheel: slip -> friction curve -> force, suspension and spin, after Unity's WheelCollider.

Plain scalar Python: scalars in, scalars out, so that Numba (and later Warp, on a GPU) compile this very source.
Unity's WheelCollider is NVIDIA's PhysX 4.1 `PxVehicleNoDrive`; "PhysX" below means its published source,
`physxvehicle/src/PxVehicleUpdate.cpp`. What Unity does not publish is a named parameter of `WheelSpec`.
"""

from math import atan, sqrt, tan

Real = float
"""The kind of number; a compiler for the GPU binds it to its own."""


def friction_coefficient(
    slip: Real,
    extremum_slip: Real,
    extremum_value: Real,
    asymptote_slip: Real,
    asymptote_value: Real,
    initial_slope: Real,
) -> Real:
    """Force divided by load at that slip (>= 0): Unity's WheelFrictionCurve.

    Two cubic pieces, (0, 0) to (extremum) to (asymptote), with zero slope at both; constant after. Unity does not
    publish the slope at 0; `initial_slope` is that slope in units of extremum_value / extremum_slip.
    """
    coefficient = asymptote_value
    if slip < extremum_slip:
        t = slip / extremum_slip
        rest = Real(1.0) - t
        coefficient = extremum_value * (t * t * (Real(3.0) - Real(2.0) * t) + initial_slope * t * rest * rest)
    elif slip < asymptote_slip:
        t = (slip - extremum_slip) / (asymptote_slip - extremum_slip)
        coefficient = extremum_value + (asymptote_value - extremum_value) * t * t * (Real(3.0) - Real(2.0) * t)
    return coefficient


def suspension_force(
    compression: Real,
    compression_speed: Real,
    static_load: Real,
    stiffness: Real,
    damping: Real,
    compression_max: Real,
    bump_stiffness: Real,
    look_ahead: Real,
) -> Real:
    """Force of the suspension [N] along its axis, never negative.

    The static load is carried at compression 0, whatever the stiffness (PhysX). Beyond `compression_max` [m] a stop
    of `bump_stiffness` [N/m] takes over, where PhysX has a hard limit. The spring is read where it will be in
    `look_ahead` [s], the mean place in PhysX's substeps of a wheel within one step of the body; it damps like
    stiffness * look_ahead, which is all that holds a car without dampers still.
    """
    travel = min(compression + look_ahead * compression_speed, compression_max)
    spring = max(Real(0.0), static_load + stiffness * travel)
    stop = bump_stiffness * max(Real(0.0), compression - compression_max)
    return max(Real(0.0), spring + damping * compression_speed + stop)


def slip_ratio_denominator(
    longitudinal_velocity: Real,
    tread_speed: Real,
    is_active: bool,
    active_offset: Real,
    passive_minimum: Real,
) -> Real:
    """What PhysX divides the slip speed by [m/s]; a driven or braked wheel is `is_active`. Never zero."""
    speed = max(abs(longitudinal_velocity), abs(tread_speed))
    return speed + active_offset if is_active else max(passive_minimum, speed)


def slip_angle(lateral_velocity: Real, longitudinal_velocity: Real, lateral_offset: Real) -> Real:
    """Slip angle [rad], positive when the wheel moves to its left; the offset [m/s] keeps it regular at rest."""
    return atan(lateral_velocity / (abs(longitudinal_velocity) + lateral_offset))


def tyre_force(
    ratio: Real,
    angle: Real,
    load: Real,
    forward_extremum_slip: Real,
    forward_extremum_value: Real,
    forward_asymptote_slip: Real,
    forward_asymptote_value: Real,
    forward_initial_slope: Real,
    sideways_extremum_slip: Real,
    sideways_extremum_value: Real,
    sideways_asymptote_slip: Real,
    sideways_asymptote_value: Real,
    sideways_initial_slope: Real,
) -> tuple[Real, Real]:
    """Longitudinal and lateral force [N] for a slip ratio and a slip angle [rad].

    Combined slip by the similarity method (Pacejka, Tyre and Vehicle Dynamics, section 4.3.1, with the
    extremum slips as the reference): each curve is read at the length of the normalised slip vector, and the force
    has its direction. Values already contain the curve's stiffness factor.
    """
    nx = ratio / forward_extremum_slip
    ny = angle / sideways_extremum_slip
    length = sqrt(nx * nx + ny * ny + Real(1.0e-18))
    fx = friction_coefficient(
        length * forward_extremum_slip,
        forward_extremum_slip,
        forward_extremum_value,
        forward_asymptote_slip,
        forward_asymptote_value,
        forward_initial_slope,
    )
    fy = friction_coefficient(
        length * sideways_extremum_slip,
        sideways_extremum_slip,
        sideways_extremum_value,
        sideways_asymptote_slip,
        sideways_asymptote_value,
        sideways_initial_slope,
    )
    return load * fx * nx / length, -load * fy * ny / length


def coasting_spin(
    angular_velocity: Real,
    longitudinal_force: Real,
    slip_speed: Real,
    radius: Real,
    inertia: Real,
    damping_rate: Real,
    dt: Real,
) -> tuple[Real, Real]:
    """Spin after `dt` without drive and brake [rad/s], and how much a torque adds to it [rad/s per N m].

    Linearly implicit in damping and tyre: the secant stiffness of the tyre, force / slip speed, counts at the end
    of the step. An explicit step (PhysX) would need far shorter ones: 2.352 N m on 1.8e-5 kg m^2 is 131 rad/s in 1 ms.
    """
    stiffness = longitudinal_force / slip_speed if slip_speed != Real(0.0) else Real(0.0)
    gain = dt / (inertia + dt * (damping_rate + max(Real(0.0), stiffness) * radius * radius))
    return angular_velocity - gain * (damping_rate * angular_velocity + radius * longitudinal_force), gain


def motor_torque(
    coasting_left: Real,
    coasting_right: Real,
    gain_left: Real,
    gain_right: Real,
    target: Real,
    servo_gain: Real,
    torque_max: Real,
) -> Real:
    """Torque [N m] that each of two speed-controlled motors gives, at most `torque_max`.

    A servo of `servo_gain` [N m s/rad] holds the mean speed of the two wheels at `target` [rad/s], at the end of the
    step (implicit, so never bang-bang); equal torques leave left and right free to differ in turns.
    """
    mean = Real(0.5) * (coasting_left + coasting_right)
    mean_gain = Real(0.5) * (gain_left + gain_right)
    torque = servo_gain * (target - mean) / (Real(1.0) + servo_gain * mean_gain)
    return max(-torque_max, min(torque_max, torque))


def braked_spin(angular_velocity: Real, brake_torque: Real, gain: Real) -> Real:
    """Spin after the brake's torque, which stops the wheel dead but never turns it backwards (PhysX)."""
    change = gain * brake_torque
    if angular_velocity > change:
        return angular_velocity - change
    if angular_velocity < -change:
        return angular_velocity + change
    return angular_velocity * Real(0.0)


def relaxed(previous_force: Real, force: Real, slip_velocity: Real, effective_mass: Real, dt: Real) -> Real:
    """The force as the chassis feels it [N]: relaxed so that a stiff tyre cannot overshoot within one step.

    Linearly implicit in the velocity, with the other forces taken as balancing the previous one: exact in steady
    state, and without effect where dt * stiffness is small beside `effective_mass` [kg].
    """
    stiffness = abs(force / slip_velocity) if slip_velocity != Real(0.0) else Real(0.0)
    return previous_force + (force - previous_force) / (Real(1.0) + stiffness * dt / effective_mass)


def ackermann_angle(steering_angle: Real, wheelbase: Real, left_of_centre: Real) -> Real:
    """Angle [rad] of a front wheel `left_of_centre` [m] of the axle's middle (Rajamani (2.5), (2.6), for any angle)."""
    t = tan(steering_angle)
    return atan(wheelbase * t / (wheelbase - left_of_centre * t))
