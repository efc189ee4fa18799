"""Fixtures: a running Simulation, WebSocket servers in a thread, devkit scripts in processes of their own."""

from __future__ import annotations

import contextlib
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

import autodrive
from autodrive import Frame, Simulation
from autodrive.world import World
from tests.support.waiting import is_listening, wait_until

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def one_world() -> World:
    world = autodrive.make("plane")
    for _ in range(30):  # until after the first scan: what is compiled on first use is now compiled
        world.step()
    return world


@pytest.fixture
def simulation(one_world: World) -> Iterator[Simulation]:
    """The car on the empty plane, in autonomous mode, in real time."""
    one_world.reset(0)
    one_world.set_driving_mode("V1", True)
    with Simulation(one_world) as running:
        yield running


@contextlib.contextmanager
def peer(talk: Callable[[ServerConnection], None], port: int = 0) -> Iterator[int]:
    """A WebSocket server that calls `talk` with each client; its port. An error in `talk` fails the test."""
    errors: list[Exception] = []

    def handle(connection: ServerConnection) -> None:
        try:
            talk(connection)
        except Exception as error:
            if not isinstance(error, ConnectionClosed):
                errors.append(error)

    with serve(handle, "127.0.0.1", port, max_size=None, close_timeout=0.2) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server.socket.getsockname()[1]
        finally:
            server.shutdown()
            thread.join()
    if errors:
        raise errors[0]


class Resets:
    """Sink: how often the time went back."""

    def __init__(self) -> None:
        self.count, self._tick = 0, -1

    def publish(self, frame: Frame) -> None:
        self.count += frame.tick < self._tick
        self._tick = frame.tick


def python_of(stack: str) -> Path:
    """The interpreter of a server's environment, 'legacy' or 'newest'."""
    python = ROOT / f".venv-devkit-{stack}" / "bin" / "python"
    if not python.exists():
        pytest.fail(f"the environment of the {stack} devkit server is missing: run scripts/devkit-servers ({python})")
    return python


@contextlib.contextmanager
def script(stack: str, path: Path, *arguments: object, port: int) -> Iterator[subprocess.Popen[bytes]]:
    """A user's script as a process of its own, when it listens on that port."""
    command = [python_of(stack), path, "--port", port, *arguments]
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: is_listening(port) or process.poll() is not None)
        assert process.poll() is None, f"{path.name} did not start"
        yield process
    finally:
        process.kill()
        process.wait()
