"""Damaged, truncated, foreign and newer files: a clear error, or a partial and honest result."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.writer import Writer

import autodrive
from autodrive import AutodriveError, Command
from autodrive.recording import Recorder, RecordingError, mcap, records
from autodrive.recording import open as open_recording
from autodrive.recording.wire import pool_of
from tests.support.frames import digest
from tests.support.hardening import LONG, cases

MUTATIONS = cases(40, 10_000)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """At least three chunks, without meshes; in the long form with images."""
    path = tmp_path_factory.mktemp("damaged") / "small.mcap"
    world = autodrive.make("plane", cameras="small" if LONG else False)
    with Recorder(path, world, image_quality=5, has_meshes=False) as recorder:
        for tick in range(45):
            world.step({"V1": Command(0.5)})
            if tick % 15 == 14:
                recorder.output.flush()
    return path


def read_all(path: Path) -> None:
    with open_recording(path) as recording:
        for frame in recording.frames():
            _ = [vehicle.cameras.items() for vehicle in frame.vehicles.values()]
        recording.frame_at(0.2)
        for name in ("V1/imu/euler", "V1/lidar/ranges", "V1/range/range"):
            _ = recording[name]
        _ = recording.events, recording.scenarios, list(recording.commands), list(recording.requests)
        for name in recording.attachments:
            recording.attachment(name)


def test_a_truncated_file_gives_its_whole_chunks_or_an_error(small: Path, tmp_path: Path) -> None:
    data, path = small.read_bytes(), tmp_path / "cut.mcap"
    lengths, errors = [], []
    with open_recording(small) as whole:
        frames = [digest(frame) for frame in whole.frames()]
    for percent in range(100):
        path.write_bytes(data[: len(data) * percent // 100])
        found: list[str] = []
        try:
            with open_recording(path) as recording:
                assert recording.problems
                found += [digest(frame) for frame in recording.frames()]
                _ = recording.duration
        except RecordingError as error:
            errors.append(str(error))
        assert found == frames[: len(found)]
        lengths.append(len(found))
    assert all(str(path) in error for error in errors)
    assert lengths == sorted(lengths)
    assert lengths[50] > 0
    assert 46 not in lengths[:60]


def test_a_damaged_index_of_messages_loses_nothing(small: Path, tmp_path: Path) -> None:
    """The messages of a chunk are then found from record to record."""
    path = tmp_path / "index.mcap"
    with open_recording(small) as whole:
        frames = [digest(frame) for frame in whole.frames()]
    with contextlib.closing(mcap.Reader(small)) as file:
        places = {at for chunk in file.chunks for at in chunk.places["place"].tolist()}
    assert len(places) > 10
    for offset in (0, 9 + 2 + 4 + 8, 9 + 2):  # kind of the record, place of the first message, length of the index
        data = bytearray(small.read_bytes())
        for at in places:
            data[at + offset] ^= 0x20
        path.write_bytes(data)
        with open_recording(path) as recording:
            assert [digest(frame) for frame in recording.frames()] == frames
            assert recording.problems == []


def test_a_mutated_file_neither_crashes_nor_hangs(small: Path, tmp_path: Path) -> None:
    """Bytes are changed, removed, repeated and inserted."""
    data, path, numbers = small.read_bytes(), tmp_path / "mutated.mcap", random.Random(1)
    for _ in range(MUTATIONS):
        mutated = bytearray(data)
        for _ in range(numbers.choice((1, 1, 2, 8, 64))):
            at, size = numbers.randrange(len(mutated)), numbers.choice((1, 1, 4, 8, 100))
            match numbers.randrange(4):
                case 0:
                    mutated[at : at + size] = numbers.randbytes(len(mutated[at : at + size]))
                case 1:
                    del mutated[at : at + size]
                case 2:
                    mutated[at:at] = mutated[at : at + size]
                case _:
                    mutated[at] ^= 1 << numbers.randrange(8)
        path.write_bytes(mutated)
        with contextlib.suppress(AutodriveError):
            read_all(path)


def test_a_foreign_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "other program")
        writer.finish()
    for content, reason in (
        (None, "written by 'other program'"),
        (b"", "is empty"),
        (b"PK\x03\x04" * 9, "not an MCAP"),
    ):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(RecordingError, match=reason):
            open_recording(path)
    with pytest.raises(RecordingError, match="No such file"):
        open_recording(tmp_path / "missing.mcap")
    with pytest.raises(RecordingError, match="cannot read"):
        open_recording(tmp_path)


def test_a_file_of_a_newer_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "newer.mcap"
    monkeypatch.setattr(records, "FORMAT", 3)
    Recorder(path, autodrive.make("plane"), has_meshes=False).close()
    monkeypatch.undo()
    with pytest.raises(RecordingError, match="in format 3; this version reads formats up to 2: install a newer"):
        open_recording(path)


def test_an_older_file_without_a_field_has_its_default(small: Path) -> None:
    """Field numbers come from the schema in the file, so that a later version may add fields anywhere."""
    with contextlib.closing(mcap.Reader(small)) as file, open_recording(small) as recording:
        name = "autodrive.VehicleFrame"
        schema = next(one.data for one in file.schemas.values() if one.name == name)
        older = FileDescriptorSet.FromString(schema)
        (frame,) = (one for file in older.file for one in file.message_type if one.name == "VehicleFrame")
        (place,) = (i for i, one in enumerate(frame.field) if one.name == "range")
        del frame.field[place]
        states = records.States({name: pool_of(older.SerializeToString())})
        (data, *_) = recording.messages_of(records.state_topic("V1"))
        values = states.decode_vehicle(data)
    assert values["range"] is None
    assert values["collision_count"] == 0


def test_missing_meshes_are_named(small: Path) -> None:
    with open_recording(small) as recording, pytest.raises(RecordingError, match=r"no attachment 'map\.glb'"):
        recording.attachment("map.glb")
