"""The signals of a vehicle: one table of names, types, units, frames and rates, and of how each signal is shown.

A `Channel` is a field of `VehicleFrame`: readings that are sampled together. A `Signal` is one quantity of it. HUD
rows, plots, ROS topics and the tables of the documentation derive from `CHANNELS`; log files, CSV columns and
observations can use `Channel.read`, `Signal.read`, `Signal.dtype`, `Signal.shape` and `Signal.columns`.
"""

from __future__ import annotations

import enum
import types
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from autodrive.base.arrays import element_type
from autodrive.protocol.messages import WHEEL_NAMES, VehicleFrame

EACH_TICK = ""
"""Rate of a signal that has a new value in each Frame."""

Format: TypeAlias = Literal["number", "turn", "magnitude", "vector", "list", "mode", "gear", "beam", "lap", "time"]
"""How the HUD writes a signal: one number, a number with an arrow to its side (left is positive), a number without its
sign, three columns, integers in brackets, 'Autonomous' or 'Manual', 'D' or 'R', the range at the bearing that the user
sets, completed laps of all, minutes and seconds to the millisecond."""

Reduction: TypeAlias = Literal["element", "nearest", "beam"]
"""How a plot makes one number of a signal: by taking an element, the least range, or the range at the bearing that the
user sets."""

RosQos: TypeAlias = Literal["sensor", "state", "latched", "clock", "tf", "command", "league"]
"""QoS class of a ROS topic: 'sensor' and 'clock' keep few messages, 'latched' keeps the last one for late
subscribers, 'command' is that of subscriptions, 'league' that of all topics in the profile of the RoboRacer league."""

League: TypeAlias = Literal["", "allowed", "restricted"]
"""Whether a topic is part of the interface of the RoboRacer league: no; yes; yes, but switched off at race time."""


@dataclass(frozen=True)
class HudRow:
    """A row of the HUD. The value shown is `scale` times the signal, in `unit` (by default that of the signal).

    The page lists rows of the format 'vector' and of the section 'sensors' as they come, and places the others.
    """

    id: str
    label: str
    title: str = ""
    """Tooltip."""
    format: Format = "number"
    unit: str | None = None
    scale: float = 1.0
    decimals: int = 2
    section: Literal["", "sensors"] = ""


@dataclass(frozen=True)
class Plot:
    """A curve in the plots of the HUD; unit and scale as in `HudRow`."""

    id: str
    group: str
    label: str
    span: float
    """Least height of the axis, so that noise does not fill it."""
    element: int = 0
    reduction: Reduction = "element"
    unit: str | None = None
    scale: float = 1.0


@dataclass(frozen=True)
class RosTopic:
    """A published ROS topic.

    `name` is relative unless it begins with a slash; in a channel, it is relative to the name of the vehicle. `text`
    describes the content.
    """

    name: str
    type: str
    text: str
    qos: RosQos = "state"
    league: League = ""
    signal: str = ""
    """Name of the signal that a message contains as a number; none for other messages."""


@dataclass(frozen=True)
class Signal:
    """One quantity of a vehicle."""

    name: str
    """Path in a `VehicleFrame`, for example 'imu.angular_velocity'."""
    text: str
    """What it is, for the documentation."""
    unit: str = ""
    frame: str = ""
    """Coordinate frame of the values: 'map', 'base_link' (the vehicle frame) or that of the sensor."""
    elements: tuple[str, ...] = ()
    """Names of the elements of an array; none for a scalar and for an array without a fixed size."""
    size: str = ""
    """Name of the size of an array whose size depends on the Spec, for example 'rays'."""
    hud: HudRow | None = None
    plots: tuple[Plot, ...] = ()

    @property
    def shape(self) -> tuple[int | str, ...]:
        """Shape of the value: () for a scalar; a str stands for a size that depends on the Spec."""
        if self.size:
            return (self.size,)
        return (len(self.elements),) if self.elements else ()

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the value or of its elements."""
        hint: Any = VehicleFrame
        for field in self.name.split("."):
            hint = _required(get_type_hints(_required(hint)).get(field, float))
        hint = element_type(hint) or hint
        return np.dtype(np.int64 if isinstance(hint, type) and issubclass(hint, enum.IntEnum) else hint)

    @property
    def is_optional(self) -> bool:
        """Whether only some vehicles have this signal."""
        field = next(field for field in msgspec.structs.fields(VehicleFrame) if field.name == self.name.split(".")[0])
        return field.default is None

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of a table: one for each element. None for an array without a fixed size."""
        if self.size:
            return ()
        return tuple(f"{self.name}.{element}" for element in self.elements) or (self.name,)

    def read(self, vehicle: VehicleFrame) -> Any:
        """The value in a Frame of the vehicle; None if the vehicle has no reading of it."""
        value: Any = vehicle
        for field in self.name.split("."):
            value = None if value is None else getattr(value, field)
        return value


