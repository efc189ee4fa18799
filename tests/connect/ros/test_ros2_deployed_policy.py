"""A deployed policy drives a stand-in for a real car, which has hidden parameters, by ROS 2 only."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest

from tests.support.ros.processes import Program, client
from tests.support.ros.ros2 import ENVIRONMENT
from tests.support.ros.stand_in import CAR, DrivenStandIn
from tests.support.waiting import wait_until


@pytest.mark.wall_clock  # the scans come in real time, by ROS
def test_a_deployed_policy_drives_a_car_by_ros_and_stops_when_the_scan_is_lost(
    ros2_environment: dict[str, str], tmp_path: Path
) -> None:
    settings = ("speed_cap=3.0", "cap_interval=2.0")
    with (
        DrivenStandIn(ros2_environment, tmp_path, "practice", settings=settings, speed=0.5) as car,
        client(car.port) as sim,
    ):
        # nothing is published before the button is pressed, and nothing at all by a dry run
        dry = Program(
            ros2_environment, tmp_path, ENVIRONMENT / "bin" / "python", tmp_path / "car" / "ros2_node.py", "--dry-run",
            "--set", f"log={tmp_path / 'dry.csv'}", "--ros-args", "-p", "use_sim_time:=true",
        )  # fmt: skip
        with dry:
            car.node.wait_for("the car stands: dead man")
            assert sim.wait().vehicles["V1"].throttle == 0.0
            car.press(True)
            dry.wait_for("the car drives")
            assert len(car.probe.publishers(f"{CAR}/drive")) == 1
        wait_until(lambda: sim.wait().vehicles["V1"].velocity[0] > 2.5)
        wait_until(lambda: "at most 3.5 m/s" in car.node.output)
        lost = car.turn_gate()
        car.node.wait_for("the car stands: no scan")
        wait_until(lambda: abs(sim.wait().vehicles["V1"].velocity[0]) < 0.1)
        car.turn_gate()
        wait_until(lambda: sim.wait().vehicles["V1"].velocity[0] > 1.0)
        car.press(False)
        wait_until(lambda: abs(sim.wait().vehicles["V1"].velocity[0]) < 0.1)
        frame = sim.wait().vehicles["V1"]
        assert frame.collision_count == 0
        car.node.stop()
        wait_until((tmp_path / "drive.json").is_file)
    with car.log.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    # simulated time, from the last scan; a busy machine may stop the car at other times as well
    stop = next(row for row in rows if float(row["time"]) > lost and row["stop"])
    assert float(stop["time"]) - lost <= 0.1
    assert (stop["stop"], float(stop["throttle"])) == ("no scan", 0.0)
    assert math.dist([float(rows[-1][name]) for name in "xy"], frame.pose.position[:2]) < 0.05
    assert len(list(csv.DictReader((tmp_path / "dry.csv").open(encoding="utf-8")))) >= 1
