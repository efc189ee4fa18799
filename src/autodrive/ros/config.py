"""What can be chosen of the bridge between a simulator and ROS, and how the vehicles of an era are named."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from autodrive.errors import AutodriveError
from autodrive.protocol.devkit import PROFILES, Profile
from autodrive.protocol.ports import DEVKIT_PORT, PORT

Mode = Literal["direct", "devkit"]


@dataclass(frozen=True)
class Config:
    """Raises AutodriveError if something does not fit."""

    mode: Mode = "direct"
    """'direct': a client of our simulator's own protocol. 'devkit': the server of the devkits' protocol, to which any
    AutoDRIVE simulator connects, also the original one."""
    host: str = "127.0.0.1"
    """Direct: the simulator's. Devkit: the address to listen at; '' listens to other machines too."""
    port: int = 0
    """0: the usual one, 8730 (direct) or 4567 (devkit)."""
    token: str = ""
    """Direct: what the simulator prints in its link, where it needs one."""
    profile: str = "2025"
    """The devkit whose names and signs are used: '2020', '2022', '2023', '2025'."""
    vehicle_type: str = "nigel"
    """First part of the names of vehicles since 2023, until a simulator has told it."""
    rate: float = 30.0
    """States published in a second of wall time at most [Hz]. Scans and pictures come when they are new; in devkit mode
    all comes in messages of this rate, and commands go with their answers."""
    clock_rate: float = 100.0
    """Times on /clock in a second of wall time at most [Hz], while somebody reads it; direct mode."""
    picture_rate: float = 30.0
    """Pictures of each camera in a second of wall time at most [Hz]; direct mode, while somebody reads them."""
    picture_quality: int = 90
    """Of the JPEG, 1 to 100; direct mode."""
    command_timeout: float = 0.5
    """A vehicle stops when no command came for so long [s]; 0: never."""
    take_over: bool = True
    """Whether a command that comes after silence makes its vehicle autonomous, where a person drives; direct mode."""
    publish_tf: bool = True
    """Whether /tf and /tf_static are published."""
    publish_map_to_odom: bool = True
    """Ground truth as a perfect localisation; off where a localisation of the user's publishes it."""
    robot_description: str = ""
    """URDF of the vehicles: the places of sensors and wheels."""

    def __post_init__(self) -> None:
        if self.mode not in ("direct", "devkit"):
            raise AutodriveError(f"mode must be 'direct' or 'devkit', not '{self.mode}'")
        if self.profile not in PROFILES:
            raise AutodriveError(f"profile must be one of {', '.join(PROFILES)}, not '{self.profile}'")
        if not 0 <= self.port < 65536:
            raise AutodriveError(f"port must be 0 to 65535, not {self.port}")
        for name, least in (("rate", 1e-3), ("clock_rate", 1e-3), ("picture_rate", 1e-3), ("command_timeout", 0.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= least):
                raise AutodriveError(f"{name} must be a number of at least {least:g}, not {value}")
        if not 1 <= self.picture_quality <= 100:
            raise AutodriveError(f"picture_quality must be 1 to 100, not {self.picture_quality}")

    @property
    def address(self) -> str:
        """'host:port' of the simulator (direct) or of our server (devkit)."""
        return f"{self.host}:{self.port or (PORT if self.mode == 'direct' else DEVKIT_PORT)}"

    @property
    def era(self) -> Profile:
        """Signs and the point whose position is told."""
        return PROFILES[self.profile]

    def name(self, number: int, type_: str = "") -> str:
        """Of a vehicle, in topics and frames, by its number from 1 and its type."""
        kind = (type_ or self.vehicle_type).split("_")[0]
        return {"2020": "ego_vehicle" if number == 1 else f"ego_vehicle_{number}", "2022": f"v{number}"}.get(
            self.profile, f"{kind}_{number}"
        )

    def light_name(self, number: int) -> str:
        """Of a traffic light, by its number from 1."""
        return {"2023": f"signal_{number}", "2025": f"tl_{number}"}.get(self.profile, f"tl{number}")
