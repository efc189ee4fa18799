"""Converts Frames and Commands to and from the messages of the AutoDRIVE devkits of 2020 to 2026; no I/O.

Telemetry is a dictionary of texts; commands are a dictionary of texts or numbers. A `Profile` holds the differences
between devkit generations (`devkit_profile.py`). Only this module uses right-positive steering, quaternions xyzw and
angles in [0, 2 pi).

Intentional differences from the original, on which its own clients fail: every message contains a scan and a scan rate
above 0 (the 2025 build omits the keys before the first scan, and its devkit raises KeyError; ROS bridges divide by the
rate); no decimal commas; no jump of the Euler angles near 0; base64 texts never contain the letters `null` (the C++
devkit rejects such a message).
"""

from __future__ import annotations

import base64
import gzip
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import simplejpeg

from autodrive.base.transforms import rotate
from autodrive.protocol.commands import MAX_DISTANCE
from autodrive.protocol.devkit_profile import (
    COMMAND_KEYS,
    COMMON_RESET,
    PROFILES,
    STEERING_SIGN,
    VEHICLE_KEY,
    DevkitKeys,
    DevkitSettings,
    LidarFormat,
    Profile,
)
from autodrive.protocol.messages import (
    Command,
    Headlights,
    Hold,
    Indicators,
    LidarScan,
    Operation,
    SetTimeOfDay,
    SetTrafficLight,
    SetWeather,
    TrafficLightState,
    Weather,
)
from autodrive.protocol.weather import PRESETS

if TYPE_CHECKING:
    from autodrive.protocol.messages import Array, Frame, VehicleFrame

Images = Mapping[tuple[str, str], bytes]
"""JPEG images by (name of the vehicle, name of the camera: "front" or "rear")."""

ImageSizes = Mapping[tuple[str, str], tuple[int, int]]
"""Width and height [pixels] by (name of the vehicle, name of the camera)."""

ORIGINAL_IMAGE_SIZE = 1280, 720
"""Width and height of the images of the original simulator [pixels]."""

TRAFFIC_LIGHTS = 4
"""Number of `TL<n> State` keys; the published Nigel scripts read exactly four."""

# -- telemetry: simulator to devkit ------------------------------------------------------------------------------


def telemetry(
    frame: Frame,
    profile: Profile,
    *,
    traffic_lights: Mapping[int, int] | None = None,
    images: Images | None = None,
    image_sizes: ImageSizes | None = None,
) -> dict[str, str]:
    """Telemetry message of all vehicles (2020: the first vehicle only), with the key order of the original.

    The cars of the traffic are left out.

    Vehicle i of the frame is 'V<i+1>'. 'TL<n>' is traffic light n of the map; `traffic_lights` holds states by number
    from 1 of those that the map does not have, missing ones are 0 (disabled).
    A camera without an image in `images` is sent as a black image of its size in `image_sizes`: scripts read the image
    keys of all cameras of their profile. A vehicle without a LIDAR sends a scan without returns.
    """
    vehicles = [(name, vehicle) for name, vehicle in frame.vehicles.items() if not vehicle.is_traffic]
    if not profile.is_prefixed:
        return {
            key: text
            for name, vehicle in vehicles[:1]
            for key, text in _vehicle_telemetry(name, vehicle, profile, images, image_sizes)
        }
    shown = {**(traffic_lights or {}), **{n: light.state for n, light in enumerate(frame.traffic_lights.values(), 1)}}
    data = {f"TL{n} State": str(int(shown.get(n, 0))) for n in range(1, TRAFFIC_LIGHTS + 1)}
    for i, (name, vehicle) in enumerate(vehicles, start=1):
        data |= {f"V{i} {key}": text for key, text in _vehicle_telemetry(name, vehicle, profile, images, image_sizes)}
    return data


