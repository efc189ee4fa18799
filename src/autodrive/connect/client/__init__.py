"""The Python client of the native protocol; does not need the simulator to be installed."""

from autodrive.connect.client.client import Client as Client
from autodrive.connect.client.client_socket import NoSimulatorError as NoSimulatorError
