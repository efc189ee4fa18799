"""Nigel, F1TENTH and TrafficLight of the AutoDRIVE devkits: parse telemetry, generate commands.

Names, units and signs are those of the devkits of 2022 to 2025, so that their scripts run unchanged. A value that is
missing in a message keeps its last value; the original raises KeyError.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from autodrive.protocol.devkit_profile import STEERING_SIGN

GZIP_IN_BASE64 = "H4s"
"""First characters of base64 of gzip, the format of scans since 2025."""

MaybeNone: TypeAlias = Any
"""Type of None before the first message or command; type checkers require no test for it (as in typeshed)."""


class Vehicle:
    """A vehicle of the simulator, by its name `id` ('V1', 'V2', ...); '' for the simulator of 2020.

    Readings, None until the first message: `throttle` [-1, 1]; `steering` [rad]; `speed` [m/s] (since 2025);
    `encoder_ticks`, `encoder_angles` [rad], shape (2,), left and right; `position` [m], shape (3,);
    `orientation_quaternion` xyzw; `orientation_euler_angles` [rad] in [0, 2 pi), `angular_velocity` [rad/s] and
    `linear_acceleration` [m/s^2], shape (3,); `lidar_scan_rate` [Hz]; `lidar_range_array` [m] with inf for no return,
    straight ahead first, then to the left, and `lidar_intensity_array`;
    `front_camera_image`, `rear_camera_image`: BGR uint8, shape (height, width, 3), decoded on first access.

    Commands: `throttle_command` and `steering_command` [-1, 1]; None sends nothing. A positive steering command turns
    right, as in the simulators of 2020 to 2023; the messages state this sign. With `is_left_positive` it turns left, as
    since 2025; then `reset_command` (soft reset while True) is sent, too, from which the simulator detects the devkit
    generation. For co-simulation, `cosim_mode` 1 holds the vehicle at `posX_command`, `posY_command`, `posZ_command`
    [m] and the quaternion `rotX_command` to `rotW_command`.
    """

    def __init__(self, id: str | None = None, *, is_left_positive: bool = False) -> None:
        self.id = id
        self.throttle: float | MaybeNone = None
        self.steering: float | MaybeNone = None
        self.speed: float | MaybeNone = None
        self.encoder_ticks: NDArray[np.int64] | MaybeNone = None
        self.encoder_angles: NDArray[np.float64] | MaybeNone = None
        self.position: NDArray[np.float64] | MaybeNone = None
        self.orientation_quaternion: NDArray[np.float64] | MaybeNone = None
        self.orientation_euler_angles: NDArray[np.float64] | MaybeNone = None
        self.angular_velocity: NDArray[np.float64] | MaybeNone = None
        self.linear_acceleration: NDArray[np.float64] | MaybeNone = None
        self.lidar_scan_rate: float | MaybeNone = None
        self.lidar_range_array: NDArray[np.float64] | MaybeNone = None
        self.lidar_intensity_array: NDArray[np.float64] | MaybeNone = None
        self.throttle_command: float | MaybeNone = None
        self.steering_command: float | MaybeNone = None
        self.reset_command: bool | None = False if is_left_positive else None
        self.cosim_mode: int | MaybeNone = None
        self.posX_command: float | MaybeNone = None
        self.posY_command: float | MaybeNone = None
        self.posZ_command: float | MaybeNone = None
        self.rotX_command: float | MaybeNone = None
        self.rotY_command: float | MaybeNone = None
        self.rotZ_command: float | MaybeNone = None
        self.rotW_command: float | MaybeNone = None
        self._readings = _READINGS
        self._steering_sign = None if is_left_positive else "right"
        self._images: dict[str, str | NDArray[np.uint8]] = {}

    @property
    def front_camera_image(self) -> NDArray[np.uint8] | MaybeNone:
        """BGR uint8, shape (height, width, 3); None before the first."""
        return self._image("Front Camera Image")

    @property
    def rear_camera_image(self) -> NDArray[np.uint8] | MaybeNone:
        """BGR uint8, shape (height, width, 3); None before the first."""
        return self._image("Rear Camera Image")

    def parse_data(self, data: Mapping[str, Any], verbose: bool = False) -> None:
        """Read the values of this vehicle from a telemetry message; `verbose` prints them."""
        for attribute, (key, read) in self._readings.items():
            if (text := data.get(self._prefix + key)) is not None:
                setattr(self, attribute, read(text))
        for key in ("Front Camera Image", "Rear Camera Image"):
            if text := data.get(self._prefix + key):
                self._images[key] = text
        if verbose:
            self._print("Receive Data from", [*self._readings])

    def generate_commands(self, verbose: bool = False) -> dict[str, str]:
        """The commands as a message to the simulator; unset commands are omitted. `verbose` prints them."""
        values = {key: getattr(self, attribute, None) for attribute, key in _COMMANDS.items()}
        if self.steering_command is not None:
            values[STEERING_SIGN] = self._steering_sign
        if verbose:
            self._print("Transmit Data to", [attribute for attribute in _COMMANDS if hasattr(self, attribute)])
        return {self._prefix + key: str(value) for key, value in values.items() if value is not None}

    @property
    def _prefix(self) -> str:
        return f"{self.id} " if self.id else ""

    def _image(self, key: str) -> NDArray[np.uint8] | None:
        kept = self._images.get(key)
        if isinstance(kept, str):
            kept = self._images[key] = simplejpeg.decode_jpeg(base64.b64decode(kept), colorspace="BGR")
        return kept

    def _print(self, title: str, attributes: list[str]) -> None:
        print(f"\n-- {title} {self.id or 'the vehicle'} --")
        for attribute in attributes:
            print(f"{attribute.replace('_', ' '):<26} {getattr(self, attribute)}")


class Nigel(Vehicle):
    """The 1:14 car: a `Vehicle` with lights.

    `headlights_command`: 0 off, 1 low, 2 high. `indicators_command`: 0 off, 1 left, 2 right, 3 hazard.
    """

    def __init__(self, id: str | None = None, *, is_left_positive: bool = False) -> None:
        super().__init__(id, is_left_positive=is_left_positive)
        self.headlights_command: int | MaybeNone = None
        self.indicators_command: int | MaybeNone = None


class F1TENTH(Vehicle):
    """The 1:10 racing car, also called RoboRacer: a `Vehicle` without lights, with the readings of a race.

    More readings: `linear_velocity` in the vehicle frame [m/s], shape (3,); `lap_count`; `lap_time` [s];
    `last_lap_time`, `best_lap_time` [s], infinite until there is one; `collision_count`. A positive steering command
    turns left, as in all devkits of this car.
    """

    def __init__(self, id: str | None = None, *, is_left_positive: bool = True) -> None:
        super().__init__(id, is_left_positive=is_left_positive)
        self.linear_velocity: NDArray[np.float64] | MaybeNone = None
        self.lap_count: int | MaybeNone = None
        self.lap_time: float | MaybeNone = None
        self.last_lap_time: float | MaybeNone = None
        self.best_lap_time: float | MaybeNone = None
        self.collision_count: int | MaybeNone = None
        self._readings = _READINGS | _RACE_READINGS


RoboRacer = F1TENTH
"""The name of the class in devkits since 2025."""


class TrafficLight:
    """A traffic light, by its name `id` ('TL1' to 'TL4'): `state` and `command` 0 off, 1 red, 2 yellow, 3 green."""

    def __init__(self, id: str | None = None) -> None:
        self.id = id
        self.state: int | None = None
        self.command: int | None = None

    def parse_data(self, data: Mapping[str, Any], verbose: bool = False) -> None:
        """Read the state of this light from a telemetry message; `verbose` prints it."""
        if (text := data.get(f"{self.id} State")) is not None:
            self.state = int(text)
        if verbose:
            print(f"{self.id} state: {self.state}")

    def generate_commands(self, verbose: bool = False) -> dict[str, str]:
        """The command as a message to the simulator; empty if unset. `verbose` prints it."""
        if verbose:
            print(f"{self.id} command: {self.command}")
        return {} if self.command is None else {f"{self.id} State": str(self.command)}


def _numbers(text: str) -> NDArray[np.float64]:
    return np.array(text.split(), dtype=np.float64)


def _integer(text: str) -> int:
    return int(float(text))


def _integers(text: str) -> NDArray[np.int64]:
    return _numbers(text).astype(np.int64)


def _scan(text: str) -> NDArray[np.float64]:
    """Parse a scan: text, or base64 of gzip of text."""
    return _numbers(gzip.decompress(base64.b64decode(text)).decode() if text.startswith(GZIP_IN_BASE64) else text)


_READINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "throttle": ("Throttle", float),
    "steering": ("Steering", float),
    "speed": ("Speed", float),
    "encoder_ticks": ("Encoder Ticks", _integers),
    "encoder_angles": ("Encoder Angles", _numbers),
    "position": ("Position", _numbers),
    "orientation_quaternion": ("Orientation Quaternion", _numbers),
    "orientation_euler_angles": ("Orientation Euler Angles", _numbers),
    "angular_velocity": ("Angular Velocity", _numbers),
    "linear_acceleration": ("Linear Acceleration", _numbers),
    "lidar_scan_rate": ("LIDAR Scan Rate", float),
    "lidar_range_array": ("LIDAR Range Array", _scan),
    "lidar_intensity_array": ("LIDAR Intensity Array", _scan),
}
"""Attribute -> key of the message without prefix, and parser of its text."""

_RACE_READINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "linear_velocity": ("Linear Velocity", _numbers),
    "lap_count": ("Lap Count", _integer),
    "lap_time": ("Lap Time", float),
    "last_lap_time": ("Last Lap Time", float),
    "best_lap_time": ("Best Lap Time", float),
    "collision_count": ("Collisions", _integer),
}
"""Attribute -> key and parser, as in `_READINGS`, of the readings that only `F1TENTH` has."""

_COMMANDS = {
    "throttle_command": "Throttle",
    "steering_command": "Steering",
    "headlights_command": "Headlights",
    "indicators_command": "Indicators",
    "reset_command": "Reset",
    "cosim_mode": "CoSim",
    **{f"{kind}{axis}_command": f"{kind.title()}{axis}" for kind in ("pos", "rot") for axis in "XYZ"},
    "rotW_command": "RotW",
}
