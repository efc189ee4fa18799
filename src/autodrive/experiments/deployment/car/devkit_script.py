"""Drives a RoboRacer with the policy of this folder, as a devkit script.

Usage: python3 devkit_script.py [--port 4567] [--dry-run] [--set NAME=VALUE] ...
It needs the package autodrive-client (or the simulator) for the devkit protocol. The protocol has no time stamps: each
message with a new scan is one step of the policy, and messages with an old scan count time until the car stops.
"""

# pyright: reportMissingImports=false

import argparse
import math
from pathlib import Path

from driver import CarDriver, CarLog, CarSettings, ScanLayout

from autodrive.devkit import RoboRacer
from autodrive.devkit import drive as serve

FOLDER = Path(__file__).parent
EXTENT = math.radians(270.0)
"""Angle from the first ray of a scan to the last one, or to the one after it if their number is even."""


class CarScript:
    """Drives one car; `step` is called for each message."""

    def __init__(self, driver, is_dry):
        self.car, self.driver, self.is_dry = RoboRacer("V1"), driver, is_dry
        self.time = 0.0
        self.last = None

    def step(self):
        """Read the sensors of the car, then set its commands."""
        car, driver = self.car, self.driver
        self.time += driver.settings.period
        for wheel, angle in enumerate(car.encoder_angles):
            driver.on_encoder(self.time, float(angle), wheel)
        driver.on_yaw_rate(self.time, float(car.angular_velocity[2]))
        driver.on_steering(float(car.steering))
        if car.position is not None:
            yaw = float(car.orientation_euler_angles[2])
            driver.on_pose(self.time, float(car.position[0]), float(car.position[1]), yaw)
        command, ranges = None, car.lidar_range_array
        if self.last is None or len(ranges) != len(self.last) or (ranges != self.last).any():
            self.last = ranges.copy()
            layout = ScanLayout(-0.5 * EXTENT, EXTENT / (len(ranges) - len(ranges) % 2), len(ranges), 0.06, 10.0)
            command = driver.on_scan(self.time, self.time, layout, ranges)
        command = command or driver.tick(self.time)
        if command is not None and not self.is_dry:
            car.throttle_command, car.steering_command = command.throttle, command.steering


def main():
    """Serve the simulator or the car until Ctrl-C."""
    parser = argparse.ArgumentParser(description="Drives a RoboRacer with the policy of this folder.")
    parser.add_argument("--port", type=int, default=4567)
    parser.add_argument("--dry-run", action="store_true", help="compute and log, and command nothing")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="instead of settings.json")
    options = parser.parse_args()
    settings = CarSettings.read(FOLDER / "settings.json", [*options.set, "dead_man_topic="])  # the protocol has none
    driver = CarDriver(settings, FOLDER, CarLog.of(settings, Path.cwd()))
    script = CarScript(driver, options.dry_run)
    try:
        serve(script.step, script.car, port=options.port)
    finally:
        if driver.log is not None:
            driver.log.close(driver.summary())
        print(driver.summary())


if __name__ == "__main__":
    main()
