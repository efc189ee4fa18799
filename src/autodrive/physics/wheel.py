"""Formulas of the wheel, after Unity's WheelCollider, and the magic formula as a second law of the tyre force.

Plain Python functions of scalars, which Numba compiles. Unity's WheelCollider is NVIDIA's PhysX 4.1
`PxVehicleNoDrive`; "PhysX" below means its published source, `physxvehicle/src/PxVehicleUpdate.cpp`. Values that Unity
does not publish are parameters of `WheelSpec`.
"""

from math import sqrt

from autodrive.base.elementary import atan, sin


def friction_coefficient(
    slip: float,
    extremum_slip: float,
    extremum_value: float,
    asymptote_slip: float,
    asymptote_value: float,
    initial_slope: float,
) -> float:
    """Force divided by load at a slip >= 0, as Unity's WheelFrictionCurve.

    Two cubic pieces, from (0, 0) to the extremum and on to the asymptote, with zero slope at both; constant beyond.
    Unity does not publish the slope at 0; `initial_slope` is that slope in units of extremum_value / extremum_slip.
    """
    coefficient = asymptote_value
    if slip < extremum_slip:
        t = slip / extremum_slip
        rest = 1.0 - t
        coefficient = extremum_value * (t * t * (3.0 - 2.0 * t) + initial_slope * t * rest * rest)
    elif slip < asymptote_slip:
        t = (slip - extremum_slip) / (asymptote_slip - extremum_slip)
        coefficient = extremum_value + (asymptote_value - extremum_value) * t * t * (3.0 - 2.0 * t)
    return coefficient


def suspension_force(
    compression: float,
    compression_speed: float,
    static_load: float,
    stiffness: float,
    damping: float,
    compression_max: float,
    bump_stiffness: float,
    look_ahead: float,
) -> float:
    """Force of the suspension [N] along its axis, never negative.

    At compression 0 the force is the static load for any stiffness (PhysX). Beyond `compression_max` [m] a stop with
    `bump_stiffness` [N/m] replaces the hard limit of PhysX. The compression is extrapolated by `look_ahead` [s], the
    mean time of PhysX's substeps of a wheel within one step of the body. This has the effect of a damper with the
    constant stiffness * look_ahead, the only damping of a car without dampers.
    """
    travel = min(compression + look_ahead * compression_speed, compression_max)
    spring = max(0.0, static_load + stiffness * travel)
    stop = bump_stiffness * max(0.0, compression - compression_max)
    return max(0.0, spring + damping * compression_speed + stop)


def not_zero(speed: float) -> float:
    """The speed [m/s], or 1e-30 m/s instead of 0: the stiffness of a tyre, force / slip speed, then has its limit.

    Otherwise a rounding error of the speed would decide whether a tyre at rest is stiff.
    """
    return speed if speed != 0.0 else 1.0e-30


def slip_ratio_denominator(
    longitudinal_velocity: float,
    tread_speed: float,
    is_active: bool,
    active_offset: float,
    passive_minimum: float,
) -> float:
    """Divisor of the slip speed in PhysX [m/s], never zero. `is_active`: the wheel is driven or braked."""
    speed = max(abs(longitudinal_velocity), abs(tread_speed))
    return speed + active_offset if is_active else max(passive_minimum, speed)


def slip_angle(lateral_velocity: float, longitudinal_velocity: float, lateral_offset: float) -> float:
    """Slip angle [rad], positive if the wheel moves to its left; the offset [m/s] avoids a division by zero."""
    return atan(lateral_velocity / (abs(longitudinal_velocity) + lateral_offset))


def tyre_force(
    ratio: float,
    angle: float,
    load: float,
    forward_extremum_slip: float,
    forward_extremum_value: float,
    forward_asymptote_slip: float,
    forward_asymptote_value: float,
    forward_initial_slope: float,
    sideways_extremum_slip: float,
    sideways_extremum_value: float,
    sideways_asymptote_slip: float,
    sideways_asymptote_value: float,
    sideways_initial_slope: float,
) -> tuple[float, float]:
    """Longitudinal and lateral force [N] for a slip ratio and a slip angle [rad].

    Combined slip by the similarity method (Pacejka, Tyre and Vehicle Dynamics, section 4.3.1) with the extremum slips
    as reference: each curve is evaluated at the length of the normalised slip vector, whose direction the force has.
    The values include the stiffness factor of the curve.
    """
    nx = ratio / forward_extremum_slip
    ny = angle / sideways_extremum_slip
    length = sqrt(nx * nx + ny * ny + 1.0e-18)
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


def magic_shape(slip: float, shape: float, curvature: float) -> float:
    """Force as a share of its peak at a normalised slip, which is slip times stiffness divided by peak force.

    The magic formula (Pacejka, Tyre and Vehicle Dynamics (4.6)) with B = stiffness / (shape * peak), without shifts.
    """
    x = slip / shape
    return sin(shape * atan(x - curvature * (x - atan(x))))


def peak_friction(friction: float, load: float, nominal_load: float, load_sensitivity: float) -> float:
    """Peak force divided by load; it falls linearly with the load (Pacejka (4.E23)), to a tenth at least."""
    return friction * max(0.1, 1.0 - load_sensitivity * (load / nominal_load - 1.0))


def cornering_stiffness(stiffness: float, load: float, nominal_load: float, degression: float) -> float:
    """Lateral force per slip and load [1/rad]; `stiffness` at the nominal load, `degression` 1 / p_Ky2^2.

    Pacejka (4.E25), K = p_Ky1 F_z0 sin(2 atan(F_z / (p_Ky2 F_z0))), where sin(2 atan x) = 2 x / (1 + x^2).
    """
    share = load / nominal_load
    return stiffness * (1.0 + degression) / (1.0 + degression * share * share)


