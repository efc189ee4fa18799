"""What a simulator has told since the last time, whatever it speaks."""

from __future__ import annotations

from dataclasses import dataclass, field

from autodrive.protocol.messages import Frame, LidarScan
from autodrive.protocol.native import Picture


@dataclass(frozen=True)
class Car:
    """What is known of a vehicle that does not change."""

    number: int
    """From 1, in the order of the simulator."""
    type: str
    cameras: tuple[str, ...]
    wheelbase: float = 0.14154
    """[m]; these four are the 1:14 car's (report, section 3.2; behaviour of its drive and steering: section 3.1.3)."""
    wheel_radius: float = 0.0325
    """[m]."""
    speed_limit: float = 0.44244
    """At full throttle [m/s]."""
    steering_limit: float = 0.5236
    """[rad]."""
    sensor_noise: dict[str, float] | None = None
    """As `VehicleScene.sensor_noise`; None: not known."""


@dataclass(frozen=True)
class Update:
    """A Frame, and the scans and pictures that are new in it."""

    frame: Frame
    scans: dict[str, LidarScan] = field(default_factory=dict)
    pictures: dict[tuple[str, str], Picture] = field(default_factory=dict)
    traffic_lights: dict[int, int] = field(default_factory=dict)
    """State by number from 1, where the simulator has some."""
    is_new: bool = True
    """Whether the Frame is; else it is the one before, and something came between two."""
