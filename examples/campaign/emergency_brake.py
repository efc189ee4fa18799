"""The driver of `weather.yaml`: drives straight on, and brakes before the orange box in the camera image."""

import numpy as np

from autodrive import Command, Headlights

BOX_WIDTH = 0.3
"""[m]."""
BAND = np.s_[90:160, 240:400]
"""Rows and columns of the image above the bonnet of the car."""
SATURATED = 0.35
"""Least (max - min) / max of a colour of the box; walls have less."""
LIGHTS = (Headlights.OFF, Headlights.LOW)
"""By day and at night."""
LANE = -0.15
"""y of the lane [m]."""


class Driver:
    """A campaign can set the arguments, for example the parameter `driver.has_detector`."""

    def __init__(self, has_detector=True, speed=2.5, brakes_at=1.6):
        """`speed` [m/s]; `brakes_at`: distance from the camera to the box [m]."""
        self.has_detector, self.speed, self.brakes_at = has_detector, speed, brakes_at
        self.is_braking, self.seen_at = False, None

    def reset(self, scene):
        """Read the speed limit of the vehicle."""
        car = scene.vehicles[scene.vehicle]
        limit = car.drivetrain.speed_limit_rpm * 2.0 * np.pi / 60.0 * car.wheels.radius  # [m/s]
        self.throttle = self.speed / limit

    def act(self, frame):
        """Keep the lane by IPS and IMU, until the box is near: then brake until the end."""
        car = frame.vehicles["V1"]
        image = car.cameras.get("front")
        is_dark = not frame.scene_light
        if self.has_detector and image is not None and image.time != self.seen_at:
            self.seen_at = image.time
            self.is_braking |= distance_to_box(image.rgba, image.intrinsics.fx) < self.brakes_at
        offset, heading = car.ips.position[1] - LANE, (car.imu.euler[2] + np.pi) % (2.0 * np.pi) - np.pi
        steering = float(np.clip(-2.0 * offset - 2.0 * heading, -1.0, 1.0))
        return Command(0.0 if self.is_braking else self.throttle, steering, headlights=LIGHTS[is_dark])


def distance_to_box(rgba, focal_length):
    """Distance from the width of the orange area [m]; infinite if there is none."""
    band = rgba[BAND][..., :3].astype(float)
    red, green, blue = band[..., 0], band[..., 1], band[..., 2]
    is_orange = (red > green) & (green > blue) & (red > 30.0) & (red - blue > SATURATED * red)
    columns = np.flatnonzero(is_orange.sum(axis=0) >= 4)
    return focal_length * BOX_WIDTH / len(columns) if len(columns) > 3 else np.inf
