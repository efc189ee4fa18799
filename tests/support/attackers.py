"""Hostile clients of the page server, in a process of their own, which needs nothing of this project.

    python tests/support/attackers.py PORT ROLE=COUNT [ROLE=COUNT ...]

Connects so many clients of each role, prints 'ready', and goes on until its stdin ends. Who is disconnected connects
again. The roles are the functions of `ROLES`; `CROWD` is a mixture of 200 of them.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import hashlib
import itertools
import json
import os
import random
import re
import struct
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import msgspec

pack = msgspec.msgpack.encode

Role = Callable[[int], Awaitable[None]]

PAUSE = 0.05
"""Time before a new connection [s]."""

random_ = random.Random(0)


class Client:
    """A connection with a WebSocket, of bytes that are masked with zeros."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader = reader
        self.writer = writer

    async def say(self, message: dict[str, Any]) -> None:
        await self.write(frame(pack(message)))

    async def write(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def read(self) -> None:
        """Read and drop what comes, until the end."""
        while await self.reader.read(2**18):
            pass


def frame(data: bytes, opcode: int = 2) -> bytes:
    """A frame of a WebSocket."""
    size = bytes([0x80 | len(data)]) if len(data) < 126 else struct.pack("!BH", 0xFE, len(data))
    return bytes([0x80 | opcode]) + size + bytes(4) + data


def request(type_: str, id: int = 1, **fields: Any) -> bytes:
    """The frame of a Request."""
    return frame(pack({"type": "Request", "id": id, "operation": {"type": type_, **fields}}))


@contextlib.asynccontextmanager
async def tcp(port: int) -> AsyncIterator[Client]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=2**16)
    try:
        yield Client(reader, writer)
    finally:
        writer.transport.abort()


