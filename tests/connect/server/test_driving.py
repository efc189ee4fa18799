"""Driving through the server; clients that misbehave or disconnect do not affect others."""

from __future__ import annotations

import contextlib
import random
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import simplejpeg
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from websockets.exceptions import ConnectionClosed

import autodrive
from autodrive import Simulation
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import MESSAGE_LIMIT, SimulationServer
from autodrive.graphics.cameras.jpeg import JpegEncoder
from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Frame, Pose
from autodrive.world import World
from tests.support.native_clients import Message, NativeClient, native_client, pack, raw, scene_files
from tests.support.waiting import LIMIT, free_port, wait_until


@pytest.fixture(scope="module")
def wanted() -> list[bool]:
    return []


@pytest.fixture(scope="module")
def server(one_world: World, wanted: list[bool]) -> Iterator[SimulationServer]:
    one_world.reset(0)
    simulation = Simulation(one_world)
    serving = SimulationServer(
        Served(simulation, scene_files, jpeg_encoder=JpegEncoder(), want_pictures=wanted.append),
        PageOptions(port=free_port()),
    )
    with serving, simulation:
        yield serving


@pytest.fixture(autouse=True)
def fresh(server: SimulationServer) -> None:
    with native_client(server) as it:
        for request in ("Reset", "Resume"):
            it.ask(request)
        it.ask("SetDrivingMode", vehicle="V1", is_autonomous=True)


def drivers(are: dict[str, str]) -> Callable[[Message], bool]:
    return lambda message: message["type"] == "Status" and message["drivers"] == are


def drive(it: NativeClient, throttle: float = 0.5, source: str = "script") -> None:
    it.send("Drive", vehicle="V1", command={"throttle": throttle}, source=source)


def test_a_command_moves_the_car_and_its_driver_is_known(server: SimulationServer) -> None:
    with native_client(server, "ann") as ann:
        drive(ann)
        ann.until(drivers({"V1": "ann"}))
        deadline = time.monotonic() + LIMIT
        while ann.until("Frame")["vehicles"]["V1"]["velocity"][0] < 0.1:
            drive(ann)
            assert time.monotonic() < deadline


def test_one_client_drives_and_the_others_get_its_name(server: SimulationServer) -> None:
    with native_client(server, "ann") as ann, native_client(server, "bob") as bob:
        drive(ann)
        ann.until(drivers({"V1": "ann"}))
        for _ in range(20):
            drive(bob)
        assert bob.error("taken") == "'ann' drives V1; V1 is free 2 s after the last command of 'ann'"
        others = [bob.receive() for _ in range(20)]
        assert [other for other in others if other["type"] == "Error"] == []  # at most one a second
        ann.send("Release", vehicle="V1")
        ann.until(drivers({}))
        drive(bob)
        bob.until(drivers({"V1": "bob"}))


def test_a_lost_connection_releases_the_vehicle(server: SimulationServer) -> None:
    with native_client(server, "bob") as bob:
        with native_client(server, "ann") as ann:
            drive(ann)
            bob.until(drivers({"V1": "ann"}))
            ann.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            ann.socket.socket.close()  # as a process that was killed: no goodbye
        bob.until(drivers({}))
        drive(bob)
        bob.until(drivers({"V1": "bob"}))


def test_a_person_drives_in_manual_mode_only(server: SimulationServer) -> None:
    with native_client(server, "ann") as ann:
        drive(ann, source="person")
        assert "is in autonomous mode and obeys a script" in ann.error("mode")
        ann.ask("SetDrivingMode", vehicle="V1", is_autonomous=False)
        drive(ann, source="person")
        ann.until(drivers({"V1": "ann"}))


