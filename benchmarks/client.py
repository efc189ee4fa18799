"""What lock-step over the wire costs: round trips of `Client.step` beyond `World.step`, server in its own process.

    uv run benchmarks/client.py [--steps 3000]

Without pictures, and with a scan and two JPEGs of 30 kB (encoded already) in each step. Wall time, in turns with the
World alone, so that both see the same machine.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import time
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from msgspec.structs import replace

import autodrive
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Command, Frame, LidarScan, Pose
from autodrive.protocol.native import Scene
from autodrive.world import World
from autodrive.world.simulation import Simulation
from autodrive.world.views.scene_files import SceneFiles

TURNS = 20
COMMANDS = {"V1": Command(0.3, 0.1)}
POSE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
RGBA = np.zeros((480, 640, 4), np.uint8)
SCAN = LidarScan(0.0, np.ones(360), np.ones(360), -np.pi, np.pi / 180, 0.15, 12.0, 7.0, 1 / 7, 0.0)


class Loaded:
    """A World whose every Frame has a new scan and two new pictures."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.frame = world.frame

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)

    def step(self, orders: dict[str, Command]) -> Frame:
        """One tick, with all of that."""
        frame = self._world.step(orders)
        image = CameraImage(frame.time, POSE, CameraIntrinsics(640, 480, 500.0, 500.0, 320.0, 240.0), RGBA)
        cameras = {"front": image, "rear": replace(image)}
        vehicle = replace(frame.vehicles["V1"], lidar=replace(SCAN, time=frame.time), cameras=cameras)
        self.frame = replace(frame, vehicles={"V1": vehicle})
        return self.frame


class Ready:
    """Has each JPEG already."""

    jpeg = np.random.default_rng(1).bytes(30_000)

    def encode(self, *_: object, **__: object) -> bytes:
        """At once."""
        return self.jpeg


def bare(world: World) -> SceneFiles:
    return SceneFiles(Scene("benchmark", "", "", world.tick_duration, "", {}, {}, {}, {}), {})


def serve(pipe: Connection, is_loaded: bool) -> None:
    world: Any = autodrive.make("mini_map")
    world = Loaded(world) if is_loaded else world
    world.step(COMMANDS)
    pictures: Any = Ready() if is_loaded else None
    with Simulation(world, is_paused=True) as simulation:  # noqa: SIM117
        with SimulationServer(Served(simulation, bare, jpeg_encoder=pictures), PageOptions(port=0)) as server:
            pipe.send(server.address)
            pipe.recv()


def measure(is_loaded: bool, steps: int) -> tuple[list[float], list[float]]:
    """Seconds of each `World.step`, and of each `Client.step`."""
    ours, peer = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=serve, args=(peer, is_loaded))
    process.start()
    world = autodrive.make("mini_map")
    alone: list[float] = []
    wire: list[float] = []
    with autodrive.Client(ours.recv(), picture_rate=1e5 if is_loaded else 0.0, timeout=60.0) as sim:
        for _ in range(TURNS):
            for step, times in ((world.step, alone), (sim.step, wire)):
                for _ in range(5):
                    step(COMMANDS)
                for _ in range(steps // TURNS):
                    start = time.perf_counter()
                    step(COMMANDS)
                    times.append(time.perf_counter() - start)
        if is_loaded:
            assert len(sim.pictures) == 2
    ours.send(None)
    process.join()
    return alone, wire


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=3000)
    steps = parser.parse_args().steps
    for is_loaded, what in ((False, "no pictures"), (True, "a scan and two JPEGs of 30 kB")):
        alone, wire = (np.array(times) * 1e3 for times in measure(is_loaded, steps))
        tick = statistics.median(alone)
        fast, median, slow = np.quantile(wire, [0.05, 0.5, 0.99]) - tick
        print(f"{what}: {median:.3f} ms beyond the tick of {tick:.3f} ms (5 %: {fast:.3f}, 99 %: {slow:.3f})")


if __name__ == "__main__":
    main()
