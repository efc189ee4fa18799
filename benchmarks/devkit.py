"""Round trip of a telemetry message and its commands through the Python devkit's server.

    uv run benchmarks/devkit.py

A scan of 360 rays and two JPEGs of about 30 kB, as text of 2023 and with the scan packed as since 2025; the script
looks at neither picture, or at both. The client is a process of its own. Wall time [ms], median and 95th percentile.
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
from autodrive.devkit import Nigel, Server
from autodrive.protocol.devkit import PROFILES, telemetry

ROUNDS = 500


def main() -> None:
    world = autodrive.make("mini_map")
    while world.time < 0.3:
        world.step()
    jpeg = picture()
    print(f"two pictures of {len(jpeg)} bytes\n{'era':>5} {'looked at':>9} {'bytes':>7} {'median':>7} {'95 %':>7}")
    for era in ("2023", "2025"):
        data = telemetry(world.frame, PROFILES[era], images={("V1", "front"): jpeg, ("V1", "rear"): jpeg})
        message = "42" + json.dumps(["Bridge", data])
        for looks in (False, True):
            times = round_trips(message, looks)
            p95 = sorted(times)[round(0.95 * len(times))]
            print(f"{era:>5} {looks!s:>9} {len(message):7} {1e3 * statistics.median(times):7.2f} {1e3 * p95:7.2f}")


def picture() -> bytes:
    """Noise, which fills as many bytes as a busy scene does."""
    noise = np.random.default_rng(0).integers(60, 150, (480, 640, 3), dtype=np.uint8)
    return min((simplejpeg.encode_jpeg(noise, quality=q) for q in range(1, 60)), key=lambda jpeg: abs(len(jpeg) - 3e4))


def round_trips(message: str, looks: bool) -> list[float]:
    nigel = Nigel("V1")
    nigel.throttle_command, nigel.steering_command = 0.5, 0.1

    def respond(data: Mapping[str, str]) -> dict[str, str]:
        nigel.parse_data(data)
        if looks:
            _ = nigel.front_camera_image, nigel.rear_camera_image
        return nigel.generate_commands()

    with Server(respond, port=0) as server, multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(ask, (server.port, message))


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
