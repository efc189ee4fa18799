"""Makes the film of the front page: a car drives in a town, roads are built, a car races, and the race is replayed.

`python -m docs.images.front_film race,replay film.webp` writes some parts only, to another file.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import autodrive
from autodrive.protocol.messages import Command, SetDrivingMode
from autodrive.recording import Recorder
from autodrive.recording.replay import Replay, ReplayOptions
from autodrive.run.included_driver import driver_of
from autodrive.run.options import PageOptions
from docs.images.filmed_page import FilmedPage, filmed_page, note_buttons

FILE = Path(__file__).parent / "film.webp"
PAGE = 1120, 630
"""Size of the page [CSS pixels]."""
SIZE = 720, 405
"""Width and height of the film [pixels]."""
RATE = 30
"""Images per second."""
DRAWN = "low"
"""Quality of the page."""
QUALITY = 62
"""Of WebP, 0 to 100."""


def town(film: FilmedPage) -> None:
    """A car drives among the traffic."""
    film.simulation.request(SetDrivingMode("V1", True)).result()
    film.drive(2.5, speed=1.5)
    note_buttons(film, "film")


def build(film: FilmedPage) -> None:
    """Roads are set with keys, and the loop is closed."""
    film.load("plane")
    film.begin_with_a_crossing(0.2)
    film.take(0.3)
    for key in ("Enter", "Enter", "c"):
        film.edit(lambda key=key: film.press(key), 0.35)
    close = film.page.get_by_test_id("build-close-all")
    close.scroll_into_view_if_needed()
    film.edit(lambda: film.click_at(close), 0.6)
    film.click("build-done")
    film.drive(0.8, speed=2.0)


def race(film: FilmedPage) -> None:
    """A policy races."""
    film.load("practice")
    film.drive(3.0, is_shown=False)
    film.drive(2.2)


def replay(film: FilmedPage) -> None:
    """The race is replayed from above, with the timeline."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "race.mcap"
        world = autodrive.make("practice")
        driver = driver_of(world, "V1", world.frame)
        with Recorder(file, world, name="practice"):
            command = Command()
            while world.time < 12.0:
                command = driver.command(world.frame) or command
                world.step({"V1": command})
        with Replay(file, ReplayOptions(is_paused=True, page=PageOptions(port=0))) as shown:
            film.open(f"{shown.server.url}?quality={DRAWN}#menu=0&hud=0")
            film.value("store.camera.value = 'Orbit'")
            for image in range(round(2.0 * RATE)):
                time = 6.0 + 2.0 * image / RATE
                film.page.evaluate("time => autodrive.connection.request({type: 'Seek', time})", time)
                film.take()


PARTS = (town, build, race, replay)


def main() -> None:
    """Write the film."""
    names = sys.argv[1].split(",") if len(sys.argv) > 1 else [part.__name__ for part in PARTS]
    chosen = [part for part in PARTS if part.__name__ in names]
    file = Path(sys.argv[2]) if len(sys.argv) > 2 else FILE
    images: list[Image.Image] = []

    def write(image: NDArray[np.uint8]) -> None:
        images.append(Image.fromarray(image).resize(SIZE, Image.Resampling.LANCZOS))

    with filmed_page("traffic", PAGE, RATE, write, DRAWN) as film:
        for part in chosen:
            part(film)
    images[0].save(
        file, save_all=True, append_images=images[1:], duration=1000 // RATE, loop=0, quality=QUALITY, method=4
    )
    print(f"{file}: {file.stat().st_size / 1e6:.1f} MB, {len(images) / RATE:.1f} s")


if __name__ == "__main__":
    main()