@dataclass(frozen=True)
class OwnSignal(Signal):
    """The values of a sensor of the user; `name` is 'own.' and the name of the sensor."""

    @classmethod
    def of(cls, sensor: str, columns: Sequence[str]) -> OwnSignal:
        """The columns are its elements; it has a unit if that of all columns is the same."""
        units = {column.partition("[")[2].rstrip("]") for column in columns}
        elements = tuple(column.partition("[")[0].strip() for column in columns)
        name = f"own.{sensor}"
        return cls(name, f"values of the sensor '{sensor}'", units.pop() if len(units) == 1 else "", "", elements)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the values of a sensor of the user: all are numbers."""
        return np.dtype(np.float64)

    @property
    def is_optional(self) -> bool:
        """Whether only some vehicles have the signal: always, for a sensor of the user."""
        return True

    def read(self, vehicle: VehicleFrame) -> Any:
        """The values in a Frame of the vehicle, shape (n_column,); None without a reading."""
        reading = vehicle.own.get(self.name.removeprefix("own."))
        return None if reading is None else reading.values


@dataclass(frozen=True)
class Channel:
    """A field of `VehicleFrame`, with its signals."""

    name: str
    """Name of the field."""
    signals: tuple[Signal, ...]
    rate: str = EACH_TICK
    """Where the vehicle's Spec has the sampling rate; `EACH_TICK` if the value is new in each Frame."""
    topics: tuple[RosTopic, ...] = ()

    def read(self, vehicle: VehicleFrame) -> Any:
        """The value in a Frame of the vehicle; None if the vehicle has no such sensor or it has not sampled yet."""
        return getattr(vehicle, self.name)


XYZ = ("x", "y", "z")
WXYZ = ("w", "x", "y", "z")


def _channel(*signals: Signal, rate: str = EACH_TICK, topics: tuple[RosTopic, ...] = ()) -> Channel:
    """The channel of signals, whose names begin with its name."""
    return Channel(signals[0].name.partition(".")[0], signals, rate, topics)


def _plots(group: str, ids: Sequence[str], labels: Sequence[str], *spans: float) -> tuple[Plot, ...]:
    """A curve for each element."""
    return tuple(
        Plot(id_, group, label, span, element=i)
        for i, (id_, label, span) in enumerate(zip(ids, labels, spans, strict=True))
    )


def _of_wheels(
    name: str, text: str, unit: str = "", plot: tuple[str, str, str, float] | None = None, hud: HudRow | None = None
) -> Signal:
    """A signal with an element for each wheel; `plot`: id, group, label and span of its curves."""
    plots: tuple[Plot, ...] = ()
    if plot:
        id_, group, label, span = plot
        labels = [f"{label} {wheel}" for wheel in ("FL", "FR", "RL", "RR")]
        plots = _plots(group, [f"{id_}-{i}" for i in range(4)], labels, *(4 * [span]))
    return Signal(f"wheels.{name}", text, unit, elements=WHEEL_NAMES, hud=hud, plots=plots)


