"""Prints Frames and the HUD texts that Python expects for them, as JSON: input of the page's unit tests (web/tests)."""

from __future__ import annotations

import base64
import json
import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from msgspec.structs import replace

import autodrive
from autodrive.protocol.codec import encode
from autodrive.protocol.messages import Command, Frame, VehicleFrame

GEARS = ((0.0, "D"), (-0.04, "D"), (-0.06, "R"), (-30.0, "R"), (30.0, "D"))
"""Mean speed of the rear wheels [rpm] and gear: reverse from a rounded speed of -0.1 rpm."""

TIMES = (0.0, 59.999, 60.0, 3599.99, 3600.0, 86399.5, 0.1 * 3 * 10)


def cases() -> Iterator[dict[str, Any]]:
    """Each with a name, an encoded Frame and the expected texts of some rows."""
    frame = reverse_left()
    vehicle = frame.vehicles["V1"]
    scan = vehicle.lidar
    assert scan is not None
    yield case("reverse to the left", frame, rows=texts(frame, vehicle))
    for rpm, gear in GEARS:
        spin = np.array([-50.0, -50.0, rpm + 3.0, rpm - 3.0]) * 2 * math.pi / 60  # front wheels do not count
        wheels = replace(vehicle.wheels, angular_velocity=spin)
        yield case(f"rear wheels at {rpm} rpm", changed(frame, wheels=wheels), rows={"gear": gear})
    for seconds in TIMES:
        text = time.strftime("%H:%M:%S", time.gmtime(seconds))
        yield case(f"{seconds} s", replace(frame, time=seconds), rows={"time": text})
    ranges = np.linspace(1.0, 4.59, 360)
    ranges[90], ranges[180] = math.inf, 0.25
    beam = [1.0, None, 0.25, ranges[270]]
    yield case("a scan", changed(frame, lidar=replace(scan, ranges=ranges)), beam=beam, nearest=180)
    odd = changed(
        frame,
        velocity=np.full(3, math.nan),
        throttle=math.inf,
        steering=-0.0,
        lidar=replace(scan, ranges=np.full(360, -math.inf)),
    )
    rows = {"speed": "\N{EN DASH} m/s", "throttle": "inf %", "steering": "0.00 rad", "lidar": "inf m"}
    yield case("values that are not finite", odd, rows=rows, beam=[None] * 4, nearest=-1)


def reverse_left() -> Frame:
    """The Frame after 60 ticks of driving in reverse to the left."""
    world = autodrive.make("tiny_town")
    for _ in range(60):
        world.step({"V1": Command(throttle=-0.8, steering=0.6)})
    vehicle = world.frame.vehicles["V1"]
    assert vehicle.encoders.ticks[0] < 0
    assert vehicle.steering > 0.1
    return world.frame


def texts(frame: Frame, vehicle: VehicleFrame) -> dict[str, str]:
    """The rows of the report (table 13) in its units; the vehicle turns left, which is positive."""
    left, right = vehicle.encoders.ticks
    return {
        "time": time.strftime("%H:%M:%S", time.gmtime(round(frame.time, 6))),
        "mode": "Autonomous" if vehicle.is_autonomous else "Manual",
        "gear": "R",
        "speed": f"{abs(vehicle.speed):.2f} m/s",
        "throttle": "80 %",
        "steering": f"\N{LEFTWARDS ARROW} {vehicle.steering:.2f} rad",
        "encoders": f"[{left}, {right}]",
        "collisions": str(vehicle.collision_count),
    }


def changed(frame: Frame, **values: Any) -> Frame:
    """The Frame with other values of its vehicle."""
    return replace(frame, vehicles={"V1": replace(frame.vehicles["V1"], **values)})


def case(name: str, frame: Frame, **expected: Any) -> dict[str, Any]:
    return {
        "name": name,
        "frame": base64.b64encode(encode(frame)).decode(),
        "rows": {},
        "beam": [],
        "nearest": None,
        **expected,
    }


if __name__ == "__main__":
    print(json.dumps(list(cases())))
