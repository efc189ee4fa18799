"""VehicleSpec: all parameters of a vehicle, the only source for dynamics, colliders, meshes and sensor mounts."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from autodrive.base.specs import Length, Offset, Rule, RuleError, Spec
from autodrive.base.transforms import Vector, quaternion_from_euler
from autodrive.physics.actuators.drivetrain import DrivetrainSpec
from autodrive.physics.actuators.lights import LightsSpec
from autodrive.physics.actuators.steering import SteeringSpec
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.physics.sensors.catalog import SensorSuiteSpec
from autodrive.physics.weather import SNOW_RESISTANCE
from autodrive.physics.wheel import magic_shape
from autodrive.protocol.devkit_profile import PROFILES

GRAVITY = 9.81
"""Gravity of a scenario that does not set it [m/s^2], with which vehicles are placed at rest."""
MAX_CAMERAS = 20
"""Most cameras of a vehicle."""

Inertia: TypeAlias = Annotated[float, Field(ge=1e-9, le=1e6)]
Relaxation: TypeAlias = Annotated[float, Field(ge=1e-4, le=10.0)]
Grip: TypeAlias = Annotated[float, Field(ge=0.01, le=10.0)]
At: TypeAlias = tuple[Offset, Offset, Offset]
Size: TypeAlias = tuple[Length, Length, Length]


class RigidBodySpec(Spec):
    """The chassis as a rigid body (report, table 9)."""

    mass: float = Field(ge=0.01, le=1e3)
    """Mass of the whole vehicle [kg]."""
    inertia: tuple[Inertia, Inertia, Inertia]
    """About the centre of mass, for the axes x, y, z of the vehicle [kg m^2]."""
    center_of_mass: At
    """Centre of mass in the vehicle frame [m]."""
    drag: float = Field(ge=0, le=1e3)
    """Share of the velocity that is lost per second, as Unity's Rigidbody.drag [1/s]."""
    drag_area: float = Field(default=0.0, ge=0, le=100)
    """Drag coefficient times frontal area, for the resistance of the air with the square of the speed [m^2]."""
    angular_drag: float = Field(ge=0, le=1e3)
    """Share of the angular velocity that is lost per second [1/s]."""
    angular_velocity_max: float = Field(ge=0.01, le=1e4)
    """Limit of the angular velocity [rad/s] (Unity's default: 7)."""
    friction: float = Field(ge=0, le=100)
    """Coulomb friction coefficient of the colliders; a contact has the mean of the coefficients of both sides."""

    @model_validator(mode="after")
    def _is_rigid(self) -> RigidBodySpec:
        if 2.0 * max(self.inertia) > sum(self.inertia):
            raise ValueError(
                f"inertia {self.inertia} is impossible: each value must be at most the sum of the other two"
            )
        return self


class ColliderSpec(Spec):
    """A box-shaped collider, aligned with the vehicle's axes."""

    position: At
    """Centre in the vehicle frame [m]."""
    size: Size
    """Full lengths along x, y, z [m]."""


class FrictionCurve(Spec):
    """Friction curve as Unity's WheelFrictionCurve: force divided by load over slip."""

    extremum_slip: float = Field(ge=1e-4, le=100)
    extremum_value: float = Field(ge=1e-4, le=100)
    asymptote_slip: float = Field(ge=1e-4, le=100)
    asymptote_value: float = Field(ge=0, le=100)
    stiffness: float = Field(ge=0, le=100)
    """Factor for both values."""
    initial_slope: float = Field(ge=0, le=3)
    """Slope at 0 in units of extremum_value / extremum_slip; 1.5: a natural spline, 3: the curve 1 - (1 - s)^3."""

    @model_validator(mode="after")
    def _check_order(self) -> FrictionCurve:
        if self.asymptote_slip <= self.extremum_slip:
            raise ValueError(
                f"asymptote_slip {self.asymptote_slip} must be greater than extremum_slip {self.extremum_slip}"
            )
        return self

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """Parameters of the wheel model: slips, values multiplied by the stiffness, initial slope."""
        k = self.stiffness
        return (
            self.extremum_slip,
            k * self.extremum_value,
            self.asymptote_slip,
            k * self.asymptote_value,
            self.initial_slope,
        )