def magic_stiffness(
    ratio: float,
    lateral_slip: float,
    load: float,
    forward_friction: float,
    forward_stiffness: float,
    forward_shape: float,
    forward_curvature: float,
    sideways_friction: float,
    sideways_stiffness: float,
    sideways_shape: float,
    sideways_curvature: float,
) -> tuple[float, float]:
    """Longitudinal and lateral force per slip [N] at that slip; peaks and stiffnesses are per load.

    Combined slip by the similarity method (Pacejka, section 4.3.1): each curve is evaluated at the length of the
    normalised slip vector. `lateral_slip` is the tangent of the slip angle.
    """
    nx = ratio * forward_stiffness / forward_friction
    ny = lateral_slip * sideways_stiffness / sideways_friction
    length = sqrt(nx * nx + ny * ny + 1.0e-18)
    along = magic_shape(length, forward_shape, forward_curvature) / length
    aside = magic_shape(length, sideways_shape, sideways_curvature) / length
    return load * forward_stiffness * along, load * sideways_stiffness * aside


def lagged_slip(slip: float, slip_velocity: float, transport: float, relaxation_length: float, dt: float) -> float:
    """Slip after `dt` of a tyre that follows a change of slip over its relaxation length [m], implicit Euler.

    sigma ds/dt + |V| s = V_s with the transport speed |V| of the tread through the contact and the slip velocity V_s
    (Pacejka (7.9), (7.10)). At |V| = 0 the tyre is a spring, so that there is no division by zero.
    """
    return (relaxation_length * slip + dt * slip_velocity) / (relaxation_length + dt * transport)


def bounded_slip(slip: float, slip_velocity: float, transport: float, offset: float, peak: float) -> float:
    """A lagged slip of at most `peak`, where the tyre slides, or its steady value if that is greater.

    Otherwise a wheel that slides sideways would deform its tyre without limit. `offset` [m/s] as in `slip_angle`.
    """
    most = max(peak, abs(slip_velocity) / (transport + offset))
    return max(-most, min(most, slip))


def secant_stiffness(force: float, slip_speed: float) -> float:
    """Force per slip speed [N s/m], 0 at rest and never negative."""
    stiffness = force / slip_speed if slip_speed != 0.0 else 0.0
    return max(0.0, stiffness)


def coasting_spin(
    angular_velocity: float,
    longitudinal_force: float,
    stiffness: float,
    radius: float,
    inertia: float,
    damping_rate: float,
    dt: float,
) -> tuple[float, float]:
    """Spin after `dt` without drive and brake [rad/s], and its change per torque [rad/s per N m].

    Linearly implicit in damping and tyre, with the `stiffness` of the tyre (force / slip speed). An explicit step
    (PhysX) needs far shorter steps: a torque of 2.352 N m changes the spin of 1.8e-5 kg m^2 by 131 rad/s in 1 ms.
    """
    gain = dt / (inertia + dt * (damping_rate + stiffness * radius * radius))
    return angular_velocity - gain * (damping_rate * angular_velocity + radius * longitudinal_force), gain


def motor_torque(
    mean_coasting: float,
    mean_gain: float,
    target: float,
    servo_gain: float,
    torque_max: float,
) -> float:
    """Torque [N m] of each motor of a vehicle with one motor for each driven wheel, at most `torque_max`.

    `mean_coasting` [rad/s] and `mean_gain` [rad/s per N m] are the means of `coasting_spin` over the driven wheels. A
    servo of `servo_gain` [N m s/rad] brings the mean spin to `target` [rad/s] at the end of the step (implicit, so it
    does not oscillate). All torques are equal, so that the wheels can turn at different speeds in a curve.
    """
    torque = servo_gain * (target - mean_coasting) / (1.0 + servo_gain * mean_gain)
    return max(-torque_max, min(torque_max, torque))


def shaft_spin(
    coasting: float, gain: float, other_coasting: float, other_gain: float, is_coupled: bool
) -> tuple[float, float]:
    """`coasting_spin` of the input shaft of a differential, for a torque that is the mean of those of its two outputs.

    An open differential averages the spins; a coupled one (locked or limited slip) keeps both equal.
    """
    if is_coupled:
        total = gain + other_gain
        return (coasting * other_gain + other_coasting * gain) / total, 2.0 * gain * other_gain / total
    return 0.5 * (coasting + other_coasting), 0.5 * (gain + other_gain)


def transferred_torque(
    coasting: float, gain: float, other_coasting: float, other_gain: float, torque: float, limit: float
) -> float:
    """Torque [N m] that a differential takes from one output and gives to the other, at most `limit`.

    Without the limit both have the same spin at the end of the step. `torque` is what each gets from an open one.
    """
    needed = (coasting - other_coasting + (gain - other_gain) * torque) / (gain + other_gain)
    return max(-limit, min(limit, needed))


def braked_spin(angular_velocity: float, brake_torque: float, gain: float) -> float:
    """Spin after the torque of the brake, which can stop the wheel but not reverse it (PhysX)."""
    change = gain * brake_torque
    if angular_velocity > change:
        return angular_velocity - change
    if angular_velocity < -change:
        return angular_velocity + change
    return angular_velocity * 0.0


def relaxed(previous_force: float, force: float, slip_velocity: float, effective_mass: float, dt: float) -> float:
    """Force on the chassis [N], relaxed so that a stiff tyre does not overshoot within one step.

    Linearly implicit in the velocity; the other forces are assumed to balance the previous force. Exact in steady
    state, and without effect if dt * stiffness is much smaller than `effective_mass` [kg].
    """
    stiffness = abs(force / slip_velocity) if slip_velocity != 0.0 else 0.0
    return previous_force + (force - previous_force) / (1.0 + stiffness * dt / effective_mass)
