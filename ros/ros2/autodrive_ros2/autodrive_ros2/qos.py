"""QoS profiles of the topics."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

RELIABLE = ReliabilityPolicy.RELIABLE

QOS = {
    "sensor": QoSProfile(depth=5, reliability=RELIABLE),
    "state": QoSProfile(depth=10, reliability=RELIABLE),
    "latched": QoSProfile(depth=1, reliability=RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    "clock": QoSProfile(depth=1, reliability=RELIABLE),
    "tf": QoSProfile(depth=100, reliability=RELIABLE),
    "command": QoSProfile(depth=10, reliability=RELIABLE),
    "league": QoSProfile(depth=1, reliability=RELIABLE),
}
"""`qos` of a topic or subscription -> profile. All are reliable: default subscribers, which are, get no message of a
best-effort publisher, and best-effort subscribers get those of a reliable one. History and durability are the defaults:
keep last, volatile."""
