"""Bags of ROS 1 and ROS 2, written by the package rosbags, are read as the drive that they contain."""

from __future__ import annotations

import math
import random
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from autodrive.recording import RecordingError
from autodrive.recording.drives import Drive, LogOptions, read_drives
from autodrive.recording.drives.ros_messages import MessageReader, MessageTypes
from tests.recording.drives.logs import RADIUS, SPEED, circle

FORMS = ("ros1", "ros1 bz2", "ros1 lz4", "mcap", "mcap zstd", "sqlite3", "sqlite3 foxy")
BEGAN = 1.7e9
"""Unix time of the first message [s]."""
ACKERMANN = (
    "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
)
STAMPED = "std_msgs/Header header\nAckermannDrive drive\n"
MOTOR = "uint8 FAULT=3  # fault\nstd_msgs/Header header\nstring name\nbool[3] flags\nfloat64[] cells\nfloat32 erpm\n"


class Bag:
    """Writes messages into a bag."""

    def __init__(self, path: Path, form: str) -> None:
        kind, _, compression = form.partition(" ")
        self.path = path / (f"{form}.bag" if kind == "ros1" else form)
        is_old = compression == "foxy"
        self.is_ros1 = kind == "ros1"
        store = Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_FOXY if is_old else Stores.ROS2_JAZZY
        self.store = get_typestore(store)
        header = {"ackermann_msgs/msg/AckermannDrive": ACKERMANN, "ackermann_msgs/msg/AckermannDriveStamped": STAMPED}
        for name, text in {**header, "lab_msgs/msg/Motor": MOTOR}.items():
            self.store.register(get_types_from_msg(text, name))
        if "tf2_msgs/msg/TFMessage" not in self.store.types:
            text = "geometry_msgs/TransformStamped[] transforms\n"
            self.store.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
        if self.is_ros1:
            self.writer: Any = Writer1(self.path)
            if compression:
                self.writer.set_compression(getattr(Writer1.CompressionFormat, compression.upper()))
        else:
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            self.writer = Writer2(self.path, version=8 if is_old else 9, storage_plugin=plugin)
            if compression in {"zstd", "file"}:
                mode = CompressionMode.FILE if compression == "file" else CompressionMode.STORAGE
                self.writer.set_compression(mode, CompressionFormat.ZSTD)
        self.connections: dict[str, Any] = {}

    def __enter__(self) -> Bag:
        self.writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def make(self, type_: str, **fields: Any) -> Any:
        """A message; fields that are not given are zero."""
        kind = self.store.types[type_]
        definition: Any = self.store.fielddefs[type_][1]
        values: dict[str, Any] = {}
        for name, (node, parts) in definition:
            if name in fields:
                values[name] = fields[name]
            elif node.name == "NAME":
                values[name] = self.make(parts)
            elif node.name == "BASE":
                values[name] = {"string": "", "bool": False}.get(parts[0], 0)
            else:
                (_, inner), size = parts
                values[name] = [] if inner[0] == "string" else np.zeros(size, inner[0])
        return kind(**values)

    def header(self, time: float) -> Any:
        nanoseconds = round((BEGAN + time) * 1e9)
        stamp = self.make("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="odd")

    def pose(self, x: float, y: float, yaw: float) -> Any:
        rotation = self.make("geometry_msgs/msg/Quaternion", z=math.sin(yaw / 2), w=math.cos(yaw / 2))
        return self.make(
            "geometry_msgs/msg/Pose", position=self.make("geometry_msgs/msg/Point", x=x, y=y), orientation=rotation
        )

    def write(self, topic: str, type_: str, time: float, **fields: Any) -> None:
        type_ = type_.replace("/", "/msg/")
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, type_, typestore=self.store)
        message = self.make(type_, **fields)
        serialize = self.store.serialize_ros1 if self.is_ros1 else self.store.serialize_cdr
        self.writer.write(self.connections[topic], round((BEGAN + time) * 1e9), serialize(message, type_))


Written = Callable[..., Path]


