"""Round trip of a telemetry message and its commands through the Python devkit's server.

    uv run benchmarks/devkit.py

A scan of 360 rays and two JPEG images of about 30 kB; profile 2023 (scan as text) and 2025 (scan compressed); the
script decodes no image, or both. The client is another process. Wall time [ms], median and 95th percentile. Also the
wall time of `DevkitBridge.publish`, which each tick of the simulation waits for.
"""

from __future__ import annotations

import json
import multiprocessing
import statistics
import time
from collections.abc import Mapping

import numpy as np
import simplejpeg
from websockets.sync.client import connect

import autodrive
from autodrive import Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.devkit import Nigel, Server
from autodrive.protocol.devkit import telemetry
from autodrive.protocol.devkit_profile import PROFILES

ROUNDS = 500


def main() -> None:
    world = autodrive.make("mini_map")
    while world.time < 0.3:
        world.step()
    jpeg = noise_image()
    print(f"two images of {len(jpeg)} bytes\n{'profile':>7} {'decoded':>7} {'bytes':>7} {'median':>7} {'95 %':>7}")
    for profile in ("2023", "2025"):
        data = telemetry(world.frame, PROFILES[profile], images={("V1", "front"): jpeg, ("V1", "rear"): jpeg})
        message = "42" + json.dumps(["Bridge", data])
        for decodes in (False, True):
            times = round_trips(message, decodes)
            median, p95 = statistics.median(times), sorted(times)[round(0.95 * len(times))]
            print(f"{profile:>7} {decodes!s:>7} {len(message):7} {1e3 * median:7.2f} {1e3 * p95:7.2f}")
    print(f"publish {1e3 * statistics.median(publish_times()):.4f} ms")


def noise_image() -> bytes:
    """JPEG of noise with about as many bytes as an image of a detailed scene."""
    noise = np.random.default_rng(0).integers(60, 150, (480, 640, 3), dtype=np.uint8)
    return min((simplejpeg.encode_jpeg(noise, quality=q) for q in range(1, 60)), key=lambda jpeg: abs(len(jpeg) - 3e4))


def round_trips(message: str, decodes: bool) -> list[float]:
    nigel = Nigel("V1")
    nigel.throttle_command, nigel.steering_command = 0.5, 0.1

    def respond(data: Mapping[str, str]) -> dict[str, str]:
        nigel.parse_data(data)
        if decodes:
            _ = nigel.front_camera_image, nigel.rear_camera_image
        return nigel.generate_commands()

    with Server(respond, port=0) as server, multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(ask, (server.port, message))


def publish_times() -> list[float]:
    """Wall time of each `DevkitBridge.publish` on a connected bridge [s]."""
    nigel, times = Nigel("V1"), []

    def respond(data: Mapping[str, str]) -> dict[str, str]:
        nigel.parse_data(data)
        return {"V1 Throttle": "0", "V1 Steering": "0"}

    simulation = Simulation(autodrive.make("plane"))
    with simulation, Server(respond, port=0) as server, DevkitBridge(simulation, port=server.port) as bridge:
        while bridge.counters.commands_received < 10:
            time.sleep(0.01)
        frame = simulation.frame
        for _ in range(ROUNDS):
            begin = time.perf_counter()
            bridge.publish(frame)
            times.append(time.perf_counter() - begin)
    return times


def ask(port: int, message: str) -> list[float]:
    times = []
    with connect(f"ws://127.0.0.1:{port}/socket.io/?EIO=4&transport=websocket", compression=None) as simulator:
        for _ in range(2):
            simulator.recv()
        for _ in range(ROUNDS):
            sent = time.perf_counter()
            simulator.send(message)
            simulator.recv()
            times.append(time.perf_counter() - sent)
    return times[50:]


if __name__ == "__main__":
    main()
