"""Datasets for detectors, read back by pycocotools; boxes and masks against the live world and against geometry."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from pycocotools import mask as coco_masks
from pycocotools.coco import COCO

import autodrive
from autodrive import Command, Frame, ScenarioSpec
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.graphics.meshes.instances import CLASSES
from autodrive.recording import Recorder, RecordingError
from autodrive.recording import open as open_recording
from autodrive.recording.exports import export
from autodrive.recording.exports.annotations import LEAST_PIXELS
from autodrive.recording.exports.detection import run_lengths
from autodrive.recording.exports.options import ExportOptions
from autodrive.world.views.cameras import process_cameras
from tests.support.cars import car_file, small_images
from tests.support.waiting import wait_until

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # of pycocotools

SIZE = (160, 120)


class Drive(NamedTuple):
    """A recorded drive, and its Frames with the instances of the images."""

    path: Path
    frames: list[Frame]
    names: list[str]
    """Names of the instances."""


@pytest.fixture(scope="module")
def drive(gl: str, tmp_path_factory: pytest.TempPathFactory) -> Drive:
    """V1 follows V2, whose lens is that of a real camera, past boxes and towards a crossing."""
    folder = tmp_path_factory.mktemp("town")
    extras = {f"cameras.{name}.instances": True for name in ("front", "rear")}
    car = car_file(folder, small_images(*SIZE) | extras)
    vehicles = {
        "V1": {"type": car, "x": -1.5, "y": -0.15},
        "V2": {"type": car, "x": -0.6, "y": -0.2, "has_realistic_sensors": True},
    }
    boxes = {"near": {"x": -0.8, "y": 0.05}, "far": {"x": -0.1, "y": -0.15}}
    spec = ScenarioSpec.model_validate({"map": "tiny_town", "vehicles": vehicles, "boxes": boxes})
    world = autodrive.make(spec, cameras="small")
    frames = [world.frame]
    with Recorder(folder / "town.mcap", world, has_meshes=False):
        for _ in range(50):
            frames.append(world.step({"V1": Command(0.8), "V2": Command(0.8, 0.3)}))
    return Drive(folder / "town.mcap", frames, [instance.name for instance in world.instances])


@pytest.fixture(scope="module")
def yolo(drive: Drive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with open_recording(drive.path) as recording:
        return export(recording, "yolo", tmp_path_factory.mktemp("yolo") / "town")


@pytest.fixture(scope="module")
def coco(drive: Drive, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Both parts of the dataset by name, as `COCO`; its types do not have the fields that we add."""
    with open_recording(drive.path) as recording:
        folder = export(recording, "coco", tmp_path_factory.mktemp("coco") / "town")
    return {part: COCO(folder / f"annotations/instances_{part}.json") for part in ("train", "val")}


