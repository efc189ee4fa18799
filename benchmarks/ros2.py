"""What the ROS 2 node costs, and how late its readers are.

    scripts/ros2 && uv run benchmarks/ros2.py

A simulator in real time with a scan and two pictures of 640 x 480, the node, and one reader in rclpy, each a process of
its own. CPU of the node in a core [%]; medians [ms] until the reader's callback: of a scan from its simulated time on
(where real time is, the fastest Frame to a native client says), of a picture from when a native client has it. (Before,
it is drawn and encoded, which is the simulator's affair.)
"""

from __future__ import annotations

import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))

from autodrive import Client
from tests.ros.ros1 import free_port, simulator
from tests.ros.ros2 import VEHICLE, WHEELS, bridge, sourced

SECONDS = 15.0
STATES = {f"{VEHICLE}/imu/data": "Imu", f"{VEHICLE}/scan": "LaserScan", f"{VEHICLE}/joint_states": "JointState"}
PICTURES = {
    "none": {},
    "compressed": {f"{VEHICLE}/{side}_camera/image_raw/compressed": "CompressedImage" for side in ("front", "rear")},
    "raw": {f"{VEHICLE}/{side}_camera/image_raw": "Image" for side in ("front", "rear")},
}
CASES = [("devkit", "raw"), ("direct", "none"), ("direct", "compressed"), ("direct", "raw")]

READER = """
import json, sys, time, rclpy, sensor_msgs.msg
from rclpy.qos import qos_profile_sensor_data
rclpy.init()
node = rclpy.create_node("reader")
def take(message, topic):
    print(json.dumps([topic, message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec, time.time()]), flush=True)
for topic, kind in json.loads(sys.argv[1]).items():
    heard = lambda message, topic=topic: take(message, topic)
    node.create_subscription(getattr(sensor_msgs.msg, kind), topic, heard, qos_profile_sensor_data)
rclpy.spin(node)
"""


class Seen(NamedTuple):
    """What a native client saw meanwhile: wall time less simulated time of each Frame, and arrivals of pictures [s]."""

    frames: dict[float, float]
    pictures: dict[float, float]

    def lag(self, wall: float, stamp: float) -> float:
        """From that simulated time on: the fastest Frames of the second around it say when that was [s]."""
        return wall - stamp - min(offset for time_, offset in self.frames.items() if abs(time_ - stamp) < 0.5)


def main() -> None:
    environment = sourced()
    print(f"load {os.getloadavg()[0]:.1f}")
    print(f"{'mode':>7} {'pictures':>10} {'CPU %':>6} {'scan ms':>8} {'picture ms':>10} {'of a camera':>11}")
    with tempfile.TemporaryDirectory() as folder:
        for mode, pictures in CASES:
            run(environment, Path(folder), mode, pictures)


def run(environment: dict[str, str], folder: Path, mode: str, pictures: str) -> None:
    port, devkit = free_port(), free_port()
    options = ["--devkit", f"127.0.0.1:{devkit}", "--devkit-profile", "2025"] if mode == "devkit" else []
    simulated = simulator(folder, "mini_map", *options, port=port)
    with bridge(environment, folder, mode=mode, port=devkit if mode == "devkit" else port) as node:
        command = [WHEELS / "bin" / "python", "-c", READER, json.dumps(STATES | PICTURES[pictures])]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as reader:
            assert reader.stdout is not None
            reader.stdout.readline()
            time.sleep(5.0)
            begin, used = time.time(), cpu(node.process.pid)
            seen = watched(port, 30.0 if mode == "direct" and pictures != "none" else 0.0)
            share = (cpu(node.process.pid) - used) / (time.time() - begin)
            reader.kill()
            heard = [one for one in map(json.loads, reader.stdout) if begin + 1.0 < one[2] < begin + SECONDS - 1.0]
    simulated.end(signal.SIGTERM)
    # The devkits' protocol tells no time: the stamps are the node's.
    scans = [seen.lag(wall, stamp) for topic, stamp, wall in heard if topic.endswith("scan") and mode == "direct"]
    shown = [(round(stamp, 6), wall) for topic, stamp, wall in heard if "front_camera" in topic]
    late = [wall - seen.pictures[stamp] for stamp, wall in shown if stamp in seen.pictures]
    rate = len(shown) / (SECONDS - 2.0)
    print(
        f"{mode:>7} {pictures:>10} {100.0 * share:6.1f} {median(scans):>8} {median(late):>10} {rate:8.1f} Hz",
        flush=True,
    )


def median(values: list[float]) -> str:
    return f"{1e3 * statistics.median(values):.2f}" if values else "-"


def watched(port: int, picture_rate: float) -> Seen:
    """For some seconds."""
    seen = Seen({}, {})
    with Client(f"127.0.0.1:{port}", picture_rate=picture_rate, picture_quality=90) as sim:
        end = time.time() + SECONDS
        while time.time() < end:
            frame = sim.wait()
            now = time.time()
            seen.frames[frame.time] = now - frame.time
            if picture := sim.pictures.get(("V1", "front")):
                seen.pictures.setdefault(round(picture.time, 6), now)
    return seen


def cpu(pid: int) -> float:
    """Time that it and its threads have used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