@contextlib.asynccontextmanager
async def websocket(port: int) -> AsyncIterator[Client]:
    async with tcp(port) as client:
        key = base64.b64encode(os.urandom(16)).decode()
        await client.write(
            f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        answer = await client.reader.readuntil(b"\r\n\r\n")
        if b" 101 " not in answer:
            raise ConnectionResetError
        yield client


@contextlib.asynccontextmanager
async def introduced(port: int) -> AsyncIterator[Client]:
    """A client after its Hello."""
    async with websocket(port) as client:
        await client.say({"type": "Hello", "protocol": 2, "name": "hostile"})
        yield client


@contextlib.asynccontextmanager
async def reading(port: int) -> AsyncIterator[Client]:
    """A client after its Hello that reads in the background, and is told no Frames."""
    async with introduced(port) as client:
        await client.say({"type": "Subscribe", "frame_rate": 0.0})
        task = asyncio.create_task(client.read())
        try:
            yield client
        finally:
            task.cancel()


# -- silent ----------------------------------------------------------------------------------------------------------


async def mute(port: int) -> None:
    """A connection on which nothing is sent."""
    async with tcp(port) as client:
        await client.read()


async def half(port: int) -> None:
    """Half of a request."""
    async with tcp(port) as client:
        await client.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ")
        await client.read()


async def stranger(port: int) -> None:
    """A WebSocket without a Hello."""
    async with websocket(port) as client:
        await client.read()


async def deaf(port: int) -> None:
    """Subscribes to everything, and never reads."""
    async with introduced(port) as client:
        await client.say({"type": "Subscribe", "frame_rate": None, "scans": True, "picture_rate": 60.0})
        await asyncio.sleep(3600)


async def slow_download(port: int) -> None:
    """Requests files and reads a byte now and then."""
    async with tcp(port) as client:
        await client.write(100 * f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        while await client.reader.read(1):
            await asyncio.sleep(1.0)


# -- loud --------------------------------------------------------------------------------------------------------------


async def viewer(port: int) -> None:
    """Reads each Frame and scan."""
    async with introduced(port) as client:
        await client.say({"type": "Subscribe", "frame_rate": None, "scans": True})
        await client.read()


async def garbage(port: int) -> None:
    """Bytes that are no messages."""
    async with reading(port) as client:
        while True:
            await client.write(b"".join(frame(random_.randbytes(random_.randrange(2000))) for _ in range(10)))


async def texts(port: int) -> None:
    """A text that is not UTF-8."""
    async with introduced(port) as client:
        await client.write(frame(b"\xff", opcode=1))
        await client.read()


async def subscribes(port: int) -> None:
    """Changes its subscription as fast as it can."""
    async with reading(port) as client:
        for number in itertools.count():
            await client.say({"type": "Subscribe", "frame_rate": None, "picture_rate": float(number % 2)})


def floods(data: bytes) -> Role:
    """Sends that as fast as it can, and reads the answers."""

    async def role(port: int) -> None:
        async with reading(port) as client:
            while True:
                await client.write(data)

    return role


FLOODS = {
    "pings": 100 * frame(bytes(125), opcode=9),
    "drives": 100
    * b"".join(
        (
            frame(pack({"type": "Drive", "vehicle": "V1", "command": {"throttle": 1.0}, "source": "script"})),
            frame(pack({"type": "Drive", "vehicle": "V9", "command": {"throttle": 1.0}, "source": "person"})),
            frame(pack({"type": "Release", "vehicle": "V1"})),
        )
    ),
    "refused": b"".join(
        (
            request("LoadScenario", name="../secret"),
            request("Teleport", vehicle="V9", x=0.0, y=0.0),
            request("SetSpeed", factor=-1.0),
            request("Reset", seed=-1),
            request("Step", ticks=1, commands={"V9": {"throttle": 1.0}}),
            request("Hold", vehicle="V9", position=[0.0, 0.0, 1.0]),
            request("ConnectBridge", host="a:b:c", port=1),
            request("SaveScenario"),
            request("Unknown"),
        )
    ),
    "resets": 10 * request("Reset"),
    "loads": 10 * request("LoadScenario", name="plane"),
    "undoes": 10 * request("Undo"),
    "connects_the_bridge": request("ConnectBridge", host="127.0.0.1", port=1) + request("DisconnectBridge"),
}
"""What is sent in each role; 'drives': vehicles that it may not drive; 'refused': and one that changes nothing."""


async def hit_and_run(port: int) -> None:
    """Requests a reset and leaves, again and again."""
    for _ in range(100):
        async with introduced(port) as client:
            await client.write(request("Reset"))
            await asyncio.sleep(0)


async def gets(port: int) -> None:
    """Requests files as fast as it can."""
    async with tcp(port) as client:
        task = asyncio.create_task(client.read())
        try:
            while not task.done():
                await client.write(20 * f"GET /x HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        finally:
            task.cancel()


# -- devkit scripts, which listen at the port --------------------------------------------------------------------------


async def commands(port: int) -> None:
    """A script that commands as fast as it can."""
    await _script(port, {"V1 Throttle": "0", "V1 Steering": "0"})


async def long_commands(port: int) -> None:
    """A script that sends messages of 60 kB with many wrong values as fast as it can."""
    await _script(port, {f"V{number} Throttle": "x" for number in range(2, 2500)})


async def orders(port: int) -> None:
    """A script that drives, resets and moves the car as fast as it can."""
    pose = {f"V1 {key}": "1" for key in ("PosX", "PosY", "PosZ", "RotX", "RotY", "RotZ", "RotW")}
    pressed = {"V1 Throttle": "1", "V1 Steering": "1", "V1 Reset": "True", "V2 Throttle": "x", "V1 CoSim": "True"}
    await _script(port, pressed | pose, {"V1 Reset": "False", "V1 CoSim": "False"})


async def _script(port: int, *values: dict[str, str]) -> None:
    flood = b""
    for each in values:
        message = b"42" + json.dumps(["Bridge", each]).encode()
        size = bytes([len(message)]) if len(message) < 126 else b"\x7e" + len(message).to_bytes(2, "big")
        flood += b"\x81" + size + message
    flood *= max(2**16 // len(flood), 1)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):
            head = await reader.readuntil(b"\r\n\r\n")
            key = re.findall(rb"(?i)sec-websocket-key: (\S+)", head)[0]
            accept = base64.b64encode(hashlib.sha1(key + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
            start = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            writer.write(start + b"Sec-WebSocket-Accept: " + accept + b"\r\n\r\n")
            task = asyncio.create_task(Client(reader, writer).read())
            while not task.done():
                writer.write(flood)
                await writer.drain()

    async with await asyncio.start_server(serve, "127.0.0.1", port) as server:
        await server.serve_forever()


SINGLE = (mute, half, stranger, deaf, slow_download, viewer, garbage, texts, subscribes, hit_and_run, gets)
SCRIPTS = (commands, long_commands, orders)
ROLES = {role.__name__: role for role in (*SINGLE, *SCRIPTS)} | {name: floods(data) for name, data in FLOODS.items()}

POWERLESS = {
    "mute": 35,
    "half": 25,
    "stranger": 20,
    "deaf": 10,
    "slow_download": 10,
    "viewer": 30,
    "pings": 10,
    "garbage": 10,
    "texts": 5,
    "drives": 10,
    "refused": 10,
    "gets": 25,
}
"""200 connections, of which half are silent; none of them may influence a run in which time goes on."""

CROWD = {**POWERLESS, "viewer": 20, "subscribes": 5, "resets": 5}
"""200 connections, of which half are silent; some may reset."""


async def again_and_again(role: Role, port: int, has_begun: asyncio.Event) -> None:
    while True:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            asyncio.get_running_loop().call_later(0.5, has_begun.set)
            await role(port)
        await asyncio.sleep(PAUSE)


async def attack(port: int, counts: dict[str, int]) -> None:
    begun = []
    tasks = []
    for name, count in counts.items():
        for _ in range(count):
            begun.append(asyncio.Event())
            tasks.append(asyncio.create_task(again_and_again(ROLES[name], port, begun[-1])))
    for event in begun:
        await event.wait()
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    os._exit(0)


def counts_of(words: list[str]) -> dict[str, int]:
    return {name: int(count) for name, _, count in (word.partition("=") for word in words)}


if __name__ == "__main__":
    asyncio.run(attack(int(sys.argv[1]), counts_of(sys.argv[2:])))
