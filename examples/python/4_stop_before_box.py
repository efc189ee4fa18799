"""4. Drive straight and stop before the first obstacle; shows how to read the LIDAR.

It is for the scenario 'boxes'. Start it, then the simulator: autodrive run boxes --devkit 127.0.0.1:4567
"""

import math
import sys

import numpy as np

from autodrive.devkit import Nigel, drive

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567
HALF_WIDTH = 0.12  # half the width of the path of the car, with a margin [m]
STOP, SLOW = 0.25, 0.60  # distance from the LIDAR to the obstacle [m]; the bumper is 0.08 m ahead of the LIDAR

AT_START = 1.0  # the first box of the scenario 'boxes' is nearer than this [m]

nigel = Nigel("V1", is_left_positive=True)


def step():
    """Slow down towards the nearest obstacle on the path; a throttle of 0 brakes."""
    free = free_distance(nigel.lidar_range_array)
    if nigel.throttle_command is None and len(nigel.lidar_range_array) and free > AT_START:  # the first call
        sys.exit(
            f"no box within {AT_START:g} m ahead: this is not the start of the scenario 'boxes'. Start the simulator "
            f"with:  autodrive run boxes --devkit 127.0.0.1:{PORT}"
        )
    throttle = (free - STOP) / (SLOW - STOP)
    nigel.throttle_command = 0.0 if throttle <= 0.0 else max(0.2, min(0.8, throttle))
    nigel.steering_command = 0.0
    nigel.headlights_command = 1 if nigel.throttle_command == 0.0 else 0


def free_distance(ranges):
    """Free distance ahead [m]; ray 0 points straight ahead, ray i by i degrees to the left."""
    angles = 2.0 * math.pi * np.arange(len(ranges)) / max(len(ranges), 1)
    hits = np.isfinite(ranges)
    x, y = ranges[hits] * np.cos(angles[hits]), ranges[hits] * np.sin(angles[hits])
    return x[(abs(y) < HALF_WIDTH) & (x > 0.0)].min(initial=12.0)


drive(step, nigel, port=PORT)
