"""The ports at which the two sides of a connection meet if nobody said otherwise; imports nothing, so that all may."""

PORT = 8730
"""The simulator serves its page and the native protocol here, or on one of the next ports if that is taken."""

DEVKIT_PORT = 4567
"""A script of the AutoDRIVE devkits listens here, and the simulator looks for it here."""
