"""Any AutoDRIVE simulator by the devkits' protocol: the server that it connects to, and its texts as Frames."""

from __future__ import annotations

import base64
import contextlib
import math
import re
import time
import zlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import simplejpeg

from autodrive.devkit import Server, Vehicle
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
    TailLights,
    VehicleFrame,
    WheelsReading,
)
from autodrive.protocol.native import Picture
from autodrive.ros.config import Config
from autodrive.ros.direct import LOOK, Listener
from autodrive.ros.update import Car, Update
from autodrive.transforms import euler_from_quaternion, rotate

FIELD_OF_VIEW = 41.669
"""Vertical, of the cameras (report, table 8) [deg]."""
RANGE_MIN, RANGE_MAX = 0.15, 12.0
"""Of the LIDAR (report, table 7) [m]."""
CAMERAS = ("front", "rear")
LONGEST_REST = 0.5
"""A simulator that hears nothing for longer may think that its message was lost [s]."""
NONSENSE = (ValueError, TypeError, ArithmeticError, EOFError, OSError, zlib.error)
"""What reading texts raises that mean nothing: numbers, arrays, base64, gzip."""
UNKNOWN = np.full(4, math.nan)
REPEAT = 0.2
"""Where nothing moves, a scan or a picture is the same as before: it is told again after that time [s]."""


class DevkitSource:
    """Has the listener take each message of a simulator, and answers it with the commands of `commands()`, by name.

    Nothing tells the time: `now` does [s].
    """

    def __init__(self, config: Config, now: Callable[[], float], commands: Callable[[], dict[str, Command]]) -> None:
        self._config = config
        self._now = now
        self._commands = commands
        self._cars: dict[str, _Car] = {}
        self._tick = 0
        self._due = 0.0
        self.resets: set[str] = set()
        """Vehicles for which a reset is held."""
        self.traffic_lights: dict[int, int] = {}
        """Commanded states by number."""

    def serve(self, listener: Listener) -> None:
        """Until the listener has ended. Raises `OSError` if the port is taken."""
        host, _, port = self._config.address.rpartition(":")
        with Server(lambda data: self._respond(data, listener), host=host, port=int(port)) as server:
            while not listener.is_ended:
                server.wait(min(listener.patience, LOOK))
                listener.idle()

    def _respond(self, data: Mapping[str, Any], listener: Listener) -> dict[str, str]:
        """Whatever was told is answered: the original simulator waits for it."""
        try:
            self._tell(data, listener)
        except NONSENSE as error:
            listener.complain(f"a message of the simulator was not understood: {error}")
        self._rest()
        return self._answer()

    def _rest(self) -> None:
        """An answer brings the next message: it need not come sooner than it is published."""
        time.sleep(max(min(self._due - time.monotonic(), LONGEST_REST), 0.0))
        self._due = time.monotonic() + 1.0 / self._config.rate

    def _tell(self, data: Mapping[str, Any], listener: Listener) -> None:
        names = self._names(data)
        if names and names.keys() != self._cars.keys():
            cars = {name: Car(number, "", CAMERAS) for number, name in enumerate(names, start=1)}
            self._cars = {name: _Car(prefix, self._config, cars[name]) for name, prefix in names.items()}
            listener.begin(cars)
        now = self._now()
        self._tick += 1
        scans: dict[str, LidarScan] = {}
        pictures: dict[tuple[str, str], Picture] = {}
        frames = {}
        for name, car in self._cars.items():
            frames[name] = car.take(data, now)
            if car.new_scan is not None:
                scans[name] = car.new_scan
            pictures |= {(name, camera): picture for camera, picture in car.new_pictures(data, now).items()}
        lights = {n: int(data[key]) for n in range(1, TRAFFIC_LIGHTS + 1) if (key := f"TL{n} State") in data}
        if frames:
            listener.take(Update(Frame(now, self._tick, frames, {}, (), True), scans, pictures, lights))

    def _names(self, data: Mapping[str, Any]) -> dict[str, str]:
        """Vehicle -> what stands before its keys."""
        if not self._config.era.is_prefixed:
            return {"V1": ""} if "Position" in data else {}
        numbers = sorted(int(match[1]) for key in data if (match := _POSITION.fullmatch(key)))
        return {f"V{number}": f"V{number}" for number in numbers}

    def _answer(self) -> dict[str, str]:
        era, answer = self._config.era, {}
        for name, command in self._commands().items():
            car = self._cars.get(name)
            if car is None:
                continue
            told = {"Throttle": f"{command.throttle:.3f}", "Steering": f"{era.command_sign * command.steering:.3f}"}
            told["Headlights"] = str(int(command.headlights or 0))
            told["Indicators"] = str(int(command.indicators or 0))
            if era.name == "2025":
                told["Reset"] = str(name in self.resets)
            answer |= {f"{car.prefix} {key}".lstrip(): text for key, text in told.items()}
            car.command = command
        if era.is_prefixed:
            answer |= {f"TL{n} State": str(self.traffic_lights.get(n, 0)) for n in range(1, TRAFFIC_LIGHTS + 1)}
        return answer


_POSITION = re.compile(r"V(\d{1,4}) Position")