def test_a_step_with_a_command_needs_the_driver_lease(server: SimulationServer) -> None:
    with native_client(server, "ann") as ann, native_client(server, "bob") as bob:
        bob.ask("Pause")
        drive(ann)
        ann.until(drivers({"V1": "ann"}))
        error = bob.ask("Step", commands={"V1": {"throttle": 1.0}})
        assert (error["code"], error["text"]) == (
            "taken",
            "'ann' drives V1; V1 is free 2 s after the last command of 'ann'",
        )
        assert bob.ask("Step")["type"] == "Response"


@pytest.mark.parametrize(
    ("drive_", "text"),
    [
        ({"vehicle": "V9", "command": {}}, "vehicle 'V9' is not known. Known: V1."),
        ({"vehicle": "V1", "command": {"throttle": float("nan")}}, "throttle of vehicle 'V1' must be a finite number"),
    ],
)
def test_an_invalid_command_is_refused(server: SimulationServer, drive_: Message, text: str) -> None:
    with native_client(server) as it:
        it.send("Drive", **drive_)
        assert text in it.error("request")


# -- those who misbehave ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "not understood"),
        (b"\xc1", "not understood"),
        (pack({"type": "Explode"}), "Invalid value 'Explode'"),
        (pack({"type": "Drive", "vehicle": "V1"}), "missing required field `command`"),
        (pack({"type": "Hello", "protocol": 2}), "a Hello is sent once"),
        (pack({"type": "Subscribe", "frame_rate": -1.0}), ">= 0.0 - at `$.frame_rate`"),
        (b"\x91" * 5000, "not understood"),
        ("text", "messages must be binary"),
    ],
)
def test_an_invalid_message_is_answered_with_an_error(server: SimulationServer, data: bytes | str, text: str) -> None:
    with native_client(server) as it:
        it.socket.send(data)
        assert text in it.error("message")
        assert it.ask("SetSceneLight", enabled=True)["type"] == "Response"


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.binary(max_size=100), max_size=10))
def test_random_bytes_do_not_disturb_other_clients(server: SimulationServer, messages: list[bytes]) -> None:
    with raw(server) as socket_:
        with contextlib.suppress(ConnectionClosed):
            for message in messages:
                socket_.send(message)
        with native_client(server) as other:
            assert other.receive()["type"] == "Welcome"


def test_a_message_that_is_too_long_disconnects_only_its_sender(server: SimulationServer) -> None:
    with native_client(server) as long, native_client(server) as other:
        long.socket.send(bytes(MESSAGE_LIMIT + 1))
        with pytest.raises(ConnectionClosed) as end:
            long.until("Never")
        assert end.value.rcvd is not None
        assert end.value.rcvd.code == 1009
        assert other.ask("SetSceneLight", enabled=True)["type"] == "Response"


