"""What differs between the AutoDRIVE devkits: profiles, settings of a user, detection; no I/O."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

from autodrive.base.errors import AutodriveError

if TYPE_CHECKING:
    from autodrive.protocol.messages import VehicleFrame

DevkitKeys: TypeAlias = Literal["plain", "prefixed"]
"""'Throttle' of a single vehicle; 'V1 Throttle', with traffic lights."""
LidarFormat: TypeAlias = Literal["text", "gzip"]
"""Numbers separated by spaces; base64 of gzip with one number per line."""
Side: TypeAlias = Literal["left", "right"]
Handshake: TypeAlias = Literal["engineio-3", "engineio-4", "raw"]
"""Engine.IO 3: python-socketio 4. Engine.IO 4: python-socketio 5. Raw: the C++ devkit."""


@dataclass(frozen=True)
class Profile:
    """Message format of one devkit generation, or of the scripts for one vehicle."""

    name: str
    """Year of the devkit generation, or name of the vehicle that has its own."""
    keys: DevkitKeys
    """Whether keys have a vehicle prefix ('V1 Throttle') and traffic lights exist; otherwise a single vehicle."""
    decimals: int
    """Digits after the decimal point."""
    lidar: LidarFormat | None
    """Format of scans; None: an empty text."""
    has_speed: bool
    """Whether telemetry has a 'Speed' key."""
    steering: Side
    """Direction of a positive steering command."""
    feedback: Side
    """Direction of a positive steering feedback."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Reference point of the position, in the vehicle frame (origin: centre of the rear axle) [m]."""
    velocity_at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Point whose velocity is sent, in the vehicle frame [m]."""
    has_race: bool = False
    """Whether telemetry has the velocity as a vector, laps and collisions."""
    has_common_reset: bool = False
    """Whether a key 'Reset' without prefix exists, for all vehicles."""
    cameras: tuple[str, ...] = ("front", "rear")
    """Cameras of which every vehicle sends an image; black without such a camera."""

    @property
    def is_prefixed(self) -> bool:
        """Whether keys have a vehicle prefix."""
        return self.keys == "prefixed"

    def velocity(self, vehicle: VehicleFrame) -> tuple[float, float, float]:
        """Velocity that is sent, in the axes of the vehicle [m/s]."""
        (x, y, z), (p, q, r) = vehicle.velocity.tolist(), vehicle.angular_velocity.tolist()
        a, b, c = self.velocity_at
        return x + q * c - r * b, y + r * a - p * c, z + p * b - q * a

    @property
    def command_sign(self) -> float:
        """1 if a positive steering command turns left, otherwise -1."""
        return _SIGN[self.steering]

    @property
    def feedback_sign(self) -> float:
        """1 if a positive steering feedback points left, otherwise -1."""
        return _SIGN[self.feedback]


_SIGN: dict[Side, float] = {"left": 1.0, "right": -1.0}

# the RoboRacer Sim Racing League: keys of its releases of 2025 ('Speed') and of 2026 ('Linear Velocity')
_LEAGUE = Profile(
    *("roboracer", "prefixed", 4, "gzip", True, "left", "left"),
    velocity_at=(0.15532, 0.00008, 0.01434),  # the centre of mass: IMU.cs reads the rigid body
    has_race=True,
    has_common_reset=True,
    cameras=("front",),
)
PROFILES = {
    profile.name: profile
    for profile in (
        # 2020 reports the position of the body centre; the rear axle is at x -0.08, z -0.015 m from it
        Profile("2020", "plain", 3, "text", False, "right", "right", origin=(0.08, 0.0, 0.015)),
        Profile("2022", "prefixed", 3, "text", False, "right", "right"),
        # the devkit of 2023 is left-positive: teleoperation, navigation and wheel frames of its ROS packages; the
        # simulator of that year took right-positive commands, and scripts written for it need `steering` "right"
        Profile("2023", "prefixed", 3, "text", False, "left", "left"),
        Profile("2025", "prefixed", 4, "gzip", True, "left", "left", has_common_reset=True),
        _LEAGUE,
        # the devkit of the NeoRacer, 2026: the same messages, of another car
        replace(_LEAGUE, name="neoracer", velocity_at=(0.13, 0.0, 0.04)),
    )
}


@dataclass(frozen=True)
class DevkitSettings:
    """What a user has chosen about a devkit script; None: by the profile, and the profile is detected.

    Raises `AutodriveError` for an unknown value.
    """

    profile: str | None = None
    """Devkit generation, one of `PROFILES`."""
    keys: DevkitKeys | None = None
    """Keys of the messages."""
    lidar: LidarFormat | None = None
    """Format of scans; None: detected from the keys of the commands."""
    steering: Side | None = None
    """Direction of a positive steering command."""
    feedback: Side | None = None
    """Direction of a positive steering feedback."""
    handshake: Handshake | None = None
    """Handshake of the server; None: by its first packets."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            known = KNOWN_SETTINGS[field.name]
            if value is not None and value not in known:
                raise AutodriveError(f"unknown devkit {field.name} '{value}'. Known: {', '.join(known)}.")

    def applied_to(self, profile: Profile) -> Profile:
        """The profile with the values that the user has chosen."""
        chosen = {name: getattr(self, name) for name in ("keys", "lidar", "steering", "feedback")}
        return replace(profile, **{name: value for name, value in chosen.items() if value is not None})


