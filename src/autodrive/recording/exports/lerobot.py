"""A LeRobot dataset, version 3: Parquet for states and actions, MP4 for the cameras, JSON for the description.

The layout is that of `lerobot.datasets` v3.0: `meta/info.json`, `meta/stats.json`, `meta/tasks.parquet`,
`meta/episodes/chunk-000/file-000.parquet`, `data/chunk-000/file-000.parquet` and
`videos/observation.images.CAMERA/chunk-000/file-000.mp4`. We have checked it with pyarrow and PyAV, not with lerobot,
which needs PyTorch. As LeRobot's, the table of the tasks has the task as the index of its data frame, and statistics of
an image are those of its channels, from 0 to 1.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from autodrive.base.cache import make_folder, write_file
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.learning import ACTION, STATE, DatasetStep, checked, steps
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.film.video import Video
from autodrive.recording.recording import decoded

RATE = 30
"""Default rate of the steps [Hz]."""
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
"""Quantiles in the statistics, by name."""
MAX_IMAGES, PIXEL_STEP = 100, 8
"""The statistics of a camera are those of at most so many images, and of each 8th pixel of each 8th row."""


def write(recording: Recording, path: Path, options: ExportOptions, _: str) -> None:
    """Write the dataset of one vehicle; each part between resets is an episode."""
    rate = options.rate or RATE
    if rate != round(rate):
        raise RecordingError(f"a LeRobot dataset has a whole number of steps in a second, not {rate:g}")
    rate = round(rate)
    all_steps = checked(list(steps(recording, options, rate)))
    vehicle = options.vehicles(recording)[0]
    cameras = [
        camera for camera in recording.cameras(vehicle) if all(camera in step.images.times for step in all_steps[-1:])
    ]
    for folder in ("meta/episodes/chunk-000", "data/chunk-000"):
        make_folder(path / folder)
    task = f"drive: {recording.scenario.spec.get('title') or recording.scenario.name}"
    columns = _columns(all_steps, rate)
    pq.write_table(pa.table(columns), path / "data/chunk-000/file-000.parquet")
    pq.write_table(_tasks(task), path / "meta/tasks.parquet")
    videos = {camera: _write_video(path, camera, all_steps, rate) for camera in cameras}
    values = {
        name: np.array(column.to_pylist(), np.float64).reshape(len(all_steps), -1) for name, column in columns.items()
    }
    episodes = _episode_rows(columns, task, cameras, rate)
    episodes |= _episode_statistics(values, all_steps, cameras)
    pq.write_table(pa.table(episodes), path / "meta/episodes/chunk-000/file-000.parquet")
    write_file(path / "meta/stats.json", json.dumps(_statistics(values, all_steps, cameras), indent=2))
    write_file(path / "meta/info.json", json.dumps(_info(recording, vehicle, all_steps, rate, videos), indent=2))


def _tasks(task: str) -> pa.Table:
    """The table of the tasks, which pandas reads as a data frame with the task as its index."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": type_, "numpy_type": dtype, "metadata": None}
        for name, type_, dtype in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    described = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": [task]})
    return table.replace_schema_metadata({"pandas": json.dumps(described)})


def _columns(all_steps: Sequence[DatasetStep], rate: int) -> dict[str, Any]:
    _, firsts, episode = np.unique([step.episode for step in all_steps], return_index=True, return_inverse=True)
    frame = np.arange(len(all_steps)) - firsts[episode]
    return {
        "observation.state": pa.array([step.state for step in all_steps], pa.list_(pa.float32(), len(STATE))),
        "action": pa.array([step.action for step in all_steps], pa.list_(pa.float32(), len(ACTION))),
        "timestamp": pa.array((frame / rate).astype(np.float32)),
        "frame_index": pa.array(frame, pa.int64()),
        "episode_index": pa.array(episode, pa.int64()),
        "index": pa.array(range(len(all_steps)), pa.int64()),
        "task_index": pa.array([0] * len(all_steps), pa.int64()),
    }


def _episode_rows(columns: dict[str, Any], task: str, cameras: Sequence[str], rate: int) -> dict[str, Any]:
    numbers, first, lengths = np.unique(columns["episode_index"], return_index=True, return_counts=True)
    zeros = pa.array([0] * len(numbers), pa.int64())
    rows: dict[str, Any] = {
        "episode_index": pa.array(numbers, pa.int64()),
        "tasks": [[task]] * len(numbers),
        "length": pa.array(lengths, pa.int64()),
        "data/chunk_index": zeros,
        "data/file_index": zeros,
        "dataset_from_index": pa.array(first, pa.int64()),
        "dataset_to_index": pa.array(first + lengths, pa.int64()),
        "meta/episodes/chunk_index": zeros,
        "meta/episodes/file_index": zeros,
    }
    for camera in cameras:
        key = f"videos/observation.images.{camera}"
        rows |= {f"{key}/chunk_index": zeros, f"{key}/file_index": zeros}
        rows[f"{key}/from_timestamp"] = pa.array(first / rate, pa.float64())
        rows[f"{key}/to_timestamp"] = pa.array((first + lengths) / rate, pa.float64())
    return rows


