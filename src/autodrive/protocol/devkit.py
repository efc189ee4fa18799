"""Messages <-> the flat dictionaries of the AutoDRIVE devkits of 2020, 2022, 2023 and 2025; no sockets, no I/O.

Telemetry is a dictionary of texts; commands are a dictionary of texts or numbers. What differs between the eras stands
in a `Profile`. This is the one place that knows right-positive steering, quaternions xyzw and angles in [0, 2 pi).

Not copied from the original, because its clients stop for ever on it: a LIDAR key is always there, "" before the first
scan (the 2025 build left it out, and its own devkit then raised KeyError); no decimal commas; no jump of the Euler
angles near 0; never the letters `null` inside base64 (the C++ devkit refuses such a frame).
"""

from __future__ import annotations

import base64
import gzip
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from autodrive.protocol.messages import Command, Headlights, Indicators
from autodrive.transforms import rotate

if TYPE_CHECKING:
    from autodrive.protocol.messages import Array, Frame, LidarScan, VehicleFrame

Images = Mapping[tuple[str, str], bytes]
"""JPEG pictures by (name of the vehicle, name of the camera: "front" or "rear")."""

TRAFFIC_LIGHTS = 4
"""How many `TL<n> State` keys there are: the published Nigel scripts read exactly four."""

LEFT, RIGHT = 1.0, -1.0


@dataclass(frozen=True)
class Profile:
    """How the simulator of one era speaks with the devkit of that era."""

    name: str
    """The year."""
    is_prefixed: bool
    """Keys are 'V1 Throttle' and traffic lights are told; otherwise they are 'Throttle', of one vehicle."""
    decimals: int
    """Digits after the point."""
    lidar: Literal["none", "text", "gzip"]
    """Blank-separated text, or base64 of gzip of a value a line. 'none' says that there is no scan yet."""
    has_speed: bool
    """Whether there is a 'Speed' key."""
    command_sign: float
    """Where a positive steering command turns: LEFT or RIGHT."""
    feedback_sign: float
    """Where a positive steering feedback points: LEFT or RIGHT."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The point of the vehicle whose position is told, from the centre of the rear axle [m]."""


PROFILES = {
    profile.name: profile
    for profile in (
        # the 2020 devkit's transforms hang on the body's centre: its rear axle is at x -0.08, z -0.015 of that
        Profile("2020", False, 3, "text", False, RIGHT, RIGHT, origin=(0.08, 0.0, 0.015)),
        Profile("2022", True, 3, "text", False, RIGHT, RIGHT),
        # the 2023 simulator took right-positive commands but told left-positive angles; scripts of that year and its
        # recorded dataset rely on both
        Profile("2023", True, 3, "text", False, RIGHT, LEFT),
        Profile("2025", True, 4, "gzip", True, LEFT, LEFT),
    )
}


def recognise(data: Mapping[str, object]) -> Profile | None:
    """The era of a devkit by the keys of its commands; None if they do not tell (no vehicle is spoken of).

    No prefix is 2020. 'V1 Reset' and its like (late 2024 and after) are 2025. Any other 'V1 ...' is taken for 2023: the
    commands of 2022 are the same, only the sign of its steering feedback is not, and that must be chosen by hand.
    """
    own = [match[2] for match in map(_VEHICLE_KEY.fullmatch, data) if match]
    if any(key in _KEYS_SINCE_2024 for key in own):
        return PROFILES["2025"]
    if own:
        return PROFILES["2023"]
    return PROFILES["2020"] if any(key in _COMMAND_KEYS for key in data) else None


_VEHICLE_KEY = re.compile(r"V(\d{1,4}) (.+)")
_LIGHT_KEY = re.compile(r"(?:TL(\d{1,4}) State|Traffic Light (\d{1,4}))")  # the second only in 2021
_COMMAND_KEYS = {"Throttle", "Steering", "Headlights", "Indicators"}
_KEYS_SINCE_2024 = {
    "Reset",
    "CoSim",
    *(f"Pos{axis}" for axis in "XYZ"),
    *(f"Rot{axis}" for axis in "XYZW"),
    "Linear Velocity",
    "Angular Velocity",
}


# -- telemetry: simulator to devkit ------------------------------------------------------------------------------


def telemetry(
    frame: Frame,
    profile: Profile,
    *,
    traffic_lights: Mapping[int, int] | None = None,
    images: Images | None = None,
) -> dict[str, str]:
    """The state of all vehicles (in 2020: of the first) as the devkit of that era reads it, in the original's order.

    Vehicle i of the frame is 'V<i+1>'. `traffic_lights` are states by number from 1; 0 (disabled) where it has none.
    A camera without a picture in `images` shows a black one: the scripts of all eras read both keys unconditionally.
    """
    vehicles = frame.vehicles.items()
    if not profile.is_prefixed:
        return {
            key: text for name, vehicle in list(vehicles)[:1] for key, text in _told(name, vehicle, profile, images)
        }
    data = {f"TL{n} State": str((traffic_lights or {}).get(n, 0)) for n in range(1, TRAFFIC_LIGHTS + 1)}
    for i, (name, vehicle) in enumerate(vehicles, start=1):
        data |= {f"V{i} {key}": text for key, text in _told(name, vehicle, profile, images)}
    return data


