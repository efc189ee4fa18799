"""What runs in a `RenderProcess`: draws the cameras of vehicles, and views as JPEG.

The simulator sends a `CameraRig`, which is answered by `Ready`, then a `RenderRequest` for each `RenderResult`.
`Failed` is the last answer. Images come through a large pipe, which takes the same time, within 3 %, as memory that
both processes map; Linux, macOS and Windows map memory each in their own way. (The `SharedMemory` of the standard
library is in /dev/shm, which has 64 MB in a container, and a process that writes more is killed; before Python 3.13 it
is also tracked by, and removed with, each process that opens it.)
"""

from __future__ import annotations

import contextlib
import os
import pickle
import sys
import time
from collections.abc import Iterator
from typing import Any, BinaryIO, Literal, NamedTuple, TypeAlias

import simplejpeg

from autodrive.base.arrays import Floats
from autodrive.base.child_process import take_stdout
from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.adaptive_renderer import AdaptiveRenderer
from autodrive.graphics.cameras.false_colours import depth_colours, label_colours
from autodrive.graphics.cameras.rig import CameraArray, CameraRig
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.strokes import Strokes
from autodrive.physics.sensors.camera.view import View

JPEG_QUALITY = 80

VIEW_PERIOD = 1.0 / 30.0
"""Longest time of a view [s] with which quality 'auto' smooths edges."""


class CameraImages(NamedTuple):
    """A target: images of the rig's cameras with these numbers. The answer is a list of `CameraImage`."""

    tick: int
    cameras: list[int]
    noise: tuple[int, int]
    """When this changes, or in a new process, image noise restarts from the seed in its second place."""


class Jpeg(NamedTuple):
    """A target: a view, encoded. The answer is `bytes`."""

    view: View
    content: Literal["image", "depth", "labels"] = "image"
    farthest: float = 0.0
    """Depth at which the colours end [m]."""
    strokes: Strokes | None = None
    """What is drawn into the image."""


Target: TypeAlias = CameraImages | Jpeg


class RenderRequest(NamedTuple):
    """Draw a state."""

    state: Floats
    """`RenderState.data`."""
    target: Target


class Ready(NamedTuple):
    """The process can draw, with the OpenGL renderer of this name."""

    renderer: str


class RenderResult(NamedTuple):
    """A request has been drawn."""

    answer: Any
    """What the target of the request returns."""
    seconds: float
    """Wall time that drawing took [s]."""


class Failed(NamedTuple):
    """The process cannot draw, for this reason, and ends."""

    reason: str


def main() -> None:
    """Draw what is requested until the simulator closes the pipe."""
    answers = take_stdout()
    if hasattr(os, "nice"):  # not on Windows
        with contextlib.suppress(OSError):
            os.nice(5)  # the physics go first
    with contextlib.suppress(BrokenPipeError):  # the simulator has ended
        for answer in _answers(sys.stdin.buffer):
            pickle.dump(answer, answers, pickle.HIGHEST_PROTOCOL)
            answers.flush()


def _answers(pipe: BinaryIO) -> Iterator[Ready | RenderResult | Failed]:
    """An exception becomes a `Failed`."""
    try:
        yield from _drawn(pickle.load(pipe), _requests(pipe))
    except Exception as error:
        unexpected = "" if isinstance(error, AutodriveError) else f"cameras are unavailable: {type(error).__name__}: "
        yield Failed(" ".join(f"{unexpected}{error}".split()))


def _requests(pipe: BinaryIO) -> Iterator[RenderRequest]:
    with contextlib.suppress(EOFError):
        while True:
            yield pickle.load(pipe)


def _drawn(rig: CameraRig, requests: Iterator[RenderRequest]) -> Iterator[Ready | RenderResult]:
    array, noise = CameraArray(rig), None
    drawing = AdaptiveRenderer(rig.scene, rig.quality, _shortest_period(rig))
    try:
        yield Ready(drawing.renderer.name)
        for data, target in requests:
            state = RenderState.from_buffer(data, len(rig.contents.vehicles))
            start = time.perf_counter()
            if isinstance(target, Jpeg):
                answer: Any = _jpeg(drawing.renderer, state, target)
            else:
                if target.noise != noise:
                    noise = target.noise
                    array.reset(noise[1])
                answer = array.capture(drawing.renderer, state, target.tick, target.cameras)
            seconds = time.perf_counter() - start
            yield RenderResult(answer, seconds)
            drawing.add_draw_time(seconds)
    finally:
        drawing.release()


def _jpeg(renderer: Renderer, state: RenderState, target: Jpeg) -> bytes:
    content = target.content
    wanted = {"depth": content == "depth", "labels": content == "labels", "strokes": target.strokes}
    [image] = renderer.draw(state, [target.view], **wanted)
    if content == "image":
        sampling = "444" if target.strokes else "420"  # thin lines keep their colours
        return simplejpeg.encode_jpeg(image.rgba, quality=JPEG_QUALITY, colorspace="RGBX", colorsubsampling=sampling)
    if image.depth is not None:
        pixels = depth_colours(image.depth, target.farthest)
    else:
        assert image.labels is not None
        pixels = label_colours(image.labels)
    return simplejpeg.encode_jpeg(pixels, quality=90, colorspace="RGBX", colorsubsampling="444")


def _shortest_period(rig: CameraRig) -> float:
    """Time between two images of the fastest camera [s]; 0 if each camera draws in every tick."""
    if not rig.slots:
        return VIEW_PERIOD
    rate = max(slot.spec.rate or 0.0 for slot in rig.slots)
    return 1.0 / rate if rate else 0.0