class _Car:
    """One vehicle of the simulator; remembers what was told, so that only what is new is read."""

    def __init__(self, prefix: str, config: Config, car: Car) -> None:
        self.prefix = prefix
        self.command = Command()
        self.new_scan: LidarScan | None = None
        self._config = config
        self._car = car
        self._told = Vehicle(prefix)
        self._texts: dict[str, tuple[str, float]] = {}
        """Scan and pictures as they were told last, and when [s]."""
        self._angle: float | None = None
        self._time = 0.0
        self._speed = 0.0

    def take(self, data: Mapping[str, Any], now: float) -> VehicleFrame:
        """As a Frame; what the devkits are not told is unknown, or follows from what they are."""
        told, era = self._told, self._config.era
        scan = str(data.get(self._key("LIDAR Range Array"), ""))
        skipped = (
            ("Image",) if scan != self._texts.get("scan", ("",))[0] else ("Image", "LIDAR Range", "LIDAR Intensity")
        )
        told.parse_data({key: text for key, text in data.items() if not any(word in key for word in skipped)})
        self.new_scan = self._scan(now) if self._is_news("scan", scan, now) else None
        orientation = np.roll(_vector(told.orientation_quaternion, (0.0, 0.0, 0.0, 1.0)), 1)
        lever = rotate(orientation, era.origin)
        position = _vector(told.position, (0.0, 0.0, 0.0)) - lever
        angles = _vector(told.encoder_angles, (0.0, 0.0))
        self._measure_speed(float(angles.mean()), now)
        turn = _vector(told.angular_velocity, (0.0, 0.0, 0.0))
        acceleration = _vector(told.linear_acceleration, (0.0, 0.0, 0.0))
        steering = era.feedback_sign * (told.steering or 0.0)
        ticks = np.zeros(2, np.int64) if told.encoder_ticks is None else told.encoder_ticks
        return VehicleFrame(
            pose=Pose(position, orientation),
            velocity=np.array([self._speed, 0.0, 0.0]),
            angular_velocity=turn,
            throttle=told.throttle or 0.0,
            steering=steering,
            encoders=EncoderReading(now, ticks, angles),
            ips=IpsReading(now, position),
            imu=ImuReading(now, orientation, np.array(euler_from_quaternion(orientation)), turn, acceleration),
            lidar=None,
            lights=self._lights(),
            wheels=self._wheels(steering, angles),
            is_autonomous=True,
            collision_count=0,
        )

    def new_pictures(self, data: Mapping[str, Any], now: float) -> dict[str, Picture]:
        """Those that are news, by camera; their pose is not known."""
        news = {}
        for camera in CAMERAS:
            text = str(data.get(self._key(f"{camera.capitalize()} Camera Image"), ""))
            if self._is_news(camera, text, now):
                with contextlib.suppress(ValueError):  # a picture that is damaged is none
                    jpeg = base64.b64decode(text)
                    news[camera] = Picture(self.prefix, camera, now, Pose(UNKNOWN[:3], UNKNOWN), _pinhole(jpeg), jpeg)
        return news

    def _is_news(self, of: str, text: str, now: float) -> bool:
        known, when = self._texts.get(of, ("", -math.inf))
        if not text or (text == known and now - when < REPEAT):
            return False
        self._texts[of] = text, now
        return True

    def _key(self, name: str) -> str:
        return f"{self.prefix} {name}".lstrip()

    def _measure_speed(self, angle: float, now: float) -> None:
        """Since 2025 it is told, without its sign; before, that of the rear wheels' tread is taken."""
        if self._angle is not None and now > self._time:
            rolled = self._car.wheel_radius * (angle - self._angle) / (now - self._time)
            told = self._told.speed
            self._speed = rolled if told is None else math.copysign(told, rolled)
        self._angle, self._time = angle, now

    def _scan(self, now: float) -> LidarScan | None:
        ranges = self._told.lidar_range_array
        if ranges is None or not len(ranges):
            return None
        intensities, count = self._told.lidar_intensity_array, len(ranges)
        rate = self._told.lidar_scan_rate or 7.0
        if intensities is None or len(intensities) != count:
            intensities = np.zeros(count)
        step = 2.0 * math.pi / count
        return LidarScan(now, ranges, intensities, 0.0, step, RANGE_MIN, RANGE_MAX, rate, 1.0 / rate, 0.0)

    def _lights(self) -> Lights:
        """As commanded."""
        headlights = self.command.headlights or Headlights.OFF
        indicators = self.command.indicators or Indicators.OFF
        return Lights(headlights, indicators, TailLights.OFF, bool(indicators & 1), bool(indicators & 2), False)

    def _wheels(self, steering: float, angles: np.ndarray) -> WheelsReading:
        """Both front wheels turn as the middle one would; the rear ones as the encoders say."""
        left, right = angles.tolist()
        turned = np.array([steering, steering, 0.0, 0.0])
        return WheelsReading(turned, np.array([left, right, left, right]), UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN)


def _vector(told: np.ndarray | None, otherwise: tuple[float, ...]) -> np.ndarray:
    return np.array(otherwise) if told is None or len(told) != len(otherwise) else np.asarray(told, float)


def _pinhole(jpeg: bytes) -> CameraIntrinsics:
    height, width = map(int, simplejpeg.decode_jpeg_header(jpeg)[:2])
    focal = 0.5 * height / math.tan(math.radians(0.5 * FIELD_OF_VIEW))
    return CameraIntrinsics(width, height, focal, focal, 0.5 * width, 0.5 * height)
