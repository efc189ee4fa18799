"""Where a vehicle would think it is by its own encoders and gyroscope: the pose in the frame odom, which drifts."""

from __future__ import annotations

from math import atan2, cos, sin

from autodrive.protocol.messages import VehicleFrame
from autodrive.ros.robot import Transform
from autodrive.transforms import quaternion_from_yaw


class Odometer:
    """Adds up the way of the rear axle centre: on each, the mean of both wheels, along the middle of the headings.

    (Borenstein, Everett, Feng, "Where am I?", 1996, section 1.3, with the heading of the IMU.) It begins where it is
    told first, at odom's origin.
    """

    def __init__(self, wheel_radius: float) -> None:
        self.x = self.y = self.yaw = 0.0
        self.speed = 0.0
        """Forward [m/s]."""
        self.distance = 0.0
        """Driven, forward or back [m]."""
        self._radius = wheel_radius
        self._last: tuple[float, float, float] | None = None

    def take(self, vehicle: VehicleFrame) -> None:
        """Go on to that reading."""
        w, x, y, z = vehicle.imu.orientation.tolist()
        heading = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        angle = float(vehicle.encoders.angles.mean())
        time = vehicle.encoders.time
        if self._last is not None:
            before, old_heading, then = self._last
            way = self._radius * (angle - before)
            turn = atan2(sin(heading - old_heading), cos(heading - old_heading))
            self.x += way * cos(self.yaw + 0.5 * turn)
            self.y += way * sin(self.yaw + 0.5 * turn)
            self.yaw += turn
            self.distance += abs(way)
            if time > then:
                self.speed = way / (time - then)
        self._last = angle, heading, time

    def pose(self, parent: str, child: str) -> Transform:
        """Of the vehicle in odom."""
        return Transform(parent, child, (self.x, self.y, 0.0), quaternion_from_yaw(self.yaw))