def drive_in(bag: Bag, poses: Callable[[Bag, float, float, float, float], None], delay: float = 0.0) -> Path:
    """The circle: poses at 50 Hz and commands at 10 Hz, which are recorded later by `delay` [s]."""
    log = circle()
    with bag:
        for i, time in enumerate(log["time"].tolist()):
            if i % 5 == 0:
                drive = bag.make("ackermann_msgs/msg/AckermannDrive", speed=1.5 + 0.1 * (i % 2), steering_angle=0.3)
                stamped = {"header": bag.header(time), "drive": drive}
                bag.write("/drive", "ackermann_msgs/AckermannDriveStamped", time + delay, **stamped)
            poses(bag, time, *(float(log[name][i]) for name in ("x", "y", "yaw")))
    return bag.path


def mocap(bag: Bag, time: float, x: float, y: float, yaw: float) -> None:
    bag.write("/vicon/car", "geometry_msgs/PoseStamped", time, header=bag.header(time), pose=bag.pose(x, y, yaw))


def odometry(bag: Bag, time: float, x: float, y: float, yaw: float) -> None:
    linear, angular = (
        bag.make("geometry_msgs/msg/Vector3", **value) for value in ({"x": SPEED}, {"z": SPEED / RADIUS})
    )
    twist = bag.make("geometry_msgs/msg/Twist", linear=linear, angular=angular)
    fields = {
        "header": bag.header(time),
        "pose": bag.make("geometry_msgs/msg/PoseWithCovariance", pose=bag.pose(x, y, yaw), covariance=np.zeros(36)),
        "twist": bag.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
    }
    bag.write("/odom", "nav_msgs/Odometry", time, **fields)


def transform(bag: Bag, time: float, x: float, y: float, yaw: float) -> None:
    pose = bag.pose(x, y, yaw)
    moved = bag.make(
        "geometry_msgs/msg/Transform",
        translation=bag.make("geometry_msgs/msg/Vector3", x=x, y=y),
        rotation=pose.orientation,
    )
    other = bag.make("geometry_msgs/msg/TransformStamped", header=bag.header(time), child_frame_id="laser")
    car = bag.make(
        "geometry_msgs/msg/TransformStamped", header=bag.header(time), child_frame_id="base_link", transform=moved
    )
    bag.write("/tf", "tf2_msgs/TFMessage", time, transforms=[other, car])


def point_and_imu(bag: Bag, time: float, x: float, y: float, yaw: float) -> None:
    bag.write("/ips", "geometry_msgs/Point", time, x=x, y=y)
    rate = bag.make("geometry_msgs/msg/Vector3", z=SPEED / RADIUS)
    imu = {"header": bag.header(time), "orientation": bag.pose(0, 0, yaw).orientation, "angular_velocity": rate}
    bag.write("/imu", "sensor_msgs/Imu", time + 0.003, **imu)


def read(path: Path, topics: str = "", **options: Any) -> Drive:
    (drive,) = read_drives(path, LogOptions(topics=topics, **options))
    return drive


def is_circle(drive: Drive) -> None:
    np.testing.assert_allclose(drive.speed, SPEED, rtol=3e-3)
    np.testing.assert_allclose(drive.yaw_rate, SPEED / RADIUS, rtol=1e-5)
    np.testing.assert_allclose(drive.x, RADIUS * np.sin(SPEED / RADIUS * drive.time), atol=1e-5)
    assert drive.steering == pytest.approx(0.3)


@pytest.mark.parametrize("form", FORMS)
def test_poses_and_commands_of_a_bag_are_the_drive(tmp_path: Path, form: str) -> None:
    drive = read(drive_in(Bag(tmp_path, form), mocap))
    is_circle(drive)
    assert (drive.throttle_unit, drive.steering_unit) == ("m/s", "rad")
    assert drive.throttle[:3] == pytest.approx([1.5, 1.6, 1.5], abs=1e-6)
    assert drive.command_time[:3] == pytest.approx([0.0, 0.1, 0.2], abs=1e-6)
    assert drive.command_period == pytest.approx(0.1)
    assert len(drive.time) == 400
    assert drive.problem_texts() == ["read: x, y, yaw from /vicon/car; throttle, steering from /drive"]


@pytest.mark.parametrize("poses", [odometry, transform, point_and_imu])
def test_other_messages_with_poses(tmp_path: Path, poses: Callable[..., None]) -> None:
    drive = read(drive_in(Bag(tmp_path, "mcap"), poses))
    assert drive.is_differentiated == (poses is not odometry)
    is_circle(drive)


def test_a_delay_of_the_recording_is_no_delay_of_a_stamped_command(tmp_path: Path) -> None:
    drive = read(drive_in(Bag(tmp_path, "mcap"), mocap, delay=0.037))
    assert drive.command_time[:3] == pytest.approx([0.0, 0.1, 0.2], abs=1e-6)
    is_circle(drive)