def introduction(frame: Frame, attempt: int = 0, *, images: Images | None = None) -> dict[str, str]:
    """Telemetry for a devkit of which nothing is known: the keys of all eras at once.

    Only the LIDAR cannot be told to all: text makes a 2025 devkit raise, gzip makes a 2023 devkit raise (NumPy 2) or
    read rubbish (NumPy 1). So it is "" at first, which all of them read as an empty scan. A script that cannot do
    without a scan does not answer that; the next attempts bring the scan as text and as gzip in turn.
    """
    lidar: tuple[Literal["none", "text", "gzip"], ...] = ("none", "text", "gzip")
    prefixed = replace(PROFILES["2025"], lidar=lidar[attempt % 3])
    return telemetry(frame, prefixed, images=images) | telemetry(frame, PROFILES["2020"], images=images)


def _told(name: str, vehicle: VehicleFrame, profile: Profile, images: Images | None) -> Iterable[tuple[str, str]]:
    """Keys without prefix, and their texts."""

    def text(*values: float) -> str:
        return " ".join(f"{value:z.{profile.decimals}f}" for value in values)  # z: never "-0.000"

    imu = vehicle.imu
    w, x, y, z = imu.orientation.tolist()
    yield "Throttle", text(vehicle.throttle)
    yield "Steering", text(profile.feedback_sign * vehicle.steering)
    if profile.has_speed:
        yield "Speed", text(abs(vehicle.speed))
    yield "Encoder Ticks", " ".join(map(str, vehicle.encoders.ticks.tolist()))
    yield "Encoder Angles", text(*vehicle.encoders.angles.tolist())
    lever = rotate((w, x, y, z), profile.origin)
    yield "Position", text(*(p + d for p, d in zip(vehicle.ips.position.tolist(), lever, strict=True)))
    yield "Orientation Quaternion", text(x, y, z, w)
    yield "Orientation Euler Angles", text(*(_full_turn(angle, profile.decimals) for angle in imu.euler.tolist()))
    yield "Angular Velocity", text(*imu.angular_velocity.tolist())
    yield "Linear Acceleration", text(*imu.linear_acceleration.tolist())
    scan = vehicle.lidar
    yield "LIDAR Scan Rate", text(scan.scan_rate if scan else 0.0)
    yield "LIDAR Range Array", _scan_text(scan, scan.ranges, profile) if scan else ""
    yield "LIDAR Intensity Array", _scan_text(scan, scan.intensities, profile) if scan else ""
    for camera in ("front", "rear"):
        jpeg = images.get((name, camera)) if images else None
        yield f"{camera.capitalize()} Camera Image", (_picture_text(jpeg) if jpeg else None) or no_picture()


def _full_turn(angle: float, decimals: int) -> float:
    """The angle in [0, 2 pi), also after it is rounded."""
    angle %= 2.0 * math.pi
    return 0.0 if round(angle, decimals) >= 2.0 * math.pi else angle


def _scan_text(scan: LidarScan, values: Array, profile: Profile) -> str:
    """A value per ray, 'inf' for too near and for nothing there. A full circle begins straight ahead and goes left."""
    if profile.lidar == "none":
        return ""
    is_circle = abs(len(values) * scan.angle_increment - 2.0 * math.pi) < 0.5 * scan.angle_increment
    ahead = round(-scan.angle_min / scan.angle_increment) if is_circle else 0
    texts = [f"{value:.7g}" if math.isfinite(value) else "inf" for value in np.roll(values, -ahead).tolist()]
    return " ".join(texts) if profile.lidar == "text" else _gzip_text("\n".join(texts))


def _gzip_text(text: str) -> str:
    """Base64 of gzip, without the letters null: level 0 stores ASCII as it is, and no three ASCII bytes give them."""
    packed = (base64.b64encode(gzip.compress(text.encode(), level, mtime=0)).decode() for level in (6, 9, 1, 0))
    return next(candidate for candidate in packed if "null" not in candidate)


def _picture_text(jpeg: bytes) -> str | None:
    """Base64 of a JPEG, without the letters null; None if that cannot be (one of 100 000 pictures of 400 kB).

    A comment of a few bytes at the front of the JPEG shifts all that follows: other letters, the same picture.
    """
    comments = (b"", b"\xff\xfe\x00\x02", b"\xff\xfe\x00\x03 ")  # shifts of 0, 4, 5 bytes: base64 has three alignments
    packed = (base64.b64encode(jpeg[:2] + comment + jpeg[2:]).decode() for comment in comments)
    return next((candidate for candidate in packed if "null" not in candidate), None)


