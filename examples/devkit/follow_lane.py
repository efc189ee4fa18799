"""Keeps the right-hand lane of the mini-map by the front camera alone, in the style of a devkit script.

Classical computer vision: the picture is laid flat onto the road (inverse perspective), narrow white things are kept,
and the vehicle is placed on the road so that they lie where its lines are painted. Position, heading and wheels of the
telemetry are not read.

What it assumes of the map: roads of the kit with their lines as they are painted, that run straight or turn left by a
right angle; before each curve its outer line is in sight. Crossroads are crossed straight on: their corners bend away
from the lane and do not count, and between them the vehicle drives by how far the road's surface has moved beneath it
and how it has steered.

Runs with python-socketio 5, eventlet, numpy, pillow and opencv-python-headless. How to start it: see README.md.
"""

import math

import cv2
import numpy as np
from follow_loop import Vehicle, options_of, serve

# The camera as it is mounted (table 8 of the report; docs/vehicle.md), and where it stands: ahead of the rear axle and
# above the road [m], looking down [rad]
FOCAL = 240.0 / math.tan(math.radians(41.669 / 2.0))  # [pixels] of a picture 480 high
AHEAD, ABOVE, DOWN = 0.186, 0.14465, math.radians(7.294)

NEAR, FAR, SIDE = 0.28, 1.30, 0.60  # what is laid flat, from the camera [m]
SCALE = 200.0  # [pixels/m]
# How far to the left of the middle of the right-hand lane are the middle line, and the right and left edge of the road
LINES = np.array([0.150, -0.134, 0.434])  # [m]
RADIUS = 0.85  # of the middle of the lane in a curve to the left [m]
ALIKE = 0.2  # paint that runs otherwise than the lane is no line of it [rad]
OUT_OF_SIGHT = -1.6  # where the next curve begins as long as it is not seen [m]
KEEP = np.diag([12.0, 240.0, 80.0])  # what the last pose counts, in pixels of paint: x, y; heading (by 1 m/rad)

TURN = 2.2  # at full steering [1/m]; less than its geometry says, for the driven wheels are rigidly coupled
LOOKAHEAD = 0.28  # [m]


def lay_flat(picture, right, left, far, scale, moved=(0.0, 0.0)):
    """A grey picture as if seen from above: from NEAR to `far` ahead of the camera and between `right` and `left` [m].

    `scale` is in pixels/m; `moved`, how far the vehicle has gone [m] and turned [rad] since the picture was taken.
    """
    way, turn = moved
    height, width = picture.shape
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
    return cv2.warpPerspective(picture, change, (round((left - right) * scale), round((far - NEAR) * scale)))


def way_between(before, now, way, curvature):
    """How far the vehicle has gone between two grey pictures [m], by the grain of the road: about that `way` [m]."""
    grains = []
    for picture, moved in ((before, (way, way * curvature)), (now, (0.0, 0.0))):
        road = np.log(lay_flat(picture, 0.0, 0.2, 0.5, 400.0, moved) + np.float32(4.0))
        grains.append(np.clip(road - cv2.blur(road, (9, 9)), -0.15, 0.15))  # neither lamps nor lines count much
    window = cv2.createHanningWindow(road.shape[::-1], cv2.CV_32F)
    (_, further), certainty = cv2.phaseCorrelate(*grains, window)
    return way + further / 400.0 if certainty > 0.3 else way