def test_stamps_of_another_clock_are_not_used(tmp_path: Path) -> None:
    def ahead(bag: Bag, time: float, x: float, y: float, yaw: float) -> None:
        pose = {"header": bag.header(time + 900.0), "pose": bag.pose(x, y, yaw)}
        bag.write("/vicon/car", "geometry_msgs/PoseStamped", time, **pose)

    drive = read(drive_in(Bag(tmp_path, "mcap"), ahead))
    is_circle(drive)
    assert "the stamps of /vicon/car differ from the times of recording by 900 s" in drive.problem_texts()[1]


def other_messages(bag: Bag, time: float, x: float, y: float, yaw: float) -> None:
    """Two poses, throttle and steering as numbers, and a message that only the bag describes."""
    mocap(bag, time, x, y, yaw)
    odometry(bag, time, 0.0, 0.0, 0.0)
    bag.write("/car/throttle_command", "std_msgs/Float32", time, data=0.25)
    bag.write("/car/steering_command", "std_msgs/Float64", time, data=-0.5)
    motor = {"header": bag.header(time), "name": "left", "flags": np.array([True, False, True])}
    bag.write("/motor", "lab_msgs/Motor", time, **motor, cells=np.array([3.7, 3.9]), erpm=4614.0 * SPEED)
    joints = {"name": ["wheel", "left_steer", "right_steer"], "position": np.array([9.0, 0.2, 0.4])}
    bag.write("/joints", "sensor_msgs/JointState", time, header=bag.header(time), **joints)


@pytest.mark.parametrize("form", ["ros1", "mcap"])
def test_topics_and_fields_are_chosen_by_an_option(tmp_path: Path, form: str) -> None:
    path = drive_in(Bag(tmp_path, form), other_messages)
    numbers = "throttle=/car/throttle_command,steering=-/car/steering_command*0.5+0.05"
    drive = read(path, f"pose=/vicon/car,speed=/motor:erpm/4614,{numbers}")
    assert drive.throttle == pytest.approx(0.25)
    assert drive.steering == pytest.approx(0.3)
    assert (drive.throttle_unit, drive.steering_unit) == ("share", "share")
    assert drive.speed == pytest.approx(SPEED)
    assert not drive.is_differentiated
    assert read(path, "x=/vicon/car,y=/vicon/car,yaw=/vicon/car,throttle=/motor:cells.1/10").throttle == pytest.approx(
        0.39
    )
    angle = read(path, "steering_angle=/joints,throttle=/drive:drive.speed [m/s]")
    assert angle.is_angle
    assert angle.steering == pytest.approx(0.3)
    for topics, message in (
        ("pose=/vicon/cat", r"the bag has no topic '/vicon/cat'\. Known: .*Did you mean '/vicon/car'"),
        ("throttle=/motor:cell.1", r"lab_msgs/Motor of '/motor' has no 'cell' in 'cell\.1': Known: .*mean 'cells'"),
        ("throttle=/motor:cells.7", r"has no '7' in 'cells\.7': an array of 2"),
        ("throttle=/motor:name", "'name' of '/motor' is no number"),
        ("throttle=/motor", r"'/motor' \(lab_msgs/Motor\) has no throttle; name a field"),
        ("steer=/drive", "--topics: 'steer' is not known"),
        ("pose=/vicon/car,throttle=/drive [V]", "'V' is no unit of 'throttle'"),
    ):
        with pytest.raises(RecordingError, match=message):
            read(path, topics)


def test_a_choice_that_is_not_clear_is_not_made(tmp_path: Path) -> None:
    def two(bag: Bag, time: float, x: float, y: float, yaw: float) -> None:
        for name in ("/vicon/a", "/vicon/b"):
            bag.write(name, "geometry_msgs/PoseStamped", time, header=bag.header(time), pose=bag.pose(x, y, yaw))

    path = drive_in(Bag(tmp_path, "mcap"), two)
    with pytest.raises(RecordingError, match="several topics have poses: /vicon/a, /vicon/b; choose one with"):
        read(path)
    is_circle(read(path, "pose=/vicon/b"))


