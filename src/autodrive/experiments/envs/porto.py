"""The track and the car of the published racing networks, after the published scene of the original simulator.

The track is like that of Porto: our own points, after the shape of the public map `porto` of f1tenth_simulator. Moved
by 12.825 m along both axes, the middle of that map passes the published starts at 3 and 6 cm.

The ray sensor of the original is in the plane of the car, whose front is lower; here the rays are level as those of the
LIDAR. The height of the walls is not published, and rays above walls of 0.254 m would see nothing.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yaml

from autodrive.base.elementary import cos, sin
from autodrive.experiments.envs.race_tracks import cached_file
from autodrive.scenario import kinds
from autodrive.scenario.tracks.points import smooth_line
from autodrive.scenario.tracks.shape import walls_along
from autodrive.scenario.tracks.track import BarrierSpec, Pose, Track

POINTS = np.array([
    (14.8, -7, 1.6), (14.7, -9, 1.5), (14.65, -11, 1.5), (14.5, -13, 1.9), (14.4, -15, 2.1),
    (13.9, -16.8, 2.6), (13, -17.3, 2.5), (12, -17.1, 1.9), (11.25, -16.5, 1.7), (11, -15.6, 1.6),
    (11.25, -14.6, 1.55), (12.4, -13, 1.7), (12.85, -11, 1.5), (12.2, -9.2, 1.45), (11.5, -7.3, 1.6),
    (11.4, -6.3, 1.8), (11.5, -5.3, 2.1), (12, -4.5, 2.5), (12.9, -4.15, 2.5), (13.9, -4.35, 2.3),
    (14.55, -5.1, 1.9),
])  # fmt: skip
"""x, y of the centre line and width of the track [m].

The width is that of the map plus 0.1 m: 5 cm are a pixel, in the middle of which a wall is on average, and at the
height of the wheels a round duct of 0.254 m is 2 cm farther away than the box that stands for it here.
"""
BARRIER = BarrierSpec(width=0.254, height=0.254)
ROOTS: tuple[Pose, ...] = ((14.8, -7.0, -0.5 * math.pi), (11.0, -15.0, math.pi / 3.0))
"""Published starts of both cars: x, y [m] and yaw [rad] of the root of the car."""
ROOT = 0.16
"""Distance from the centre of the rear axle to the root of the car, forward [m]."""
RAYS, LAST_DEGREES = 27, 135.0
"""Number of rays of the ray sensor, and bearing of the leftmost one [deg]; the rightmost one is at its negative."""


def track() -> Track:
    """The track in the frame of the published scene, clockwise from the start of the first car."""
    places, parameters = smooth_line(POINTS[:, :2])
    widths = np.interp(parameters, np.arange(len(POINTS) + 1), np.append(POINTS[:, 2], POINTS[0, 2]))
    rows = np.round(np.column_stack([places, 0.5 * widths, 0.5 * widths]), 4)
    return Track("porto", rows, walls=walls_along(rows), title="Like the track of Porto", barrier=BARRIER)


def starts() -> list[Pose]:
    """x, y [m] and yaw [rad] of the centre of the rear axle of each car."""
    return [(x - ROOT * cos(yaw), y - ROOT * sin(yaw), yaw) for x, y, yaw in ROOTS]


def car() -> Path:
    """File of the car: `roboracer` with a fifth of the motor torque, and with the ray sensor in place of its LIDAR.

    The wheels turn at 85.6 rad/s times the throttle, which is 5.05 m/s.
    """
    tree = yaml.safe_load(kinds.find("vehicle", "roboracer").read_text(encoding="utf-8"))
    tree["drivetrain"] |= {"torque_limit": 21.4, "brake_torque": 85.6}
    lidar = tree["sensors"]["lidar"]
    del lidar["angle_increment_deg"]
    lidar |= {"rays": RAYS, "angle_min_deg": -LAST_DEGREES, "angle_max_deg": LAST_DEGREES, "range_min": 0.001}
    return cached_file("published_car", "roboracer_published.yaml", yaml.safe_dump(tree, sort_keys=False))
