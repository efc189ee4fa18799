"""The worker process of `CameraProcess`: draws the cameras of a rig into shared memory."""

from __future__ import annotations

import pickle
import sys
import time
from collections.abc import Iterator
from typing import BinaryIO, TypeAlias

import msgspec

from autodrive.graphics.cameras.adaptive_renderer import AdaptiveRenderer
from autodrive.graphics.cameras.image_buffers import SharedBuffers
from autodrive.graphics.cameras.rig import CameraArray, CameraRig
from autodrive.graphics.cameras.shared_memory import attach
from autodrive.graphics.cameras.worker import Failed, Ready, serve
from autodrive.protocol.messages import CameraImage, CameraIntrinsics


class DrawCameras(msgspec.Struct, array_like=True):
    """Draw the state in shared memory with these cameras; `seed`: reset all image noise first."""

    tick: int
    cameras: list[int]
    seed: int | None


class ImageHeader(msgspec.Struct, array_like=True):
    """An image without its pixels; fields as in `CameraImage`."""

    time: float
    position: tuple[float, ...]
    orientation: tuple[float, ...]
    intrinsics: CameraIntrinsics


class Drawn(msgspec.Struct, tag=True):
    """The images are in shared memory."""

    headers: list[ImageHeader]
    """In the order of `DrawCameras.cameras`."""
    seconds: float
    """Wall time that drawing took [s]."""


WorkerMessage: TypeAlias = Ready | Drawn | Failed

_decode_request = msgspec.json.Decoder(DrawCameras).decode


def main() -> None:
    """Draw what is requested until the simulator closes the pipe."""
    serve(_work, "cameras")


def _work(requests: BinaryIO) -> Iterator[WorkerMessage]:
    rig: CameraRig = pickle.load(requests)
    buffers = SharedBuffers(attach(sys.argv[1], SharedBuffers.size(rig)), rig)
    array = CameraArray(rig)
    drawing = AdaptiveRenderer(rig.scene, rig.quality, _shortest_period(rig))
    try:
        yield Ready(drawing.renderer.name)
        for line in requests:
            request = _decode_request(line)
            if request.seed is not None:
                array.reset(request.seed)
            start = time.perf_counter()
            images = array.capture(drawing.renderer, buffers.state, request.tick, request.cameras)
            for number, image in zip(request.cameras, images, strict=True):
                _store(image, buffers, number)
            seconds = time.perf_counter() - start
            yield Drawn([_header(image) for image in images], seconds)
            drawing.add_draw_time(seconds)
    finally:
        drawing.release()


def _shortest_period(rig: CameraRig) -> float:
    """Time between two images of the fastest camera [s]; 0 if each camera draws in every tick."""
    rate = max((slot.spec.rate or 0.0 for slot in rig.slots), default=0.0)
    return 1.0 / rate if rate else 0.0


def _store(image: CameraImage, buffers: SharedBuffers, number: int) -> None:
    for buffer, pixels in zip(buffers.images[number], (image.rgba, image.depth, image.labels), strict=True):
        if buffer is not None:
            buffer[:] = pixels


def _header(image: CameraImage) -> ImageHeader:
    pose = image.pose
    return ImageHeader(image.time, tuple(pose.position.tolist()), tuple(pose.orientation.tolist()), image.intrinsics)


if __name__ == "__main__":
    main()
