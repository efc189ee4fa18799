"""Each entrance refuses each invalid value with a reason, and nothing has moved: worlds, requests, clients, files.

What the reason says is compared with a pattern for each entrance; the tests of the parts have the exact texts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml

import autodrive
from autodrive import AutodriveError, BatchWorld, Client, Command, Simulation, World
from autodrive.base.yaml_files import parse
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.devkit import read_commands
from autodrive.protocol.devkit_profile import PROFILES
from autodrive.protocol.messages import Hold, Place, Reset, SetDrivingMode, SetSensor, SetSpeed, Step, Teleport
from autodrive.scenario import ScenarioSpec
from tests.connect.client.conftest import bare
from tests.support.frames import digest
from tests.support.invalid import INVALID
from tests.support.waiting import LIMIT


class Parts(NamedTuple):
    """What has entrances; the client is that of the paused simulation."""

    world: World
    batch: BatchWorld
    simulation: Simulation
    client: Client

    def state(self) -> list[object]:
        return [digest(self.world.frame), self.batch.readings.tick.tolist(), digest(self.simulation.frame)]


@pytest.fixture(scope="module")
def parts() -> Iterator[Parts]:
    simulation = Simulation(autodrive.make("plane"), is_paused=True, load=autodrive.make)
    with (
        simulation,
        SimulationServer(Served(simulation, bare), PageOptions(port=0)) as server,
        Client(server.url, timeout=LIMIT) as client,
    ):
        yield Parts(autodrive.make("plane"), BatchWorld("plane", 2), simulation, client)


def devkit(key: str, value: Any) -> None:
    (refused,) = read_commands({key: value}, PROFILES["2025"], {"V1": Command()}).refused
    raise AutodriveError(refused)


def file(**fields: Any) -> None:
    parse(yaml.safe_dump(fields), ScenarioSpec, "scenario.yaml")


Entrance = Callable[[Parts, Any], object]
SPEED = "speed must be a number from 1e-06 to"
FINITE = "steering of vehicle 'V1' must be a finite number"
LAMP = "indicators of vehicle 'V1' must be one of 0 off, 1"
ENTRANCES: dict[str, dict[str, tuple[str, Entrance]]] = {
    "command": {
        "World.step": ("throttle of vehicle 'V1'", lambda p, v: p.world.step({"V1": Command(v)})),
        "BatchWorld.step": ("commands|throttle of vehicle", lambda p, v: p.batch.step([[[v, 0.0]], [[0.0, 0.0]]])),
        "Simulation.submit": (FINITE, lambda p, v: p.simulation.submit("V1", Command(0.0, v))),
        "Step": ("throttle|Step", lambda p, v: p.simulation.request(Step(1, {"V1": Command(v)}))),
        "Client.drive": ("throttle of vehicle 'V1'", lambda p, v: p.client.drive("V1", throttle=v)),
        "Client.step": ("steering of vehicle 'V1'", lambda p, v: p.client.step({"V1": Command(0.0, v)})),
        "devkit": ("V1 Throttle: must be a finite number, not", lambda _, v: devkit("V1 Throttle", v)),
    },
    "length": {
        "World.teleport": ("numbers", lambda p, v: p.world.teleport("V1", v, 0.0)),
        "World.teleport yaw": ("numbers", lambda p, v: p.world.teleport("V1", 0.0, 0.0, v)),
        "World.reset": ("numbers", lambda p, v: p.world.reset(poses={"V1": (0.0, v, 0.0)})),
        "World.hold": ("not a pose", lambda p, v: p.world.hold("V1", (v, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0))),
        "BatchWorld.reset": ("numbers|must have the shape", lambda p, v: p.batch.reset(poses={"V1": [v, 0.0, 0.0]})),
        "Teleport": ("-10000 to 10000|of Teleport", lambda p, v: p.simulation.request(Teleport("V1", 0.0, v))),
        "Hold": ("not a pose|of Hold", lambda p, v: p.simulation.request(Hold("V1", (v, 0.0, 0.0))).result(LIMIT)),
        "Place": (
            "finite|at most|at least|of Place",
            lambda p, v: p.simulation.request(Place("V1", v, 0.0)).result(LIMIT),
        ),
        "Client.teleport": ("10000|x must be a number", lambda p, v: p.client.teleport("V1", v, 0.0)),
        "file": ("scenario.yaml", lambda _, v: file(vehicles={"V1": {"x": v}})),
    },
    "speed": {
        "Simulation": (SPEED, lambda p, v: Simulation(p.world, speed=v)),
        "SetSpeed": (f"{SPEED}|of SetSpeed", lambda p, v: p.simulation.request(SetSpeed(v))),
        "Client.set_speed": (f"{SPEED}|factor must be a number", lambda p, v: p.client.set_speed(v)),
    },
    "seed": {
        "World.reset": ("a seed must be a whole number", lambda p, v: p.world.reset(v)),
        "BatchWorld": ("a seed must be a whole number", lambda _, v: BatchWorld("plane", 1, seed=v)),
        "BatchWorld.reset": ("seed", lambda p, v: p.batch.reset(seeds=[0, v])),
        "Reset": ("a seed must be|of Reset", lambda p, v: p.simulation.request(Reset(v))),
        "Client.reset": ("a seed must be|of Reset|not understood", lambda p, v: p.client.reset(seed=v)),
        "file": ("scenario.yaml", lambda _, v: file(seed=v)),
    },
    "vehicle": {
        "World.step": ("not known|Known", lambda p, v: p.world.step({v: Command()})),
        "World.teleport": ("Known", lambda p, v: p.world.teleport(v, 0.0, 0.0)),
        "World.add_sensor": ("Known", lambda p, v: p.world.add_sensor(v, "own", None)),  # pyright: ignore[reportArgumentType]
        "World.set_driving_mode": ("Known", lambda p, v: p.world.set_driving_mode(v, True)),
        "World.reset": ("V1", lambda p, v: p.world.reset(poses={v: (0.0, 0.0, 0.0)})),
        "BatchWorld.reset": ("is not in these worlds", lambda p, v: p.batch.reset(poses={v: [0.0, 0.0, 0.0]})),
        "Simulation.submit": (r"is not known\. Known: V1\.", lambda p, v: p.simulation.submit(v, Command())),
        "Step": ("is not known", lambda p, v: p.simulation.request(Step(1, {v: Command()}))),
        "SetDrivingMode": ("is not known", lambda p, v: p.simulation.request(SetDrivingMode(v, True))),
        "SetSensor": ("V1", lambda p, v: p.simulation.request(SetSensor(v, "lidar")).result(LIMIT)),
        "Client.teleport": ("is not known|not understood", lambda p, v: p.client.teleport(v, 0.0, 0.0)),
    },
    "lamp": {
        "World.step": ("headlights of vehicle 'V1'", lambda p, v: p.world.step({"V1": Command(0.0, 0.0, v)})),
        "Simulation.submit": (LAMP, lambda p, v: p.simulation.submit("V1", Command(0.0, 0.0, None, v))),
        "Client.drive": ("headlights of vehicle 'V1'", lambda p, v: p.client.drive("V1", headlights=v)),
    },
    "ticks": {
        "BatchWorld.step": ("ticks must be", lambda p, v: p.batch.step(np.zeros((2, 1, 2)), ticks=v)),
        "Step": ("1 tick or more|of Step", lambda p, v: p.simulation.request(Step(v))),
        "Client.step": ("1 tick or more|of Step|not understood", lambda p, v: p.client.step(ticks=v)),
    },
    "commands": {
        "World.step": ("must be a Command|a dictionary", lambda p, v: p.world.step(v)),
        "BatchWorld.step": ("commands", lambda p, v: p.batch.step(v)),
        "Step": ("of Step|a dictionary", lambda p, v: p.simulation.request(Step(1, v))),
        "Client.step": ("must be a Command|a dictionary", lambda p, v: p.client.step(v)),
    },
}


@pytest.mark.parametrize(
    ("pattern", "entrance", "value"),
    [
        pytest.param(pattern, entrance, value, id=f"{kind}-{name}-{str(value)[:12]!r}")
        for kind, entrances in ENTRANCES.items()
        for name, (pattern, entrance) in entrances.items()
        for value in INVALID[kind]
    ],
)
def test_an_invalid_value_is_refused_and_nothing_has_moved(
    parts: Parts, pattern: str, entrance: Entrance, value: Any
) -> None:
    before = parts.state()
    with pytest.raises(AutodriveError, match=pattern):
        entrance(parts, value)
    assert parts.state() == before


def test_after_all_refusals_everything_goes_on(parts: Parts) -> None:
    assert parts.client.step(ticks=2).tick == 2
    assert parts.world.step().tick == 1
    assert not parts.simulation.error