def initial_telemetry(
    frame: Frame,
    *,
    settings: DevkitSettings | None = None,
    lidar: LidarFormat | None = "text",
    traffic_lights: Mapping[int, int] | None = None,
    images: Images | None = None,
    image_sizes: ImageSizes | None = None,
) -> dict[str, str]:
    """Telemetry message for a script of an unknown profile: the keys of all profiles at once.

    No scan format suits all: a 2025 devkit raises on text; a 2023 devkit raises on gzip (NumPy 2) or reads no values
    (NumPy 1). A script that cannot read `lidar` does not answer. All read None, an empty scan.
    """
    formats: tuple[tuple[str, DevkitKeys, LidarFormat | None], ...]
    formats = ("2025", "prefixed", lidar), ("2020", "plain", "text")
    data: dict[str, str] = {}
    for year, keys, lidar_format in formats:
        profile = (settings or DevkitSettings()).applied_to(PROFILES[year])
        profile = replace(profile, keys=keys, lidar=lidar_format, has_race=keys == "prefixed")
        data |= telemetry(frame, profile, traffic_lights=traffic_lights, images=images, image_sizes=image_sizes)
    return data


def expected_size(frame: Frame, image_sizes: ImageSizes) -> int:
    """Length that a telemetry message is expected not to exceed [characters]; a multiple of 4.

    At quality 75 a JPEG of a road has at most 0.11 bytes a pixel (measured); 0.2 are expected. Base64 has 4 characters
    for 3 bytes.
    """
    pixels = sum(width * height for width, height in image_sizes.values())
    numbers = sum(2000 + 20 * len((vehicle.lidar or _NO_RETURNS).ranges) for vehicle in frame.vehicles.values())
    return 4 * math.ceil((0.2 * 4.0 / 3.0 * pixels + numbers) / 4.0)


def _vehicle_telemetry(
    name: str, vehicle: VehicleFrame, profile: Profile, images: Images | None, image_sizes: ImageSizes | None
) -> Iterable[tuple[str, str]]:
    """Keys without prefix, and their values."""

    def text(*values: float) -> str:
        return " ".join(f"{value:z.{profile.decimals}f}" for value in values)  # z: never "-0.000"

    imu = vehicle.imu
    w, x, y, z = imu.orientation.tolist()
    yield "Throttle", text(vehicle.throttle)
    yield "Steering", text(profile.feedback_sign * vehicle.steering)
    if profile.has_speed:
        yield "Speed", text(abs(vehicle.speed))
    if profile.has_race:
        yield "Linear Velocity", text(*profile.velocity(vehicle))
    yield "Encoder Ticks", " ".join(map(str, vehicle.encoders.ticks.tolist()))
    yield "Encoder Angles", text(*vehicle.encoders.angles.tolist())
    lever = rotate((w, x, y, z), profile.origin)
    yield "Position", text(*(p + d for p, d in zip(vehicle.ips.position.tolist(), lever, strict=True)))
    yield "Orientation Quaternion", text(x, y, z, w)
    yield "Orientation Euler Angles", text(*(_full_turn(angle, profile.decimals) for angle in imu.euler.tolist()))
    yield "Angular Velocity", text(*imu.angular_velocity.tolist())
    yield "Linear Acceleration", text(*imu.linear_acceleration.tolist())
    scan = vehicle.lidar or _NO_RETURNS
    yield "LIDAR Scan Rate", text(scan.scan_rate)
    yield "LIDAR Range Array", _scan_text(scan, scan.ranges, profile)
    yield "LIDAR Intensity Array", _scan_text(scan, scan.intensities, profile)
    for camera in ("front", "rear"):
        jpeg = images.get((name, camera)) if images else None
        size = (image_sizes or {}).get((name, camera))
        if camera in profile.cameras or jpeg or size:
            black = black_image(*(size or ORIGINAL_IMAGE_SIZE))
            yield f"{camera.capitalize()} Camera Image", (_image_text(jpeg) if jpeg else None) or black
    if profile.has_race:
        yield from _race_telemetry(vehicle, text)


def _race_telemetry(vehicle: VehicleFrame, text: Callable[[float], str]) -> Iterable[tuple[str, str]]:
    """Laps and collisions; without a race, as before the first lap.

    A time that is infinite is 'Infinity', as Unity writes it in English; `float` of Python reads it.
    """
    race = vehicle.race
    yield "Lap Count", str(race.lap_count) if race else "0"
    times = (race.lap_time, race.last_lap_time, race.best_lap_time) if race else (0.0, math.inf, math.inf)
    for key, time in zip(("Lap Time", "Last Lap Time", "Best Lap Time"), times, strict=True):
        yield key, text(time) if math.isfinite(time) else "Infinity"
    yield "Collisions", str(race.collision_count if race else vehicle.collision_count)


