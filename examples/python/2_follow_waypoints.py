"""2. Follow waypoints around the mini-map with pure pursuit; shows how to read position and heading.

Start it, then the simulator: autodrive run mini_map --devkit 127.0.0.1:4567
"""

import math
import sys
from pathlib import Path

import numpy as np

from autodrive.devkit import Nigel, drive

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567
WHEELBASE = 0.14154  # [m]
STEERING_LIMIT = math.radians(30.0)
LOOKAHEAD = 0.25  # [m]

route = np.loadtxt(Path(__file__).parents[1] / "devkit" / "mini_map_loop.csv", delimiter=",")  # x, y [m]
nigel = Nigel("V1", is_left_positive=True)


def step():
    """Steer along the circle that is tangent to the heading and passes through a waypoint ahead."""
    x, y, _ = nigel.position
    yaw = nigel.orientation_euler_angles[2]
    distance = np.hypot(*(route - (x, y)).T)
    ahead = np.roll(np.arange(len(route)), -int(np.argmin(distance)))[: len(route) // 2]
    goal = next(i for i in ahead if distance[i] > LOOKAHEAD)
    bearing = math.atan2(route[goal, 1] - y, route[goal, 0] - x) - yaw
    curvature = 2.0 * math.sin(bearing) / distance[goal]
    nigel.throttle_command = 0.8
    nigel.steering_command = max(-1.0, min(1.0, math.atan(WHEELBASE * curvature) / STEERING_LIMIT))


drive(step, nigel, port=PORT)