class MagicCurve(Spec):
    """Peak and shape of the force over slip in one direction: D, C and E of the magic formula."""

    friction: float = Field(ge=1e-4, le=100)
    """Peak force divided by load, at the nominal load (Pacejka: p_D1)."""
    shape: float = Field(ge=0.3, le=2)
    """Shape factor C; 1: the force does not fall beyond its peak. Below 1 it rises at any slip, to sin(C pi / 2) of the
    peak that `friction` names."""
    curvature: float = Field(ge=-10, le=1)
    """Curvature factor E; smaller: a sharper peak."""
    load_sensitivity: float = Field(default=0.0, ge=0, le=1)
    """Relative loss of peak friction at twice the nominal load (-p_D2 / p_D1)."""

    @property
    def normalised_peak_slip(self) -> float:
        """Slip times stiffness divided by peak force where the force has its peak, at most 10."""
        return _normalised_peak_slip(self.shape, self.curvature)

    @property
    def greatest_share(self) -> float:
        """Greatest force as a share of D: the limit at any slip (Pacejka (4.6)) for shapes below 1."""
        if self.shape >= 1.0:
            return 1.0
        # the argument of the outer arc tangent is unbounded, but with E = 1 it approaches pi / 2
        return math.sin(self.shape * (0.5 * math.pi if self.curvature < 1.0 else math.atan(0.5 * math.pi)))


@lru_cache(maxsize=4096)  # a fit makes tables of many vehicles with the same curves
def _normalised_peak_slip(shape: float, curvature: float) -> float:
    slips = np.linspace(0.0, 10.0, 1001)[1:]
    forces = [magic_shape(slip, shape, curvature) for slip in slips.tolist()]
    return float(slips[int(np.argmax(forces))])


class MagicFormulaSpec(Spec):
    """Tyre force by the magic formula, with the influence of the load and relaxation lengths (Pacejka 2012)."""

    nominal_load: float = Field(ge=1e-3, le=1e6)
    """Load at which the values below hold [N]."""
    forward: MagicCurve
    sideways: MagicCurve
    rear_sideways: MagicCurve | None = None
    """The curve of the rear wheels; left out: as `sideways`."""
    slip_stiffness: float = Field(ge=1e-2, le=1e3)
    """Longitudinal force per slip ratio and load (p_Kx1)."""
    front_cornering_stiffness: float = Field(ge=1e-2, le=1e3)
    """Lateral force per slip angle and load of a front wheel [1/rad]."""
    rear_cornering_stiffness: float = Field(ge=1e-2, le=1e3)
    """Lateral force per slip angle and load of a rear wheel [1/rad]."""
    peak_stiffness_load: float | None = Field(default=None, ge=0.1, le=1e3)
    """Load with the greatest cornering force per slip, divided by the nominal load (p_Ky2); omitted: the cornering
    stiffness is proportional to the load."""
    relaxation_length: tuple[Relaxation, Relaxation]
    """Way that a wheel rolls until its force follows a change of slip, longitudinal and lateral [m]."""


class SuspensionSpec(Spec):
    """Spring and damper of each wheel (report, table 9)."""

    distance: float = Field(ge=1e-4, le=10)
    """Total travel [m]."""
    target_position: float = Field(ge=0, le=1)
    """Position of the static equilibrium in that travel, as in Unity: 0 fully compressed ... 1 fully extended."""
    stiffness: float = Field(ge=0.01, le=1e9)
    """[N/m]."""
    damping: float = Field(ge=0, le=1e7)
    """[N s/m]."""
    bump_stiffness: float = Field(ge=0.01, le=1e9)
    """Stiffness of the stop at full compression [N/m]."""
    look_ahead: float = Field(default=0.0, ge=0, le=0.01)
    """Time [s] by which the spring extrapolates the compression, which damps like stiffness x look_ahead [N s/m].

    PhysX divides a step dt of the body into n substeps of a wheel. They read the spring at 0, dt/n, 2 dt/n ..., after
    the mean time dt (n - 1) / (2 n).
    """

    @property
    def compression_max(self) -> float:
        """Largest compression from the target position [m]."""
        return (1.0 - self.target_position) * self.distance

    @property
    def droop_max(self) -> float:
        """Largest extension from the target position [m]."""
        return self.target_position * self.distance


class RegularisationSpec(Spec):
    """Parameters that keep the slip finite at low speed and hold a car at rest."""

    active_slip_offset: float = Field(ge=1e-6, le=1e3)
    """Added to the denominator of the slip ratio of a driven or braked wheel [m/s]."""
    passive_slip_minimum: float = Field(ge=1e-6, le=1e3)
    """Minimum of the denominator of the slip ratio of a free wheel [m/s]."""
    slip_angle_offset: float = Field(ge=1e-6, le=1e3)
    """Added to the denominator of the slip angle [m/s]."""
    hold_speed: float = Field(ge=0, le=1e3)
    """Below this speed a locked wheel is held in place by a spring, so that it does not creep [m/s]."""
    hold_frequency: float = Field(ge=0.01, le=60)
    """Natural frequency of the car on these springs [Hz]."""


