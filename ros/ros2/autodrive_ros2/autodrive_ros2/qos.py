"""QoS profiles of the topics."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from autodrive.ros import QOS as CLASSES

QOS = {
    name: QoSProfile(
        depth=of.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if of.is_latched else DurabilityPolicy.VOLATILE,
    )
    for name, of in CLASSES.items()
}
"""`qos` of a topic or subscription -> profile."""
