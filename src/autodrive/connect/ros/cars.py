"""Figures of the cars for devkit mode, whose protocol does not transmit them.

The source are the files in `data/vehicles`; a test compares each figure. They are repeated here because ROS nodes use
an installation without the simulator: without its data files and without a YAML parser.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Car:
    """Figures of a car."""

    name: str
    wheelbase: float
    """[m]."""
    wheel_radius: float
    """[m]."""
    speed_limit: float
    """Speed at full throttle [m/s]."""
    steering_limit: float
    """[rad]."""
    cameras: tuple[str, ...]
    vertical_field_of_view: float
    """Vertical field of view of the cameras [deg]."""
    lidar_rays: int
    lidar_angle_min: float
    """Angle of the first ray in a message [deg]."""
    lidar_field_of_view: float
    """[deg]."""
    lidar_range_min: float
    """[m]."""
    lidar_range_max: float
    """[m]."""
    lidar_rate: float
    """[Hz]."""


NIGEL = Car(
    name="nigel",
    wheelbase=0.14154,
    wheel_radius=0.0325,
    speed_limit=0.44244,
    steering_limit=0.5236,
    cameras=("front", "rear"),
    vertical_field_of_view=41.669,
    lidar_rays=360,
    lidar_angle_min=0.0,
    lidar_field_of_view=360.0,
    lidar_range_min=0.15,
    lidar_range_max=12.0,
    lidar_rate=7.0,
)
ROBORACER = Car(
    name="roboracer",
    wheelbase=0.324,
    wheel_radius=0.059,
    speed_limit=25.252,
    steering_limit=0.5236,
    cameras=("front",),
    vertical_field_of_view=37.598,
    lidar_rays=1081,
    lidar_angle_min=-135.0,
    lidar_field_of_view=270.0,
    lidar_range_min=0.06,
    lidar_range_max=10.0,
    lidar_rate=40.0,
)
CARS = {car.name: car for car in (NIGEL, ROBORACER)}