def objects(part: Any) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Each annotation, and its image."""
    return [(part.imgs[shown["image_id"]], shown) for shown in part.anns.values()]


def test_masks_are_the_instances_of_the_images_of_the_world(drive: Drive, coco: dict[str, Any]) -> None:
    """Each object but the own vehicle, with the distortion of the lens, and no other pixels."""
    frames = {frame.time: frame for frame in drive.frames}
    checked = 0
    for part in coco.values():
        for number, about in part.imgs.items():
            image = frames[round(about["time"], 9)].vehicles[about["vehicle"]].cameras[about["camera"]]
            assert image.instances is not None
            masks = {shown["name"]: part.annToMask(shown) for shown in part.imgToAnns[number]}
            seen = {drive.names[i - 1]: image.instances == i for i in np.unique(image.instances).tolist() if i}
            seen.pop(about["vehicle"], None)
            assert {name for name, pixels in seen.items() if pixels.sum() >= LEAST_PIXELS} == {*masks}
            for name, mask in masks.items():
                np.testing.assert_array_equal(mask, seen[name])
                checked += 1
    assert checked > 100


def test_boxes_and_areas_are_those_that_pycocotools_finds_in_the_masks(coco: dict[str, Any]) -> None:
    for part in coco.values():
        for image, shown in objects(part):
            lengths = part.annToRLE(shown)
            assert shown["bbox"] == coco_masks.toBbox(lengths).tolist()
            assert shown["area"] == coco_masks.area(lengths)
            x, y, width, height = shown["whole_bbox"]
            assert 0 <= x <= shown["bbox"][0]
            assert 0 <= y <= shown["bbox"][1]
            assert shown["bbox"][0] + shown["bbox"][2] <= x + width <= image["width"]
            assert shown["bbox"][1] + shown["bbox"][3] <= y + height <= image["height"]
            assert 0.0 <= shown["occlusion"] < 1.0
    hidden = {shown["name"] for _, shown in objects(coco["train"]) if shown["occlusion"] > 0.3}
    assert "far" in hidden  # behind V2
    assert "V2" not in hidden


def test_the_box_of_an_object_contains_it_and_is_where_the_frame_says(drive: Drive, coco: dict[str, Any]) -> None:
    """Corners are projected with the matrix of the dataset, in which the centre of the first pixel is 0."""
    frames, checked = {frame.time: frame for frame in drive.frames}, 0
    for image, shown in objects(coco["train"]):
        if any(image["distortion"]):
            continue
        solid = shown["box_3d"]
        turn = np.reshape(rotation_from_quaternion(solid["orientation"]), (3, 3))
        signs = np.mgrid[-0.5:1:1, -0.5:1:1, -0.5:1:1].reshape(3, -1)
        corners = turn @ (signs * np.array(solid["size"])[:, None]) + np.array(solid["center"])[:, None]
        if corners[2].min() < 0.05:
            continue
        u, v, w = np.array(image["camera_matrix"]) @ corners
        x, y, width, height = shown["whole_bbox"]
        assert (u / w).min() < x + 0.5
        assert (v / w).min() < y + 0.5
        assert (u / w).max() > x + width - 1.5
        assert (v / w).max() > y + height - 1.5
        if shown["name"] in ("near", "far"):
            looking = np.reshape(rotation_from_quaternion(image["camera_orientation"]), (3, 3))
            place = looking @ solid["center"] + image["camera_position"]
            truth = frames[round(image["time"], 9)].objects[shown["name"]].pose.position
            np.testing.assert_allclose(place, truth, atol=1e-6)  # vertices of meshes are float32
            np.testing.assert_allclose(solid["size"], 0.1, atol=1e-6)
        checked += 1
    assert checked > 30


def test_the_last_fifth_of_the_time_is_for_validation_and_images_are_those_of_the_recording(
    drive: Drive, coco: dict[str, Any], yolo: Path, tmp_path: Path
) -> None:
    times = {part: [image["time"] for image in own.imgs.values()] for part, own in coco.items()}
    assert max(times["train"]) < 0.4 <= min(times["val"])
    with open_recording(drive.path) as recording:
        pictures = [
            picture.jpeg
            for vehicle in ("V1", "V2")
            for camera in ("front", "rear")
            for _, picture in recording.pictures(vehicle, camera)
        ]
        some = export(recording, "yolo", tmp_path / "some", ExportOptions(vehicle="V2", rate=5.0, start=0.01, end=0.3))
        assert recording.problems == []
    files = list(yolo.glob("images/*/*.jpg"))
    assert len(files) == len(times["train"]) + len(times["val"]) == len(pictures)
    assert sorted(file.read_bytes() for file in files) == sorted(pictures)
    assert len(list(some.glob("images/*/*_V2_*.jpg"))) == len(list(some.glob("images/*/*.jpg"))) == 2 * 2


def test_yolo_has_the_boxes_of_coco_as_shares_of_the_image(coco: dict[str, Any], yolo: Path) -> None:
    about = yaml.safe_load((yolo / "data.yaml").read_text())
    assert tuple(about["names"].values()) == CLASSES
    for part, own in coco.items():
        assert [category["name"] for category in own.loadCats(own.getCatIds())] == [*CLASSES]
        for number, image in own.imgs.items():
            name = Path(image["file_name"])
            assert (yolo / about[part] / name).is_file()
            numbers = (yolo / "labels" / part / name.with_suffix(".txt")).read_text().split()
            expected = [
                [shown["category_id"] - 1, (x + w / 2) / SIZE[0], (y + h / 2) / SIZE[1], w / SIZE[0], h / SIZE[1]]
                for shown in own.imgToAnns[number]
                for x, y, w, h in [shown["bbox"]]
            ]
            np.testing.assert_allclose(np.array(numbers, float), np.ravel(expected), atol=1e-6)  # six digits


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.999, 1.0])
def test_masks_are_compressed_as_pycocotools_does(share: float) -> None:
    random = np.random.default_rng(3)
    for height, width in ((1, 1), (1, 7), (40, 30), (120, 160)):
        mask = np.repeat(random.random((height, width)) < share, 3, axis=0)
        assert run_lengths(mask).encode() == coco_masks.encode(np.asfortranarray(mask.astype(np.uint8)))["counts"]


def test_a_recording_without_images_or_their_frames_says_so(drive: Drive, gl: str, tmp_path: Path) -> None:
    world = autodrive.make("plane")
    with Recorder(tmp_path / "dark.mcap", world, has_meshes=False):
        world.step()
    no_images = pytest.raises(RecordingError, match="no images of a vehicle; record with --cameras")
    with open_recording(tmp_path / "dark.mcap") as recording, no_images:
        export(recording, "coco", tmp_path / "coco")
    car = car_file(tmp_path, small_images(*SIZE))
    world = autodrive.make(ScenarioSpec.model_validate({"vehicles": {"V1": {"type": car}}}), cameras="small")
    with Recorder(tmp_path / "few.mcap", world, frame_rate=20.0, has_meshes=False):
        for _ in range(50):
            world.step()
    with open_recording(tmp_path / "few.mcap") as recording:
        folder = export(recording, "coco", tmp_path / "few")
        (problem,) = recording.problems
        left_out = int(problem.split()[0])
        assert problem.endswith("images are left out: the recording does not have the Frames of their times")
        recorded = sum(1 for camera in ("front", "rear") for _ in recording.pictures("V1", camera))
    assert 0 < left_out == recorded - len(list(folder.glob("images/*/*.jpg"))) < recorded


@pytest.mark.process
def test_images_that_are_drawn_in_real_time_have_the_objects_of_their_own_time(gl: str, tmp_path: Path) -> None:
    """Such an image is first in a later Frame than that which it shows."""
    car = car_file(tmp_path, small_images(*SIZE))
    vehicles = {"V1": {"type": car}, "V2": {"type": car, "x": 0.8}}
    spec = ScenarioSpec.model_validate({"map": "plane", "vehicles": vehicles})
    world = autodrive.make(spec, cameras=process_cameras)

    def has_images() -> bool:
        world.look()
        return not world.is_looking

    late: set[float] = set()
    with Recorder(tmp_path / "late.mcap", world, has_meshes=False):
        for tick in range(40):
            frame = world.step({"V2": Command(1.0)})
            late.update(image.time for image in frame.vehicles["V1"].cameras.values() if image.time < frame.time)
            if tick % 3 == 0:
                wait_until(has_images)
    assert len(late) >= 4
    world.close()
    with open_recording(tmp_path / "late.mcap") as recording:
        folder = export(recording, "coco", tmp_path / "coco", ExportOptions(vehicle="V1"))
        assert recording.problems == []
        taken = {p.time for camera in ("front", "rear") for _, p in recording.pictures("V1", camera)}
        offsets: list[float] = []
        for part in ("train", "val"):
            for image, shown in objects(COCO(folder / f"annotations/instances_{part}.json")):
                assert round(image["time"], 9) in taken
                looking = np.reshape(rotation_from_quaternion(image["camera_orientation"]), (3, 3))
                x, _, _ = looking @ shown["box_3d"]["center"] + image["camera_position"]
                offsets.append(x - recording.frame_at(image["time"]).vehicles["V2"].pose.position[0])
    assert len(offsets) >= 3
    np.testing.assert_allclose(offsets, offsets[0], atol=1e-3)  # V2 pitches a little; it drives 4 mm in a tick
