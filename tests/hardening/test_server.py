"""Hostile clients of the server: others are not slowed, memory stays bounded, and each request gets an answer."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

import autodrive
from autodrive import AutodriveError, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.server import connections
from autodrive.server.server import Server
from autodrive.world import World
from tests.support.native_clients import native_client, raw, scene_files
from tests.support.waiting import LIMIT, free_port, wait_until

HUGE = 1e300


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(autodrive.make("plane"), load=autodrive.make)


@contextlib.contextmanager
def served(simulation: Simulation) -> Iterator[Server]:
    bridge = DevkitBridge(simulation)
    scenarios = {"plane": "Plane"}
    with Server(simulation, scene_files=scene_files, scenarios=scenarios, port=free_port(), bridge=bridge) as server:
        yield server
    bridge.close()


@pytest.fixture(scope="module")
def server(simulation: Simulation) -> Iterator[Server]:
    with simulation, served(simulation) as server:
        yield server


# -- requests ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("type_", "fields"),
    [
        ("Reset", {"seed": -1}),
        ("Reset", {"seed": 2**63}),
        ("Reset", {"seed": "1"}),
        ("SetSpeed", {"factor": 1e-12}),
        ("SetSpeed", {"factor": float("nan")}),
        ("Teleport", {"vehicle": "V1", "x": 1e10, "y": 0.0}),
        ("Teleport", {"vehicle": "V1", "x": float("nan"), "y": 0.0}),
        ("Teleport", {"vehicle": "V" * 60_000, "x": 0.0, "y": 0.0}),
        ("Hold", {"vehicle": "V1", "position": [HUGE, 0.0, 0.0]}),
        ("SetTimeOfDay", {"time": float("inf")}),
        ("SetTimeOfDay", {"time": 0.0, "scale": HUGE}),
        ("AddBox", {"name": "box", "x": 0.5, "y": 0.5, "size": [-1.0, 1.0, 1.0]}),
        ("AddBox", {"name": "box", "x": 0.5, "y": 0.5, "mass": HUGE}),
        ("AddBox", {"name": "box", "x": 0.5, "y": 0.5, "size": [HUGE, 1.0, 1.0]}),
        ("SetSensor", {"vehicle": "V1", "sensor": "lidar", "rate": HUGE}),
        ("LoadScenario", {"name": "x" * 60_000}),
        ("LoadScenario", {"name": "../plane"}),
        ("Step", {"ticks": 0}),
        ("Step", {"ticks": 10**9}),
        ("SetCamera", {"camera": "Orbit", "rate": -1.0}),
        ("SetCamera", {"camera": "Orbit", "zoom": float("nan")}),
        ("ConnectBridge", {"host": "a:b:c", "port": 4567}),
        ("ConnectBridge", {"host": "a\0b", "port": 4567}),
        ("ConnectBridge", {"host": "a\r\nHost: b", "port": 4567}),
        ("ConnectBridge", {"host": "::ffff::1", "port": 4567}),
        ("ConnectBridge", {"host": "-a.example", "port": 4567}),
        ("ConnectBridge", {"host": "x" * 300, "port": 4567}),
        ("ConnectBridge", {"host": "127.0.0.1", "port": 0}),
        ("ConnectBridge", {"host": "127.0.0.1", "port": 65536}),
        ("Unknown", {}),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_request_out_of_range_is_refused_with_its_id(
    server: Server, simulation: Simulation, type_: str, fields: dict[str, Any]
) -> None:
    with native_client(server) as client:
        answer = client.ask(type_, **fields)
        assert answer["type"] == "Error"
        assert answer["code"] == "request"
        assert len(answer["text"]) < 500
        assert client.ask("Resume")["type"] == "Response"
    assert not simulation.error


def test_a_flood_of_resets_is_answered_with_few_resets(
    server: Server, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    seeds = []
    reset = World.reset
    monkeypatch.setattr(World, "reset", lambda self, seed=None: (seeds.append(seed), reset(self, seed))[1])
    with native_client(server) as client:
        ids = [client.begin("Reset", seed=seed) for seed in range(60)]
        answered = {client.answer(id)["id"] for id in ids}
    assert answered == set(ids)
    assert len(seeds) <= 10
    assert seeds[-1] == 59


def test_requests_use_at_most_a_fifth_of_the_time(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    spans = []
    reset = World.reset

    def timed(self: World, seed: int | None = None) -> Any:
        start = time.perf_counter()
        frame = reset(self, seed)
        spans.append((start, time.perf_counter()))
        return frame

    monkeypatch.setattr(World, "reset", timed)
    with native_client(server) as client:
        for _ in range(8):
            client.ask("Reset")
    for (start, end), (following, _) in pairwise(spans):
        assert following - end > 3.9 * (end - start)  # the load of the machine makes the left side longer only


def test_a_client_that_reads_no_replies_is_disconnected(server: Server) -> None:
    with native_client(server, max_queue=1) as lazy:
        lazy.send("Subscribe", frame_rate=0.0)
        lazy.ask("Pause")

        def flood() -> None:
            for id in range(200_000):
                lazy.send("Request", id=id, operation={"type": "Undo"})

        with pytest.raises(ConnectionClosed):
            flood()
    with native_client(server) as other:
        assert other.ask("Resume")["type"] == "Response"


def test_requests_of_a_client_that_left_are_dropped(
    server: Server, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads: list[Any] = []
    load = simulation._load
    assert load is not None
    monkeypatch.setattr(simulation, "_load", lambda name: (loads.append(name), load(name))[1])
    with native_client(server) as client:
        for _ in range(30):
            client.begin("LoadScenario", name="plane")
            client.begin("Undo")
    with native_client(server) as other:
        other.ask("Resume")
        other.ask("Resume")
    assert len(loads) <= 3


def test_a_client_above_the_byte_limit_is_disconnected(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.server.rate_limit.MOST_DROPPED", 100)
    with native_client(server) as loud:
        loud.send("Subscribe", frame_rate=0.0)

        def flood() -> None:
            for _ in range(20_000):
                loud.send("Release", vehicle="V" * 60_000)

        with pytest.raises(ConnectionClosed):
            flood()


def test_pings_without_reading_end_the_connection(server: Server) -> None:
    with _websocket(server) as peer:
        ping = bytes([0x89, 0x80 | 125]) + bytes(4) + bytes(125)

        def flood() -> None:
            for _ in range(1000):
                peer.sendall(200 * ping)

        with pytest.raises((ConnectionResetError, BrokenPipeError)):
            flood()


def _websocket(server: Server) -> socket.socket:
    """A WebSocket that reads nothing but the answer to its handshake."""
    peer = socket.create_connection(("127.0.0.1", server.port), LIMIT)
    peer.sendall(
        b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
    )
    assert b" 101 " in peer.recv(4096)
    return peer


# -- HTTP ----------------------------------------------------------------------------------------------------------


def _exchange(server: Server, request: bytes) -> bytes:
    """What the server answers until it closes the connection."""
    with socket.create_connection(("127.0.0.1", server.port), LIMIT) as peer:
        peer.sendall(request)
        answer = b""
        while part := peer.recv(65536):
            answer += part
        return answer


GET = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def test_idle_connections_do_not_block_new_ones(server: Server) -> None:
    idle = [socket.create_connection(("127.0.0.1", server.port), LIMIT) for _ in range(450)]
    try:
        assert _exchange(server, GET + b"Connection: close\r\n\r\n").startswith(b"HTTP/1.1 404")  # no page is built
        with native_client(server) as client:
            assert client.receive()["type"] == "Welcome"
    finally:
        for one in idle:
            one.close()


def test_a_connection_without_a_complete_request_is_closed(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "IDLE_TIMEOUT", 0.2)
    with socket.create_connection(("127.0.0.1", server.port), LIMIT) as silent:
        assert _is_closed(silent)
    with socket.create_connection(("127.0.0.1", server.port), LIMIT) as slow:

        def trickle() -> None:
            for _ in range(1000):
                slow.sendall(b"GET")
                time.sleep(0.02)

        with pytest.raises((ConnectionResetError, BrokenPipeError)):
            trickle()


def _is_closed(peer: socket.socket) -> bool:
    try:
        return peer.recv(1) == b""
    except ConnectionResetError:
        return True


@pytest.mark.parametrize(
    "head",
    [
        b"Content-Length: 40\r\nTransfer-Encoding: chunked\r\n",
        b"Content-Length: 4\r\nContent-Length: 40\r\n",
        b"Content-Length: 40\r\n",
        b"Transfer-Encoding: chunked\r\n",
    ],
)
def test_a_request_hidden_in_the_content_of_another_is_not_answered(server: Server, head: bytes) -> None:
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
    server: Server, headers: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    answer = _exchange(server, b"GET / HTTP/1.1\r\n" + headers + b"Connection: close\r\n\r\n")
    assert answer.startswith((b"HTTP/1.1 403", b"HTTP/1.1 400"))
    assert not [record for record in caplog.records if record.exc_info]


def test_a_websocket_with_a_malformed_origin_is_refused(server: Server) -> None:
    with pytest.raises(InvalidStatus) as refused, raw(server, origin="http://[::1"):
        pass
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("token", ["x", "", "short-token-1234"[:15], "sixteen characters", "ä" * 20])
def test_a_weak_token_is_refused(simulation: Simulation, token: str) -> None:
    with pytest.raises(AutodriveError, match="16 or more characters"):
        Server(simulation, scene_files=scene_files, token=token)


def test_the_server_closes_while_a_client_neither_reads_nor_leaves(server: Server, simulation: Simulation) -> None:
    with served(simulation) as other, _websocket(other), native_client(other, max_queue=1) as lazy:
        lazy.send("Subscribe", frame_rate=None, scans=True)
        wait_until(lambda: other.clients == 1)
        other.close()
        assert other.clients == 0
