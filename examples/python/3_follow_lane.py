"""3. Keep the lane of the mini-map by the front camera: lines on the road say where the car is, no position is read.

Start it, then the simulator: autodrive run mini_map --devkit 127.0.0.1:4567

It knows how the kit's roads are painted, and that they run straight or turn left by a right angle. Where it sees no
line, as on crossroads, it goes on as the road did, by how far its wheels have turned. Start it on a straight.
"""

import math
import sys

import numpy as np

from autodrive.devkit import Nigel, drive

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567
FOCAL = 240.0 / math.tan(math.radians(41.669 / 2.0))  # [pixels]
AHEAD, ABOVE, DOWN = 0.186, 0.14465, math.radians(7.294)  # camera: from the rear axle, from the road [m]; looks down
LINES = np.array([-0.134, 0.150, 0.434])  # right edge, middle and left edge of the road, left of the lane's middle [m]
RADIUS = 0.85  # of the lane's middle in a curve [m]
OUT_OF_SIGHT = -1.6  # where the car is, before the next curve, as long as that is not seen [m]
ROLL = 0.92 * 0.0325  # way by angle of the rear wheels, which slip a little [m/rad]
TURN, LOOKAHEAD = 2.2, 0.28  # curvature at full steering [1/m]; how far ahead to meet the lane [m]

# places on the road, as a grid ahead (rows) and to the left (columns) [m], and the pixels in which they are seen
x, y = np.meshgrid(AHEAD + np.arange(0.28, 1.3, 0.02), np.arange(-0.6, 0.6, 0.005), indexing="ij")
depth = (x - AHEAD) * math.cos(DOWN) + ABOVE * math.sin(DOWN)
column = np.round(320 - FOCAL * y / depth).astype(int)
row = np.round(240 + FOCAL * (ABOVE * math.cos(DOWN) - (x - AHEAD) * math.sin(DOWN)) / depth).astype(int)
in_sight = (column >= 0) & (column < 640) & (row < 480)
column, row = column.clip(0, 639), row.clip(0, 479)

# the lane comes along the x axis, turns left from the origin to (RADIUS, RADIUS) and goes on along the y axis
straight, angle = np.arange(OUT_OF_SIGHT, 0.0, 0.01), np.linspace(0.0, math.pi / 2.0, 100)
lane_x = np.concatenate([straight, RADIUS * np.sin(angle), np.full(160, RADIUS)])
lane_y = np.concatenate([0.0 * straight, RADIUS - RADIUS * np.cos(angle), RADIUS - straight[::-1]])

nigel = Nigel("V1", is_left_positive=True)


class Car:
    """Where it is on that lane, and how it drives."""

    pose = np.array([OUT_OF_SIGHT, 0.0, 0.0])  # x, y [m], heading [rad]
    curvature = 0.0  # [1/m], left positive
    picture, wheels = None, None  # the last one, and the angle of the wheels then [rad]

    def move(self, way):
        """Go a way [m]; with a curve behind it, the car is before the next one."""
        x, y, heading = self.pose
        middle = heading + 0.5 * way * self.curvature
        x, y, heading = x + way * math.cos(middle), y + way * math.sin(middle), heading + way * self.curvature
        self.pose = np.array([OUT_OF_SIGHT, RADIUS - x, heading - math.pi / 2] if y > RADIUS else [x, y, heading])


car = Car()


def step():
    """Move as the wheels have, look where the lines are, and steer along the circle that meets the lane ahead."""
    picture, wheels = nigel.front_camera_image, nigel.encoder_angles.mean()
    if np.array_equal(picture, car.picture):
        return  # the commands stand until there is a new one
    car.move(0.0 if car.wheels is None else ROLL * (wheels - car.wheels))
    car.picture, car.wheels = picture, wheels
    car.pose = fitted(car.pose, *paint(picture))
    distance = np.hypot(lane_x - car.pose[0], lane_y - car.pose[1])
    bearing = np.arctan2(lane_y - car.pose[1], lane_x - car.pose[0]) - car.pose[2]
    goal = np.argmax((distance > LOOKAHEAD) & (abs(bearing) < math.pi / 2))
    car.curvature = max(-TURN, min(TURN, 2.0 * math.sin(bearing[goal]) / distance[goal]))
    nigel.throttle_command = 0.6
    nigel.steering_command = car.curvature / TURN


def paint(picture):
    """Where on the road something is brighter than what lies 15 mm beside it [m], shape (n, 1) each: lines."""
    grey = picture[row, column].mean(axis=2)
    white = grey > np.maximum(np.roll(grey, 3, axis=1), np.roll(grey, -3, axis=1)) + 50.0
    return x[white & in_sight][:, None], y[white & in_sight][:, None]


def fitted(guess, x, y):
    """The pose near another from which most paint lies where lines are; finer and finer tries."""
    is_lost = guess[0] < -0.7  # any distance to the next curve may be right
    best = guess
    begins = np.arange(OUT_OF_SIGHT, -0.6, 0.05) - guess[0] if is_lost else [-0.04, 0.0, 0.04]
    for size, further in ((4, begins), (2, (-0.02, 0.0, 0.02)), (1, (-0.01, 0.0, 0.01))):
        aside, turned = 0.0025 * size * np.array([-1, 0, 1]), 0.005 * size * np.array([-1, 0, 1])
        tries = best + np.stack(np.meshgrid(further, aside, turned), axis=-1).reshape(-1, 3)
        left, ahead = np.sin(tries[:, 2]), np.cos(tries[:, 2])
        offset = from_lane(tries[:, 0] + x * ahead - y * left, tries[:, 1] + x * left + y * ahead)
        error = abs(offset[:, :, None] - LINES).min(axis=2)
        hits = (np.exp(-((error / 0.015) ** 2)) / (1.0 + (x / 0.8) ** 2)).sum(axis=0)  # far away it is less certain
        doubt = (tries - guess) / (1e9 if is_lost else 0.03, 0.003, 0.005)  # the wheels have something to say too
        best = tries[np.argmax(hits - 20.0 * (doubt**2).sum(axis=1))]
    return best


def from_lane(x, y):
    """How far to the left of the lane's middle places are [m]."""
    return np.where(x < 0.0, y, np.where(y > RADIUS, RADIUS - x, RADIUS - np.hypot(x, y - RADIUS)))


drive(step, nigel, port=PORT)
