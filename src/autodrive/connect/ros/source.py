"""What a simulator source provides, for either protocol: vehicle descriptions, updates, and the listener interface."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from autodrive.connect.ros.cars import Car
from autodrive.protocol.messages import Frame, LidarScan
from autodrive.protocol.native import Picture


@dataclass(frozen=True)
class VehicleInfo:
    """Constant properties of a vehicle."""

    number: int
    """Number of the vehicle in the simulator's order, from 1."""
    type: str
    cameras: tuple[str, ...]
    wheelbase: float
    """[m]."""
    wheel_radius: float
    """[m]."""
    speed_limit: float
    """Speed at full throttle [m/s]."""
    steering_limit: float
    """[rad]."""
    sensor_noise: dict[str, float] | None = None
    """Noise of the sensors, see `VehicleScene.sensor_noise`; None if unknown."""
    missing_gravity: float = 9.81
    """Gravity that accelerations lack [m/s^2], see `VehicleScene.missing_gravity`; those of the devkit protocol have
    none."""
    urdf: str = ""
    """Frames of its sensors and wheels; empty if unknown."""

    @staticmethod
    def of(car: Car, number: int = 1, type_: str = "") -> VehicleInfo:
        """A vehicle with the figures of a car."""
        return VehicleInfo(
            number, type_, car.cameras, car.wheelbase, car.wheel_radius, car.speed_limit, car.steering_limit
        )


@dataclass(frozen=True)
class Update:
    """A Frame, and the scans and images that are new in it."""

    frame: Frame
    scans: dict[str, LidarScan] = field(default_factory=dict)
    pictures: dict[tuple[str, str], Picture] = field(default_factory=dict)
    traffic_lights: dict[int, int] = field(default_factory=dict)
    """State by number from 1, if the simulator has traffic lights."""
    is_new: bool = True
    """False if the Frame is the previous one and only scans or images are new."""


class Listener(Protocol):
    """Receives the data of a source."""

    @property
    def wants_clock(self) -> bool:
        """Whether the simulated time has subscribers."""
        ...

    @property
    def wants_images(self) -> bool:
        """Whether any camera image has subscribers."""
        ...

    @property
    def max_wait(self) -> float:
        """Longest time to wait for a Frame before `on_idle` is called [s]."""
        ...

    @property
    def is_closed(self) -> bool:
        """Whether the source must stop."""
        ...

    def on_vehicles(self, vehicles: dict[str, VehicleInfo]) -> None:
        """A simulator was found, or another scenario was loaded."""
        ...

    def on_update(self, update: Update) -> None:
        """New data arrived."""
        ...

    def on_idle(self) -> None:
        """No data arrived within `max_wait`."""
        ...

    def warn(self, text: str) -> None:
        """Report a problem to the user."""
        ...
