"""Hostile clients of the server: others are not slowed, memory stays bounded, and each request gets an answer."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from websockets.exceptions import ConnectionClosed, InvalidStatus

import autodrive
from autodrive import AutodriveError, Command, Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.server import connections, hub
from autodrive.connect.server.bridge_control import BridgeControl
from autodrive.connect.server.connections import HttpProtocol
from autodrive.connect.server.frame_queue import FrameQueue, FrameUpdate
from autodrive.connect.server.requests import Requests
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import AddBox, Collision, Frame, SetSpeed
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.factory import new_world
from autodrive.world.observer import Request
from autodrive.world.views.scene_files import SceneFiles
from tests.support.attackers import frame
from tests.support.native_clients import native_client, pack, raw, scene_files
from tests.support.waiting import LIMIT, free_port, wait_until

HUGE = 1e300


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(autodrive.make("plane"), load=autodrive.make)


@contextlib.contextmanager
def served(
    simulation: Simulation,
    files: Callable[[World], SceneFiles] = scene_files,
    scenarios: tuple[str, ...] = ("plane",),
) -> Iterator[SimulationServer]:
    bridge = DevkitBridge(simulation)
    everything = Served(simulation, files, scenarios={name: name.title() for name in scenarios}, bridge=bridge)
    with SimulationServer(everything, PageOptions(port=free_port())) as server:
        yield server
    bridge.close()


@pytest.fixture(scope="module")
def server(simulation: Simulation) -> Iterator[SimulationServer]:
    with simulation, served(simulation) as server:
        yield server


def connection(server: SimulationServer) -> socket.socket:
    """A plain connection."""
    return socket.create_connection(("127.0.0.1", server.port), LIMIT)


def cut_off(send: Callable[[int], object], most: int = 1000) -> None:
    """Send again and again, at most so many times, until the server ends the connection."""
    with pytest.raises((ConnectionClosed, ConnectionResetError, BrokenPipeError)):  # noqa: PT012  any of them may end it
        for number in range(most):
            send(number)


# -- requests ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("type_", "fields"),
    [
        ("Teleport", {"vehicle": "V" * 60_000, "x": 0.0, "y": 0.0}),
        ("Hold", {"vehicle": "V1", "position": [HUGE, 0.0, 0.0]}),
        ("SetTimeOfDay", {"time": float("inf")}),
        ("SetWeather", {"weather": {"rain": 2.0}}),
        ("Draw", {"drawings": {"a": {"kind": "points", "points": [[HUGE, 0.0, 0.0]]}}}),
        ("Draw", {"drawings": {"a": {"kind": "points", "points": [[0, 0, 0]] * 2001}}}),
        ("Draw", {"drawings": {f"a{number}": None for number in range(2000)}}),
        ("SetTrafficLight", {"light": "L" * 60_000, "state": None}),
        ("AddBox", {"name": "box", "x": 0.5, "y": 0.5, "size": [-1.0, 1.0, 1.0]}),
        ("SetSensor", {"vehicle": "V1", "sensor": "lidar", "rate": HUGE}),
        ("EditMap", {"parts": {"a": {"type": "MapModule", "module": "lawn", "x": HUGE, "y": 0.0}}}),
        ("EditMap", {"parts": {"a": {"type": "MapModule", "module": "/etc/hosts.yaml", "x": 0.0, "y": 0.0}}}),
        ("EditMap", {"parts": {"a": {"type": "MapModule", "module": "x" * 60_000, "x": 0.0, "y": 0.0}}}),
        ("EditMap", {"parts": {"a": {"type": "MapWall", "points": [[0.0, 1.0]] * 3000, "height": 0.1}}}),
        ("EditMap", {"parts": {f"a{number}": None for number in range(2000)}}),
        ("EditMap", {"parts": {"a": None}, "seen": {"a": {"type": "MapProp", "kind": "?", "x": 0, "y": 0, "yaw": 0}}}),
        ("UseMap", {"name": "../maps/plane"}),
        ("UseMap", {"text": "title: [" * 5000}),
        ("UseMap", {"text": "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]\n" * 9}),
        ("UseMap", {"text": "width: 1\npoints: [0 0, 9 0, 9 5]\ncentre_line: [0 0 1 1, 1 0 1 1, 1 1 1 1, 0 1 1 1]"}),
        ("EditTrack", {"track": {"points": [[0.0, 0.0], [HUGE, 0.0], [0.0, HUGE]]}}),
        ("EditTrack", {"track": {"points": [[0.0, float(number)] for number in range(201)]}}),
        ("EditTrack", {"track": {"points": [[0.0, 0.0]] * 100}}),
        ("GenerateTrack", {"length": HUGE}),
        ("SaveMap", {"title": "x" * 60_000}),
        ("LoadScenario", {"name": "x" * 60_000}),
        ("LoadScenario", {"name": "../plane"}),
        ("Step", {"ticks": 10**9}),
        ("SetCamera", {"camera": "Orbit", "zoom": float("nan")}),
        ("ConnectBridge", {"host": "a:b:c", "port": 4567}),
        ("ConnectBridge", {"host": "a\0b", "port": 4567}),
        ("ConnectBridge", {"host": "a\r\nHost: b", "port": 4567}),
        ("ConnectBridge", {"host": "x" * 300, "port": 4567}),
        ("ConnectBridge", {"host": "127.0.0.1", "port": 65536}),
        ("Unknown", {}),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_request_out_of_range_is_refused_with_its_id(
    server: SimulationServer, simulation: Simulation, type_: str, fields: dict[str, Any]
) -> None:
    with native_client(server) as client:
        answer = client.ask(type_, **fields)
        assert answer["type"] == "Error"
        assert answer["code"] == "request"
        assert len(answer["text"]) < 500
        assert client.ask("Resume")["type"] == "Response"
    assert not simulation.error


def test_a_flood_of_resets_is_answered_with_few_resets(
    server: SimulationServer, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    seeds = []
    begin = World.begin
    monkeypatch.setattr(World, "begin", lambda world, seed, *start: (seeds.append(seed), begin(world, seed, *start))[1])
    with native_client(server) as client:
        ids = [client.begin("Reset", seed=seed) for seed in range(60)]
        answered = {client.answer(id)["id"] for id in ids}
    assert answered == set(ids)
    assert len(seeds) <= 10
    assert seeds[-1] == 59


def test_requests_use_at_most_a_fifth_of_the_time(server: SimulationServer, monkeypatch: pytest.MonkeyPatch) -> None:
    spans = []
    apply = World.apply

    def timed(world: World, request: Request) -> Frame:
        start = time.perf_counter()
        frame = apply(world, request)
        spans.append((start, time.perf_counter()))
        return frame

    monkeypatch.setattr(World, "apply", timed)
    with native_client(server) as client:
        for _ in range(8):
            client.ask("Reset")
    assert len(spans) == 8
    for (start, end), (following, _) in pairwise(spans):
        assert following - end > 3.9 * (end - start)  # the load of the machine makes the left side longer only


def test_the_simulation_gets_one_request_of_all_clients_at_a_time(
    server: SimulationServer, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise clients that connect, request and leave, again and again, would let no time for ticks."""
    is_free, begun, received, posted = threading.Event(), threading.Event(), [], []
    apply, execute, request = World.apply, Requests.execute, Simulation.request

    def waiting(world: World, request: Request) -> Frame:
        begun.set()
        assert is_free.wait(LIMIT)
        return apply(world, request)

    monkeypatch.setattr(World, "apply", waiting)
    monkeypatch.setattr(Requests, "execute", lambda *words: (received.append(1), execute(*words))[1])
    monkeypatch.setattr(
        Simulation, "request", lambda *words, **options: (posted.append(1), request(*words, **options))[1]
    )
    with contextlib.ExitStack() as stack:
        for _ in range(20):
            stack.enter_context(native_client(server)).begin("Reset")
        assert begun.wait(LIMIT)
        wait_until(lambda: len(received) == 20)
        assert len(posted) == 1, "the one that is executed; no other one waits"
        is_free.set()


