"""A recorder does not disturb the simulation, and leaves readable files behind."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
import zstandard
from msgspec.structs import replace

import autodrive
from autodrive import Command, Simulation
from autodrive.protocol.messages import CameraImage, CameraIntrinsics, Collision, Pose
from autodrive.recording import Recorder, RecordingError, mcap
from autodrive.recording import open as open_recording
from autodrive.recording.resimulation import resimulate
from autodrive.run import RunOptions, simulate
from tests.support.frames import digest
from tests.support.waiting import wait_until


def test_a_run_is_recorded_and_simulated_again(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    summary = simulate(RunOptions(duration=1.0, speed=None, seed=3, has_page=False, record=path))
    assert summary.recording is not None
    assert summary.recording.files == [str(path)]
    assert summary.recording.error == ""
    with open_recording(path) as recording:
        assert recording.duration == pytest.approx(1.0)
        assert recording.scenario.name == "mini_map"
        assert recording.scenario.spec["seed"] == 3
        assert len(list(recording.statuses)) >= 1
        assert str(resimulate(recording)) == "identical"


def test_a_closed_recorder_hears_nothing_more(tmp_path: Path) -> None:
    world = autodrive.make("plane")
    recorder = Recorder(tmp_path / "a.mcap", world, has_meshes=False)
    world.step()
    recorder.close()
    recorder.close()
    size = (tmp_path / "a.mcap").stat().st_size
    world.step()
    assert (tmp_path / "a.mcap").stat().st_size == size
    assert world.observers == []


def test_the_last_seconds_are_written_at_a_collision(tmp_path: Path) -> None:
    path = tmp_path / "crash.mcap"
    world = autodrive.make("mini_map")
    with Recorder(path, world, last=2.0, has_meshes=False) as recorder:
        world.teleport("V1", 1.0, 0.75 - 0.4, 0.7)  # towards the box 'corner_2'
        while not any(isinstance(event, Collision) for event in world.step({"V1": Command(1.0)}).events):
            assert world.time < 20.0
        hit = world.time
        for _ in range(150):
            world.step()
        assert recorder.files == [tmp_path / "crash-001.mcap"]
        recorder.save()
    assert not path.exists()
    assert recorder.files[1:] == [tmp_path / "crash-002.mcap"]
    with open_recording(recorder.files[0]) as recording:
        assert recording.end == pytest.approx(hit + 1.0, abs=0.011)
        assert recording.duration >= min(2.0, hit)
        assert any(isinstance(event.event, Collision) for event in recording.events)
        assert list(recording.frames())[-1].tick == recording.end_tick
        assert recording.scenario.spec["map"] == "mini_map"


def test_a_file_that_cannot_be_written_is_an_error_at_once(tmp_path: Path) -> None:
    world = autodrive.make("plane")
    for path in (tmp_path / "no" / "folder.mcap", tmp_path):
        with pytest.raises(RecordingError, match="cannot write"):
            Recorder(path, world)
    world.step()


def test_chunks_that_are_mostly_images_get_little_compression(tmp_path: Path) -> None:
    path, data = tmp_path / "a.mcap", [bytes(i * k % 251 for k in range(3000)) for i in range(1, 30)]
    contents: list[bytes] = []
    with path.open("wb") as file:
        writer = mcap.Writer(file, file.write(mcap.header("")))
        for share in (0, 10, 20):  # of the messages
            chunk = mcap.Chunk()
            for i, text in enumerate(data):
                chunk.add(mcap.McapMessage(1, i, i, 0, text), is_packed=i < share)
            contents.append(bytes(chunk.data))
            writer.chunk(chunk)
        writer.finish()
    written = path.read_bytes()
    for content, level in zip(contents, (mcap.LEVEL, mcap.LEVEL, mcap.PACKED_LEVEL), strict=True):
        assert zstandard.ZstdCompressor(level=level).compress(content) in written
    reader = mcap.Reader(path)
    assert [[record.data for record in reader.messages(i)] for i in range(3)] == [data] * 3
    reader.close()


def test_a_slow_disk_drops_images_and_frames_but_no_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    is_free, write = threading.Event(), mcap.Writer.chunk

    def slow(self: mcap.Writer, chunk: mcap.Chunk) -> None:
        is_free.wait()
        write(self, chunk)

    monkeypatch.setattr(mcap.Writer, "chunk", slow)
    monkeypatch.setattr("autodrive.recording.recorder.MAX_QUEUE", 20)
    monkeypatch.setattr("autodrive.recording.outputs.CHUNK_SIZE", 1)
    simulation = Simulation(autodrive.make("plane"), speed=1e3)
    is_free.set()
    with Recorder(tmp_path / "slow.mcap", simulation, has_meshes=False) as recorder:
        is_free.clear()
        for _ in range(300):
            simulation.submit("V1", Command(0.5))
            simulation.run(0.01)
        is_free.set()
    assert recorder.dropped_frames > 200
    with open_recording(tmp_path / "slow.mcap") as recording:
        assert len(list(recording.commands)) == 300
        assert len(recording.times) == 301 - recorder.dropped_frames
        assert str(resimulate(recording)) == "identical"


def test_an_image_waits_once_for_the_disk_and_after_left_out_images_others_are_recorded(tmp_path: Path) -> None:
    """In real time: several Frames show the same image, and eight images of a camera may wait."""
    simulation = Simulation(autodrive.make("plane"), speed=1.0)
    first = simulation.world.frame
    ticks = itertools.count(1)

    def publish(number: int) -> None:
        """Three Frames with a new image."""
        image = CameraImage(
            0.03 * number,
            Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])),
            CameraIntrinsics(64, 48, 50.0, 50.0, 32.0, 24.0),
            np.full((48, 64, 4), 255, np.uint8),
        )
        vehicle = replace(first.vehicles["V1"], cameras={"front": image})
        for tick in itertools.islice(ticks, 3):
            recorder.publish(replace(first, tick=tick, time=0.01 * tick, vehicles={"V1": vehicle}))

    with Recorder(tmp_path / "images.mcap", simulation, has_meshes=False) as recorder:
        for number in range(8):
            publish(number)
        assert recorder.dropped_images == 0
        number = 8
        while number < 100:
            publish(number)
            number += 1
        left_out = recorder.dropped_images
        assert left_out > 0

        def is_recorded_again() -> bool:
            nonlocal number, left_out
            before = left_out
            publish(number)
            number += 1
            left_out = recorder.dropped_images
            return left_out == before

        wait_until(is_recorded_again)
    with open_recording(tmp_path / "images.mcap") as recording:
        times = [picture.time for _, picture in recording.pictures("V1", "front")]
    assert times[:8] == pytest.approx(0.03 * np.arange(8.0))
    assert times[-1] == pytest.approx(0.03 * (number - 1))
    assert len(times) == number - left_out


def test_a_recording_that_has_begun_has_its_scenario(tmp_path: Path) -> None:
    """In real time, too, where another thread writes: the process may be killed at any time."""
    simulation = Simulation(autodrive.make("plane"), speed=1.0)
    with Recorder(tmp_path / "begun.mcap", simulation, has_meshes=False):
        (tmp_path / "killed.mcap").write_bytes((tmp_path / "begun.mcap").read_bytes())
    with open_recording(tmp_path / "killed.mcap") as recording:
        assert recording.scenario.spec == simulation.world.spec.model_dump(mode="json") | {"seed": 0}
        assert [frame.tick for frame in recording.frames()] == [0]


@pytest.mark.process
def test_a_killed_process_leaves_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    code = (
        "import autodrive, sys\n"
        "from autodrive import Command, Simulation\n"
        "from autodrive.recording import Recorder\n"
        "simulation = Simulation(autodrive.make('plane'), speed=1.0)\n"
        "Recorder(sys.argv[1], simulation, has_meshes=False)\n"
        "simulation.start()\n"
        "while True:\n"
        "    simulation.wait(0.5)\n"
        "    print(simulation.frame.tick, flush=True)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        last = 0
        while last < 250:
            last = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
    with open_recording(path) as recording:
        assert "the file has no summary" in recording.problems[0]
        frames = list(recording.frames())
        assert [frame.tick for frame in frames] == list(range(len(frames)))
        assert len(frames) > last - 150  # at 1 s of wall time at most; half a second more for a busy machine


def test_a_recorded_world_gives_the_same_bits(tmp_path: Path) -> None:
    plain, recorded = autodrive.make("mini_map"), autodrive.make("mini_map")
    with Recorder(tmp_path / "a.mcap", recorded, has_meshes=False):
        for _ in range(20):
            assert digest(plain.step({"V1": Command(0.7)})) == digest(recorded.step({"V1": Command(0.7)}))


def test_the_period_of_a_recorded_rate_is_exact(tmp_path: Path) -> None:
    """The float 1.2 is a little less than 6/5: with its period, the seventh Frame would be that of 5.01 s."""
    path = tmp_path / "rate.mcap"
    world = autodrive.make("plane")
    with Recorder(path, world, frame_rate=1.2, has_meshes=False):
        for _ in range(520):
            world.step()
    with open_recording(path) as recording:
        times = [moment.time for moment in recording.moments()]
    assert times == pytest.approx([0.0, 0.84, 1.67, 2.5, 3.34, 4.17, 5.0])
