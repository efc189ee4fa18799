"""The still pictures of the scenarios, which the page shows on its start screen and while a scenario loads.

`python -m tests.support.stills [NAME ...]` renders them again, all or those of these names. The same versions of the
simulator and of the graphics driver give the same files.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import autodrive
from autodrive.base.transforms import Vector
from autodrive.graphics.cameras.viewpoints import Viewpoint, orbit
from autodrive.graphics.meshes import store
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.protocol.messages import Command, Frame, Headlights, SetSceneLight, SetTimeOfDay, SetWeather

FOLDER = Path(__file__).parents[2] / "web" / "src" / "stills"
SIZE = 640, 360
"""Width and height of a still [pixels]."""
FINENESS = 2
"""Each pixel is the mean of a square of so many rendered pixels."""
FIELD_OF_VIEW_DEG = 45.0
"""Vertical [degree]."""
QUALITY = 72
"""Of WebP, 0 to 100."""


class Shot(NamedTuple):
    """What a still shows: a scenario after some time, from an orbit. By night the first vehicle has its lamps on."""

    scenario: str
    target: Vector | None = None
    """What the orbit looks at [m]; None: the first vehicle."""
    distance: float = 1.0
    """[m]."""
    azimuth: float = 0.0
    """Of the place of the orbit, from the x axis to the left [degree]."""
    elevation: float = 30.0
    """[degree]."""
    duration: float = 0.0
    """Simulated time from the start [s]."""
    requests: tuple[SetSceneLight | SetTimeOfDay | SetWeather, ...] = ()
    """Applied at the start."""


SHOTS = {
    "boxes": Shot("boxes", (0.9, 0.0, 0.1), 1.6, -140.0, 22.0),
    "crossing": Shot("crossing", (0.0, 0.0, 0.0), 4.0, -60.0, 34.0),
    "four_cars": Shot("four_cars", (0.7, 1.55, 0.0), 4.2, -120.0, 40.0),
    "mini_map": Shot("mini_map", (0.1, 0.15, 0.05), 1.5, 205.0, 20.0),
    "nigel_2023": Shot("nigel_2023", (-1.0, -0.15, 0.05), 0.75, 30.0, 18.0),
    "night": Shot("night", (0.35, 0.05, 0.05), 1.3, 165.0, 20.0, duration=0.1),
    "parking": Shot("parking", (2.1, 3.4, 0.0), 2.1, -112.0, 34.0),
    "plane": Shot("plane", (0.07, 0.0, 0.05), 0.8, 35.0, 18.0),
    "practice": Shot("practice", None, 1.7, 215.0, 38.0),
    "tiny_town": Shot("tiny_town", (1.6, 0.9, 0.0), 8.4, -90.0, 52.0),
    "traffic": Shot("traffic", (0.4, 0.1, 0.05), 2.3, -150.0, 24.0, duration=30.0),
    "traffic_rain": Shot("traffic_rain", (0.3, 0.1, 0.05), 1.9, -142.0, 20.0, duration=40.0),
    "two_cars": Shot("two_cars", (0.6, 0.0, 0.05), 1.5, 150.0, 22.0),
    "build": Shot("mini_map", (0.7, 1.3, 0.0), 5.0, -90.0, 62.0),
}
"""By name: that of a scenario, or 'build' for a map that is being built."""


def still(shot: Shot) -> bytes:
    """The picture as a WebP file."""
    world = autodrive.make(shot.scenario)
    for request in shot.requests:
        world.apply(request)
    lamps = Command(headlights=Headlights.OFF if world.frame.scene_light else Headlights.HIGH)
    while world.time < shot.duration:
        world.step({next(iter(world.frame.vehicles)): lamps})
    state = RenderState.of(world.frame)
    width, height = SIZE
    view = _viewpoint(shot, world.frame).view(FINENESS * width, FINENESS * height)
    with Renderer(store.scene_of(world.compiled), "gpu") as renderer:
        image = _reduced(renderer.draw(state, [view])[0].rgba[..., :3])
    file = io.BytesIO()
    Image.fromarray(image).save(file, "WEBP", quality=QUALITY, method=6)
    return file.getvalue()


def write(names: Iterable[str]) -> None:
    """Render the stills of these names again."""
    FOLDER.mkdir(exist_ok=True)
    for name in names:
        (FOLDER / f"{name}.webp").write_bytes(still(SHOTS[name]))


def _viewpoint(shot: Shot, frame: Frame) -> Viewpoint:
    if (target := shot.target) is None:
        x, y, z = next(iter(frame.vehicles.values())).pose.position.tolist()
        target = x, y, z
    return orbit(target, shot.distance, shot.azimuth, shot.elevation, FIELD_OF_VIEW_DEG)


def _reduced(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width, _ = image.shape
    parts = image.reshape(height // FINENESS, FINENESS, width // FINENESS, FINENESS, 3)
    return np.round(parts.mean(axis=(1, 3))).astype(np.uint8)


if __name__ == "__main__":
    write(sys.argv[1:] or SHOTS)
