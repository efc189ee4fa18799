"""Command, Request, Frame, Event and every Reading: the one source for all languages.

Units are SI and radians. Axes are x forward, y left, z up (REP 103); left turns are positive. Quaternions are
wxyz. Arrays are read-only float64 numpy arrays unless said otherwise. Every reading carries the simulated time at
which it was measured. (`gc=False`: what cannot be part of a cycle need not be searched for one, many times a second.)
"""

from __future__ import annotations

import enum
from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


class Headlights(enum.IntEnum):
    """Front lamps: off, low beam (lamp 1 of each side), high beam (lamps 1 and 2). Report, section 3.1.4."""

    OFF = 0
    LOW = 1
    HIGH = 2


class Indicators(enum.IntEnum):
    """Turning indicators: off, left, right, hazard (both). Report, section 3.1.4."""

    OFF = 0
    LEFT = 1
    RIGHT = 2
    HAZARD = 3


class TailLights(enum.IntEnum):
    """Rear red lamps: off, partial (with headlights), bright (brakes applied). Report, section 3.1.4."""

    OFF = 0
    PARTIAL = 1
    BRIGHT = 2


# -- messages in ------------------------------------------------------------------------------------------------


class Command(msgspec.Struct, frozen=True, gc=False):
    """What a driver wants of one vehicle.

    `throttle` [-1, 1]: fraction of the drive limit, forward positive; 0 brakes. `steering` [-1, 1]: fraction of
    the steering limit, left positive. Both are clamped. `headlights`, `indicators`: None leaves them as they are.
    """

    throttle: float = 0.0
    steering: float = 0.0
    headlights: Headlights | None = None
    indicators: Indicators | None = None


class Reset(msgspec.Struct, frozen=True, tag=True):
    """Bring the world to its initial state; `seed` None keeps the seed."""

    seed: int | None = None


class Pause(msgspec.Struct, frozen=True, tag=True):
    """Stop simulated time; readers stay connected."""


class Resume(msgspec.Struct, frozen=True, tag=True):
    """Let simulated time run again."""


class Step(msgspec.Struct, frozen=True, tag=True):
    """Run `ticks` ticks while paused, the first of them with these commands, by vehicle.

    A command of a Step is obeyed whatever the driving mode: who moves time drives.
    """

    ticks: int = 1
    commands: dict[str, Command] = {}


class SetSpeed(msgspec.Struct, frozen=True, tag=True):
    """Simulated seconds per wall second; None: as fast as possible."""

    factor: float | None = 1.0


class Teleport(msgspec.Struct, frozen=True, tag=True):
    """Put a vehicle, at rest, at x, y [m] of the map with heading yaw [rad]."""

    vehicle: str
    x: float
    y: float
    yaw: float = 0.0


class SetSceneLight(msgspec.Struct, frozen=True, tag=True):
    """Day (True) or night (False)."""

    enabled: bool


class SetDrivingMode(msgspec.Struct, frozen=True, tag=True):
    """Who drives: a person (manual: commands of a bridge are ignored) or a script (autonomous)."""

    vehicle: str
    is_autonomous: bool


class LoadScenario(msgspec.Struct, frozen=True, tag=True):
    """Go over to the scenario of that name; readers stay connected."""

    name: str


Request: TypeAlias = Reset | Pause | Resume | Step | SetSpeed | Teleport | SetSceneLight | SetDrivingMode | LoadScenario


# -- readings ---------------------------------------------------------------------------------------------------


class Pose(msgspec.Struct, frozen=True, gc=False):
    """Position [m], shape (3,), and orientation (quaternion wxyz), shape (4,), in the map frame."""

    position: Array
    orientation: Array


class EncoderReading(msgspec.Struct, frozen=True, gc=False):
    """Rear wheels, left then right: `ticks` (int64, shape (2,)) and `angles` [rad], shape (2,); never wrap."""

    time: float
    ticks: NDArray[np.int64]
    angles: Array


class IpsReading(msgspec.Struct, frozen=True, gc=False):
    """Position [m] of the rear axle centre in the map frame, shape (3,)."""

    time: float
    position: Array


class ImuReading(msgspec.Struct, frozen=True, gc=False):
    """Inertial data in the axes of the sensor (REP 103, REP 145).

    `orientation` wxyz, shape (4,); `euler` roll, pitch, yaw [rad] in (-pi, pi], shape (3,), with
    R = Rz(yaw) Ry(pitch) Rx(roll); `angular_velocity` [rad/s], shape (3,); `linear_acceleration` [m/s^2], shape
    (3,), without gravity unless the spec asks for specific force.
    """

    time: float
    orientation: Array
    euler: Array
    angular_velocity: Array
    linear_acceleration: Array


class LidarScan(msgspec.Struct, frozen=True, gc=False):
    """One scan. Ray i looks along angle_min + i * angle_increment [rad] in the sensor's axes, left positive.

    `ranges` [m], shape (n_ray,): by REP 117, -inf is "too near to measure" and +inf is "nothing within range_max".
    `intensities`, shape (n_ray,). `time` is that of the last ray; a rolling scan began `scan_time` earlier.
    `time_increment` [s] between rays is 0 for an instantaneous scan. `scan_rate` [Hz].
    """

    time: float
    ranges: Array
    intensities: Array
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    scan_rate: float
    scan_time: float
    time_increment: float


