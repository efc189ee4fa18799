"""A recording gives back what happened, and other programs read it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from mcap.decoder import DecoderFactory
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder

import autodrive
from autodrive import Command
from autodrive.graphics.meshes.urdf import PACKAGE
from autodrive.protocol.messages import Reset, SetSceneLight
from autodrive.recording import Recorder, Recording, RecordingError
from autodrive.recording import open as open_recording
from tests.recording.conftest import Drive
from tests.support.frames import digest


def test_frames_come_back_bit_by_bit(drive: Drive, recording: Recording) -> None:
    assert [digest(frame) for frame in recording.frames()] == [digest(frame) for frame in drive.frames]
    assert (recording.start_tick, recording.end_tick) == (0, drive.frames[-1].tick)
    assert recording.duration == pytest.approx(1.5 + drive.frames[-1].time)
    assert recording.problems == []


def test_a_frame_is_found_by_its_time(drive: Drive, recording: Recording) -> None:
    for time, place in ((1.234, 123), (-5.0, 0), (math.inf, -1)):
        assert digest(recording.frame_at(time)) == digest(drive.frames[place])
    assert recording.frame_at(1.5).scene_light is False  # the last of four Frames at this time, after the reset
    assert [frame.tick for frame in recording.frames(0.5, 0.52)] == [50, 51, 52]


def test_events_commands_and_requests_come_back(drive: Drive, recording: Recording) -> None:
    happened = [event for frame in drive.frames for event in frame.events]
    assert happened
    assert [digest(one.event) for one in recording.events] == [digest(event) for event in happened]
    first = next(one for _, one in recording.commands)
    assert first.tick == 0
    assert first.commands["V2"] == Command(0.4)
    requests = [one.request for _, one in recording.requests]
    assert requests[0] == Reset(11)
    assert requests[2] == SetSceneLight(False)
    assert recording.next_event(0.0) == recording.events[0]
    assert recording.next_event(recording.end) is None
    assert recording.scenario.spec["seed"] == 7
    assert "map/tiny_town" in recording.scenario.files or "map/mini_map" in recording.scenario.files


def test_signals_are_those_of_the_frames(drive: Drive, recording: Recording) -> None:
    frames = drive.frames
    assert len(recording.times) == len(frames)
    for name, signal in recording.signals.described.items():
        values, times = recording[name], recording.signals.times(name)
        assert len(values) == len(times), name
        if name.startswith("V2/") and "lidar" not in name:
            if signal.read(frames[0].vehicles["V2"]) is None:
                assert np.isnan(values).all(), name
                continue
            expected = np.array([signal.read(frame.vehicles["V2"]) for frame in frames])
            np.testing.assert_array_equal(values, expected, err_msg=name)
    scans = recording["V1/lidar/ranges"]
    assert scans.shape == (len(recording.signals.times("V1/lidar/ranges")), 360)
    with pytest.raises(RecordingError, match="Did you mean 'V1/ips/position'"):
        recording["V1/ips/positions"]


class JsonDecoder(DecoderFactory):
    """As in docs/recordings.md."""

    def decoder_for(self, message_encoding: str, schema: Any) -> Any:
        return json.loads if message_encoding == "json" else None


def test_the_reader_of_mcap_reads_everything(drive: Drive) -> None:
    """An independent reader, with the schemas in the file."""
    found: dict[str, list[Any]] = {}
    with drive.path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[JsonDecoder(), ProtobufDecoder()], validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        for decoded in reader.iter_decoded_messages():
            assert decoded.schema is not None
            found.setdefault(decoded.channel.topic, []).append(decoded.decoded_message)
        assert sum(map(len, found.values())) == summary.statistics.message_count
        assert {one.name for one in reader.iter_metadata()} == {"autodrive"}
        attachments = {one.name: one for one in reader.iter_attachments()}
    assert [one.data[:4] for name, one in attachments.items() if name.endswith(".glb")] == [b"glTF"] * 3
    (urdf,) = [one for name, one in attachments.items() if name.endswith(".urdf")]  # of four equal cars
    assert found["/autodrive/scenario"][0]["attachments"]["urdf/V4"] == urdf.name == "urdf/nigel.urdf"
    robot = ElementTree.fromstring(urdf.data)
    paths = {one.attrib["filename"] for one in robot.iter("mesh")}
    assert paths == {f"package://{PACKAGE}/{name}" for name in attachments if name.endswith(".stl")}
    assert len(paths) > 10
    frame = drive.frames[100]
    state = found["/V1/state"][100]
    assert list(state.imu.linear_acceleration) == frame.vehicles["V1"].imu.linear_acceleration.tolist()
    assert state.lights.indicators == 1
    assert state.cameras == {}
    assert set(found["/autodrive/frame"][100].objects) == set(frame.objects)
    scan = found["/V1/lidar"][3]
    assert len(scan.ranges) == 360
    assert scan.end_angle == pytest.approx(scan.start_angle + 359 * scan.angle_increment)
    assert {one.child_frame_id for one in found["/tf"][0].transforms} >= {"V1", "V4", "V1/lidar"}


def test_images_are_decoded_when_they_are_read(tmp_path: Path) -> None:
    world = autodrive.make("plane", cameras="small")
    path = tmp_path / "images.mcap"
    with Recorder(path, world, image_quality=90):
        for _ in range(20):
            world.step({"V1": Command(0.5)})
    with open_recording(path) as recording:
        frame = recording.frame_at(0.2)
        images, original = frame.vehicles["V1"].cameras, world.frame.vehicles["V1"].cameras
        assert recording.cameras("V1") == tuple(original)
        for camera, image in original.items():
            again = images[camera]
            assert again.time == image.time
            assert again.intrinsics == image.intrinsics
            difference = np.abs(again.rgba.astype(int) - image.rgba.astype(int))
            assert difference.mean() < 3.0  # of 255: JPEG of quality 90
            pictures = list(recording.pictures("V1", camera))
            assert pictures[-1][1].jpeg[:2] == b"\xff\xd8"
            latest = recording.picture_at("V1", camera, 0.2)
            assert latest is not None
            assert latest.jpeg == pictures[-1][1].jpeg
        with pytest.raises(KeyError):
            images["roof"]


def test_frames_at_a_lower_rate_keep_all_events(drive: Drive, tmp_path: Path) -> None:
    world = autodrive.make("plane")
    path = tmp_path / "slow.mcap"
    with Recorder(path, world, frame_rate=10.0, has_meshes=False):
        for _ in range(100):
            world.step({"V1": Command(1.0)})
    with open_recording(path) as recording:
        assert len(recording.times) == 11
        np.testing.assert_allclose(np.diff(recording.times), 0.1)
        assert len(list(recording.commands)) == 100
