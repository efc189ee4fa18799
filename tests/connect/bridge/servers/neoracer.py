"""A driving script in the style of the published bridge node of the NeoRacer (2026), without ROS.

It reads scans as gzip only, puts them into the middle of a full circle of 1440 bins, and controls the speed: the car
drives 6 m/s with throttle 1. An exception ends it. Prints what it reads of each message as a line of JSON.
"""

# Runs in the environment of a devkit server.
# pyright: reportMissingImports=false, reportArgumentType=false

import base64
import gzip
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

SPEED, STEERING = 6.0, 30.0
"""[m/s] and [degrees] for commands of 1."""
port, target = int(sys.argv[sys.argv.index("--port") + 1]), float(sys.argv[sys.argv.index("--speed") + 1])
sio = socketio.Server(async_mode="eventlet")


def numbers(text, sep=" "):
    return np.fromstring(text, dtype=float, sep=sep)


def read(data):
    ranges = numbers(gzip.decompress(base64.b64decode(data["V1 LIDAR Range Array"])).decode("utf-8"), sep="\n")
    scan = np.full(1440, np.inf, dtype=np.float32)
    start = (1440 - ranges.size) // 2
    scan[start : start + ranges.size] = ranges
    keys = ("Position", "Orientation Quaternion", "Linear Velocity", "Angular Velocity", "Linear Acceleration")
    return {
        **{key: numbers(data[f"V1 {key}"]).tolist() for key in keys},
        "scan": [round(float(value), 3) for value in scan],
        "rays": ranges.size,
        "image": Image.open(BytesIO(base64.b64decode(data["V1 Front Camera Image"]))).size,
    }


@sio.on("Bridge")
def bridge(sid, data):
    try:
        readings = read(data)
        print(json.dumps(readings), flush=True)
    except Exception:
        traceback.print_exc()
        os._exit(1)
    speed = float(np.hypot(*readings["Linear Velocity"][:2]))
    throttle = max(-1.0, min(1.0, target / SPEED + 0.5 * (target - speed) / SPEED))
    commands = {"V1 Throttle": str(throttle), "V1 Steering": str(6.0 / STEERING), "V1 Reset": "False", "V1 CoSim": "0"}
    sio.emit("Bridge", data=commands)


warnings.simplefilter("ignore")
eventlet.wsgi.server(eventlet.listen(("127.0.0.1", port)), socketio.Middleware(sio), log_output=False)
