"""Plain clients of a server: another WebSocket library, and no types of this project."""

from __future__ import annotations

import contextlib
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.native import Scene
from autodrive.world import World
from autodrive.world.views.scene_files import SceneFiles
from tests.support.waiting import LIMIT, wait_until

pack = msgspec.msgpack.encode

Message = dict[str, Any]


def unpack(data: bytes | str) -> Message:
    assert isinstance(data, bytes)
    return msgspec.msgpack.decode(data, ext_hook=_values)


def _values(code: int, data: memoryview) -> tuple[Any, ...]:
    kind, size = {1: ("d", 8), 2: ("q", 8), 3: ("f", 4), 4: ("B", 1)}[code]
    return struct.unpack(f"<{len(data) // size}{kind}", data)


def scene_files(world: World) -> SceneFiles:
    """The scene of the world with a short file instead of its meshes, which take seconds to make on a new machine."""
    scene = Scene(
        scenario=world.spec.title,
        title=world.spec.title,
        map=world.spec.map_name,
        tick=world.tick_duration,
        model="scene/map.glb",
        vehicles={},
        objects={},
        light_table={},
        scene_cameras={},
    )
    return SceneFiles(scene, {"map.glb": b"a map " * 1000})


class NativeClient:
    """A client that sends a Hello when it is created."""

    def __init__(self, socket: ClientConnection, name: str = "client") -> None:
        self.socket = socket
        self.send("Hello", protocol=2, name=name)
        self._id = 0

    def send(self, type_: str, **fields: Any) -> None:
        self.socket.send(pack({"type": type_, **fields}))

    def receive(self) -> Message:
        return unpack(self.socket.recv(timeout=LIMIT))

    def until(self, wanted: Callable[[Message], object] | str) -> Message:
        """The next message of that type, or for which the function is true; earlier messages are dropped."""
        deadline = time.monotonic() + LIMIT
        while time.monotonic() < deadline:
            message = self.receive()
            if message["type"] == wanted if isinstance(wanted, str) else wanted(message):
                return message
        raise AssertionError("no such message")

    def begin(self, type_: str, **fields: Any) -> int:
        """Send a Request; returns its id."""
        self._id += 1
        self.send("Request", id=self._id, operation={"type": type_, **fields})
        return self._id

    def answer(self, id: int) -> Message:
        return self.until(lambda message: message.get("id") == id)

    def ask(self, type_: str, **fields: Any) -> Message:
        """Send a Request; returns its Response or Error."""
        return self.answer(self.begin(type_, **fields))

    def error(self, code: str) -> str:
        """The text of the next Error, of that code."""
        message = self.until("Error")
        assert message["code"] == code
        return message["text"]


@contextlib.contextmanager
def native_client(server: SimulationServer, name: str = "client", **options: Any) -> Iterator[NativeClient]:
    with raw(server, **options) as socket:
        yield NativeClient(socket, name)


@contextlib.contextmanager
def connected(port: int) -> Iterator[NativeClient]:
    """A client of a server in another process; where it is refused, it tries again."""
    with contextlib.ExitStack() as stack:

        def welcomed() -> NativeClient | None:
            with contextlib.suppress(OSError, WebSocketException):
                address = f"ws://127.0.0.1:{port}/ws"
                socket = connect(address, compression=None, max_size=None, close_timeout=1, ping_interval=None)
                client = NativeClient(stack.enter_context(socket))
                client.until("Welcome")
                return client
            return None

        client = wait_until(welcomed)
        assert client is not None
        yield client


@contextlib.contextmanager
def raw(server: SimulationServer, *, query: str = "", **options: Any) -> Iterator[ClientConnection]:
    query = query or (f"?token={server.token}" if server.token else "")
    with connect(
        f"ws://{server.address}/ws{query}",
        subprotocols=["autodrive.v2"],  # type: ignore[list-item]
        compression=None,
        close_timeout=1,
        max_size=None,
        **options,
    ) as socket:
        yield socket
