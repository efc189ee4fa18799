"""The ROS bridge without ROS: sensor readings as ROS messages, ROS messages as Commands. See `Bridge`."""

from __future__ import annotations

from autodrive.connect.ros.bridge import Bridge as Bridge
from autodrive.connect.ros.config import Config as Config
from autodrive.connect.ros.message import Message as Message
from autodrive.connect.ros.message import Node as Node
from autodrive.connect.ros.message import Subscription as Subscription
from autodrive.connect.ros.message import Time as Time
from autodrive.connect.ros.message import Topic as Topic
from autodrive.connect.ros.qos import QOS as QOS
