"""Who drives over the wire, and what clients that misbehave or vanish can do to others, which is nothing."""

from __future__ import annotations

import contextlib
import random
import socket
import struct
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
import simplejpeg
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from websockets.exceptions import ConnectionClosed

import autodrive
from autodrive import Simulation
from autodrive.bridge.server import Server
from autodrive.jpeg import JpegEncoder
from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Frame, Pose
from autodrive.world import World
from tests.bridge.conftest import PATIENCE, eventually, free_port
from tests.bridge.viewers import Guest, Message, guest, pack, raw, scenery


@pytest.fixture(scope="module")
def wanted() -> list[bool]:
    return []


@pytest.fixture(scope="module")
def server(one_world: World, wanted: list[bool]) -> Iterator[Server]:
    one_world.reset(0)
    simulation = Simulation(one_world)
    serving = Server(
        simulation, scenery=scenery, port=free_port(), pictures=JpegEncoder(), wants_pictures=wanted.append
    )
    with serving, simulation:
        yield serving


@pytest.fixture(autouse=True)
def fresh(server: Server) -> None:
    with guest(server) as it:
        for request in ("Reset", "Resume"):
            it.ask(request)
        it.ask("SetDrivingMode", vehicle="V1", is_autonomous=True)


def drivers(are: dict[str, str]) -> object:
    return lambda message: message["type"] == "Status" and message["drivers"] == are


def drive(it: Guest, throttle: float = 0.5, source: str = "script") -> None:
    it.say("Drive", vehicle="V1", command={"throttle": throttle}, source=source)


def test_a_command_moves_the_car_and_its_driver_is_known(server: Server) -> None:
    with guest(server, "ann") as ann:
        drive(ann)
        ann.until(drivers({"V1": "ann"}))  # type: ignore[arg-type]
        deadline = time.monotonic() + PATIENCE
        while ann.until("Frame")["vehicles"]["V1"]["velocity"][0] < 0.1:
            drive(ann)
            assert time.monotonic() < deadline


def test_one_drives_and_the_others_are_told_who(server: Server) -> None:
    with guest(server, "ann") as ann, guest(server, "bob") as bob:
        drive(ann)
        ann.until(drivers({"V1": "ann"}))  # type: ignore[arg-type]
        for _ in range(20):
            drive(bob)
        assert bob.fault("taken") == "'ann' drives vehicle 'V1'"
        others = [bob.hear() for _ in range(20)]
        assert [other for other in others if other["type"] == "Fault"] == []  # at most one a second
        ann.say("Release", vehicle="V1")
        ann.until(drivers({}))  # type: ignore[arg-type]
        drive(bob)
        bob.until(drivers({"V1": "bob"}))  # type: ignore[arg-type]


def test_a_driver_who_vanishes_lets_go(server: Server) -> None:
    with guest(server, "bob") as bob:
        with guest(server, "ann") as ann:
            drive(ann)
            bob.until(drivers({"V1": "ann"}))  # type: ignore[arg-type]
            ann.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            ann.socket.socket.close()  # as a process that was killed: no goodbye
        bob.until(drivers({}))  # type: ignore[arg-type]
        drive(bob)
        bob.until(drivers({"V1": "bob"}))  # type: ignore[arg-type]


def test_a_person_drives_in_manual_mode_only(server: Server) -> None:
    with guest(server, "ann") as ann:
        drive(ann, source="person")
        assert "is in autonomous mode and obeys scripts" in ann.fault("mode")
        ann.ask("SetDrivingMode", vehicle="V1", is_autonomous=False)
        drive(ann, source="person")
        ann.until(drivers({"V1": "ann"}))  # type: ignore[arg-type]


def test_a_step_with_a_command_needs_the_wheel(server: Server) -> None:
    with guest(server, "ann") as ann, guest(server, "bob") as bob:
        bob.ask("Pause")
        drive(ann)
        ann.until(drivers({"V1": "ann"}))  # type: ignore[arg-type]
        fault = bob.ask("Step", commands={"V1": {"throttle": 1.0}})
        assert (fault["code"], fault["text"]) == ("taken", "'ann' drives vehicle 'V1'")
        assert bob.ask("Step")["type"] == "Done"


@pytest.mark.parametrize(
    ("drive_", "says"),
    [
        ({"vehicle": "V9", "command": {}}, "vehicle 'V9' is not known. Known: V1."),
        ({"vehicle": "V1", "command": {"throttle": float("nan")}}, "throttle of vehicle 'V1' must be a finite number"),
    ],
)
def test_a_command_that_makes_no_sense_is_refused(server: Server, drive_: Message, says: str) -> None:
    with guest(server) as it:
        it.say("Drive", **drive_)
        assert says in it.fault("request")


# -- those who misbehave ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "not understood"),
        (b"\xc1", "not understood"),
        (pack({"type": "Explode"}), "Invalid value 'Explode'"),
        (pack({"type": "Drive", "vehicle": "V1"}), "missing required field `command`"),
        (pack({"type": "Hello", "protocol": 1}), "a Hello comes once"),
        (pack({"type": "Subscribe", "frame_rate": -1.0}), "rates of 0 or more"),
        (b"\x91" * 5000, "not understood"),
        ("text", "messages are binary"),
    ],
)
def test_a_broken_message_is_told_and_ends_nothing(server: Server, data: bytes | str, says: str) -> None:
    with guest(server) as it:
        it.socket.send(data)
        assert says in it.fault("message")
        assert it.ask("SetSceneLight", enabled=True)["type"] == "Done"


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.binary(max_size=100), max_size=10))
def test_no_bytes_at_all_disturb_others(server: Server, messages: list[bytes]) -> None:
    with raw(server) as socket_:
        with contextlib.suppress(ConnectionClosed):
            for message in messages:
                socket_.send(message)
        with guest(server) as other:
            assert other.hear()["type"] == "Welcome"