def test_a_bag_without_a_drive_says_what_it_has(tmp_path: Path) -> None:
    bag = Bag(tmp_path, "mcap")
    with bag:
        for i in range(9):
            bag.write("/chat", "std_msgs/String", 0.1 * i, data="hello")
    with pytest.raises(RecordingError, match=r"no topic with poses or commands .*Topics: /chat \(std_msgs/String\)"):
        read(bag.path)
    other = Bag(tmp_path, "sqlite3")
    with other:
        for i in range(9):
            mocap(other, 0.1 * i, 0.1 * i, 0.0, 0.0)
    with pytest.raises(RecordingError, match="the log has no throttle; no steering: name the source with --topics"):
        read(other.path)
    with pytest.raises(RecordingError, match="--columns is for tables"):
        read(other.path, columns="x=y")
    packed = drive_in(Bag(tmp_path, "mcap file"), mocap)
    with pytest.raises(RecordingError, match=r"decompress mcap file\.mcap\.zstd first"):
        read(packed)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="the folder is no bag of ROS 2"):
        read(tmp_path / "empty")


def damaged(data: bytes, rng: random.Random) -> Iterator[bytes]:
    """A file that is cut off, and files with wrong bytes."""
    yield data[: len(data) // 2]
    yield data[: len(data) - 100]
    for _ in range(12):
        place = rng.randrange(len(data) - 8)
        yield data[:place] + rng.randbytes(8) + data[place + 8 :]


@pytest.mark.parametrize("form", ["ros1", "ros1 bz2", "mcap", "sqlite3"])
def test_a_damaged_bag_is_an_error_or_the_drive(tmp_path: Path, form: str) -> None:
    path = drive_in(Bag(tmp_path, form), mocap)
    (file,) = [path] if path.is_file() else [file for file in path.iterdir() if file.suffix != ".yaml"]
    wrong, said = tmp_path / f"wrong{file.suffix}", set[str]()
    for content in damaged(file.read_bytes(), random.Random(4)):
        wrong.write_bytes(content)
        try:
            assert read(wrong).duration > 0.0
        except RecordingError as error:
            said.add(re.sub(r"\d+", "N", str(error)))
    assert said
    assert not any("\n" in text for text in said)


def test_a_chunk_that_becomes_too_large_is_refused(tmp_path: Path) -> None:
    bag = tmp_path / "bomb.bag"

    def record(header: dict[bytes, bytes], data: bytes) -> bytes:
        fields = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in header.items())
        return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data

    chunk = {b"op": b"\x05", b"compression": b"none", b"size": struct.pack("<I", 2**31)}
    bag.write_bytes(b"#ROSBAG V2.0\n" + record(chunk, b""))
    with pytest.raises(RecordingError, match="a chunk of the bag has 2147483648 bytes; at most 67108864 are read"):
        read(bag)
    bag.write_bytes(b"#ROSBAG V2.0\n" + struct.pack("<I", 2**32 - 1))
    with pytest.raises(RecordingError, match="the header of a record has 4294967295 bytes"):
        read(bag)


def test_a_message_of_another_definition_is_not_misread() -> None:
    """Foxy to Humble do not write the definitions into a bag with sqlite3, and a package may have changed its own."""
    types = MessageTypes()
    reader = MessageReader(types, is_cdr=True)
    assert reader.read("std_msgs/Float64", struct.pack("<BBxxd", 0, 1, 2.5)) == {"data": 2.5}
    assert reader.read("std_msgs/Float64", struct.pack(">BBxxd", 0, 0, 2.5)) == {"data": 2.5}  # big endian
    for data in (struct.pack("<BBxxdd", 0, 1, 2.5, 1.0), struct.pack("<BBxxf", 0, 1, 2.5)):
        with pytest.raises(RecordingError, match=rf"a message of {len(data)} bytes is no std_msgs/Float64"):
            reader.read("std_msgs/Float64", data)
    with pytest.raises(RecordingError, match="is not in the encoding CDR"):
        reader.read("std_msgs/Float64", b"(\xb5/\xfd")
    types.add("a/B", "a/B[] parts\n")
    with pytest.raises(RecordingError, match="the message a/B contains itself"):
        reader.read("a/B", struct.pack("<BBxxI", 0, 1, 1) + struct.pack("<I", 1) * 20)
    with pytest.raises(RecordingError, match="the bag has no definition of the message vesc_msgs/VescStateStamped"):
        reader.read("vesc_msgs/VescStateStamped", b"\0\1" + bytes(40))
