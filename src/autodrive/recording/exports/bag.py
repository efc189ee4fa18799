"""ROS bags: the topics of the ROS bridge, as it would have published them during the run."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace
from rosbags.interfaces import (
    Nodetype,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from autodrive.connect.ros.bridge import Bridge
from autodrive.connect.ros.config import Config
from autodrive.connect.ros.message import Message, Time, Topic
from autodrive.connect.ros.qos import QOS
from autodrive.connect.ros.source import Update, VehicleInfo
from autodrive.graphics.meshes import store
from autodrive.protocol.messages import LidarScan
from autodrive.protocol.native import Picture
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.recording import LazyImages
from autodrive.recording.records import ScenarioRecord
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world.compile import sensors_of
from autodrive.world.views.scene_files import sensor_noise

RATE = 30.0
"""Default rate of the states [Hz], as that of the bridge."""

DEFINITIONS = {
    "autodrive_msgs/msg/Collision": (
        "std_msgs/Header header\nstring vehicle\nstring other\nfloat64 impulse\ngeometry_msgs/Point position\n"
    ),
    "autodrive_msgs/msg/Lights": (
        "uint8 HEADLIGHTS_OFF = 0\nuint8 HEADLIGHTS_LOW = 1\nuint8 HEADLIGHTS_HIGH = 2\n"
        "uint8 INDICATORS_OFF = 0\nuint8 INDICATORS_LEFT = 1\nuint8 INDICATORS_RIGHT = 2\nuint8 INDICATORS_HAZARD = 3\n"
        "uint8 TAIL_LIGHTS_OFF = 0\nuint8 TAIL_LIGHTS_PARTIAL = 1\nuint8 TAIL_LIGHTS_BRIGHT = 2\n"
        "std_msgs/Header header\nuint8 headlights\nuint8 indicators\nuint8 tail_lights\n"
        "bool left_indicator\nbool right_indicator\nbool reverse_lights\n"
    ),
    "autodrive_msgs/msg/WheelStates": (
        "std_msgs/Header header\nstring[] name\nfloat64[] steering_angle\nfloat64[] rotation_angle\n"
        "float64[] angular_velocity\nfloat64[] compression\nfloat64[] normal_load\nfloat64[] slip_ratio\n"
        "float64[] slip_angle\n"
    ),
}
"""Our own messages, without the comments of their files in the folder `ros`."""
CALLER = "/autodrive_bridge"
"""Node of all connections in a bag of ROS 1."""
INFINITE = QosTime(9223372036, 854775807)
"""The duration that ROS 2 takes as infinite."""
TRANSFORMS = {"tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n"}


def write(recording: Recording, path: Path, options: ExportOptions, form: str) -> None:
    """Write a bag; raw images are left out, because compressed ones take a tenth of the space."""
    names = options.vehicles(recording)
    scans: dict[str, LidarScan] = {}
    images: dict[tuple[str, str], float] = {}
    scenario: ScenarioRecord | None = None
    infos: dict[str, VehicleInfo] = {}
    seen: set[str] = set()
    tick = 0
    with _BagNode(path, is_ros2=form == "rosbag2") as node:
        bridge = Bridge(Config(rate=options.rate or RATE), node, clock=lambda: node.time)
        node.is_ready = True
        for time, whole in options.moments(recording, None):
            node.time = time
            before, scenario = scenario, recording.scenario_at(time)
            if scenario is not before and (new_infos := _infos(recording, scenario, names)) != infos:
                infos = new_infos
                seen |= {*infos}
                bridge.on_vehicles(infos)
            frame = replace(
                whole, vehicles={name: vehicle for name, vehicle in whole.vehicles.items() if name in infos}
            )
            if frame.tick < tick:  # after a reset, readings can have the times of earlier ones
                scans.clear()
                images.clear()
            tick = frame.tick
            new = {
                name: vehicle.lidar
                for name, vehicle in frame.vehicles.items()
                if vehicle.lidar is not None and (name not in scans or scans[name].time != vehicle.lidar.time)
            }
            scans |= new
            pictures: dict[tuple[str, str], Picture] = {}
            for name, vehicle in frame.vehicles.items():
                assert isinstance(vehicle.cameras, LazyImages)
                for camera, taken in vehicle.cameras.times.items():
                    if images.get((name, camera)) != taken and (picture := vehicle.cameras.picture(camera)) is not None:
                        images[name, camera] = taken
                        pictures[name, camera] = picture
            bridge.on_update(Update(frame, new, pictures))
    if options.vehicle and not seen:
        raise RecordingError(f"vehicle '{options.vehicle}' is traffic, which has no topics in ROS")


def _infos(recording: Recording, scenario: ScenarioRecord, names: Collection[str]) -> dict[str, VehicleInfo]:
    """The vehicles with these names in a scenario, numbered as the bridge numbers all of them, without the traffic."""
    with recording.scenario_spec(scenario) as spec:
        driven = [name for name in spec.vehicles if name not in spec.traffic.names]
        return {
            name: _info(spec, name, number, recording.cameras(name))
            for number, name in enumerate(driven, 1)
            if name in names
        }


def _info(spec: ScenarioSpec, name: str, number: int, cameras: tuple[str, ...]) -> VehicleInfo:
    placement = spec.vehicles[name]
    vehicle = load_vehicle(placement.type)
    return VehicleInfo(
        number,
        Path(placement.type).stem,
        cameras,
        vehicle.wheelbase,
        vehicle.wheels.radius,
        vehicle.full_throttle_speed,
        vehicle.steering.limit,
        sensor_noise(sensors_of(vehicle, placement)),
        missing_gravity=0.0 if vehicle.sensors.imu.measures_specific_force else spec.gravity,
        urdf=store.urdf(vehicle, placement.type),
    )


class _BagNode:
    """A node of the bridge that writes what is published into a bag."""

    def __init__(self, path: Path, *, is_ros2: bool) -> None:
        self.time = 0.0
        """Time of the recording [s], which each message of the bag has."""
        self.is_ready = False
        self._store = get_typestore(Stores.ROS2_JAZZY if is_ros2 else Stores.ROS1_NOETIC)
        for name, text in {**DEFINITIONS, **TRANSFORMS}.items():
            if name not in self._store.types:
                self._store.register(get_types_from_msg(text, name))
        self._is_ros2 = is_ros2
        # version 8 of the metadata: ROS 2 Humble does not read version 9, Jazzy and later read both
        self._writer: Any = Writer2(path, version=8, storage_plugin=StoragePlugin.MCAP) if is_ros2 else Writer1(path)
        self._serialize: Callable[[Any, str], Any] = (
            self._store.serialize_cdr if is_ros2 else self._store.serialize_ros1
        )
        self._connections: dict[str, Any] = {}
        self._last = 0
        """Time of the last message [ns]. The first one is later: ROS 1 does not read messages at time 0."""

    def __enter__(self) -> _BagNode:
        self._writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def add_topics(self, topics: list[Topic], subscriptions: list[Any]) -> None:
        """Nothing: a topic begins with its first message."""

    def has_subscribers(self, topic: Topic) -> bool:
        """Whether the topic is in the bag."""
        return topic.type != "sensor_msgs/Image"

    def now(self) -> float:
        """The time of the recording [s]."""
        return self.time

    def publish(self, message: Message, topic: Topic) -> None:
        """Write a message."""
        if not self.is_ready:
            return
        type_ = message.type.replace("/", "/msg/")
        if topic.name not in self._connections:
            name = topic.name if topic.name.startswith("/") else f"/{topic.name}"
            self._connections[topic.name] = self._writer.add_connection(
                name, type_, typestore=self._store, **self._offer(topic)
            )
        data = self._serialize(self._made(type_, message.fields), type_)
        self._last = max(round(self.time * 1e9), self._last + 1)  # so that players keep the order
        self._writer.write(self._connections[topic.name], self._last, data)

    def _offer(self, topic: Topic) -> dict[str, Any]:
        """What a player has to offer to subscribers, as the bridge did."""
        offered = QOS[topic.qos]
        if not self._is_ros2:
            return {"callerid": CALLER, "latching": int(offered.is_latched)}
        qos = Qos(
            QosHistory.KEEP_LAST,
            offered.depth,
            QosReliability.RELIABLE,
            QosDurability.TRANSIENT_LOCAL if offered.is_latched else QosDurability.VOLATILE,
            INFINITE,
            INFINITE,
            QosLiveliness.AUTOMATIC,
            INFINITE,
            avoid_ros_namespace_conventions=False,
        )
        return {"offered_qos_profiles": [qos]}

    def _made(self, type_: str, fields: dict[str, Any]) -> Any:
        """The message of rosbags; fields that are not given are zero or empty."""
        _, definition = self._store.fielddefs[type_]
        replaced = (
            {"d": "D", "k": "K", "r": "R", "p": "P"} if type_.endswith("CameraInfo") and not self._is_ros2 else {}
        )
        fields = {replaced.get(name, name): value for name, value in fields.items()}
        values = {name: self._value(kind, parts, fields.pop(name, None)) for name, (kind, parts) in definition}
        assert not fields, f"{type_} has no {', '.join(fields)}"
        return self._store.types[type_](**values)

    def _value(self, kind: Any, parts: Any, value: Any) -> Any:
        if kind == Nodetype.NAME:
            if isinstance(value, Time):
                return self._store.types["builtin_interfaces/msg/Time"](value.sec, value.nanosec)
            if isinstance(value, Message):
                value = value.fields
            return self._made(parts, value or {})
        if kind == Nodetype.BASE:
            return _ZERO.get(parts[0], 0) if value is None else value
        return self._array(parts, value)

    def _array(self, parts: Any, value: Any) -> Any:
        (kind, inner), size = parts
        if kind == Nodetype.NAME:
            return [self._value(kind, inner, part) for part in value or ()]
        if inner[0] == "string":
            return list(value or ())
        dtype = np.dtype({"bool": "?", "byte": "u1", "char": "u1"}.get(inner[0], inner[0]))
        if isinstance(value, bytes):
            return np.frombuffer(value, dtype)
        return np.zeros(size, dtype) if value is None else np.asarray(value, dtype)


_ZERO: dict[str, Any] = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