def test_a_message_that_is_too_long_ends_its_sender_only(server: Server) -> None:
    with guest(server) as long, guest(server) as other:
        long.socket.send(bytes(2**16 + 1))
        with pytest.raises(ConnectionClosed) as end:
            long.until("Never")
        assert end.value.rcvd is not None
        assert end.value.rcvd.code == 1009
        assert other.ask("SetSceneLight", enabled=True)["type"] == "Done"


def test_who_sends_too_much_is_told_and_in_the_end_sent_away(server: Server) -> None:
    with guest(server) as mad:
        mad.until("Frame")
        text = pack({"type": "Release", "vehicle": "V1"})
        for _ in range(3000):
            mad.socket.send(text)
        assert "more than 1000 messages a second" in mad.fault("rate")

        def flood() -> None:
            while True:
                mad.socket.send(text)

        with pytest.raises(ConnectionClosed):
            flood()
    with guest(server) as other:
        assert other.hear()["type"] == "Welcome"


def test_requests_without_end_are_refused(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.bridge.errands.PENDING", 0)
    with guest(server) as it:
        fault = it.ask("Reset")
        assert (fault["code"], fault["type"]) == ("rate", "Fault")


def test_too_many_viewers_are_sent_away(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.bridge.hub.VIEWERS", 1)
    with guest(server) as first, guest(server) as second:
        first.until("Frame")
        assert "no room for more" in second.fault("rate")


def test_who_is_killed_during_a_step_harms_nobody(server: Server) -> None:
    with guest(server) as other:
        other.ask("Pause")
        with guest(server) as victim:
            victim.begin("Step", ticks=5000)
            victim.socket.socket.close()
        assert other.ask("Step")["type"] == "Done"
        other.until(lambda message: message["type"] == "Status" and message["viewers"] == 1)


def test_twenty_come_and_go_at_once(server: Server) -> None:
    seen: list[int] = []

    def visit(number: int) -> None:
        rng = random.Random(number)
        for _ in range(3):
            with guest(server, f"guest {number}") as it:
                it.say("Subscribe", frame_rate=None, scans=True)
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
        thread.join(3 * PATIENCE)
    assert sorted(seen) == list(range(20))
    with guest(server) as last:
        last.until(lambda message: message["type"] == "Status" and message["viewers"] == 1)
    eventually(lambda: not server._hub._viewers)


def test_it_ends_soon_although_somebody_does_not_read() -> None:
    simulation = Simulation(autodrive.make("plane"), speed=None)
    server = Server(simulation, scenery=scenery, port=free_port())
    with simulation, server, guest(server, max_queue=1) as lazy:
        lazy.say("Subscribe", frame_rate=None, scans=True)
        then = simulation.ticks
        eventually(lambda: simulation.ticks > then + 2000)
        begin = time.monotonic()
        server.close()
        assert time.monotonic() - begin < PATIENCE / 2


# -- pictures ---------------------------------------------------------------------------------------------------


def picture(frame: Frame, now: float) -> Frame:
    rgba = np.full((48, 64, 4), 200, np.uint8)
    image = CameraImage(now, Pose(np.zeros(3), np.zeros(4)), CameraIntrinsics(64, 48, 50.0, 50.0, 32.0, 24.0), rgba)
    return replace(frame, vehicles={"V1": replace(frame.vehicles["V1"], cameras={"front": image})})


def test_pictures_come_as_wide_as_is_wanted_before_their_frame(server: Server, wanted: list[bool]) -> None:
    hub = server._hub
    with guest(server) as it, guest(server) as blind:
        it.ask("Pause")
        wanted.clear()
        it.say("Subscribe", frame_rate=None, picture_rate=100.0, picture_width=32)
        blind.ask("SetSpeed", factor=1.0)
        hub._mail.publish(picture(hub._simulation.frame, 1.0))
        messages = [it.until("Picture"), it.hear()]
        assert [message["type"] for message in messages] == ["Picture", "Frame"]
        first = messages[0]
        assert (first["vehicle"], first["camera"], first["time"]) == ("V1", "front", 1.0)
        assert simplejpeg.decode_jpeg(first["jpeg"]).shape == (24, 32, 3)
        assert first["intrinsics"]["width"] == 64
        assert wanted == [True]
    eventually(lambda: wanted == [True, False])


def test_pictures_come_no_more_often_than_is_wanted(server: Server) -> None:
    hub = server._hub
    with guest(server) as it:
        it.ask("Pause")
        it.say("Subscribe", frame_rate=0.0, picture_rate=5.0)
        it.ask("SetSpeed", factor=1.0)
        begin, count = time.monotonic(), 0
        while time.monotonic() < begin + 0.5:
            hub._mail.publish(picture(hub._simulation.frame, time.monotonic()))
            time.sleep(0.01)
        lasted = time.monotonic() - begin
        id = it.begin("SetSpeed", factor=1.0)
        while (message := it.hear()).get("id") != id:
            count += message["type"] == "Picture"
        assert 1 <= count <= 5.0 * lasted + 1, "one at the beginning, and then one in 0.2 s"
