"""What the server costs and how quick it is: viewers at 60 Hz, key press to command, Steps over the wire.

    uv run benchmarks/server.py [--seconds 300] [--only cpu,keys,steps,crowd]

Scenario 'boxes': one vehicle, ten boxes. Everything that connects runs in processes of its own, so that its time does
not count; with two cores they take time from the simulator all the same.
"""

from __future__ import annotations

import argparse
import base64
import os
import selectors
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

import autodrive
from autodrive import Command, Simulation
from autodrive.connect.server.served import Served
from autodrive.connect.server.server import SimulationServer
from autodrive.graphics.cameras.jpeg import JpegEncoder
from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Frame, Pose
from autodrive.world import World
from autodrive.world.views.scene_files import SceneFiles

SCENARIO = "boxes"
MEASURE = 10.0
"""Wall time of a measurement of processor time [s]."""

pack, unpack = msgspec.msgpack.encode, msgspec.msgpack.decode


# -- those who connect, in processes of their own ---------------------------------------------------------------


class Client:
    """The shortest client: blocking, of one thread."""

    def __init__(self, port: int, name: str = "benchmark") -> None:
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [
            "GET /ws HTTP/1.1",
            f"Host: 127.0.0.1:{port}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Protocol: autodrive.v2",
        ]
        self.socket.sendall("\r\n".join([*lines, "", ""]).encode())
        self.rest = b""
        while b"\r\n\r\n" not in self.rest:
            self.rest += self.socket.recv(65536)
        self.rest = self.rest.partition(b"\r\n\r\n")[2]
        self.say({"type": "Hello", "protocol": 2, "name": name})

    def say(self, message: dict[str, Any]) -> None:
        """Masked with zeros."""
        data = pack(message)
        size = bytes([0x82, 0x80 | len(data)]) if len(data) < 126 else struct.pack("!BBH", 0x82, 0xFE, len(data))
        self.socket.sendall(size + bytes(4) + data)

    def hear(self) -> bytes:
        """The next message."""
        size = self._take(2)[1]
        if size == 126:
            (size,) = struct.unpack("!H", self._take(2))
        elif size == 127:
            (size,) = struct.unpack("!Q", self._take(8))
        return self._take(size)

    def _take(self, count: int) -> bytes:
        while len(self.rest) < count:
            self.rest += self.socket.recv(262144)
        data, self.rest = self.rest[:count], self.rest[count:]
        return data


def view(port: int, count: int) -> None:
    """So many viewers, who read and look at nothing; prints Mbytes at the end of stdin."""
    selector = selectors.DefaultSelector()
    for number in range(count):
        client = Client(port, f"viewer {number}")
        selector.register(client.socket, selectors.EVENT_READ)
        time.sleep(0.003)  # as people come: not all in the same instant of a frame
    selector.register(sys.stdin, selectors.EVENT_READ)
    print("ready", flush=True)
    total = 0
    while True:
        for key, _ in selector.select():
            if key.fileobj is sys.stdin:
                print(total / 1e6, flush=True)
                return
            total += len(key.fileobj.recv(65536))  # type: ignore[union-attr]


def press(port: int, count: int) -> None:
    """Send this number of commands at random times; the throttle numbers them, and a line has the time of each."""
    client = Client(port)
    threading.Thread(target=lambda: [client.hear() for _ in iter(int, 1)], daemon=True).start()
    time.sleep(0.5)
    rng = np.random.default_rng(0)
    for number in range(1, count + 1):
        command = {"throttle": number / 1000}
        sent = time.monotonic()
        client.say({"type": "Drive", "vehicle": "V1", "command": command, "source": "script"})
        print(number, sent)
        time.sleep(rng.uniform(0.02, 0.05))


def step(port: int, count: int, all_sensors: int) -> None:
    """So many Steps; prints each round trip [us]."""
    client = Client(port)
    pictures = {"scans": True, "picture_rate": 1e5} if all_sensors else {}
    client.say({"type": "Subscribe", "frame_rate": 0.0, **pictures})
    client.say({"type": "Request", "id": 0, "operation": {"type": "Pause"}})
    for number in range(count):
        begin = time.perf_counter()
        client.say(
            {"type": "Request", "id": number, "operation": {"type": "Step", "commands": {"V1": {"throttle": 0.2}}}}
        )
        while b"\xa8Response" not in client.hear()[:20]:
            pass
        print((time.perf_counter() - begin) * 1e6)


ROLES = {"view": view, "press": press, "step": step}


def other(role: str, *arguments: int) -> subprocess.Popen[str]:
    words = [sys.executable, __file__, "--as", role, *map(str, arguments)]
    return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


# -- the simulator ----------------------------------------------------------------------------------------------


@contextmanager
def served(world: World) -> Iterator[tuple[Simulation, SimulationServer]]:
    simulation = Simulation(world)
    server = SimulationServer(
        Served(simulation, lambda world: SceneFiles.of(world, SCENARIO), jpeg_encoder=JpegEncoder())
    )
    with server, simulation:
        time.sleep(1.0)
        yield simulation, server


@contextmanager
def viewers(server: SimulationServer, count: int) -> Iterator[None]:
    process = other("view", server.port, count)
    assert process.stdout is not None
    assert process.stdin is not None
    process.stdout.readline()
    yield
    process.communicate("\n")


