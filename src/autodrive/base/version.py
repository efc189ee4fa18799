"""The version of both distributions, which their builds read from this file."""

__version__ = "1.0.0"
