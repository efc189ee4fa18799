"""The HUD's texts, made by the page's own code of a Frame's bytes, against Python's formatting of the same Frame."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import autodrive
from autodrive.protocol.codec import encode
from autodrive.protocol.messages import Command, Frame, VehicleFrame

HERE = Path(__file__).parent
WEB = HERE.parents[1] / "web"
ROLLDOWN = WEB / "node_modules" / ".bin" / "rolldown"

pytestmark = pytest.mark.skipif(
    not ROLLDOWN.exists() or shutil.which("node") is None, reason="needs Node and web/node_modules (npm ci)"
)


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page's functions as one file for Node."""
    bundle = tmp_path_factory.mktemp("page") / "hud_rows.mjs"
    subprocess.run(
        [ROLLDOWN, HERE / "hud_rows.ts", "--file", bundle, "--format", "esm", "--platform", "node"],
        check=True,
        capture_output=True,
    )
    return bundle


@pytest.fixture(scope="module")
def frame() -> Frame:
    """Of a drive in reverse to the left, long enough for some scans."""
    world = autodrive.make("tiny_town")
    for _ in range(60):
        world.step({"V1": Command(throttle=-0.8, steering=0.6)})
    return world.frame


def shown(script: Path, frame: Frame) -> dict[str, Any]:
    """Row -> what it says of that Frame."""
    done = subprocess.run(["node", script], input=encode(frame), check=True, capture_output=True)
    return json.loads(done.stdout)


def vehicle_of(frame: Frame) -> VehicleFrame:
    return next(iter(frame.vehicles.values()))


def changed(frame: Frame, **values: Any) -> Frame:
    """The Frame with other values of its vehicle."""
    return replace(frame, vehicles={"V1": replace(vehicle_of(frame), **values)})


def test_rows_say_what_the_frame_says_in_the_units_of_the_report(script: Path, frame: Frame) -> None:
    rows, vehicle = shown(script, frame), vehicle_of(frame)
    left, right = vehicle.encoders.ticks
    assert left < 0, "the drive is meant to be in reverse"
    assert vehicle.steering > 0.1, "the drive is meant to be to the left"
    assert rows["time"] == time.strftime("%H:%M:%S", time.gmtime(round(frame.time, 6)))
    assert rows["frame-rate"] == "60 Hz"
    assert rows["mode"] == ("Autonomous" if vehicle.is_autonomous else "Manual")
    assert rows["gear"] == "R"
    assert rows["speed"] == f"{abs(vehicle.speed):.2f} m/s"
    assert rows["throttle"] == f"{100 * abs(vehicle.throttle):.2f}%" == "80.00%"
    assert rows["steering"] == f"{-vehicle.steering:.2f} rad"  # right positive: report, table 3
    assert rows["encoders"] == f"[{left}, {right}]"
    assert rows["collisions"] == str(vehicle.collision_count)


@pytest.mark.parametrize(("rpm", "gear"), [(0.0, "D"), (-0.04, "D"), (-0.06, "R"), (-30.0, "R"), (30.0, "D")])
def test_gear_is_reverse_where_the_rear_wheels_turn_back_by_a_tenth_of_a_turn_a_minute(
    script: Path, frame: Frame, rpm: float, gear: str
) -> None:
    spin = np.array([-50.0, -50.0, rpm + 3.0, rpm - 3.0]) * 2 * math.pi / 60  # the front wheels do not count
    wheels = replace(vehicle_of(frame).wheels, angular_velocity=spin)
    assert shown(script, changed(frame, wheels=wheels))["gear"] == gear


def test_measurement_is_that_of_a_beam_that_turns_once_a_scan(script: Path, frame: Frame) -> None:
    scan = vehicle_of(frame).lidar
    assert scan is not None
    ranges = np.linspace(1.0, 4.59, 360)
    ranges[90], ranges[180] = math.inf, 0.25
    rows = shown(script, changed(frame, lidar=replace(scan, ranges=ranges)))
    assert rows["beam"] == [1.0, None, 0.25, pytest.approx(ranges[270])]  # JSON has no inf
    assert rows["nearest"] == 180


def test_values_that_are_no_numbers_and_a_vehicle_without_scan_are_said_in_words(script: Path, frame: Frame) -> None:
    scan = vehicle_of(frame).lidar
    assert scan is not None
    nothing = replace(scan, ranges=np.full(360, -math.inf))
    odd = changed(frame, velocity=np.full(3, math.nan), throttle=math.inf, steering=-0.0, lidar=nothing)
    rows = shown(script, odd)
    assert (rows["speed"], rows["throttle"], rows["steering"]) == ("\N{EN DASH} m/s", "inf%", "0.00 rad")
    assert rows["lidar"] == "inf m"
    assert rows["nearest"] == -1


@pytest.mark.parametrize("seconds", [0.0, 59.999, 60.0, 3599.99, 3600.0, 86399.5, 0.1 * 3 * 10])
def test_time_is_hours_minutes_and_seconds(script: Path, frame: Frame, seconds: float) -> None:
    text = shown(script, replace(frame, time=seconds))["time"]
    assert text == time.strftime("%H:%M:%S", time.gmtime(seconds))
