"""3. Keep the lane of the mini-map with the front camera: detects lane markings, uses no position.

Start it, then the simulator: autodrive run mini_map --devkit 127.0.0.1:4567

It assumes the lane markings of the road modules, and that roads are straight or turn left by 90 degrees. Where no
markings are visible, as on crossings, it uses wheel odometry only. Start it on a straight road.
"""

import math
import sys

import numpy as np

from autodrive.devkit import Nigel, drive

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567
FOCAL = 240.0 / math.tan(math.radians(41.669 / 2.0))  # [pixels]
AHEAD, ABOVE, DOWN = 0.186, 0.14465, math.radians(7.294)  # camera: ahead of the rear axle, above the road [m]; pitch
LINES = np.array([-0.134, 0.150, 0.434])  # right, middle, left line; left of the lane centre [m]
RADIUS = 0.85  # of the lane centre in a curve [m]
START = -1.6  # x of the car after a curve, until the next curve is visible [m]
ROLL = 0.0325  # distance by angle of the rear wheels [m/rad]
WHEELBASE, STEERING_LIMIT = 0.14154, math.radians(30.0)  # [m], [rad]
TURN = math.tan(STEERING_LIMIT) / WHEELBASE  # curvature at full steering [1/m]
LOOKAHEAD = 0.28  # [m]

# a grid of points on the road, x ahead (rows) and y to the left (columns) of the rear axle [m], and their pixels
x, y = np.meshgrid(AHEAD + np.arange(0.28, 1.3, 0.02), np.arange(-0.6, 0.6, 0.005), indexing="ij")
depth = (x - AHEAD) * math.cos(DOWN) + ABOVE * math.sin(DOWN)
column = np.round(320 - FOCAL * y / depth).astype(int)
row = np.round(240 + FOCAL * (ABOVE * math.cos(DOWN) - (x - AHEAD) * math.sin(DOWN)) / depth).astype(int)
visible = (column >= 0) & (column < 640) & (row < 480)
column, row = column.clip(0, 639), row.clip(0, 479)

# the centre line: along the x axis, a left turn from the origin to (RADIUS, RADIUS), then along the y axis
straight, angle = np.arange(START, 0.0, 0.01), np.linspace(0.0, math.pi / 2.0, 100)
lane_x = np.concatenate([straight, RADIUS * np.sin(angle), np.full(160, RADIUS)])
lane_y = np.concatenate([0.0 * straight, RADIUS - RADIUS * np.cos(angle), RADIUS - straight[::-1]])

nigel = Nigel("V1", is_left_positive=True)


class Car:
    """Estimated pose in the frame of that lane, and the curvature that it drives."""

    pose = np.array([START, 0.0, 0.0])  # x, y [m], heading [rad]
    curvature = 0.0  # [1/m], left positive
    image, wheels = np.empty(0, np.uint8), 0.0  # the last one, and the wheel angle at its time [rad]

    def move(self, way):
        """Advance by a distance [m]; after a curve, the frame moves on to the next curve."""
        x, y, heading = self.pose
        middle = heading + 0.5 * way * self.curvature
        x, y, heading = x + way * math.cos(middle), y + way * math.sin(middle), heading + way * self.curvature
        self.pose = np.array([START, RADIUS - x, heading - math.pi / 2] if y > RADIUS else [x, y, heading])


car = Car()


def step():
    """Update the pose by odometry, correct it by the lane markings, and steer by pure pursuit."""
    image, wheels = nigel.front_camera_image, nigel.encoder_angles.mean()
    if np.array_equal(image, car.image):
        return  # keep the commands until there is a new image
    car.move(ROLL * (wheels - car.wheels) if car.image.size else 0.0)
    car.image, car.wheels = image, wheels
    car.pose = fitted(car.pose, *marking_points(image))
    distance = np.hypot(lane_x - car.pose[0], lane_y - car.pose[1])
    bearing = np.arctan2(lane_y - car.pose[1], lane_x - car.pose[0]) - car.pose[2]
    goal = np.argmax((distance > LOOKAHEAD) & (abs(bearing) < math.pi / 2))
    car.curvature = max(-TURN, min(TURN, 2.0 * math.sin(bearing[goal]) / distance[goal]))
    nigel.throttle_command = 0.6
    nigel.steering_command = math.atan(WHEELBASE * car.curvature) / STEERING_LIMIT


def marking_points(image):
    """Points of lane markings, brighter than the road 15 mm to the side: x, y [m], shape (n, 1) each."""
    grey = image[row, column].mean(axis=2)
    white = grey > np.maximum(np.roll(grey, 3, axis=1), np.roll(grey, -3, axis=1)) + 50.0
    return x[white & visible][:, None], y[white & visible][:, None]


def fitted(guess, x, y):
    """The pose near `guess` for which most points lie on lines: a grid search in three steps, coarse to fine."""
    is_lost = guess[0] < -0.7  # the distance to the next curve is unknown
    best = guess
    offsets = np.arange(START, -0.6, 0.05) - guess[0] if is_lost else [-0.04, 0.0, 0.04]
    for size, along in ((4, offsets), (2, (-0.02, 0.0, 0.02)), (1, (-0.01, 0.0, 0.01))):
        aside, turned = 0.0025 * size * np.array([-1, 0, 1]), 0.005 * size * np.array([-1, 0, 1])
        tries = best + np.stack(np.meshgrid(along, aside, turned), axis=-1).reshape(-1, 3)
        left, ahead = np.sin(tries[:, 2]), np.cos(tries[:, 2])
        offset = lane_offset(tries[:, 0] + x * ahead - y * left, tries[:, 1] + x * left + y * ahead)
        error = abs(offset[:, :, None] - LINES).min(axis=2)
        hits = (np.exp(-((error / 0.015) ** 2)) / (1.0 + (x / 0.8) ** 2)).sum(axis=0)  # distant points count less
        change = (tries - guess) / (1e9 if is_lost else 0.03, 0.003, 0.005)  # prefers the pose by odometry
        best = tries[np.argmax(hits - 20.0 * (change**2).sum(axis=1))]
    return best


def lane_offset(x, y):
    """Distance of points from the lane centre, left positive [m]."""
    return np.where(x < 0.0, y, np.where(y > RADIUS, RADIUS - x, RADIUS - np.hypot(x, y - RADIUS)))


drive(step, nigel, port=PORT)
