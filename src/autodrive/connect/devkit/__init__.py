"""The devkit of driving scripts, which import it as `autodrive.devkit`."""

from autodrive.connect.devkit.server import Server, drive
from autodrive.connect.devkit.vehicles import F1TENTH, Nigel, RoboRacer, TrafficLight, Vehicle

__all__ = ["F1TENTH", "Nigel", "RoboRacer", "Server", "TrafficLight", "Vehicle", "drive"]