def paint(picture):
    """What a grey picture shows of narrow white lines on the road.

    Returns x ahead of the rear axle and y to the left [m], and x and y of the direction across the line: shape (4, n).
    """
    # in logarithms paint stands out from the road as much by the light of lamps as by day
    road = np.log(lay_flat(picture, -SIDE, SIDE, FAR, SCALE) + np.float32(8.0))
    # brighter than its surroundings of 5 cm, along or across
    hats = [cv2.morphologyEx(road, cv2.MORPH_TOPHAT, np.ones(shape, np.uint8)) for shape in ((1, 11), (11, 1))]
    white = np.maximum(*hats) > 0.4
    # lines are 12 mm wide; stop lines and the stripes of crossings, 30 mm
    wide = cv2.morphologyEx(white.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    v, u = np.nonzero(white & (cv2.dilate(wide, np.ones((5, 5), np.uint8)) == 0))
    across = cv2.cornerEigenValsAndVecs(road, 9, 3)[v, u, 2:4]  # the direction in which brightness changes most
    return np.stack([AHEAD + FAR - (v + 0.5) / SCALE, SIDE - (u + 0.5) / SCALE, -across[:, 1], -across[:, 0]])


class LaneFinder:
    """Knows where the rear axle is on a road that is straight, turns left by a right angle, and is straight again.

    The lane comes along the x axis, turns from the origin to (RADIUS, RADIUS) and goes on along the y axis.
    """

    def __init__(self):
        self.pose = np.array([OUT_OF_SIGHT, 0.0, 0.0])  # x, y [m], heading [rad]

    def move(self, way, curvature):
        """The vehicle has gone a way [m] along a circle of a curvature [1/m], left positive."""
        x, y, heading = self.pose
        middle = heading + 0.5 * way * curvature
        x, y, heading = x + way * math.cos(middle), y + way * math.sin(middle), heading + way * curvature
        if y > RADIUS:  # the curve lies behind, the next one somewhere ahead
            x, y, heading = OUT_OF_SIGHT, RADIUS - x, heading - 0.5 * math.pi
        self.pose = np.array([x, y, heading])

    def look(self, picture):
        """Correct the pose by a grey picture."""
        lines = paint(picture)
        begins = [self.pose[0]] if self.pose[0] > -0.7 else np.arange(OUT_OF_SIGHT, -0.6, 0.05)
        poses = [fit(np.array([begin, *self.pose[1:]]), lines) for begin in begins]
        self.pose = max(poses, key=lambda pose: seen_from(pose, lines))

    def curvature(self):
        """Of the circle to drive [1/m], left positive: it meets the lane a little ahead."""
        angles = np.linspace(0.0, 0.5 * math.pi, 100)
        turning = RADIUS * np.stack([np.sin(angles), 1.0 - np.cos(angles)])
        straight = np.stack([np.arange(OUT_OF_SIGHT, 0.0, 0.01), np.zeros(160)])
        lane = np.concatenate([straight, turning, RADIUS - straight[::-1, ::-1]], axis=1)
        x, y = lane - self.pose[:2, None]
        distance, bearing = np.hypot(x, y), np.arctan2(y, x) - self.pose[2]
        goal = np.argmax((distance > LOOKAHEAD) & (abs(bearing) < 0.5 * math.pi))
        return 2.0 * math.sin(bearing[goal]) / distance[goal]


def fit(before, lines):
    """The pose near another from which lines are seen where they are painted (Gauss-Newton)."""
    pose = before
    for reach in (0.06, 0.045, 0.03):
        error, is_line = errors(pose, lines)
        slopes = np.stack([(errors(pose + step, lines)[0] - error) / 1e-5 for step in 1e-5 * np.eye(3)])
        # what is far away is seen less sharply
        weighted = slopes * (is_line & (abs(error) < reach)) / (1.0 + (lines[0] / 0.8) ** 2)
        pose = pose - np.linalg.solve(weighted @ slopes.T + KEEP, weighted @ error + KEEP @ (pose - before))
    return pose


def seen_from(pose, lines):
    """How much paint lies where it belongs."""
    error, is_line = errors(pose, lines)
    return np.sum(is_line * np.exp(-((error / 0.015) ** 2)) / (1.0 + (lines[0] / 0.8) ** 2))


def errors(pose, lines):
    """How far to the left of the nearest line paint lies that is seen from a pose [m], and whether it runs alike."""
    ahead, left, ahead_across, left_across = lines
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + ahead * cos - left * sin, pose[1] + ahead * sin + left * cos
    heading = np.clip(np.arctan2(x, np.maximum(RADIUS - y, 1e-9)), 0.0, 0.5 * math.pi)
    offset = np.where(x < 0.0, y, np.where(y > RADIUS, RADIUS - x, RADIUS - np.hypot(x, y - RADIUS)))
    error = offset[:, None] - LINES
    nearest = np.argmin(abs(error), axis=1)
    along = ahead_across * np.cos(heading - pose[2]) + left_across * np.sin(heading - pose[2])
    return error[np.arange(len(nearest)), nearest], abs(along) < ALIKE


class LaneFollower:
    """Drives by what the front camera of a vehicle shows, and by how it has steered the vehicle."""

    def __init__(self, throttle):
        self.throttle = throttle
        self.lane = LaneFinder()
        self.before = None  # the last picture
        self.way = 0.0  # from picture to picture [m]
        self.curvature = 0.0  # [1/m]

    def drive(self, vehicle):
        """Set the commands of a vehicle whose telemetry has arrived."""
        picture = cv2.cvtColor(vehicle.camera_image("Front"), cv2.COLOR_RGB2GRAY)
        if self.before is not None:
            if np.array_equal(picture, self.before):
                return  # the commands stand until there is a new one
            self.way = way_between(self.before, picture, self.way, self.curvature)
            self.lane.move(self.way, self.curvature)
        self.before = picture
        self.lane.look(picture)
        self.curvature = max(-TURN, min(TURN, self.lane.curvature()))
        vehicle.throttle_command = self.throttle
        vehicle.steering_command = vehicle.steering_sign * self.curvature / TURN


if __name__ == "__main__":
    options = options_of(__doc__.splitlines()[0], throttle=0.6).parse_args()
    serve(Vehicle(options.era), LaneFollower(options.throttle), options.host, options.port)
