"""The profile of a devkit script: chosen by the user, that of the vehicles, or detected from its commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from autodrive.connect.bridge.engineio import Dialect
from autodrive.protocol.devkit_profile import (
    PROFILES,
    DevkitSettings,
    LidarFormat,
    Profile,
    detect_profile,
    is_ambiguous,
)

NOTE = (
    "The devkits 2022 and 2023 have the same keys; this script is treated as one of 2023: positive steering "
    "turns left. If the car turns the wrong way, restart with --devkit-profile 2022 or --devkit-steering right."
)


class Detection:
    """The profile of a script; one object for all connections of a bridge.

    `vehicle_profile()` is the name of the profile of the vehicles of the current world, None if they have none: then
    the profile is detected.
    """

    def __init__(self, settings: DevkitSettings, vehicle_profile: Callable[[], str | None] = lambda: None) -> None:
        self.settings = settings
        self._vehicle_profile = vehicle_profile
        self.note = ""
        """What the user should know about the choice; empty if it is certain."""
        self._lidar: LidarFormat = settings.lidar or PROFILES[settings.profile or "2023"].lidar
        self.begin(None)

    def begin(self, dialect: Dialect | None) -> None:
        """Start with a new connection. The format of scans that the last script could read is tried first."""
        self._dialect = dialect
        self._detected: Profile | None = None
        self._has_commands = False
        self.note = ""
        if dialect is Dialect.RAW and self.settings.lidar is None:
            self._lidar = "text"  # no C++ devkit reads gzip

    @property
    def fixed(self) -> str | None:
        """Name of the profile that does not depend on the script: that of the user, or of the vehicles."""
        return self.settings.profile or self._vehicle_profile()

    @property
    def profile(self) -> Profile | None:
        """The profile of the script; None before it is detected."""
        detected = profile = self._detected
        if name := self.fixed:
            profile = PROFILES[name]
            if not self.settings.profile and detected is not None and detected.is_prefixed:
                profile = replace(profile, steering=detected.steering)  # a script may send its sign
        return profile and replace(self.settings.applied_to(profile), lidar=self._lidar_of_vehicles or self._lidar)

    def lidar(self, attempt: int) -> LidarFormat:
        """Format of the scan of a message; alternates until it is known which format the script can read."""
        if known := self._lidar_of_vehicles:
            return known
        is_known = self.settings.lidar is not None or self._has_commands or self._dialect is Dialect.RAW
        if is_known or attempt % 2 == 0:
            return self._lidar
        return "text" if self._lidar == "gzip" else "gzip"

    @property
    def _lidar_of_vehicles(self) -> LidarFormat | None:
        """The format of the profile of the vehicles, unless the user has chosen, or the script reads no gzip."""
        settings, name = self.settings, self._vehicle_profile()
        is_chosen = settings.profile is not None or settings.lidar is not None
        return PROFILES[name].lidar if name and not is_chosen and self._dialect is not Dialect.RAW else None

    def observe(self, commands: Mapping[str, object]) -> bool:
        """Read the keys of a command message. Returns whether they change the choice.

        Later keys may change 2023 to 2025, and text to gzip, nothing else.
        """
        detected = detect_profile(commands)
        if detected is None:
            return False
        before = self._detected, self._lidar, self._has_commands
        if self._detected is None or (self._detected.name, detected.name) == ("2023", "2025"):
            self._detected = detected
        if self.settings.lidar is None and (not self._has_commands or detected.lidar == "gzip"):
            self._lidar = detected.lidar
        self._has_commands = True
        is_chosen = self.fixed is not None or self.settings.steering is not None
        self.note = NOTE if self._detected is PROFILES["2023"] and is_ambiguous(commands) and not is_chosen else ""
        return before != (self._detected, self._lidar, True)

    def __str__(self) -> str:
        """The choice in one line; empty before there is one."""
        if (profile := self.profile) is None:
            return ""
        how = "chosen" if self.settings.profile else "of the vehicle" if self.fixed else "detected"
        key = "V1 Throttle" if profile.is_prefixed else "Throttle"
        steering = f"positive steering turns {profile.steering}, its feedback is positive to the {profile.feedback}"
        return f"devkit {profile.name} ({how}): keys '{key}', LIDAR as {profile.lidar}, {steering}, {self._dialect}"
