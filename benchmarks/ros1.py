"""What the ROS 1 node costs, and how late its readers are.

    scripts/ros1 --headless && uv run benchmarks/ros1.py

A simulator in real time, whose car drives in circles, with a scan and two pictures of 640 x 480; the node; a reader in
rospy: each a process of its own. CPU of the node in a core [%]; medians [ms] until the reader's callback: of a scan
from its simulated time on (where real time is, the fastest Frames to a native client say), of a picture from when a
native client has it. (Before, it is drawn and encoded, which is the simulator's affair.)
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
from tests.support.ros.processes import Program, simulator
from tests.support.ros.ros1 import master, sourced
from tests.support.waiting import free_port, wait_until

STATES = {f"{ROOT}/imu": "Imu", f"{ROOT}/lidar": "LaserScan", f"{ROOT}/joint_states": "JointState"}
READER = """
import json, sys, time, rospy, sensor_msgs.msg, std_msgs.msg
rospy.init_node("reader", disable_rostime=True)
def take(message, topic):
    print(json.dumps([topic, message.header.stamp.to_sec(), time.time()]), flush=True)
for topic, kind in json.loads(sys.argv[1]).items():
    rospy.Subscriber(topic, getattr(sensor_msgs.msg, kind), take, topic, tcp_nodelay=True)
throttle, steering = [rospy.Publisher("/autodrive/nigel_1/%s_command" % name, std_msgs.msg.Float32, queue_size=1)
    for name in ("throttle", "steering")]
while not rospy.is_shutdown():
    throttle.publish(0.4)
    steering.publish(0.9)
    time.sleep(0.1)
"""


def main() -> None:
    environment = sourced()
    head()
    with tempfile.TemporaryDirectory() as folder:
        roscore = master(environment, Path(folder))
        for mode, pictures in CASES:
            run(environment, Path(folder), mode, pictures)
        roscore.stop()


def run(environment: dict[str, str], folder: Path, mode: str, pictures: str) -> None:
    port, devkit = free_port(), free_port()
    options = ["--devkit", f"127.0.0.1:{devkit}", "--devkit-profile", "2025"] if mode == "devkit" else []
    simulated = simulator(folder, "mini_map", *options, port=port)
    at = devkit if mode == "devkit" else port
    launch = ["roslaunch", "autodrive_ros", "autodrive.launch", f"mode:={mode}", f"port:={at}"]
    with Program(environment, folder, *launch) as node:
        command = ["/usr/bin/python3", "-c", READER, json.dumps(STATES | PICTURES[pictures])]
        words = folder / "heard.txt"  # no pipe, which would fill up
        with words.open("w") as output, subprocess.Popen(command, env=environment, stdout=output) as reader:
            wait_until(words.read_text)
            time.sleep(5.0)
            pid, begin = node_of(node), time.time()
            used = cpu(pid)
            seen = watched(port, 30.0 if mode == "direct" and pictures != "none" else 0.0)
            share = (cpu(pid) - used) / (time.time() - begin)
            reader.terminate()
        heard = [json.loads(line) for line in words.read_text().splitlines() if line.endswith("]")]
        heard = [one for one in heard if begin + 1.0 < one[2] < begin + SECONDS - 1.0]
    simulated.stop(signal.SIGTERM)
    report(mode, pictures, share, seen, heard)


def node_of(launch: Program) -> int:
    """Its process."""

    def found() -> int:
        children = Path(f"/proc/{launch.process.pid}/task/{launch.process.pid}/children")
        threads = [one.read_text().split() for one in children.parents[1].glob("*/children")]
        return next((int(pid) for pids in threads for pid in pids), 0)

    return wait_until(found)


if __name__ == "__main__":
    main()