class CameraIntrinsics(msgspec.Struct, frozen=True, gc=False):
    """The pinhole of a camera, in pixels.

    A point (x, y, z) of the optical frame is seen at u = cx + fx x / z, v = cy + fy y / z, from the picture's upper
    left corner; pixel (0, 0) covers 0 to 1 of both. `distortion` k1, k2, p1, p2, k3 moves x / z and y / z before that
    (Brown-Conrady, as OpenCV and ROS 'plumb_bob').
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


class CameraImage(msgspec.Struct, frozen=True, gc=False):
    """One picture, of the moment `time` [s].

    `pose` is that of the optical frame (x right, y down, z forward, REP 103) in the map: world from camera. `rgba`
    uint8, shape (height, width, 4), first row on top, sRGB; the fourth is 255. Where asked for: `depth` [m] float32,
    shape (height, width), along z of the optical frame, inf where nothing is; `labels` uint8, likewise, see
    `autodrive.render.asset.Label`.
    """

    time: float
    pose: Pose
    intrinsics: CameraIntrinsics
    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32] | None = None
    labels: NDArray[np.uint8] | None = None

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """The picture without the fourth value, shape (height, width, 3); a view, not a copy."""
        return self.rgba[..., :3]


class Lights(msgspec.Struct, frozen=True, gc=False):
    """What the lamps do now. `left_indicator` and `right_indicator` say whether the lamp is lit at this moment."""

    headlights: Headlights
    indicators: Indicators
    tail_lights: TailLights
    left_indicator: bool
    right_indicator: bool
    reverse_lights: bool


class WheelsReading(msgspec.Struct, frozen=True, gc=False):
    """Ground truth of the wheels, shape (4,) each: front left, front right, rear left, rear right.

    `steering_angle` [rad], `rotation_angle` [rad], `angular_velocity` [rad/s], `compression` [m] of the suspension
    (0 at the target position), `normal_load` [N], `slip_ratio` and `slip_angle` [rad].
    """

    steering_angle: Array
    rotation_angle: Array
    angular_velocity: Array
    compression: Array
    normal_load: Array
    slip_ratio: Array
    slip_angle: Array


class VehicleFrame(msgspec.Struct, frozen=True, gc=False):
    """One vehicle at the time of the Frame: ground truth, actuator feedback, and the latest of every sensor.

    `pose` is that of the vehicle frame: centre of the rear axle at wheel-centre height. `velocity` [m/s] of that
    point and `angular_velocity` [rad/s], shape (3,), are in vehicle axes. `throttle` [-1, 1] is the latest command
    given to the drive actuators and `steering` [rad], left positive, the angle of the steering actuator (report,
    tables 2 and 3; sampled every tick). `lidar` is None before the first scan is complete. `cameras` holds the latest
    picture of each camera by its name ('front', 'rear'); none where cameras are off, or before the first.
    """

    pose: Pose
    velocity: Array
    angular_velocity: Array
    throttle: float
    steering: float
    encoders: EncoderReading
    ips: IpsReading
    imu: ImuReading
    lidar: LidarScan | None
    lights: Lights
    wheels: WheelsReading
    is_autonomous: bool
    collision_count: int
    cameras: dict[str, CameraImage] = {}

    @property
    def speed(self) -> float:
        """Forward speed [m/s], negative in reverse."""
        return float(self.velocity[0])


class ObjectFrame(msgspec.Struct, frozen=True, gc=False):
    """A movable object, for example a construction box."""

    pose: Pose


# -- events -----------------------------------------------------------------------------------------------------


class Collision(msgspec.Struct, frozen=True, tag=True):
    """A vehicle began to touch something.

    `other` is the name of the vehicle, box or fixed thing; `impulse` [N s] is the magnitude of the contact impulse
    of the tick; `position` [m] a contact point in the map frame, shape (3,).
    """

    time: float
    vehicle: str
    other: str
    impulse: float
    position: Array


class OffRoad(msgspec.Struct, frozen=True, tag=True):
    """A vehicle's first wheel left the drivable area; `position` [m], shape (3,), of its rear axle centre."""

    time: float
    vehicle: str
    position: Array


class BackOnRoad(msgspec.Struct, frozen=True, tag=True):
    """All wheels of a vehicle are on the drivable area again."""

    time: float
    vehicle: str
    position: Array


Event: TypeAlias = Collision | OffRoad | BackOnRoad


class Frame(msgspec.Struct, frozen=True, gc=False, tag=True):
    """The world after a tick: `time` [s] since reset, number of ticks, vehicles and movable objects by name.

    `events` are those of this tick, in order. `scene_light` is True by day.
    """

    time: float
    tick: int
    vehicles: dict[str, VehicleFrame]
    objects: dict[str, ObjectFrame]
    events: tuple[Event, ...]
    scene_light: bool
