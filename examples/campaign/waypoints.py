"""The driver of the campaigns in this folder: pure pursuit along the waypoints of the mini-map."""

import math
from pathlib import Path

import numpy as np

from autodrive import Command

ROUTE = Path(__file__).parents[1] / "devkit" / "mini_map_loop.csv"


class Driver:
    """Follows the route. A campaign can set the arguments: parameters `driver.lookahead` and `driver.throttle`."""

    def __init__(self, lookahead=0.25, throttle=0.8):
        self.lookahead, self.throttle = lookahead, throttle

    def reset(self, scene):
        """Read what the driver needs to know of the vehicle."""
        car = scene.vehicles[scene.vehicle]
        self.wheelbase, self.steering = car.wheelbase, car.steering
        self.route = np.loadtxt(ROUTE, delimiter=",")  # x, y [m]

    def act(self, frame):
        """Steer along the circle that is tangent to the heading and passes through a waypoint ahead."""
        car = frame.vehicles["V1"]
        x, y, _ = car.ips.position
        yaw = car.imu.euler[2]
        distance = np.hypot(*(self.route - (x, y)).T)
        ahead = np.roll(np.arange(len(self.route)), -int(np.argmin(distance)))[: len(self.route) // 2]
        goal = next((i for i in ahead if distance[i] > self.lookahead), ahead[-1])
        bearing = math.atan2(self.route[goal, 1] - y, self.route[goal, 0] - x) - yaw
        curvature = 2.0 * math.sin(bearing) / distance[goal]
        steering = float(self.steering.commands(math.atan(self.wheelbase * curvature)))
        return Command(throttle=self.throttle, steering=max(-1.0, min(1.0, steering)))


def route_error(frames):
    """A metric: root mean square of the distance from the nearest waypoint [m]."""
    route = np.loadtxt(ROUTE, delimiter=",")
    positions = [frame.vehicles["V1"].pose.position[:2] for frame in frames[::10]]
    return math.sqrt(np.mean([np.min(np.sum((route - position) ** 2, axis=1)) for position in positions]))
