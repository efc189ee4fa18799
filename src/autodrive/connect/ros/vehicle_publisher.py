"""Publishes the readings of one vehicle; messages are built only for topics with subscribers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from autodrive.base.transforms import compose, inverse, rotate
from autodrive.connect.ros import readings
from autodrive.connect.ros.config import Config
from autodrive.connect.ros.dead_reckoning import DeadReckoning
from autodrive.connect.ros.message import Message, Node, Time, Topic
from autodrive.connect.ros.robot import Robot, Transform, relative, xyz
from autodrive.connect.ros.source import VehicleInfo
from autodrive.connect.ros.topics import VehicleTopics
from autodrive.protocol.messages import LidarScan, OwnReading, VehicleFrame, WheelsReading
from autodrive.protocol.native import Picture

SIDES = ("left", "right")

ODOMETRY_DRIFT = 0.02
"""Standard deviation of dead reckoning as a fraction of the distance; tyre slip is the largest part."""

TOLERANCE = 1e-3
"""Distance [m] or angle [rad] between a frame in a given URDF and in the simulator above which the bridge warns."""

HALF_TURN = (0.0, 0.0, 0.0, 1.0)
"""About z, wxyz."""


class VehiclePublisher:
    """Publishes one vehicle through `node`."""

    def __init__(self, config: Config, info: VehicleInfo, node: Node, own_topics: set[str] | None = None) -> None:
        """`own_topics`: names of the topics of the user's sensors that `node` has.

        A `robot_description` of the configuration is used instead of that of `info`. Raises AutodriveError for a bad
        URDF.
        """
        self._own_topics = set() if own_topics is None else own_topics
        self.topics = VehicleTopics(config, info.number, info.type, info.cameras, is_direct=config.mode == "direct")
        self.info = info
        self._config = config
        self._urdf = config.robot_description or info.urdf
        self._robot = Robot(self._urdf)
        self._node = node
        self._dead_reckoning = DeadReckoning(info.wheel_radius)
        self._times: dict[str, float] = {}
        """Time of the latest reading published [s], by channel."""
        self._is_turned = config.profile in ("2020", "2022", "2023")

    def advance(self, vehicle: VehicleFrame) -> None:
        """Take note of a new state, before its transforms and readings are published."""
        self._dead_reckoning.update(vehicle)

    def forget(self) -> None:
        """Publish the next readings even if they are those that were published last."""
        self._times.clear()

    def restart(self) -> None:
        """Restart the odometry, after a reset."""
        self._dead_reckoning = DeadReckoning(self.info.wheel_radius)
        self.forget()

    # -- readings -------------------------------------------------------------------------------------------------

    def publish(self, stamp: Time, vehicle: VehicleFrame) -> None:
        """Publish the state at that time."""
        topics, devkit, frame = self.topics, self._config.devkit_profile, self.topics.frame
        self._publish(topics.throttle, lambda: readings.number(vehicle.throttle))
        self._publish(topics.steering, lambda: readings.number(devkit.feedback_sign * vehicle.steering))
        self._publish(topics.speed, lambda: readings.number(abs(vehicle.speed)))
        self._publish_encoders(vehicle)
        self._publish(topics.ips, lambda: Message("geometry_msgs/Point", xyz(self._reference_position(vehicle))))
        imu_frame = frame("imu")
        noise = None if self._config.is_league else self.info.sensor_noise  # the league has fixed variances
        self._publish(topics.imu, lambda: readings.imu(vehicle.imu, imu_frame, noise))
        for topic, has_orientation in ((topics.imu_data, True), (topics.imu_raw, False)):
            of_rep_145 = {"added_gravity": self.info.missing_gravity, "has_orientation": has_orientation}
            self._publish(topic, lambda: readings.imu(vehicle.imu, imu_frame, noise, **of_rep_145))  # noqa: B023 - called at once
        self._publish(topics.odom, lambda: self._odometry(stamp, vehicle))
        for signal, topic in topics.numbers:
            self._publish_number(topic, signal.read(vehicle), vehicle)
        self._publish(topics.truth, lambda: self._truth(stamp, vehicle))
        self._publish(topics.joints, lambda: self._joint_states(stamp, vehicle.wheels))
        self._publish(topics.lights, lambda: readings.lights(stamp, frame("base_link"), vehicle.lights))
        self._publish(topics.wheels, lambda: readings.wheel_states(stamp, frame("base_link"), vehicle.wheels))

        self._publish_readings(vehicle)
        if not self._config.is_league:
            self._publish_own(vehicle)

    def _publish_number(self, topic: Topic, value: float | None, vehicle: VehicleFrame) -> None:
        """Publish laps and collisions; without a race, laps are 0 in the league, and not published otherwise."""
        if vehicle.race is not None and topic.signal == "collision_count":
            value = vehicle.race.collision_count
        if value is not None or self._config.is_league:
            self._publish(topic, lambda: readings.number(value or 0, topic.type))

    def _publish_readings(self, vehicle: VehicleFrame) -> None:
        """Publish new readings of the channels whose messages carry the reading as it is."""
        for channel, topic in self.topics.readings:
            reading = channel.read(vehicle)
            if reading is not None and reading.time != self._times.get(topic.name):
                self._times[topic.name] = reading.time
                convert, frame_id = readings.CONVERTERS[topic.type], self.topics.frame(channel.name)
                self._publish(topic, lambda: convert(reading, frame_id))  # noqa: B023 - called at once

    def _publish_own(self, vehicle: VehicleFrame) -> None:
        """Publish new readings of the sensors of the user, and what was heard by radio.

        Each topic is created with the first reading.
        """
        own = [(self.topics.own(name), reading) for name, reading in vehicle.own.items()]
        for topic, reading in [*own, *self._heard(vehicle)]:
            if topic.name not in self._own_topics:
                self._own_topics.add(topic.name)
                self._node.add_topics([topic], [])
            if reading.time != self._times.get(topic.name):
                self._times[topic.name] = reading.time
                self._publish(topic, lambda: readings.own_reading(reading))  # noqa: B023 - called at once

    def _heard(self, vehicle: VehicleFrame) -> Iterator[tuple[Topic, OwnReading]]:
        """What was heard of each vehicle and traffic light."""
        if vehicle.v2x is not None:
            for name, message in vehicle.v2x.vehicles.items():
                yield self.topics.heard("vehicle", name), readings.heard_vehicle(message)
            for name, light in vehicle.v2x.lights.items():
                yield self.topics.heard("light", name), readings.heard_light(light)

    def publish_scan(self, scan: LidarScan) -> None:
        """Publish a new scan."""
        message: list[Message] = []
        for topic in (self.topics.lidar, self.topics.scan):
            if self._node.has_subscribers(topic):
                message = message or [readings.laser_scan(scan, self.topics.frame("lidar"), is_turned=self._is_turned)]
                self._node.publish(message[0], topic)

    def publish_picture(self, camera: str, picture: Picture) -> None:
        """Publish a new image; it is decoded at most once, and only if a raw image topic has subscribers."""
        topics = self.topics.cameras.get(camera)
        if topics is None:
            return
        stamp = Time.of(picture.time)
        self._publish(topics.compressed, lambda: readings.compressed_image(stamp, topics.frame, picture.jpeg))
        self._publish(topics.info, lambda: readings.camera_info(stamp, topics.frame, picture.intrinsics))
        subscribed = [topic for topic in (topics.raw, topics.legacy) if self._node.has_subscribers(topic)]
        if subscribed:
            message = readings.image(stamp, topics.frame, readings.decoded(picture.jpeg))
            for topic in subscribed:
                self._node.publish(message, topic)

    def publish_description(self) -> None:
        """Publish the URDF, if there is one."""
        if self._urdf and self.topics.description in self.topics.all:
            self._node.publish(Message("std_msgs/String", {"data": self._urdf}), self.topics.description)

    def publish_collision(self, stamp: Time, other: str, impulse: float, position: np.ndarray) -> None:
        """Publish the start of a contact."""
        fields = {
            "header": readings.header(stamp, "map"),
            "vehicle": self.topics.name,
            "other": other,
            "impulse": impulse,
            "position": xyz(position),
        }
        self._publish(self.topics.collision, lambda: Message("autodrive_msgs/Collision", fields))

    # -- frames ---------------------------------------------------------------------------------------------------

    def static_transforms(self) -> list[Transform]:
        """Fixed frames of the vehicle, including the vehicle frame of the AutoDRIVE packages."""
        frame = self.topics.frame
        placed = map(self._placed, self._robot.fixed)
        fixed = [
            transform._replace(parent=frame(transform.parent), child=frame(transform.child)) for transform in placed
        ]
        if self._config.is_league:  # its vehicle frame is base_link
            return fixed
        own = Transform("base_link", self.topics.name, self._config.devkit_profile.origin)
        return [own._replace(parent=frame("base_link")), *fixed]

    def transforms(self, vehicle: VehicleFrame) -> list[Transform]:
        """Pose of the vehicle, steering and wheels."""
        frame = self.topics.frame
        if self._config.is_league:
            return [self._league_pose(vehicle), *self.static_transforms(), *self._joints(vehicle)]
        odom = self._dead_reckoning.pose(frame("odom"), frame("base_link"))
        moving = self._joints(vehicle)
        if self._config.publish_map_to_odom:
            moving.append(self._map_to_odom(vehicle, odom))
        return [odom, *moving]

    def frames(self, vehicle: VehicleFrame) -> list[Transform]:
        """All frames of the vehicle at that state, also the true place of odom if that is not published."""
        odom = self._dead_reckoning.pose(self.topics.frame("odom"), self.topics.frame("base_link"))
        return [*self.static_transforms(), *self.transforms(vehicle), self._map_to_odom(vehicle, odom)]

    @property
    def contradiction(self) -> str:
        """Where the `robot_description` of the configuration differs from that of the simulator; '' if it does not."""
        transforms = {frame.child: frame for frame in self._robot.transforms({}) + self._robot.fixed}
        simulated = Robot(self.info.urdf)
        apart = []
        for frame in simulated.transforms({}) + simulated.fixed:
            if (other := transforms.get(frame.child)) is None:
                apart.append(f"{frame.child} is missing")
                continue
            distance = math.dist(other.position, frame.position)
            w, *axis = compose(inverse(other.orientation), frame.orientation)
            angle = 2.0 * math.atan2(math.hypot(*axis), abs(w))
            if max(distance, angle) > TOLERANCE:
                apart.append(f"{frame.child} differs by {distance:.3f} m and {math.degrees(angle):.1f} degrees")
        text = f"the given robot_description is not that of {self.topics.name} in the simulator: {', '.join(apart)}. "
        return (
            text + "Leave robot_description out: then the bridge uses the robot_description of the simulator"
            if apart
            else ""
        )

    def _joints(self, vehicle: VehicleFrame) -> list[Transform]:
        frame = self.topics.frame
        moving = self._robot.transforms(readings.joint_angles(vehicle.wheels))
        return [
            transform._replace(parent=frame(transform.parent), child=frame(transform.child)) for transform in moving
        ]

    def _league_pose(self, vehicle: VehicleFrame) -> Transform:
        """Pose of the vehicle in the league: as measured, in world."""
        position, orientation = (
            tuple(map(float, components)) for components in (vehicle.ips.position, vehicle.imu.orientation)
        )
        return Transform("world", self.topics.name, position, orientation)  # type: ignore[arg-type]

    def _map_to_odom(self, vehicle: VehicleFrame, odom: Transform) -> Transform:
        """The transform that makes map to base_link the ground truth."""
        back = Transform("base_link", "odom", (0.0, 0.0, 0.0))
        position, orientation = relative(back, odom._replace(parent="base_link"))
        pose = vehicle.pose
        offset = rotate(pose.orientation, position)
        place = tuple(float(a) + b for a, b in zip(pose.position, offset, strict=True))
        return Transform("map", odom.parent, place, compose(pose.orientation, orientation))  # type: ignore[arg-type]

    def _placed(self, link: Transform) -> Transform:
        """The LIDAR frame of the packages of 2020 to 2023 points backwards."""
        if self._is_turned and link.child == "lidar":
            return link._replace(orientation=compose(link.orientation, HALF_TURN))
        return link

    # -- parts ----------------------------------------------------------------------------------------------------

    def _publish(self, topic: Topic, build: Callable[[], Message]) -> None:
        if self._node.has_subscribers(topic):
            self._node.publish(build(), topic)

    def _publish_encoders(self, vehicle: VehicleFrame) -> None:
        stamp = Time.of(vehicle.encoders.time)
        for topic, side, angle in zip(self.topics.encoders, SIDES, vehicle.encoders.angles.tolist(), strict=True):
            name = self.topics.frame(f"{side}_encoder")
            if self._node.has_subscribers(topic):
                self._node.publish(readings.joint_states(stamp, name, {name: angle}, {}), topic)

    def _reference_position(self, vehicle: VehicleFrame) -> list[float]:
        lever = rotate(vehicle.imu.orientation, self._config.devkit_profile.origin)
        return [float(p) + d for p, d in zip(vehicle.ips.position, lever, strict=True)]

    def _joint_states(self, stamp: Time, wheels: WheelsReading) -> Message:
        return readings.joint_states(stamp, "", readings.joint_angles(wheels), readings.joint_rates(wheels))

    def _odometry(self, stamp: Time, vehicle: VehicleFrame) -> Message:
        if self._config.is_league:
            variances = readings.DEVKIT_VARIANCE, readings.DEVKIT_VARIANCE
            velocity = self._config.devkit_profile.velocity(vehicle)
            angular = tuple(vehicle.imu.angular_velocity)
            return readings.odometry(stamp, self._league_pose(vehicle), velocity, angular, variances)
        frame, reckoning = self.topics.frame, self._dead_reckoning
        pose = reckoning.pose(frame("odom"), frame("base_link"))
        noise = self.info.sensor_noise or {}
        speed_variance = (self.info.wheel_radius * noise.get("encoder_angle", 0.0) / reckoning.interval) ** 2
        yaw_rate = float(vehicle.imu.angular_velocity[2])
        variances = (ODOMETRY_DRIFT * reckoning.distance) ** 2, speed_variance
        return readings.odometry(stamp, pose, (reckoning.speed, 0.0, 0.0), (0.0, 0.0, yaw_rate), variances)

    def _truth(self, stamp: Time, vehicle: VehicleFrame) -> Message:
        position, orientation = (
            tuple(map(float, components)) for components in (vehicle.pose.position, vehicle.pose.orientation)
        )
        pose = Transform("map", self.topics.frame("base_link"), position, orientation)  # type: ignore[arg-type]
        return readings.odometry(stamp, pose, tuple(vehicle.velocity), tuple(vehicle.angular_velocity), (0.0, 0.0))
