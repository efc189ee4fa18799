"""Figures of the cars for devkit mode, whose protocol does not transmit them.

Cars of a family (`nigel`, `roboracer`) have the same frames and names of topics, but other cameras.

The source are the files in `data/vehicles`; a test compares each figure. They are repeated here because ROS nodes use
an installation without the simulator: without its data files and without a YAML parser.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


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
    image_size: tuple[int, int]
    """Width and height of the images [pixels]."""
    focal_length: float
    """Focal length of the cameras, whose pixels are square [pixels]."""
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

    @property
    def family(self) -> str:
        """First part of the name, as in names of topics and frames."""
        return self.name.partition("_")[0]


NIGEL = Car(
    name="nigel",
    wheelbase=0.14154,
    wheel_radius=0.0325,
    speed_limit=0.44244,
    steering_limit=0.5236,
    cameras=("front", "rear"),
    image_size=(640, 480),
    focal_length=630.66,
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
    image_size=(192, 108),
    focal_length=158.61,
    lidar_rays=1081,
    lidar_angle_min=-135.0,
    lidar_field_of_view=270.0,
    lidar_range_min=0.06,
    lidar_range_max=10.0,
    lidar_rate=40.0,
)
NIGEL_2023 = replace(NIGEL, name="nigel_2023", speed_limit=0.30576, image_size=(1280, 720), focal_length=1057.39)
ROBORACER_PHYSICAL = replace(
    ROBORACER,
    name="roboracer_physical",
    speed_limit=22.88,
    image_size=(640, 360),
    focal_length=396.53,
    lidar_rays=1080,
)
ROBORACER_F1TENTH = replace(
    ROBORACER_PHYSICAL,
    name="roboracer_f1tenth",
    wheelbase=0.3302,
    wheel_radius=0.0508,
    speed_limit=20.0,
    steering_limit=0.4189,
)
NEORACER = replace(
    ROBORACER,
    name="neoracer",
    wheelbase=0.285,
    wheel_radius=0.0425,
    speed_limit=6.137,
    image_size=(640, 480),
    focal_length=528.70,
    lidar_range_max=25.0,
    lidar_rate=30.0,
)
CARS = {car.name: car for car in (NIGEL, NIGEL_2023, ROBORACER, ROBORACER_PHYSICAL, ROBORACER_F1TENTH, NEORACER)}
