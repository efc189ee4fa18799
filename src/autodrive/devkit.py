"""AutoDRIVE devkit in Python: vehicles, traffic lights and the server of a driving script.

A script for the devkits of 2022 to 2025 runs with one changed line, `from autodrive import devkit as autodrive`. A new
script needs no web framework:

    from autodrive.devkit import Nigel, drive

    nigel = Nigel("V1", is_left_positive=True)

    def step():
        nigel.throttle_command = 0.5
        nigel.steering_command = 0.2 if nigel.lidar_range_array.min(initial=9.0) < 0.3 else 0.0

    drive(step, nigel)
"""

from autodrive.connect.devkit import F1TENTH, Nigel, RoboRacer, Server, TrafficLight, Vehicle, drive

__all__ = ["F1TENTH", "Nigel", "RoboRacer", "Server", "TrafficLight", "Vehicle", "drive"]
__path__: list[str] = []  # its modules have former paths
