"""The Model's tables of vehicles and wheels, computed from the vehicles' Specs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.elementary import exp
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.base.units import RPM
from autodrive.physics.actuators.drivetrain import DrivetrainSpec
from autodrive.physics.engine import Engine, Geom
from autodrive.physics.model import BOX, COVER, CURVE_POINTS, VEHICLE, WHEEL, Table
from autodrive.physics.weather import SURFACES, Surface, road
from autodrive.protocol.messages import Weather
from autodrive.scenario.vehicles.spec import MagicFormulaSpec, VehicleSpec

if TYPE_CHECKING:
    from autodrive.scenario.maps.spec import GroundSpec

AIR_DENSITY = 1.2
"""Density of air at 20 degrees Celsius and sea level [kg/m^3]."""
HOLD_DAMPING_RATIO = 0.7
"""Damping of a locked wheel's holding spring, relative to critical damping."""


def vehicle_table(vehicles: Mapping[str, VehicleSpec], engine: Engine, geoms: Sequence[Geom], dt: float) -> Table:
    """`Model.vehicles` for a substep of `dt` [s]; each vehicle is a free body of the engine with its name."""
    table = np.zeros(len(vehicles), dtype=VEHICLE)
    for row, (name, spec) in zip(table, vehicles.items(), strict=True):
        row["body"], row["qpos"], row["dof"] = engine.body(name)
        _set_outline(row, spec, [geom for geom in geoms if geom.body == row["body"]])
        for field in ("center_of_mass", "drag", "angular_drag", "angular_velocity_max"):
            row[field] = getattr(spec.body, field)
        row["air_drag"] = 0.5 * AIR_DENSITY * spec.body.drag_area
        row["wheelbase"] = spec.wheelbase
        row["steering_limit"], row["command_limits"] = spec.steering.limit, spec.steering.command_limits
        row["steering_rate_limit"] = _rate(spec.steering.rate_limit)
        row["steering_unwinds_at_once"] = spec.steering.unwinds_at_once
        row["steering_response"] = _response(spec.steering.time_constant, dt)
        row["steering_delay"] = round(spec.steering.dead_time / dt)
        row["drive_response"] = _response(spec.drivetrain.time_constant, dt)
        row["drive_rate_limit"] = _rate(spec.drivetrain.rate_limit)
        row["drive_delay"] = round(spec.drivetrain.dead_time / dt)
        row["brake_torque"] = spec.drivetrain.brake_torque
        _set_motor(row, spec.drivetrain)
        set_factors(row, spec)
    return table


def set_factors(row: Table, spec: VehicleSpec) -> None:
    """Sets all columns of a vehicle that `VehicleSpec.with_factors` changes."""
    row["mass"], row["inertia"] = spec.body.mass, spec.body.inertia
    row["drive_torque_limit"] = spec.drivetrain.torque_limit
    knots = () if spec.steering.is_straight else spec.steering.knots
    _set_curve(row, "steering_curve", "servo", "angle", knots)


def _set_motor(row: Table, drivetrain: DrivetrainSpec) -> None:
    row["drive_is_speed_controlled"] = drivetrain.control == "speed"
    row["drive_is_voltage_controlled"] = drivetrain.control == "voltage"
    row["drive_coasts"], row["drive_has_reverse"] = drivetrain.coasts, drivetrain.has_reverse
    row["drive_speed_limit"] = drivetrain.speed_limit
    row["drive_speed_gain"], row["drive_speed_offset"] = drivetrain.speed_gain, drivetrain.speed_offset_rpm * RPM
    row["drive_servo_gain"] = drivetrain.servo_gain
    torque_curve = [(speed_rpm * RPM, share) for speed_rpm, share in drivetrain.torque_curve]
    _set_curve(row, "torque_curve", "speed", "share", torque_curve)
    _set_curve(row, "throttle_curve", "throttle", "share", drivetrain.throttle_curve)
    differentials = drivetrain.differentials
    for place in ("front", "centre", "rear"):
        row[f"{place}_differential"] = getattr(differentials, place).limits
    row["has_differentials"] = any(differential.kind != "open" for _, differential in differentials)


def _set_curve(row: Table, curve: str, position: str, value: str, points: Sequence[tuple[float, float]]) -> None:
    assert len(points) <= CURVE_POINTS
    row[f"{curve}_points"] = len(points)
    for k, (position_of_point, value_of_point) in enumerate(points):
        row[f"{curve}_{position}"][k], row[f"{curve}_{value}"][k] = position_of_point, value_of_point


