"""Factors from units of people and data sheets to SI; used only where such units come in or go out."""

import math

RPM = 2.0 * math.pi / 60.0
"""One revolution per minute [rad/s]."""

DEGREE = math.pi / 180.0
"""One degree [rad]."""

STANDARD_GRAVITY = 9.80665
"""The unit g of accelerometer data sheets [m/s^2]. The gravity of a simulated world is set by its scenario."""