KNOWN_SETTINGS: dict[str, tuple[str, ...]] = {
    "profile": tuple(PROFILES),
    "keys": get_args(DevkitKeys),
    "lidar": get_args(LidarFormat),
    "steering": get_args(Side),
    "feedback": get_args(Side),
    "handshake": get_args(Handshake),
}
"""Values of each field of `DevkitSettings`."""


def detect_profile(data: Mapping[str, object]) -> Profile | None:
    """Detect the devkit generation from the keys of a command message; None if it addresses no vehicle.

    Keys without prefix: 2020. 'V1 Reset' and other keys since late 2024, also a 'Reset' without prefix beside keys with
    one: 2025. Any other 'V1 ...' key: 2023. The keys of 2022 are the same as those of 2023, see `is_ambiguous`.
    'V1 Steering Sign' with the value left or right, which only the devkits of this simulator send, sets the direction
    of a positive steering command.
    """
    own = {match[2]: value for key, value in data.items() if (match := VEHICLE_KEY.fullmatch(key))}
    if own:
        profile = PROFILES["2025" if _is_new(data, own) else "2023"]
        side = own.get(STEERING_SIGN)
        return replace(profile, steering=side) if side in ("left", "right") and side != profile.steering else profile
    return PROFILES["2020"] if COMMAND_KEYS & data.keys() else None


def is_ambiguous(data: Mapping[str, object]) -> bool:
    """Whether a script of 2022 sends the same keys as one of 2023: it always commands the lights, and no newer key."""
    own = {match[2] for match in map(VEHICLE_KEY.fullmatch, data) if match}
    return "Headlights" in own and STEERING_SIGN not in own and not _is_new(data, own)


def _is_new(data: Mapping[str, object], own: Iterable[str]) -> bool:
    """Whether a message has keys since late 2024; `own`: its keys of vehicles, without prefix."""
    return COMMON_RESET in data or not KEYS_SINCE_2024.isdisjoint(own)


VEHICLE_KEY = re.compile(r"V(\d{1,4}) (.+)")
"""Key of a numbered vehicle."""
COMMAND_KEYS = {"Throttle", "Steering", "Headlights", "Indicators"}
"""Keys of all generations, without prefix."""
STEERING_SIGN = "Steering Sign"
"""Key with the direction of a positive steering command, without prefix."""
COMMON_RESET = "Reset"
"""Key of all vehicles, in the league's devkit of 2025."""
KEYS_SINCE_2024 = {
    "Reset",
    "CoSim",
    *(f"Pos{axis}" for axis in "XYZ"),
    *(f"Rot{axis}" for axis in "XYZW"),
    "Linear Velocity",
    "Angular Velocity",
}
"""Keys without prefix that no earlier devkit sends."""
