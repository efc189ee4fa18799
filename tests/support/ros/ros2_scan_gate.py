"""A ROS 2 node between a scanner and a driver: forwards scans until a line arrives at its standard input.

A line changes between forwarding and silence. For each change it prints the stamp of the last scan that it forwarded.
"""

# pyright: reportMissingImports=false

import sys
import threading

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan


def main():
    """Forward the topic of the first argument to that of the second one."""
    rclpy.init()
    node = rclpy.create_node("scan_gate")
    publisher = node.create_publisher(LaserScan, sys.argv[2], 5)
    is_open, last = threading.Event(), [0.0]
    is_open.set()

    def forward(scan):
        if is_open.is_set():
            last[0] = scan.header.stamp.sec + 1e-9 * scan.header.stamp.nanosec
            publisher.publish(scan)

    def read():
        for _ in sys.stdin:
            (is_open.clear if is_open.is_set() else is_open.set)()
            print(last[0], flush=True)

    node.create_subscription(LaserScan, sys.argv[1], forward, qos_profile_sensor_data)
    threading.Thread(target=read, daemon=True).start()
    print("ready", flush=True)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


main()
