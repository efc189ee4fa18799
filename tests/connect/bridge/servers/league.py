"""A driving script in the style of the bridge node of the RoboRacer league: it indexes every key of the specification.

A missing key is a KeyError, which ends the process. Drives V1, V2 ... with throttle 0.1, 0.2 ...; `V1 Reset` is the
text True in the messages 41 to 60. Prints what it reads of each message as a line of JSON.
"""

# Runs in the environment of a devkit server.
# pyright: reportMissingImports=false, reportArgumentType=false

import base64
import gzip
import itertools
import json
import os
import sys
import traceback
import warnings
from io import BytesIO

import eventlet
import eventlet.wsgi
import numpy as np
import socketio
from PIL import Image

port, count = int(sys.argv[sys.argv.index("--port") + 1]), int(sys.argv[sys.argv.index("--vehicles") + 1])
sio = socketio.Server(async_mode="eventlet")
numbering = itertools.count(1)


def numbers(text, sep=" "):
    """The call of the published node."""
    return np.fromstring(text, dtype=float, sep=sep).tolist()


def inflated(text):
    return gzip.decompress(base64.b64decode(text)).decode("utf-8")


def read(data, car):
    return {
        "throttle": float(data[f"{car} Throttle"]),
        "steering": float(data[f"{car} Steering"]),
        "encoder_angles": numbers(data[f"{car} Encoder Angles"]),
        "position": numbers(data[f"{car} Position"]),
        "orientation_quaternion": numbers(data[f"{car} Orientation Quaternion"]),
        "angular_velocity": numbers(data[f"{car} Angular Velocity"]),
        "linear_velocity": numbers(data[f"{car} Linear Velocity"]),
        "speed": float(data[f"{car} Speed"]),
        "linear_acceleration": numbers(data[f"{car} Linear Acceleration"]),
        "scan_time": 1 / float(data[f"{car} LIDAR Scan Rate"]),
        "ranges": len(numbers(inflated(data[f"{car} LIDAR Range Array"]), sep="\n")),
        "image": np.asarray(Image.open(BytesIO(base64.b64decode(data[f"{car} Front Camera Image"])))).shape,
        "lap_count": int(float(data[f"{car} Lap Count"])),
        "lap_time": float(data[f"{car} Lap Time"]),
        "last_lap_time": float(data[f"{car} Last Lap Time"]),
        "best_lap_time": float(data[f"{car} Best Lap Time"]),
        "collision_count": int(float(data[f"{car} Collisions"])),
    }


@sio.on("Bridge")
def bridge(sid, data):
    number = next(numbering)
    cars = [f"V{i}" for i in range(1, count + 1)]
    try:
        print(json.dumps([read(data, car) for car in cars]), flush=True)
    except Exception:
        traceback.print_exc()
        os._exit(1)
    commands = {}
    for i, car in enumerate(cars, start=1):
        commands[f"{car} Throttle"] = str(np.round(0.1 * i, 3))
        commands[f"{car} Steering"] = str(0.0)
        commands[f"{car} Reset"] = str(car == "V1" and 40 < number <= 60)
    sio.emit("Bridge", data=commands)


warnings.simplefilter("ignore")
eventlet.wsgi.server(eventlet.listen(("127.0.0.1", port)), socketio.Middleware(sio), log_output=False)
