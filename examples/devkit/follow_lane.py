"""Keeps the right-hand lane of the mini-map with the front camera only, in the style of a devkit script.

Classical computer vision: the image is projected onto the road (inverse perspective mapping), narrow white markings are
detected, and the pose of the vehicle is fitted so that they match the lines of the road. Position, heading and wheel
angles of the telemetry are not used.

Assumptions: roads have the lane markings of the road modules, and are straight or turn left by 90 degrees; the outer
line of a curve is visible before the curve. Crossroads are crossed straight; their curved corners are ignored, and
without markings the vehicle uses visual odometry of the road surface and its steering.

Runs with python-socketio 5, eventlet, numpy, pillow and opencv-python-headless. How to start it: see README.md.
"""

# pyright: reportMissingImports=false

import math

import cv2
import numpy as np
from follow_loop import STEERING_LIMIT, WHEELBASE, Vehicle, options_of, serve

# Camera (table 8 of the report; docs/vehicle.md): position ahead of the rear axle and above the road [m], downward
# pitch [rad]
FOCAL = 240.0 / math.tan(math.radians(41.669 / 2.0))  # [pixels], for an image height of 480
AHEAD, ABOVE, DOWN = 0.186, 0.14465, math.radians(7.294)

NEAR, FAR, SIDE = 0.28, 1.30, 0.60  # projected area, from the camera [m]
SCALE = 200.0  # [pixels/m]
# Middle line, right line and left line of the road, left of the centre of the right-hand lane
LINES = np.array([0.150, -0.134, 0.434])  # [m]
RADIUS = 0.85  # of the lane centre in a left curve [m]
MAX_ANGLE = 0.2  # largest angle between a marking and the lane [rad]
START = -1.6  # x of the vehicle after a curve, until the next curve is visible [m]
PRIOR = np.diag([12.0, 240.0, 80.0])  # weight of the previous pose, in pixels of markings: x, y; heading (1 m/rad)

TURN = math.tan(STEERING_LIMIT) / WHEELBASE  # curvature at full steering [1/m]
LOOKAHEAD = 0.28  # [m]


def bird_eye_view(image, right, left, far, scale, moved=(0.0, 0.0)):
    """A grey image projected onto the road: from NEAR to `far` ahead of the camera, between `right` and `left` [m].

    `scale` is in pixels/m; `moved` is the distance [m] and turn [rad] of the vehicle since the image was taken.
    """
    way, turn = moved
    height, width = image.shape
    corners = np.array([(NEAR, left), (NEAR, right), (far, right), (far, left)])
    x, y = corners[:, 0] + AHEAD, corners[:, 1]
    x, y = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)
    x, y = x + way * math.cos(turn / 2.0) - AHEAD, y + way * math.sin(turn / 2.0)
    depth = x * math.cos(DOWN) + ABOVE * math.sin(DOWN)
    down = ABOVE * math.cos(DOWN) - x * math.sin(DOWN)
    focal = FOCAL * height / 480.0
    seen = np.stack([width / 2.0 - focal * y / depth, height / 2.0 + focal * down / depth], axis=1)
    flat = scale * ((left, far) - corners[:, ::-1])
    change = cv2.getPerspectiveTransform(np.float32(seen), np.float32(flat))
    return cv2.warpPerspective(image, change, (round((left - right) * scale), round((far - NEAR) * scale)))


def way_between(before, now, way, curvature):
    """Distance between two grey images [m], by the texture of the road; `way` is an estimate [m]."""
    grains = []
    for image, moved in ((before, (way, way * curvature)), (now, (0.0, 0.0))):
        road = np.log(bird_eye_view(image, 0.0, 0.2, 0.5, 400.0, moved) + np.float32(4.0))
        grains.append(np.clip(road - cv2.blur(road, (9, 9)), -0.15, 0.15))  # limits the influence of lamps and lines
    window = cv2.createHanningWindow(road.shape[::-1], cv2.CV_32F)
    (_, further), certainty = cv2.phaseCorrelate(*grains, window)
    return way + further / 400.0 if certainty > 0.3 else way