_NO_RETURNS = LidarScan(
    time=0.0,
    ranges=np.full(360, math.inf),
    intensities=np.zeros(360),
    angle_min=0.0,
    angle_increment=math.radians(1.0),
    range_min=0.15,
    range_max=12.0,
    scan_rate=7.0,
    scan_time=1.0 / 7.0,
    time_increment=0.0,
)
"""Sent for a vehicle without a LIDAR, with the figures of the report's LIDAR: scripts divide by the rate."""


def _full_turn(angle: float, decimals: int) -> float:
    """The angle in [0, 2 pi); 0 if it is 2 pi within rounding, so that the text does not flicker for angles near 0."""
    angle %= 2.0 * math.pi
    return 0.0 if 2.0 * math.pi - angle <= 0.5 * 10.0**-decimals else angle


def _scan_text(scan: LidarScan, values: Array, profile: Profile) -> str:
    """One value per ray, 'inf' without a return. A full-circle scan starts straight ahead and turns left."""
    if profile.lidar is None:
        return ""
    is_circle = abs(len(values) * scan.angle_increment - 2.0 * math.pi) < 0.5 * scan.angle_increment
    ahead = round(-scan.angle_min / scan.angle_increment) if is_circle else 0
    texts = [f"{value:.7g}" if math.isfinite(value) else "inf" for value in np.roll(values, -ahead).tolist()]
    return " ".join(texts) if profile.lidar == "text" else _gzip_text("\n".join(texts))


def _gzip_text(text: str) -> str:
    """Base64 of gzip without the letters null; level 0 stores plain ASCII, of which no three bytes encode to null."""
    packed = (base64.b64encode(gzip.compress(text.encode(), level, mtime=0)).decode() for level in (6, 9, 1, 0))
    return next(candidate for candidate in packed if "null" not in candidate)


def _image_text(jpeg: bytes) -> str | None:
    """Base64 of a JPEG without the letters null; None if impossible (one of 100 000 images of 400 kB).

    A JPEG comment of a few bytes at the front shifts all following bytes: other letters, the same image.
    """
    comments = (b"", b"\xff\xfe\x00\x02", b"\xff\xfe\x00\x03 ")  # shifts of 0, 4, 5 bytes: base64 has three alignments
    packed = (base64.b64encode(jpeg[:2] + comment + jpeg[2:]).decode() for comment in comments)
    return next((candidate for candidate in packed if "null" not in candidate), None)


@cache
def black_image(width: int, height: int) -> str:
    """Base64 of a black JPEG, sent for a camera without an image because scripts always decode one."""
    jpeg = simplejpeg.encode_jpeg(np.zeros((height, width, 3), np.uint8), colorspace="RGB", colorsubsampling="420")
    text = _image_text(jpeg)
    assert text is not None
    return text


# -- commands: devkit to simulator -------------------------------------------------------------------------------


@dataclass
class DevkitCommands:
    """Content of one message of a devkit script."""

    commands: dict[str, Command] = field(default_factory=dict)
    """New commands by vehicle, for the vehicles that the message addresses."""
    traffic_lights: dict[int, int] = field(default_factory=dict)
    """New states by number from 1: 0 disabled, 1 red, 2 yellow, 3 green."""
    resets: dict[str, bool] = field(default_factory=dict)
    """Whether 'Reset' is held, by vehicle; a change to True requests a reset."""
    holds: dict[str, Hold] = field(default_factory=dict)
    """Poses of co-simulated vehicles, by vehicle; a vehicle whose co-simulation is off is no longer held."""
    environment: dict[str, float] = field(default_factory=dict)
    """Time of day and weather, by the keys of `ENVIRONMENT`."""
    refused: list[str] = field(default_factory=list)
    """An error text for each refused value."""
    ignored: list[str] = field(default_factory=list)
    """Keys without effect."""


_LIGHT_KEY = re.compile(r"(?:TL(\d{1,4}) State|Traffic Light (\d{1,4}))")  # the second only in 2021


