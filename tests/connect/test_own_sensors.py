"""A sensor of the user, through a running Server to a Client and to ROS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import autodrive
from autodrive import Client, Command, Simulation
from autodrive.connect.ros import Config
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.codec import encode
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.views.scene_files import SceneFiles
from tests.support.cars import car_file
from tests.support.radar import Radar
from tests.support.ros.recorder import Recorder, running
from tests.support.waiting import LIMIT, wait_until

CAR = "autodrive/car_1"
RANGE = {"mount": {"position": [0.2, 0.0, 0.1]}, "rate": 20.0, "range_max": 2.0, "radiation": "infrared"}


@pytest.fixture
def world(tmp_path: Path) -> World:
    """A car with a radar of the user and a range sensor in its file, 0.8 m before a box."""
    boxes = {"box": BoxSpec(x=1.1, y=0.0, size=(0.2, 0.4, 0.4))}
    car = car_file(tmp_path, {"sensors.range": RANGE})
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=car)}, boxes=boxes))
    world.add_sensor("V1", "radar", Radar())
    return world


@pytest.fixture
def server(world: World) -> Iterator[SimulationServer]:
    served = Served(Simulation(world, is_paused=True), lambda world: SceneFiles.of(world, ""))
    with served.simulation, SimulationServer(served, PageOptions(port=0)) as one:
        yield one


def test_readings_arrive_at_a_client_with_their_bits(server: SimulationServer, world: World) -> None:
    before = world.save()
    with Client(server.address, name="script", timeout=LIMIT) as client, client.lockstep():
        frames = [client.step({"V1": Command(0.5)}) for _ in range(20)]
    world.restore(before)
    for frame in frames:
        assert encode(frame) == encode(world.step({"V1": Command(0.5)}))
    car = frames[-1].vehicles["V1"]
    assert car.range is not None
    assert (car.range.radiation, car.range.range) == ("infrared", pytest.approx(0.8, abs=0.05))
    assert car.own["radar"].columns == Radar.columns
    assert not car.own["radar"].values.flags.writeable


def test_ros_has_a_topic_with_the_names_of_the_columns(server: SimulationServer) -> None:
    node = Recorder()
    with running(Config(port=server.port), node):
        wait_until(lambda: {f"{CAR}/own/radar", f"{CAR}/range"} <= {*node.messages})
    fields = node.last(f"{CAR}/own/radar")
    (dimension,) = fields["layout"]["dim"]
    assert dimension.fields == {"label": "distance [m], speed [m/s], sample", "size": 3, "stride": 3}
    assert fields["data"][2] == 1.0
    assert len(node.messages[f"{CAR}/own/radar"]) == 1
    assert node.topics[f"{CAR}/own/radar"].type == "std_msgs/Float64MultiArray"
