"""Stand-in for the published MATLAB and Simulink toolbox (AutoDRIVE-MathWorks), whose Java library is not ours to ship.

Its side is a bare WebSocket server: it sends neither an Engine.IO opening nor `40`, takes every text message for an
event, and sends commands only if it could read all of the message.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import simplejpeg
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection

NUMBERS = ("Throttle", "Steering", "Speed", "LIDARScanRate")
NUMBERS += ("LapCount", "LapTime", "LastLapTime", "BestLapTime", "Collisions")
VECTORS = {"EncoderTicks": 2, "EncoderAngles": 2, "Position": 3, "OrientationQuaternion": 4}
VECTORS |= {"OrientationEulerAngles": 3, "AngularVelocity": 3, "LinearAcceleration": 3}
ANGLES = np.deg2rad(np.arange(0.0, 270.25, 0.25))
"""Angles over which the ranges are plotted: 1081."""
COMMANDS = '42["Bridge",{"V1 Throttle":"0.3","V1 Steering":"0.1","Reset":"False"}]'


@dataclass
class Readings:
    """What the toolbox keeps of a message."""

    numbers: dict[str, float]
    vectors: dict[str, np.ndarray]
    ranges: np.ndarray
    picture: np.ndarray
    """Shape (3, 192, 108): colour, column, row."""


@dataclass
class MatlabToolbox:
    """Talks on one connection: `readings` of each message that it has answered, `errors` of the others."""

    readings: list[Readings] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def __call__(self, connection: ServerConnection) -> None:
        """Serve a simulator until it disconnects."""
        try:
            for message in connection:
                try:
                    self.readings.append(read(str(message)))
                except (ValueError, KeyError, TypeError, OSError) as error:  # MATLAB prints it and goes on
                    self.errors.append(f"{str(message)[:40]}: {error!r}")
                else:
                    connection.send(COMMANDS)
        except ConnectionClosed:
            pass


def read(message: str) -> Readings:
    """All values of a message. Raises an error where the toolbox does."""
    data = _structure(json.loads(message[12:-1]))
    ranges = gzip.decompress(base64.b64decode(data["V1LIDARRangeArray"])).decode().splitlines()
    if len(ranges) != len(ANGLES):
        raise ValueError(f"{len(ANGLES)} angles, but {len(ranges)} ranges")
    jpeg = base64.b64decode(data["V1FrontCameraImage"])
    pixels = simplejpeg.decode_jpeg(jpeg, colorspace="BGR").ravel()
    return Readings(
        {key: float(data[f"V1{key}"]) for key in NUMBERS},
        {key: np.array(data[f"V1{key}"].split(), float).reshape(length) for key, length in VECTORS.items()},
        np.array(ranges, float),
        pixels.reshape((3, 192, 108), order="F"),
    )


def _structure(data: Mapping[str, object]) -> dict[str, str]:
    """The data as a structure of MATLAB: keys without spaces."""
    if wrong := [key for key, value in data.items() if not isinstance(value, str)]:
        raise TypeError(f"not texts: {wrong}")
    return {key.replace(" ", ""): str(value) for key, value in data.items()}