def processor_time(seconds: float = MEASURE) -> float:
    """Share of a core that this process takes."""
    begin, wall = time.process_time(), time.monotonic()
    time.sleep(seconds)
    return (time.process_time() - begin) / (time.monotonic() - wall)


def resident() -> float:
    """Memory of this process [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1e3


def measure_cpu(world: World) -> None:
    with served(world) as (_, server):
        alone = processor_time()
        print(f"simulation and server without viewers: {alone:.1%} of a core")
        for count in (1, 10):
            with viewers(server, count):
                share = processor_time() - alone
            print(f"{count:2d} viewers at 60 Hz: {share:.2%} of a core, {share / count:.2%} each (at most 2 %)")


def measure_crowd(world: World, seconds: float) -> None:
    with served(world) as (simulation, server), viewers(server, 50):
        time.sleep(2.0)
        memory, ticks, begin = resident(), simulation.ticks, time.monotonic()
        busy = processor_time(seconds)
        factor = (simulation.ticks - ticks) * world.tick_duration / (time.monotonic() - begin)
        print(f"50 viewers for {seconds:.0f} s: {busy:.1%} of a core, real-time factor {factor:.4f} (at least 0.99)")
        print(f"   memory {memory:.1f} MB, then {resident():.1f} MB; late ticks {simulation.late_ticks}")


def measure_keys(world: World, count: int = 500) -> None:
    arrived: dict[int, float] = {}
    usual = world.step

    def watched(commands: Mapping[str, Command] | None = None) -> Frame:
        if commands:
            arrived.setdefault(round(commands["V1"].throttle * 1000), time.monotonic())
        return usual(commands or {})

    world.step = watched  # type: ignore[method-assign]
    world.set_driving_mode("V1", True)
    with served(world) as (_, server):
        out, _ = other("press", server.port, count).communicate()
    del world.step
    times = []
    for line in out.splitlines():
        number, sent = line.split()
        if int(number) in arrived:
            times.append((arrived[int(number)] - float(sent)) * 1e3)
    median, last = statistics.median(times), np.percentile(times, 99)
    print(f"key press to command: median {median:.2f} ms (at most 5), p99 {last:.2f} ms (at most 20), n {len(times)}")


def measure_steps(world: World, count: int = 2000) -> None:
    spent: list[float] = []
    usual = world.step

    def timed(commands: Mapping[str, Command] | None = None) -> Frame:
        begin = time.perf_counter()
        frame = usual(commands or {})
        if with_pictures:
            frame = shown.of(frame)
        spent.append((time.perf_counter() - begin) * 1e6)
        return frame

    world.step = timed  # type: ignore[method-assign]
    for with_pictures, limit in ((0, 300), (1, 600)):
        shown = Shown()
        with served(world) as (_, server):
            spent.clear()
            out, _ = other("step", server.port, count, with_pictures).communicate()
        ticks = spent[-count:]
        trips = [float(line) for line in out.split()]
        beyond = sorted(trip - tick for trip, tick in zip(trips, ticks, strict=True))
        what = "two new JPEGs and a scan" if with_pictures else "no pictures"
        print(
            f"a Step and its Frame, {what}: {statistics.median(trips):.0f} us, the tick {statistics.median(ticks):.0f};"
        )
        late = beyond[len(beyond) * 99 // 100]
        print(f"   beyond the tick {statistics.median(beyond):.0f} us (at most {limit}), p99 {late:.0f}")
    del world.step


class Shown:
    """Frames with two new pictures and a new scan each; the JPEGs are encoded already, as those of a script are."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        smooth = np.cumsum(rng.normal(0, 4, (480, 640, 4)), axis=1) % 255
        self.rgba = smooth.astype(np.uint8)
        self.intrinsics = CameraIntrinsics(640, 480, 500.0, 500.0, 320.0, 240.0)
        self.jpeg = JpegEncoder().encode("V1", "front", self._image(0.0))
        JpegEncoder.encode = lambda *_, **__: self.jpeg  # type: ignore[method-assign]

    def _image(self, now: float) -> CameraImage:
        return CameraImage(now, Pose(np.zeros(3), np.zeros(4)), self.intrinsics, self.rgba)

    def of(self, frame: Frame) -> Frame:
        """That Frame with all of them."""
        replace = msgspec.structs.replace
        vehicle = frame.vehicles["V1"]
        scan = vehicle.lidar and replace(vehicle.lidar, time=frame.time)
        images = {name: self._image(frame.time) for name in ("front", "rear")}
        return replace(frame, vehicles={"V1": replace(vehicle, cameras=images, lidar=scan)})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=300.0, help="of 50 viewers")
    parser.add_argument("--only", default="cpu,keys,steps,crowd", help="what to measure, with commas")
    parser.add_argument("--as", nargs="+", dest="role", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.role:
        ROLES[arguments.role[0]](*map(int, arguments.role[1:]))
        return
    world = autodrive.make(SCENARIO)
    for _ in range(100):  # until all is compiled
        world.step()
    measures = {
        "cpu": lambda: measure_cpu(world),
        "keys": lambda: measure_keys(world),
        "steps": lambda: measure_steps(world),
        "crowd": lambda: measure_crowd(world, arguments.seconds),
    }
    for name in arguments.only.split(","):
        world.reset()
        measures[name]()


if __name__ == "__main__":
    main()
