"""Renders the images of README and docs that do not show the page: vehicles, maps, scenes and an image of a camera.

`uv run python -m docs.images.renders [NAME ...]` from the root folder renders all, or those of these names.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import autodrive
from autodrive.base.png import encode_png
from autodrive.cli.preview import render_preview
from autodrive.protocol.messages import SetSceneLight, SetTimeOfDay, SetWeather, Weather
from tests.support.stills import Shot, still

HERE = Path(__file__).parent

DUSK, RAIN = SetTimeOfDay(17.6 * 3600.0), SetWeather(Weather(clouds=1.0, rain=0.8))
SHOTS = {
    "day": Shot("two_cars", (0.6, 0.0, 0.05), 1.2, 205.0, 19.0),
    "night": Shot("two_cars", (0.6, 0.0, 0.05), 1.2, 160.0, 19.0, duration=0.5, requests=(SetSceneLight(False),)),
    "crossing_day": Shot("crossing", (0.0, 0.0, 0.1), 2.0, -120.0, 16.0, duration=3.0),
    "crossing_night": Shot(
        "crossing", (0.0, 0.0, 0.1), 2.0, -120.0, 16.0, duration=3.0, requests=(SetSceneLight(False),)
    ),
    "weather_town": Shot("tiny_town", (0.4, 0.1, 0.2), 2.4, -150.0, 12.0),
    "weather_dusk": Shot("mini_map", (0.1, 0.15, 0.2), 1.5, 205.0, 8.0, requests=(DUSK,)),
    "weather_rain": Shot("night", (0.35, 0.05, 0.05), 1.3, 165.0, 12.0, duration=20.0, requests=(RAIN,)),
    "weather_snow": Shot(
        "traffic", (0.4, 0.1, 0.05), 2.3, -150.0, 16.0, duration=30.0, requests=(SetWeather(Weather(snow=0.5)),)
    ),
}
"""Scenes, by the name of the file."""
MAPS = ("mini_map", "tiny_town", "crossing")
VEHICLES = ("nigel", "roboracer", "neoracer")


def draw_scene(name: str) -> None:
    """Render a scene."""
    (HERE / f"{name}.webp").write_bytes(still(SHOTS[name]))


def draw_map(name: str) -> None:
    """Draw a map from above."""
    command = [sys.executable, "-m", "autodrive", "show", name, "--output", str(HERE / f"{name}.png")]
    subprocess.run(command, check=True)


def draw_vehicle(name: str) -> None:
    """Render a vehicle."""
    render_preview("vehicle", name, HERE / f"{name}.png")


def draw_front_camera() -> None:
    """Render an image of the front camera."""
    image = autodrive.make("two_cars", cameras="software-fxaa").frame.vehicles["V1"].cameras["front"].rgb
    (HERE / "front_camera.png").write_bytes(encode_png(image))


IMAGES: dict[str, Callable[[], None]] = {
    **{name: partial(draw_scene, name) for name in SHOTS},
    **{name: partial(draw_map, name) for name in MAPS},
    **{name: partial(draw_vehicle, name) for name in VEHICLES},
    "front_camera": draw_front_camera,
}


def main() -> None:
    """Render all images, or some."""
    for name in sys.argv[1:] or IMAGES:
        IMAGES[name]()
        print(name, flush=True)


if __name__ == "__main__":
    main()
