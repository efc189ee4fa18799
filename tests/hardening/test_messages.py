"""Mutated messages of devkit scripts and native clients: each is used, answered or dropped, and nothing else happens.

The mutations know the structure of the messages: they change, remove, double and exchange values, and also bytes.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
import random
import time
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import autodrive
from autodrive import AutodriveError, Simulation
from autodrive.base.png import encode_png
from autodrive.connect.bridge.detection import Detection
from autodrive.connect.bridge.engineio import ConnectionEnd, EngineIoConnection, PacketError
from autodrive.connect.bridge.metrics import Metrics
from autodrive.connect.bridge.session import Session
from autodrive.connect.server.hub import Hub
from autodrive.connect.server.served import Served
from autodrive.protocol.devkit_profile import DevkitSettings
from autodrive.protocol.messages import Command, Operation
from autodrive.protocol.native import RunOrigin, Source
from autodrive.run.own_files import UserFiles
from autodrive.world import World
from autodrive.world.simulation.paced import Execution
from tests.support.hardening import cases, memory
from tests.support.native_clients import pack, scene_files

EXTREMES = (
    *(None, True, "", "x" * 300, "nan", "1e999", "-0", "null", "V1", "V9", "\0", "\u00e4\U0001f697", b"\xff"),
    *([], {}, [[[]]]),
    *(0, -1, 1, 255, 2**31, 2**63 - 1, -(2**63), 2**64 - 1, 0.0, -0.0, 1e-300, 1e300, math.inf, -math.inf, math.nan),
)


def mutated(value: Any, random_: random.Random, *, chance: float = 0.25) -> Any:
    """A copy with some parts changed, removed, doubled or exchanged."""
    if random_.random() < 0.1 * chance:
        return random_.choice(EXTREMES)
    if isinstance(value, dict):
        items = [(key, mutated(item, random_, chance=chance)) for key, item in value.items()]
        if items and random_.random() < chance:
            items.pop(random_.randrange(len(items)))
        if items and random_.random() < chance:
            number = random_.randrange(len(items))
            items[number] = items[number][0], random_.choice(EXTREMES)
        if random_.random() < 0.3 * chance:
            items.append((random_.choice(["", "type", "V1 Reset", "x" * 50]), random_.choice(EXTREMES)))
        return dict(items)
    if isinstance(value, list):
        return [mutated(item, random_, chance=chance) for item in value] * random_.choice([1, 1, 1, 0, 2])
    return random_.choice(EXTREMES) if random_.random() < 0.3 * chance else value


def with_wrong_bytes(data: bytes, random_: random.Random) -> bytes:
    """A copy with some bytes changed, removed, doubled, or cut off."""
    changed = bytearray(data)
    for _ in range(random_.randint(1, 4)):
        place = random_.randrange(len(changed) + 1)
        match random_.randrange(4):
            case 0 if place < len(changed):
                changed[place] = random_.randrange(256)
            case 1:
                del changed[place : place + random_.randint(1, 8)]
            case 2:
                changed[place:place] = changed[place : place + random_.randint(1, 8)]
            case _ if random_.random() < 0.2:
                del changed[place:]
    return bytes(changed)


# -- devkit scripts ------------------------------------------------------------------------------------------------

COMMANDS: dict[str, Any] = {
    **{f"V{n} {key}": "0.5" for n in (1, 2) for key in ("Throttle", "Steering", "Headlights", "Indicators")},
    **{f"V1 {key}": 0.5 for key in ("PosX", "PosY", "PosZ", "RotX", "RotY", "RotZ", "RotW")},
    "V1 CoSim": "True",
    "V1 Reset": "False",
    "Throttle": "1",
    "Steering": "-1",
    "TL1 State": "2",
    "Auto Time": "False",
    "Time": "720",
    "Time Scale": "60",
    "Weather": "3",
    "Fog": "0.5",
}

PACKETS: tuple[Any, ...] = (
    ("0", {"sid": "x", "upgrades": [], "pingTimeout": 20000, "pingInterval": 25000, "maxPayload": 1000000}),
    ("40", {"sid": "y"}),
    ("2", "probe"),
    ("42", ["Bridge", COMMANDS]),
    ("4217", ["Bridge", COMMANDS]),
    ("4317", []),
    ("44", {"message": "refused"}),
    ("41", ""),
    ("1", ""),
)


class Waiting(Simulation):
    """Keeps the latest commands, and counts the requests that it accepts."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self.commands: dict[str, Command] = {}
        self.request_count = 0

    def submit(self, vehicle: str, command: Command, source: Source = "script") -> None:
        super().submit(vehicle, command, source)
        self.commands[vehicle] = command

    def request(self, request: Operation, *, here: bool = False) -> Execution:
        done = super().request(request, here=here)
        self.request_count += 1
        return done