def test_a_client_above_the_rate_limit_gets_an_error_and_is_disconnected_at_last(
    server: SimulationServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("autodrive.connect.server.rate_limit.RATE", 10.0)
    monkeypatch.setattr("autodrive.connect.server.rate_limit.MOST_DROPPED", 300)
    with native_client(server) as mad:
        mad.until("Frame")
        text = pack({"type": "Release", "vehicle": "V1"})
        for _ in range(200):
            mad.socket.send(text)
        assert "messages per second" in mad.error("rate")

        def flood() -> None:
            while True:
                mad.socket.send(text)

        with pytest.raises(ConnectionClosed):
            flood()
    with native_client(server) as other:
        assert other.receive()["type"] == "Welcome"


def test_too_many_pending_requests_are_refused(server: SimulationServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.connect.server.request_queue.MAX_PENDING", 0)
    with native_client(server) as it:
        error = it.ask("Reset")
        assert (error["code"], error["type"]) == ("rate", "Error")


def test_too_many_clients_are_refused(server: SimulationServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.connect.server.hub.MAX_CLIENTS", 1)
    with native_client(server) as first, native_client(server) as second:
        first.until("Frame")
        assert "no more are accepted" in second.error("rate")


def test_a_client_that_is_killed_during_a_step_does_not_disturb_others(server: SimulationServer) -> None:
    with native_client(server) as other:
        other.ask("Pause")
        with native_client(server) as victim:
            victim.begin("Step", ticks=5000)
            victim.socket.socket.close()
        assert other.ask("Step")["type"] == "Response"
        other.until(lambda message: message["type"] == "Status" and message["clients"] == 1)


def test_twenty_clients_connect_and_disconnect_at_once(server: SimulationServer) -> None:
    seen: list[int] = []

    def visit(number: int) -> None:
        rng = random.Random(number)
        for _ in range(3):
            with native_client(server, f"client {number}") as it:
                it.send("Subscribe", frame_rate=None, scans=True)
                for _ in range(rng.randrange(1, 20)):
                    it.until("Frame")
                drive(it)
                if rng.random() < 0.5:
                    it.socket.socket.close()
        seen.append(number)

    threads = [threading.Thread(target=visit, args=(number,)) for number in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(3 * LIMIT)
    assert sorted(seen) == list(range(20))
    with native_client(server) as last:
        last.until(lambda message: message["type"] == "Status" and message["clients"] == 1)
    wait_until(lambda: not server.clients)


@pytest.mark.slow
def test_the_server_closes_soon_although_a_client_does_not_read() -> None:
    simulation = Simulation(autodrive.make("plane"), speed=None)
    server = SimulationServer(Served(simulation, scene_files), PageOptions(port=free_port()))
    with simulation, server, native_client(server, max_queue=1) as lazy:
        lazy.send("Subscribe", frame_rate=None, scans=True)
        then = simulation.ticks
        wait_until(lambda: simulation.ticks > then + 2000)
        begin = time.monotonic()
        server.close()
        assert time.monotonic() - begin < LIMIT / 2


# -- pictures ---------------------------------------------------------------------------------------------------


def picture(frame: Frame, now: float) -> Frame:
    rgba = np.full((48, 64, 4), 200, np.uint8)
    image = CameraImage(now, Pose(np.zeros(3), np.zeros(4)), CameraIntrinsics(64, 48, 50.0, 50.0, 32.0, 24.0), rgba)
    return replace(frame, vehicles={"V1": replace(frame.vehicles["V1"], cameras={"front": image})})


def test_pictures_have_the_subscribed_width_and_precede_their_frame(
    server: SimulationServer, wanted: list[bool], one_world: World
) -> None:
    with native_client(server) as it, native_client(server) as blind:
        it.ask("Pause")
        wanted.clear()
        it.send("Subscribe", frame_rate=None, picture_rate=100.0, picture_width=32)
        blind.ask("SetSpeed", factor=1.0)
        server.hub.broadcast.queue.publish(picture(one_world.frame, 1.0))
        messages = [it.until("Picture"), it.receive()]
        assert [message["type"] for message in messages] == ["Picture", "Frame"]
        first = messages[0]
        assert (first["vehicle"], first["camera"], first["time"]) == ("V1", "front", 1.0)
        assert simplejpeg.decode_jpeg(first["jpeg"]).shape == (24, 32, 3)
        assert first["intrinsics"]["width"] == 64
        assert wanted == [True]
    wait_until(lambda: wanted == [True, False])


def test_pictures_have_at_most_the_subscribed_rate(server: SimulationServer, one_world: World) -> None:
    with native_client(server) as it:
        it.ask("Pause")
        it.send("Subscribe", frame_rate=0.0, picture_rate=5.0)
        it.ask("SetSpeed", factor=1.0)
        begin, count = time.monotonic(), 0
        while time.monotonic() < begin + 0.5:
            server.hub.broadcast.queue.publish(picture(one_world.frame, time.monotonic()))
            time.sleep(0.01)
        lasted = time.monotonic() - begin
        id = it.begin("SetSpeed", factor=1.0)
        while (message := it.receive()).get("id") != id:
            count += message["type"] == "Picture"
        assert 1 <= count <= 5.0 * lasted + 1, "one at the beginning, and then one in 0.2 s"
