"""Devkit-protocol source: a server that any AutoDRIVE simulator connects to; converts its messages to Frames."""

from __future__ import annotations

import base64
import contextlib
import math
import re
import time
import zlib
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np
import simplejpeg

from autodrive.base.transforms import cross, euler_from_quaternion, rotate
from autodrive.connect.devkit import F1TENTH, Server
from autodrive.connect.ros.cars import CARS, Car
from autodrive.connect.ros.config import Config
from autodrive.connect.ros.direct_source import POLL_INTERVAL
from autodrive.connect.ros.source import Listener, Update, VehicleInfo
from autodrive.protocol.devkit import TRAFFIC_LIGHTS
from autodrive.protocol.messages import (
    CameraIntrinsics,
    Command,
    EncoderReading,
    Frame,
    Headlights,
    ImuReading,
    Indicators,
    IpsReading,
    LidarScan,
    Lights,
    Pose,
    RaceState,
    RaceStatus,
    TailLights,
    VehicleFrame,
    WheelsReading,
)
from autodrive.protocol.native import Picture
from autodrive.protocol.ports import DEVKIT_PORT

ANSWER_TIME = 4.0
"""Time that the driver has for a scan in lock-step [s]; a race sends a message that is not answered again after 4.5 s
or later."""
MAX_DELAY = 0.5
"""An answer is never delayed longer: the simulator may take its message for lost [s]."""
PARSE_ERRORS = (ValueError, TypeError, ArithmeticError, EOFError, OSError, zlib.error)
"""Raised for malformed values: numbers, arrays, base64, gzip."""
UNKNOWN = np.full(4, math.nan)
REPEAT_INTERVAL = 0.2
"""A scan or an image that is equal to the last one is published again after this time [s]; in lock-step, each scan."""


