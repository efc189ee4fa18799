"""What the C++ interfaces cost: round trips through the devkit server, and of the native client's lock-step.

    uv run benchmarks/cpp.py

Builds clients/cpp/benchmarks in a temporary folder (a minute). The server: a scan of 360 rays and two JPEGs of about
30 kB, as text of 2023 and with the scan packed as since 2025; the client is a plain socket with the frame ready. The
client: `step` beyond the tick that the same World takes by itself, and the CPU time of it that is the client's own.
Wall time [ms]; the server of the simulator is in a process of its own.
"""

from __future__ import annotations

import base64
import json
import multiprocessing
import os
import socket
import statistics
import struct
import subprocess
import tempfile
import time
from pathlib import Path

from client import COMMANDS, serve
from devkit import noise_image

import autodrive
from autodrive.protocol.devkit import telemetry
from autodrive.protocol.devkit_profile import PROFILES

PACKAGE = Path(__file__).parents[1] / "clients" / "cpp"
ROUNDS = 1000


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        options = ["-DCMAKE_CXX_FLAGS=-O2", "-DAUTODRIVE_BUILD_BENCHMARKS=ON", "-DAUTODRIVE_BUILD_EXAMPLES=OFF"]
        built = Path(os.environ.get("AUTODRIVE_CPP_BUILD", folder))
        subprocess.run(["cmake", "-S", PACKAGE, "-B", built, *options], check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["cmake", "--build", built, "--parallel", "2"], check=True, stdout=subprocess.DEVNULL)
        of_server(built / "serve")
        of_client(built / "step")


def of_server(program: Path) -> None:
    """Telemetry to commands."""
    world = autodrive.make("mini_map")
    while world.time < 0.3:
        world.step()
    jpeg = noise_image()
    for generation in ("2023", "2025"):
        data = telemetry(world.frame, PROFILES[generation], images={("V1", "front"): jpeg, ("V1", "rear"): jpeg})
        message = "42" + json.dumps(["Bridge", data], separators=(",", ":"))
        with subprocess.Popen([program], stdout=subprocess.PIPE, text=True) as script:
            assert script.stdout is not None
            times = round_trips(int(script.stdout.readline()), message.encode())
            script.terminate()
        median, p95 = statistics.median(times), sorted(times)[round(0.95 * len(times))]
        rate = 1e3 * len(times) / sum(times)
        print(f"server, {generation}, {len(message)} bytes: {median:.3f} ms (95 %: {p95:.3f}), {rate:.0f}/s")


def round_trips(port: int, message: bytes) -> list[float]:
    # a mask of zeros leaves the text as it is; the server takes it off all the same
    frame = b"\x81\xff" + struct.pack(">Q", len(message)) + bytes(4) + message
    key = base64.b64encode(os.urandom(16)).decode()
    times = []
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.sendall(
            "GET /socket.io/?EIO=4&transport=websocket HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        while b'"maxPayload"' not in connection.recv(4096):
            pass
        for _ in range(ROUNDS):
            sent = time.perf_counter()
            connection.sendall(frame)
            assert b'42["Bridge"' in connection.recv(4096)
            times.append(1e3 * (time.perf_counter() - sent))
    return times[50:]


def of_client(program: Path) -> None:
    """Lock-step, beyond the tick."""
    world = autodrive.make("mini_map")
    ticks = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        world.step(COMMANDS)
        ticks.append(1e3 * (time.perf_counter() - start))
    tick = statistics.median(ticks)
    for is_loaded, what in ((False, "bare"), (True, "with a scan and two JPEGs of 30 kB")):
        ours, peer = multiprocessing.Pipe()
        process = multiprocessing.get_context("spawn").Process(target=serve, args=(peer, is_loaded))
        process.start()
        port = ours.recv().rsplit(":", 1)[1].strip("/ws")
        words = [str(program), port, str(ROUNDS), "1e5" if is_loaded else "0"]
        *times, own = map(float, subprocess.run(words, check=True, capture_output=True, text=True).stdout.split())
        ours.send(None)
        process.join()
        median, p95 = statistics.median(times[50:]) - tick, sorted(times[50:])[round(0.95 * len(times[50:]))] - tick
        print(f"client, {what}: {median:.3f} ms beyond the tick of {tick:.3f} (95 %: {p95:.3f}), own CPU {own:.3f} ms")


if __name__ == "__main__":
    main()
