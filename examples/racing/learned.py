"""Races with a policy that learned to, and reads LIDAR, encoders, gyroscope and steering only.

Start it, then the race: autodrive race practice --devkit 127.0.0.1:4567 --rules practice

A policy is the name of an included one, or the file that examples/learning/ppo.py writes.
"""

import argparse

from autodrive.devkit import RoboRacer, drive
from autodrive.experiments.policies import Policy
from autodrive.experiments.policies.racer import PolicyRacer


def main():
    """Serve the simulator."""
    parser = argparse.ArgumentParser(description="Races with a policy.")
    parser.add_argument("port", type=int, nargs="?", default=4567)
    parser.add_argument("--policy", default="race")
    options = parser.parse_args()
    racer, car = PolicyRacer(Policy.find(options.policy)), RoboRacer("V1")

    def step():
        car.throttle_command, car.steering_command = racer.command(
            car.encoder_angles, float(car.angular_velocity[2]), car.steering, car.lidar_range_array
        )

    drive(step, car, port=options.port)


if __name__ == "__main__":
    main()