def _set_outline(row: Table, spec: VehicleSpec, colliders: Sequence[Geom]) -> None:
    """The spheres around the colliders and the box around those that the floor stops."""
    boxes = np.array([_box_around(geom) for geom in colliders])
    *centre, row["sphere_radius"] = _sphere_around(boxes)
    row["sphere_centre"] = centre
    row["cover"] = cover(boxes)
    suspension = spec.wheels.suspension
    ray = spec.wheels.radius + suspension.compression_max + suspension.droop_max
    row["reach"] = max(row["sphere_radius"], *(math.dist(hub, centre) + ray for hub in spec.hubs))
    chassis = boxes[[geom.is_stopped_by_floor for geom in colliders]]
    row["chassis_low"], row["chassis_high"] = chassis[:, 0].min(axis=0), chassis[:, 1].max(axis=0)


def _box_around(geom: Geom) -> Floats:
    """Lowest and highest corner of a collider in the vehicle frame [m], shape (2, 3)."""
    size = geom.size if geom.kind == BOX else geom.size[[0, 0, 1]]
    rotation = np.abs(np.array(rotation_from_quaternion(geom.orientation)).reshape(3, 3))
    half = np.sum(rotation * size, axis=1)
    return np.array([geom.position - half, geom.position + half])


def cover(boxes: Floats) -> list[list[float]]:
    """Spheres, from rear to front, each around one of COVER slices of equal length of the boxes: centre and radius."""
    spheres = []
    for rear, front in pairwise(np.linspace(boxes[:, 0, 0].min(), boxes[:, 1, 0].max(), COVER + 1).tolist()):
        slices = boxes[(boxes[:, 0, 0] <= front) & (boxes[:, 1, 0] >= rear)]
        slices[:, :, 0] = slices[:, :, 0].clip(rear, front)
        spheres.append(_sphere_around(slices) if len(slices) else spheres[-1])  # the first slice has a box
    return spheres


def _sphere_around(boxes: Floats) -> list[float]:
    """Centre and radius [m] of a sphere around boxes: its centre is that of the box around them all."""
    centre = 0.5 * (boxes[:, 0].min(axis=0) + boxes[:, 1].max(axis=0))
    return [*centre.tolist(), max(_farthest(corners, centre) for corners in boxes)]


def _farthest(corners: Floats, centre: Floats) -> float:
    """Distance of the farthest point of a box from a point [m]."""
    return math.hypot(*np.maximum(np.abs(corners[0] - centre), np.abs(corners[1] - centre)).tolist())


def wheel_table(
    vehicles: Sequence[VehicleSpec], grips: Sequence[float], dt: float, ground: GroundSpec, weather: Weather
) -> Table:
    """`Model.wheels` for a substep of `dt` [s] on that ground in that weather.

    `grips`: factors of the friction values of each vehicle's wheels, besides those of the ground.
    """
    table = np.zeros(4 * len(vehicles), dtype=WHEEL)
    for i, (spec, factor) in enumerate(zip(vehicles, grips, strict=True)):
        rows = table[4 * i : 4 * i + 4]
        rows["hub"] = spec.hubs
        for axle, wheels in ((spec.axles.front, rows[:2]), (spec.axles.rear, rows[2:])):
            for field in ("is_steered", "is_driven", "is_braked"):
                wheels[field] = getattr(axle, field)
        _set_wheels(rows, spec)
        _set_suspension(rows, spec)
        set_conditions(rows, spec, factor, dt, ground, weather)
    return table


def set_conditions(
    rows: Table, spec: VehicleSpec, factor: float, dt: float, ground: GroundSpec, weather: Weather
) -> None:
    """Sets all columns of the wheels of a vehicle, shape (4,), that depend on its mass, the ground or the weather.

    `factor`: of the friction values, besides those of the ground and the weather.
    """
    state = road(surface_of(spec, ground), weather)
    grip = ground.grip * factor * state.grip
    rows["rolling_resistance"] = spec.wheels.rolling_resistance + state.resistance
    rows["sprung_mass"] = sprung_masses(spec)
    rows["effective_mass"] = effective_masses(spec)
    rows["hold_stiffness"], rows["hold_damping"] = hold_spring(spec, dt)
    wheel = spec.wheels
    if wheel.magic_formula is not None:
        _set_magic_formula(rows, spec, wheel.magic_formula, grip)
        return
    factors = (1.0, grip, 1.0, grip, 1.0)
    assert wheel.forward_friction is not None
    assert wheel.sideways_friction is not None
    rows["forward"] = np.multiply(wheel.forward_friction.numbers, factors)
    rows["sideways"] = np.multiply(wheel.sideways_friction.numbers, factors)


def surface_of(spec: VehicleSpec, ground: GroundSpec) -> Surface:
    """What water and snow do to the tyres of a vehicle."""
    own = spec.wheels.weather
    return SURFACES[ground.surface] if own is None else Surface(**own.model_dump())


