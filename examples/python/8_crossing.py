"""8. Four cars drive straight on through a crossing, with the policy that learned it by self-play.

Start it, then the simulator: autodrive run crossing --devkit 127.0.0.1:4567

Each car reads its own state and what the others tell it: place, direction and speed.
"""

import math
import sys

import numpy as np

from autodrive.devkit import Nigel, drive
from autodrive.experiments.policies import Policy

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567
POLICY = Policy.find("crossing")
GOAL, END = 1.6, 1.45  # distances of the goal and of the end of the drive, behind the middle of the crossing [m]
LANES = 0.3  # from the middle of the road to that of its right half [m]

nigels = [Nigel(f"V{k}", is_left_positive=True) for k in range(1, 5)]  # each follows the one to its right


def features(number):
    """What a car sees, by name; units and signs as in docs/learning.md."""
    car = nigels[number]
    yaw = car.orientation_euler_angles[2]
    road = round(yaw / (0.5 * math.pi)) * 0.5 * math.pi  # direction of the road
    east, north, _ = car.position
    along, right = turned(east, north, road) * (1.0, -1.0)
    x, y = turned(GOAL - along, right - LANES, yaw - road)
    seen = {
        "speed": car.speed / 0.5,
        "yaw_rate": car.angular_velocity[2] / 2.0,
        "steering": car.steering / 0.5,
        "goal_x": x / 4.0,
        "goal_y": y / 4.0,
        "lane": (LANES - right) / 0.3,
        "road_cos": math.cos(road - yaw),
        "road_sin": math.sin(road - yaw),
    }
    for k in range(1, 4):
        other = nigels[(number + k) % 4]
        east, north, _ = other.position - car.position
        x, y = turned(east, north, yaw)
        turn = other.orientation_euler_angles[2] - yaw
        said = {"x": x / 4.0, "y": y / 4.0, "cos": math.cos(turn), "sin": math.sin(turn), "speed": other.speed / 0.5}
        seen |= {f"peer_{k}_{name}": one for name, one in said.items()} | {f"peer_{k}_age": 0.0}
    return seen, along


def turned(x, y, angle):
    """The vector x, y in axes that are turned by an angle [rad]."""
    return np.array([x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)])


def step():
    """Command all cars."""
    for number, nigel in enumerate(nigels):
        seen, along = features(number)
        drive_, steer = POLICY.outputs(np.array([seen[name] for name in POLICY.inputs]))
        low, high = POLICY.throttle
        is_there = along > END
        nigel.throttle_command = 0.0 if is_there else low + (high - low) * 0.5 * (drive_ + 1.0)
        nigel.steering_command = 0.0 if is_there else steer


drive(step, *nigels, port=PORT)
