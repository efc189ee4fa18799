"""Exports for learning libraries and for Rerun, read back by pyarrow, PyAV, Minari and Rerun."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import av
import minari
import numpy as np
import pandas
import pyarrow.parquet as pq
import pytest

import autodrive
from autodrive import Command, ScenarioSpec
from autodrive.recording import Moment, Recorder, Recording, RecordingError
from autodrive.recording import open as open_recording
from autodrive.recording.exports import export
from autodrive.recording.exports.learning import ACTION, STATE, steps
from autodrive.recording.exports.options import ExportOptions
from autodrive.scenario import VehiclePlacement
from tests.support.cars import car_file, small_images


def test_lerobot_layout_is_complete(lap: Recording, tmp_path: Path) -> None:
    folder = export(lap, "lerobot", tmp_path / "lerobot", ExportOptions(rate=20.0))
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_frames"]) == ("v3.0", 20, 21)
    data = pq.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0)).to_pydict()
    np.testing.assert_allclose(data["timestamp"], np.arange(21) / 20.0, atol=1e-6)  # float32
    state = np.array(data["observation.state"])
    np.testing.assert_array_equal(
        state[:, STATE.index("position.x")], lap["V1/ips/position"][::5, 0].astype(np.float32)
    )
    action = np.array(data["action"])
    np.testing.assert_array_equal(action[:, 0], np.float32(0.8))
    assert action[10, 1] == 0.0
    assert action[11, 1] == np.float32(0.2)  # the command of tick 55
    episodes = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(one["episode_index"], one["length"], one["dataset_to_index"]) for one in episodes] == [(0, 21, 21)]
    # what LeRobot does: the task of a step is the name of a row of a data frame
    task = pandas.read_parquet(folder / "meta/tasks.parquet").iloc[data["task_index"][20]].name
    assert [task] == episodes[0]["tasks"] == ["drive: Mini-map"]
    stats = json.loads((folder / "meta/stats.json").read_text())
    assert stats["action"]["count"] == [21]
    np.testing.assert_allclose(stats["action"]["q10"], np.quantile(action, 0.1, axis=0))
    assert episodes[0]["stats/action/mean"] == stats["action"]["mean"]
    video = info["video_path"].format(video_key="observation.images.front", chunk_index=0, file_index=0)
    with av.open(str(folder / video)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 21
    assert [*frames[0].shape] == info["features"]["observation.images.front"]["shape"]
    of_front = stats["observation.images.front"]  # channels from 0 to 1, shape (3, 1, 1); LeRobot requires them
    np.testing.assert_allclose(of_front["mean"], np.mean(frames, axis=(0, 1, 2))[:, None, None] / 255.0, atol=0.01)
    assert (np.shape(of_front["std"]), of_front["count"]) == ((3, 1, 1), [21])
    image = lap.frame_at(1.0).vehicles["V1"].cameras["front"].rgb
    assert np.abs(frames[-1].astype(int) - image.astype(int)).mean() < 8.0  # of 255: the video is compressed again


def test_videos_of_lerobot_have_the_colours_and_the_size_that_the_dataset_says(tmp_path: Path) -> None:
    """A camera whose images have an odd width: the video, the dataset and the container agree on the padded size."""
    vehicles = {"V1": VehiclePlacement(type=car_file(tmp_path, small_images(79, 60)))}
    world = autodrive.make(ScenarioSpec(map="plane", vehicles=vehicles), cameras="small")
    with Recorder(tmp_path / "odd.mcap", world, has_meshes=False):
        for _ in range(8):
            world.step()
    image = world.frame.vehicles["V1"].cameras["front"].rgb
    with open_recording(tmp_path / "odd.mcap") as recording:
        folder = export(recording, "lerobot", tmp_path / "odd")
    info = json.loads((folder / "meta/info.json").read_text())
    feature = info["features"]["observation.images.front"]
    assert (feature["shape"], feature["info"]["video.width"], image.shape) == ([60, 80, 3], 80, (60, 79, 3))
    with av.open(str(folder / "videos/observation.images.front/chunk-000/file-000.mp4")) as container:
        frame = next(container.decode(video=0))
    assert (frame.width, frame.height, frame.colorspace, frame.color_range) == (80, 60, 1, 1)
    decoded = frame.to_ndarray(format="rgb24")[:, :79].astype(float)
    np.testing.assert_allclose(decoded.mean(axis=(0, 1)), image.mean(axis=(0, 1)), atol=2.0)


class WithGap(ExportOptions):
    """Options for a recording without the Frames from 0.35 s to 0.75 s."""

    def moments(self, recording: Recording, rate: float | None) -> Iterator[Moment]:
        return (one for one in super().moments(recording, rate) if not 0.35 < one.time < 0.75)


def test_an_episode_ends_with_a_reset_and_at_a_gap_and_the_action_is_what_the_vehicle_obeys(tmp_path: Path) -> None:
    """A command is obeyed for 0.5 s; a reset is between two steps."""
    path = tmp_path / "parts.mcap"
    world = autodrive.make("plane")
    with Recorder(path, world, has_meshes=False):
        world.step({"V1": Command(0.4, 0.2)})
        for _ in range(112):
            world.step()
        world.step({"V1": Command(0.8)})
        world.reset()
        for _ in range(10):
            world.step()
    with open_recording(path) as recording:
        found = list(steps(recording, ExportOptions(), 10.0))
        np.testing.assert_allclose([one.time for one in found], np.arange(13) / 10.0)
        np.testing.assert_allclose([one.action[0] for one in found], [0.4] * 5 + [0.0] * 8)
        assert [one.episode for one in found] == [0] * 12 + [1]
        assert [one.episode for one in steps(recording, WithGap(), 10.0)] == [0] * 4 + [1] * 4 + [2]
        with pytest.raises(RecordingError, match=r"a Frame every 0.01 s: choose a rate of at most 100 Hz"):
            export(recording, "lerobot", tmp_path / "fast", ExportOptions(rate=200.0))
        with pytest.raises(RecordingError, match=r"a whole number of steps in a second, not 12.5"):
            export(recording, "lerobot", tmp_path / "broken", ExportOptions(rate=12.5))


def test_minari_loads_the_dataset_from_absolute_and_relative_paths(
    lap: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("lap.mcap").symlink_to(lap.path)
    with open_recording("lap.mcap") as recording:
        assert export(recording, "minari") == Path("lap_minari")
        export(recording, "minari", "drives/lap")
    export(lap, "minari", tmp_path / "drives" / "absolute", ExportOptions(rate=20.0))
    for folder, name in (("lap_minari", "lap-minari"), ("drives/lap", "lap"), ("drives/absolute", "absolute")):
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / folder))
        dataset = minari.load_dataset(f"autodrive/{name}-v0")
        assert (dataset.total_episodes, dataset.total_steps) == (1, 20)
        (episode,) = dataset.iterate_episodes()
        assert episode.observations.shape == (21, len(STATE))
        assert episode.actions.shape == (20, len(ACTION))
        np.testing.assert_array_equal(episode.observations[:, 3], lap["V1/velocity"][::5, 0].astype(np.float32))
        assert episode.truncations[-1]


def test_a_failed_export_names_the_file(lap: Recording, tmp_path: Path) -> None:
    folder = tmp_path
    while len(str(folder)) < 3900:
        folder /= "x" * 180
    # the folder can have this path, and be in another one meanwhile; a file in it cannot
    folder /= "y" * (4095 - len(str(folder)) - 8 - len("/.autodrive-abcdefgh"))
    with pytest.raises(RecordingError, match=r"^cannot write: File name too long  \(.*/y+/[\w.]+\)$"):
        export(lap, "csv", folder)


@pytest.mark.process
def test_rerun_reads_its_file(lap: Recording, tmp_path: Path) -> None:
    path = export(lap, "rerun", tmp_path / "lap.rrd", ExportOptions(start=0.5, end=0.7))
    command = [sys.executable, "-m", "rerun_cli"]
    subprocess.run([*command, "rrd", "verify", str(path)], timeout=120, check=True)
    shown = subprocess.run(
        [*command, "rrd", "stats", str(path)], capture_output=True, text=True, timeout=120, check=True
    )
    assert "num_rows_max = 21\n" in shown.stdout  # the curves have the Frames from 0.5 s to 0.7 s
    for entity in ("/world/V1/lidar", "/images/V1/front", "/signals/V1/velocity", "/world/map"):
        assert entity in shown.stdout
