"""Figures of the car Nigel for devkit mode, whose protocol does not transmit them.

The source is `data/vehicles/nigel.yaml`; a test compares each figure. They are repeated here because ROS nodes use an
installation without the simulator: without its data files and without a YAML parser.
"""

from __future__ import annotations

WHEELBASE = 0.14154
"""[m]."""
WHEEL_RADIUS = 0.0325
"""[m]."""
SPEED_LIMIT = 0.44244
"""At full throttle [m/s]."""
STEERING_LIMIT = 0.5236
"""[rad]."""
CAMERAS = ("front", "rear")
VERTICAL_FIELD_OF_VIEW = 41.669
"""Of both cameras [deg]."""
LIDAR_RANGE_MIN = 0.15
"""[m]."""
LIDAR_RANGE_MAX = 12.0
"""[m]."""
LIDAR_RATE = 7.0
"""[Hz]."""
