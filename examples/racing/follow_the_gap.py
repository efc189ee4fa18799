"""Races with the LIDAR only: follow the gap, with disparities extended by the width of the car.

Start it, then the race: autodrive race practice --devkit 127.0.0.1:4567 --rules league_2026
"""

import argparse
import math

import numpy as np

from autodrive.devkit import RoboRacer, drive

TOP_SPEED = 25.252  # speed of throttle 1 [m/s]
STEERING_LIMIT = 0.5236  # [rad]
WHEELBASE = 0.324  # [m]
FASTEST, SLOWEST = 6.0, 1.0  # [m/s]
BRAKING, SIDEWAYS = 2.5, 4.0  # accelerations that the tyres take with a reserve [m/s^2]
HALF_WIDTH = 0.26  # half of the car, with a margin [m]
DISPARITY = 0.25  # neighbouring ranges that differ by more belong to two things [m]
VIEW, AHEAD, NARROW = math.radians(100.0), math.radians(75.0), math.radians(4.0)  # to each side


def command(ranges, angles):
    """Throttle and steering, -1 to 1, for one scan: ranges [m] and angles [rad] from right to left."""
    right, left = np.searchsorted(angles, (-VIEW, VIEW))
    angles = angles[right:left:2]  # every second ray is enough
    free = widened(np.minimum(np.maximum(ranges[right:left:2], 0.05), 10.0), angles)
    right, left = np.searchsorted(angles, (-AHEAD, AHEAD))
    best = float(free[right:left].max())
    far = angles[right:left][free[right:left] > 0.9 * best]
    goal = float(far[np.abs(far).argmin()] if best > 8.0 else far.mean())
    steering = math.atan(WHEELBASE * 2.0 * math.sin(goal) / min(best, 1.2))
    # speed: stop within what is free ahead, and hold the curve that leads there
    right, left = np.searchsorted(angles, (0.5 * steering - NARROW, 0.5 * steering + NARROW))
    front = float(free[right:left].min())
    curvature = abs(math.tan(steering)) / WHEELBASE
    speed = min(
        FASTEST,
        math.sqrt(2.0 * BRAKING * max(front - 0.3, 0.1)),
        math.sqrt(SIDEWAYS / max(curvature, 1e-3)),
    )
    return max(speed, SLOWEST) / TOP_SPEED, max(-1.0, min(1.0, steering / STEERING_LIMIT))


def widened(ranges, angles):
    """Ranges as a car of that width sees them: the nearer side of each disparity hides what is behind it."""
    free = ranges.copy()
    step = angles[1] - angles[0]
    for i in np.flatnonzero(np.abs(ranges[1:] - ranges[:-1]) > DISPARITY).tolist():
        near = float(min(ranges[i], ranges[i + 1]))
        reach = int(math.asin(min(1.0, HALF_WIDTH / near)) / step) + 1
        hidden = free[i + 1 : i + 1 + reach] if ranges[i] < ranges[i + 1] else free[max(0, i + 1 - reach) : i + 1]
        np.minimum(hidden, near, out=hidden)
    return free


def main():
    """Serve the simulator."""
    parser = argparse.ArgumentParser(description="Races with the LIDAR only.")
    parser.add_argument("port", type=int, nargs="?", default=4567)
    car = RoboRacer("V1")

    def step():
        ranges = car.lidar_range_array
        angles = np.radians(np.linspace(-135.0, 135.0, len(ranges)))
        car.throttle_command, car.steering_command = command(ranges, angles)

    drive(step, car, port=parser.parse_args().port)


if __name__ == "__main__":
    main()
