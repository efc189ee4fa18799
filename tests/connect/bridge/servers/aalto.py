"""A driving script in the style of the bridge node of the course of Aalto University (2025), for Nigel.

It reads scans as gzip only, each key of the message without asking whether it is there, and answers nothing after an
exception, which ends the process here. Prints the number of rays of each scan.
"""

# Runs in the environment of a devkit server.
# pyright: reportMissingImports=false, reportArgumentType=false

import base64
import gzip
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

port = int(sys.argv[sys.argv.index("--port") + 1])
sio = socketio.Server(async_mode="eventlet")


def read(data):
    for key in ("Throttle", "Steering", "Speed"):
        float(data[f"V1 {key}"])
    for key in ("Encoder Angles", "Position", "Orientation Quaternion", "Angular Velocity", "Linear Acceleration"):
        np.fromstring(data[f"V1 {key}"], dtype=float, sep=" ")
    assert 1 / float(data["V1 LIDAR Scan Rate"]) > 0
    scan = gzip.decompress(base64.b64decode(data["V1 LIDAR Range Array"])).decode("utf-8")
    for side in ("Front", "Rear"):
        np.asarray(Image.open(BytesIO(base64.b64decode(data[f"V1 {side} Camera Image"]))))
    for number in range(1, 5):
        int(data[f"TL{number} State"])
    return len(np.fromstring(scan, sep="\n"))


@sio.on("Bridge")
def bridge(sid, data):
    try:
        print(read(data), flush=True)
    except Exception:
        traceback.print_exc()
        os._exit(1)
    commands = {"V1 Throttle": "0.5", "V1 Steering": "0.0", "V1 Headlights": "0", "V1 Indicators": "0"}
    commands |= {"V1 Reset": "False"} | {f"TL{number} State": "0" for number in range(1, 5)}
    sio.emit("Bridge", data=commands)


warnings.simplefilter("ignore")
eventlet.wsgi.server(eventlet.listen(("127.0.0.1", port)), socketio.Middleware(sio), log_output=False)
