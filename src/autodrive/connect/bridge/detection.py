"""The profile of a devkit script: chosen by the user, that of the vehicles, or detected from its commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from autodrive.connect.bridge.engineio import Dialect
from autodrive.connect.bridge.flow_control import FlowControl
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

ENOUGH_ANSWERS = 10
"""Number of commands after which a script is known to read the format of the scans. Some of them may be late answers to
scans in the other format: a script that is only slow gets up to four messages before the format changes."""


class Detection:
    """The profile of a script; one object for all connections of a bridge.

    `vehicle_profile()` is the name of the profile of the vehicles of the current world, None if they have none: then
    the profile is detected.
    """

    def __init__(self, settings: DevkitSettings, vehicle_profile: Callable[[], str | None] = lambda: None) -> None:
        self.settings = settings
        self._vehicle_profile = vehicle_profile
        self.begin(None)

    def begin(self, dialect: Dialect | None) -> None:
        """Start with a new connection."""
        self._dialect = dialect
        self._detected: Profile | None = None
        self._lidar: LidarFormat = "text"
        """Format of scans that the keys of the commands imply."""
        self._sent: LidarFormat | None = None
        """Format of the latest scan."""
        self._answered: LidarFormat | None = None
        self._answers = 0
        """Format of the scan before the latest command, and the number of commands in sequence with this format."""
        self.note = ""
        """What the user should know about the choice; empty if it is certain."""

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
        return profile and replace(self.settings.applied_to(profile), lidar=self._known_lidar or profile.lidar)

    def lidar(self, flow: FlowControl) -> LidarFormat | None:
        """Format of the scan of the next message; None: an empty scan.

        Before the first command the format is that of the profile of the user or of the vehicles. Without a profile, a
        server of Engine.IO gets a scan on which no published script raises: an empty scan. The first message to a
        server of Engine.IO 3 has gzip: the NumPy of the older scripts reads it as an empty scan. If a script does not
        answer for the time `PATIENCE`, the formats alternate.
        """
        self._sent = self._known_lidar or self._tried_lidar(flow)
        return self._sent

    def _tried_lidar(self, flow: FlowControl) -> LidarFormat | None:
        if self.fixed or self._dialect is Dialect.RAW or flow.has_command:
            first = self._answered or PROFILES[self.fixed or "2023"].lidar
            return first if flow.late_resends % 2 == 0 else "gzip" if first == "text" else "text"
        if flow.late_resends:
            return "text" if flow.late_resends % 2 else "gzip"
        return "gzip" if self._dialect is Dialect.ENGINE_IO_3 and not flow.resends else None

    @property
    def _known_lidar(self) -> LidarFormat | None:
        """The format that the user has chosen, or that the script reads; None if it is not known.

        A script for vehicles with a profile reads the format that it answers. A raw server is a C++ script of 2023,
        which reads text only but answers to gzip, too, or the MATLAB toolbox: its keys decide.
        """
        if self.settings.lidar is not None or self._detected is None:
            return self.settings.lidar
        if self.settings.profile or self._dialect is Dialect.RAW or not self._vehicle_profile():
            return self._lidar
        return self._answered if self._answers >= ENOUGH_ANSWERS else None

    def observe(self, commands: Mapping[str, object]) -> bool:
        """Read the keys of a command message. Returns whether they change the choice.

        Later keys may change 2023 to 2025, and text to gzip, nothing else.
        """
        detected = detect_profile(commands)
        if detected is None:
            return False
        before = self._detected, self._lidar
        if self._sent != self._answered:
            self._answered, self._answers = self._sent, 0
        self._answers += 1
        if self._detected is None or (self._detected.name, detected.name) == ("2023", "2025"):
            self._detected = detected
        if detected.lidar == "gzip":
            self._lidar = "gzip"
        is_chosen = self.fixed is not None or self.settings.steering is not None
        self.note = NOTE if self._detected is PROFILES["2023"] and is_ambiguous(commands) and not is_chosen else ""
        return before != (self._detected, self._lidar)

    def __str__(self) -> str:
        """The choice in one line; empty before there is one."""
        if (profile := self.profile) is None:
            return ""
        how = "chosen" if self.settings.profile else "of the vehicle" if self.fixed else "detected"
        key = "V1 Throttle" if profile.is_prefixed else "Throttle"
        steering = f"positive steering turns {profile.steering}, its feedback is positive to the {profile.feedback}"
        return f"devkit {profile.name} ({how}): keys '{key}', LIDAR as {profile.lidar}, {steering}, {self._dialect}"
