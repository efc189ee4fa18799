"""Default ports."""

PORT = 8730
"""The simulator serves its page and the native protocol here, or on the next free port."""

PORT_VARIABLE = "AUTODRIVE_PORT"
"""Environment variable with another port for `autodrive run` and for clients without an address."""

DEVKIT_PORT = 4567
"""A script of the AutoDRIVE devkits listens here, and the simulator connects to it."""