class TyreWeatherSpec(Spec):
    """What water and snow do to the tyres, on any surface."""

    wet_grip: float = Field(ge=0.01, le=10.0)
    """Friction on a wet road relative to a dry one."""
    snow_grip: float = Field(ge=0.01, le=10.0)
    """Friction on snow relative to a dry road."""
    snow_resistance: float = Field(default=SNOW_RESISTANCE, ge=0.0, le=1.0)
    """Rolling resistance on snow per load, in addition to that on a dry road."""


class WheelSpec(Spec):
    """The four equal wheels (report, table 9); their tyres have two friction curves or the magic formula."""

    mass: float = Field(ge=1e-4, le=1e3)
    """[kg]. The moment of inertia is that of a solid disc, as in PhysX."""
    radius: Length
    """[m]."""
    width: Length
    """[m]."""
    collider_radius: Length | None = None
    """Radius of the cylinder that touches other things than the ground below the wheel [m]; left out: the radius less
    the travel of compression."""
    side_friction: float | None = Field(default=None, ge=0, le=100)
    """Coulomb friction coefficient of tyre and rim where they touch other things than the ground below them, such as a
    wall beside them; left out: that of the body."""
    damping_rate: float = Field(ge=0, le=1e4)
    """Resisting torque per spin [N m s/rad] (kg m^2/s in Unity)."""
    rolling_resistance: float = Field(default=0.0, ge=0, le=1)
    """Resisting force of a rolling wheel per load, at any speed and on any surface (Coulomb)."""
    steering_resistance: float = Field(default=0.0, ge=0, le=10)
    """Resisting force of a steered wheel that rolls, per load and angle, in addition [1/rad]."""
    force_height: Offset
    """Height of the point where the force acts above the base of the wheel (Unity: force app point distance) [m]."""
    suspension: SuspensionSpec
    forward_friction: FrictionCurve | None = None
    sideways_friction: FrictionCurve | None = None
    magic_formula: MagicFormulaSpec | None = None
    regularisation: RegularisationSpec
    surfaces: Annotated[dict[str, Grip], Field(max_length=20)] = Field(default_factory=dict)
    """Friction of these tyres on named floors, as a factor of the values of this file: {rubber: 1.0, tape: 0.43};
    `surface` of a vehicle in a scenario names the floor."""
    weather: TyreWeatherSpec | None = None
    """What water and snow do to the tyres; left out: as the surface of the map says."""

    @model_validator(mode="after")
    def _has_a_collider(self) -> WheelSpec:
        if self.collider_radius is not None and self.collider_radius > self.radius:
            raise ValueError(
                f"collider_radius {self.collider_radius:g} m must be at most the radius, {self.radius:g} m"
            )
        if self.suspension.compression_max > 0.99 * self.radius:
            raise ValueError(
                f"the suspension can be compressed by {self.suspension.compression_max:g} m; it must be less than 0.99 "
                f"times the radius of a wheel, {self.radius:g} m"
            )
        curves = (self.forward_friction is not None) + (self.sideways_friction is not None)
        if curves != (2 if self.magic_formula is None else 0):
            raise ValueError("a wheel has both forward_friction and sideways_friction, or magic_formula alone")
        return self


class AxleSpec(Spec):
    """Functions of the two wheels of an axle."""

    is_steered: bool
    """The wheels are turned by the steering actuator."""
    is_driven: bool
    """A motor drives each wheel."""
    is_braked: bool
    """A brake holds each wheel at zero throttle."""


class FrontAxleSpec(AxleSpec):
    """The front axle: steered and braked by default."""

    is_steered: bool = True
    is_driven: bool = False
    is_braked: bool = True
    x: Length | None = None
    """Distance of its wheel centres from those of the rear axle [m]; left out: the wheelbase, whose value always sets
    the angles of the steered wheels."""
    z: Offset = 0.0
    """Height of its wheel centres above those of the rear axle, in the vehicle frame [m]; at rest the vehicle stands
    with its front lower by so much."""


class RearAxleSpec(AxleSpec):
    """The rear axle: driven and braked by default."""

    is_steered: bool = False
    is_driven: bool = True
    is_braked: bool = True


