"""The server of a replay: what clients receive, and what they are refused."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from autodrive.connect.server.served import PageOptions
from autodrive.recording.replay import Replay, ReplayOptions
from tests.recording.conftest import Drive
from tests.support.native_clients import NativeClient, native_client


@pytest.fixture
def replay(drive: Drive) -> Iterator[Replay]:
    with Replay(drive.path, ReplayOptions(is_paused=True, page=PageOptions(port=0))) as running:
        yield running


@pytest.fixture
def client(replay: Replay) -> Iterator[NativeClient]:
    with native_client(replay.server) as one:
        yield one


def test_a_client_gets_the_scene_with_the_timeline(replay: Replay, client: NativeClient, drive: Drive) -> None:
    scene = client.until("Scene")
    assert scene["scenario"] == "four_cars"
    assert list(scene["vehicles"]) == list(drive.frames[0].vehicles)
    timeline = scene["timeline"]
    assert (timeline["name"], timeline["duration"]) == ("drive.mcap", replay.tape.duration)
    kinds = [type(event).__name__ for frame in drive.frames for event in frame.events]
    assert [mark["event"]["type"] for mark in timeline["marks"]] == kinds
    times = [mark["time"] for mark in timeline["marks"]]
    assert times == sorted(times)
    assert times[-1] > drive.frames[-1].time  # a reset sets the time of the events back, and not that of the marks


def test_all_viewers_see_the_same_time(replay: Replay, client: NativeClient, drive: Drive) -> None:
    with native_client(replay.server) as other:
        for one in (client, other):
            one.until("Frame")
        answer = client.ask("Seek", time=1.2)
        assert answer["frame"]["tick"] == 120
        frame = other.until(lambda message: message["type"] == "Frame" and message["tick"] == 120)
        assert frame["vehicles"]["V1"]["pose"]["position"] == tuple(drive.frames[120].vehicles["V1"].pose.position)
        status = other.until(lambda message: message["type"] == "Status" and message["position"] == 1.2)
        assert status["is_paused"]


def test_drivers_and_requests_are_refused_with_a_sentence(client: NativeClient) -> None:
    client.until("Frame")
    for source in ("person", "script"):
        client.send("Drive", vehicle="V1", command={"throttle": 1.0}, source=source)
    assert "the recorded commands drive" in client.error("request")
    assert "nothing can be changed" in client.ask("Reset")["text"]
    assert "without a bridge" in client.ask("ConnectBridge")["text"]
    assert "started without recordings" in client.ask("StartRecording")["text"]


def test_vehicles_are_described_as_in_a_simulation(client: NativeClient) -> None:
    assert '<robot name="nigel">' in client.ask("DescribeVehicle", vehicle="V1")["text"]
    assert "vehicle 'V9' is not known. Known: V1" in client.ask("DescribeVehicle", vehicle="V9")["text"]


def test_plots_come_with_the_response(client: NativeClient, drive: Drive) -> None:
    answer = client.ask("PlotRecording", vehicle="V1", plots=["speed"], start=0.0, end=1.0, columns=50)
    curve = answer["curves"]["speed"]
    speeds = [frame.vehicles["V1"].speed for frame in drive.frames[:101]]
    assert max(curve["high"]) == pytest.approx(max(speeds))
    assert np.isfinite(curve["low"]).all()


def test_sensor_images_that_were_not_recorded_are_drawn(gl: str, replay: Replay, client: NativeClient) -> None:
    client.send("Subscribe", frame_rate=60.0, picture_rate=10.0, picture_width=160)
    first = client.until("Picture")
    client.ask("Seek", time=1.2)
    later = client.until(lambda message: message["type"] == "Picture" and message["time"] == pytest.approx(1.2))
    assert first["jpeg"][:2] == later["jpeg"][:2] == b"\xff\xd8"
    assert first["jpeg"] != later["jpeg"]
