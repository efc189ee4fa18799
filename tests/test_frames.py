"""Frames share their arrays with later Frames, snapshots and sinks: nobody can write to one, wherever it is from."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command, Frame, ScenarioSpec
from autodrive.recording import Recorder
from autodrive.recording import open as open_recording
from autodrive.recording.replay.tape import Tape
from tests.support.cars import car_file, small_images
from tests.support.frames import arrays, bytes_of
from tests.support.radar import Radar

CAMERAS = {f"cameras.{name}.{extra}": True for name in ("front", "rear") for extra in ("depth", "labels", "instances")}
CRASH = {"V1": Command(1.0), "V2": Command(1.0)}


@pytest.fixture(scope="module")
def sources(gl: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Frame]:
    """A Frame with all kinds of readings and an event, from each place that makes Frames."""
    folder = tmp_path_factory.mktemp("frames")
    car = car_file(folder, small_images(33, 21) | CAMERAS)
    vehicles = {"V1": {"type": car, "x": -1.0, "y": -0.15}, "V2": {"type": car, "x": -0.3, "y": -0.15, "yaw_deg": 180}}
    box = {"box": {"x": 1.0, "y": 0.15}}
    world = autodrive.make(
        ScenarioSpec.model_validate({"map": "crossing", "vehicles": vehicles, "boxes": box, "v2x": {}}), cameras="small"
    )
    world.add_sensor("V1", "radar", Radar())
    with Recorder(folder / "crash.mcap", world, has_meshes=False):
        while not world.step(CRASH).events:
            assert world.time < 2.0
    frame = world.frame
    frames = {"world": frame, "copy": copy.deepcopy(frame), "pickle": pickle.loads(pickle.dumps(frame))}
    frames["snapshot"] = world.restore(world.save())
    with open_recording(folder / "crash.mcap") as recording, Tape(folder / "crash.mcap") as tape:
        frames |= {"recording": recording.frame_at(frame.time), "tape": tape.frame_at(frame.time)}
        for vehicle in frames["recording"].vehicles.values():
            vehicle.cameras.values()  # reads them from the file
        frames["noisy"] = noisy(car)
    return frames


def noisy(car: str) -> Frame:
    """A Frame whose images have the imperfections of the camera."""
    vehicle = {"type": car, "has_realistic_sensors": True}
    return autodrive.make(ScenarioSpec.model_validate({"vehicles": {"V1": vehicle}}), cameras="small").frame


@pytest.mark.parametrize("source", ["world", "noisy", "copy", "pickle", "snapshot", "recording", "tape"])
def test_no_array_of_a_frame_can_be_written_to(sources: dict[str, Frame], source: str) -> None:
    frame = sources[source]
    before = list(bytes_of(frame))
    assert len(frame.vehicles["V1"].cameras) == (0 if source == "tape" else 2)
    for array in arrays(frame):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    assert list(bytes_of(frame)) == before


@pytest.mark.parametrize("source", ["world", "noisy", "recording"])
def test_images_are_contiguous(sources: dict[str, Frame], source: str) -> None:
    """OpenCV draws on arrays of C-order only."""
    for image in sources[source].vehicles["V1"].cameras.values():
        extras = image.depth, image.labels, image.instances
        layers = [image.rgba, image.rgb, *(layer for layer in extras if layer is not None)]
        assert len(layers) == (2 if source == "recording" else 5)
        assert all(layer.flags.c_contiguous for layer in layers)
        np.testing.assert_array_equal(image.rgb, image.rgba[..., :3])


def test_a_signal_of_a_recording_is_read_once_and_cannot_be_written_to(tmp_path: Path) -> None:
    world = autodrive.make("plane")
    with Recorder(tmp_path / "drive.mcap", world, has_meshes=False):
        world.step()
    with open_recording(tmp_path / "drive.mcap") as recording:
        speed = recording["V1/velocity"]
        assert recording["V1/velocity"] is speed
        with pytest.raises(ValueError, match="read-only"):
            speed *= 3.6
