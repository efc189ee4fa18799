"""Frames with known numbers for the tests of the devkit protocol."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from autodrive.protocol.messages import (
    EncoderReading,
    Frame,
    Headlights,
    ImuReading,
    Indicators,
    IpsReading,
    LidarScan,
    Lights,
    Pose,
    TailLights,
    VehicleFrame,
    WheelsReading,
)

QUARTER_TURN = np.array([math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)])
"""Heading along y, quaternion wxyz."""


def scan(ranges: list[float], angle_min: float = -math.pi, increment: float | None = None) -> LidarScan:
    """By default a full circle that begins straight behind."""
    n = len(ranges)
    return LidarScan(
        time=0.0,
        ranges=np.array(ranges),
        intensities=np.full(n, 47.0),
        angle_min=angle_min,
        angle_increment=increment or 2.0 * math.pi / n,
        range_min=0.15,
        range_max=12.0,
        scan_rate=7.0,
        scan_time=1.0 / 7.0,
        time_increment=0.0,
    )


def vehicle(**changes: Any) -> VehicleFrame:
    """One that stands at (1, 2, 0.0325), heading along y, its wheels turned 0.25 rad to the left."""
    position = np.array([1.0, 2.0, 0.0325])
    frame = VehicleFrame(
        pose=Pose(position, QUARTER_TURN),
        velocity=np.array([-0.2, 0.0, 0.0]),
        angular_velocity=np.zeros(3),
        throttle=0.5,
        steering=0.25,
        encoders=EncoderReading(0.0, np.array([1920, -7]), np.array([2.0 * math.pi, -0.0229])),
        ips=IpsReading(0.0, position),
        imu=ImuReading(
            0.0,
            QUARTER_TURN,
            np.array([0.01, -0.02, math.pi / 2]),
            np.array([0.1, 0.2, 0.3]),
            np.array([1.0, -2.0, 3.0]),
        ),
        lidar=scan([1.0] * 360),
        lights=Lights(Headlights.OFF, Indicators.OFF, TailLights.BRIGHT, False, False, False),
        wheels=WheelsReading(*(np.zeros(4) for _ in range(7))),
        is_autonomous=True,
        collision_count=0,
    )
    return msgspec.structs.replace(frame, **changes)


def frame(*vehicles: VehicleFrame) -> Frame:
    """Of vehicles named 'red', 'green', 'blue': the names differ from those of the protocol."""
    named: dict[str, VehicleFrame] = dict(zip(("red", "green", "blue"), vehicles or (vehicle(),), strict=False))
    return Frame(time=0.0, tick=0, vehicles=named, objects={}, events=(), scene_light=True)
