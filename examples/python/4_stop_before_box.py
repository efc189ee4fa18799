"""4. Drive straight on and stop before the first obstacle that the LIDAR sees.

Start it, then the simulator: autodrive run boxes --devkit 127.0.0.1:4567
"""

import math
import sys

import numpy as np

from autodrive.devkit import Nigel, drive

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567
HALF_WIDTH = 0.12  # of what the car needs [m]
STOP, SLOW = 0.25, 0.60  # from the LIDAR to the obstacle [m]; the bumper is 0.08 m ahead of it

nigel = Nigel("V1", is_left_positive=True)


def step():
    """Slow down towards the nearest thing on the car's way; a throttle of 0 brakes."""
    free = free_way(nigel.lidar_range_array)
    share = (free - STOP) / (SLOW - STOP)
    nigel.throttle_command = 0.0 if share <= 0.0 else max(0.2, min(0.8, share))
    nigel.steering_command = 0.0
    nigel.headlights_command = 1 if nigel.throttle_command == 0.0 else 0


def free_way(ranges):
    """How far ahead the way is free [m]: ray i looks to the left by i of 360 degrees, ray 0 straight ahead."""
    angles = 2.0 * math.pi * np.arange(len(ranges)) / max(len(ranges), 1)
    hits = np.isfinite(ranges)
    x, y = ranges[hits] * np.cos(angles[hits]), ranges[hits] * np.sin(angles[hits])
    return x[(abs(y) < HALF_WIDTH) & (x > 0.0)].min(initial=12.0)


drive(step, nigel, port=PORT)
