"""Drives a stand-in for a real car by ROS 2 with a deployed policy, and identifies the car from its log.

The stand-in is a simulator with hidden parameters: less grip, latency, another layout of the scan, an offset of the
steering, and noise (`tests/support/ros/stand_in.py`). Prints laps, collisions, and what the node costs.

    python -m benchmarks.stand_in [--tracks practice fast technical] [--laps 10] [--speed 0.5] [--output FOLDER]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.support.ros.processes import client
from tests.support.ros.ros2 import sourced
from tests.support.ros.stand_in import GRIP, LATENCY, OFFSET, DrivenStandIn

LIMIT = 900.0
"""Simulated time after which a drive ends [s]."""
SETTINGS = ("cap_interval=5.0",)


FREE = "steering.dead_time=0.001:0.1,steering.offset_deg=-3:3,wheels.sideways_friction.stiffness=0.5:1.2"
"""What is identified of the hidden parameters."""


def drive(folder: Path, track: str, laps: int, speed: float, policy: str, vehicle: str) -> None:
    """Drive laps on a track; print a line."""
    environment = sourced()
    folder.mkdir(parents=True, exist_ok=True)
    arguments = {"policy": policy, "vehicle": vehicle, "laps": laps, "speed": speed, "settings": SETTINGS}
    with DrivenStandIn(environment, folder, track, **arguments) as car, client(car.port) as sim:
        car.press(True)
        frame, began, used = sim.wait(), time.monotonic(), car.processor_time()
        times: list[float] = []
        while frame.time < LIMIT and not frame.vehicles["V1"].collision_count and len(times) < laps:
            frame = sim.wait()
            race = frame.vehicles["V1"].race
            if race is not None and race.lap_count > len(times):
                times.append(race.last_lap_time)
        share = (car.processor_time() - used) / (time.monotonic() - began) / speed
        collisions = frame.vehicles["V1"].collision_count
        car.press(False)
        car.node.stop()
    summary = json.loads(car.log.with_suffix(".json").read_text(encoding="utf-8"))
    print(
        f"{track}: {len(times)} laps, {collisions} collisions, first {times[0] if times else 0:.2f} s, "
        f"best {min(times, default=0.0):.2f} s, last {times[-1] if times else 0:.2f} s; stops {summary['stops']}; "
        f"node {100 * share:.1f} % of a core per simulated second; {summary['seconds_from_scan_to_command']}",
        flush=True,
    )


def main() -> None:
    """Drive on each track."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracks", nargs="+", default=["practice", "fast", "technical"])
    parser.add_argument("--laps", type=int, default=10)
    parser.add_argument("--speed", type=float, default=1.0, help="simulated seconds per second")
    parser.add_argument("--policy", default="race")
    parser.add_argument("--vehicle", default="roboracer", help="with which the policy was trained")
    parser.add_argument("--output", type=Path, help="folder of the logs")
    options = parser.parse_args()
    folder = options.output or Path(tempfile.mkdtemp(prefix="stand_in_"))
    for track in options.tracks:
        drive(folder / track, track, options.laps, options.speed, options.policy, options.vehicle)
    log = folder / options.tracks[-1] / "drive.csv"
    print(f"{GRIP=}, {LATENCY=} s, {OFFSET=} degrees; identified from {log}:", flush=True)
    command = [sys.executable, "-m", "autodrive", "identify", log, "--vehicle", options.vehicle, "--free", FREE]
    subprocess.run([*map(str, command), "--window", "1", "--output", folder / "identified.yaml", "--force"], check=True)
    print(f"logs: {folder}/*/drive.csv")


if __name__ == "__main__":
    main()