def _write_video(path: Path, camera: str, all_steps: Sequence[DatasetStep], rate: int) -> dict[str, Any]:
    """One image for each step: the latest one, black before the first one; the description of the video."""
    target = path / f"videos/observation.images.{camera}/chunk-000"
    make_folder(target)
    last = all_steps[-1].images.picture(camera)
    assert last is not None
    height, width = decoded(last).rgba.shape[:2]
    pixels = np.zeros((height, width, 3), np.uint8)
    known = -1.0
    with Video(target / "file-000.mp4", (width, height), rate) as video:
        for step in all_steps:
            if step.images.times.get(camera, known) != known and (picture := step.images.picture(camera)) is not None:
                known, pixels = picture.time, decoded(picture).rgb
            video.write(pixels)
    return {
        "video.height": video.size[1],
        "video.width": video.size[0],
        "video.codec": video.codec,
        "video.pix_fmt": "yuv420p",
        "video.is_depth_map": False,
        "video.fps": rate,
        "video.channels": 3,
        "has_audio": False,
    }


Statistics: TypeAlias = dict[str, dict[str, list[Any]]]


def _statistics(
    values: Mapping[str, NDArray[np.float64]], all_steps: Sequence[DatasetStep], cameras: Sequence[str]
) -> Statistics:
    """Statistics of each feature, by its name and by the name of the statistic."""
    statistics = {name: _summary(column, len(column)) for name, column in values.items()}
    for camera in cameras:
        chosen = all_steps[:: -(-len(all_steps) // MAX_IMAGES)]
        pixels = [_pixels(step, camera) for step in chosen]
        summary = _summary(np.concatenate(pixels) / 255.0, len(pixels))
        shaped = {
            name: value if name == "count" else [[[channel]] for channel in value] for name, value in summary.items()
        }
        statistics[f"observation.images.{camera}"] = shaped
    return statistics


def _summary(rows: NDArray[np.float64], count: int) -> dict[str, list[Any]]:
    """Statistics of the columns, shape (n, k), of that many samples."""
    figures = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
    quantiles = np.quantile(rows, [*QUANTILES.values()], axis=0)
    figures |= dict(zip(QUANTILES, quantiles, strict=True))
    return {name: value.tolist() for name, value in figures.items()} | {"count": [count]}


def _pixels(step: DatasetStep, camera: str) -> NDArray[np.uint8]:
    """Some pixels of an image, shape (n, 3); one black pixel before the first image."""
    picture = step.images.picture(camera) if camera in step.images.times else None
    if picture is None:
        return np.zeros((1, 3), np.uint8)
    return decoded(picture).rgb[::PIXEL_STEP, ::PIXEL_STEP].reshape(-1, 3)


def _episode_statistics(
    values: Mapping[str, NDArray[np.float64]], all_steps: Sequence[DatasetStep], cameras: Sequence[str]
) -> dict[str, list[Any]]:
    """Columns with the statistics of each episode, such as 'stats/action/mean'."""
    columns: dict[str, list[Any]] = {}
    episode = values["episode_index"][:, 0]
    for number in np.unique(episode):
        (rows,) = np.nonzero(episode == number)
        by_feature = _statistics(
            {name: column[rows] for name, column in values.items()}, [all_steps[i] for i in rows.tolist()], cameras
        )
        for feature, statistics in by_feature.items():
            for name, value in statistics.items():
                columns.setdefault(f"stats/{feature}/{name}", []).append(value)
    return columns


def _info(
    recording: Recording, vehicle: str, all_steps: Sequence[DatasetStep], rate: int, videos: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    whole = {"dtype": "int64", "shape": [1], "names": None}
    features: dict[str, Any] = {
        "observation.state": {"dtype": "float32", "shape": [len(STATE)], "names": list(STATE)},
        "action": {"dtype": "float32", "shape": [len(ACTION)], "names": list(ACTION)},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), whole),
    }
    for camera, about in videos.items():
        features[f"observation.images.{camera}"] = {
            "dtype": "video",
            "shape": [about["video.height"], about["video.width"], 3],
            "names": ["height", "width", "channels"],
            "info": about,
        }
    episodes = len({step.episode for step in all_steps})
    return {
        "codebase_version": "v3.0",
        "robot_type": recording.scenario_of(vehicle).spec["vehicles"][vehicle]["type"],
        "total_episodes": episodes,
        "total_frames": len(all_steps),
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 500,
        "fps": rate,
        "splits": {"train": f"0:{episodes}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4" if videos else None,
        "features": features,
    }