def read_commands(data: Mapping[str, object], profile: Profile, previous: Mapping[str, Command]) -> DevkitCommands:
    """Parse a command message; never raises.

    `previous` holds the latest command of every vehicle, in the order V1, V2 ...: each key is optional, and a missing
    one keeps its last value. Numbers are texts or JSON numbers and are clamped; None (never set by the user) is
    ignored; values that are not finite numbers are refused. Keys of other features (brakes ...) have no effect.
    """
    result = DevkitCommands()
    poses: dict[str, dict[str, float]] = {}
    for key, value in data.items():
        if value is None or value in ("None", ""):
            continue
        try:
            _read_value(key, value, profile, previous, result, poses)
        except ValueError as error:
            result.refused.append(f"{key}: {error}")
    for vehicle, pose in poses.items():
        try:
            if "CoSim" in pose:
                result.holds[vehicle] = _hold(vehicle, pose)
        except ValueError as error:
            result.refused.append(f"co-simulation of {vehicle}: {error}")
    return result


def _hold(vehicle: str, pose: Mapping[str, float]) -> Hold:
    """What the keys of co-simulation request."""
    if not pose["CoSim"]:
        return Hold(vehicle, None)
    if missing := [key for key in _POSE_KEYS if key not in pose]:
        raise ValueError(f"the pose is not complete: {', '.join(missing)} missing")
    px, py, pz, x, y, z, w = (pose[key] for key in _POSE_KEYS)
    if max(abs(px), abs(py), abs(pz)) > MAX_DISTANCE:
        raise ValueError(f"a position must be from {-MAX_DISTANCE:g} to {MAX_DISTANCE:g} m")
    if not 1e-6 <= math.hypot(x, y, z, w) <= 1e6:
        raise ValueError("the length of the quaternion must be above 0 and at most 1e6")
    return Hold(vehicle, (px, py, pz), (w, x, y, z))


_POSE_KEYS = ("PosX", "PosY", "PosZ", "RotX", "RotY", "RotZ", "RotW")

ENVIRONMENT = {
    "Auto Time": (0.0, 1.0),
    "Time Scale": (0.0, 1e6),
    "Time": (0.0, 1440.0),
    "Weather": (0.0, 8.0),
    "Clouds": (0.0, 1.0),
    "Fog": (0.0, 1.0),
    "Rain": (0.0, 1.0),
    "Snow": (0.0, 1.0),
}
"""Smallest and largest value of each key of time of day and weather, since 2023. 'Time': minutes since midnight, used
without 'Auto Time'; 'Time Scale': seconds of the day per second, used with it."""


def light_operations(before: Mapping[int, int], now: Mapping[int, int], lights: Sequence[str]) -> list[Operation]:
    """What a script requests that has changed the states of traffic lights, by number from 1.

    `lights`: names of the traffic lights of the map. A light that is set to 0 follows its program again.
    """
    return [
        SetTrafficLight(light, TrafficLightState(state) if state else None)
        for number, light in enumerate(lights, 1)
        if (state := now.get(number, 0)) != before.get(number, 0)
    ]


TIME_SCALE = 60.0
"""Time scale of a script that sends none: the default of the devkit of 2025."""


def environment_operations(before: Mapping[str, float], now: Mapping[str, float]) -> list[Operation]:
    """What a script requests that has changed the values of `ENVIRONMENT`: time of day and weather."""
    auto, scale, time = (
        [environment.get(key) for environment in (before, now)] for key in ("Auto Time", "Time Scale", "Time")
    )
    operations: list[Operation] = []
    if auto[1] and (auto[0] != auto[1] or scale[0] != scale[1]):
        operations.append(SetTimeOfDay(None, TIME_SCALE if scale[1] is None else scale[1]))
    elif not auto[1] and time[1] is not None and (auto[0], time[0]) != (auto[1], time[1]):
        operations.append(SetTimeOfDay(60.0 * time[1]))
    if weather(now) != weather(before):
        operations.append(SetWeather(weather(now)))
    return operations


