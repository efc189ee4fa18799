"""Conversions between SI and the units that people and data sheets use; only the doors of the house need them."""

import math

RPM = 2.0 * math.pi / 60.0
"""One revolution a minute [rad/s]."""

DEGREE = math.pi / 180.0
"""One degree [rad]."""

STANDARD_GRAVITY = 9.80665
"""The unit g of accelerometer data sheets [m/s^2]; the simulated world's gravity is the scenario's."""
