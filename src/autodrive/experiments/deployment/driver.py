"""Drives a car with a policy: from the car's own scan and speed to speed and steering angle, with a safety layer.

`autodrive deploy` copies this file into the folder for a car, beside a node for ROS 2, one for ROS 1 and a devkit
script, which only pass values. It needs NumPy and Python 3.8 or newer, and nothing of the simulator. SI units, x
forward, y left, left turns positive; the origin of the car is the centre of its rear axle.
"""

from __future__ import annotations

import csv
import json
import math
import time as wall
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

GRID = 1e-3
"""Rounding of the bearing of a ray, in sectors: messages have angles in single precision."""
MOST_UNSEEN = 0.2
"""Greatest share of the sectors that a scanner may not see, and of the rays that may be without a measurement."""
MOST_POINTS = 180
"""Points of a scan that the braking model looks at; of neighbouring rays it takes the nearest point."""
ARCS = np.linspace(-1.0, 1.0, 15)
"""Paths that the braking model tries, as shares of the greatest curvature."""
FAR = 10.0
"""Greatest free distance of a path [m]: what is farther was not seen."""
JUMP = 1.0
"""Change of the clock of the node against that of the machine between two scans that means that it was set [s]."""
USABLE = 0.75
"""A scan is used for this share of `scan_timeout`: the car has its stop in time, although `tick` comes from time to
time."""
FEW = 5
"""Scans after which a scanner counts as too slow."""
CLEARLY = 1.5
"""Factor of the free distance by which another path must be better than that of the policy."""
CREEP = 0.4
"""Speed with which a car that braked before a wall turns away from it, where there is room [m/s]."""
STANDSTILL = 0.05
"""A car that is slower stands [m/s]."""
OWN = "drive", "steer", "throttle"
"""Inputs of a policy that are its own outputs."""
SPEEDS = "speed", "side_speed", "wheel_speed", "yaw_rate"
"""Inputs of a policy that are speeds."""
READINGS = "speed", "side_speed", "yaw_rate", "steering", "wheel_speed", "scan_age"
"""Inputs of a policy that are not ranges, in the order in which `CarDriver` has them."""


class CarError(Exception):
    """The settings, the policy or the scanner cannot be used; the text says why, and what would be right."""


POSITIVE = (
    *("period", "full_speed", "full_angle", "car_full_speed", "sector_degrees", "sector_range", "wheelbase", "front"),
    *("wheel_radius", "half_width", "steering_limit", "steering_rate", "scan_timeout", "speed_timeout"),
    *("dead_man_timeout", "speed_cap", "braking", "lateral"),
)
"""Settings that must be over 0."""
MAY_BE_ZERO = "cap_step", "cap_interval", "latency", "margin", "side_margin", "dead_man_button"
"""Settings that must be 0 or more."""


