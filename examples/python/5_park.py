"""5. Park in a bay of the mini-map: plan a path of lines and arcs, and follow it with position and heading.

Start it, then the simulator: autodrive run mini_map --devkit 127.0.0.1:4567
"""

import math
import sys

import numpy as np

from autodrive.devkit import Nigel, drive

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567
WHEELBASE = 0.14154  # [m]
STEERING_LIMIT = math.radians(30.0)
LOOKAHEAD = 0.12  # [m]
BAY = (0.511, -1.375)  # centre of the third bay on the right; it opens to the east
REAR = 0.07  # distance of the rear axle behind the centre of the car [m]


def line(start, end):
    """Points from `start` to `end`, 1 cm apart."""
    n = max(2, round(math.dist(start, end) / 0.01))
    return np.linspace(start, end, n)


def right_turn(center, radius, heading):
    """Points of a quarter circle to the right that starts with that heading [rad]."""
    angles = np.linspace(heading + math.pi / 2, heading, round(radius * math.pi / 0.02))
    return np.array(center) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


# along the road, right into the parking lot, along its aisle, right into the bay
goal = (BAY[0] + REAR, BAY[1])
path = np.concatenate(
    [
        line((0.0, 0.0), (0.59, 0.0)),
        right_turn((0.59, -0.5), 0.5, 0.0),
        line((1.09, -0.5), (1.09, BAY[1] + 0.47)),
        right_turn((0.62, BAY[1] + 0.47), 0.47, -math.pi / 2),
        line((0.62, BAY[1]), (goal[0] - 0.5, BAY[1])),  # extended beyond the goal, for the lookahead
    ]
)
nigel = Nigel("V1", is_left_positive=True)


class Progress:
    """Progress of the car along the path; only points ahead are searched, because the path passes close to the bay."""

    reached = 0  # index of the nearest point of the path

    def update(self, x, y):
        """Search the nearest point among the next 30."""
        near = np.hypot(*(path[self.reached : self.reached + 30] - (x, y)).T)
        self.reached += int(np.argmin(near))

    def ahead(self, distance):
        """The point at that distance ahead [m]."""
        return path[min(self.reached + round(100 * distance), len(path) - 1)]


progress = Progress()


def step():
    """Steer towards a point of the path ahead (pure pursuit); stop in the bay."""
    x, y, _ = nigel.position
    progress.update(x, y)
    aim = progress.ahead(LOOKAHEAD)
    bearing = math.atan2(aim[1] - y, aim[0] - x) - nigel.orientation_euler_angles[2]
    curvature = 2.0 * math.sin(bearing) / math.dist(aim, (x, y))
    nigel.steering_command = max(-1.0, min(1.0, math.atan(WHEELBASE * curvature) / STEERING_LIMIT))
    is_parked = progress.reached > len(path) - 60 and x < goal[0] + 0.01
    nigel.throttle_command = 0.0 if is_parked else 0.4
    nigel.indicators_command = 2 if x > 0.3 and not is_parked else 0


drive(step, nigel, port=PORT)
