"""The worker process of `SceneProcess`: draws scene cameras and encodes them as JPEG."""

from __future__ import annotations

import pickle
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, BinaryIO, NamedTuple, TypeAlias

import msgspec
import numpy as np
import simplejpeg

from autodrive.graphics.cameras.adaptive_renderer import AdaptiveRenderer
from autodrive.graphics.cameras.viewpoints import Viewpoint
from autodrive.graphics.cameras.worker import Failed, Ready, serve
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer

if TYPE_CHECKING:
    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.maps.solids import BoxPlacement
    from autodrive.scenario.vehicles.spec import VehicleSpec

JPEG_QUALITY = 80

PERIOD = 1.0 / 30.0
"""If an image takes longer [s], quality 'auto' stops smoothing edges."""


class SceneContents(NamedTuple):
    """What a world contains that can be drawn."""

    map: Map
    vehicles: dict[str, VehicleSpec]
    boxes: list[BoxPlacement]
    quality: str
    """One of `render.quality.NAMES`."""


class DrawScene(msgspec.Struct, array_like=True):
    """Draw this state from this viewpoint."""

    state: bytes
    """Of `RenderState.data`."""
    viewpoint: Viewpoint
    width: int
    """[pixels]."""
    height: int
    """[pixels]."""


class DrawnScene(msgspec.Struct, tag=True):
    """The requested image."""

    jpeg: bytes


SceneMessage: TypeAlias = Ready | DrawnScene | Failed

_decode_request = msgspec.json.Decoder(DrawScene).decode


def main() -> None:
    """Draw what is requested until the simulator closes the pipe."""
    serve(_work, "scene cameras")


def _work(requests: BinaryIO) -> Iterator[SceneMessage]:
    contents: SceneContents = pickle.load(requests)
    scene = scene_of(contents)
    drawing = AdaptiveRenderer(scene, contents.quality, PERIOD)
    try:
        yield Ready(drawing.renderer.name)
        for line in requests:
            request = _decode_request(line)
            start = time.perf_counter()
            yield DrawnScene(_jpeg(drawing.renderer, request, len(scene.vehicles), len(scene.objects)))
            drawing.add_draw_time(time.perf_counter() - start)
    finally:
        drawing.release()


def _jpeg(renderer: Renderer, request: DrawScene, vehicles: int, objects: int) -> bytes:
    state = RenderState.from_buffer(np.frombuffer(request.state), vehicles, objects)
    [image] = renderer.draw(state, [request.viewpoint.view(request.width, request.height)])
    return simplejpeg.encode_jpeg(image.rgba, quality=JPEG_QUALITY, colorspace="RGBX", colorsubsampling="420")


if __name__ == "__main__":
    main()
