"""VehicleSpec: all numbers of a car, in one file; meshes, colliders, dynamics and sensor mounts come from it alone."""

from __future__ import annotations

from pydantic import Field, model_validator

from autodrive.actuators.drivetrain import DrivetrainSpec
from autodrive.actuators.lights import LightsSpec
from autodrive.actuators.steering import SteeringSpec
from autodrive.descriptions import Spec, read
from autodrive.sensors.camera import CameraSpec
from autodrive.sensors.catalog import SensorSuiteSpec

Vector = tuple[float, float, float]


class RigidBodySpec(Spec):
    """The chassis as a rigid body (report, table 9)."""

    mass: float = Field(gt=0)
    """Of the whole car [kg]."""
    inertia: Vector
    """About the centre of mass, along x, y, z of the vehicle [kg m^2]."""
    center_of_mass: Vector
    """In the vehicle frame [m]."""
    drag: float = Field(ge=0)
    """Share of the velocity lost in a second, as Unity's Rigidbody.drag [1/s]."""
    angular_drag: float = Field(ge=0)
    """Likewise of the angular velocity [1/s]."""
    angular_velocity_max: float = Field(gt=0)
    """The engine never turns the body faster [rad/s] (Unity's default: 7)."""
    friction: float = Field(ge=0)
    """Coulomb friction of the colliders against other things."""


class BoxSpec(Spec):
    """A box along the vehicle's axes."""

    position: Vector
    """Its centre in the vehicle frame [m]."""
    size: Vector
    """Full lengths along x, y, z [m]."""


class FrictionCurve(Spec):
    """Unity's WheelFrictionCurve: force / load over slip."""

    extremum_slip: float = Field(gt=0)
    extremum_value: float = Field(gt=0)
    asymptote_slip: float = Field(gt=0)
    asymptote_value: float = Field(ge=0)
    stiffness: float = Field(ge=0)
    """Factor of both values."""
    initial_slope: float = Field(ge=0, le=3)
    """Slope at 0 in units of extremum_value / extremum_slip; 1.5 makes a natural spline, 3 the curve 1 - (1 - s)^3."""

    @model_validator(mode="after")
    def _in_order(self) -> FrictionCurve:
        if self.asymptote_slip <= self.extremum_slip:
            raise ValueError(
                f"asymptote_slip {self.asymptote_slip} must be greater than extremum_slip {self.extremum_slip}"
            )
        return self

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """As the wheel model takes it: slips, values with the stiffness in them, initial slope."""
        k = self.stiffness
        return (
            self.extremum_slip,
            k * self.extremum_value,
            self.asymptote_slip,
            k * self.asymptote_value,
            self.initial_slope,
        )


class SuspensionSpec(Spec):
    """Spring and damper of one wheel (report, table 9)."""

    distance: float = Field(gt=0)
    """Whole travel [m]."""
    target_position: float = Field(ge=0, le=1)
    """Where in that travel the static load is carried: 0 fully compressed ... 1 fully extended, as Unity."""
    stiffness: float = Field(gt=0)
    """[N/m]."""
    damping: float = Field(ge=0)
    """[N s/m]."""
    bump_stiffness: float = Field(gt=0)
    """Of the stop at full compression [N/m]."""
    substeps: int = Field(ge=1)
    """PhysX moves a wheel this many times within one step of the body; see `look_ahead`."""

    def look_ahead(self, dt: float) -> float:
        """Mean time [s], within a step of `dt`, at which PhysX's substeps (0, dt/n, 2 dt/n ...) read the spring."""
        return dt * (self.substeps - 1) / (2 * self.substeps)

    @property
    def compression_max(self) -> float:
        """From the target position [m]."""
        return (1.0 - self.target_position) * self.distance

    @property
    def droop_max(self) -> float:
        """From the target position [m]."""
        return self.target_position * self.distance


class RegularisationSpec(Spec):
    """Figures that keep slip finite at low speed and a standing car still."""

    active_slip_offset: float = Field(gt=0)
    """Added to the slip ratio's denominator of a driven or braked wheel [m/s]."""
    passive_slip_minimum: float = Field(gt=0)
    """Least denominator of the slip ratio of a wheel that rolls freely [m/s]."""
    slip_angle_offset: float = Field(gt=0)
    """Added to the slip angle's denominator [m/s]."""
    hold_speed: float = Field(ge=0)
    """Below it a locked wheel holds its place like a spring instead of creeping [m/s]."""
    hold_frequency: float = Field(gt=0, le=60)
    """Natural frequency of that spring with the car on it [Hz]."""


class WheelSpec(Spec):
    """The four equal wheels (report, table 9)."""

    mass: float = Field(gt=0)
    """[kg]; the moment of inertia is that of a solid disc, as in PhysX."""
    radius: float = Field(gt=0)
    """[m]."""
    width: float = Field(gt=0)
    """[m]."""
    damping_rate: float = Field(ge=0)
    """Torque against the spin [N m s/rad] (Unity calls the unit kg m^2/s)."""
    force_height: float
    """Unity's force application point distance, above the wheel's base [m]."""
    collider_center: float
    """Height of the collider above the wheel's place at the target position [m]; it is droop_max in every Unity rig."""
    suspension: SuspensionSpec
    forward_friction: FrictionCurve
    sideways_friction: FrictionCurve
    regularisation: RegularisationSpec


class VehicleSpec(Spec):
    """A four-wheeled car, front wheels steered, rear wheels driven.

    The vehicle frame is the centre of the rear axle at wheel-centre height: x forward, y left, z up.
    """

    title: str
    """For people."""
    summary: dict[str, str] = Field(default_factory=dict)
    """What the car is built of, for people (report, table 1)."""
    size: Vector
    """Overall length, width, height [m]."""
    wheelbase: float = Field(gt=0)
    """[m]."""
    track: float = Field(gt=0)
    """Between the centres of left and right wheels [m]."""
    body: RigidBodySpec
    platforms: list[BoxSpec]
    """Colliders of the acrylic platforms, from the lowest up."""
    lidar_collider: BoxSpec
    wheels: WheelSpec
    steering: SteeringSpec
    drivetrain: DrivetrainSpec
    lights: LightsSpec
    sensors: SensorSuiteSpec
    cameras: dict[str, CameraSpec] = Field(default_factory=dict)

    @property
    def hubs(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Wheel centres at the suspension's target position: front left, front right, rear left, rear right [m]."""
        front, side = self.wheelbase, self.track / 2
        return (front, side, 0.0), (front, -side, 0.0), (0.0, side, 0.0), (0.0, -side, 0.0)

    @property
    def ride_height(self) -> float:
        """Height of the vehicle frame above the ground when the car stands [m]."""
        return self.wheels.radius


def load_vehicle(name: str) -> VehicleSpec:
    """The vehicle of that name, or of that file. Raises `SpecError` with all faults."""
    return read("vehicle", name, VehicleSpec)
