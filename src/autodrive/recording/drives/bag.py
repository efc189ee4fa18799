"""Reads drives from ROS bags: which topics have poses and commands, and what their messages say."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.suggest import suggest
from autodrive.recording.drives.bag_files import BagFile, BagMessage
from autodrive.recording.drives.drive import LogProblem
from autodrive.recording.drives.options import UNITS, LogOptions, TableColumn, mapped_column, pairs, source_name
from autodrive.recording.drives.ros_messages import MessageReader
from autodrive.recording.drives.rows import MAX_ROWS, LogRows
from autodrive.recording.drives.text_lines import naming
from autodrive.recording.errors import RecordingError

GROUPS = {
    "pose": ("x", "y", "yaw"),
    "odometry": ("x", "y", "yaw", "speed", "yaw_rate"),
    "command": ("throttle", "steering"),
    "imu": ("yaw_rate",),
}
"""Names of the option `--topics` that stand for several quantities of one topic."""
EXAMPLE = "pose=/odom or throttle=/cmd:data [m/s]"
SUFFIXES = (".mcap", ".db3")
"""Files in the folder of a bag of ROS 2."""
STAMP_ERROR = 0.5
"""Stamps that differ from the time of recording by more than this [s] are of another clock."""
COMMAND_TOPICS = ("/ackermann_cmd", "/drive")
"""The one of several command topics that is used: that behind the multiplexer of F1TENTH, or that before it."""
_MOCAP = re.compile(r"vicon|mocap|optitrack|vrpn|natnet|qualisys|rigid|motion_capture", re.IGNORECASE)
_NO_POSE = re.compile(r"goal|initial|target|waypoint", re.IGNORECASE)

Values = dict[str, float]
"""Quantity -> value of a message."""


@dataclass
class _Topic:
    """What the messages of a topic say."""

    name: str
    type: str
    received: array[float] = field(default_factory=lambda: array("d"))
    """[s], Unix time."""
    stamps: array[float] = field(default_factory=lambda: array("d"))
    """Time in the message [s]; NaN: none."""
    numbers: array[int] = field(default_factory=lambda: array("q"))
    values: dict[str, array[float]] = field(default_factory=dict[str, "array[float]"])

    def add(self, received: float, stamp: float, number: int, values: Values) -> None:
        count = len(self.received)
        for name, value in values.items():
            if name not in self.values:
                self.values[name] = array("d", [math.nan]) * count
            self.values[name].append(value)
        self.received.append(received)
        self.stamps.append(stamp if stamp > 0.0 else math.nan)
        self.numbers.append(number)
        for column in self.values.values():
            if len(column) == count:
                column.append(math.nan)


@dataclass(frozen=True)
class _QuantitySource:
    """Where a quantity comes from."""

    topic: str
    key: str
    column: TableColumn
    """Scale, constant and unit."""


def is_bag(path: Path) -> bool:
    """Whether a path looks like a bag that is no MCAP file: a folder, `.bag` or `.db3`."""
    return path.is_dir() or path.suffix.lower() in {".bag", ".db3"}


def read_bag(path: Path, options: LogOptions) -> LogRows:
    """The rows of a bag: a file of ROS 1 or ROS 2, or the folder of a bag of ROS 2. Raises `RecordingError`."""
    with naming(path):
        if options.columns:
            raise RecordingError("--columns is for tables; name the topics of a bag with --topics")
        if options.run:
            raise RecordingError("--run is for tables; a bag has one run")
        known = [name for name in UNITS if name not in {"time", "run", "qw", "qx", "qy", "qz", "command_time"}]
        wanted = pairs(options.topics, "--topics", [*GROUPS, *known], EXAMPLE)
        topics = _topics(path, wanted)
        sources = _sources(topics, wanted)
        return _rows(topics, sources, path)


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = [file for file in path.iterdir() if file.suffix.lower() in SUFFIXES]
    if not files:
        packed = [file.name for file in path.iterdir() if file.suffix.lower() == ".zstd"]
        more = f"; decompress {packed[0]} first" if packed else ""
        raise RecordingError(f"the folder is no bag of ROS 2: it has no files .mcap or .db3{more}")
    return sorted(files, key=lambda file: [part.zfill(9) for part in re.split(r"(\d+)", file.name)])


def _topics(path: Path, wanted: Mapping[str, str]) -> dict[str, _Topic]:
    """The topics of known types, and those that are named, by name."""
    names = {source_name(source) for source in wanted.values()}
    fields: dict[str, set[str]] = {}
    for name in names:
        topic, _, path_in_message = name.partition(":")
        fields.setdefault(topic, set()).update(filter(None, [path_in_message]))
    topics: dict[str, _Topic] = {}
    seen: dict[str, str] = {}
    number = 0
    for file in _files(path):
        bag = BagFile(file)
        reader = MessageReader(bag.types, is_cdr=not bag.is_ros1)
        for message in bag.messages():
            number += 1
            if message.type not in READERS and message.topic not in fields:
                continue
            content = reader.read(message.type, message.data)
            for name, stamp, values in _said(message, content, fields.get(message.topic, set())):
                topic = topics.setdefault(name, _Topic(name, message.type))
                topic.add(message.time, stamp, number, values)
            if sum(len(topic.received) for topic in topics.values()) > MAX_ROWS if number % 4096 == 0 else False:
                raise RecordingError(f"the bag has more than {MAX_ROWS:,} messages of these topics: cut it into parts")
        seen |= bag.topics
    for topic in fields:
        if topic not in seen:
            raise RecordingError(f"--topics: the bag has no topic '{topic[:80]}'. {suggest(topic, [*seen])}")
    if not topics:
        raise RecordingError(f"the bag has no topic with poses or commands of a known type. Topics: {_listed(seen)}")
    return topics


def _listed(topics: Mapping[str, str]) -> str:
    return ", ".join(f"{name} ({type_})" for name, type_ in [*topics.items()][:20]) or "none"


def _said(message: BagMessage, content: dict[str, Any], fields: set[str]) -> Iterator[tuple[str, float, Values]]:
    """Name of the topic, stamp and values of a message; one of transforms has some of them."""
    if message.type in {"tf2_msgs/TFMessage", "tf/tfMessage"}:
        for transform in content["transforms"]:
            child = transform["child_frame_id"].lstrip("/")
            yield f"{message.topic}:{child}", _stamp(transform), _transform(transform)
        return
    values = READERS[message.type](content) if message.type in READERS else {}
    for path in fields:
        values[path] = _field(content, path, message)
    yield message.topic, _stamp(content), values


def _stamp(content: Mapping[str, Any]) -> float:
    header = content.get("header")
    return float(header["stamp"]) if header else math.nan


def _field(content: Any, path: str, message: BagMessage) -> float:
    """The number at a path such as 'drive.speed', or 'position.2' in an array."""
    value: Any = content
    for name in path.split("."):
        count = len(value) if isinstance(value, list | np.ndarray) else 0
        if name.isdigit() and int(name) < count:
            value = value[int(name)]
        elif isinstance(value, dict) and name in value:
            value = value[name]
        else:
            known = [*value] if isinstance(value, dict) else []
            more = f"an array of {count}" if count else suggest(name, known)
            raise RecordingError(
                f"--topics: {message.type} of '{message.topic}' has no '{name}' in '{path[:80]}': {more}"
            )
    try:
        return float(value)
    except (TypeError, ValueError):
        raise RecordingError(f"--topics: '{path}' of '{message.topic}' is no number") from None


# -- messages ------------------------------------------------------------------------------------------------------


def _yaw(orientation: Mapping[str, float]) -> float:
    w, x, y, z = (orientation[name] for name in "wxyz")
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) if w or x or y or z else math.nan


def _pose(pose: Mapping[str, Any]) -> Values:
    return {"x": pose["position"]["x"], "y": pose["position"]["y"], "yaw": _yaw(pose["orientation"])}


def _transform(message: Mapping[str, Any]) -> Values:
    moved = message["transform"]
    return {"x": moved["translation"]["x"], "y": moved["translation"]["y"], "yaw": _yaw(moved["rotation"])}


def _odometry(message: Mapping[str, Any]) -> Values:
    twist = message["twist"]["twist"]
    return _pose(message["pose"]["pose"]) | {"speed": twist["linear"]["x"], "yaw_rate": twist["angular"]["z"]}


def _ackermann(message: Mapping[str, Any]) -> Values:
    drive = message.get("drive", message)
    return {"throttle": drive["speed"], "steering": drive["steering_angle"]}


def _joints(message: Mapping[str, Any]) -> Values:
    angles = [
        float(angle)
        for name, angle in zip(message["name"], message["position"], strict=False)
        if "steer" in name.lower()
    ]
    return {"steering_angle": sum(angles) / len(angles)} if angles else {}


READERS: dict[str, Callable[[Mapping[str, Any]], Values]] = {
    "geometry_msgs/PoseStamped": lambda message: _pose(message["pose"]),
    "geometry_msgs/PoseWithCovarianceStamped": lambda message: _pose(message["pose"]["pose"]),
    "geometry_msgs/TransformStamped": _transform,
    "nav_msgs/Odometry": _odometry,
    "geometry_msgs/Point": lambda message: {"x": message["x"], "y": message["y"]},
    "geometry_msgs/PointStamped": lambda message: {"x": message["point"]["x"], "y": message["point"]["y"]},
    "sensor_msgs/Imu": lambda message: {
        "yaw": _yaw(message["orientation"]),
        "yaw_rate": message["angular_velocity"]["z"],
    },
    "sensor_msgs/JointState": _joints,
    "ackermann_msgs/AckermannDrive": _ackermann,
    "ackermann_msgs/AckermannDriveStamped": _ackermann,
    "std_msgs/Float32": lambda message: {"data": message["data"]},
    "std_msgs/Float64": lambda message: {"data": message["data"]},
    "tf2_msgs/TFMessage": lambda _: {},
    "tf/tfMessage": lambda _: {},
}
"""Type of a message -> its quantities; 'data' has a meaning only by the name of its topic."""


# -- choice --------------------------------------------------------------------------------------------------------


def _sources(topics: Mapping[str, _Topic], wanted: Mapping[str, str]) -> dict[str, _QuantitySource]:
    sources: dict[str, _QuantitySource] = {}
    for name, source in wanted.items():
        for quantity in GROUPS.get(name, (name,)):
            sources[quantity] = _named(topics, quantity, source, is_group=name in GROUPS)
    if "x" not in sources and (pose := _pose_topic(topics)):
        sources |= {name: _plain(topics, pose, name) for name in ("x", "y", "yaw") if name in topics[pose].values}
        if topics[pose].type == "nav_msgs/Odometry":
            for name in ("speed", "yaw_rate"):
                if name not in sources and np.any(np.frombuffer(topics[pose].values[name])):  # often left at 0
                    sources[name] = _plain(topics, pose, name)
    imus = [name for name, topic in topics.items() if topic.type == "sensor_msgs/Imu"]
    if imus and "x" in sources and "yaw" not in sources:
        sources["yaw"] = _plain(topics, _only(imus, "the yaw", "yaw"), "yaw")
    if imus and "x" not in sources and "yaw_rate" not in sources:
        sources["yaw_rate"] = _plain(topics, _only(imus, "the yaw rate", "imu"), "yaw_rate")
    _choose_commands(topics, sources)
    return sources


def _named(topics: Mapping[str, _Topic], quantity: str, source: str, *, is_group: bool) -> _QuantitySource:
    """The source that the option `--topics` names."""
    column = mapped_column(quantity, source, [source_name(source)], UNITS[quantity], "--topics")
    name, _, path = column.name.partition(":")
    if column.name in topics:  # a frame of /tf
        name, path = column.name, ""
    key = path or quantity
    topic = topics.get(name)
    if topic is not None and key not in topic.values and "data" in topic.values and not is_group:
        key = "data"
    if topic is None or key not in topic.values:
        type_ = f" ({topic.type})" if topic else ""
        raise RecordingError(
            f"--topics: '{name}'{type_} has no {quantity}; name a field of its messages, such as "
            f"{quantity}={name}:FIELD"
        )
    if not column.unit and key == quantity and topic.type.startswith("ackermann_msgs"):
        column = column._replace(unit={"throttle": "m/s", "steering": "rad"}.get(quantity, ""))
    return _QuantitySource(name, key, column)


def _plain(topics: Mapping[str, _Topic], topic: str, quantity: str, key: str = "") -> _QuantitySource:
    is_ackermann = topics[topic].type.startswith("ackermann_msgs")
    unit = {"throttle": "m/s", "steering": "rad"}.get(quantity, "") if is_ackermann else ""
    return _QuantitySource(topic, key or quantity, TableColumn(0, topic, 1.0, 0.0, unit))


def _only(names: Sequence[str], content: str, option: str) -> str:
    if len(names) > 1:
        raise RecordingError(
            f"several topics have {content}: {', '.join(names[:10])}; choose one with --topics {option}={names[0]}"
        )
    return names[0]


def _pose_topic(topics: Mapping[str, _Topic]) -> str | None:
    """The topic of the poses: motion capture, odometry, another pose, a frame of /tf, or a point."""
    poses = {"geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/TransformStamped"}
    ranks: list[list[str]] = [[], [], [], [], []]
    for name, topic in topics.items():
        if topic.type in poses and _MOCAP.search(name):
            ranks[0].append(name)
        elif topic.type == "nav_msgs/Odometry":
            ranks[1].append(name)
        elif topic.type in poses and not _NO_POSE.search(name):
            ranks[2].append(name)
        elif name in {"/tf:base_link", "/tf:base_footprint"}:
            ranks[3].append(name)
        elif topic.type in {"geometry_msgs/Point", "geometry_msgs/PointStamped"}:
            ranks[4].append(name)
    best = next(filter(None, ranks), None)
    return _only(best, "poses", "pose") if best else None


def _choose_commands(topics: Mapping[str, _Topic], sources: dict[str, _QuantitySource]) -> None:
    """Add the sources of throttle and steering that are not named."""
    missing = [name for name in ("throttle", "steering") if name not in sources]
    if "steering_angle" in sources and "steering" in missing:
        missing.remove("steering")
    ackermann = [name for name, topic in topics.items() if topic.type.startswith("ackermann_msgs")]
    if missing and ackermann:
        usual = [name for name in COMMAND_TOPICS if name in ackermann]
        topic = usual[0] if usual else _only(ackermann, "commands", "command")
        sources |= {name: _plain(topics, topic, name) for name in missing}
        return
    for quantity in missing:
        numbers = [name for name, topic in topics.items() if "data" in topic.values and quantity in _last(name)]
        commands = [name for name in numbers if re.search(r"command|cmd", _last(name))]
        if chosen := commands or numbers:
            name = _only(chosen, f"the {quantity}", quantity)
            sources[quantity] = _plain(topics, name, quantity, "data")
    joints = [name for name, topic in topics.items() if "steering_angle" in topic.values]
    if "steering" not in sources and "steering_angle" not in sources and joints:
        sources["steering_angle"] = _plain(topics, _only(joints, "the angle", "steering_angle"), "steering_angle")


def _last(name: str) -> str:
    return name.rsplit("/", 1)[-1].lower()


# -- rows ----------------------------------------------------------------------------------------------------------


def _rows(topics: Mapping[str, _Topic], sources: Mapping[str, _QuantitySource], path: Path) -> LogRows:
    """The messages of the sources, in the order in which they were recorded."""
    names = [*dict.fromkeys(source.topic for source in sources.values())]
    if not names:
        raise RecordingError(
            f"no topic has poses or commands: name them with --topics. Topics: "
            f"{_listed({name: topic.type for name, topic in topics.items()})}"
        )
    starts = np.concatenate(([0], np.cumsum([len(topics[name].received) for name in names])))
    received = np.concatenate([np.frombuffer(topics[name].received) for name in names])
    stamps = np.concatenate([np.frombuffer(topics[name].stamps) for name in names])
    numbers = np.concatenate([np.frombuffer(topics[name].numbers, np.int64) for name in names])
    problems = [_used(sources)]
    is_stamped = _have_one_clock(names, starts, stamps, received, problems)
    values: dict[str, Floats] = {}
    for quantity, source in sources.items():
        column = np.full(len(received), np.nan)
        place = names.index(source.topic)
        part = np.frombuffer(topics[source.topic].values[source.key])
        column[starts[place] : starts[place + 1]] = source.column.scale * part + source.column.constant
        values[quantity] = column
    time = np.where(is_stamped & np.isfinite(stamps), stamps, received)
    order = np.argsort(received, kind="stable")
    units = {quantity: source.column.unit for quantity, source in sources.items()}
    rows = LogRows(time, numbers, values, units, str(path), "message", problems).chosen(order)
    rows.time -= rows.time[0]
    if "x" in sources and "yaw" in sources and sources["x"].topic != sources["yaw"].topic:
        _fill_yaw(rows)
    return rows


def _used(sources: Mapping[str, _QuantitySource]) -> LogProblem:
    """Says which topics are used: the choice is a guess unless they are named."""
    by_topic: dict[str, list[str]] = {}
    for quantity, source in sources.items():
        by_topic.setdefault(source.topic, []).append(quantity)
    text = "; ".join(f"{', '.join(quantities)} from {topic}" for topic, quantities in by_topic.items())
    return LogProblem("topics", 0, 0.0, f"read: {text}")


def _have_one_clock(
    names: Sequence[str], starts: NDArray[Any], stamps: Floats, received: Floats, problems: list[LogProblem]
) -> bool:
    """Whether the stamps of all topics are of the clock that recorded them; otherwise times of recording are used."""
    for i, name in enumerate(names):
        late = (stamps - received)[starts[i] : starts[i + 1]]
        late = late[np.isfinite(late)]
        if len(late) and abs(float(np.median(late))) > STAMP_ERROR:
            text = (
                f"the stamps of {name} differ from the times of recording by {np.median(late):.4g} s: the times of "
                "recording are used"
            )
            problems.append(LogProblem("clock", 0, 0.0, text))
            return False
    return True


def _fill_yaw(rows: LogRows) -> None:
    """Give the rows with a position the yaw of another topic."""
    is_known = np.isfinite(rows.values["yaw"])
    if is_known.sum() < 2:
        return
    order = np.argsort(rows.time[is_known], kind="stable")
    time, yaw = rows.time[is_known][order], np.unwrap(rows.values["yaw"][is_known][order])
    has_position = np.isfinite(rows.values["x"])
    rows.values["yaw"] = np.where(has_position, np.interp(rows.time, time, yaw), np.nan)