class Order:
    """Observer: the operations in the order of their execution; the first one ends when `is_free`."""

    def __init__(self) -> None:
        self.is_free = threading.Event()
        self.executed_types: list[str] = []

    def publish(self, frame: Frame) -> None:
        pass

    def given(self, commands: Mapping[str, Command]) -> None:
        pass

    def executed(self, request: Request) -> None:
        self.executed_types.append(type(request).__name__)
        assert self.is_free.wait(LIMIT)


def test_a_client_does_not_wait_for_forty_others_who_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a pause, in which nothing is limited, so that only the order counts."""
    received, execute = [], Requests.execute
    monkeypatch.setattr(Requests, "execute", lambda *words: (received.append(1), execute(*words))[1])
    order = Order()
    scenario = ScenarioSpec(vehicles={"V1": VehiclePlacement()}, boxes={"a": BoxSpec(x=3.0, y=3.0)})
    simulation = Simulation(autodrive.make(scenario), load=new_world, is_paused=True)
    simulation.add_observer(order)
    with simulation, served(simulation) as server, contextlib.ExitStack() as stack:
        builders = [stack.enter_context(native_client(server)) for _ in range(40)]
        client = stack.enter_context(native_client(server))
        for number, builder in enumerate(builders):
            block = {"type": "MapBlock", "x": 9.0, "y": 0.5 * number, "length": 0.3, "width": 0.3, "height": 0.2}
            builder.send("Subscribe", frame_rate=0.0)
            builder.begin("EditMap", parts={f"block_{number}": block})
        wait_until(lambda: len(received) == 40)
        ids = [
            client.begin("Teleport", vehicle="V1", x=1.0, y=0.0),
            client.begin("SetWeather", weather={"rain": 0.5}),
            client.begin("RemoveBox", name="a"),
        ]
        wait_until(lambda: len(received) == 43)
        order.is_free.set()
        assert [client.answer(id)["type"] for id in ids] == 3 * ["Response"]
        builds_before = order.executed_types.index("RemoveBox") - 2
        assert builds_before < 8, order.executed_types  # one for each answer, and few that begin meanwhile
    assert order.executed_types.index("Teleport") < order.executed_types.index("SetWeather")


def test_the_next_request_does_not_wait_until_a_weather_is_described(
    server: SimulationServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_free = threading.Event()
    numbers = "autodrive.world.views.weather_numbers.weather_numbers"
    monkeypatch.setattr(numbers, lambda *_, **__: str(is_free.wait(LIMIT)))
    with native_client(server) as client:
        description = client.begin("DescribeWeather")
        assert client.ask("SetWeather", weather={"rain": 0.5})["type"] == "Response"
        is_free.set()
        assert client.answer(description)["text"] == "True"


@pytest.mark.parametrize("part", ["world", "scene"])
@pytest.mark.parametrize("scenario", ["mini_map", "tiny_town"])
def test_frames_go_on_while_scenarios_are_loaded_and_the_newest_request_answers_all(
    scenario: str, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_free, loads, received = threading.Event(), [], []
    scenarios = ("plane", "two_cars", "mini_map", "tiny_town")
    execute = Requests.execute
    monkeypatch.setattr(Requests, "execute", lambda *words: (received.append(words[2].operation), execute(*words))[1])

    def load(name: Any) -> World:
        loads.append(name)
        assert part == "scene" or is_free.wait(LIMIT)
        return autodrive.make(name)

    def files(world: World) -> SceneFiles:
        assert part == "world" or not loads or is_free.wait(LIMIT)
        return scene_files(world)

    simulation = Simulation(autodrive.make(scenario), load=load)
    with simulation, served(simulation, files, scenarios) as server, contextlib.ExitStack() as stack:
        viewer, *flood = (stack.enter_context(native_client(server)) for _ in range(6))
        viewer.until("Frame")
        ids = [flood[0].begin("LoadScenario", name=scenario)]
        wait_until(lambda: loads)
        ids += [client.begin("LoadScenario", name=name) for client, name in zip(flood[1:], scenarios, strict=True)]
        wait_until(lambda: len(received) == 5)
        first = viewer.until("Frame")["tick"]
        viewer.until(lambda message: message["type"] == "Frame" and message["tick"] >= first + 100)
        is_free.set()
        for client, id in zip(flood, ids, strict=True):
            assert client.answer(id)["type"] == "Response"
    assert loads == [scenario, received[-1].name]
    assert simulation.world.spec.map == {"two_cars": "plane"}.get(loads[-1], loads[-1])


def test_frames_go_on_while_the_mesh_of_a_new_box_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    is_free, begun = threading.Event(), threading.Event()
    monkeypatch.setattr("autodrive.world.views.scene_files.box_file", lambda _: (begun.set(), is_free.wait(LIMIT)))
    simulation = Simulation(autodrive.make("plane"), load=autodrive.make)
    with simulation, served(simulation) as server, native_client(server) as viewer, native_client(server) as editing:
        assert (
            "boxes.b.size 1: must be at least" in editing.ask("AddBox", name="b", x=1.0, y=0.0, size=[0, 1, 1])["text"]
        )
        id = editing.begin("AddBox", name="b", x=1.0, y=0.0)
        assert begun.wait(LIMIT)
        first = viewer.until("Frame")["tick"]
        viewer.until(lambda message: message["type"] == "Frame" and message["tick"] >= first + 100)
        is_free.set()
        assert "b" in editing.answer(id)["frame"]["objects"]


def test_a_world_that_is_edited_again_while_its_scene_is_loaded_is_seen() -> None:
    """Otherwise a program that edits without a pause would leave the viewers of the page without a Frame."""
    edits = 5

    def files(world: World) -> SceneFiles:
        if len(world.boxes) < edits:
            name = f"box_{len(world.boxes)}"
            simulation.request(AddBox(name, 1.0, 0.5 * len(world.boxes))).result(LIMIT)
        return scene_files(world)

    simulation = Simulation(autodrive.make("plane"), is_paused=True, load=autodrive.make)
    with simulation, served(simulation, files) as server, native_client(server) as viewer:
        seen = {len(viewer.until("Frame")["objects"])}
        while max(seen) < edits:
            seen.add(len(viewer.until("Frame")["objects"]))
    assert len(seen) > 2, f"of the {edits + 1} worlds, only those with {seen} boxes were seen"


def test_a_response_while_a_scene_is_loaded_has_no_frame_of_its_world_which_then_comes() -> None:
    """Otherwise a page that is opened after an edit in a pause shows nothing."""
    is_free, begun = threading.Event(), threading.Event()

    def files(world: World) -> SceneFiles:
        if world.boxes:
            begun.set()
            assert is_free.wait(LIMIT)
        return scene_files(world)

    simulation = Simulation(autodrive.make("plane"), is_paused=True, load=autodrive.make)
    with simulation, served(simulation, files) as server, native_client(server) as viewer:
        viewer.until("Frame")
        simulation.request(AddBox("b", 1.0, 0.0)).result(LIMIT)
        assert begun.wait(LIMIT)
        response = viewer.ask("DisconnectBridge")
        is_free.set()
        viewer.until("Scene")
        assert "b" in viewer.until("Frame")["objects"]
    assert "b" not in response["frame"]["objects"]


def test_many_refused_requests_end_the_connection(server: SimulationServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.connect.server.rate_limit.MOST_DROPPED", 100)
    with native_client(server, max_queue=None) as loud:
        cut_off(lambda id: loud.send("Request", id=id, operation={"type": "Undo"}), 100_000)


def test_a_step_of_unknown_vehicles_is_refused_and_gives_no_lease(server: SimulationServer) -> None:
    with native_client(server) as client:
        client.ask("Pause")
        commands = {f"car {number}": {"throttle": 1.0} for number in range(1000)}
        assert client.ask("Step", commands=commands)["code"] == "request"
        client.ask("Resume")
        assert client.until("Status")["drivers"] == {}


def test_a_request_that_fails_inside_is_answered_and_the_next_one_executed(
    server: SimulationServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: object) -> str:
        raise ValueError("inside")

    monkeypatch.setattr("autodrive.world.simulation.paced.scenario_text", fail)
    with native_client(server) as client:
        assert client.ask("SaveScenario")["text"] == "inside"
        assert client.ask("Resume")["type"] == "Response"


def test_changes_cause_a_status_only_now_and_then(server: SimulationServer) -> None:
    with native_client(server) as client, native_client(server, max_queue=None) as other:
        other.send("Subscribe", frame_rate=0.0)
        other.until("Welcome")
        begin = time.monotonic()
        for _ in range(400):
            client.send("Drive", vehicle="V1", command={}, source="person")
            client.send("Release", vehicle="V1")
            time.sleep(0.001)
        client.ask("Resume")
        count = 0
        other.begin("Resume")
        while (message := other.receive())["type"] != "Response":
            count += message["type"] == "Status"
        assert count < (time.monotonic() - begin) * (1 / hub.LEAST_STATUS_INTERVAL + 1 / hub.STATUS_INTERVAL) + 3


def test_a_client_that_reads_no_replies_is_disconnected(server: SimulationServer) -> None:
    small = socket.socket()
    small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # what is not read soon fills it
    small.connect(("127.0.0.1", server.port))
    with native_client(server, sock=small, max_queue=1) as lazy:
        lazy.send("Subscribe", frame_rate=0.0)
        lazy.ask("Pause")
        cut_off(lambda id: lazy.send("Request", id=id, operation={"type": "Undo"}), 200_000)
    with native_client(server) as other:
        assert other.ask("Resume")["type"] == "Response"


def test_requests_of_a_client_that_left_are_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loads: list[Any] = []
    simulation = Simulation(autodrive.make("plane"), load=lambda name: (loads.append(name), autodrive.make(name))[1])
    with simulation, served(simulation) as server:
        with native_client(server) as client:
            for _ in range(30):
                client.begin("LoadScenario", name="plane")
                client.begin("Undo")
        with native_client(server) as other:
            other.ask("Resume")
            other.ask("Resume")
    assert len(loads) <= 3


def test_a_client_above_the_byte_limit_is_disconnected(
    server: SimulationServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("autodrive.connect.server.rate_limit.MOST_DROPPED", 100)
    monkeypatch.setattr(connections, "SHARE", 1.0)  # no long pauses
    with native_client(server) as loud:
        loud.send("Subscribe", frame_rate=0.0)
        cut_off(lambda _: loud.send("Release", vehicle="V" * 60_000), 20_000)


def test_pings_without_reading_end_the_connection(server: SimulationServer) -> None:
    with _websocket(server) as peer:
        ping = bytes([0x89, 0x80 | 125]) + bytes(4) + bytes(125)
        cut_off(lambda _: peer.sendall(200 * ping))


def waits(server: SimulationServer, peer: socket.socket, sent: bytes, answer: bytes, most: int) -> None:
    """Of what the peer has sent at once so many are answered, and then it waits; others do not."""
    peer.sendall(sent)
    answers = b""
    while answers.count(answer) < most - 1:
        answers += peer.recv(65536)
    with native_client(server) as other:
        for _ in range(20):
            assert other.ask("Reset")["type"] == "Response"
    peer.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        answers += peer.recv(65536)
    assert answers.count(answer) <= most


def test_who_sends_more_than_a_piece_waits_and_others_do_not(
    server: SimulationServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "SHARE", 1e-9)  # the pause is longer than the test
    ping = frame(b"", opcode=9)
    pings = connections.PIECE // len(ping)
    with _websocket(server) as peer:
        waits(server, peer, 10 * pings * ping, b"\x8a\0", pings)


def test_who_sends_many_http_requests_waits_and_others_do_not(
    server: SimulationServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "REQUEST_RATE", 1e-6)
    monkeypatch.setattr(connections, "REQUEST_BURST", 3.0)
    with connection(server) as peer:
        waits(server, peer, 100 * b"GET /none HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", b"HTTP/1.1 404", 4)


def _websocket(server: SimulationServer) -> socket.socket:
    """A WebSocket that reads nothing but the answer to its handshake."""
    peer = connection(server)
    peer.sendall(
        b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
    )
    assert b" 101 " in peer.recv(4096)
    return peer


def _deaf_client(server: SimulationServer) -> socket.socket:
    """A client that subscribes to everything and reads nothing."""
    peer = _websocket(server)
    peer.sendall(frame(pack({"type": "Hello", "protocol": 2})))
    peer.sendall(frame(pack({"type": "Subscribe", "frame_rate": None, "scans": True})))
    return peer


def test_clients_that_do_not_read_lock_nobody_out(
    server: SimulationServer, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hub, "MAX_CLIENTS", 3)
    monkeypatch.setattr(hub, "MAX_WAIT", 0.1)
    wait_until(lambda: not server.clients)
    simulation.request(SetSpeed(None)).result(LIMIT)  # the buffers of the system are soon full
    with contextlib.ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(_deaf_client(server))
        wait_until(lambda: server.clients == 3)
        wait_until(lambda: all(server.hub.now() - client.waits_since > 0.1 for client in set(server.hub.clients)))
        with native_client(server) as client:
            assert client.receive()["type"] == "Welcome"
            assert client.until("Frame")
            assert server.clients == 3
    simulation.request(SetSpeed(1.0)).result(LIMIT)


def test_a_client_that_neither_reads_nor_stops_sending_is_cut_off(server: SimulationServer) -> None:
    with _deaf_client(server) as peer:
        undo = frame(pack({"type": "Request", "id": 1, "operation": {"type": "Undo"}}))
        cut_off(lambda _: peer.sendall(undo), 1_000_000)


def test_websockets_without_a_hello_lock_nobody_out(server: SimulationServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MAX_WEBSOCKETS", 3)
    with contextlib.ExitStack() as stack, native_client(server) as client:
        assert client.receive()["type"] == "Welcome"
        for _ in range(5):
            stack.enter_context(_websocket(server))
        with native_client(server) as other:
            assert other.receive()["type"] == "Welcome"
        assert client.until("Frame")


@pytest.mark.parametrize(
    "data",
    [
        frame(pack({"type": "Hello", "protocol": 2})) + frame(b"", opcode=3),
        frame(pack({"type": "Hello", "protocol": 9})) + frame(b"", opcode=3),
        frame(b"", opcode=3),
        frame(b"\xff", opcode=1),
        3 * frame(b"\xff", opcode=1),
        frame(pack({"type": "Hello", "protocol": 2})) + frame(b"\xff", opcode=1),
        frame(b"x", opcode=8),
    ],
)
def test_a_wrong_frame_ends_its_connection_without_a_traceback_in_the_log(
    server: SimulationServer, caplog: pytest.LogCaptureFixture, data: bytes
) -> None:
    for _ in range(5):
        with _websocket(server) as peer, contextlib.suppress(ConnectionResetError):
            peer.sendall(data)
            while peer.recv(65536):
                pass
    assert not [record for record in caplog.records if record.name.startswith(("uvicorn", "asyncio"))]


# -- HTTP ----------------------------------------------------------------------------------------------------------


def _exchange(server: SimulationServer, request: bytes) -> bytes:
    """What the server answers until it closes the connection."""
    with connection(server) as peer:
        peer.sendall(request)
        answer = b""
        while part := peer.recv(65536):
            answer += part
        return answer


GET = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def test_idle_connections_do_not_block_new_ones(server: SimulationServer) -> None:
    idle = [connection(server) for _ in range(450)]
    try:
        assert _exchange(server, GET + b"Connection: close\r\n\r\n").startswith(b"HTTP/1.1 404")  # no page is built
        with native_client(server) as client:
            assert client.receive()["type"] == "Welcome"
    finally:
        for peer in idle:
            peer.close()


def test_downloads_that_nobody_reads_lock_nobody_out(server: SimulationServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MAX_HTTP", 5)
    wait_until(lambda: "scene/map.glb" in server.hub.files)
    with contextlib.ExitStack() as stack:
        for _ in range(5):
            peer = stack.enter_context(connection(server))
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            peer.sendall(300 * b"GET /scene/map.glb HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert server.web_server
        state = server.web_server.server_state
        wait_until(
            lambda: (
                sum(not protocol.is_idle for protocol in set(state.connections) if isinstance(protocol, HttpProtocol))
                == 5
            )
        )
        assert _exchange(server, GET + b"Connection: close\r\n\r\n").startswith(b"HTTP/1.1 404")


def test_a_connection_without_a_complete_request_is_closed(
    server: SimulationServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "IDLE_TIMEOUT", 0.2)
    with connection(server) as silent, contextlib.suppress(ConnectionResetError):
        assert silent.recv(1) == b""
    with connection(server) as slow:
        cut_off(lambda _: (slow.sendall(b"GET"), time.sleep(0.02)))


@pytest.mark.parametrize(
    "head",
    [
        b"Content-Length: 40\r\nTransfer-Encoding: chunked\r\n",
        b"Content-Length: 4\r\nContent-Length: 40\r\n",
        b"Content-Length: 40\r\n",
        b"Transfer-Encoding: chunked\r\n",
    ],
)
def test_a_request_hidden_in_the_content_of_another_is_not_answered(server: SimulationServer, head: bytes) -> None:
    hidden = b"GET /hidden HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    answer = _exchange(server, GET + head + b"\r\n" + b"0\r\n\r\n" + hidden)
    assert answer.count(b"HTTP/1.1 ") == 1
    assert answer.startswith(b"HTTP/1.1 400")
    assert b"hidden" not in answer


@pytest.mark.parametrize(
    "headers",
    [
        b"Host: [::1]evil.example:80\r\n",
        b"Host: [::1\r\n",
        b"Host: 127.0.0.1:80:evil.example\r\n",
        b"Host: 127.0.0.1\r\nOrigin: http://[::1\r\n",
        b"Host: 127.0.0.1\r\nOrigin: http://127.0.0.1@evil.example\r\n",
        b"Host: 127.0.0.1\r\nOrigin: http://127.0.0.1/path\r\n",
    ],
)
def test_a_malformed_host_or_origin_is_refused(
    server: SimulationServer, headers: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    answer = _exchange(server, b"GET / HTTP/1.1\r\n" + headers + b"Connection: close\r\n\r\n")
    assert answer.startswith((b"HTTP/1.1 403", b"HTTP/1.1 400"))
    assert not [record for record in caplog.records if record.exc_info]


def test_a_websocket_with_a_malformed_origin_is_refused(server: SimulationServer) -> None:
    with pytest.raises(InvalidStatus) as refused, raw(server, origin="http://[::1"):
        pass
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("token", ["x", "", "short-token-1234"[:15], "sixteen characters", "ä" * 20])
def test_a_weak_token_is_refused(simulation: Simulation, token: str) -> None:
    with pytest.raises(AutodriveError, match="16 or more characters"):
        SimulationServer(Served(simulation, scene_files), PageOptions(token=token))


def test_the_server_closes_while_a_client_neither_reads_nor_leaves(
    server: SimulationServer, simulation: Simulation
) -> None:
    with served(simulation) as other, _websocket(other), native_client(other, max_queue=1) as lazy:
        lazy.send("Subscribe", frame_rate=None, scans=True)
        wait_until(lambda: other.clients == 1)
        other.close()
        assert other.clients == 0


# -- inside --------------------------------------------------------------------------------------------------------


def test_events_that_wait_for_the_server_are_bounded(simulation: Simulation) -> None:
    queue = FrameQueue(simulation, lambda: None)
    event = Collision(0.0, "V1", "box", 1.0, np.zeros(3))
    for _ in range(1500):
        queue.publish(replace(simulation.frame, events=(event,)))
    (update,) = queue.take()
    assert isinstance(update, FrameUpdate)
    assert len(update.events) == 1000


def test_the_bridge_is_connected_after_it_is_disconnected(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever asks, and however long it takes to disconnect."""
    bridge = DevkitBridge(simulation)
    may_close, close = threading.Event(), bridge.close
    monkeypatch.setattr(bridge, "close", lambda: (may_close.wait(LIMIT), close()))

    async def both() -> None:
        control = BridgeControl(bridge)
        await control.connect("127.0.0.1", free_port())
        tasks = [asyncio.create_task(control.disconnect())]
        await asyncio.sleep(0.05)
        tasks.append(asyncio.create_task(control.connect("127.0.0.1", free_port())))
        await asyncio.sleep(0.05)
        may_close.set()
        await asyncio.gather(*tasks)

    asyncio.run(both())
    assert bridge.status == "connecting"
    bridge.close()