@cache
def no_picture(width: int = 1280, height: int = 720) -> str:
    """Base64 of a black JPEG, as sent for a camera that gives no picture: not data, but scripts need one to decode.

    Baseline, RGB colours (YCbCr 4:2:0), of the original's size, 1280 x 720. ITU-T T.81: with a quantum of 128, black is
    the level -8 in the first block of Y, and nothing changes after it, so every other code is the one-bit word 0.
    """
    quantization = b"\x00" + bytes([128] * 64)
    frame_header = (
        b"\x08" + height.to_bytes(2, "big") + width.to_bytes(2, "big") + b"\x03\x01\x22\x00\x02\x11\x00\x03\x11\x00"
    )
    # canonical codes: DC '0' is "no difference", '10' is "a difference of 4 bits"; AC '0' is "end of block"
    dc_codes = b"\x00" + bytes([1, 1] + [0] * 14) + b"\x00\x04"
    ac_codes = b"\x10" + bytes([1] + [0] * 15) + b"\x00"
    scan_header = b"\x03\x01\x00\x02\x00\x03\x00\x00\x3f\x00"
    blocks = 6 * math.ceil(width / 16) * math.ceil(height / 16)
    bits = "10" + "0111" + "0" * (2 * blocks - 1)
    bits += "1" * (-len(bits) % 8)
    segments = ((0xDB, quantization), (0xC0, frame_header), (0xC4, dc_codes), (0xC4, ac_codes), (0xDA, scan_header))
    head = b"".join(b"\xff%c" % mark + (len(body) + 2).to_bytes(2, "big") + body for mark, body in segments)
    jpeg = b"\xff\xd8" + head + int(bits, 2).to_bytes(len(bits) // 8, "big") + b"\xff\xd9"
    return base64.b64encode(jpeg).decode()


# -- commands: devkit to simulator -------------------------------------------------------------------------------


@dataclass
class Orders:
    """What one message of a devkit asks for."""

    commands: dict[str, Command] = field(default_factory=dict)
    """New commands by vehicle, for the vehicles that were spoken of."""
    traffic_lights: dict[int, int] = field(default_factory=dict)
    """New states by number from 1: 0 disabled, 1 red, 2 yellow, 3 green."""
    resets: dict[str, bool] = field(default_factory=dict)
    """Whether 'Reset' is held, by vehicle. Its beginning is the wish to reset."""
    refused: list[str] = field(default_factory=list)
    """What is wrong with the values that were not taken, a sentence each."""


def read_orders(data: Mapping[str, object], profile: Profile, previous: Mapping[str, Command]) -> Orders:
    """The orders in a message; whatever it holds, this does not raise.

    `previous` has the latest command of every vehicle, in the order V1, V2 ...: each key is optional and the last value
    stands. Numbers come as text or as JSON numbers and are clamped; None (never set by the user) is left out; what is
    no finite number is refused. Keys of other features (weather, co-simulation, brakes ...) are passed over.
    """
    orders = Orders()
    for key, value in data.items():
        if value is None or value in ("None", ""):
            continue
        try:
            _read_order(key, value, profile, previous, orders)
        except ValueError as fault:
            orders.refused.append(f"{key}: {fault}")
    return orders


def _read_order(key: str, value: object, profile: Profile, previous: Mapping[str, Command], orders: Orders) -> None:
    if light := _LIGHT_KEY.fullmatch(key):
        number = int(light[1] or light[2])
        if not 1 <= number <= TRAFFIC_LIGHTS:
            raise ValueError(f"there are traffic lights 1 to {TRAFFIC_LIGHTS}")
        orders.traffic_lights[number] = _integer(value, most=3)
        return
    number, name = _address(key, profile)
    if name not in _COMMAND_KEYS | {"Reset"}:
        return
    if not 1 <= number <= len(previous):
        raise ValueError(f"there is no such vehicle; there are {len(previous)}")
    vehicle = list(previous)[number - 1]
    command = orders.commands.get(vehicle, previous[vehicle])
    match name:
        case "Reset":
            orders.resets[vehicle] = _truth(value)
            return
        case "Throttle":
            command = msgspec.structs.replace(command, throttle=_fraction(value))
        case "Steering":
            command = msgspec.structs.replace(command, steering=profile.command_sign * _fraction(value))
        case "Headlights":
            command = msgspec.structs.replace(command, headlights=Headlights(_integer(value, most=2)))
        case _:
            command = msgspec.structs.replace(command, indicators=Indicators(_integer(value, most=3)))
    orders.commands[vehicle] = command


def _address(key: str, profile: Profile) -> tuple[int, str]:
    """Number of the vehicle and the key without its prefix; (0, "") if this era's devkits say no such thing."""
    own = _VEHICLE_KEY.fullmatch(key)
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
