"""A sensor of the user, through a running Server to a Client and to ROS."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import autodrive
from autodrive import Client, Command, Simulation
from autodrive.connect.ros import Bridge, Config
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import Server
from autodrive.protocol.codec import encode
from autodrive.world.scene_files import SceneFiles
from tests.support.radar import Radar
from tests.support.ros.recorder import Recorder
from tests.support.waiting import LIMIT, wait_until


@pytest.fixture
def server() -> Iterator[Server]:
    world = autodrive.make("mini_map")
    world.add_sensor("V1", "radar", Radar())
    with (
        Simulation(world, is_paused=True) as simulation,
        Server(Served(simulation, lambda world: SceneFiles.of(world, "")), PageOptions(port=0)) as one,
    ):
        yield one


def test_readings_arrive_at_a_client_with_their_bits(server: Server) -> None:
    world = autodrive.make("mini_map")
    world.add_sensor("V1", "radar", Radar())
    with Client(server.address, name="script", timeout=LIMIT) as client, client.lockstep():
        for _ in range(20):
            command = {"V1": Command(0.5)}
            assert encode(client.step(command)) == encode(world.step(command))
        reading = client.step().vehicles["V1"].own["radar"]
    assert reading.columns == Radar.columns
    assert not reading.values.flags.writeable


def test_ros_has_a_topic_with_the_names_of_the_columns(server: Server) -> None:
    node = Recorder()
    bridge = Bridge(Config(port=server.port), node)
    try:
        bridge.start()
        wait_until(lambda: "autodrive/nigel_1/own/radar" in node.messages)
    finally:
        bridge.close()
    fields = node.last("own/radar")
    (dimension,) = fields["layout"]["dim"]
    assert dimension.fields == {"label": "distance [m], speed [m/s], sample", "size": 3, "stride": 3}
    assert fields["data"][2] == 1.0
    assert len(node.messages["autodrive/nigel_1/own/radar"]) == 1
    assert node.topics["autodrive/nigel_1/own/radar"].type == "std_msgs/Float64MultiArray"
