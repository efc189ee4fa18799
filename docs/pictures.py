"""Draws the pictures of the README: `uv run docs/pictures.py`. Each is drawn at twice its size and made smaller."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import autodrive
from autodrive.assets import scene_of
from autodrive.compile import compile_scenario
from autodrive.portrait import portrait
from autodrive.render.moment import Moment
from autodrive.render.png import write_png
from autodrive.render.renderer import Renderer
from autodrive.render.view import View
from autodrive.render.viewpoints import orbit
from autodrive.scenario import load_scenario

HERE = Path(__file__).parent
SIZE = 960, 540


def draw(renderer: Renderer, moment: Moment, view: View, name: str) -> None:
    """Write what the view sees, at half its size."""
    pixels = renderer.draw(moment, [view])[0].rgba[..., :3]
    height, width, _ = pixels.shape
    means = pixels.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
    write_png(HERE / name, np.round(means).astype(np.uint8))


def main() -> None:
    """Draw all of them."""
    portrait("vehicle", "nigel", HERE / "nigel.png")
    world = autodrive.make("two_cars")
    frames = {}
    for name, lamps in (("day", autodrive.Headlights.OFF), ("night", autodrive.Headlights.LOW)):
        world.reset()
        world.set_scene_light(name == "day")
        drive = autodrive.Command(0.8, 0.12, lamps, autodrive.Indicators.HAZARD if name == "night" else None)
        for _ in range(80):
            frames[name] = world.step({"V1": drive, "V2": autodrive.Command(0.5, -0.1, lamps)})
    with Renderer(scene_of(compile_scenario(load_scenario("two_cars"))), "gpu") as renderer:
        for name, azimuth in (("day", 205.0), ("night", 160.0)):
            x, y, _ = frames[name].vehicles["V1"].pose.position.tolist()
            target = x + 0.25, y, 0.05
            view = orbit(target, 1.05, azimuth, 19.0, 42.0).view(2 * SIZE[0], 2 * SIZE[1])
            draw(renderer, Moment.of(frames[name]), view, f"{name}.png")
    seeing = autodrive.make("two_cars", cameras="software-fxaa")
    write_png(HERE / "front_camera.png", np.ascontiguousarray(seeing.frame.vehicles["V1"].cameras["front"].rgb))


if __name__ == "__main__":
    main()
