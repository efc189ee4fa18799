"""A simulator in this process, served on a free port."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import autodrive
from autodrive import Client
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.native import Scene, VehicleScene
from autodrive.world import World
from autodrive.world.editing.map_scene import map_scene
from autodrive.world.editing.track_edits import track_scene
from autodrive.world.simulation import Simulation
from autodrive.world.views.scene_files import SceneFiles
from tests.support.waiting import LIMIT

SCENARIOS = {"mini_map": "Mini-map", "boxes": "Boxes"}


def bare(world: World) -> SceneFiles:
    """A Scene without its .glb files, which no script needs."""
    vehicles = {
        name: VehicleScene("nigel", "", 0.15, 0.5236, {}, ["front", "rear"], None, 0.14, 0.03, 0.44, {})
        for name in world.vehicle_specs
    }
    title, town = world.spec.title, map_scene(world, lambda name, _: name)
    scene = Scene(
        title, title, "", world.tick_duration, "", vehicles, {}, {}, {}, map_scene=town, track_scene=track_scene(world)
    )
    return SceneFiles(scene, {})


def started(world: World) -> World:
    """After a tick, so that what is compiled at the first is there, and at its beginning again."""
    world.step()
    world.reset()
    return world


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    """Runs in real time."""
    with Simulation(started(autodrive.make("mini_map")), load=lambda name: started(autodrive.make(name))) as running:
        yield running


@pytest.fixture
def server(simulation: Simulation) -> Iterator[SimulationServer]:
    """Serves it."""
    with SimulationServer(Served(simulation, bare, scenarios=SCENARIOS), PageOptions(port=0)) as serving:
        yield serving


@pytest.fixture
def sim(server: SimulationServer) -> Iterator[Client]:
    """A client of it."""
    with Client(server.address, name="script", timeout=LIMIT) as client:
        yield client
