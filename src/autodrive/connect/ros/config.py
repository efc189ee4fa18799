"""Configuration of the ROS bridge, and the names of vehicles in each devkit profile."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from autodrive.base.errors import AutodriveError
from autodrive.base.tcp import address_text, without_brackets
from autodrive.connect.ros.cars import CARS, NIGEL, Car
from autodrive.protocol.devkit_profile import PROFILES, DevkitSettings, Profile, Side
from autodrive.protocol.ports import DEVKIT_PORT, PORT

Mode = Literal["direct", "devkit"]


@dataclass(frozen=True)
class Config:
    """Raises AutodriveError if a value is invalid."""

    mode: Mode = "direct"
    """'direct': a client of this simulator's native protocol. 'devkit': a server of the devkit protocol; any AutoDRIVE
    simulator connects to it, also the original one."""
    host: str = "127.0.0.1"
    """Direct: address of the simulator. Devkit: address to listen at; '' accepts other machines too."""
    port: int = 0
    """0: the default port, 4567 (devkit); direct, on this machine: as a Client without an address, see `Client`."""
    token: str = ""
    """Access token that the simulator prints in its link, if it needs one; direct mode."""
    profile: str = "2025"
    """Devkit profile, which sets names and signs: '2020', '2022', '2023', '2025', 'neoracer'; 'roboracer' for the
    topics, frames and QoS of the RoboRacer league."""
    race: bool = False
    """Whether the topics are left out that the league allows in training only; profile 'roboracer'."""
    steering: Side | Literal[""] = ""
    """Direction of a positive steering command, 'left' or 'right'; '': that of the profile."""
    feedback: Side | Literal[""] = ""
    """Direction of a positive steering feedback, 'left' or 'right'; '': that of the profile."""
    vehicle_type: str = ""
    """First part of the vehicle names since 2023, until a simulator is connected; '': 'nigel'. In the profile
    'roboracer' it is always the first part; '': 'roboracer'. In devkit mode, whose protocol does not have them, it also
    selects the car whose frames, LIDAR, cameras and limits the bridge uses: 'nigel', 'nigel_2023', 'roboracer',
    'roboracer_physical', 'roboracer_f1tenth' or 'neoracer'."""
    rate: float = 30.0
    """Maximum rate of states in wall time [Hz]. Scans and images are published when they are new. In devkit mode, all
    messages have this rate, and commands are sent with the answers."""
    clock_rate: float = 100.0
    """Maximum rate of /clock in wall time, while it has subscribers [Hz]; direct mode."""
    picture_rate: float = 30.0
    """Maximum rate of images of each camera in wall time, while they have subscribers [Hz]; direct mode."""
    picture_quality: int = 90
    """JPEG quality, 1 to 100; direct mode."""
    command_timeout: float = 0.5
    """A vehicle stops if no command arrives for this time [s]; 0: never."""
    lockstep: bool = False
    """Whether the answer to a message with a scan waits for the commands that follow the scan; devkit mode. For races
    in lock-step."""
    take_over: bool = True
    """Whether the first command, also after a timeout, switches its vehicle to autonomous mode; direct mode."""
    publish_tf: bool = True
    """Whether /tf and /tf_static are published."""
    publish_map_to_odom: bool = True
    """Whether the transform from map to odom is published, from ground truth. Switch it off if a localisation node
    publishes it."""
    robot_description: str = ""
    """URDF of all vehicles: poses of sensors and wheels; '': in direct mode that of each vehicle in the simulator, in
    devkit mode that of the car in the package autodrive_description."""

    def __post_init__(self) -> None:
        if self.mode not in ("direct", "devkit"):
            raise AutodriveError(f"mode must be 'direct' or 'devkit', not '{self.mode}'")
        if self.profile not in PROFILES:
            raise AutodriveError(f"profile must be one of {', '.join(PROFILES)}, not '{self.profile}'")
        _ = self.devkit_profile  # checks the signs
        if self.race and not self.is_league:
            raise AutodriveError(f"race needs the profile 'roboracer', not '{self.profile}'")
        if not 0 <= self.port < 65536:
            raise AutodriveError(f"port must be 0 to 65535, not {self.port}")
        for name, least in (("rate", 1e-3), ("clock_rate", 1e-3), ("picture_rate", 1e-3), ("command_timeout", 0.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= least):
                raise AutodriveError(f"{name} must be a number of at least {least:g}, not {value}")
        if not 1 <= self.picture_quality <= 100:
            raise AutodriveError(f"picture_quality must be 1 to 100, not {self.picture_quality}")

    @property
    def simulator(self) -> str | None:
        """Address of the simulator in direct mode; None: that of a Client without an address."""
        return None if (self.host, self.port) == (Config.host, 0) else self.address

    @property
    def address(self) -> str:
        """'host:port' of the simulator (direct) or of the devkit server (devkit)."""
        return address_text(without_brackets(self.host), self.port or (PORT if self.mode == "direct" else DEVKIT_PORT))

    @property
    def devkit_profile(self) -> Profile:
        """Signs, keys and reference point of the devkit profile."""
        settings = DevkitSettings(steering=self.steering or None, feedback=self.feedback or None)
        return settings.applied_to(PROFILES[self.profile])

    @property
    def is_league(self) -> bool:
        """Whether topics, frames and QoS are those of the RoboRacer league."""
        return self.profile == "roboracer"

    @property
    def car(self) -> Car:
        """Figures of the vehicles where the simulator does not send them."""
        names = self.vehicle_type, self.vehicle_type.partition("_")[0], self.profile
        return next((CARS[name] for name in names if name in CARS), NIGEL)

    def vehicle_name(self, number: int, type_: str = "") -> str:
        """Name of a vehicle in topics and frames, from its number (from 1) and type."""
        if self.is_league:
            return f"{self.vehicle_type or self.car.name}_{number}"
        file = Path(type_ or self.vehicle_type or self.car.name)  # a type may be the path of a file
        kind = re.sub(r"\W", "_", file.stem).split("_")[0]
        return {"2020": "ego_vehicle" if number == 1 else f"ego_vehicle_{number}", "2022": f"v{number}"}.get(
            self.profile, f"{kind}_{number}"
        )

    def light_name(self, number: int) -> str:
        """Name of a traffic light, from its number (from 1)."""
        return {"2023": f"signal_{number}", "2025": f"tl_{number}"}.get(self.profile, f"tl{number}")
