"""The ROS bridge without ROS: sensor readings as ROS messages, ROS messages as Commands. See `Bridge`."""

from __future__ import annotations

from autodrive.ros.bridge import Bridge as Bridge
from autodrive.ros.config import Config as Config
from autodrive.ros.message import Message as Message
from autodrive.ros.message import Node as Node
from autodrive.ros.message import Subscription as Subscription
from autodrive.ros.message import Time as Time
from autodrive.ros.message import Topic as Topic
