"""Reads telemetry as the published devkits of each year do: the same keys, the same NumPy and Pillow calls.

Takes a list of {"year": ..., "data": {...}} as JSON on stdin and writes what it read as JSON to stdout.
"""

# Runs in the environment of a devkit server.
# pyright: reportMissingImports=false, reportArgumentType=false

import base64
import gzip
import json
import sys
import warnings
from io import BytesIO

import numpy as np
from PIL import Image

RACE_CARS = ("roboracer", "neoracer")
VECTORS = ("Encoder Angles", "Position", "Orientation Quaternion", "Orientation Euler Angles")
VECTORS += ("Angular Velocity", "Linear Acceleration")


def numbers(text, dtype=float, sep=" "):
    """Every published script uses this call, also for an empty text, which newer NumPy only warns about."""
    return np.fromstring(text, dtype=dtype, sep=sep).tolist()


def inflated(text):
    return gzip.decompress(base64.b64decode(text)).decode("utf-8")


def read(year, data):
    prefix = "" if year == "2020" else "V1 "
    result = {key: float(data[prefix + key]) for key in ("Throttle", "Steering", "LIDAR Scan Rate")}
    result |= {key: numbers(data[prefix + key]) for key in VECTORS}
    result["Encoder Ticks"] = numbers(data[prefix + "Encoder Ticks"], dtype=int)
    if year in ("2025", *RACE_CARS):
        result["Speed"] = float(data[prefix + "Speed"])
        result["LIDAR Range Array"] = numbers(inflated(data[prefix + "LIDAR Range Array"]), sep="\n")
    else:
        result["LIDAR Range Array"] = numbers(data[prefix + "LIDAR Range Array"])
        result["LIDAR Intensity Array"] = numbers(data[prefix + "LIDAR Intensity Array"])
    if year != "2020":
        result["lights"] = [int(data[f"TL{n} State"]) for n in range(1, 5)]
    for side in ("Front",) if year in RACE_CARS else ("Front", "Rear"):
        picture = np.asarray(Image.open(BytesIO(base64.b64decode(data[f"{prefix}{side} Camera Image"]))))
        result[f"{side} Camera Image"] = [picture.shape, int(picture.min()), int(picture.max())]
    return result


warnings.simplefilter("ignore")
json.dump([read(case["year"], case["data"]) for case in json.load(sys.stdin)], sys.stdout)
