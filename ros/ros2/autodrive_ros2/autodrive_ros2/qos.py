"""QoS profiles of the topics."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

RELIABLE, BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT

QOS = {
    "sensor": QoSProfile(depth=5, reliability=BEST_EFFORT),
    "state": QoSProfile(depth=10, reliability=RELIABLE),
    "latched": QoSProfile(depth=1, reliability=RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    "clock": QoSProfile(depth=1, reliability=BEST_EFFORT),
    "tf": QoSProfile(depth=100, reliability=RELIABLE),
    "command": QoSProfile(depth=10, reliability=RELIABLE),
    "league": QoSProfile(depth=1, reliability=RELIABLE),
}
"""`qos` of a topic or subscription -> profile: the usual ones of sensor data, tf2 and /clock, that of commands, and
that of the RoboRacer league. History and durability are the defaults: keep last, volatile."""
