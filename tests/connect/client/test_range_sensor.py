"""The range sensor of a vehicle file, through a running Server to a Client."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import autodrive
from autodrive import Client
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import Server
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world.simulation import Simulation
from tests.connect.client.conftest import bare
from tests.support.cars import car_file


def test_readings_of_a_vehicle_file_with_a_range_sensor_arrive_at_a_client(tmp_path: Path) -> None:
    sensor = {"mount": {"position": [0.2, 0.0, 0.1]}, "rate": 20.0, "range_max": 2.0, "radiation": "infrared"}
    car = car_file(tmp_path, {"sensors.range": sensor})
    world = autodrive.make(
        ScenarioSpec(
            vehicles={"V1": VehiclePlacement(type=car), "V2": VehiclePlacement(y=3.0)},
            boxes={"box": BoxSpec(x=1.0, y=0.0, size=(0.2, 0.4, 0.4))},
        )
    )
    with (
        Simulation(world, is_paused=True) as simulation,
        Server(Served(simulation, bare), PageOptions(port=0)) as server,
        Client(server.address, name="script") as client,
        client.lockstep(),
    ):
        vehicles = client.step(ticks=12).vehicles
        reading = vehicles["V1"].range
        assert reading is not None
        assert reading.time == pytest.approx(0.1)  # 20 Hz: the latest sample at 0.12 s
        assert reading.range == pytest.approx(0.7, abs=1e-6)  # the near face of the box is at 0.9
        assert reading.field_of_view == pytest.approx(math.radians(15.0))
        assert (reading.range_min, reading.range_max, reading.radiation) == (0.02, 2.0, "infrared")
        assert vehicles["V2"].range is None
        client.teleport("V1", 0.0, 0.0, math.pi)  # the box is behind
        reading = client.step(ticks=6).vehicles["V1"].range
        assert reading is not None
        assert reading.range == math.inf