class AxlesSpec(Spec):
    """Drive layout: which axles are steered, driven and braked (report, table 1: rear wheel drive)."""

    front: FrontAxleSpec = FrontAxleSpec()
    rear: RearAxleSpec = RearAxleSpec()

    @model_validator(mode="after")
    def _check_layout(self) -> AxlesSpec:
        if not (self.front.is_driven or self.rear.is_driven):
            raise ValueError("no axle is driven; set is_driven: true for front, rear or both")
        if not self.front.is_steered or self.rear.is_steered:
            raise ValueError(
                "only the front axle can be steered; set front.is_steered: true and rear.is_steered: false"
            )
        return self


def _named(cameras: dict[str, CameraSpec]) -> dict[str, CameraSpec]:
    if len(cameras) > MAX_CAMERAS:
        raise ValueError(f"a vehicle can have at most {MAX_CAMERAS} cameras")
    for name in cameras:
        if not name.isidentifier() or len(name) > 100:
            raise ValueError(f"a name is letters, digits and '_', such as front, not '{name[:100]}'")
        if name in SensorSuiteSpec.model_fields:
            raise ValueError(f"'{name}' is a sensor; a camera needs another name")
    return cameras


def _known(profile: str | None) -> str | None:
    if profile not in (None, *PROFILES):
        raise ValueError(f"'{profile}' is not known. Known: {', '.join(PROFILES)}")
    return profile


