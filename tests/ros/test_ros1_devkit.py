"""The ROS 1 node with the names and signs of three eras, also as the server of the devkits' protocol."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from autodrive import Client
from tests.ros.ros1 import Stage, launched, witness
from tests.ros.running import Witness, await_that, client, free_port


@pytest.fixture
def sim(stage: Stage) -> Iterator[Client]:
    with client(stage.port) as one:
        one.reset()
        yield one
        one.disconnect_bridge()
        one.resume()


@pytest.fixture
def hearing(stage: Stage) -> Iterator[Witness]:
    with witness(stage.environment, stage.folder) as one:
        yield one


@pytest.mark.parametrize(
    ("mode", "profile", "root", "left", "feedback_left"),
    [
        ("devkit", "2020", "ego_vehicle", -1.0, -1.0),
        ("devkit", "2023", "nigel_1", -1.0, 1.0),  # as its simulator had it
        ("direct", "2022", "v1", -1.0, -1.0),  # a simulator cannot tell this devkit from that of 2023
    ],
)
def test_names_signs_and_values_are_those_of_the_era(
    stage: Stage, hearing: Witness, sim: Client, mode: str, profile: str, root: str, left: float, feedback_left: float
) -> None:
    port = stage.port if mode == "direct" else free_port()
    steering = "steering_angle" if profile == "2020" else "steering"
    kinds = {
        "throttle": "std_msgs/Float32",
        steering: "std_msgs/Float32",
        "left_encoder": "sensor_msgs/JointState",
        "ips": "geometry_msgs/Point",
        "imu": "sensor_msgs/Imu",
        "lidar": "sensor_msgs/LaserScan",
        "front_camera": "sensor_msgs/Image",
    }
    topics = {name: f"/autodrive/{root}/{name}" for name in kinds}

    def heard(name: str) -> Any:
        return hearing.latest(topics[name])["message"]

    with launched(stage, "autodrive.launch", f"mode:={mode}", f"port:={port}", f"profile:={profile}"):
        for name, topic in topics.items():
            hearing.listen(topic, kinds[name])
        for name, value in (("throttle", 0.6), ("steering", 0.5 * left)):
            hearing.say(f"/autodrive/{root}/{name}_command", "std_msgs/Float32", value)
        if mode == "devkit":
            sim.connect_bridge("127.0.0.1", port)
        v = await_that(lambda: (v := sim.wait().vehicles["V1"]) and v.pose.position[1] > 0.05 and v)
        assert v.throttle == pytest.approx(0.6)
        sim.pause()
        v = sim.frame.vehicles["V1"]
        decimals = 5.1e-4  # three in the text
        w, x, y, z = v.imu.orientation

        def is_told() -> bool:
            """All of that moment; the devkits' protocol tells no time."""
            return (
                np.allclose(heard("imu")["orientation"]["z"], z, atol=decimals)
                and np.allclose(heard("left_encoder")["position"], v.encoders.angles[:1], atol=decimals)
                and np.allclose(heard(steering)["data"], feedback_left * v.steering, atol=decimals)
            )

        await_that(is_told, 10.0)
        place = [*heard("ips").values()]
        if profile == "2020":  # its vehicle's origin is the body's centre
            place[0] -= 0.08 * (1.0 - 2.0 * (y * y + z * z))
            place[1] -= 0.08 * 2.0 * (x * y + w * z)
            place[2] -= 0.015
        np.testing.assert_allclose(place, v.ips.position, atol=2.0 * decimals)
        scan = heard("lidar")
        assert v.lidar is not None
        assert (scan["header"]["frame_id"], scan["angle_min"]) == ("lidar", pytest.approx(-np.pi))
        told = [np.inf if r < 0.0 else r for r in scan["ranges"]]
        np.testing.assert_allclose(told, np.where(v.lidar.ranges < 0.0, np.inf, v.lidar.ranges), rtol=1e-5)
        ips = [*heard("ips").values()]
        await_that(lambda: np.allclose(hearing.transform("map", root)[0], ips, atol=2e-3), 10.0)
        assert heard("front_camera")["encoding"] == "rgb8"
