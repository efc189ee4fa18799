"""The topics of a vehicle and of the whole world: those of the AutoDRIVE ROS packages, and what ROS users expect."""

from __future__ import annotations

from functools import cached_property

from autodrive.ros.config import Config
from autodrive.ros.message import Topic

CAMERAS = ("front", "rear")
"""Names of the cameras of a simulator that has not told its own."""


class VehicleTopics:
    """The names of vehicle `number` (from 1) of that type, and its topics; `root` is before all of them."""

    def __init__(
        self, config: Config, number: int = 1, type_: str = "", cameras: tuple[str, ...] = CAMERAS, *, is_direct: bool
    ) -> None:
        self.config = config
        self.name = config.name(number, type_)
        self.root = f"autodrive/{self.name}"
        self._prefix = "" if number == 1 else f"{self.name}/"
        has_steering_angle = config.profile == "2020"
        self.throttle = self._topic("throttle", "std_msgs/Float32", "throttle feedback, -1 to 1")
        sign = "left" if config.era.feedback_sign > 0 else "right"
        self.steering = self._topic(
            "steering_angle" if has_steering_angle else "steering",
            "std_msgs/Float32",
            f"steering angle [rad], {sign} turns positive",
        )
        self.speed = self._topic("speed", "std_msgs/Float32", "forward speed, without sign [m/s]")
        self.encoders = tuple(
            self._topic(f"{side}_encoder", "sensor_msgs/JointState", f"angle of the rear {side} wheel [rad]")
            for side in ("left", "right")
        )
        self.ips = self._topic("ips", "geometry_msgs/Point", "position in map [m]")
        self.imu = self._topic("imu", "sensor_msgs/Imu", "orientation, angular velocity, acceleration", "sensor")
        self.imu_data = self._topic("imu/data", "sensor_msgs/Imu", "the same, by its name of REP 145", "sensor")
        self.imu_raw = self._topic("imu/data_raw", "sensor_msgs/Imu", "without the orientation", "sensor")
        self.lidar = self._topic("lidar", "sensor_msgs/LaserScan", "scan, straight ahead first", "sensor")
        self.scan = self._topic("scan", "sensor_msgs/LaserScan", "the same, by its name of REP 138", "sensor")
        self.odom = self._topic("odom", "nav_msgs/Odometry", "dead reckoning by encoders and IMU, which drifts")
        self.truth = self._topic("ground_truth/odom", "nav_msgs/Odometry", "true pose in map, and twist")
        self.joints = self._topic("joint_states", "sensor_msgs/JointState", "steering and wheel angles [rad]")
        self.description = self._topic("robot_description", "std_msgs/String", "the URDF", "latched")
        self.lights = self._topic("lights", "autodrive_msgs/Lights", "what the lamps do")
        self.wheels = self._topic("wheels", "autodrive_msgs/WheelStates", "true slip, load, compression")
        self.collision = self._topic("collision", "autodrive_msgs/Collision", "the vehicle began to touch something")
        self.cameras = {camera: CameraTopics(self, camera) for camera in cameras}
        self._is_direct = is_direct

    def frame(self, name: str) -> str:
        """That frame of this vehicle."""
        return self._prefix + name

    @cached_property
    def all(self) -> list[Topic]:
        """Those that are published in this mode."""
        direct = [self.lights, self.wheels, self.collision] if self._is_direct else []
        cameras = [topic for camera in self.cameras.values() for topic in camera.all]
        speed = [self.speed] if self._is_direct or self.config.era.has_speed else []
        sensors = [self.throttle, self.steering, *speed, *self.encoders, self.ips, self.imu, self.imu_data]
        rest = [self.imu_raw, self.lidar, self.scan, self.odom, self.truth, self.joints, self.description]
        return [*sensors, *rest, *direct, *cameras]

    def _topic(self, name: str, type_: str, text: str, quality: str = "state") -> Topic:
        return Topic(f"{self.root}/{name}", type_, text, quality)  # type: ignore[arg-type]


class CameraTopics:
    """Those of one camera: the picture by its name of the AutoDRIVE packages, and as image_transport has it."""

    def __init__(self, vehicle: VehicleTopics, camera: str) -> None:
        name = f"{vehicle.root}/{camera}_camera"
        self.frame = vehicle.frame(f"{camera}_camera_optical_frame")
        self.body_frame = vehicle.frame(f"{camera}_camera")
        self.legacy = Topic(name, "sensor_msgs/Image", f"{camera} picture, rgb8", "sensor")
        self.raw = Topic(f"{name}/image_raw", "sensor_msgs/Image", "the same, in the optical frame", "sensor")
        self.compressed = Topic(f"{name}/image_raw/compressed", "sensor_msgs/CompressedImage", "as JPEG", "sensor")
        self.info = Topic(f"{name}/camera_info", "sensor_msgs/CameraInfo", "its pinhole and distortion", "sensor")
        self.all = [self.legacy, self.raw, self.compressed, self.info]


TF = Topic("/tf", "tf2_msgs/TFMessage", "map to odom to base_link; steered and turning wheels", "tf")
TF_STATIC = Topic("/tf_static", "tf2_msgs/TFMessage", "world to map; sensors on the vehicle", "latched")
CLOCK = Topic("/clock", "rosgraph_msgs/Clock", "simulated time; in devkit mode that of the node", "clock")
WORLD_TOPICS = [TF, TF_STATIC, CLOCK]


def light_topic(config: Config, number: int) -> Topic:
    """State of that traffic light; devkit mode."""
    return Topic(f"autodrive/{config.light_name(number)}/state", "std_msgs/Int32", "0 off, 1 red, 2 yellow, 3 green")
