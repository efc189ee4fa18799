"""Drives laps of the mini-map, in the style of a devkit script: it uses only the telemetry of the simulator.

It is a Socket.IO server; the simulator connects to it. It reads the position (IPS) and the heading (IMU) and steers
towards a waypoint ahead (pure pursuit). Runs with python-socketio 4 and 5, eventlet, numpy and pillow.
"""

# pyright: reportMissingImports=false

import argparse
import base64
import gzip
import math
from io import BytesIO
from pathlib import Path

import eventlet
import eventlet.wsgi
import numpy as np
import socketio
from PIL import Image

WHEELBASE = 0.14154  # [m]
STEERING_LIMIT = math.radians(30.0)
LOOKAHEAD = 0.25  # [m]

GENERATIONS = {"2020": ("", -1.0), "2022": ("V1 ", -1.0), "2023": ("V1 ", 1.0), "2025": ("V1 ", 1.0)}
"""Prefix of the keys, and whether a positive steering command turns left (1) or right (-1), by devkit generation."""


class Vehicle:
    """Readings and commands of one vehicle."""

    def __init__(self, generation):
        self.generation = generation
        self.prefix, self.steering_sign = GENERATIONS[generation]
        self.throttle_command = None
        self.steering_command = None
        self.headlights_command = 0
        self.indicators_command = 0

    def parse_data(self, data):
        """Read a telemetry message."""

        def numbers(key):
            return np.array(data[self.prefix + key].split(), dtype=float)

        self.throttle = float(data[self.prefix + "Throttle"])
        self.steering = float(data[self.prefix + "Steering"])
        self.encoder_ticks = numbers("Encoder Ticks").astype(int)
        self.encoder_angles = numbers("Encoder Angles")
        self.position = numbers("Position")
        self.orientation_quaternion = numbers("Orientation Quaternion")
        self.orientation_euler_angles = numbers("Orientation Euler Angles")
        self.angular_velocity = numbers("Angular Velocity")
        self.linear_acceleration = numbers("Linear Acceleration")
        self.lidar_scan_rate = float(data[self.prefix + "LIDAR Scan Rate"])
        self.lidar_range_array = self.parse_scan(data[self.prefix + "LIDAR Range Array"])
        self._images = {side: data[f"{self.prefix}{side} Camera Image"] for side in ("Front", "Rear")}

    def parse_scan(self, text):
        """Ranges [m]."""
        if self.generation == "2025":
            text = gzip.decompress(base64.b64decode(text)).decode()
        return np.array(text.split(), dtype=float)

    def camera_image(self, side):
        """RGB image of the 'Front' or 'Rear' camera, shape (height, width, 3); decoded by each call."""
        return np.asarray(Image.open(BytesIO(base64.b64decode(self._images[side]))))

    def generate_commands(self):
        """The command message."""
        commands = {
            self.prefix + "Throttle": str(self.throttle_command),
            self.prefix + "Steering": str(self.steering_command),
            self.prefix + "Headlights": str(self.headlights_command),
            self.prefix + "Indicators": str(self.indicators_command),
        }
        if self.generation == "2025":
            commands[self.prefix + "Reset"] = "False"
        return commands


class RouteFollower:
    """Pure pursuit along a closed route."""

    def __init__(self, route, throttle):
        self.route = route
        self.throttle = throttle

    def drive(self, vehicle):
        """Set the commands of a vehicle after its telemetry was read."""
        x, y, _ = vehicle.position
        angle = self.steering_angle(x, y, vehicle.orientation_euler_angles[2])
        vehicle.throttle_command = self.throttle
        vehicle.steering_command = vehicle.steering_sign * min(max(angle / STEERING_LIMIT, -1.0), 1.0)

    def steering_angle(self, x, y, yaw):
        """Angle of the front wheels [rad], left positive, for a pose of the centre of the rear axle."""
        distance = np.hypot(*(self.route - (x, y)).T)
        nearest = int(np.argmin(distance))
        ahead = np.roll(np.arange(len(self.route)), -nearest)[: len(self.route) // 2]
        goal = next(i for i in ahead if distance[i] > LOOKAHEAD)
        bearing = math.atan2(self.route[goal, 1] - y, self.route[goal, 0] - x) - yaw
        # the circle that is tangent to the heading at the rear axle and passes through the goal
        return math.atan(2.0 * WHEELBASE * math.sin(bearing) / distance[goal])


def serve(vehicle, follower, host, port):
    """Reply to each telemetry message with commands; never returns."""
    sio = socketio.Server(async_mode="eventlet")

    @sio.on("connect")
    def connect(sid, environ):
        print("simulator connected", flush=True)

    @sio.on("Bridge")
    def bridge(sid, data):
        if not data:
            return
        vehicle.parse_data(data)
        follower.drive(vehicle)
        sio.emit("Bridge", data=vehicle.generate_commands())

    eventlet.wsgi.server(eventlet.listen((host, port)), socketio.Middleware(sio), log_output=False)


def options_of(title, throttle):
    """Options of both examples."""
    parser = argparse.ArgumentParser(description=title)
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (0.0.0.0: all)")
    parser.add_argument("--port", type=int, default=4567)
    parser.add_argument("--generation", choices=GENERATIONS, default="2025", help="devkit generation (keys, signs)")
    parser.add_argument("--throttle", type=float, default=throttle, help="[-1, 1]")
    return parser


def main():
    """Read the options and serve."""
    parser = options_of((__doc__ or "").splitlines()[0], throttle=1.0)
    parser.add_argument("--route", type=Path, default=Path(__file__).with_name("mini_map_loop.csv"))
    options = parser.parse_args()
    route = np.loadtxt(options.route, delimiter=",")
    serve(Vehicle(options.generation), RouteFollower(route, options.throttle), options.host, options.port)


if __name__ == "__main__":
    main()
