"""The ROS bridge without ROS: sensor readings as ROS messages, ROS messages as Commands. See `Bridge`."""

from autodrive.connect.ros import QOS, Bridge, Config, Message, Node, Subscription, Time, Topic

__all__ = ["QOS", "Bridge", "Config", "Message", "Node", "Subscription", "Time", "Topic"]
