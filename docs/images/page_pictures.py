"""Makes the pictures of the page.

`python -m docs.images.page_pictures [NAME,...]` makes all, or those of these names.
"""

from __future__ import annotations

import io
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import autodrive
from autodrive.protocol.messages import Command, Headlights, Indicators
from autodrive.recording import Recorder
from autodrive.recording.replay import Replay, ReplayOptions
from autodrive.run.options import PageOptions
from docs.images.filmed_page import HERE, FilmedPage, filmed_page, note_buttons

SIZE = 1280, 720
"""Width and height of a picture [pixels]."""
QUALITY = 80
"""Of WebP, 0 to 100."""
HIDDEN = "#film-pointer, .preview-figures { display: none }"
"""Rates of images are those of a simulator that waits for the picture."""


def page_day(film: FilmedPage) -> None:
    """The page by day, with Menu and HUD."""
    film.load("mini_map")
    film.drive(4.0, is_shown=False)
    film.value("[store.isMenuOpen.value = true, store.isHudOpen.value = true]")
    film.wait(lambda: _has_camera_image(film))


def page_night(film: FilmedPage) -> None:
    """The page by night, with the HUD."""
    film.load("night")
    film.drive(2.0, is_shown=False)
    film.step(2, {"V1": Command(0.8, 0.0, Headlights.HIGH, Indicators.LEFT)})
    film.value("store.isHudOpen.value = true")
    film.wait(lambda: _has_camera_image(film))


def overlays(film: FilmedPage) -> None:
    """Collision shapes, contact forces and axes of a car."""
    film.load("mini_map")
    film.drive(2.0, is_shown=False)
    film.value(
        "[store.areShapesShown.value = true, store.areForcesShown.value = true, store.areAxesShown.value = true]"
    )
    film.value("store.camera.value = 'Orbit'")
    film.wait(lambda: film.draw() or film.value("store.shapes.value"))
    film.step(10)
    film.page.mouse.move(SIZE[0] / 2, SIZE[1] / 2)
    film.page.mouse.wheel(0, -800)


def build(film: FilmedPage) -> None:
    """Build mode: a curve is offered that closes a loop."""
    film.load("plane")
    film.begin_with_a_crossing(0.0)
    for _ in range(2):
        film.edit(lambda: film.press("Enter"), 0.0)


def build_track(film: FilmedPage) -> None:
    """Build mode: a race track by points."""
    film.load("practice")
    film.begin_to_build()
    film.edit(lambda: film.click("track-new"), 0.0)
    film.wait_for_track()


def build_picture(film: FilmedPage) -> None:
    """The window for a picture without a YAML file, with the line of a known length and the start line."""
    film.load("practice")
    film.begin_to_build()
    drawing = Image.new("L", (400, 300), 255)
    pen = ImageDraw.Draw(drawing)
    pen.rectangle((20, 20, 380, 280), outline=0, width=8)
    pen.rectangle((70, 70, 330, 230), outline=0, width=8)
    file = io.BytesIO()
    drawing.save(file, "PNG")
    film.page.get_by_test_id("build-file").set_input_files(
        {"name": "my drawing.png", "mimeType": "image/png", "buffer": file.getvalue()}
    )
    film.wait(lambda: film.draw() or film.page.get_by_test_id("picture").is_visible())


def replay(film: FilmedPage) -> None:
    """A replay: the timeline with marks of collisions and departures from the road, speed and steering."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mini_map.mcap"
        world = autodrive.make("mini_map")
        with Recorder(file, world, name="mini_map"):
            while world.time < 60.0:
                world.step({"V1": Command(0.6, 0.8 * np.sin(0.3 * world.time))})
        with Replay(file, ReplayOptions(is_paused=True, page=PageOptions(port=0))) as shown:
            film.open(f"{shown.server.url}?quality=low#menu=0&hud=1")
            film.page.evaluate("() => autodrive.connection.request({type: 'Seek', time: 17.5})")
            film.wait(lambda: film.draw() or film.value("store.frame.value.time > 17"))
            _save(film, "replay")


PICTURES: tuple[Callable[[FilmedPage], None], ...] = (
    *(page_day, page_night, overlays, build, build_track, build_picture, replay),
)


def _has_camera_image(film: FilmedPage) -> bool:
    """Whether the HUD shows an image of the front camera, after one more tick, which asks for an image."""
    film.step(1)
    film.draw()
    return film.page.locator("[data-testid=hud-front-camera]:not([data-state=none])").count() > 0


def _save(film: FilmedPage, name: str) -> None:
    film.page.add_style_tag(content=HIDDEN)
    for _ in range(20):  # what moves comes to rest
        film.draw()
    Image.fromarray(film.picture()).save(HERE / f"{name}.webp", quality=QUALITY, method=6)
    note_buttons(film, name)
    print(name, flush=True)


def main() -> None:
    """Make the pictures."""
    names = sys.argv[1].split(",") if len(sys.argv) > 1 else [make.__name__ for make in PICTURES]
    for make in PICTURES:
        if make.__name__ in names:
            with filmed_page("plane", SIZE, 30.0, lambda _: None) as film:
                make(film)
                if make is not replay:
                    _save(film, make.__name__)


if __name__ == "__main__":
    main()
