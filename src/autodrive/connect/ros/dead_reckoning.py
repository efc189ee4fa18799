"""Dead reckoning with wheel encoders and IMU heading: the pose of a vehicle in the frame odom, which drifts."""

from __future__ import annotations

from math import atan2, cos, inf, sin

from autodrive.base.transforms import quaternion_from_yaw
from autodrive.connect.ros.robot import Transform
from autodrive.protocol.messages import VehicleFrame


class DeadReckoning:
    """Integrates the path of the rear axle centre: the mean of both wheel paths, along the mean of both headings.

    The equations are those of Borenstein, Everett, Feng, "Where am I?", 1996, section 1.3, with the heading of the IMU.
    The first reading is the origin of odom.
    """

    def __init__(self, wheel_radius: float) -> None:
        self.x = self.y = self.yaw = 0.0
        self.speed = 0.0
        """Forward [m/s]."""
        self.distance = 0.0
        """Length of the path, forward and backward [m]."""
        self.interval = inf
        """Interval over which `speed` is a mean [s]."""
        self._radius = wheel_radius
        self._last: tuple[float, float, float] | None = None

    def update(self, vehicle: VehicleFrame) -> None:
        """Integrate up to this reading."""
        w, x, y, z = vehicle.imu.orientation.tolist()
        heading = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        angle = float(vehicle.encoders.angles.mean())
        time = vehicle.encoders.time
        if self._last is not None:
            last_angle, last_heading, last_time = self._last
            step = self._radius * (angle - last_angle)
            turn = atan2(sin(heading - last_heading), cos(heading - last_heading))
            self.x += step * cos(self.yaw + 0.5 * turn)
            self.y += step * sin(self.yaw + 0.5 * turn)
            self.yaw += turn
            self.distance += abs(step)
            if time > last_time:
                self.interval = time - last_time
                self.speed = step / self.interval
        self._last = angle, heading, time

    def pose(self, parent: str, child: str) -> Transform:
        """Pose of the vehicle in odom."""
        return Transform(parent, child, (self.x, self.y, 0.0), quaternion_from_yaw(self.yaw))