class DevkitSource:
    """Passes each message of a simulator to the listener and answers with `commands()`, by vehicle.

    The protocol has no time stamps: `now` returns the time of a message [s]. `clock` and `sleep` limit the rate.
    `wait_for_answers(vehicles, timeout)` waits for the commands that follow a scan, and returns whether there are any.
    """

    def __init__(
        self,
        config: Config,
        now: Callable[[], float],
        commands: Callable[[], dict[str, Command]],
        wait_for_answers: Callable[[Collection[str], float], bool] = lambda vehicles, timeout: True,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._config = config
        self._now = now
        self._commands = commands
        self._wait_for_answers = wait_for_answers
        self._clock = clock
        self._sleep = sleep
        self._vehicles: dict[str, _DevkitVehicle] = {}
        self._tick = 0
        self._due = 0.0
        self.resets: set[str] = set()
        """Vehicles whose reset command is true."""
        self.traffic_lights: dict[int, int] = {}
        """Commanded states by number."""
        self.environment: dict[str, float] = {}
        """Commanded time of day and weather, by key."""

    def serve(self, listener: Listener) -> None:
        """Run until the listener is closed. Raises `OSError` if the port is in use."""
        config = self._config
        at = {"host": config.host, "port": config.port or DEVKIT_PORT}
        with Server(lambda data: self.respond(data, listener), **at) as server:
            while not listener.is_closed:
                server.wait(min(listener.max_wait, POLL_INTERVAL))
                if server.is_connected:
                    listener.on_idle()

    def respond(self, data: Mapping[str, Any], listener: Listener) -> dict[str, str] | None:
        """The answer to a message. Malformed messages are answered too: the original simulator waits for it.

        None in lock-step, if the driver has not answered the scan of the message in time.
        """
        scanned: Collection[str] = ()
        try:
            scanned = self._publish(data, listener)
        except PARSE_ERRORS as error:
            listener.warn(f"cannot read a message of the simulator: {error}")
        if not self._config.lockstep:
            self._limit_rate()
        elif scanned and not self._wait_for_answers(scanned, ANSWER_TIME):
            return None
        return self._answer()

    def _limit_rate(self) -> None:
        """Delay the answer: the simulator sends its next message after it."""
        self._sleep(max(min(self._due - self._clock(), MAX_DELAY), 0.0))
        self._due = self._clock() + 1.0 / self._config.rate

    def _publish(self, data: Mapping[str, Any], listener: Listener) -> Collection[str]:
        """Returns the vehicles with a new scan."""
        prefixes = self._prefixes(data)
        if prefixes and prefixes.keys() != self._vehicles.keys():
            infos = {name: VehicleInfo.of(self._config.car, number) for number, name in enumerate(prefixes, start=1)}
            self._vehicles = {
                name: _DevkitVehicle(prefix, self._config, infos[name]) for name, prefix in prefixes.items()
            }
            listener.on_vehicles(infos)
        now = self._now()
        self._tick += 1
        scans: dict[str, LidarScan] = {}
        pictures: dict[tuple[str, str], Picture] = {}
        frames = {}
        for name, vehicle in self._vehicles.items():
            frames[name] = vehicle.update(data, now)
            if vehicle.new_scan is not None:
                scans[name] = vehicle.new_scan
                if text := vehicle.contradiction(name):
                    listener.warn(text)
            pictures |= {(name, camera): picture for camera, picture in vehicle.new_pictures(data, now).items()}
        lights = {n: int(data[key]) for n in range(1, TRAFFIC_LIGHTS + 1) if (key := f"TL{n} State") in data}
        if frames:
            listener.on_update(Update(Frame(now, self._tick, frames, {}, (), True), scans, pictures, lights))
        return scans.keys()

    def _prefixes(self, data: Mapping[str, Any]) -> dict[str, str]:
        """Vehicle -> prefix of its keys."""
        if not self._config.devkit_profile.is_prefixed:
            return {"V1": ""} if "Position" in data else {}
        numbers = sorted(int(match[1]) for key in data if (match := _POSITION.fullmatch(key)))
        return {f"V{number}": f"V{number}" for number in numbers}

    def _answer(self) -> dict[str, str]:
        devkit, answer = self._config.devkit_profile, {}
        for name, command in self._commands().items():
            vehicle = self._vehicles.get(name)
            if vehicle is None:
                continue
            steering = devkit.command_sign * command.steering
            values = {"Throttle": f"{command.throttle:.3f}", "Steering": f"{steering:.3f}"}
            if not self._config.is_league:
                values["Headlights"] = str(int(command.headlights or 0))
                values["Indicators"] = str(int(command.indicators or 0))
            if devkit.has_common_reset:  # the devkits since late 2024
                values["Reset"] = str(name in self.resets)
            answer |= {f"{vehicle.prefix} {key}".lstrip(): text for key, text in values.items()}
            vehicle.command = command
        if devkit.is_prefixed and not self._config.is_league:
            answer |= {f"TL{n} State": str(self.traffic_lights.get(n, 0)) for n in range(1, TRAFFIC_LIGHTS + 1)}
            answer |= {
                key: str(bool(value) if key == "Auto Time" else value) for key, value in self.environment.items()
            }
        return answer


_POSITION = re.compile(r"V(\d{1,4}) Position")


class _DevkitVehicle:
    """Converts the messages of one vehicle. Keeps the last texts, so that unchanged scans and images are skipped."""

    def __init__(self, prefix: str, config: Config, info: VehicleInfo) -> None:
        self.prefix = prefix
        self.command = Command()
        self.new_scan: LidarScan | None = None
        self._config = config
        self._info = info
        self._state = F1TENTH(prefix)
        self._texts: dict[str, tuple[str, float]] = {}
        """Last text of the scan and of each image, and its time [s]."""
        self._is_checked = False
        """Whether a contradiction was reported."""
        self._angle: float | None = None
        self._time = 0.0
        self._speed = 0.0

    def update(self, data: Mapping[str, Any], now: float) -> VehicleFrame:
        """The message as a VehicleFrame; values that the protocol does not have are derived, or NaN."""
        state, devkit = self._state, self._config.devkit_profile
        scan = str(data.get(self._key("LIDAR Range Array"), ""))
        skipped = (
            ("Image",) if scan != self._texts.get("scan", ("",))[0] else ("Image", "LIDAR Range", "LIDAR Intensity")
        )
        state.parse_data({key: text for key, text in data.items() if not any(word in key for word in skipped)})
        is_new = self._is_new("scan", scan, now) or (self._config.lockstep and bool(scan))
        self.new_scan = self._scan(now) if is_new else None
        orientation = np.roll(_vector(state.orientation_quaternion, (0.0, 0.0, 0.0, 1.0)), 1)
        lever = rotate(orientation, devkit.origin)
        position = _vector(state.position, (0.0, 0.0, 0.0)) - lever
        angles = _vector(state.encoder_angles, (0.0, 0.0))
        self._estimate_speed(float(angles.mean()), now)
        angular_velocity = _vector(state.angular_velocity, (0.0, 0.0, 0.0))
        acceleration = _vector(state.linear_acceleration, (0.0, 0.0, 0.0))
        steering = devkit.feedback_sign * (state.steering or 0.0)
        ticks = np.zeros(2, np.int64) if state.encoder_ticks is None else state.encoder_ticks
        euler = np.array(euler_from_quaternion(orientation))
        return VehicleFrame(
            pose=Pose(position, orientation),
            velocity=self._velocity(angular_velocity),
            angular_velocity=angular_velocity,
            throttle=state.throttle or 0.0,
            steering=steering,
            encoders=EncoderReading(now, ticks, angles),
            ips=IpsReading(now, position),
            imu=ImuReading(now, orientation, euler, angular_velocity, acceleration),
            lidar=None,
            lights=self._lights(),
            wheels=self._wheels(steering, angles),
            is_autonomous=True,
            collision_count=state.collision_count or 0,
            race=self._race(),
        )

    def _velocity(self, angular_velocity: np.ndarray) -> np.ndarray:
        """Velocity of the origin of the vehicle frame, in its axes [m/s]."""
        sent = self._state.linear_velocity
        if sent is None or len(sent) != 3:
            return np.array([self._speed, 0.0, 0.0])
        return np.asarray(sent, float) - cross(angular_velocity, self._config.devkit_profile.velocity_at)

    def new_pictures(self, data: Mapping[str, Any], now: float) -> dict[str, Picture]:
        """New images by camera; their pose is unknown."""
        news = {}
        for camera in self._info.cameras:
            text = str(data.get(self._key(f"{camera.capitalize()} Camera Image"), ""))
            if self._is_new(camera, text, now):
                with contextlib.suppress(ValueError):  # damaged images are ignored
                    jpeg = base64.b64decode(text)
                    lens = _pinhole(jpeg, self._config.car)
                    news[camera] = Picture(self.prefix, camera, now, Pose(UNKNOWN[:3], UNKNOWN), lens, jpeg)
        return news

    def _is_new(self, key: str, text: str, now: float) -> bool:
        known, when = self._texts.get(key, ("", -math.inf))
        if not text or (text == known and now - when < REPEAT_INTERVAL):
            return False
        self._texts[key] = text, now
        return True

    def _key(self, name: str) -> str:
        return f"{self.prefix} {name}".lstrip()

    def _estimate_speed(self, angle: float, now: float) -> None:
        """Since 2025 the message has the speed without sign; before, the speed of the rear tyres is used."""
        if self._angle is not None and now > self._time:
            rolled = self._info.wheel_radius * (angle - self._angle) / (now - self._time)
            speed = self._state.speed
            self._speed = rolled if speed is None else math.copysign(speed, rolled)
        self._angle, self._time = angle, now

    def _scan(self, now: float) -> LidarScan | None:
        ranges = self._state.lidar_range_array
        if ranges is None or not len(ranges):
            return None
        intensities, count, car = self._state.lidar_intensity_array, len(ranges), self._config.car
        rate = self._state.lidar_scan_rate or car.lidar_rate
        if intensities is None or len(intensities) != count:
            intensities = np.zeros(count)
        begin, whole = math.radians(car.lidar_angle_min), math.radians(car.lidar_field_of_view)
        # an odd number of rays has both ends of the field of view
        step = whole / (count - 1 if count % 2 and begin else count)
        limits = car.lidar_range_min, car.lidar_range_max
        return LidarScan(now, ranges, intensities, begin, step, *limits, rate, 1.0 / rate, 0.0)

    def contradiction(self, name: str) -> str:
        """Why the new scan is not one of the configured car, the first time; '' otherwise."""
        car, count = self._config.car, 0 if self.new_scan is None else len(self.new_scan.ranges)
        if self._is_checked or abs(count - car.lidar_rays) <= 1:
            return ""
        self._is_checked = True
        known = " or ".join(f"'{family}'" for family in sorted({other.family for other in CARS.values()}))
        return (
            f"{name} has a LIDAR with {count} rays, but a {car.name} has a LIDAR with {car.lidar_rays} rays: {name} is "
            f"not a {car.name}. The devkit protocol does not state the type of {name}, so that frames, angles of the "
            f"LIDAR and limits of {car.name} are used. Set "
            f"vehicle_type to {known}, or use the mode 'direct'"
        )

    def _race(self) -> RaceState | None:
        """Laps and collisions, if the simulator sends them; nothing else of a race is known."""
        state = self._state
        if state.lap_count is None:
            return None
        last, best = (math.inf if time is None else time for time in (state.last_lap_time, state.best_lap_time))
        times = state.lap_time or 0.0, last, best
        count, unknown = state.collision_count or 0, math.nan
        return RaceState(
            RaceStatus.RACING, state.lap_count, 0, *times, unknown, unknown, count, 0, unknown, 0, unknown, False
        )

    def _lights(self) -> Lights:
        """Lights as commanded, without tail lights, which the protocol does not report."""
        headlights = self.command.headlights or Headlights.OFF
        indicators = self.command.indicators or Indicators.OFF
        return Lights(headlights, indicators, TailLights.OFF, bool(indicators & 1), bool(indicators & 2), False)

    def _wheels(self, steering: float, angles: np.ndarray) -> WheelsReading:
        """State of the wheels: both front wheels are steered, and turn as the rear wheel behind them does."""
        left, right = angles.tolist()
        steered = np.array([steering, steering, 0.0, 0.0])
        return WheelsReading(steered, np.array([left, right, left, right]), UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN)


def _vector(values: np.ndarray | None, default: tuple[float, ...]) -> np.ndarray:
    return np.array(default) if values is None or len(values) != len(default) else np.asarray(values, float)


def _pinhole(jpeg: bytes, car: Car) -> CameraIntrinsics:
    """The lens of the car, or of that car of its family whose images have this size.

    An image of another size is a stretched image of the car.
    """
    height, width = map(int, simplejpeg.decode_jpeg_header(jpeg)[:2])
    family = (other for other in (car, *CARS.values()) if other.family == car.family)
    seen = next((other for other in family if other.image_size == (width, height)), car)
    fx, fy = (seen.focal_length * size / own for size, own in zip((width, height), seen.image_size, strict=True))
    return CameraIntrinsics(width, height, fx, fy, 0.5 * width, 0.5 * height)
