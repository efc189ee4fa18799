"""Small images of many worlds: one call for all of them beside one World after another, front camera of two cars.

    python benchmarks/batch_camera.py [SIZE]

CPU time of all cores for an image [ms], images in a second of it, and how many times as many as one at a time: medians
of rounds that take turns, so that the load of the machine affects all equally. The boxes stand still, the cars drive.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from dataclasses import replace

import autodrive
from autodrive.graphics.cameras.rig import CameraArray
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.protocol.messages import Frame
from autodrive.world.factory import compile_scenario
from autodrive.world.views.batch_camera import BatchCamera
from autodrive.world.views.cameras import camera_rig

COUNTS = (1, 16, 64, 256)
ROUNDS, SINGLES, SETTLING = 7, 16, 150


def drive(name: str, headlights: autodrive.Headlights) -> list[Frame]:
    """So many states of a drive in curves that all differ."""
    world = autodrive.make(name)
    world.set_scene_light(headlights == autodrive.Headlights.OFF)
    for _ in range(SETTLING):
        world.step({})
    names = list(world.frame.vehicles)
    frames = []
    for i in range(3 * max(COUNTS)):
        commands = {
            v: autodrive.Command(0.7 - 0.3 * k, math.sin(0.02 * i + k), headlights) for k, v in enumerate(names)
        }
        frames.append(world.step(commands))
    return frames[::3]


def measured(name: str, size: int, headlights: autodrive.Headlights) -> None:
    """Print the figures of a scenario by day (headlights off) or by night."""
    compiled = compile_scenario(name)
    rig = camera_rig(compiled, "small")
    slot = rig.slots[0]
    spec = slot.spec.model_copy(update={"width": size, "height": size})
    array, renderer = CameraArray(replace(rig, slots=(slot._replace(spec=spec),))), Renderer(rig.scene, "small")
    batch = BatchCamera(compiled, slot.vehicle, slot.camera, size=(size, size))
    frames = drive(name, headlights)
    states = {n: RenderState.of_all(frames[:: max(COUNTS) // n]) for n in COUNTS}
    singles = [RenderState.of(frame) for frame in frames[:: len(frames) // SINGLES]]
    batch.render(states[max(COUNTS)])  # compiles the shaders
    for state in singles:
        array.capture(renderer, state, 0, [0])
    times: dict[int, list[float]] = {n: [] for n in (0, *COUNTS)}
    for _ in range(ROUNDS):
        start = time.process_time()
        for state in singles:
            array.capture(renderer, state, 0, [0])
        times[0].append((time.process_time() - start) / len(singles))
        for n in COUNTS:
            repeats = max(1, SINGLES // n)
            start = time.process_time()
            for _ in range(repeats):
                batch.render(states[n])
            times[n].append((time.process_time() - start) / (n * repeats))
    alone = statistics.median(times[0])
    light = "day" if headlights == autodrive.Headlights.OFF else "night, low beams"
    print(f"{name}, {light}, {size}x{size}: one at a time {1e3 * alone:.2f} ms, {1.0 / alone:.0f}/s")
    for n in COUNTS:
        each = statistics.median(times[n])
        print(
            f"  {n:4d} worlds: {1e3 * each:5.2f} ms, {1.0 / each:4.0f}/s, {alone / each:.1f} times as many", flush=True
        )


def main() -> None:
    size = int(sys.argv[1]) if len(sys.argv) > 1 else 84
    for name in ("mini_map", "two_cars"):
        for headlights in (autodrive.Headlights.OFF, autodrive.Headlights.LOW):
            measured(name, size, headlights)


if __name__ == "__main__":
    main()
