"""The Python client of the simulator's native protocol; needs no simulator where it runs."""

from autodrive.client.client import Client as Client
from autodrive.client.wire import NoSimulatorError as NoSimulatorError