@pytest.mark.parametrize("dialect", ["engineio-4", "engineio-3", "raw"])
def test_mutated_packets_of_a_devkit_script(one_world: World, dialect: Any) -> None:
    one_world.reset(0)
    simulation = Waiting(one_world)  # not started: what is requested waits, once a Frame at most
    random_ = random.Random(dialect)
    outcomes = Counter[str]()

    def session() -> tuple[Session, EngineIoConnection]:
        settings = DevkitSettings(handshake=dialect)
        detection = Detection(settings)
        made = Session(
            None,  # type: ignore[arg-type]  # nothing is sent
            simulation,
            Metrics(),
            detection=detection,
            traffic_lights={},
            clock=lambda: 0.0,
        )
        for text in [] if dialect == "raw" else ['0{"sid":"x"}', "40" if dialect == "engineio-3" else '40{"sid":"y"}']:
            made.engineio.receive(text, 0.0)
        return made, made.engineio

    talk, connection = session()
    for _ in range(cases(1500, 333_334)):
        head, content = random_.choices(PACKETS, [1, 1, 1, 8, 4, 1, 1, 1, 1])[0]
        packet = head + json.dumps(mutated(content, random_, chance=0.3), default=repr) if content else head
        if random_.random() < 0.3:
            packet = with_wrong_bytes(packet.encode(), random_).decode(errors="replace")
        try:
            talk.process(packet)
            outcomes["used"] += 1
        except PacketError:
            outcomes["refused"] += 1
        except ConnectionEnd:
            outcomes["ended"] += 1
            talk, connection = session()
        if len(connection.outbox) > 500:
            connection.outbox.clear()
    assert min(outcomes[name] for name in ("used", "refused", "ended")) > 50
    commands = simulation.commands
    assert all(-1.0 <= command.throttle <= 1.0 and -1.0 <= command.steering <= 1.0 for command in commands.values())
    assert simulation.request_count <= 3 * (outcomes["ended"] + 1)  # one of each kind, for the one Frame, in a session
    for _ in range(100):
        one_world.step(commands)


# -- native clients ------------------------------------------------------------------------------------------------

COMMAND = {"throttle": 0.3, "steering": -0.1, "headlights": 1, "indicators": 2}

RING = encode_png(np.kron(np.pad([[0, 0], [0, 0]], 1, constant_values=254), np.ones((12, 12))).astype(np.uint8))
"""The picture of a track: 48 x 48 pixels, white around a black square."""
RING_SHEET = "image: ring.png\nresolution: 0.1\norigin: [-2.4, -2.4, 0]"

OPERATIONS: tuple[dict[str, Any], ...] = (
    {"type": "Reset", "seed": 3},
    {"type": "Step", "ticks": 2, "commands": {"V1": COMMAND}},
    {"type": "SetSpeed", "factor": 1.0},
    {"type": "Teleport", "vehicle": "V1", "x": 0.5, "y": 0.5, "yaw": 1.0},
    {"type": "Hold", "vehicle": "V1", "position": [0.0, 0.0, 0.1], "orientation": [1.0, 0.0, 0.0, 0.0]},
    {"type": "SetSceneLight", "enabled": False},
    {"type": "SetTimeOfDay", "time": 3600.0, "scale": 60.0},
    {"type": "SetWeather", "weather": {"rain": 0.5, "wetness": None}},
    {"type": "Draw", "drawings": {"a": {"kind": "path", "points": [[0.0, 0.0, 0.1], [1.0, 0.0, 0.1]]}, "b": None}},
    {"type": "SetTrafficLight", "light": "traffic_light_1", "state": 3},
    {"type": "SetDrivingMode", "vehicle": "V1", "is_autonomous": True},
    {"type": "LoadScenario", "name": "plane"},
    {"type": "Place", "name": "V1", "x": 0.3, "y": 0.3, "yaw": 0.0},
    {"type": "AddBox", "name": "box_7", "x": 1.0, "y": 1.0, "yaw": 0.0, "size": [0.1, 0.1, 0.1], "mass": 0.1},
    {"type": "SetSensor", "vehicle": "V1", "sensor": "lidar", "is_on": True, "rate": 5.0, "noise": "ideal"},
    {
        "type": "EditMap",
        "parts": {
            "block": {"type": "MapBlock", "x": 4.0, "y": 4.0, "length": 0.5, "width": 0.5, "height": 0.2, "yaw": 1.0},
            "sign": {"type": "MapProp", "kind": "stop", "x": 5.0, "y": 4.0, "yaw": 1.0},
            "road": None,
        },
        "seen": {"block": None},
    },
    {"type": "RemoveTraffic"},
    {"type": "InsertModule", "module": "straight_road", "part": "road", "port": "west"},
    {"type": "CloseLoop", "part": "road", "port": "west", "other": "road", "other_port": "north"},
    {"type": "UseMap", "text": "title: x\nplacements: [{module: lawn, x: 0, y: 0}]"},
    {
        "type": "EditTrack",
        "track": {"points": [[0.0, 0.0], [9.0, 0.0], [9.0, 5.0]]},
        "seen": {"points": [[0.0, 0.0], [9.0, 0.0], [9.0, 5.0]], "width": 1.0, "barrier": "duct"},
    },
    {"type": "GenerateTrack", "seed": 1, "length": 20.0, "width": 1.0, "barrier": "duct"},
    {"type": "ImportTrack", "picture": RING, "text": RING_SHEET, "start": [25.0, 5.0], "gap": 0.1, "is_reversed": True},
    {"type": "OpenFile", "name": "sent.yaml", "text": "title: x\nmap: plane\nvehicles: {V1: {type: nigel}}\n"},
    {"type": "OpenFile", "name": "sent.yaml", "text": "width: 1.2\npoints: [0 0, 9 0, 9 5, 0 5]"},
    {"type": "SaveFile", "name": "mine", "kind": "map", "title": "x", "replaces": True},
    {"type": "ExportMap", "name": "mine", "resolution": 0.2},
    {"type": "Undo"},
    {"type": "SaveScenario"},
    {"type": "ConnectBridge", "host": "127.0.0.1", "port": 4567},
    {"type": "SetCamera", "camera": None},
)

