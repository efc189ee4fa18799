"""Renders the images of the README, at twice their size for antialiasing: `uv run docs/pictures.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import autodrive
from autodrive.base.png import encode_png
from autodrive.cli.preview import render_preview
from autodrive.graphics.cameras.viewpoints import orbit
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.sensors.camera.view import View
from autodrive.world.factory import compile_scenario

HERE = Path(__file__).parent
SIZE = 960, 540


def draw(renderer: Renderer, state: RenderState, view: View, name: str) -> None:
    """Render a view and write it at half its size."""
    pixels = renderer.draw(state, [view])[0].rgba[..., :3]
    height, width, _ = pixels.shape
    means = pixels.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
    (HERE / name).write_bytes(encode_png(np.round(means).astype(np.uint8)))


def main() -> None:
    """Render all images."""
    for vehicle in ("nigel", "roboracer", "neoracer"):
        render_preview("vehicle", vehicle, HERE / f"{vehicle}.png")
    world = autodrive.make("two_cars")
    frames = {}
    for name, lamps in (("day", autodrive.Headlights.OFF), ("night", autodrive.Headlights.LOW)):
        world.reset()
        world.set_scene_light(name == "day")
        drive = autodrive.Command(0.8, 0.12, lamps, autodrive.Indicators.HAZARD if name == "night" else None)
        for _ in range(80):
            frames[name] = world.step({"V1": drive, "V2": autodrive.Command(0.5, -0.1, lamps)})
    with Renderer(scene_of(compile_scenario("two_cars")), "gpu") as renderer:
        for name, azimuth in (("day", 205.0), ("night", 160.0)):
            x, y, _ = frames[name].vehicles["V1"].pose.position.tolist()
            target = x + 0.25, y, 0.05
            view = orbit(target, 1.05, azimuth, 19.0, 42.0).view(2 * SIZE[0], 2 * SIZE[1])
            draw(renderer, RenderState.of(frames[name]), view, f"{name}.png")
    seeing = autodrive.make("two_cars", cameras="software-fxaa")
    front = seeing.frame.vehicles["V1"].cameras["front"].rgb
    (HERE / "front_camera.png").write_bytes(encode_png(front))


if __name__ == "__main__":
    main()