# -- settings ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CarSettings:
    """Everything that can be set for a car; `settings.json` of the folder has these names."""

    policy: str = "policy.npz"
    """File of the policy."""
    period: float = 0.025
    """Time between two steps of the policy, as in its training [s]."""
    full_speed: float = 25.252
    """Speed of the throttle 1 in the training [m/s]: the vehicle's speed of the treads at full throttle."""
    full_angle: float = 0.5236
    """Steering angle of the steering 1 in the training [rad]."""
    policy_lidar: tuple[float, float] = (0.2733, 0.0)
    """Place of the LIDAR in the training, x and y from the rear axle [m]."""
    first_degree: float = -135.0
    """Bearing where the first sector of the policy begins [degree]."""
    sector_degrees: float = 5.0
    """Angle of a sector [degree]."""
    sectors: int = 54
    """Number of sectors."""
    sector_range: float = 10.0
    """Range beyond which the policy sees no return [m]."""

    car_full_speed: float = 25.252
    """Speed of the car at the throttle 1 [m/s], for the log and for `throttle_topic`."""
    wheelbase: float = 0.324
    """Distance of the axles of the car [m]."""
    wheel_radius: float = 0.059
    """Radius of the wheels of the car, for encoders [m]."""
    front: float = 0.42
    """How far the car reaches ahead of its rear axle [m]."""
    half_width: float = 0.15
    """Half of the width of the car [m]."""
    lidar: tuple[float, float] = (0.2733, 0.0)
    """Place of the LIDAR on the car, x and y from the rear axle [m]."""
    lidar_yaw: float = 0.0
    """Direction of the bearing 0 of the LIDAR in the car, left positive [rad]."""
    lidar_is_upside_down: bool = False
    """Whether the LIDAR hangs upside down: its bearings then count to the right."""
    steering_limit: float = 0.5236
    """Greatest steering angle that the car is asked for [rad]."""
    steering_rate: float = 3.2
    """Angular speed of the steering of the car [rad/s]; without `steering_topic` it estimates the steering angle."""
    steering_unwinds_at_once: bool = False
    """Whether the steering returns to the middle without a limit of its speed, as in the program of the league."""

    scan_timeout: float = 0.1
    """The car stops if there is no new scan for this time [s]."""
    speed_timeout: float = 0.2
    """The car stops if its speed was not measured for this time [s]."""
    dead_man_timeout: float = 0.5
    """The car stops if the dead man's button was not reported as pressed for this time [s]."""
    speed_cap: float = 1.0
    """Greatest speed at the start [m/s]: the policy drives slower as a whole, with the same path."""
    cap_step: float = 0.5
    """Step by which the greatest speed rises after each `cap_interval` of driving, and falls at a wall [m/s]."""
    cap_interval: float = 10.0
    """Driving without a stop after which the greatest speed rises [s]."""
    cap_most: float = 5.0
    """Greatest speed after all steps [m/s]."""
    braking: float = 4.0
    """Deceleration by which the braking model stops the car [m/s^2]: less than the car can."""
    lateral: float = 4.0
    """Lateral acceleration of the paths that the braking model tries [m/s^2]: less than the car can."""
    latency: float = 0.1
    """Time from a scan until the car brakes, for the braking model [s]."""
    margin: float = 0.1
    """Distance from a wall at which the braking model stops the car [m]."""
    side_margin: float = 0.02
    """Free space to each side of the car that the braking model keeps [m]."""

    scan_topic: str = "/scan"
    """sensor_msgs/LaserScan."""
    odometry_topic: str = "/odom"
    """nav_msgs/Odometry: speed, yaw rate and, for the log, pose; '': none."""
    speed_topic: str = ""
    """std_msgs/Float32 with the forward speed [m/s], instead of that of the odometry; '': none."""
    encoder_topics: tuple[str, ...] = ()
    """sensor_msgs/JointState with the angle of a wheel [rad], one or two, instead of the speed of the odometry."""
    imu_topic: str = ""
    """sensor_msgs/Imu with the yaw rate, instead of that of the odometry; '': none."""
    steering_topic: str = ""
    """std_msgs/Float32 with the measured steering angle [rad], left positive; '': it is estimated."""
    pose_topic: str = ""
    """Pose for the log, instead of that of the odometry; '': none."""
    pose_type: str = "PoseStamped"
    """Type of `pose_topic`: PoseStamped, PoseWithCovarianceStamped or Odometry."""
    drive_topic: str = "/drive"
    """ackermann_msgs/AckermannDriveStamped with speed and steering angle; '': `throttle_topic` and the next one."""
    throttle_topic: str = ""
    """std_msgs/Float32 with the throttle, -1 to 1, instead of `drive_topic`."""
    steering_command_topic: str = ""
    """std_msgs/Float32 with the steering, -1 to 1, left positive, instead of `drive_topic`."""
    dead_man_topic: str = "/dead_man"
    """CarTopic of the dead man's button; '': there is none, which is for a car on a stand only."""
    dead_man_type: str = "Bool"
    """Type of `dead_man_topic`: Bool, or Joy with `dead_man_button`."""
    dead_man_button: int = 5
    """Number of the button in the messages of type Joy."""
    log: str = "drive_{time}.csv"
    """Log to write, {time} is date and time; '': none."""

    def __post_init__(self) -> None:
        errors = [
            f"{name} must be {'0 or more' if name in MAY_BE_ZERO else 'over 0'}, not {value}"
            for name in (*POSITIVE, *MAY_BE_ZERO)
            if not ((value := getattr(self, name)) > 0.0 or (value == 0.0 and name in MAY_BE_ZERO))
        ]
        if self.sectors < 1 or self.sectors * self.sector_degrees > 360.0 + 1e-9:
            errors.append("sectors: the sectors together must have at most 360 degrees")
        if self.cap_most < self.speed_cap:
            errors.append(f"cap_most must be at least speed_cap ({self.speed_cap}), not {self.cap_most}")
        if not self.drive_topic and not (self.throttle_topic and self.steering_command_topic):
            errors.append("drive_topic is empty: throttle_topic and steering_command_topic must be given then")
        if not (self.odometry_topic or self.speed_topic or self.encoder_topics):
            errors.append("the speed of the car is needed: give odometry_topic, speed_topic or encoder_topics")
        if self.pose_type not in POSES:
            errors.append(f"pose_type '{self.pose_type}' is not known. Known: {', '.join(POSES)}")
        if self.dead_man_type not in ("Bool", "Joy"):
            errors.append(f"dead_man_type '{self.dead_man_type}' is not known. Known: Bool, Joy")
        if errors:
            raise CarError("; ".join(errors))

    @classmethod
    def read(cls, file: Path, changes: Sequence[str] = ()) -> CarSettings:
        """The settings of a JSON file; `changes` are texts NAME=VALUE. Raises `CarError`."""
        try:
            values = json.loads(Path(file).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise CarError(f"{file} cannot be read as JSON: {error}") from None
        if not isinstance(values, dict):
            raise CarError(f"{file} must be an object with names and values")
        values.update(changed(changes))
        return cls.checked(values)

    @classmethod
    def checked(cls, values: dict[str, Any]) -> CarSettings:
        """The settings with these values; those that are missing have their defaults. Raises `CarError`."""
        known = {setting.name: setting.default for setting in fields(cls)}
        errors: list[str] = []
        used: dict[str, Any] = {}
        for name, value in values.items():
            if name not in known:
                errors.append(f"setting '{name}' is not known. Known: {', '.join(known)}")
                continue
            try:
                used[name] = _converted(value, known[name])
            except (TypeError, ValueError):
                errors.append(f"{name} must be like {json.dumps(known[name])}, not {json.dumps(value)}")
        if errors:
            raise CarError("; ".join(errors))
        return cls(**used)

    def json(self) -> str:
        """The settings as the text of a JSON file."""
        return json.dumps(asdict(self), indent=1) + "\n"


def changed(changes: Sequence[str]) -> dict[str, Any]:
    """The values in texts NAME=VALUE. Raises `CarError`."""
    values: dict[str, Any] = {}
    for text in changes:
        name, sign, value = text.partition("=")
        if not sign:
            raise CarError(f"--set {text}: write NAME=VALUE")
        try:
            values[name.strip()] = json.loads(value)
        except ValueError:  # a text without quotes
            values[name.strip()] = value
    return values


POSES = {
    "PoseStamped": "geometry_msgs",
    "PoseWithCovarianceStamped": "geometry_msgs",
    "Odometry": "nav_msgs",
}
"""Types of a message with a pose, and their packages."""


def _converted(value: Any, like: Any) -> Any:
    """The value with the type of a default. Raises TypeError or ValueError if that is not possible."""
    if isinstance(like, bool) or isinstance(value, bool):
        if not (isinstance(like, bool) and isinstance(value, bool)):
            raise TypeError
        return value
    if isinstance(like, tuple):
        if isinstance(value, str):
            value = [part.strip() for part in value.split(",") if part.strip()]
        if like:  # a place
            x, y = map(float, value)
            if not (math.isfinite(x) and math.isfinite(y)):
                raise ValueError
            return (x, y)
        if not all(isinstance(part, str) for part in value) or len(value) > 2:
            raise TypeError
        return tuple(value)
    if isinstance(like, str):
        if not isinstance(value, str):
            raise TypeError
        return value
    if isinstance(value, str):
        raise TypeError
    number = type(like)(value)
    if not math.isfinite(number) or number != value:
        raise ValueError
    return number


# -- the policy --------------------------------------------------------------------------------------------------------

ACTIVATIONS: dict[str, Callable[..., Any]] = {
    "none": lambda values: values,
    "tanh": np.tanh,
    "relu": lambda values: np.maximum(values, 0.0),
    "sigmoid": lambda values: 0.5 * (1.0 + np.tanh(0.5 * values)),
    "elu": lambda values, slope=1.0: np.where(values > 0.0, values, slope * np.expm1(np.minimum(values, 0.0))),
    "leaky_relu": lambda values, slope=0.01: np.where(values > 0.0, values, slope * values),
    "clip": lambda values, low=-1.0, high=1.0: np.clip(values, low, high),
}
"""Functions between the layers of a network by name; in a file numbers may follow the name, as in 'clip:-1:1'."""


class Network:
    """A network of layers, in double precision."""

    def __init__(
        self, inputs: Sequence[str], scale: Any, layers: Sequence[tuple[Any, Any]], activations: Sequence[str]
    ) -> None:
        """`layers`: weight, shape (n_out, n_in), and bias; `activations`: one for each layer. Raises `CarError`."""
        self.inputs = tuple(inputs)
        self._scale = np.asarray(scale, np.float64)
        self._layers = [(np.asarray(weight, np.float64), np.asarray(bias, np.float64)) for weight, bias in layers]
        self._functions: list[tuple[Callable[..., Any], list[float]]] = []
        for text in activations:
            name, *numbers = text.split(":")
            if name not in ACTIVATIONS:
                raise CarError(f"the activation '{text}' is not known. Known: {', '.join(ACTIVATIONS)}")
            self._functions.append((ACTIVATIONS[name], [float(number) for number in numbers]))
        width = len(self.inputs)
        for weight, bias in self._layers:
            if weight.ndim != 2 or weight.shape != (len(bias), width):
                raise CarError(f"a layer of the policy has the shape {weight.shape} for {width} inputs")
            width = len(bias)
        if width != 2 or len(self._functions) != len(self._layers) or self._scale.shape != (len(self.inputs),):
            raise CarError("the policy must have one scale for each input, and two outputs")

    def __call__(self, values: Any) -> Any:
        """The two outputs for the values of the inputs, shape (n_input,)."""
        values = values * self._scale
        for (weight, bias), (function, numbers) in zip(self._layers, self._functions):  # noqa: B905  Python 3.8
            values = function(weight @ values + bias, *numbers)
        return values


class NetworkMemory:
    """What a network reads: readings and own outputs, now or some steps ago."""

    def __init__(self, inputs: Sequence[str], readings: Sequence[str]) -> None:
        columns = {name: number for number, name in enumerate([*readings, *OWN])}
        parts = [name.partition("@") for name in inputs]
        if unknown := [name for name, _, _ in parts if name not in columns]:
            raise CarError(
                f"the policy reads '{unknown[0]}', which a car does not measure. "
                f"Known: {', '.join(READINGS)}, range_BEARING of its sectors, and {', '.join(OWN)} of earlier steps"
            )
        self._columns = np.array([columns[name] for name, _, _ in parts])
        self._ago = np.array([int(ago or 0) for _, _, ago in parts])
        self._past = np.zeros((int(self._ago.max()) + 1, len(columns)))

    def begin(self, readings: Any) -> None:
        """The drive begins with these readings: they count for all moments before."""
        self._past[:, : -len(OWN)] = readings
        self._past[:, -len(OWN) :] = 0.0

    def add(self, readings: Any) -> None:
        """The readings of the next step."""
        self._past[1:] = self._past[:-1].copy()
        self._past[0, : -len(OWN)] = readings

    def put_out(self, outputs: Any, throttle: float) -> None:
        """The outputs of this step, and the throttle that follows."""
        self._past[0, -len(OWN) : -1] = outputs
        self._past[0, -1] = throttle

    @property
    def inputs(self) -> Any:
        """The inputs in this step, shape (n_input,)."""
        return self._past[self._ago, self._columns]


class CarPolicy:
    """The policy of a file, with what it remembers; the numbers are those of the simulator but for rounding."""

    def __init__(self, file: Path, readings: Sequence[str]) -> None:
        """`readings`: names of the numbers that `act` gets. Raises `CarError` if the policy needs others."""
        try:
            with np.load(str(file), allow_pickle=False) as archive:
                arrays = dict(archive)
            about = json.loads(str(arrays["about"]))
            self.throttle: tuple[float, float] = (float(about["throttle"][0]), float(about["throttle"][1]))
            self._network = _network("", about, arrays)
            pace = about.get("pace")
            self._pace = None if pace is None else _network("pace_", pace, arrays)
            self._slowness = (1.0, 1.0) if pace is None else tuple(map(float, pace["slowness"]))
            self._keep = 0.0 if pace is None else float(pace["keep"])
            self._top = 1.0 if pace is None else float(pace.get("top_throttle", 1.0))
        except CarError as error:
            raise CarError(f"{file}: {error}") from None
        except Exception as error:  # numpy and json raise what they like for damaged files
            raise CarError(f"{file} is not a policy: {error}") from None
        self._memory = NetworkMemory(self._network.inputs, readings)
        self._motion = None if self._pace is None else NetworkMemory(self._pace.inputs, readings)
        names = [name.partition("@")[0] for name in self._network.inputs]
        self._is_speed = np.array([name in SPEEDS for name in names])
        self._evidence = np.zeros(2)
        self._has_begun = False

    @property
    def top_throttle(self) -> float:
        """The greatest throttle that it commands."""
        return min(max(self.throttle), self._top)

    def begin(self) -> None:
        """Forget everything: the next step begins a new drive."""
        self._has_begun = False

    def act(self, readings: Any, slower: float = 1.0) -> tuple[float, float]:
        """Throttle and steering, -1 to 1, for the readings of one more step; `slower` divides all speeds."""
        memories = [self._memory] + ([self._motion] if self._motion is not None else [])
        for memory in memories:
            (memory.add if self._has_begun else memory.begin)(readings)
        if not self._has_begun:
            self._evidence = np.array([self._slowness[1], 1.0])
            self._has_begun = True
        factor = slower
        if self._pace is not None and self._motion is not None:
            evidence = self._pace(self._motion.inputs)
            weight = math.exp(min(max(float(evidence[1]), -20.0), 20.0))
            self._evidence = self._keep * self._evidence + np.array([evidence[0] * weight, weight])
            factor *= min(max(float(self._evidence[0] / self._evidence[1]), self._slowness[0]), self._slowness[1])
        inputs = self._memory.inputs
        outputs = np.clip(self._network(np.where(self._is_speed, inputs * factor, inputs)), -1.0, 1.0)
        low, high = self.throttle
        throttle = min((low + (high - low) * 0.5 * (float(outputs[0]) + 1.0)) / factor, self._top)
        for memory in memories:
            memory.put_out(outputs, throttle)
        return throttle, float(outputs[1])


def _network(prefix: str, about: dict[str, Any], arrays: dict[str, Any]) -> Network:
    count = sum(name.startswith(f"{prefix}weight_") for name in arrays)
    layers = [(arrays[f"{prefix}weight_{k}"], arrays[f"{prefix}bias_{k}"]) for k in range(count)]
    activations = about.get("activations", ["tanh"] * (count - 1) + ["none"])
    return Network(about["inputs"], about["scale"], layers, activations)


# -- the scan ----------------------------------------------------------------------------------------------------------


class ScanLayout(NamedTuple):
    """How a scanner measures: bearing of the first ray, angle between two rays [rad], number of rays, limits [m]."""

    angle_min: float
    angle_increment: float
    rays: int
    range_min: float = 0.0
    range_max: float = math.inf


class Sectors:
    """The shortest range in each sector of the policy, from the scans of any scanner.

    With the scanner of the training, the values have the bits of the observation of the environment. A sector without a
    ray has the shorter range of its neighbours; a scanner that does not see a fifth of the sectors is refused.
    """

    def __init__(self, layout: ScanLayout, settings: CarSettings) -> None:
        """Raises `CarError` for a scanner that cannot be used."""
        numbers = (layout.angle_min, layout.angle_increment, layout.range_min)
        if layout.rays < 2 or not all(map(math.isfinite, numbers)) or layout.angle_increment == 0.0:
            raise CarError(f"the scan must have two rays or more, with finite angles that differ, not {layout}")
        self.layout = layout
        self._settings = settings
        sign = -1.0 if settings.lidar_is_upside_down else 1.0
        bearings = layout.angle_min + layout.angle_increment * np.arange(layout.rays)
        bearings = sign * bearings + settings.lidar_yaw
        self._cos, self._sin = np.cos(bearings), np.sin(bearings)
        self._numbers = self._sectors_of(bearings)
        width = math.radians(settings.sector_degrees)
        reach = 0.5 * max(abs(layout.angle_increment), width) - 1e-6
        middles = math.radians(settings.first_degree) + width * (np.arange(settings.sectors) + 0.5)
        turned = np.abs(np.angle(np.exp(1j * (bearings[None, :] - middles[:, None])))).min(axis=1)
        self.unseen = int((turned > reach).sum())
        """Sectors that the scanner does not see; they have the range of the nearest one that it sees."""
        if self.unseen > MOST_UNSEEN * settings.sectors:
            first, last = sorted((math.degrees(bearings[0]), math.degrees(bearings[-1])))
            raise CarError(
                f"the scan covers {first:.0f} to {last:.0f} degrees, so {self.unseen} of the {settings.sectors} "
                f"sectors of the policy are not seen. The policy needs {settings.first_degree:g} to "
                f"{settings.first_degree + settings.sectors * settings.sector_degrees:g} degrees, "
                f"or at least {100 * (1 - MOST_UNSEEN):.0f} % of them"
            )
        ahead = settings.lidar[0] - settings.policy_lidar[0], settings.lidar[1] - settings.policy_lidar[1]
        self._offset = ahead if max(map(abs, ahead)) > 0.005 else None
        used = np.flatnonzero(self._numbers >= 0)
        self._order = used[np.argsort(self._numbers[used], kind="stable")]
        ordered = self._numbers[self._order]
        self._starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
        self._present = ordered[self._starts]
        self._group = -(-layout.rays // MOST_POINTS)

    def __call__(self, ranges: Any) -> tuple[Any, Any]:
        """Ranges of the sectors [m], shape (n,), and points on the car's ground [m], shape (m, 2); see `checked`."""
        settings = self._settings
        values, is_point = self._valid(ranges)
        near = np.maximum(values, 0.0)
        near[np.isfinite(near)] = np.minimum(near[np.isfinite(near)], settings.sector_range)
        shortest = np.full(settings.sectors, np.inf)
        if self._offset is None:
            shortest[self._present] = np.minimum.reduceat(near[self._order], self._starts)
        else:
            self._seen_from_the_place_of_the_training(near, shortest)
        return _filled(shortest, settings.sector_range), self._points(values, is_point)

    def is_invalid(self, ranges: Any) -> Any:
        """Which rays have no measurement: NaN, or nearer than the scanner measures (sensor_msgs/LaserScan)."""
        with np.errstate(invalid="ignore"):
            return np.isnan(ranges) | ((ranges >= 0.0) & (ranges < self.layout.range_min))

    def _valid(self, ranges: Any) -> tuple[Any, Any]:
        """Ranges [m], and which rays have hit something.

        REP 117: -inf is too near, which is -1 here; inf is no return, the greatest range of the policy. A ray without a
        measurement is infinite here: the other rays of its sector count.
        """
        invalid = self.is_invalid(ranges)
        with np.errstate(invalid="ignore"):
            is_point = (ranges >= 0.0) & (ranges <= self.layout.range_max + 1e-3) & ~invalid & np.isfinite(ranges)
        values = np.where(is_point, ranges, self._settings.sector_range)
        values[ranges == -np.inf] = -1.0
        values[invalid] = np.inf
        return values, is_point

    def _sectors_of(self, bearings: Any) -> Any:
        """Number of the sector of each bearing [rad]; -1: in none."""
        settings = self._settings
        turn = 2.0 * math.pi / math.radians(settings.sector_degrees)
        place = (bearings - math.radians(settings.first_degree)) / math.radians(settings.sector_degrees)
        place = np.floor(np.mod(place + GRID, turn)).astype(np.int64)
        return np.where(place < settings.sectors, place, -1)

    def _seen_from_the_place_of_the_training(self, near: Any, shortest: Any) -> None:
        """Write the shortest ranges as the LIDAR of the training would see the same points."""
        assert self._offset is not None
        limit = self._settings.sector_range
        with np.errstate(invalid="ignore"):
            x = near * self._cos + self._offset[0]
            y = near * self._sin + self._offset[1]
        is_near = np.isfinite(near) & (near < limit)
        numbers = np.where(is_near, self._sectors_of(np.arctan2(y, x)), self._numbers)
        distance = np.where(is_near, np.hypot(x, y), near)
        is_used = (numbers >= 0) & np.isfinite(distance)
        np.minimum.at(shortest, numbers[is_used], np.minimum(distance[is_used], limit))

    def _points(self, values: Any, is_point: Any) -> Any:
        """Points that the scan has hit, in the frame of the car [m], shape (m, 2): the nearest of some neighbours."""
        near = np.where(is_point, values, np.inf)
        rest = -len(near) % self._group
        if rest:
            near = np.r_[near, np.full(rest, np.inf)]
        groups = near.reshape(-1, self._group)
        rays = groups.argmin(axis=1) + self._group * np.arange(len(groups))
        rays = rays[np.isfinite(near[rays])]
        settings = self._settings
        return np.column_stack(
            [
                near[rays] * self._cos[rays] + settings.lidar[0],
                near[rays] * self._sin[rays] + settings.lidar[1],
            ]
        )


def _filled(shortest: Any, most: float) -> Any:
    """The ranges, with the shorter one of the nearest neighbours in place of infinity."""
    missing = np.flatnonzero(~np.isfinite(shortest))
    if not len(missing):
        return shortest
    known = np.flatnonzero(np.isfinite(shortest))
    if not len(known):
        return np.full(len(shortest), most)
    after = np.searchsorted(known, missing)
    left, right = known[np.maximum(after - 1, 0)], known[np.minimum(after, len(known) - 1)]
    shortest[missing] = np.minimum(shortest[left], shortest[right])
    return shortest


# -- the braking model -------------------------------------------------------------------------------------------------


def free_distances(points: Any, curvatures: Any, *, front: float, half_width: float) -> Any:
    """How far a car can drive along arcs of these curvatures [1/m] until it touches a point [m], shape (n,).

    `points`: x and y in the frame of the car [m], shape (m, 2). A car on an arc covers the ring between the circles of
    the inner side of its rear axle and of its outer front corner.
    """
    curvatures = np.where(np.abs(curvatures) < 1e-4, 1e-4, curvatures)
    radius = np.abs(1.0 / curvatures)
    x, y = points[:, 0], np.sign(curvatures)[:, None] * points[:, 1]
    aside = y - radius[:, None]
    distance = x * x + aside * aside
    inner, outer = np.maximum(radius - half_width, 0.0) ** 2, (radius + half_width) ** 2 + front * front
    paths, hits = np.nonzero((distance > inner[:, None]) & (distance < outer[:, None]))
    driven = radius[paths] * np.arctan2(x[hits], -aside[paths, hits]) - front
    free = np.full(len(curvatures), FAR)
    is_ahead = driven > -front
    np.minimum.at(free, paths[is_ahead], driven[is_ahead])
    return free


def seen_from(points: Any, curvature: float, way: float) -> Any:
    """Points [m], shape (m, 2), in the frame of the car after a way [m] on an arc of that curvature [1/m]."""
    turn = curvature * way
    if abs(turn) < 1e-6:
        return points - np.array([way, 0.0])
    c, s = math.cos(turn), math.sin(turn)
    moved = points - np.array([s / curvature, (1.0 - c) / curvature])
    return moved @ np.array([[c, -s], [s, c]])


def safe_speed(distance: float, braking: float) -> float:
    """Greatest speed [m/s] from which a car stops within a distance [m]: v^2 / (2 braking) = distance."""
    return math.sqrt(2.0 * braking * max(distance, 0.0))


# -- the driver --------------------------------------------------------------------------------------------------------


class CarCommand(NamedTuple):
    """What the car is told: speed [m/s], steering angle [rad], left positive, and both as shares, -1 to 1."""

    speed: float
    angle: float
    throttle: float
    steering: float
    stop: str
    """Why the car is stopped; '': it drives."""


@dataclass
class Totals:
    """What is counted during a drive, for its summary."""

    steps: int = 0
    driven: float = 0.0
    stops: dict[str, int] = field(default_factory=dict)
    scan_age: list[float] = field(default_factory=list)
    compute: list[float] = field(default_factory=list)


class CarDriver:
    """Drives one car: give it each message with its `on_` methods, and `tick` it; both return what to command.

    `on_scan` makes the steps of the policy. `tick` must be called at least each quarter of `scan_timeout`: it stops the
    car when something is missing, and makes the steps between the scans of a slow scanner. All times are those of the
    clock of the node [s].
    """

    def __init__(self, settings: CarSettings, folder: Path, log: CarLog | None = None) -> None:
        """`folder` has the file of the policy. Raises `CarError`."""
        self.settings = settings
        bearings = [settings.first_degree + (k + 0.5) * settings.sector_degrees for k in range(settings.sectors)]
        self._names = [*READINGS, *(f"range_{bearing:g}" for bearing in bearings)]
        self.policy = CarPolicy(Path(folder) / settings.policy, self._names)
        self.log = log
        self.totals = Totals()
        self.cap = settings.speed_cap
        """The greatest speed now [m/s]."""
        self._used_cap = self.cap
        self.problem = ""
        """Why the last scan could not be used; '': it could."""
        self.waits_for = "no scan"
        """What is missing before the first drive; '': nothing."""
        self.notes: list[str] = []
        """What a person should know about the scanner; the node prints it."""
        self._sectors: Sectors | None = None
        self._ranges: Any = None
        self._points: Any = np.empty((0, 2))
        self._last_ranges: Any = None
        self._same_since = math.nan
        self._slow_scans = 0
        self._scan_time = self._scan_stamp = -math.inf
        self._least_delay = math.inf
        self._clock_offset = math.inf
        self._step_time = -math.inf
        self._due = -math.inf
        self._speed = self._side_speed = self._yaw_rate = 0.0
        self._speed_time = self._rate_time = -math.inf
        self._encoders: dict[int, tuple[float, float]] = {}
        self._encoder_speed: dict[int, float] = {}
        self._angle = self._target = 0.0
        self._has_steering = False
        self._pose = (math.nan, math.nan, math.nan, math.nan)
        self._dead_man_time = -math.inf
        self._drives_since = math.nan
        self._is_at_wall = self._has_driven = False
        self._braked = math.inf
        self._last = CarCommand(0.0, 0.0, 0.0, 0.0, "no scan")
        self._began = wall.perf_counter()
        self._logged = math.nan

    # -- what the car measures -----------------------------------------------------------------------------------------

    def on_scan(self, now: float, stamp: float, layout: ScanLayout, ranges: Any) -> CarCommand | None:
        """A scan with its stamp [s] and ranges [m]; the command that follows, if a step of the policy is due."""
        self._began = wall.perf_counter()
        try:
            self._take_scan(now, stamp, layout, ranges)
        except CarError as error:
            self.problem = str(error)
            return None
        period = self.settings.period
        if now < self._due - 0.25 * period and now >= self._step_time:  # a faster scanner than that of the training
            return None
        self._due = max(self._due, now - period) + period if math.isfinite(self._due) else now + period
        return self._step(now)

    def _take_scan(self, now: float, stamp: float, layout: ScanLayout, ranges: Any) -> None:
        if self._sectors is None or self._sectors.layout != layout:
            self._sectors = Sectors(layout, self.settings)
            if self._sectors.unseen:
                self.notes.append(
                    f"the scanner does not see {self._sectors.unseen} of the {self.settings.sectors} sectors of the "
                    f"policy: they have the range of the nearest sector"
                )
        values = np.asarray(ranges, np.float64)
        if values.shape != (layout.rays,):
            raise CarError(f"the scan has {values.size} ranges, and its angles are those of {layout.rays}")
        if stamp <= self._scan_stamp and now >= self._scan_time:
            raise CarError("the scan has the stamp of an earlier one: it is not new")
        if now <= 0.0:
            raise CarError("the clock of the node has not begun: with use_sim_time, it waits for /clock")
        offset = now - wall.monotonic()
        if abs(offset - self._clock_offset) > JUMP or now < self._scan_time:  # the clock was set
            self._least_delay = math.inf
        self._clock_offset = offset
        self._least_delay = min(self._least_delay, now - stamp)
        if now - stamp - self._least_delay > self.settings.scan_timeout:
            raise CarError(f"the scan is {now - stamp - self._least_delay:.2f} s later than others: it is too old")
        if (share := float(np.mean(self._sectors.is_invalid(values)))) > MOST_UNSEEN:
            raise CarError(f"{100 * share:.0f} % of the rays of the scan have no measurement")
        is_same = self._last_ranges is not None and np.array_equal(values, self._last_ranges)
        if not is_same or abs(self._speed) < STANDSTILL or math.isnan(self._same_since):
            self._same_since = now
        if now - self._same_since > self.settings.scan_timeout:
            raise CarError("the car drives, and each scan has the same numbers: the scanner hangs")
        interval = now - self._scan_time
        self._slow_scans = self._slow_scans + 1 if USABLE * self.settings.scan_timeout < interval < 1.0 else 0
        if self._slow_scans == FEW:
            most = USABLE * self.settings.scan_timeout
            self.notes.append(
                f"the scans are {interval:.3f} s apart, and the car stops after {most:.3f} s without one: use a faster "
                f"scanner, or set scan_timeout"
            )
        self._last_ranges = values
        self._ranges, self._points = self._sectors(values)
        self._scan_time, self._scan_stamp, self.problem = now, stamp, ""

    def on_speed(self, now: float, speed: float, side_speed: float = 0.0) -> None:
        """Forward speed and speed to the left [m/s]."""
        if math.isfinite(speed) and math.isfinite(side_speed):
            self._speed, self._side_speed, self._speed_time = float(speed), float(side_speed), now

    def on_encoder(self, now: float, angle: float, wheel: int = 0) -> None:
        """Angle of a wheel [rad], which counts on; `wheel`: its number."""
        last = self._encoders.get(wheel)
        if not math.isfinite(angle) or (last is not None and 0.0 <= now - last[0] < 1e-4):
            return
        self._encoders[wheel] = now, angle
        if last is not None and now > last[0]:
            self._encoder_speed[wheel] = self.settings.wheel_radius * (angle - last[1]) / (now - last[0])
            self.on_speed(now, sum(self._encoder_speed.values()) / len(self._encoder_speed))

    def on_yaw_rate(self, now: float, rate: float) -> None:
        """Yaw rate [rad/s], left positive."""
        if math.isfinite(rate):
            self._yaw_rate, self._rate_time = float(rate), now

    def on_steering(self, angle: float) -> None:
        """Measured steering angle [rad], left positive."""
        if math.isfinite(angle):
            self._angle, self._has_steering = float(angle), True

    def on_pose(self, stamp: float, x: float, y: float, yaw: float) -> None:
        """Pose for the log [m, m, rad], and when it was measured [s]."""
        self._pose = (float(stamp), float(x), float(y), float(yaw))

    def on_dead_man(self, now: float, is_pressed: bool) -> None:
        """Whether the dead man's button is pressed."""
        self._dead_man_time = now if is_pressed else -math.inf

    # -- what it is told -----------------------------------------------------------------------------------------------

    def tick(self, now: float) -> CarCommand | None:
        """The command between scans: a stop, or a step of the policy with the last scan; None: nothing new.

        Nothing is commanded before the car has driven for the first time: a person may drive it until then.
        """
        self._began = wall.perf_counter()
        if self._missing(now):
            return self._step(now)
        if now - self._step_time >= 1.5 * self.settings.period:
            self._due = now + self.settings.period
            return self._step(now)
        return None

    def stopped(self, now: float, reason: str) -> CarCommand | None:
        """The command that stops the car; None if it has not driven."""
        return self._log(now, self._stop(reason), (0.0, 0.0)) if self._has_driven else None

    def _missing(self, now: float) -> str:
        """What is missing for driving; '': nothing. A clock that jumped back makes everything old."""
        settings = self.settings
        if not 0.0 <= now - self._scan_time + 1e-9 <= USABLE * settings.scan_timeout:
            return "no scan"
        if not 0.0 <= now - self._speed_time + 1e-9 <= settings.speed_timeout:
            return "no speed"
        if not 0.0 <= now - self._rate_time + 1e-9 <= settings.speed_timeout:
            return "no yaw rate"
        if settings.dead_man_topic and not 0.0 <= now - self._dead_man_time + 1e-9 <= settings.dead_man_timeout:
            return "dead man"
        return ""

    def _step(self, now: float) -> CarCommand | None:
        settings = self.settings
        duration = min(max(now - self._step_time, 0.0), 0.1)
        if not self._has_steering:
            self._angle = _turned(self._angle, self._target, settings, duration)
        self._step_time = now
        self.waits_for = reason = self._missing(now)
        if reason:
            self.policy.begin()
            return self.stopped(now, reason)
        self._has_driven = True
        readings = np.array(
            [
                self._speed,
                self._side_speed,
                self._yaw_rate,
                self._angle,
                self._speed,
                min(max(now - self._scan_time, 0.0), 1.0),
                *self._ranges,
            ]
        )
        self._used_cap = self.cap
        top = self.policy.top_throttle * settings.full_speed
        throttle, steering = self.policy.act(readings, min(max(top / self.cap, 1.0), 10.0))
        speed = min(max(throttle * settings.full_speed, 0.0), self.cap)
        angle = min(max(steering * settings.full_angle, -settings.steering_limit), settings.steering_limit)
        limit, wanted, path, free = self._safe_path(angle)
        drive = self._driven(speed, angle)
        if self._is_blocked(limit, wanted):
            self._braked = self._brake(free, duration)
            if self._braked <= CREEP and limit > CREEP:  # it stands, or nearly: it leaves the wall slowly
                self._braked = CREEP
            aside = angle if path is None else math.atan(settings.wheelbase * path)
            drive = self._driven(self._braked, aside)._replace(stop="wall")
        elif limit < speed:
            drive = self._driven(limit, angle)
        self._raise_cap(now, drive)
        self.totals.driven += abs(self._speed) * duration
        return self._log(now, drive, (throttle, steering))

    def _safe_path(self, angle: float) -> tuple[float, float, float | None, float]:
        """Speed from which the car can stop before a wall on the best path, and on that of the wanted angle [m/s].

        The other two values are the curvature of the path to take [1/m], None: that of the wanted angle, and how far it
        is free [m]. The car is safe while there is one path on which it can stop: that of the wanted angle, or another
        one that its tyres allow. The angle stays as it is wanted unless another path is clearly better: a policy that
        turns into a curve must not be kept straight.
        """
        settings = self.settings
        speed = max(abs(self._speed), 0.5)
        most = min(math.tan(settings.steering_limit) / settings.wheelbase, settings.lateral / (speed * speed))
        chosen = math.tan(angle) / settings.wheelbase
        curvatures = np.r_[min(max(chosen, -most), most), most * ARCS]
        width = settings.half_width + settings.side_margin
        # where the car is when it begins to obey, on its present path
        present = min(max(self._yaw_rate / speed, -most), most)
        way = abs(self._speed) * settings.latency
        ahead = free_distances(self._points, np.array([present]), front=settings.front, half_width=settings.half_width)
        if ahead[0] < way:
            return 0.0, 0.0, None, 0.0
        points = seen_from(self._points, present, way)
        free = free_distances(points, curvatures, front=settings.front, half_width=width) - settings.margin
        best = int(np.argmax(free - 1e-3 * np.abs(curvatures - chosen)))
        limits = [safe_speed(float(free[path]), settings.braking) for path in (best, 0)]
        is_better = free[best] > max(CLEARLY * free[0], free[0] + settings.margin)
        taken = best if is_better else 0
        return limits[0], limits[1], float(curvatures[best]) if is_better else None, float(free[taken])

    def _brake(self, free: float, duration: float) -> float:
        """The speed that brakes the car without locking its wheels, which could not steer [m/s]."""
        speed = min(self._braked, max(self._speed, 0.0))
        needed = speed * speed / (2.0 * max(free, 0.02))
        return max(speed - max(self.settings.braking, needed) * duration, 0.0)

    def _is_blocked(self, limit: float, wanted: float) -> bool:
        """Whether the car must brake now; `limit` and `wanted` are the first two values of `_safe_path`.

        Once it brakes, it goes on until it is clearly slower than it may be on the path that the policy wants.
        """
        speed = max(self._speed, 0.0)
        if self._is_at_wall:
            self._is_at_wall = speed > 0.7 * wanted or wanted < 0.3
        else:
            self._is_at_wall = speed > limit or limit <= 0.0
            if self._is_at_wall:
                self._braked = math.inf
                self.cap = max(self.cap - self.settings.cap_step, min(self.settings.speed_cap, self.cap))
        return self._is_at_wall

    def _raise_cap(self, now: float, drive: CarCommand) -> None:
        if drive.stop or math.isnan(self._drives_since) or now < self._drives_since:
            self._drives_since = math.nan if drive.stop else now
        elif now - self._drives_since >= self.settings.cap_interval:
            self.cap = min(self.cap + self.settings.cap_step, self.settings.cap_most)
            self._drives_since = now

    def _driven(self, speed: float, angle: float) -> CarCommand:
        settings = self.settings
        share = speed / settings.car_full_speed, angle / settings.steering_limit
        self._target = angle
        return CarCommand(speed, angle, min(share[0], 1.0), min(max(share[1], -1.0), 1.0), "")

    def _stop(self, reason: str) -> CarCommand:
        """The command that stops the car; the steering stays."""
        self._drives_since = math.nan
        return self._driven(0.0, self._target)._replace(stop=reason)

    def _log(self, now: float, drive: CarCommand, policy: tuple[float, float]) -> CarCommand:
        totals, age = self.totals, now - self._scan_stamp
        compute = wall.perf_counter() - self._began
        totals.steps += 1
        if drive.stop and drive.stop != self._last.stop:
            totals.stops[drive.stop] = totals.stops.get(drive.stop, 0) + 1
        if not drive.stop and len(totals.compute) < 10**6:
            totals.scan_age.append(age)
            totals.compute.append(compute)
        self._last = drive
        if self.log is not None and now != self._logged:
            self._logged = now
            numbers = [now, *self._pose_at(now), self._speed, drive.throttle, drive.steering, self._yaw_rate]
            numbers += [drive.speed, drive.angle, *policy, self._angle, self._used_cap, age, compute]
            self.log.write(numbers, drive.stop, None if self._ranges is None else self._ranges)
        return drive

    def _pose_at(self, now: float) -> tuple[float, float, float]:
        """The pose for the log, which is moved from its time to this one with the speed and the yaw rate."""
        stamp, x, y, yaw = self._pose
        late = min(max(now - stamp, 0.0), 0.2)
        middle = yaw + 0.5 * late * self._yaw_rate
        way = late * self._speed
        return x + way * math.cos(middle), y + way * math.sin(middle), yaw + late * self._yaw_rate

    def summary(self) -> dict[str, Any]:
        """What the drive was like: steps, distance, stops by reason, latency and time of computation [s]."""
        totals = self.totals
        return {
            "steps": totals.steps,
            "distance": round(totals.driven, 2),
            "speed_cap": self.cap,
            "stops": totals.stops,
            "seconds_from_scan_to_command": _spread(totals.scan_age),
            "seconds_of_computing": _spread(totals.compute),
        }


def _spread(values: Sequence[float]) -> dict[str, float]:
    if not values:
        return {}
    median, most, greatest = np.percentile(values, [50, 95, 100])
    return {"median": round(float(median), 6), "95 %": round(float(most), 6), "greatest": round(float(greatest), 6)}


def _turned(angle: float, target: float, settings: CarSettings, duration: float) -> float:
    """The steering angle [rad] after a time [s], by the limit of its speed."""
    step = settings.steering_rate * duration
    if settings.steering_unwinds_at_once and (target < angle) == (angle + target > 0.0):
        return target
    return angle + min(max(target - angle, -step), step)


# -- the log -----------------------------------------------------------------------------------------------------------

LOG_COLUMNS = (
    "time",
    "x",
    "y",
    "yaw",
    "wheel_speed",
    "throttle",
    "steering",
    "yaw_rate",
    "command_speed",
    "command_angle",
    "policy_throttle",
    "policy_steering",
    "policy_angle",
    "speed_cap",
    "scan_age",
    "compute",
)
"""Columns of a log that are numbers; `stop` and the ranges of the sectors follow. SI units, rad.

`wheel_speed` is what the car measures, and is not called speed: an identification then takes the speed from the poses,
which the slip of the wheels does not change. `throttle` and `steering`, -1 to 1: as the car was told. `policy_`: before
the safety layer, and the angle that the policy read. `scan_age`: from the stamp of a scan to the command."""


class CarLog:
    """A log of a drive as a CSV file with a header, which `autodrive identify` and `autodrive parity` read."""

    def __init__(self, file: Path, settings: CarSettings) -> None:
        """Raises `CarError` if the file cannot be written."""
        bearings = [settings.first_degree + (k + 0.5) * settings.sector_degrees for k in range(settings.sectors)]
        self._sectors = settings.sectors
        self.file = Path(file)
        try:
            self._stream = self.file.open("w", newline="", encoding="utf-8")
        except OSError as error:
            raise CarError(f"{file} cannot be written: {error}") from None
        self._writer = csv.writer(self._stream)
        self._writer.writerow([*LOG_COLUMNS, "stop", *(f"range_{bearing:g}" for bearing in bearings)])
        self._flushed = wall.monotonic()

    @classmethod
    def of(cls, settings: CarSettings, folder: Path) -> CarLog | None:
        """The log of the settings, in a folder; None: none is wanted."""
        if not settings.log:
            return None
        return cls(Path(folder) / settings.log.replace("{time}", wall.strftime("%Y-%m-%d_%H-%M-%S")), settings)

    def write(self, numbers: Sequence[float], stop: str, ranges: Any) -> None:
        """Write a row; a number that is not known is left out."""
        cells = ["" if math.isnan(number) or math.isinf(number) else f"{number:.6g}" for number in numbers]
        cells[0] = f"{numbers[0]:.6f}"
        seen = [""] * self._sectors if ranges is None else [f"{distance:.4g}" for distance in ranges.tolist()]
        self._writer.writerow([*cells, stop, *seen])
        if wall.monotonic() - self._flushed > 1.0:
            self._stream.flush()
            self._flushed = wall.monotonic()

    def close(self, summary: dict[str, Any]) -> None:
        """Close the file, and write the summary of the drive beside it."""
        self._stream.close()
        self.file.with_suffix(".json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")


# -- messages of ROS, which have the same fields in ROS 1 and ROS 2 ----------------------------------------------------


class CarTopic(NamedTuple):
    """A topic that a node subscribes: name, package and type of its messages, and what takes them."""

    name: str
    package: str
    type: str
    take: Callable[[float, Any], CarCommand | None]
    """Gets the time [s] and the message."""


def stamp_of(message: Any) -> float:
    """Time of the header of a message [s], of ROS 1 or ROS 2."""
    stamp = message.header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec if hasattr(stamp, "nanosec") else stamp.secs + 1e-9 * stamp.nsecs


def yaw_of(orientation: Any) -> float:
    """Yaw of a geometry_msgs/Quaternion [rad]."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def topics(driver: CarDriver) -> list[CarTopic]:
    """What a node subscribes."""
    settings = driver.settings
    has_speed = bool(settings.speed_topic or settings.encoder_topics)

    def take_scan(now: float, message: Any) -> CarCommand | None:
        layout = ScanLayout(
            message.angle_min, message.angle_increment, len(message.ranges), message.range_min, message.range_max
        )
        return driver.on_scan(now, stamp_of(message), layout, message.ranges)

    def take_odometry(now: float, message: Any) -> None:
        twist = message.twist.twist
        if not has_speed:
            driver.on_speed(now, twist.linear.x, twist.linear.y)
        if not settings.imu_topic:
            driver.on_yaw_rate(now, twist.angular.z)
        if not settings.pose_topic:
            take_pose(now, message)

    def take_pose(now: float, message: Any) -> None:
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        driver.on_pose(stamp_of(message), pose.position.x, pose.position.y, yaw_of(pose.orientation))

    def take_encoder(wheel: int) -> Callable[[float, Any], None]:
        return lambda now, message: driver.on_encoder(now, message.position[0], wheel)

    def take_dead_man(now: float, message: Any) -> None:
        if settings.dead_man_type == "Bool":
            driver.on_dead_man(now, bool(message.data))
        else:
            buttons = message.buttons
            driver.on_dead_man(now, settings.dead_man_button < len(buttons) and bool(buttons[settings.dead_man_button]))

    wanted = [
        CarTopic(settings.scan_topic, "sensor_msgs", "LaserScan", take_scan),
        CarTopic(settings.odometry_topic, "nav_msgs", "Odometry", take_odometry),
        CarTopic(settings.speed_topic, "std_msgs", "Float32", lambda now, message: driver.on_speed(now, message.data)),
        CarTopic(
            settings.imu_topic,
            "sensor_msgs",
            "Imu",
            lambda now, message: driver.on_yaw_rate(now, message.angular_velocity.z),
        ),
        CarTopic(settings.steering_topic, "std_msgs", "Float32", lambda _, message: driver.on_steering(message.data)),
        CarTopic(settings.pose_topic, POSES[settings.pose_type], settings.pose_type, take_pose),
        CarTopic(
            settings.dead_man_topic,
            {"Bool": "std_msgs", "Joy": "sensor_msgs"}[settings.dead_man_type],
            settings.dead_man_type,
            take_dead_man,
        ),
        *(
            CarTopic(name, "sensor_msgs", "JointState", take_encoder(wheel))
            for wheel, name in enumerate(settings.encoder_topics)
        ),
    ]
    return [topic for topic in wanted if topic.name]
