"""Datasets for object detection: the recorded images with boxes and masks of their objects, for COCO and YOLO.

Both have the images as they were recorded, in `images/train` and `images/val`: the last fifth of the time is for
validation, because neighbouring images are nearly equal. COCO: `annotations/instances_train.json` and
`instances_val.json`, in the format of https://cocodataset.org/#format-data, with more fields. YOLO: a text file for
each image in `labels/train` and `labels/val`, and `data.yaml`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive.base.cache import make_folder, write_file
from autodrive.base.version import __version__
from autodrive.graphics.meshes.instances import CLASSES
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.annotations import AnnotatedImage, Annotation, PixelBox, annotated_images
from autodrive.recording.exports.options import ExportOptions

if TYPE_CHECKING:
    from numpy.typing import NDArray

VALIDATION = 0.2
"""Share of the time that is for validation."""
PARTS = ("train", "val")


def write(recording: Recording, path: Path, options: ExportOptions, name: str) -> None:
    """Write the images of the chosen vehicles with their objects; `name`: 'coco' or 'yolo'."""
    for part in PARTS:
        make_folder(path / "images" / part)
    start = recording.start if options.start is None else max(options.start, recording.start)
    end = recording.end if options.end is None else min(options.end, recording.end)
    first_of_validation = end - VALIDATION * (end - start)
    dataset = _Coco(path) if name == "coco" else _Yolo(path)
    count = 0
    for count, image in enumerate(annotated_images(recording, options), 1):
        stem = f"{count:06d}_{image.picture.vehicle}_{image.picture.camera}"
        part = "val" if image.time >= first_of_validation else "train"
        write_file(path / "images" / part / f"{stem}.jpg", image.picture.jpeg)
        dataset.add(part, stem, image)
    if count == 0:
        raise RecordingError("there is no image between these times whose Frame was recorded, too")
    dataset.finish()


class _Coco:
    """Collects the annotations, and writes them at the end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._images: dict[str, list[dict[str, Any]]] = {part: [] for part in PARTS}
        self._annotations: dict[str, list[dict[str, Any]]] = {part: [] for part in PARTS}

    def add(self, part: str, stem: str, image: AnnotatedImage) -> None:
        """Add an image of a part of the dataset; `stem`: of its file."""
        images, annotations, picture = self._images[part], self._annotations[part], image.picture
        images.append(
            {
                "id": len(images) + 1,
                "file_name": f"{stem}.jpg",
                "width": picture.intrinsics.width,
                "height": picture.intrinsics.height,
                "time": image.time,
                "vehicle": picture.vehicle,
                "camera": picture.camera,
                "camera_matrix": picture.intrinsics.matrix.tolist(),
                "distortion": list(picture.intrinsics.distortion),
                "camera_position": picture.pose.position.tolist(),
                "camera_orientation": picture.pose.orientation.tolist(),
            }
        )
        for shown in image.annotations:
            annotations.append({"id": len(annotations) + 1, "image_id": len(images), **_coco(shown)})

    def finish(self) -> None:
        """Write the files."""
        categories = [
            {"id": number, "name": name, "supercategory": "sign" if name.endswith("_sign") else name}
            for number, name in enumerate(CLASSES, 1)
        ]
        make_folder(self._path / "annotations")
        for part in PARTS:
            dataset = {
                "info": {"description": f"{part}: images of a recording", "version": __version__},
                "licenses": [],
                "categories": categories,
                "images": self._images[part],
                "annotations": self._annotations[part],
            }
            write_file(self._path / "annotations" / f"instances_{part}.json", json.dumps(dataset))


def _coco(shown: Annotation) -> dict[str, Any]:
    return {
        "category_id": CLASSES.index(shown.instance.kind) + 1,
        "bbox": PixelBox.around(shown.mask),
        "area": shown.area,
        "segmentation": {"size": list(shown.mask.shape), "counts": run_lengths(shown.mask)},
        "iscrowd": 0,
        "instance_id": shown.number,
        "name": shown.instance.name,
        "whole_bbox": PixelBox.around(shown.whole),
        "occlusion": round(shown.occlusion, 4),
        "box_3d": shown.solid._asdict(),
        **({"state": shown.state} if shown.state else {}),
    }


def run_lengths(mask: NDArray[np.bool_]) -> str:
    """A mask as COCO compresses it: the lengths of the runs of its columns, without and with the object in turn.

    From the fourth on, a length is the difference from the last but one; each has 5 bits in a character, and a sixth
    one that says that the next character belongs to it.
    """
    pixels = mask.ravel(order="F")
    edges = np.flatnonzero(np.diff(pixels, prepend=False))
    lengths = np.diff([0, *edges.tolist(), len(pixels)]).tolist()
    differences = [*lengths[:3], *np.subtract(lengths[3:], lengths[1:-2]).tolist()]
    return "".join(character for number in differences for character in _characters(number))


def _characters(number: int) -> Iterator[str]:
    is_more = True
    while is_more:
        bits, number = number & 31, number >> 5
        is_more = number != (-1 if bits & 16 else 0)
        yield chr(48 + bits + 32 * is_more)


class _Yolo:
    """Writes a text file for each image: class, middle, width and height of each box, as shares of the image."""

    def __init__(self, path: Path) -> None:
        self._path = path
        for part in PARTS:
            make_folder(path / "labels" / part)

    def add(self, part: str, stem: str, image: AnnotatedImage) -> None:
        """Write the boxes of an image of a part of the dataset; `stem`: of its file."""
        lines = [_yolo(shown) for shown in image.annotations]
        write_file(self._path / "labels" / part / f"{stem}.txt", "".join(lines))

    def finish(self) -> None:
        """Write the description of the dataset; without a path it is beside the images."""
        names = "".join(f"  {number}: {name}\n" for number, name in enumerate(CLASSES))
        write_file(self._path / "data.yaml", f"train: images/train\nval: images/val\nnames:\n{names}")


def _yolo(shown: Annotation) -> str:
    x, y, width, height = PixelBox.around(shown.mask)
    rows, columns = shown.mask.shape
    shares = (x + 0.5 * width) / columns, (y + 0.5 * height) / rows, width / columns, height / rows
    return f"{CLASSES.index(shown.instance.kind)} {' '.join(f'{share:.6f}' for share in shares)}\n"