def _set_wheels(rows: Table, spec: VehicleSpec) -> None:
    wheel = spec.wheels
    for field in ("radius", "damping_rate", "steering_resistance", "force_height"):
        rows[field] = getattr(wheel, field)
    for field in ("active_slip_offset", "passive_slip_minimum", "slip_angle_offset", "hold_speed"):
        rows[field] = getattr(wheel.regularisation, field)
    rows["inertia"] = 0.5 * wheel.mass * wheel.radius * wheel.radius


def _set_suspension(rows: Table, spec: VehicleSpec) -> None:
    suspension = spec.wheels.suspension
    for field in ("stiffness", "damping", "compression_max", "droop_max", "bump_stiffness", "look_ahead"):
        rows[field] = getattr(suspension, field)


def hold_spring(spec: VehicleSpec, dt: float) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] of the spring that holds a locked wheel at rest.

    A quarter of the mass on each spring; the frequency is limited to what a substep of `dt` [s] can follow.
    """
    frequency = 2.0 * math.pi * min(spec.wheels.regularisation.hold_frequency, 0.04 / dt)
    quarter = spec.body.mass / 4
    return quarter * frequency * frequency, 2.0 * HOLD_DAMPING_RATIO * quarter * frequency


def _set_magic_formula(rows: Table, spec: VehicleSpec, magic: MagicFormulaSpec, grip: float) -> None:
    rows["is_magic"] = True
    rows["nominal_load"] = magic.nominal_load
    rows["stiffness_degression"] = 0.0 if magic.peak_stiffness_load is None else magic.peak_stiffness_load**-2
    stiffness = np.repeat((magic.front_cornering_stiffness, magic.rear_cornering_stiffness), 2)
    rear = magic.sideways if magic.rear_sideways is None else magic.rear_sideways
    curves = [magic.sideways, magic.sideways, rear, rear]
    sides = (("forward", [magic.forward] * 4, np.full(4, magic.slip_stiffness)), ("sideways", curves, stiffness))
    for side, (name, curves_of_side, stiffnesses) in enumerate(sides):
        for row, curve, k in zip(rows, curves_of_side, stiffnesses.tolist(), strict=True):
            peak = grip * curve.friction
            row[name][1] = curve.greatest_share * peak
            row[f"magic_{name}"] = peak, k, curve.shape, curve.curvature, curve.load_sensitivity
            row["peak_slip"][side] = curve.normalised_peak_slip * peak / k
            length = magic.relaxation_length[side]
            row["relaxation_length"][side] = length
            # a quarter of the mass on the spring k F_z / length, critically damped
            row["slip_damping"][side] = 2.0 * math.sqrt(0.25 * spec.body.mass / (length * k * magic.nominal_load))


def _rate(limit: float | None) -> float:
    return math.inf if limit is None else limit


def _response(time_constant: float, dt: float) -> float:
    """Fraction of the difference to its target that a first-order lag covers in one step."""
    return 1.0 - exp(-dt / time_constant) if time_constant > 0.0 else 1.0


def sprung_masses(spec: VehicleSpec) -> Floats:
    """Mass on the spring of each wheel [kg], shape (4,).

    They sum to the mass M of the vehicle, balance about its centre of mass x, y, and differ as little as possible
    (PhysX, PxVehicleComputeSprungMasses): the least squares solution m = A^T (A A^T)^-1 b of A m = b, where A has a row
    of ones, a row of the hubs' x and one of their y, and b = M (1, x, y). With the hubs at 0 or the distance L of the
    axles and at +-T/2 of the track T, measured from their centre, the rows are perpendicular to each other, with the
    squares 4, L^2 and T^2. So m_i = M / 4 + (+-L/2) M (x - L/2) / L^2 + (+-T/2) M y / T^2, as below.
    """
    x, y, _ = spec.body.center_of_mass
    front, left = x / spec.hubs[0][0], y / spec.track
    shares = (front + left, front - left, 1.0 - front + left, 1.0 - front - left)
    return 0.5 * spec.body.mass * np.array(shares)


def effective_masses(spec: VehicleSpec) -> Floats:
    """Smallest effective mass for a horizontal force at each contact point [kg], shape (4,), for four wheels together.

    1 / (1/m + (r x d) . I^-1 (r x d)) for a unit force d at r from the centre of mass (Featherstone (2.74)).
    """
    ix, iy, iz = spec.body.inertia
    masses = []
    for hub in spec.hubs:
        x, y, z = (a - b for a, b in zip(hub, spec.body.center_of_mass, strict=True))
        z -= spec.wheels.radius
        # r x d is (0, z, -y) for d along x and (-z, 0, x) along y
        inverse = 1.0 / spec.body.mass + max(z * z / iy + y * y / iz, z * z / ix + x * x / iz)
        masses.append(0.25 / inverse)
    return np.array(masses)
