"""The server against another WebSocket library and another reader of MessagePack: handshake, Frames, requests."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import simplejpeg
from msgspec.structs import replace
from websockets.exceptions import ConnectionClosed

import autodrive
from autodrive import Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import Collision, Pause, SetSpeed
from autodrive.protocol.native import Starting
from autodrive.scenario.descriptions import Descriptions
from autodrive.world import World
from tests.support.native_clients import NativeClient, native_client, raw, scene_files
from tests.support.waiting import LIMIT, free_port, wait_until


@pytest.fixture
def server(simulation: Simulation) -> Iterator[SimulationServer]:
    with SimulationServer(
        Served(
            simulation,
            scene_files,
            bridge=DevkitBridge(simulation),
            scenarios={"two_cars": "Two cars", "plane": "One"},
        ),
        PageOptions(port=free_port()),
    ) as serving:
        yield serving


@pytest.fixture
def client(server: SimulationServer) -> Iterator[NativeClient]:
    with native_client(server, "one") as it:
        yield it


def test_a_client_gets_welcome_and_scene_before_the_first_frame(client: NativeClient) -> None:
    welcome = client.receive()
    assert (welcome["type"], welcome["protocol"], welcome["name"]) == ("Welcome", 2, "one")
    assert welcome["version"] == autodrive.__version__
    assert welcome["scenarios"] == {"two_cars": "Two cars", "plane": "One"}
    types = [client.receive()["type"] for _ in range(8)]
    assert client.socket.subprotocol == "autodrive.v2"
    assert types.index("Scene") < types.index("Frame")


def test_a_client_of_a_server_without_a_simulation_is_told_so_until_there_is_one(simulation: Simulation) -> None:
    unknown = {
        "share": None,
        "remaining": None,
        "scene": None,
        "frame": None,
        "scenario": "",
        "has_start_screen": False,
    }
    with SimulationServer(None, PageOptions(port=free_port())) as server:
        with native_client(server, "early") as early:  # its Hello is sent now
            assert early.receive() == {"type": "Starting", "stage": "starting", **unknown}
            early.send("Subscribe", frame_rate=7.0)
            assert early.socket.ping().wait(LIMIT)
            server.starting = Starting("compiling", 0.25, 12.0)
            while (message := early.receive())["stage"] == "starting":
                pass
            assert message == {"type": "Starting", "stage": "compiling", **unknown, "share": 0.25, "remaining": 12.0}
            server.serve(Served(simulation, scene_files))
            while (message := early.receive())["type"] == "Starting":
                pass
            assert (message["type"], message["name"]) == ("Welcome", "early")
            wait_until(lambda: [client.subscription.frame_rate for client in server.hub.clients] == [7.0])
        with native_client(server, "late") as late:
            assert late.receive()["type"] == "Welcome"


def test_a_server_without_a_simulation_closes_the_connections_of_its_clients() -> None:
    with SimulationServer(None, PageOptions(port=free_port())) as server, native_client(server) as early:
        early.receive()
        server.close()
        with pytest.raises(ConnectionClosed):
            _ = [early.receive() for _ in itertools.count()]


@pytest.mark.parametrize(("version", "message"), [(1, "Fault"), (3, "Error")])
def test_a_client_of_another_version_gets_an_error_that_it_can_read(
    server: SimulationServer, version: int, message: str
) -> None:
    with raw(server) as socket:
        strange = NativeClient.__new__(NativeClient)
        strange.socket = socket
        strange.send("Hello", protocol=version)
        error = strange.receive()
        assert (error["type"], error["code"]) == (message, "version")
        assert f"speaks version 2 of the native protocol, not {version}" in error["text"]
        with pytest.raises(ConnectionClosed):
            strange.receive()


def test_a_client_without_hello_is_disconnected(server: SimulationServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.connect.server.handshake.HELLO_TIMEOUT", LIMIT)
    mute = NativeClient.__new__(NativeClient)
    with raw(server) as socket:
        mute.socket = socket
        mute.send("Subscribe")
        assert "the first message must be a Hello" in mute.error("message")
    monkeypatch.setattr("autodrive.connect.server.handshake.HELLO_TIMEOUT", 0.1)
    with raw(server) as socket:
        mute.socket = socket
        assert "no Hello" in mute.error("message")


def test_clients_with_the_same_name_get_different_names(server: SimulationServer) -> None:
    with (
        native_client(server, "page") as first,
        native_client(server, "page") as second,
        native_client(server, "\n") as third,
    ):
        assert [it.receive()["name"] for it in (first, second, third)] == ["page", "page 2", "client"]


def test_frames_have_the_subscribed_rate(client: NativeClient) -> None:
    client.until("Frame")
    start = time.monotonic()
    client.send("Subscribe", frame_rate=20.0)
    client.ask("SetSpeed", factor=1.0)  # what comes before its Response was sent at the rate before
    for _ in range(21):
        client.until("Frame")
    assert time.monotonic() - start > 0.9 * 20 / 20.0  # a busy machine takes longer


def test_a_subscription_without_frames_gets_none(client: NativeClient) -> None:
    client.until("Frame")
    client.send("Subscribe", frame_rate=0.0)
    client.ask("SetSpeed", factor=1.0)
    statuses = [client.receive()["type"] for _ in range(4)]
    assert set(statuses) == {"Status"}


def test_a_subscription_of_all_frames_gets_each_tick(client: NativeClient) -> None:
    client.ask("Pause")
    client.send("Subscribe", frame_rate=None)
    begin = client.ask("Step")["frame"]["tick"]
    ticks = [client.ask("Step")["frame"]["tick"] for _ in range(20)]
    assert ticks == list(range(begin + 1, begin + 21))


def test_a_scan_precedes_the_first_frame_that_contains_it(client: NativeClient) -> None:
    client.send("Subscribe", frame_rate=None, scans=True)
    client.until("Frame")
    scan = client.until("Scan")
    after = client.until("Frame")
    assert scan["vehicle"] == "V1"
    assert scan["scan"]["time"] <= after["time"] <= scan["scan"]["time"] + 0.5
    assert len(scan["scan"]["ranges"]) == 360
    assert after["vehicles"]["V1"]["lidar"] is None


def test_a_slow_reader_gets_the_latest_and_no_backlog(server: SimulationServer, simulation: Simulation) -> None:
    with native_client(server, "slow", max_queue=2) as slow:
        slow.send("Subscribe", frame_rate=None, scans=True)
        slow.until("Frame")
        simulation.request(SetSpeed(None)).result(LIMIT)
        then = simulation.ticks
        wait_until(lambda: simulation.ticks > then + 3000)
        simulation.request(Pause()).result(LIMIT)
        last = simulation.frame.tick
        count = 1
        while slow.until("Frame")["tick"] < last:
            count += 1
        assert count < 1500  # what the system holds of both sides, not 3000


def test_events_are_kept_for_a_client_with_a_low_frame_rate(server: SimulationServer, simulation: Simulation) -> None:
    position = np.zeros(3)
    with native_client(server) as rare:
        rare.ask("Pause")
        rare.send("Subscribe", frame_rate=0.0)
        rare.ask("Resume")
        for number in range(5):
            event = Collision(0.0, "V1", f"box {number}", 1.0, position)
            server.hub.broadcast.queue.publish(replace(simulation.frame, events=(event,)))
            time.sleep(0.02)
        events = rare.ask("Pause")["frame"]["events"]
        assert [event["other"] for event in events] == [f"box {number}" for number in range(5)]
        assert not rare.ask("Step")["frame"]["events"]


def test_a_step_needs_a_pause(client: NativeClient) -> None:
    error = client.ask("Step")
    assert (error["type"], error["code"]) == ("Error", "request")
    assert "request Pause first" in error["text"]


def test_a_request_that_was_held_up_is_refused(
    server: SimulationServer, client: NativeClient, simulation: Simulation
) -> None:
    clock = client.until("Status")["clock"]
    for id, heard in ((1, clock - 5), (2, clock)):  # the sender of the first one knew a Status that is 5 s older
        client.send("Request", id=id, operation={"type": "SetSceneLight", "enabled": id == 1}, heard=heard)
        answer = client.answer(id)
        assert answer["type"] == ("Error" if id == 1 else "Response")
        if id == 1:
            assert "the request arrived 5 s late and was not executed" in answer["text"]
    assert not simulation.frame.scene_light


def test_a_pause_and_a_step_can_be_requested_together(client: NativeClient) -> None:
    pause, step = client.begin("Pause"), client.begin("Step", ticks=3)
    assert client.answer(step)["frame"]["tick"] - 3 >= 0
    assert pause < step


def test_a_reset_keeps_all_clients(server: SimulationServer, client: NativeClient) -> None:
    with native_client(server, "two") as two:
        client.until(lambda message: message["type"] == "Status" and message["clients"] == 2)
        assert client.ask("Reset", seed=1)["frame"]["tick"] <= 1
        assert two.until("Frame")["tick"] >= 0
        assert two.until("Status")["clients"] == 2


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ({"type": "LoadScenario", "name": "../secret"}, "scenario '../secret' is not known"),
        ({"type": "ConnectBridge", "host": "not a host", "port": 4567}, "is not a host name or IP address"),
        ({"type": "ConnectBridge", "host": "127.0.0.1", "port": 70000}, "is not between 1 and 65535"),
        ({"type": "SetCamera", "camera": "Devil's Eye"}, "scene camera 'Devil's Eye' is not known"),
        ({"type": "SetCamera", "camera": "Orbit", "rate": 0.0}, "more than 0 Hz"),
    ],
)
def test_an_impossible_request_is_answered_with_an_error_and_its_id(
    client: NativeClient, request_: dict[str, Any], text: str
) -> None:
    error = client.ask(request_.pop("type"), **request_)
    assert (error["type"], error["code"]) == ("Error", "request")
    assert text in error["text"]
    assert client.until("Frame")


def test_the_bridge_connects_reports_its_error_and_disconnects(client: NativeClient) -> None:
    port = free_port()
    for _ in range(2):  # again after an end
        assert client.ask("ConnectBridge", host="127.0.0.1", port=port)["type"] == "Response"
        status = client.until(lambda message: message["type"] == "Status" and message["bridge"]["error"])
        assert status["bridge"]["state"] == "connecting"
        assert status["bridge"]["error"] == f"no script at 127.0.0.1:{port} (connection refused); trying again"
        assert client.ask("DisconnectBridge")["type"] == "Response"
        status = client.until(lambda message: message["type"] == "Status" and message["bridge"]["state"] == "closed")
        assert status["bridge"]["error"] == ""


def test_a_new_scenario_starts_with_its_scene() -> None:
    is_note_seen = threading.Event()  # a quick load would leave no time for a Status with its note

    def load(scenario: str | Descriptions) -> World:
        is_note_seen.wait()
        return autodrive.make(scenario)

    simulation = Simulation(autodrive.make("plane"), load=load)
    served = Served(simulation, scene_files, scenarios={"two_cars": "Two cars"})
    with (
        SimulationServer(served, PageOptions(port=free_port())) as server,
        simulation,
        native_client(server) as it,
        native_client(server) as watcher,
    ):
        it.until("Frame")
        watcher.until("Frame")
        id = it.begin("LoadScenario", name="two_cars")
        try:
            it.until(lambda message: message["type"] == "Status" and "Two cars" in message["note"])
        finally:
            is_note_seen.set()
        for each in (it, watcher):
            has_scene = False
            while True:
                message = each.receive()
                has_scene |= message["type"] == "Scene"
                frame = message["frame"] if message.get("id") == id else message
                if frame["type"] == "Frame" and "V2" in frame["vehicles"]:
                    break
            assert has_scene
        it.until(lambda message: message["type"] == "Status" and not message["note"])
        simulation.stop()
        simulation.world.close()


def test_scene_cameras_are_rendered_for_other_clients(gl: str, client: NativeClient, simulation: Simulation) -> None:
    client.ask("SetCamera", camera="Bird's Eye", width=320)
    driven = client.until("Rendered")
    later = client.until("Rendered")
    assert later["time"] > driven["time"]
    assert simplejpeg.decode_jpeg(later["jpeg"]).shape == (180, 320, 3)
    client.ask("Pause")
    client.ask("Reset")
    while client.until("Rendered")["time"] > 0.0:  # the last Frame before a pause is drawn too
        pass
    client.ask("SetCamera", camera=None)
    client.ask("Resume")
    seen = [client.receive()["type"] for _ in range(30)]
    assert "Rendered" not in seen[10:]


@pytest.mark.slow
def test_scene_cameras_continue_in_another_scenario(gl: str) -> None:
    simulation = Simulation(autodrive.make("plane"), load=autodrive.make)
    scenarios = {"two_cars": "Two cars"}
    served = Served(simulation, scene_files, scenarios=scenarios)
    with SimulationServer(served, PageOptions(port=free_port())) as server, simulation:
        with native_client(server) as it:
            it.ask("SetCamera", camera="Driver's Eye", width=160)
            it.until("Rendered")
            assert it.ask("LoadScenario", name="two_cars")["type"] == "Response"
            it.until("Rendered")  # it may be the last of the world before
            it.until("Frame")
            it.until("Rendered")
        simulation.stop()
        simulation.world.close()