MESSAGES: tuple[dict[str, Any], ...] = (
    {"type": "Hello", "protocol": 2, "name": "x"},
    {"type": "Subscribe", "frame_rate": 30.0, "scans": True, "picture_rate": 0.0, "picture_width": 64},
    {"type": "Drive", "vehicle": "V1", "command": COMMAND, "source": "script"},
    {"type": "Release", "vehicle": "V1"},
    *({"type": "Request", "id": 1, "operation": operation} for operation in OPERATIONS),
)


def hostile_message(random_: random.Random) -> bytes:
    """A mutated message in MessagePack."""
    message = mutated(random_.choice(MESSAGES), random_, chance=0.2)
    try:
        data = pack(message)
    except (OverflowError, TypeError, msgspec.EncodeError):  # such a value has no form in MessagePack
        data = pack({"type": "Request"})
    return with_wrong_bytes(data, random_) if random_.random() < 0.3 else data


class Peer:
    """The ASGI side of a client in this process: no sockets, so that many messages take little time."""

    def __init__(self, messages: list[bytes]) -> None:
        self.sent: list[dict[str, Any]] = []
        self._messages = iter(messages)

    async def receive(self) -> dict[str, Any]:
        await asyncio.sleep(0)
        data = next(self._messages, None)
        return {"type": "websocket.disconnect"} if data is None else {"type": "websocket.receive", "bytes": data}

    async def send(self, event: dict[str, Any]) -> None:
        self.sent.append(event)


def no_renderer(_: World) -> Any:
    raise AutodriveError("no scene cameras here")


def test_mutated_messages_of_native_clients(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("autodrive.connect.server.rate_limit.RATE", 1e9)
    monkeypatch.setattr("autodrive.connect.server.rate_limit.BYTES", 1e12)
    simulation = Simulation(autodrive.make("plane"), load=autodrive.make, pause_on_error=True)
    hello = pack({"type": "Hello", "protocol": 2, "name": "x"})
    random_ = random.Random(7)
    errors: list[str] = []
    clients, at_start, begin = cases(30, 2000), list[float](), time.monotonic()

    async def attack() -> None:
        served = Served(
            simulation,
            scene_files,
            scenarios={"plane": "Plane"},
            renderer_factory=no_renderer,
            own_files=UserFiles(tmp_path / "own"),
        )
        hub = Hub(served, RunOrigin("0", "user", 0.0))
        scope = {"subprotocols": ["autodrive.v2"]}
        async with hub:
            for number in range(clients):
                if number == clients // 5:
                    at_start.append(memory())
                peer = Peer([hello, *(hostile_message(random_) for _ in range(cases(100, 500)))])
                await asyncio.wait_for(hub.serve(scope, peer.receive, peer.send), 600.0)
                assert hub.client_count == 0
            other = Peer([hello, pack({"type": "Request", "id": 1, "operation": {"type": "Reset"}})])

            async def receive() -> dict[str, Any]:  # stays until it has its answer
                while (event := await other.receive())["type"] == "websocket.disconnect":
                    if any(b"Response" in event.get("bytes", b"") for event in other.sent):
                        break
                    await asyncio.sleep(0.01)
                return event

            await asyncio.wait_for(hub.serve(scope, receive, other.send), 600.0)
            messages = [event.get("bytes", b"") for event in other.sent]
            errors.extend(repr(message) for message in messages if b"Error" in message)

    with simulation:
        asyncio.run(attack())
    end = memory()
    print(f"{clients} clients in {time.monotonic() - begin:.0f} s; memory {at_start[0]:.1f} MB, then {end:.1f} MB")
    assert not errors
    assert not simulation.error
    assert [path.name for path in tmp_path.iterdir()] == ["own"]
    assert all(path.suffix == ".yaml" and path.is_file() for path in (tmp_path / "own").iterdir())
    assert not [record for record in caplog.records if record.exc_info or record.levelno >= logging.ERROR]
    if cases(short=False, long=True):
        assert end < 1.05 * at_start[0]
