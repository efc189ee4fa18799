"""Reads a LaserScan with CycloneDDS, without ROS, and prints it as JSON. Usage: TOPIC DOMAIN."""

# pyright: reportMissingImports=false, reportCallIssue=false, reportGeneralTypeIssues=false

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float32, int32, sequence, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
@final
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
@final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
@final
class LaserScan(IdlStruct, typename="sensor_msgs::msg::dds_::LaserScan_"):
    header: Header
    angle_min: float32
    angle_max: float32
    angle_increment: float32
    time_increment: float32
    scan_time: float32
    range_min: float32
    range_max: float32
    ranges: sequence[float32]
    intensities: sequence[float32]


name, domain = sys.argv[1], int(sys.argv[2])
qos = Qos(
    Policy.Reliability.BestEffort,
    Policy.History.KeepLast(5),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)
participant = DomainParticipant(domain)
reader = DataReader(participant, Topic(participant, f"rt{name}", LaserScan), qos=qos)
deadline = time.monotonic() + 120.0
while time.monotonic() < deadline:
    for scan in reader.take_iter(timeout=duration(seconds=1)):
        if isinstance(scan, LaserScan):
            print(json.dumps([scan.header.frame_id, scan.header.stamp.sec, scan.angle_increment, list(scan.ranges)]))
            sys.exit()
sys.exit("no scan was received")
