"""The server against another WebSocket library and another reader of MessagePack: handshake, Frames, requests."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import simplejpeg
from websockets.exceptions import ConnectionClosed

import autodrive
from autodrive import Command, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.server import Server
from autodrive.protocol.messages import Collision, Frame, Pause, SetSpeed
from autodrive.world import World
from tests.bridge.conftest import PATIENCE, eventually, free_port
from tests.bridge.viewers import Guest, guest, raw, scenery
from tests.frames import bytes_of


@pytest.fixture
def server(simulation: Simulation) -> Iterator[Server]:
    with Server(
        simulation,
        scenery=scenery,
        bridge=DevkitBridge(simulation),
        scenarios={"two_cars": "Two cars", "plane": "One"},
        port=free_port(),
    ) as serving:
        yield serving


@pytest.fixture
def one(server: Server) -> Iterator[Guest]:
    with guest(server, "one") as it:
        yield it


def test_a_client_is_welcomed_and_shown_the_scene_before_the_first_frame(one: Guest) -> None:
    welcome = one.hear()
    assert (welcome["type"], welcome["protocol"], welcome["name"]) == ("Welcome", 1, "one")
    assert welcome["version"] == autodrive.__version__
    assert welcome["scenarios"] == {"two_cars": "Two cars", "plane": "One"}
    types = [one.hear()["type"] for _ in range(8)]
    assert one.socket.subprotocol == "autodrive.v1"
    assert types.index("Scene") < types.index("Frame")


def test_another_version_is_told_ours(server: Server) -> None:
    with raw(server) as socket:
        strange = Guest.__new__(Guest)
        strange.socket = socket
        strange.say("Hello", protocol=2)
        assert "version 1" in strange.fault("version")
        with pytest.raises(ConnectionClosed):
            strange.hear()


def test_who_does_not_say_hello_is_sent_away(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.bridge.hub.GREETING_TIME", 0.1)
    with raw(server) as socket:
        mute = Guest.__new__(Guest)
        mute.socket = socket
        assert "no Hello" in mute.fault("message")
    with raw(server) as socket:
        mute.socket = socket
        mute.say("Subscribe")
        assert "the first message is a Hello" in mute.fault("message")


def test_viewers_of_one_name_get_names_of_their_own(server: Server) -> None:
    with guest(server, "page") as first, guest(server, "page") as second, guest(server, "\n") as third:
        assert [it.hear()["name"] for it in (first, second, third)] == ["page", "page 2", "viewer"]


def test_frames_come_at_the_rate_that_was_asked_for(one: Guest) -> None:
    one.until("Frame")
    one.say("Subscribe", frame_rate=20.0)
    one.ask("SetSpeed", factor=1.0)  # what comes before its Done was sent at the rate before
    times = [one.until("Frame")["time"] for _ in range(21)]
    assert times[-1] - times[0] > 0.9 * 20 / 20.0  # a busy machine takes longer


def test_no_frames_come_where_none_are_wanted(one: Guest) -> None:
    one.until("Frame")
    one.say("Subscribe", frame_rate=0.0)
    one.ask("SetSpeed", factor=1.0)
    statuses = [one.hear()["type"] for _ in range(4)]
    assert set(statuses) == {"Status"}


def test_each_tick_comes_where_all_are_wanted(one: Guest) -> None:
    one.ask("Pause")
    one.say("Subscribe", frame_rate=None)
    begin = one.ask("Step")["frame"]["tick"]
    ticks = [one.ask("Step")["frame"]["tick"] for _ in range(20)]
    assert ticks == list(range(begin + 1, begin + 21))


def test_scans_come_before_the_first_frame_that_they_belong_to(one: Guest) -> None:
    one.say("Subscribe", frame_rate=None, scans=True)
    one.until("Frame")
    scan = one.until("Scan")
    after = one.until("Frame")
    assert scan["vehicle"] == "V1"
    assert scan["scan"]["time"] <= after["time"] <= scan["scan"]["time"] + 0.5
    assert len(scan["scan"]["ranges"]) == 360
    assert after["vehicles"]["V1"]["lidar"] is None


def test_a_slow_reader_gets_the_latest_and_no_backlog(server: Server, simulation: Simulation) -> None:
    with guest(server, "slow", max_queue=2) as slow:
        slow.say("Subscribe", frame_rate=None, scans=True)
        slow.until("Frame")
        simulation.request(SetSpeed(None)).result(PATIENCE)
        then = simulation.ticks
        eventually(lambda: simulation.ticks > then + 3000)
        simulation.request(Pause()).result(PATIENCE)
        last = simulation.frame.tick
        count = 1
        while slow.until("Frame")["tick"] < last:
            count += 1
        assert count < 1500  # what the system holds of both sides, not 3000


def test_events_are_kept_for_who_takes_few_frames(server: Server, simulation: Simulation) -> None:
    position = np.zeros(3)
    with guest(server) as rare:
        rare.ask("Pause")
        rare.say("Subscribe", frame_rate=0.0)
        rare.ask("Resume")
        hub = server._hub
        for number in range(5):
            event = Collision(0.0, "V1", f"box {number}", 1.0, position)
            with_event = _with_events(simulation.frame, event)
            hub._mail.publish(with_event)
            time.sleep(0.02)
        events = rare.ask("Pause")["frame"]["events"]
        assert [event["other"] for event in events] == [f"box {number}" for number in range(5)]
        assert not rare.ask("Step")["frame"]["events"]


def _with_events(frame: Frame, *events: Any) -> Frame:
    from msgspec.structs import replace

    return replace(frame, events=events)


def test_a_step_needs_a_pause(one: Guest) -> None:
    fault = one.ask("Step")
    assert (fault["type"], fault["code"]) == ("Fault", "request")
    assert "request Pause first" in fault["text"]


def test_a_pause_and_a_step_may_be_asked_for_in_one_breath(one: Guest) -> None:
    pause, step = one.begin("Pause"), one.begin("Step", ticks=3)
    assert one.answer(step)["frame"]["tick"] - 3 >= 0
    assert pause < step


def test_steps_over_the_wire_are_those_of_a_world_of_ones_own(server: Server, simulation: Simulation) -> None:
    from autodrive.protocol.codec import decode_server, encode, streamed

    commands = [{"V1": Command(0.3 + 0.01 * n, 0.2 * (-1) ** n)} for n in range(60)]
    with guest(server) as script:
        script.ask("Pause")
        script.ask("SetDrivingMode", vehicle="V1", is_autonomous=True)
        script.ask("Reset", seed=3)
        script.say("Subscribe", frame_rate=0.0)
        over_wire = [
            script.ask("Step", commands={"V1": {"throttle": its.throttle, "steering": its.steering}})["frame"]
            for (its,) in (command.values() for command in commands)
        ]
    own = autodrive.make("plane")
    own.reset(3)
    own.set_driving_mode("V1", True)
    for command, frame in zip(commands, over_wire, strict=True):
        mine = own.step(command)
        theirs = frame["vehicles"]["V1"]
        assert frame["tick"] == mine.tick
        assert theirs["pose"]["position"] == tuple(mine.vehicles["V1"].pose.position)
        assert theirs["imu"]["linear_acceleration"] == tuple(mine.vehicles["V1"].imu.linear_acceleration)
    last = decode_server(encode(streamed(simulation.frame, simulation.frame.events)))
    assert isinstance(last, Frame)
    assert list(bytes_of(last)) == list(bytes_of(streamed(mine, mine.events)))


def test_a_reset_keeps_all_viewers(server: Server, one: Guest) -> None:
    with guest(server, "two") as two:
        one.until(lambda message: message["type"] == "Status" and message["viewers"] == 2)
        assert one.ask("Reset", seed=1)["frame"]["tick"] <= 1
        assert two.until("Frame")["tick"] >= 0
        assert two.until("Status")["viewers"] == 2


def test_every_simple_request_is_carried_out(one: Guest, simulation: Simulation) -> None:
    assert one.ask("SetSceneLight", enabled=False)["frame"]["scene_light"] is False
    teleported = one.ask("Teleport", vehicle="V1", x=1.0, y=2.0, yaw=0.5)["frame"]
    assert teleported["vehicles"]["V1"]["pose"]["position"][:2] == pytest.approx((1.0, 2.0), abs=1e-6)
    assert not one.ask("SetDrivingMode", vehicle="V1", is_autonomous=False)["frame"]["vehicles"]["V1"]["is_autonomous"]
    one.ask("SetSpeed", factor=2.0)
    one.ask("Pause")
    status = one.until(lambda message: message["type"] == "Status" and message["is_paused"])
    assert status["speed"] == 2.0
    one.ask("Resume")
    assert not simulation.is_paused


@pytest.mark.parametrize(
    ("request_", "says"),
    [
        ({"type": "Teleport", "vehicle": "V9", "x": 0, "y": 0}, "vehicle 'V9' is not known"),
        ({"type": "SetSpeed", "factor": -1.0}, "speed must be a positive number"),
        ({"type": "LoadScenario", "name": "../secret"}, "scenario '../secret' is not known"),
        ({"type": "ConnectBridge", "host": "not a host", "port": 4567}, "not a name or an IP address"),
        ({"type": "ConnectBridge", "host": "127.0.0.1", "port": 70000}, "not from 1 to 65535"),
        ({"type": "SetCamera", "camera": "Devil's Eye"}, "scene camera 'Devil's Eye' is not known"),
        ({"type": "SetCamera", "camera": "Orbit", "rate": 0.0}, "more than 0 Hz"),
    ],
)
def test_what_cannot_be_done_is_told_with_the_number_of_the_request(
    one: Guest, request_: dict[str, Any], says: str
) -> None:
    fault = one.ask(request_.pop("type"), **request_)
    assert (fault["type"], fault["code"]) == ("Fault", "request")
    assert says in fault["text"]
    assert one.until("Frame")


def test_the_bridge_is_connected_and_its_fault_told_and_disconnected(one: Guest) -> None:
    port = free_port()
    for _ in range(2):  # again after an end
        assert one.ask("ConnectBridge", host="127.0.0.1", port=port)["type"] == "Done"
        status = one.until(lambda message: message["type"] == "Status" and message["bridge"]["fault"])
        assert status["bridge"]["state"] == "connecting"
        assert status["bridge"]["fault"] == f"no script at 127.0.0.1:{port} (connection refused); trying again"
        assert one.ask("DisconnectBridge")["type"] == "Done"
        status = one.until(lambda message: message["type"] == "Status" and message["bridge"]["state"] == "closed")
        assert status["bridge"]["fault"] == ""


def test_another_scenario_comes_with_its_scene_first(one_world: World) -> None:
    one_world.reset(0)
    simulation = Simulation(one_world, load=autodrive.make)
    with (
        Server(simulation, scenery=scenery, scenarios={"two_cars": "Two cars"}, port=free_port()) as server,
        simulation,
        guest(server) as it,
        guest(server) as watcher,
    ):
        it.until("Frame")
        watcher.until("Frame")
        id = it.begin("LoadScenario", name="two_cars")
        it.until(lambda message: message["type"] == "Status" and "Two cars" in message["note"])
        for each in (it, watcher):
            has_scene = False
            while True:
                message = each.hear()
                has_scene |= message["type"] == "Scene"
                frame = message["frame"] if message.get("id") == id else message
                if frame["type"] == "Frame" and "V2" in frame["vehicles"]:
                    break
            assert has_scene
        it.until(lambda message: message["type"] == "Status" and not message["note"])
        simulation.stop()
        simulation.world.close()


def test_scene_cameras_are_drawn_for_who_cannot(gl: str, one: Guest, simulation: Simulation) -> None:
    one.ask("SetCamera", camera="Bird's Eye", width=320)
    driven = one.until("Rendered")
    later = one.until("Rendered")
    assert later["time"] > driven["time"]
    assert simplejpeg.decode_jpeg(later["jpeg"]).shape == (180, 320, 3)
    one.ask("Pause")
    one.ask("Reset")
    while one.until("Rendered")["time"] > 0.0:  # the last Frame before a pause is drawn too
        pass
    one.ask("SetCamera", camera=None)
    one.ask("Resume")
    seen = [one.hear()["type"] for _ in range(30)]
    assert "Rendered" not in seen[10:]


def test_scene_cameras_go_on_in_another_scenario(gl: str, one_world: World) -> None:
    one_world.reset(0)
    simulation = Simulation(one_world, load=autodrive.make)
    scenarios = {"two_cars": "Two cars"}
    with Server(simulation, scenery=scenery, scenarios=scenarios, port=free_port()) as server, simulation:
        with guest(server) as it:
            it.ask("SetCamera", camera="Driver's Eye", width=160)
            it.until("Rendered")
            assert it.ask("LoadScenario", name="two_cars")["type"] == "Done"
            it.until("Rendered")  # it may be the last of the world before
            it.until("Frame")
            it.until("Rendered")
        simulation.stop()
        simulation.world.close()
