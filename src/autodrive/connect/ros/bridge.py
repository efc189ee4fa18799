"""The bridge between a simulator and ROS: the part of a ROS node that does not depend on ROS."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from autodrive.base.errors import AutodriveError, CommandError
from autodrive.base.log_throttle import LogThrottle
from autodrive.base.suggest import suggest
from autodrive.base.transforms import Quaternion, Vector, yaw_from_quaternion
from autodrive.connect.ros.command_input import CommandInput
from autodrive.connect.ros.config import Config
from autodrive.connect.ros.devkit_source import DevkitSource
from autodrive.connect.ros.direct_source import DirectSource
from autodrive.connect.ros.markers import drawings
from autodrive.connect.ros.message import Message, Node, Subscription, Time, Topic
from autodrive.connect.ros.robot import Transform, in_parent, quaternion
from autodrive.connect.ros.source import Update, VehicleInfo
from autodrive.connect.ros.topics import (
    CLOCK,
    ENVIRONMENT_TOPICS,
    TF,
    TF_STATIC,
    WORLD_TOPICS,
    change_topic,
    light_topic,
    published,
)
from autodrive.connect.ros.vehicle_publisher import VehiclePublisher
from autodrive.protocol.devkit import ENVIRONMENT, environment_operations
from autodrive.protocol.messages import (
    Collision,
    Command,
    Frame,
    Operation,
    Pose,
    Reset,
    SetDrivingMode,
    SetTrafficLight,
    Teleport,
    TrafficLightFrame,
    TrafficLightState,
    VehicleFrame,
)
from autodrive.protocol.native import Scene, Status

log = logging.getLogger(__name__)

RETRY_INTERVAL = 0.5
"""Wall time between two attempts to connect to a simulator [s]."""
COMMAND_INTERVAL = 0.1
"""A command that is still valid is sent again after this simulated time: the simulator has a timeout too [s]."""
REPEAT_INTERVAL = 1.0
"""Wall time after which the latest state is published again in a pause [s]."""
WORLD_TO_MAP = Transform("world", "map", (0.0, 0.0, 0.0))
WARNING_INTERVAL = 10.0
"""Least time between two logs of the same warning [s]."""


class Bridge:
    """Publishes the data of a simulator through `node` and drives its vehicles; call `start`, at the end `close`.

    The topics of the first vehicle are created at once, those of other vehicles when a simulator has them. The bridge
    waits for a simulator, also after it was lost. `clock` is the wall time [s]. Raises AutodriveError for a bad URDF.
    """

    def __init__(self, config: Config, node: Node, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.config = config
        self._node = node
        self._clock = clock
        self._vehicles: dict[str, VehiclePublisher] = {}
        self._inputs: dict[str, CommandInput] = {}
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="autodrive-ros-bridge", daemon=True)
        self._lock = threading.Lock()
        self._created: set[str] = set()
        self._latest: Update | None = None
        self._is_pending = False
        """Whether the states of the latest update were not published yet."""
        self._transformed = math.nan
        """Time of the latest transforms [s]."""
        self._due = 0.0
        self._sent: dict[str, float] = {}
        self._tick = -1
        self._is_reset_held = False
        self._environment: dict[str, float] = {}
        """Time of day and weather, by the keys of the devkit."""
        self._throttle = LogThrottle(WARNING_INTERVAL, clock)
        self._last_warning = ""
        self._time = 0.0
        self._is_direct = config.mode == "direct"
        self._source: DirectSource | DevkitSource = (
            DirectSource(config)
            if self._is_direct
            else DevkitSource(config, node.now, self._commands, self._wait_for_answers)
        )
        world = published(config, WORLD_TOPICS)
        inputs = [*self._light_subscriptions(), *self._environment_subscriptions(), *self._league_subscriptions()]
        node.add_topics([*world, *self._light_topics], [*inputs, *self._marker_subscriptions()])
        self._create({"V1": VehicleInfo.of(config.car, 1, config.vehicle_type)})

    def start(self) -> None:
        """Connect to a simulator in a thread."""
        self._thread.start()

    def close(self) -> None:
        """Disconnect from the simulator and end the thread."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()

    # -- for services ---------------------------------------------------------------------------------------------

    def request(self, request: Operation) -> Frame:
        """The Frame after a request, for example `Reset()`. Raises AutodriveError, in devkit mode always."""
        return self._direct.request(request)

    @property
    def frame(self) -> Frame | None:
        """Latest Frame; None before the first one and in devkit mode."""
        return self._source.frame if isinstance(self._source, DirectSource) else None

    @property
    def scene(self) -> Scene | None:
        """Latest Scene; None as for `frame`."""
        return self._source.scene if isinstance(self._source, DirectSource) else None

    @property
    def status(self) -> Status | None:
        """Latest Status; None as for `frame`."""
        return self._source.status if isinstance(self._source, DirectSource) else None

    @property
    def scenarios(self) -> dict[str, str]:
        """Scenarios that can be loaded: name -> title; empty as for `frame`."""
        return self._source.scenarios if isinstance(self._source, DirectSource) else {}

    def vehicle_name(self, vehicle: str) -> str:
        """Name in ROS of a vehicle of the simulator."""
        return self._vehicles[vehicle].topics.name

    # -- Listener -------------------------------------------------------------------------------------------------

    @property
    def wants_clock(self) -> bool:
        """Whether /clock has subscribers."""
        return self._node.has_subscribers(CLOCK)

    @property
    def wants_images(self) -> bool:
        """Whether any image topic has subscribers."""
        cameras = (camera for publisher in self._vehicles.values() for camera in publisher.topics.cameras.values())
        return any(self._node.has_subscribers(topic) for camera in cameras for topic in camera.all)

    @property
    def max_wait(self) -> float:
        """Time until a state is due, a new one or the latest again [s]; infinite if there is none."""
        if self._latest is None:
            return math.inf
        return max(self._due + (0.0 if self._is_pending else REPEAT_INTERVAL) - self._clock(), 0.0)

    @property
    def is_closed(self) -> bool:
        """Whether `close` was called."""
        return self._closed.is_set()

    def on_vehicles(self, vehicles: dict[str, VehicleInfo]) -> None:
        """Create the topics of new vehicles, and publish descriptions and static transforms."""
        with self._lock:
            self._latest, self._tick = None, -1
            self._create(vehicles)
            for vehicle in self._vehicles.values():
                vehicle.publish_description()
                if text := vehicle.contradiction:
                    log.warning("%s", text)
            if self.config.publish_tf and not self.config.is_league:
                static = [transform for vehicle in self._vehicles.values() for transform in vehicle.static_transforms()]
                self._publish_transforms([WORLD_TO_MAP, *static], 0.0, TF_STATIC)

    def _create(self, vehicles: dict[str, VehicleInfo]) -> None:
        """Create the topics of new vehicles."""
        self._vehicles = {
            name: VehiclePublisher(self.config, info, self._node, self._created) for name, info in vehicles.items()
        }
        for name, vehicle in self._vehicles.items():
            command_input = self._inputs.setdefault(name, CommandInput(self.config, vehicle.info))
            command_input.vehicle = vehicle.info
            root = vehicle.topics.root
            if root not in self._created:
                self._created.add(root)
                self._node.add_topics(vehicle.topics.all, [*self._subscriptions(name, root)])

    def on_update(self, update: Update) -> None:
        """Publish new data, and the states if they are due."""
        for vehicle in update.scans:
            self._inputs[vehicle].begin()
        with self._lock:
            self._publish(update)
        if self._is_direct:
            self._repeat_commands()

    def on_idle(self) -> None:
        """Publish the latest state if it is due, in a pause also again, for nodes that start in it."""
        with self._lock:
            if self._latest is None or self.max_wait > 0.0:
                return
            if not self._is_pending:
                for vehicle in self._vehicles.values():
                    vehicle.forget()
                self._publish_clock(self._latest.frame)
            if not self._is_pending or self._latest.frame.time != self._transformed:
                self._publish_moving(self._latest.frame)
            self._publish_states(self._latest)

    def warn(self, text: str) -> None:
        """Log a warning; the same one at most once in `WARNING_INTERVAL`."""
        if text != self._last_warning:
            self._throttle.forget(self._last_warning)
            self._last_warning = text
        if self._throttle.admits(text):
            log.warning("%s", text)

    # -- publishing -----------------------------------------------------------------------------------------------

    def _publish(self, update: Update) -> None:
        """Publish the time, then the transforms of that time, and then what subscribers transform with them."""
        frame, is_due = update.frame, update.is_new and self._clock() >= self._due
        if update.is_new:
            self._begin(update)
        is_wanted = is_due or update.scans or update.pictures or frame.events
        if is_wanted and (update.is_new or frame.time != self._transformed):
            self._publish_moving(frame)
        for event in frame.events if update.is_new else ():
            if isinstance(event, Collision) and event.vehicle in self._vehicles:
                stamp = Time.of(event.time)
                self._vehicles[event.vehicle].publish_collision(stamp, event.other, event.impulse, event.position)
        if is_due:
            self._publish_states(update)
        for vehicle, scan in update.scans.items():
            self._vehicles[vehicle].publish_scan(scan)
        for (vehicle, camera), picture in update.pictures.items():
            self._vehicles[vehicle].publish_picture(camera, picture)

    def _begin(self, update: Update) -> None:
        """Publish the time of a new Frame; its states are published when they are due."""
        frame = update.frame
        self._time = frame.time
        if frame.tick < self._tick:
            for vehicle in self._vehicles.values():
                vehicle.restart()
        self._tick = frame.tick
        self._latest, self._is_pending = update, True
        self._publish_clock(frame)

    def _publish_clock(self, frame: Frame) -> None:
        if self._node.has_subscribers(CLOCK):
            self._node.publish(Message(CLOCK.type, {"clock": Time.of(frame.time)}), CLOCK)

    def _publish_moving(self, frame: Frame) -> None:
        """Publish the poses of vehicles, steering and wheels."""
        self._transformed = frame.time
        moving: list[Transform] = []
        for name, reading in self._own_vehicles(frame):
            vehicle = self._vehicles[name]
            vehicle.advance(reading)
            moving += vehicle.transforms(reading)
        if self.config.publish_tf and self._node.has_subscribers(TF):
            self._publish_transforms(moving, frame.time, TF)

    def _own_vehicles(self, frame: Frame) -> list[tuple[str, VehicleFrame]]:
        """The vehicles of a Frame without those of the traffic."""
        return [(name, reading) for name, reading in frame.vehicles.items() if not reading.is_traffic]

    def _publish_states(self, update: Update) -> None:
        now, period = self._clock(), 1.0 / self.config.rate
        self._due = max(self._due + period, now - 0.5 * period)
        self._is_pending = False
        stamp = Time.of(update.frame.time)
        for name, reading in self._own_vehicles(update.frame):
            self._vehicles[name].publish(stamp, reading)
        for topic, (_, state) in zip(self._light_topics, sorted(update.traffic_lights.items()), strict=False):
            self._publish_number(topic, state)
        if self._is_direct and update.frame.traffic_lights and not self.config.is_league:
            self._publish_lights(update.frame.traffic_lights)

    def _publish_lights(self, lights: Mapping[str, TrafficLightFrame]) -> None:
        """State and time to change of the traffic lights of the map; direct mode. Creates their topics first."""
        for number, (_name, light) in enumerate(lights.items(), 1):
            topics = light_topic(self.config, number), change_topic(self.config, number)
            if topics[0].name not in self._created:
                self._created.add(topics[0].name)
                self._node.add_topics([*topics], [_light_command(topics[0], partial(self._on_light, number))])
            self._publish_number(topics[0], int(light.state))
            self._publish_number(topics[1], math.nan if light.time_to_change is None else light.time_to_change)

    def _publish_number(self, topic: Topic, value: float) -> None:
        if self._node.has_subscribers(topic):
            self._node.publish(Message(topic.type, {"data": value}), topic)

    def _publish_transforms(self, transforms: list[Transform], seconds: float, topic: Topic) -> None:
        stamp = Time.of(seconds)
        self._node.publish(
            Message(TF.type, {"transforms": [transform.message(stamp) for transform in transforms]}), topic
        )

    # -- driving --------------------------------------------------------------------------------------------------

    def _subscriptions(self, vehicle: str, root: str) -> list[Subscription]:
        """Command topics of a vehicle."""
        target = self._inputs[vehicle]
        side = "left" if self.config.devkit_profile.command_sign > 0 else "right"

        def command(name: str, type_: str, text: str, callback: Callable[[Any], None]) -> Subscription:
            return Subscription(f"{root}/{name}", type_, text, partial(self._on_command, vehicle, callback))

        common = [
            command("throttle_command", "std_msgs/Float32", "-1 to 1", target.on_throttle),
            command("steering_command", "std_msgs/Float32", f"-1 to 1, positive {side}", target.on_steering),
        ]
        if self.config.is_league:
            return [replace(subscription, qos="league") for subscription in common]
        return [
            *common,
            command("headlights_command", "std_msgs/Int32", "0 off, 1 low, 2 high beam", target.on_headlights),
            command("indicators_command", "std_msgs/Int32", "0 off, 1 left, 2 right, 3 hazard", target.on_indicators),
            command("drive", "ackermann_msgs/AckermannDriveStamped", "speed, steering angle", target.on_ackermann),
            command("cmd_vel", "geometry_msgs/Twist", "forward speed, yaw rate", target.on_twist),
            command(
                "cmd_vel_stamped", "geometry_msgs/TwistStamped", "forward speed, yaw rate", target.on_twist_stamped
            ),
            Subscription(f"{root}/reset_command", "std_msgs/Bool", "true resets", partial(self._on_reset, vehicle)),
            Subscription(
                f"{root}/initialpose",
                "geometry_msgs/PoseWithCovarianceStamped",
                "teleports the vehicle to a pose, also in a frame of TF; direct mode",
                partial(self._on_initial_pose, vehicle),
            ),
        ]

    def _on_command(self, vehicle: str, callback: Callable[[Any], None], message: Any) -> None:
        is_first = not self._inputs[vehicle].is_active
        callback(message)
        state = self.frame and self.frame.vehicles.get(vehicle)
        if state is not None:
            if is_first and self.config.take_over and not state.is_autonomous:
                self._try(SetDrivingMode(vehicle, True))
            self._drive(vehicle)

    def _drive(self, vehicle: str) -> None:
        if vehicle not in self._vehicles or (command := self._inputs[vehicle].command(self._time)) is None:
            return
        self._sent[vehicle] = self._time
        with self._warning():
            self._direct.drive(vehicle, command)

    def _repeat_commands(self) -> None:
        """Send active commands again at the interval, and once the stop after the timeout."""
        for name in self._vehicles:
            vehicle_input = self._inputs[name]
            was_active = vehicle_input.is_active
            vehicle_input.command(self._time)
            is_due = abs(self._time - self._sent.get(name, -1.0)) >= COMMAND_INTERVAL
            if was_active and (not vehicle_input.is_active or is_due):
                self._drive(name)

    def _commands(self) -> dict[str, Command]:
        """Commands of all vehicles; zero for vehicles without one."""
        return {name: self._inputs[name].command(self._time) or Command() for name in self._vehicles}

    def _wait_for_answers(self, vehicles: Collection[str], timeout: float) -> bool:
        """Wait for the commands that follow the scans of these vehicles, those of a driver; whether there are any.

        `timeout` [s], in all.
        """
        end = time.monotonic() + timeout
        inputs = [self._inputs[name] for name in vehicles]
        driven = [vehicle_input for vehicle_input in inputs if vehicle_input.has_command] or inputs
        answers = [vehicle_input.wait_for_answer(max(end - time.monotonic(), 0.0)) for vehicle_input in driven]
        return any(answers)

    def _on_reset(self, vehicle: str, message: Any) -> None:
        if isinstance(self._source, DevkitSource):
            (self._source.resets.add if message.data else self._source.resets.discard)(vehicle)
        elif message.data:
            self._try(Reset())

    def _on_initial_pose(self, vehicle: str, message: Any) -> None:
        marked = message.pose.pose
        with self._warning():
            pose = self._in_map(
                message.header.frame_id,
                (marked.position.x, marked.position.y, marked.position.z),
                quaternion(marked.orientation),
            )
            x, y, _ = pose.position.tolist()
            self._direct.request(Teleport(vehicle, x, y, yaw_from_quaternion(pose.orientation)))

    def _league_subscriptions(self) -> list[Subscription]:
        """The reset of the league: a level, so that one message with true is one reset."""
        if not self.config.is_league or self.config.race:
            return []
        text = "resets the world when the value becomes true"
        return [Subscription("autodrive/reset_command", "std_msgs/Bool", text, self._on_reset_level, "league")]

    def _on_reset_level(self, message: Any) -> None:
        is_rising, self._is_reset_held = message.data and not self._is_reset_held, bool(message.data)
        if isinstance(self._source, DevkitSource):
            self._source.resets = {*self._vehicles} if message.data else set()
        elif is_rising:
            self._try(Reset())

    # -- drawings -------------------------------------------------------------------------------------------------

    def _marker_subscriptions(self) -> list[Subscription]:
        if not self._is_direct or self.config.is_league:
            return []
        text = "markers that the page draws into its view, in map or in a frame of a vehicle; direct mode"
        return [Subscription("autodrive/markers", "visualization_msgs/MarkerArray", text, self._on_markers)]

    def _on_markers(self, message: Any) -> None:
        with self._warning():
            self._direct.request(drawings(message, self._pose_of))

    def _pose_of(self, frame: str) -> Pose:
        """Pose in the map of a TF frame, now. Raises `CommandError` if the bridge does not have it."""
        return self._in_map(frame, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

    def _in_map(self, frame: str, position: Vector, orientation: Quaternion) -> Pose:
        """A pose in a TF frame as a pose in the map, now. '' is the map. Raises `CommandError` as `_pose_of`."""
        frames: dict[str, Transform] = {}
        for name, reading in self._own_vehicles(self.frame) if self.frame else ():
            frames |= {transform.child: transform for transform in self._vehicles[name].frames(reading)}
        known, at = ["map", *frames], frame.lstrip("/")
        while at not in ("", "map", "world"):
            if (link := frames.pop(at, None)) is None:
                raise CommandError(f"the frame '{frame}' is not known. {suggest(frame, known)}")
            position, orientation = in_parent(link, position, orientation)
            at = link.parent
        return Pose(np.array(position), np.array(orientation))

    # -- traffic lights -------------------------------------------------------------------------------------------

    @property
    def _light_topics(self) -> list[Topic]:
        config = self.config
        has_lights = config.mode == "devkit" and config.devkit_profile.is_prefixed and not config.is_league
        return [light_topic(self.config, number) for number in range(1, 5)] if has_lights else []

    def _light_subscriptions(self) -> list[Subscription]:
        return [
            _light_command(topic, partial(self._on_light, number)) for number, topic in enumerate(self._light_topics, 1)
        ]

    def _on_light(self, number: int, message: Any) -> None:
        state = min(max(int(message.data), 0), 3)
        if isinstance(self._source, DevkitSource):
            self._source.traffic_lights[number] = state
        elif self.frame is not None and number <= len(self.frame.traffic_lights):
            light = list(self.frame.traffic_lights)[number - 1]
            self._try(SetTrafficLight(light, TrafficLightState(state) if state else None))

    # -- time of day and weather ----------------------------------------------------------------------------------

    def _environment_subscriptions(self) -> list[Subscription]:
        if self.config.is_league:
            return []
        return [
            Subscription(f"autodrive/environment/{name}", type_, text, partial(self._on_environment, key))
            for key, (name, type_, text) in ENVIRONMENT_TOPICS.items()
        ]

    def _on_environment(self, key: str, message: Any) -> None:
        if not math.isfinite(message.data):
            self.warn(f"autodrive/environment/{ENVIRONMENT_TOPICS[key][0]} must be a finite number, not {message.data}")
            return
        least, most = ENVIRONMENT[key]
        before, now = self._environment, self._environment | {key: min(max(float(message.data), least), most)}
        self._environment = now
        if isinstance(self._source, DevkitSource):
            self._source.environment = now
        else:
            for operation in environment_operations(before, now):
                self._try(operation)

    # -- source ---------------------------------------------------------------------------------------------------

    def _try(self, request: Operation) -> None:
        with self._warning():
            self._direct.request(request)

    @property
    def _direct(self) -> DirectSource:
        if not isinstance(self._source, DirectSource):
            raise AutodriveError("the devkit protocol does not have this request: use the mode 'direct'")
        return self._source

    @contextlib.contextmanager
    def _warning(self) -> Iterator[None]:
        """Log errors as warnings."""
        try:
            yield
        except (AutodriveError, OSError) as error:
            self.warn(str(error))

    def _run(self) -> None:
        while not self.is_closed:
            try:
                with self._warning():
                    self._source.serve(self)
            except Exception:
                log.exception("unexpected error; the bridge connects again")
            self._closed.wait(RETRY_INTERVAL)
        if isinstance(self._source, DirectSource):
            self._source.close()


def _light_command(state: Topic, callback: Callable[[Any], None]) -> Subscription:
    """Sets a traffic light; 0 lets it follow its program again."""
    text = "0 by the light program, 1 red, 2 yellow, 3 green"
    return Subscription(state.name.replace("state", "command"), state.type, text, callback)
