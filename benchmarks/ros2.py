"""What the ROS 2 node costs, and how late its readers are.

    scripts/ros2 && uv run benchmarks/ros2.py

A simulator in real time with a scan and two pictures of 640 x 480, the node, and one reader in rclpy, each a process of
its own. CPU of the node in a core [%]; medians [ms] until the reader's callback: of a scan from its simulated time on
(where real time is, the fastest Frame to a native client says), of a picture from when a native client has it. (Before,
it is drawn and encoded, which is the simulator's affair.)
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.ros_node import CASES, PICTURES, ROOT, SECONDS, cpu, head, report, watched
from tests.support.ros.processes import simulator
from tests.support.ros.ros2 import ENVIRONMENT, bridge, sourced
from tests.support.waiting import free_port

STATES = {f"{ROOT}/imu/data": "Imu", f"{ROOT}/scan": "LaserScan", f"{ROOT}/joint_states": "JointState"}
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


def main() -> None:
    environment = sourced()
    head()
    with tempfile.TemporaryDirectory() as folder:
        for mode, pictures in CASES:
            run(environment, Path(folder), mode, pictures)


def run(environment: dict[str, str], folder: Path, mode: str, pictures: str) -> None:
    port, devkit = free_port(), free_port()
    options = ["--devkit", f"127.0.0.1:{devkit}", "--devkit-profile", "2025"] if mode == "devkit" else []
    simulated = simulator(folder, "mini_map", *options, port=port)
    with bridge(environment, folder, mode=mode, port=devkit if mode == "devkit" else port) as node:
        command = [ENVIRONMENT / "bin" / "python", "-c", READER, json.dumps(STATES | PICTURES[pictures])]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as reader:
            assert reader.stdout is not None
            reader.stdout.readline()
            time.sleep(5.0)
            begin, used = time.time(), cpu(node.process.pid)
            seen = watched(port, 30.0 if mode == "direct" and pictures != "none" else 0.0)
            share = (cpu(node.process.pid) - used) / (time.time() - begin)
            reader.kill()
            heard = [one for one in map(json.loads, reader.stdout) if begin + 1.0 < one[2] < begin + SECONDS - 1.0]
    simulated.stop(signal.SIGTERM)
    report(mode, pictures, share, seen, heard)


if __name__ == "__main__":
    main()
