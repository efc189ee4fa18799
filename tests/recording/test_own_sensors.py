"""Sensors of the user in a recording: their readings come back, and are simulated again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command, Frame
from autodrive.protocol.codec import encode
from autodrive.recording import Recorder, RecordingError
from autodrive.recording import open as open_recording
from autodrive.recording.plot import plot
from autodrive.recording.resimulation import resimulate
from tests.support.command_line import call
from tests.support.radar import Radar, radar_scenario

SENSORS = {"V1": {"radar": Radar, "late": Radar}}


@pytest.fixture
def drive(tmp_path: Path) -> tuple[Path, list[Frame]]:
    """A sensor from the start, one that is added on the way, a reset, and an edit of the scenario."""
    world = autodrive.make(radar_scenario(tmp_path))
    path = tmp_path / "drive.mcap"
    with Recorder(path, world, has_meshes=False):
        frames = [world.frame]
        for tick in range(60):
            if tick == 23:
                world.add_sensor("V1", "late", Radar())
                frames.append(world.frame)
            if tick == 41:
                frames.append(world.reset(8))
            frames.append(world.step({"V1": Command(0.5, 0.1)}))
    return path, frames


def test_frames_with_readings_come_back_bit_by_bit(drive: tuple[Path, list[Frame]]) -> None:
    path, frames = drive
    with open_recording(path) as recording:
        assert recording.own_sensors("V1") == {"late": Radar.columns, "radar": Radar.columns}
        assert [encode(frame.vehicles) for frame in recording.frames()] == [encode(frame.vehicles) for frame in frames]
        assert encode(recording.frame_at(0.5).vehicles) == encode(frames[52].vehicles)


def test_readings_are_signals_and_columns_of_a_table(drive: tuple[Path, list[Frame]]) -> None:
    path, frames = drive
    with open_recording(path) as recording:
        radar = {id(reading): reading for reading in (frame.vehicles["V1"].own["radar"] for frame in frames)}.values()
        np.testing.assert_array_equal(recording["V1/own/radar"], [reading.values for reading in radar])
        assert len(recording.signals.times("V1/own/radar")) == len(radar)
        signal = recording.signals.described["V1/own/radar"]
        assert (signal.elements, signal.unit) == (("distance", "speed", "sample"), "")
        columns = recording.columns("V1")
        expected = [frame.vehicles["V1"].own["radar"].values[0] for frame in frames]
        assert columns["own.radar.distance"].tolist()[:24] == expected[:24]
        late = columns["own.late.sample"]
        assert np.isnan(late[:23]).all()
        assert late[24:].tolist() == [frame.vehicles["V1"].own["late"].values[2] for frame in frames[24:]]
        plot(recording, ["V1/own/radar"], path.with_suffix(".svg"))
    assert ">distance</text>" in path.with_suffix(".svg").read_text(encoding="utf-8")


def test_a_recording_with_sensors_is_simulated_again(drive: tuple[Path, list[Frame]]) -> None:
    path, frames = drive
    with open_recording(path) as recording:
        result = resimulate(recording, SENSORS)
        assert str(result) == "identical"
        assert result.frames == len(frames)

        class Other(Radar):
            def sample(self, view, random):  # type: ignore[no-untyped-def]
                return super().sample(view, random) + np.array([1e-12, 0.0, 0.0])

        difference = resimulate(recording, {"V1": {"radar": Other, "late": Radar}}).difference
        assert difference is not None
        assert difference.signal == "vehicles.V1.own.radar.values[0]"


def test_a_recording_does_not_run_the_code_of_a_sensor(drive: tuple[Path, list[Frame]]) -> None:
    path, _ = drive
    with open_recording(path) as recording:
        with recording.scenario_spec() as spec:
            assert autodrive.make(spec).frame.vehicles["V1"].own == {}
        with pytest.raises(
            RecordingError, match="sensor 'radar' of the user on vehicle 'V1', whose code is not in the"
        ):
            resimulate(recording)


def test_the_command_takes_the_classes_of_sensors(drive: tuple[Path, list[Frame]]) -> None:
    path, _ = drive
    file = path.with_name("my_radar.py")
    sensors = [f"--sensor=V1/{name}={file}:Radar" for name in ("radar", "late")]
    done = call("replay", path, "--resimulate", *sensors)
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "identical")
    assert "V1/NAME=FILE.py:CLASS" in call("replay", path, "--resimulate", "--sensor=V1/radar").stderr
