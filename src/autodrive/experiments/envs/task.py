"""A driving task: its scenario, how an episode starts, its features, its reward and its end.

Single and vector environments run the same compiled functions, on arrays with a leading axis of n cars. They use only
operations that are rounded correctly (+, -, *, /, sqrt), so that the bits are the same on every processor.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.scenario import ScenarioSpec
    from autodrive.world.readings import Readings

Observation: TypeAlias = Literal["state", "lidar", "camera"]
Ground: TypeAlias = tuple[float, float, float]
"""x, y [m] and yaw [rad] on the ground."""
Bools: TypeAlias = "NDArray[np.bool_]"


OFFENCES = "red_lights", "stop_signs"
"""Names of the columns of `CarReadings.offences` in infos."""


class CarReadings(NamedTuple):
    """What the environments read of n cars, in the units and frames of a `VehicleFrame`."""

    time: Floats
    """Simulated time since the reset [s], shape (n,)."""
    position: Floats
    """Position of the centre of the rear axle in the map frame [m], shape (n, 3)."""
    orientation: Floats
    """Orientation, quaternion wxyz, map from vehicle, shape (n, 4)."""
    velocity: Floats
    """Velocity in the vehicle frame [m/s], shape (n, 3)."""
    angular_velocity: Floats
    """Angular velocity in the vehicle frame [rad/s], shape (n, 3)."""
    steering: Floats
    """Angle of the steering actuator, left positive [rad], shape (n,)."""
    encoder_angles: Floats
    """Angles of the rear wheels [rad], shape (n, 2)."""
    collision_count: NDArray[np.int64]
    """Collisions since the reset, shape (n,)."""
    lidar_time: Floats
    """Time of the latest LIDAR scan [s], shape (n,)."""
    lidar_ranges: Floats
    """Ranges of the latest LIDAR scan [m], as in REP 117, shape (n, n_ray)."""
    offences: Integers
    """Red lights and stop signs that were run since the reset, shape (n, 2)."""
    heard: Floats
    """Latest radio message of each of the s cars of the world; `Readings.heard_vehicles`, shape (n, s, 8).

    Without a channel s is 0."""
    objects: Floats
    """Positions of the movable objects [m] in the map frame, shape (n, n_object, 3)."""
    is_off_road: Bools
    """Whether a wheel is outside the drivable area, shape (n,)."""

    @classmethod
    def of(cls, readings: Readings, count: int) -> CarReadings:
        """The first `count` cars of all worlds, one world after the other.

        They may be views, which the next step of the worlds overwrites.
        """
        n = len(readings.position)
        columns = [getattr(readings, name) for name in cls._fields[1:10]]
        columns += [np.stack([readings.red_light_count, readings.stop_sign_count], -1), readings.heard_vehicles]
        cars: list[Any] = [column[:, :count].reshape(n * count, *column.shape[2:]) for column in columns]
        time, objects = readings.time, readings.object_pose[:, :, :3]
        if count > 1:
            time, objects = np.repeat(time, count), np.repeat(objects, count, axis=0)
        return cls._make([time, *cars, objects, readings.is_off_road[:, :count].reshape(n * count)])

    def rows(self, rows: NDArray[np.intp]) -> CarReadings:
        """The readings of some of the cars."""
        some: list[Any] = [values[rows] for values in self]
        return CarReadings(*some)


CHOICES: Floats = np.array([(throttle, steering) for throttle in (-1, 0, 1) for steering in (-1, -0.5, 0, 0.5, 1)])
"""Throttle and steering of each discrete action, shape (15, 2)."""


class Feature(NamedTuple):
    """One number of an observation, clipped to its limits."""

    name: str
    low: float
    high: float
    text: str
    """Unit, frame and meaning."""


class ScanView(NamedTuple):
    """How the observation 'lidar' divides a scan into sectors, of which it has the shortest range each."""

    first_degree: float
    """Bearing of the middle of the first sector, or of its beginning if the scan is no circle [deg]."""
    degrees: float
    """Angle of a sector [deg]."""
    sectors: int
    range_max: float
    """Range beyond which there is no return [m]."""

    @property
    def is_circle(self) -> bool:
        """Whether the scan has 360 degrees; then its first ray is in the middle of the first sector."""
        return self.sectors * self.degrees >= 360.0

    @property
    def bearings(self) -> list[float]:
        """Bearings of the middles of the sectors [deg], left positive."""
        first = self.first_degree + (0.0 if self.is_circle else 0.5 * self.degrees)
        return [first + k * self.degrees for k in range(self.sectors)]


CIRCLE = ScanView(0.0, 10.0, 36, 12.0)
"""View of the scan of the car Nigel."""


class Start(NamedTuple):
    """How an episode starts."""

    poses: dict[str, Ground]
    """Poses of vehicles and boxes on the ground [m, m, rad], by name."""
    memory: tuple[float, ...]
    """What the task remembers of the episode at its start."""


class StepOutcome(NamedTuple):
    """What a step of n cars led to; shape (n,) each."""

    reward: Floats
    """Reward of the step."""
    has_ended: Bools
    """Whether the episode ends here, other than by its time."""
    is_success: Bools
    """Whether the task is accomplished."""


MOTION = (
    Feature("speed", -2.0, 2.0, "forward speed [m/s]"),
    Feature("yaw_rate", -10.0, 10.0, "[rad/s], left positive"),
    Feature("steering", -1.0, 1.0, "angle of the steering actuator [rad], left positive"),
)
"""The first features of every task."""


class Task(ABC):
    """One task. Its episodes differ in what `start` draws."""

    name: str
    scenario: ScenarioSpec
    features: tuple[Feature, ...]
    """All features, which are the observation 'state'."""
    known: int
    """Number of the first features, which are also part of the observations 'lidar' and 'camera'."""
    observation: Observation
    """What is observed by default."""
    memory_size: int
    scan: ScanView = CIRCLE
    choices: Floats = CHOICES
    """Throttle and steering of each discrete action, shape (n, 2)."""

    @abstractmethod
    def __init__(self, frame_skip: int) -> None:
        """`frame_skip`: ticks of a step."""

    @abstractmethod
    def start(self, rng: np.random.Generator) -> Start:
        """Draw the start of an episode."""

    def starts(self, rng: np.random.Generator) -> list[Start]:
        """Draw the start of the episodes of all cars of a world, in order."""
        return [self.start(rng)]

    def throttle_factors(self, memory: Floats) -> Floats:
        """Factor by which the throttle of each car is multiplied, shape (n,)."""
        return np.ones(len(memory))

    def measures(self, cars: CarReadings, memory: Floats) -> dict[str, Floats]:
        """What own rewards can read of the task (`own_rules.Step`) after `evaluate`: arrays of the shape (n,) by name.

        `distance` is along the way since the start [m].
        """
        del cars, memory
        return {}

    @abstractmethod
    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
        """Judge the last step.

        Writes `memory`, shape (n, memory_size), `features`, shape (n, n_feature or known), and `outcome`. It is also
        called at the start of an episode, for the memory and the features only.
        """


# -- parts of the compiled functions; i is the number of a car ---------------------------------------------------------


@jit
def write_motion(cars: CarReadings, i: int, features: Floats) -> None:
    """Write the features of `MOTION`."""
    features[i, 0] = cars.velocity[i, 0]
    features[i, 1] = cars.angular_velocity[i, 2]
    features[i, 2] = cars.steering[i]


@jit
def heading(cars: CarReadings, i: int) -> tuple[float, float]:
    """Cosine and sine of the yaw angle."""
    q = cars.orientation[i]
    c, s = 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]), 2.0 * (q[0] * q[3] + q[1] * q[2])
    length = math.sqrt(c * c + s * s)
    return c / length, s / length


@jit
def turned(x: float, y: float, c: float, s: float) -> tuple[float, float]:
    """A vector of the map frame in the axes of a vehicle whose yaw angle has that cosine and sine."""
    return c * x + s * y, c * y - s * x


# -- parts of a start ------------------------------------------------------------------------------------------------


def uniform(rng: np.random.Generator, limits: Sequence[float]) -> list[float]:
    """A number between -limit and limit for each limit."""
    return [limit * (2.0 * float(rng.random()) - 1.0) for limit in limits]


def wrapped(angle: float) -> float:
    """The angle wrapped to [-pi, pi] [rad]."""
    return math.remainder(angle, 2.0 * math.pi)
