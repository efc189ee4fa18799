"""One vehicle in ROS: its readings out, as messages on its topics; only what somebody reads is made."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from autodrive.protocol.messages import LidarScan, VehicleFrame, WheelsReading
from autodrive.protocol.native import Picture
from autodrive.ros import readings
from autodrive.ros.config import Config
from autodrive.ros.message import Message, Node, Time, Topic
from autodrive.ros.odometer import Odometer
from autodrive.ros.robot import Robot, Transform, relative, xyz
from autodrive.ros.topics import VehicleTopics
from autodrive.ros.update import Car
from autodrive.transforms import compose, rotate

SIDES = ("left", "right")

ODOMETRY_DRIFT = 0.02
"""Standard deviation of the dead reckoning, of the distance driven; tyres that slip are most of it."""

HALF_TURN = (0.0, 0.0, 0.0, 1.0)
"""About z, wxyz."""


class VehicleNode:
    """Publishes one vehicle through `node`."""

    def __init__(self, config: Config, car: Car, robot: Robot, node: Node) -> None:
        self.topics = VehicleTopics(config, car.number, car.type, car.cameras, is_direct=config.mode == "direct")
        self.car = car
        self._config = config
        self._robot = robot
        self._node = node
        self._odometer = Odometer(car.wheel_radius)
        self._is_turned = config.profile in ("2020", "2022", "2023")

    def restart(self) -> None:
        """The world was reset: odometry begins anew."""
        self._odometer = Odometer(self.car.wheel_radius)

    # -- readings -------------------------------------------------------------------------------------------------

    def publish(self, stamp: Time, vehicle: VehicleFrame) -> None:
        """Its state at that time."""
        topics, era, frame = self.topics, self._config.era, self.topics.frame
        self._odometer.take(vehicle)
        self._send(topics.throttle, lambda: readings.number(vehicle.throttle))
        self._send(topics.steering, lambda: readings.number(era.feedback_sign * vehicle.steering))
        self._send(topics.speed, lambda: readings.number(abs(vehicle.speed)))
        self._publish_encoders(vehicle)
        self._send(topics.ips, lambda: Message("geometry_msgs/Point", xyz(self._told_position(vehicle))))
        noise, imu_frame = self.car.sensor_noise, frame("imu")
        for topic in (topics.imu, topics.imu_data):
            self._send(topic, lambda: readings.imu(vehicle.imu, imu_frame, noise))
        self._send(topics.imu_raw, lambda: readings.imu(vehicle.imu, imu_frame, noise, is_raw=True))
        self._send(topics.odom, lambda: self._odometry(stamp, vehicle))
        self._send(topics.truth, lambda: self._truth(stamp, vehicle))
        self._send(topics.joints, lambda: self._joint_states(stamp, vehicle.wheels))
        self._send(topics.lights, lambda: readings.lights(stamp, frame("base_link"), vehicle.lights))
        self._send(topics.wheels, lambda: readings.wheel_states(stamp, frame("base_link"), vehicle.wheels))

    def publish_scan(self, scan: LidarScan) -> None:
        """A new scan."""
        is_turned = self._is_turned and readings.goes_around(scan)
        message: list[Message] = []
        for topic in (self.topics.lidar, self.topics.scan):
            if self._node.has_readers(topic):
                message = message or [readings.laser_scan(scan, self.topics.frame("lidar"), is_turned=is_turned)]
                self._node.publish(message[0], topic)

    def publish_picture(self, camera: str, picture: Picture) -> None:
        """A new picture of that camera; decoded at most once, and only where somebody reads the pixels."""
        topics = self.topics.cameras.get(camera)
        if topics is None:
            return
        stamp = Time.of(picture.time)
        self._send(topics.compressed, lambda: readings.compressed_image(stamp, topics.frame, picture.jpeg))
        self._send(topics.info, lambda: readings.camera_info(stamp, topics.frame, picture.intrinsics))
        readers = [topic for topic in (topics.raw, topics.legacy) if self._node.has_readers(topic)]
        if readers:
            message = readings.image(stamp, topics.frame, readings.decoded(picture.jpeg))
            for topic in readers:
                self._node.publish(message, topic)

    def publish_description(self) -> None:
        """The URDF, where there is one."""
        if urdf := self._config.robot_description:
            self._node.publish(Message("std_msgs/String", {"data": urdf}), self.topics.description)

    def publish_collision(self, stamp: Time, other: str, impulse: float, position: np.ndarray) -> None:
        """It began to touch something."""
        fields = {
            "header": readings.header(stamp, "map"),
            "vehicle": self.topics.name,
            "other": other,
            "impulse": impulse,
            "position": xyz(position),
        }
        self._send(self.topics.collision, lambda: Message("autodrive_msgs/Collision", fields))

    # -- frames ---------------------------------------------------------------------------------------------------

    def static_transforms(self) -> list[Transform]:
        """What stands still on the vehicle; the frame that the AutoDRIVE packages know it by is one of them."""
        frame = self.topics.frame
        own = Transform("base_link", self.topics.name, self._config.era.origin)
        placed = map(self._placed, self._robot.fixed)
        fixed = [one._replace(parent=frame(one.parent), child=frame(one.child)) for one in placed]
        return [own._replace(parent=frame("base_link")), *fixed]

    def transforms(self, vehicle: VehicleFrame) -> list[Transform]:
        """Where it is, and how its wheels stand."""
        frame = self.topics.frame
        odom = self._odometer.pose(frame("odom"), frame("base_link"))
        moving = [
            one._replace(parent=frame(one.parent), child=frame(one.child))
            for one in self._robot.transforms(readings.joint_angles(vehicle.wheels))
        ]
        if self._config.publish_map_to_odom:
            moving.append(self._map_to_odom(vehicle, odom))
        return [odom, *moving]

    def _map_to_odom(self, vehicle: VehicleFrame, odom: Transform) -> Transform:
        """So that map to base_link is the truth."""
        back = Transform("base_link", "odom", (0.0, 0.0, 0.0))
        position, orientation = relative(back, odom._replace(parent="base_link"))
        pose = vehicle.pose
        offset = rotate(pose.orientation, position)
        place = tuple(float(a) + b for a, b in zip(pose.position, offset, strict=True))
        return Transform("map", odom.parent, place, compose(pose.orientation, orientation))  # type: ignore[arg-type]

    def _placed(self, link: Transform) -> Transform:
        """The LIDAR of the packages of 2020 to 2023 looks backwards."""
        if self._is_turned and link.child == "lidar":
            return link._replace(orientation=compose(link.orientation, HALF_TURN))
        return link

    # -- parts ----------------------------------------------------------------------------------------------------

    def _send(self, topic: Topic, make: Callable[[], Message]) -> None:
        if self._node.has_readers(topic):
            self._node.publish(make(), topic)

    def _publish_encoders(self, vehicle: VehicleFrame) -> None:
        stamp = Time.of(vehicle.encoders.time)
        for topic, side, angle in zip(self.topics.encoders, SIDES, vehicle.encoders.angles.tolist(), strict=True):
            name = self.topics.frame(f"{side}_encoder")
            if self._node.has_readers(topic):
                self._node.publish(readings.joint_states(stamp, name, {name: angle}, {}), topic)

    def _told_position(self, vehicle: VehicleFrame) -> list[float]:
        lever = rotate(vehicle.imu.orientation, self._config.era.origin)
        return [float(p) + d for p, d in zip(vehicle.ips.position, lever, strict=True)]

    def _joint_states(self, stamp: Time, wheels: WheelsReading) -> Message:
        return readings.joint_states(stamp, "", readings.joint_angles(wheels), readings.joint_rates(wheels))

    def _odometry(self, stamp: Time, vehicle: VehicleFrame) -> Message:
        frame, odometer = self.topics.frame, self._odometer
        pose = odometer.pose(frame("odom"), frame("base_link"))
        noise = self.car.sensor_noise or {}
        speed_variance = (self.car.wheel_radius * noise.get("encoder_angle", 0.0) * self._config.rate) ** 2
        turn = float(vehicle.imu.angular_velocity[2])
        variances = (ODOMETRY_DRIFT * odometer.distance) ** 2, speed_variance
        return readings.odometry(stamp, pose, (odometer.speed, 0.0, 0.0), (0.0, 0.0, turn), variances)

    def _truth(self, stamp: Time, vehicle: VehicleFrame) -> Message:
        position, orientation = (tuple(map(float, of)) for of in (vehicle.pose.position, vehicle.pose.orientation))
        pose = Transform("map", self.topics.frame("base_link"), position, orientation)  # type: ignore[arg-type]
        return readings.odometry(stamp, pose, tuple(vehicle.velocity), tuple(vehicle.angular_velocity), (0.0, 0.0))
