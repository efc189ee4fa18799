"""The bridge between a simulator and ROS: what a ROS node of either generation has inside."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from autodrive.errors import AutodriveError
from autodrive.protocol.messages import Collision, Command, Frame, Request, Reset, SetDrivingMode, Teleport
from autodrive.protocol.native import Scene, Status
from autodrive.ros.config import Config
from autodrive.ros.devkit import CAMERAS, DevkitSource
from autodrive.ros.direct import DirectSource
from autodrive.ros.message import Message, Node, Subscription, Time, Topic
from autodrive.ros.robot import Robot, Transform
from autodrive.ros.topics import CLOCK, TF, TF_STATIC, WORLD_TOPICS, light_topic
from autodrive.ros.update import Car, Update
from autodrive.ros.vehicle import VehicleNode
from autodrive.ros.wheel import Wheel

log = logging.getLogger(__name__)

RETRY = 0.5
"""Between two attempts to find a simulator [s]."""
REPEAT = 0.1
"""A command that stands is told again after that time: the simulator forgets it as the node does [s]."""
COMPLAINTS = 10.0
"""The same trouble is not told more often [s]."""


class Bridge:
    """Publishes through `node`, and drives by what its subscriptions take; `start` it, and `close` it in the end.

    The topics of the first vehicle are open at once, those of others when a simulator has them. A simulator that goes
    away is waited for. Raises AutodriveError if the URDF is none.
    """

    def __init__(self, config: Config, node: Node) -> None:
        self.config = config
        self._node = node
        self._robot = Robot(config.robot_description) if config.robot_description else Robot("<robot/>")
        self._vehicles: dict[str, VehicleNode] = {}
        self._wheels: dict[str, Wheel] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="autodrive-ros-bridge", daemon=True)
        self._one_at_a_time = threading.Lock()
        self._opened: set[str] = set()
        self._pending: Update | None = None
        self._due = 0.0
        self._told: dict[str, float] = {}
        self._tick = -1
        self._complaints: dict[str, float] = {}
        self._time = 0.0
        self._is_direct = config.mode == "direct"
        self._source: DirectSource | DevkitSource = (
            DirectSource(config) if self._is_direct else DevkitSource(config, node.now, self._commands)
        )
        node.open([*WORLD_TOPICS, *self._light_topics], [*self._world_subscriptions()])
        self.begin({"V1": Car(1, config.vehicle_type, CAMERAS)})

    def start(self) -> None:
        """From now on look for a simulator."""
        self._thread.start()

    def close(self) -> None:
        """Let go of the simulator."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    # -- for services ---------------------------------------------------------------------------------------------

    def ask(self, request: Request) -> Frame:
        """The Frame after a request, for example `Reset()`. Raises AutodriveError, also in devkit mode."""
        return self._direct.ask(request)

    @property
    def frame(self) -> Frame | None:
        """The latest; None before the first and in devkit mode."""
        return self._source.frame if isinstance(self._source, DirectSource) else None

    @property
    def scene(self) -> Scene | None:
        """What there is; likewise."""
        return self._source.scene if isinstance(self._source, DirectSource) else None

    @property
    def status(self) -> Status | None:
        """Pause, speed, who drives; likewise."""
        return self._source.status if isinstance(self._source, DirectSource) else None

    @property
    def scenarios(self) -> dict[str, str]:
        """Name -> title of those that can be loaded; likewise."""
        return self._source.scenarios if isinstance(self._source, DirectSource) else {}

    def name(self, vehicle: str) -> str:
        """How ROS calls that vehicle of the simulator."""
        return self._vehicles[vehicle].topics.name

    # -- what a source tells (see `Listener`) ----------------------------------------------------------------------

    @property
    def wants_clock(self) -> bool:
        """Whether somebody reads the time."""
        return self._node.has_readers(CLOCK)

    @property
    def wants_pictures(self) -> bool:
        """Whether somebody reads a picture."""
        cameras = (camera for one in self._vehicles.values() for camera in one.topics.cameras.values())
        return any(self._node.has_readers(topic) for camera in cameras for topic in camera.all)

    @property
    def patience(self) -> float:
        """Until a state that could not be published yet is due [s]."""
        return max(self._due - time.monotonic(), 0.0) if self._pending is not None else math.inf

    @property
    def is_ended(self) -> bool:
        """Whether it is closed."""
        return self._ended.is_set()

    def begin(self, cars: dict[str, Car]) -> None:
        """These are the vehicles now."""
        self._vehicles = {name: VehicleNode(self.config, car, self._robot, self._node) for name, car in cars.items()}
        for name, vehicle in self._vehicles.items():
            wheel = self._wheels.setdefault(name, Wheel(self.config, vehicle.car))
            wheel.car = vehicle.car
            root = vehicle.topics.root
            if root not in self._opened:
                self._opened.add(root)
                self._node.open(vehicle.topics.all, [*self._subscriptions(name, root)])
            vehicle.publish_description()
        self._pending, self._tick = None, -1
        if self.config.publish_tf:
            still = [one for vehicle in self._vehicles.values() for one in vehicle.static_transforms()]
            self._publish_transforms([Transform("world", "map", (0.0, 0.0, 0.0)), *still], 0.0, TF_STATIC)

    def take(self, update: Update) -> None:
        """Publish what is new in it, and the states when they are due."""
        with self._one_at_a_time:
            self._take(update)
        if self._is_direct:
            self._repeat()

    def _take(self, update: Update) -> None:
        for (vehicle, camera), picture in update.pictures.items():
            self._vehicles[vehicle].publish_picture(camera, picture)
        for vehicle, scan in update.scans.items():
            self._vehicles[vehicle].publish_scan(scan)
        if update.is_new:
            self._take_frame(update)

    def _take_frame(self, update: Update) -> None:
        frame = update.frame
        self._time = frame.time
        if frame.tick < self._tick:
            for vehicle in self._vehicles.values():
                vehicle.restart()
        self._tick = frame.tick
        if self._node.has_readers(CLOCK):
            self._node.publish(Message(CLOCK.type, {"clock": Time.of(frame.time)}), CLOCK)
        for event in frame.events:
            if isinstance(event, Collision):
                stamp = Time.of(event.time)
                self._vehicles[event.vehicle].publish_collision(stamp, event.other, event.impulse, event.position)
        self._pending = update
        if time.monotonic() >= self._due:
            self._publish_states(update)

    def idle(self) -> None:
        """Publish the state that was not due, if it is now: while paused none follows."""
        with self._one_at_a_time:
            if self._pending is not None and time.monotonic() >= self._due:
                self._publish_states(self._pending)

    def complain(self, text: str) -> None:
        """Warn, of the same not more often than is of use."""
        now = time.monotonic()
        if now - self._complaints.get(text, -math.inf) > COMPLAINTS:
            self._complaints = {text: now}
            log.warning("%s", text)

    def _publish_states(self, update: Update) -> None:
        now, period = time.monotonic(), 1.0 / self.config.rate
        self._due = max(self._due + period, now - 0.5 * period)
        self._pending = None
        stamp = Time.of(update.frame.time)
        moving: list[Transform] = []
        for name, reading in update.frame.vehicles.items():
            vehicle = self._vehicles[name]
            vehicle.publish(stamp, reading)
            moving += vehicle.transforms(reading)
        if self.config.publish_tf and self._node.has_readers(TF):
            self._publish_transforms(moving, update.frame.time, TF)
        for topic, (_, state) in zip(self._light_topics, sorted(update.traffic_lights.items()), strict=False):
            if self._node.has_readers(topic):
                self._node.publish(Message(topic.type, {"data": state}), topic)

    def _publish_transforms(self, transforms: list[Transform], seconds: float, topic: Topic) -> None:
        stamp = Time.of(seconds)
        self._node.publish(Message(TF.type, {"transforms": [one.message(stamp) for one in transforms]}), topic)

    # -- driving --------------------------------------------------------------------------------------------------

    def _subscriptions(self, vehicle: str, root: str) -> list[Subscription]:
        """What drives that vehicle."""
        wheel = self._wheels[vehicle]
        side = "left" if self.config.era.command_sign > 0 else "right"

        def obeyed(name: str, type_: str, text: str, take: Callable[[Any], None]) -> Subscription:
            return Subscription(f"{root}/{name}", type_, text, partial(self._obey, vehicle, take))

        return [
            obeyed("throttle_command", "std_msgs/Float32", "-1 to 1", wheel.throttle),
            obeyed("steering_command", "std_msgs/Float32", f"-1 to 1, positive turns {side}", wheel.steering),
            obeyed("headlights_command", "std_msgs/Int32", "0 off, 1 low, 2 high beam", wheel.headlights),
            obeyed("indicators_command", "std_msgs/Int32", "0 off, 1 left, 2 right, 3 hazard", wheel.indicators),
            obeyed("drive", "ackermann_msgs/AckermannDriveStamped", "speed, steering angle", wheel.ackermann),
            obeyed("cmd_vel", "geometry_msgs/Twist", "forward speed, yaw rate", wheel.twist),
            obeyed("cmd_vel_stamped", "geometry_msgs/TwistStamped", "forward speed, yaw rate", wheel.twist_stamped),
            Subscription(f"{root}/reset_command", "std_msgs/Bool", "true resets", partial(self._reset, vehicle)),
            Subscription(
                f"{root}/initialpose",
                "geometry_msgs/PoseWithCovarianceStamped",
                "puts the vehicle there, in map; direct mode",
                partial(self._teleport, vehicle),
            ),
        ]

    def _obey(self, vehicle: str, take: Callable[[Any], None], message: Any) -> None:
        is_new = not self._wheels[vehicle].is_fresh
        take(message)
        now = self.frame and self.frame.vehicles.get(vehicle)
        if now is not None:
            if is_new and self.config.take_over and not now.is_autonomous:
                self._try(SetDrivingMode(vehicle, True))
            self._drive(vehicle)

    def _drive(self, vehicle: str) -> None:
        if vehicle not in self._vehicles or (command := self._wheels[vehicle].command(self._time)) is None:
            return
        self._told[vehicle] = self._time
        with self._complaining():
            self._direct.drive(vehicle, command)

    def _repeat(self) -> None:
        """Tell what stands once more, and once that it stands no more."""
        for name in self._vehicles:
            wheel = self._wheels[name]
            was_fresh = wheel.is_fresh
            wheel.command(self._time)
            if was_fresh and (not wheel.is_fresh or abs(self._time - self._told.get(name, -1.0)) >= REPEAT):
                self._drive(name)

    def _commands(self) -> dict[str, Command]:
        """Of all vehicles; who says nothing stands."""
        return {name: self._wheels[name].command(self._time) or Command() for name in self._vehicles}

    def _reset(self, vehicle: str, message: Any) -> None:
        if isinstance(self._source, DevkitSource):
            (self._source.resets.add if message.data else self._source.resets.discard)(vehicle)
        elif message.data:
            self._try(Reset())

    def _teleport(self, vehicle: str, message: Any) -> None:
        pose = message.pose.pose
        q = pose.orientation
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        self._try(Teleport(vehicle, pose.position.x, pose.position.y, yaw))

    # -- the whole world ------------------------------------------------------------------------------------------

    @property
    def _light_topics(self) -> list[Topic]:
        is_there = self.config.mode == "devkit" and self.config.era.is_prefixed
        return [light_topic(self.config, number) for number in range(1, 5)] if is_there else []

    def _world_subscriptions(self) -> list[Subscription]:
        def command(number: int, message: Any) -> None:
            assert isinstance(self._source, DevkitSource)
            self._source.traffic_lights[number] = min(max(int(message.data), 0), 3)

        return [
            Subscription(topic.name.replace("state", "command"), topic.type, topic.text, partial(command, number))
            for number, topic in enumerate(self._light_topics, start=1)
        ]

    def _try(self, request: Request) -> None:
        with self._complaining():
            self._direct.ask(request)

    @property
    def _direct(self) -> DirectSource:
        if not isinstance(self._source, DirectSource):
            raise AutodriveError("the devkits' protocol has no such request: use the mode 'direct'")
        return self._source

    @contextlib.contextmanager
    def _complaining(self) -> Any:
        """What goes wrong is told."""
        try:
            yield
        except (AutodriveError, OSError) as error:
            self.complain(str(error))

    def _run(self) -> None:
        while not self.is_ended:
            try:
                with self._complaining():
                    self._source.serve(self)
            except Exception:
                log.exception("begins anew after a fault")
            self._ended.wait(RETRY)
        if isinstance(self._source, DirectSource):
            self._source.close()