def detect_markings(image):
    """Narrow white lines on the road in a grey image.

    Returns x ahead of the rear axle and y to the left [m], and x and y of the direction across the line: shape (4, n).
    """
    # the logarithm makes the contrast of markings equal by day and by lamp light
    road = np.log(bird_eye_view(image, -SIDE, SIDE, FAR, SCALE) + np.float32(8.0))
    # brighter than its surroundings of 5 cm, along or across
    hats = [cv2.morphologyEx(road, cv2.MORPH_TOPHAT, np.ones(shape, np.uint8)) for shape in ((1, 11), (11, 1))]
    white = np.maximum(*hats) > 0.4
    # lines are 12 mm wide; stop lines and pedestrian crossings 30 mm
    wide = cv2.morphologyEx(white.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    v, u = np.nonzero(white & (cv2.dilate(wide, np.ones((5, 5), np.uint8)) == 0))
    across = cv2.cornerEigenValsAndVecs(road, 9, 3)[v, u, 2:4]  # direction of the largest change in brightness
    return np.stack([AHEAD + FAR - (v + 0.5) / SCALE, SIDE - (u + 0.5) / SCALE, -across[:, 1], -across[:, 0]])


class LaneFinder:
    """Estimates the pose of the rear axle on a straight road, a left turn of 90 degrees and another straight road.

    The lane runs along the x axis, turns from the origin to (RADIUS, RADIUS) and runs along the y axis.
    """

    def __init__(self):
        self.pose = np.array([START, 0.0, 0.0])  # x, y [m], heading [rad]

    def move(self, way, curvature):
        """Advance by a distance [m] along a circle of that curvature [1/m], left positive."""
        x, y, heading = self.pose
        middle = heading + 0.5 * way * curvature
        x, y, heading = x + way * math.cos(middle), y + way * math.sin(middle), heading + way * curvature
        if y > RADIUS:  # after a curve, the frame moves on to the next curve
            x, y, heading = START, RADIUS - x, heading - 0.5 * math.pi
        self.pose = np.array([x, y, heading])

    def look(self, image):
        """Correct the pose with a grey image."""
        lines = detect_markings(image)
        begins = [self.pose[0]] if self.pose[0] > -0.7 else np.arange(START, -0.6, 0.05)
        poses = [fit(np.array([begin, *self.pose[1:]]), lines) for begin in begins]
        self.pose = max(poses, key=lambda pose: score(pose, lines))

    def curvature(self):
        """Curvature of the circle that meets the lane at the lookahead distance [1/m], left positive."""
        angles = np.linspace(0.0, 0.5 * math.pi, 100)
        turning = RADIUS * np.stack([np.sin(angles), 1.0 - np.cos(angles)])
        straight = np.stack([np.arange(START, 0.0, 0.01), np.zeros(160)])
        lane = np.concatenate([straight, turning, RADIUS - straight[::-1, ::-1]], axis=1)
        x, y = lane - self.pose[:2, None]
        distance, bearing = np.hypot(x, y), np.arctan2(y, x) - self.pose[2]
        goal = np.argmax((distance > LOOKAHEAD) & (abs(bearing) < 0.5 * math.pi))
        return 2.0 * math.sin(bearing[goal]) / distance[goal]


def fit(before, lines):
    """The pose near `before` that fits the markings to the lines of the road (Gauss-Newton)."""
    pose = before
    for reach in (0.06, 0.045, 0.03):
        error, is_line = errors(pose, lines)
        slopes = np.stack([(errors(pose + step, lines)[0] - error) / 1e-5 for step in 1e-5 * np.eye(3)])
        # distant markings are less sharp
        weighted = slopes * (is_line & (abs(error) < reach)) / (1.0 + (lines[0] / 0.8) ** 2)
        pose = pose - np.linalg.solve(weighted @ slopes.T + PRIOR, weighted @ error + PRIOR @ (pose - before))
    return pose


def score(pose, lines):
    """Weighted number of pixels of markings that lie on lines of the road."""
    error, is_line = errors(pose, lines)
    return np.sum(is_line * np.exp(-((error / 0.015) ** 2)) / (1.0 + (lines[0] / 0.8) ** 2))


def errors(pose, lines):
    """Offset of each marking from the nearest line, left positive [m], and whether it is parallel to the lane."""
    ahead, left, ahead_across, left_across = lines
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + ahead * cos - left * sin, pose[1] + ahead * sin + left * cos
    heading = np.clip(np.arctan2(x, np.maximum(RADIUS - y, 1e-9)), 0.0, 0.5 * math.pi)
    offset = np.where(x < 0.0, y, np.where(y > RADIUS, RADIUS - x, RADIUS - np.hypot(x, y - RADIUS)))
    error = offset[:, None] - LINES
    nearest = np.argmin(abs(error), axis=1)
    along = ahead_across * np.cos(heading - pose[2]) + left_across * np.sin(heading - pose[2])
    return error[np.arange(len(nearest)), nearest], abs(along) < MAX_ANGLE


class LaneFollower:
    """Drives with the front camera and the steering commands of a vehicle."""

    def __init__(self, throttle):
        self.throttle = throttle
        self.lane = LaneFinder()
        self.before = None  # the last image
        self.way = 0.0  # distance between the last two images [m]
        self.curvature = 0.0  # [1/m]

    def drive(self, vehicle):
        """Set the commands of a vehicle after its telemetry was read."""
        image = cv2.cvtColor(vehicle.camera_image("Front"), cv2.COLOR_RGB2GRAY)
        if self.before is not None:
            if np.array_equal(image, self.before):
                return  # keep the commands until there is a new image
            self.way = way_between(self.before, image, self.way, self.curvature)
            self.lane.move(self.way, self.curvature)
        self.before = image
        self.lane.look(image)
        self.curvature = max(-TURN, min(TURN, self.lane.curvature()))
        vehicle.throttle_command = self.throttle
        vehicle.steering_command = vehicle.steering_sign * math.atan(WHEELBASE * self.curvature) / STEERING_LIMIT


if __name__ == "__main__":
    options = options_of((__doc__ or "").splitlines()[0], throttle=0.6).parse_args()
    serve(Vehicle(options.generation), LaneFollower(options.throttle), options.host, options.port)