class VehicleSpec(Spec):
    """A four-wheeled car with two axles.

    The vehicle frame is the centre of the rear axle at wheel-centre height: x forward, y left, z up.
    """

    title: str
    """Title for menus and lists."""
    summary: dict[str, str] = Field(default_factory=dict)
    """Components of the car, as text (report, table 1)."""
    look: Literal["platforms", "racer", "enclosed"] = "platforms"
    """Kind of the mesh. platforms: a stack of acrylic platforms with boards. racer: a 1:10 race car, whose chassis and
    deck are the two `platforms`. enclosed: a race car with an enclosure instead of the deck."""
    size: Size
    """Overall length, width, height [m]."""
    wheelbase: Length
    """[m]."""
    track: Length
    """Distance between the centres of left and right wheels [m]."""
    body: RigidBodySpec
    platforms: Annotated[list[ColliderSpec], Field(min_length=1, max_length=100)]
    """Colliders of the platforms, lowest first."""
    bumpers: Annotated[list[ColliderSpec], Field(default_factory=list, max_length=20)]
    """Colliders of the bumpers, which may be the widest part of the vehicle."""
    lidar_collider: ColliderSpec
    wheels: WheelSpec
    axles: AxlesSpec = AxlesSpec()
    steering: SteeringSpec
    drivetrain: DrivetrainSpec
    lights: LightsSpec
    sensors: SensorSuiteSpec
    cameras: Annotated[dict[str, CameraSpec], AfterValidator(_named)] = Field(default_factory=dict)
    devkit_profile: Annotated[str | None, AfterValidator(_known)] = None
    """Profile of the devkit scripts for this vehicle, for example roboracer; null: detected from their commands."""

    @model_validator(mode="after")
    def _stands(self) -> VehicleSpec:
        boxes: dict[tuple[str | int, ...], ColliderSpec] = {("lidar_collider",): self.lidar_collider}
        boxes |= {("platforms", i): box for i, box in enumerate(self.platforms)}
        boxes |= {("bumpers", i): box for i, box in enumerate(self.bumpers)}
        errors: list[Rule] = [
            (place, f"reaches below the ground at z = {-self.ride_height:g} m")
            for place, box in boxes.items()
            if box.position[2] - box.size[2] / 2 < -self.ride_height - 1e-6
        ]
        if self.is_race_car and len(self.platforms) != 2:
            upper = "deck" if self.look == "racer" else "enclosure"
            errors.append((("platforms",), f"must be two, chassis and {upper}, for look: {self.look}"))
        x, y, _ = self.body.center_of_mass
        if not (0.0 <= x <= self.wheelbase and abs(y) <= self.track / 2):
            errors.append((("body", "center_of_mass"), "must be between the wheels; otherwise the car falls over"))
        if errors:
            raise RuleError(errors)
        return self

    @property
    def is_race_car(self) -> bool:
        """Whether it looks like a race car, which can be painted."""
        return self.look != "platforms"

    @property
    def hubs(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Wheel centres at the suspension's target position: front left, front right, rear left, rear right [m]."""
        axle, side = self.axles.front, self.track / 2
        front = self.wheelbase if axle.x is None else axle.x
        return (front, side, axle.z), (front, -side, axle.z), (0.0, side, 0.0), (0.0, -side, 0.0)

    @property
    def rest(self) -> tuple[float, float]:
        """Height of the vehicle frame above the ground at rest [m], and pitch [rad], positive with the front lower.

        With front hubs that are higher, the vehicle leans forward, its weight leans as well, and the springs follow, so
        that the pitch is a fixed point. Each iteration reduces the error to about a twentieth.
        """
        axle, _, z = self.hubs[0]
        radius, weight, pitch, rear = self.wheels.radius, self.body.mass * GRAVITY, 0.0, 0.0
        x, _, up = self.body.center_of_mass
        for _ in range(20 if z else 0):
            c, s = math.cos(pitch), math.sin(pitch)
            # share of the weight in front: distances of centre of mass and front contacts from the rear ones
            share = (x * c + (up + radius) * s) / (axle * c + z * s)
            front = weight * (share / c - x / axle * c) / (2.0 * self.wheels.suspension.stiffness)
            rear = weight * ((1.0 - share) / c - (1.0 - x / axle) * c) / (2.0 * self.wheels.suspension.stiffness)
            pitch = math.atan2(z + front - rear, axle)
        return (radius - rear) * math.cos(pitch), pitch

    @property
    def ride_height(self) -> float:
        """Height of the origin of the vehicle frame above the ground at rest [m]."""
        return self.rest[0]

    @property
    def full_throttle_speed(self) -> float:
        """Speed of the treads that full throttle asks for [m/s], or reaches in torque and voltage control.

        There the damping of the wheels limits it; in voltage control their rolling resistance does so, too.
        """
        drive, damping = self.drivetrain, self.wheels.damping_rate
        if drive.control == "voltage":
            driven = 2 * (self.axles.front.is_driven + self.axles.rear.is_driven)
            resistance = self.wheels.rolling_resistance * self.body.mass * GRAVITY * self.wheels.radius / driven
            loss = drive.torque_limit / drive.speed_limit + damping * 4 / driven
            return self.wheels.radius * max(0.01 * drive.speed_limit, (drive.torque_limit - resistance) / loss)
        is_damped = drive.control == "torque" and damping * drive.speed_limit > drive.torque_limit
        return self.wheels.radius * (drive.torque_limit / damping if is_damped else drive.speed_limit)

    def standing(self, x: float, y: float, yaw: float) -> tuple[float, ...]:
        """Pose of the vehicle at rest on the ground at x, y [m] with heading yaw [rad]: position, quaternion wxyz."""
        height, pitch = self.rest
        return (x, y, height, *quaternion_from_euler(0.0, pitch, yaw))

    @property
    def colliders(self) -> dict[str, ColliderSpec]:
        """All colliders but those of the wheels, by name."""
        boxes = {f"platform_{i}": box for i, box in enumerate(self.platforms, start=1)}
        return boxes | {f"bumper_{i}": box for i, box in enumerate(self.bumpers, 1)} | {"lidar": self.lidar_collider}

    @property
    def front(self) -> float:
        """How far its collision shape reaches ahead of the rear axle [m]."""
        ends = (box.position[0] + box.size[0] / 2 for box in self.colliders.values())
        return max(self.hubs[0][0] + self.wheels.radius, *ends)

    def with_factors(self, mass: float = 1.0, drive: float = 1.0, trim: float = 0.0) -> VehicleSpec:
        """A vehicle with `mass` times the mass and the inertia, and `drive` times the torque of the motors of this one.

        `trim`: angle that is added to those of the steered wheels [rad].
        """
        body, drivetrain, steering = self.body, self.drivetrain, self.steering
        heavier = {"mass": mass * body.mass, "inertia": tuple(mass * moment for moment in body.inertia)}
        changed = {
            "body": body.model_copy(update=heavier),
            "drivetrain": drivetrain.model_copy(update={"torque_limit": drive * drivetrain.torque_limit}),
            "steering": steering.model_copy(update={"offset_deg": steering.offset_deg + math.degrees(trim)}),
        }
        return self.model_copy(update=changed)

    def grip_on(self, surface: str | None) -> float:
        """Factor of the friction on a floor of `wheels.surfaces`; None: 1."""
        return 1.0 if surface is None else self.wheels.surfaces[surface]


def load_vehicle(name: str) -> VehicleSpec:
    """The vehicle with that name or in that file. Raises `SpecError` with all errors."""
    from autodrive.scenario.kinds import read  # noqa: PLC0415  compiling needs no files

    return read("vehicle", name, VehicleSpec)
