"""A server of a running simulation, and plain clients of it: another WebSocket library, no types of ours."""

from __future__ import annotations

import contextlib
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from websockets.sync.client import ClientConnection, connect

from autodrive.bridge.server import Server
from autodrive.protocol.native import Scene
from autodrive.scenery import Scenery
from autodrive.world import World
from tests.bridge.conftest import PATIENCE

pack = msgspec.msgpack.encode

Message = dict[str, Any]


def unpack(data: bytes | str) -> Message:
    assert isinstance(data, bytes)
    return msgspec.msgpack.decode(data, ext_hook=_values)


def _values(code: int, data: memoryview) -> tuple[Any, ...]:
    kind, size = {1: ("d", 8), 2: ("q", 8), 3: ("f", 4), 4: ("B", 1)}[code]
    return struct.unpack(f"<{len(data) // size}{kind}", data)


def scenery(world: World) -> Scenery:
    """As it is, but for the files: to make them takes seconds on a fresh machine."""
    scene = Scene(
        scenario=world.spec.title,
        title=world.spec.title,
        map=world.spec.map,
        tick=world.tick_duration,
        model="scene/map.glb",
        vehicles={},
        objects={},
        light_table={},
        scene_cameras={},
    )
    return Scenery(scene, {"map.glb": b"a map " * 1000})


class Guest:
    """A client that has said Hello."""

    def __init__(self, socket: ClientConnection, name: str = "guest") -> None:
        self.socket = socket
        self.say("Hello", protocol=1, name=name)
        self._id = 0

    def say(self, type_: str, **fields: Any) -> None:
        self.socket.send(pack({"type": type_, **fields}))

    def hear(self) -> Message:
        return unpack(self.socket.recv(timeout=PATIENCE))

    def until(self, is_it: Callable[[Message], object] | str) -> Message:
        """The first message that is so, or of that type; what comes before is passed over."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            message = self.hear()
            if message["type"] == is_it if isinstance(is_it, str) else is_it(message):
                return message
        raise AssertionError("it never came")

    def begin(self, type_: str, **fields: Any) -> int:
        """Ask for something; the number of its answer."""
        self._id += 1
        self.say("Please", id=self._id, request={"type": type_, **fields})
        return self._id

    def answer(self, id: int) -> Message:
        return self.until(lambda message: message.get("id") == id)

    def ask(self, type_: str, **fields: Any) -> Message:
        """The Done or Fault."""
        return self.answer(self.begin(type_, **fields))

    def fault(self, code: str) -> str:
        """The text of the next Fault, of that code."""
        message = self.until("Fault")
        assert message["code"] == code
        return message["text"]


@contextlib.contextmanager
def guest(server: Server, name: str = "guest", **options: Any) -> Iterator[Guest]:
    with raw(server, **options) as socket:
        yield Guest(socket, name)


@contextlib.contextmanager
def raw(server: Server, *, query: str = "", **options: Any) -> Iterator[ClientConnection]:
    query = query or (f"?token={server.token}" if server.token else "")
    with connect(
        f"ws://{server.address}/ws{query}",
        subprotocols=["autodrive.v1"],  # type: ignore[list-item]
        compression=None,
        close_timeout=1,
        max_size=None,
        **options,
    ) as socket:
        yield socket