def weather(environment: Mapping[str, float]) -> Weather:
    """The weather that a script has set.

    'Weather' is a number of `PRESETS` from 1, or 0 for the amounts of the other keys, which are used without it, too.
    """
    if number := int(environment.get("Weather", 0.0)):
        return [*PRESETS.values()][number - 1]
    return Weather(**{key.lower(): environment.get(key, 0.0) for key in ("Clouds", "Fog", "Rain", "Snow")})


def _read_value(
    key: str,
    value: object,
    profile: Profile,
    previous: Mapping[str, Command],
    result: DevkitCommands,
    poses: dict[str, dict[str, float]],
) -> None:
    if key in ENVIRONMENT:
        result.environment[key] = float(_truth(value)) if key == "Auto Time" else _within(value, *ENVIRONMENT[key])
    elif light := _LIGHT_KEY.fullmatch(key):
        number = int(light[1] or light[2])
        if not 1 <= number <= TRAFFIC_LIGHTS:
            raise ValueError(f"unknown traffic light; known: 1 to {TRAFFIC_LIGHTS}")
        result.traffic_lights[number] = _integer(value, most=3)
    elif profile.has_common_reset and key == COMMON_RESET:
        is_held = _truth(value)
        result.resets |= {vehicle: is_held or result.resets.get(vehicle, False) for vehicle in previous}
    else:
        _read_vehicle_value(key, value, profile, previous, result, poses)


def _read_vehicle_value(
    key: str,
    value: object,
    profile: Profile,
    previous: Mapping[str, Command],
    result: DevkitCommands,
    poses: dict[str, dict[str, float]],
) -> None:
    number, name = _address(key, profile)
    if name not in _VEHICLE_KEYS:
        if name != STEERING_SIGN:  # the profile has it
            result.ignored.append(key)
        return
    if not 1 <= number <= len(previous):
        raise ValueError(f"unknown vehicle; the number of a vehicle must be from 1 to {len(previous)}")
    vehicle = list(previous)[number - 1]
    if name == "Reset":
        result.resets[vehicle] = _truth(value) or result.resets.get(vehicle, False)
    elif name in _READ:
        command = result.commands.get(vehicle, previous[vehicle])
        change = {name.lower(): _READ[name](value, profile)}
        result.commands[vehicle] = msgspec.structs.replace(command, **change)
    else:
        poses.setdefault(vehicle, {})[name] = float(_truth(value)) if name == "CoSim" else _number(value)


_READ: dict[str, Callable[[object, Profile], object]] = {
    "Throttle": lambda value, _: _fraction(value),
    "Steering": lambda value, profile: profile.command_sign * _fraction(value),
    "Headlights": lambda value, _: Headlights(_integer(value, most=2)),
    "Indicators": lambda value, _: Indicators(_integer(value, most=3)),
}
"""Reads the value of each field of a Command."""

_VEHICLE_KEYS = COMMAND_KEYS | {"Reset", "CoSim", *_POSE_KEYS}


def _address(key: str, profile: Profile) -> tuple[int, str]:
    """Number of the vehicle and the key without prefix; (0, "") if the profile has no such key."""
    own = VEHICLE_KEY.fullmatch(key)
    if profile.is_prefixed:
        return (int(own[1]), own[2]) if own else (0, "")
    return (0, "") if own else (1, key)


def _number(value: object) -> float:
    if not isinstance(value, bool) and isinstance(value, str | int | float):
        try:
            number = float(value)
        except (ValueError, OverflowError):
            number = math.nan
        if math.isfinite(number):
            return number
    raise ValueError(f"must be a finite number, not {_shown(value)}")


def _within(value: object, least: float, most: float) -> float:
    number = _number(value)
    if not least <= number <= most:
        raise ValueError(f"must be from {least:g} to {most:g}, not {number:g}")
    return number


def _fraction(value: object) -> float:
    return min(max(_number(value), -1.0), 1.0)


def _integer(value: object, *, most: int) -> int:
    return round(min(max(_number(value), 0), most))


def _truth(value: object) -> bool:
    truths = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False}
    word = str(value).strip().lower() if isinstance(value, str | int | float) else ""
    if word not in truths:
        raise ValueError(f"must be True or False, not {_shown(value)}")
    return truths[word]


def _shown(value: object) -> str:
    return f"{str(value)[:40]!r}" if isinstance(value, str) else type(value).__name__