CHANNELS: tuple[Channel, ...] = (
    _channel(
        Signal("pose.position", "true position of the rear axle centre", "m", "map", XYZ),
        Signal("pose.orientation", "true orientation, quaternion", "", "map", WXYZ),
    ),
    _channel(
        Signal(
            "velocity",
            "true velocity of the rear axle centre",
            "m/s",
            "base_link",
            XYZ,
            hud=HudRow("speed", "Speed", "Magnitude of the forward velocity at the rear axle centre", "magnitude"),
            plots=_plots("Vehicle", ("speed", "side-speed"), ("Speed", "Side speed"), 0.1, 0.1),
        ),
        topics=(RosTopic("speed", "std_msgs/Float32", "absolute value of the forward speed [m/s]"),),
    ),
    _channel(Signal("angular_velocity", "true angular velocity", "rad/s", "base_link", XYZ)),
    _channel(
        Signal(
            "throttle",
            "throttle feedback, -1 to 1",
            hud=HudRow(
                "throttle",
                "Throttle",
                "Magnitude; the bar extends to the left in reverse",
                "magnitude",
                "%",
                100.0,
                decimals=0,
            ),
            plots=(Plot("throttle", "Vehicle", "Throttle", 20.0, unit="%", scale=100.0),),
        ),
        topics=(RosTopic("throttle", "std_msgs/Float32", "throttle feedback, -1 to 1", league="allowed"),),
    ),
    _channel(
        Signal(
            "steering",
            "angle of the steering actuator, left turns positive",
            "rad",
            hud=HudRow(
                "steering",
                "Steering",
                "Left is positive, as in messages; the arrow and the bar point to the side of the turn",
                "turn",
            ),
            plots=(Plot("steering", "Vehicle", "Steering", 0.2),),
        ),
        # sign: 'left' or 'right'; it depends on the devkit profile, and so does the name of the topic
        topics=(RosTopic("steering", "std_msgs/Float32", "steering angle [rad], positive {sign}", league="allowed"),),
    ),
    _channel(
        Signal("encoders.time", "time of the sample", "s"),
        Signal(
            "encoders.ticks",
            "counts of the rear encoders since the reset",
            elements=("left", "right"),
            hud=HudRow(
                "encoders", "Encoder Ticks", "Ticks of the left and right rear wheel", "list", section="sensors"
            ),
        ),
        Signal("encoders.angles", "angles of the rear encoders since the reset", "rad", elements=("left", "right")),
        rate="sensors.encoders.rate",
        topics=tuple(
            RosTopic(
                f"{side}_encoder", "sensor_msgs/JointState", f"angle of the rear {side} wheel [rad]", league="allowed"
            )
            for side in ("left", "right")
        ),
    ),
    _channel(
        Signal("ips.time", "time of the sample", "s"),
        Signal(
            "ips.position",
            "position of the rear axle centre by the indoor positioning system",
            "m",
            "map",
            XYZ,
            hud=HudRow("position", "Position", "IPS: x, y, z of the rear axle centre in the map", "vector"),
            plots=_plots("IMU and IPS", XYZ, ("Position x", "Position y", "Position z"), 0.2, 0.2, 0.02),
        ),
        rate="sensors.ips.rate",
        topics=(RosTopic("ips", "geometry_msgs/Point", "position in map [m]", league="restricted"),),
    ),
    _channel(
        Signal("imu.time", "time of the sample", "s"),
        Signal("imu.orientation", "orientation of the IMU, quaternion", "", "map", WXYZ),
        Signal(
            "imu.euler",
            "roll, pitch, yaw of the IMU, -π to π",
            "rad",
            "map",
            ("roll", "pitch", "yaw"),
            hud=HudRow(
                "orientation",
                "Orientation",
                "IMU: roll, pitch, yaw in (-π, π]; x forward, y left, z up",
                "vector",
            ),
            plots=_plots("IMU and IPS", ("roll", "pitch", "yaw"), ("Roll", "Pitch", "Yaw"), 0.02, 0.02, 0.2),
        ),
        Signal(
            "imu.angular_velocity",
            "angular velocity in the axes of the IMU",
            "rad/s",
            "imu",
            XYZ,
            hud=HudRow(
                "angular-velocity",
                "Angular velocity",
                "IMU: about x, y, z of the sensor; left turns are positive",
                "vector",
            ),
            plots=_plots(
                "IMU and IPS",
                ("roll-rate", "pitch-rate", "yaw-rate"),
                ("Roll rate", "Pitch rate", "Yaw rate"),
                *(0.2, 0.2, 0.2),
            ),
        ),
        Signal(
            "imu.linear_acceleration",
            "acceleration in the axes of the IMU, without gravity unless the Spec includes gravity",
            "m/s²",
            "imu",
            XYZ,
            hud=HudRow(
                "linear-acceleration",
                "Linear acceleration",
                "IMU: along x, y, z of the sensor, without gravity unless the Spec of the vehicle includes gravity",
                "vector",
            ),
            plots=_plots(
                "IMU and IPS",
                [f"acceleration-{axis}" for axis in XYZ],
                [f"Accel. {axis}" for axis in XYZ],
                *(0.5, 0.5, 0.5),
            ),
        ),
        rate="sensors.imu.rate",
        topics=(
            RosTopic(
                "imu",
                "sensor_msgs/Imu",
                "orientation, angular velocity, acceleration without gravity",
                "sensor",
                "allowed",
            ),
            RosTopic(
                "imu/data", "sensor_msgs/Imu", "same as imu, but with gravity: +g upward at rest (REP 145)", "sensor"
            ),
            RosTopic("imu/data_raw", "sensor_msgs/Imu", "same as imu/data, but without the orientation", "sensor"),
        ),
    ),
    _channel(
        Signal("lidar.time", "time of the last ray of the scan", "s"),
        Signal(
            "lidar.ranges",
            "ranges; REP 117: -inf is nearer than range_min, +inf is farther than range_max",
            "m",
            "lidar",
            size="rays",
            hud=HudRow(
                "lidar",
                "LIDAR Measurement",
                'Range at the bearing below; "inf" without a return, a dash outside the field of view',
                "beam",
            ),
            plots=(
                Plot("nearest", "LIDAR", "Nearest", 0.2, reduction="nearest"),
                Plot("measurement", "LIDAR", "Measurement", 0.2, reduction="beam"),
            ),
        ),
        Signal("lidar.intensities", "intensities of the returns", "", "lidar", size="rays"),
        rate="sensors.lidar.rate",
        topics=(
            RosTopic(
                "lidar",
                "sensor_msgs/LaserScan",
                "scan; a scan of 360 degrees starts with the ray straight ahead",
                "sensor",
                "allowed",
            ),
            RosTopic("scan", "sensor_msgs/LaserScan", "same as lidar, with the name of REP 138", "sensor"),
        ),
    ),
    _channel(
        Signal("range.time", "time of the sample", "s"),
        Signal(
            "range.range",
            "distance to the nearest thing in the cone; REP 117: -inf is nearer than range_min, +inf is farther "
            "than range_max",
            "m",
            "range",
            hud=HudRow("range", "Range", "Nearest thing in the cone of the range sensor", section="sensors"),
            plots=(Plot("range", "Range sensor", "Range", 0.2),),
        ),
        rate="sensors.range.rate",
        topics=(RosTopic("range", "sensor_msgs/Range", "distance to the nearest thing in the cone [m]", "sensor"),),
    ),
    _channel(
        Signal("lights.headlights", "0 off, 1 low beam, 2 high beam"),
        Signal("lights.indicators", "0 off, 1 left, 2 right, 3 hazard"),
        Signal("lights.tail_lights", "0 off, 1 partial, 2 bright"),
        Signal("lights.left_indicator", "whether the left indicator is lit"),
        Signal("lights.right_indicator", "whether the right indicator is lit"),
        Signal("lights.reverse_lights", "whether the reverse lights are lit"),
        topics=(RosTopic("lights", "autodrive_msgs/Lights", "state of the lamps"),),
    ),
    _channel(
        _of_wheels("steering_angle", "true steering angles", "rad"),
        _of_wheels("rotation_angle", "true rotation angles", "rad"),
        _of_wheels("slip_ratio", "true slip ratios", "", ("slip-ratio", "Slip ratio", "Slip ratio", 0.1)),
        _of_wheels("slip_angle", "true slip angles", "rad", ("slip-angle", "Slip angle", "Slip angle", 0.02)),
        _of_wheels("normal_load", "true normal loads", "N", ("load", "Normal load", "Load", 1.0)),
        _of_wheels(
            "angular_velocity",
            "true angular velocities",
            "rad/s",
            ("spin", "Wheel speed", "Wheel", 1.0),
            HudRow("gear", "Gear", "D: drive, R: reverse (from the speed of the rear wheels)", "gear"),
        ),
        _of_wheels(
            "compression",
            "true compression of the suspension, 0 at the target position",
            "m",
            ("compression", "Compression of the suspension", "Spring", 0.001),
        ),
        topics=(RosTopic("wheels", "autodrive_msgs/WheelStates", "true slip, load and compression of the wheels"),),
    ),
    _channel(
        Signal(
            "is_autonomous",
            "driving mode: a script drives (true) or a person (false)",
            hud=HudRow("mode", "Driving Mode", "Manual: a person drives. Autonomous: a script drives", "mode"),
        ),
    ),
    _channel(Signal("is_traffic", "whether the vehicle is a car of the traffic, which drives itself")),
    _channel(
        Signal(
            "collision_count",
            "collisions since the reset",
            hud=HudRow("collisions", "Collisions", decimals=0),
            plots=(Plot("collisions", "Vehicle", "Collisions", 1.0),),
        ),
        topics=(
            RosTopic(
                "collision_count",
                "std_msgs/Int32",
                "collisions; in a race, only collisions that the rules count",
                league="restricted",
                signal="collision_count",
            ),
        ),
    ),
    _channel(
        Signal("race.status", "0 waits for the start, 1 races, 2 finished, 3 disqualified, 4 retired"),
        Signal(
            "race.lap_count",
            "completed laps",
            hud=HudRow("race-lap", "Lap", "Completed laps, and all laps of the race, including warm-up laps", "lap"),
        ),
        Signal("race.lap_total", "laps of the race, including warm-up laps; 0 without limit"),
        Signal(
            "race.lap_time",
            "time in the present lap",
            "s",
            hud=HudRow("race-lap-time", "Lap Time", "Time in the present lap", "time"),
        ),
        Signal(
            "race.last_lap_time",
            "time of the last lap, infinite until a lap is completed",
            "s",
            hud=HudRow("race-last-lap", "Last Lap", "", "time"),
        ),
        Signal(
            "race.best_lap_time",
            "best time of the laps that count, infinite until one of them is completed",
            "s",
            hud=HudRow("race-best-lap", "Best Lap", "Best time of the laps that count", "time"),
        ),
        Signal(
            "race.race_time",
            "time of the completed laps that count, without penalties",
            "s",
            hud=HudRow("race-time", "Race Time", "Time of the laps that count, without penalties", "time"),
        ),
        Signal(
            "race.penalty",
            "sum of the time penalties",
            "s",
            hud=HudRow("race-penalty", "Penalties", "Time that the rules add to the race time", decimals=0),
        ),
        Signal("race.collision_count", "collisions that the rules count"),
        Signal("race.checkpoint", "number of the checkpoint passed last in this lap, 0 before the first one"),
        Signal("race.distance", "distance along the track since the start line", "m"),
        Signal("race.rank", "place in the race, from 1"),
        Signal("race.gap", "time behind the first vehicle", "s"),
        Signal("race.is_wrong_way", "whether the vehicle drives against the direction of the track"),
        topics=tuple(
            RosTopic(name, f"std_msgs/{kind}", f"{text} of a race", league="restricted", signal=f"race.{name}")
            for name, kind, text in (
                ("lap_count", "Int32", "completed laps"),
                ("lap_time", "Float32", "time in the present lap [s]"),
                ("last_lap_time", "Float32", "time of the last lap [s] (inf before the first)"),
                ("best_lap_time", "Float32", "best time of a lap [s] (inf before the first)"),
            )
        ),
    ),
)
"""All channels of a vehicle but its cameras, whose images are messages of their own, and the sensors of the user."""

SIGNALS: tuple[Signal, ...] = tuple(signal for channel in CHANNELS for signal in channel.signals)
SIGNAL_BY_NAME = {signal.name: signal for signal in SIGNALS}
ROS_TOPICS = {topic.name: topic for channel in CHANNELS for topic in channel.topics}


def _required(hint: Any) -> Any:
    """The type without its None."""
    if get_origin(hint) in {Union, types.UnionType}:
        (hint,) = (part for part in get_args(hint) if part is not type(None))
    return hint
