"""Races along the race line of a track: pure pursuit with a speed profile. It needs the position: for training only.

Start it, then the race: autodrive race practice --devkit 127.0.0.1:4567 --rules practice --laps 10
"""

import argparse
import math
import sys

import numpy as np

from autodrive.devkit import RoboRacer, drive
from autodrive.scenario.tracks import Track

TOP_SPEED = 25.252  # speed of throttle 1 [m/s]
STEERING_LIMIT = 0.5236  # [rad]
WHEELBASE = 0.324  # [m]
FASTEST = 8.0  # [m/s]
ACCELERATIONS = 2.5, 2.5, 4.0  # forward, braking, sideways: what the tyres take with a reserve [m/s^2]
DELAY = 0.1  # time between a reading and its effect [s]


class RaceLine:
    """The race line of a track, or its centre line, with the speed at each point."""

    def __init__(self, track, accelerations=ACCELERATIONS):
        line = track.centre_line[:, :2] if track.race_line is None else track.race_line[:, 1:3]
        self.points = evenly(line, 0.1)
        self.step = 0.1
        self.speed = speeds(curvatures(self.points), self.step, accelerations)

    def command(self, x, y, yaw, speed):
        """Throttle and steering, -1 to 1, for a pose of the rear axle and a speed [m/s]."""
        nearest = int(np.argmin((self.points[:, 0] - x) ** 2 + (self.points[:, 1] - y) ** 2))
        lookahead = 0.5 + 0.12 * speed
        goal_x, goal_y = self.points[(nearest + round(lookahead / self.step)) % len(self.points)]
        bearing = math.atan2(goal_y - y, goal_x - x) - yaw
        curvature = 2.0 * math.sin(bearing) / math.hypot(goal_x - x, goal_y - y)
        target = self.speed[(nearest + round(DELAY * speed / self.step)) % len(self.points)]
        steering = math.atan(WHEELBASE * curvature) / STEERING_LIMIT
        return target / TOP_SPEED, max(-1.0, min(1.0, steering))


def evenly(line, step):
    """Points about `step` [m] apart on a closed line."""
    closed = np.vstack([line, line[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    at = np.arange(round(along[-1] / step)) * along[-1] / round(along[-1] / step)
    return np.column_stack([np.interp(at, along, closed[:, axis]) for axis in (0, 1)])


def curvatures(points):
    """Curvature [1/m] at each point of a closed line, smoothed over half a metre."""
    before, after = points - np.roll(points, 3, axis=0), np.roll(points, -3, axis=0) - points
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn = np.arctan2(cross, np.sum(before * after, axis=1))
    return np.abs(turn) / (0.5 * (np.hypot(*before.T) + np.hypot(*after.T)))


def speeds(curvature, step, accelerations):
    """The fastest speeds [m/s] that hold each curve, and can be reached and left with the accelerations."""
    forward, braking, sideways = accelerations
    speed = np.minimum(FASTEST, np.sqrt(sideways / np.maximum(curvature, 1e-3)))
    for _ in range(2):  # twice around, because the line is closed
        for i in range(len(speed)):
            speed[i] = min(speed[i], math.sqrt(speed[i - 1] ** 2 + 2.0 * forward * step))
        for i in reversed(range(len(speed))):
            speed[i - 1] = min(speed[i - 1], math.sqrt(speed[i] ** 2 + 2.0 * braking * step))
    return speed


def main():
    """Serve the simulator."""
    parser = argparse.ArgumentParser(description="Races along the race line of a track.")
    parser.add_argument("port", type=int, nargs="?", default=4567)
    parser.add_argument("--track", default="practice")
    parser.add_argument("--accelerations", type=float, nargs=3, default=ACCELERATIONS, metavar="M/S^2")
    options = parser.parse_args()
    line, car = RaceLine(Track.load(options.track), options.accelerations), RoboRacer("V1")

    def step():
        if not any(car.position):
            sys.exit(
                "this driver reads withheld signals: the rules of this race give no position (try --rules practice)"
            )
        x, y, _ = car.position
        yaw = car.orientation_euler_angles[2]
        car.throttle_command, car.steering_command = line.command(x, y, yaw, car.speed)

    drive(step, car, port=options.port)


if __name__ == "__main__":
    main()
