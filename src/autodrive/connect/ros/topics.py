"""Names, types and QoS of all topics: those of the AutoDRIVE ROS packages, and the names that ROS tools expect."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

from autodrive.connect.ros.cars import NIGEL
from autodrive.connect.ros.config import Config
from autodrive.connect.ros.message import Topic
from autodrive.protocol.channels import CHANNELS, ROS_TOPICS, SIGNAL_BY_NAME, Channel, League, RosQos


class VehicleTopics:
    """Topics and frame names of vehicle `number` (from 1); `root` is the prefix of all its topics."""

    def __init__(
        self,
        config: Config,
        number: int = 1,
        type_: str = "",
        cameras: tuple[str, ...] = NIGEL.cameras,
        *,
        is_direct: bool,
    ) -> None:
        self.config = config
        self.name = config.vehicle_name(number, type_)
        self.root = f"autodrive/{self.name}"
        self._frame_prefix = "" if number == 1 else f"{self.name}/"
        has_steering_angle = config.profile == "2020"
        sign = "left" if config.devkit_profile.feedback_sign > 0 else "right"
        self._others = dict(ROS_TOPICS)
        self.throttle = self._registered("throttle")
        self.steering = self._registered("steering", "steering_angle" if has_steering_angle else "steering", sign=sign)
        self.speed = self._registered("speed")
        self.encoders = tuple(self._registered(f"{side}_encoder") for side in ("left", "right"))
        self.ips = self._registered("ips")
        self.imu = self._registered("imu")
        self.imu_data = self._registered("imu/data")
        self.imu_raw = self._registered("imu/data_raw")
        self.lidar = self._registered("lidar")
        self.scan = self._registered("scan")
        self.lights = self._registered("lights")
        self.wheels = self._registered("wheels")
        numbers = [topic for _, topic in self._unhandled() if topic.signal]
        self.numbers = [(SIGNAL_BY_NAME[topic.signal], self._registered(topic.name)) for topic in numbers]
        """Topics that carry a signal as a number: laps and collisions."""
        self.readings = [(channel, self._registered(topic.name)) for channel, topic in self._unhandled()]
        """Topics that carry the reading of a channel as it is, in direct mode."""
        text = "dead reckoning with encoders and IMU, which drifts"
        if config.is_league:
            text = "position of the IPS and orientation of the IMU in world, true velocity"
        self.odom = self._topic("odom", "nav_msgs/Odometry", text, league="restricted")
        self.truth = self._topic("ground_truth/odom", "nav_msgs/Odometry", "true pose in map, true twist")
        self.joints = self._topic("joint_states", "sensor_msgs/JointState", "steering and wheel angles [rad]")
        self.description = self._topic("robot_description", "std_msgs/String", "URDF of the vehicle", "latched")
        self.collision = self._topic("collision", "autodrive_msgs/Collision", "start of a contact")
        self.cameras = {camera: CameraTopics(self, camera) for camera in cameras}
        self._is_direct = is_direct

    def frame(self, name: str) -> str:
        """Name of a TF frame of this vehicle."""
        if self.config.is_league and name == "base_link":
            return self.name
        return self._frame_prefix + name

    def own(self, sensor: str) -> Topic:
        """The topic of a sensor of the user."""
        return self._topic(
            f"own/{sensor}", "std_msgs/Float64MultiArray", f"values of the sensor '{sensor}' of the user"
        )

    def heard(self, kind: str, sender: str) -> Topic:
        """The topic of the messages of a vehicle or traffic light that this vehicle hears by radio."""
        return self._topic(
            f"v2x/{kind}/{sender}", "std_msgs/Float64MultiArray", f"messages of the {kind} '{sender}', heard by radio"
        )

    @cached_property
    def all(self) -> list[Topic]:
        """The topics that are published in this mode."""
        others = [topic for _, topic in self.readings] if self._is_direct else []
        has_race = self._is_direct or self.config.devkit_profile.has_race
        numbers = [topic for _, topic in self.numbers] if has_race else []
        direct = [self.lights, self.wheels, self.collision] if self._is_direct else []
        cameras = [topic for camera in self.cameras.values() for topic in camera.all]
        speed = [self.speed] if self._is_direct or self.config.devkit_profile.has_speed else []
        sensors = [self.throttle, self.steering, *speed, *self.encoders, self.ips, self.imu, self.imu_data]
        rest = [self.imu_raw, self.lidar, self.scan, *others, self.odom, self.truth, self.joints, self.description]
        return published(self.config, [*sensors, *rest, *direct, *numbers, *cameras])

    def _registered(self, name: str, own_name: str = "", **words: str) -> Topic:
        """The topic of that name in the registry of signals; `words` are set into its text."""
        topic = self._others.pop(name)
        qos: RosQos = "league" if self.config.is_league else topic.qos
        full_name = f"{self.root}/{own_name or name}"
        return replace(topic, name=full_name, text=topic.text.format(**words), qos=qos)

    def _unhandled(self) -> list[tuple[Channel, Topic]]:
        return [(channel, topic) for channel in CHANNELS for topic in channel.topics if topic.name in self._others]

    def _topic(self, name: str, type_: str, text: str, qos: RosQos = "state", league: League = "") -> Topic:
        return Topic(f"{self.root}/{name}", type_, text, "league" if self.config.is_league else qos, league)


class CameraTopics:
    """Topics of one camera: with the name of the AutoDRIVE packages, and with the names of image_transport."""

    def __init__(self, vehicle: VehicleTopics, camera: str) -> None:
        name = f"{vehicle.root}/{camera}_camera"
        is_league = vehicle.config.is_league
        self.frame = vehicle.frame(f"{camera}_camera" if is_league else f"{camera}_camera_optical_frame")
        qos: RosQos = "league" if is_league else "sensor"
        league: League = "allowed" if camera == "front" else ""
        self.legacy = Topic(name, "sensor_msgs/Image", f"{camera} image, rgb8", qos, league)
        self.raw = Topic(f"{name}/image_raw", "sensor_msgs/Image", f"same as {camera}_camera", "sensor")
        self.compressed = Topic(f"{name}/image_raw/compressed", "sensor_msgs/CompressedImage", "JPEG", "sensor")
        self.info = Topic(f"{name}/camera_info", "sensor_msgs/CameraInfo", "intrinsics and distortion", "sensor")
        self.all = [self.legacy, self.raw, self.compressed, self.info]


TF = Topic("/tf", "tf2_msgs/TFMessage", "map to odom to base_link; steering and wheels", "tf", "restricted")
TF_STATIC = Topic("/tf_static", "tf2_msgs/TFMessage", "world to map; sensors on the vehicle", "latched")
CLOCK = Topic(
    "/clock", "rosgraph_msgs/Clock", "simulated time; in devkit mode the time of the node", "clock", "allowed"
)
WORLD_TOPICS = [TF, TF_STATIC, CLOCK]
ENVIRONMENT_TOPICS = {
    "Auto Time": ("auto_time", "std_msgs/Bool", "whether the time of day passes"),
    "Time Scale": ("time_scale", "std_msgs/Float32", "seconds of the day per second, with auto_time"),
    "Time": ("time_of_day", "std_msgs/Int32", "minutes since midnight, without auto_time"),
    "Weather": ("weather_id", "std_msgs/Int32", "0 amounts of the four intensity topics, 1 sunny ... 8 heavy snow"),
    "Clouds": ("cloud_intensity", "std_msgs/Float32", "0 to 1, with weather_id 0"),
    "Fog": ("fog_intensity", "std_msgs/Float32", "0 to 1, with weather_id 0"),
    "Rain": ("rain_intensity", "std_msgs/Float32", "0 to 1, with weather_id 0"),
    "Snow": ("snow_intensity", "std_msgs/Float32", "0 to 1, with weather_id 0"),
}
"""Name below autodrive/environment, type and text of the topics of time of day and weather, by key of the devkit."""


def published(config: Config, topics: list[Topic]) -> list[Topic]:
    """The topics that the configuration has: all, or those of the league, at race time without the restricted ones."""
    kept = ("allowed",) if config.race else ("allowed", "restricted")
    return [topic for topic in topics if topic.league in kept] if config.is_league else topics


def light_topic(config: Config, number: int) -> Topic:
    """State of a traffic light of the map."""
    return Topic(f"autodrive/{config.light_name(number)}/state", "std_msgs/Int32", "0 off, 1 red, 2 yellow, 3 green")


def change_topic(config: Config, number: int) -> Topic:
    """Time until a traffic light changes; direct mode."""
    text = "time until the light changes [s]; nan: not known; direct mode"
    return Topic(f"autodrive/{config.light_name(number)}/time_to_change", "std_msgs/Float32", text)
