"""Cost of camera images: two cars on the mini-map, both 640x480 cameras of the first one, with shadows.

    uv run benchmarks/camera.py [--frames N]

Median wall time and CPU time of all cores [ms]; configurations take turns, so that the load of the machine affects all
equally. The limits are targets for two idle cores. --frames: draw that many more and print the change in memory.
"""

from __future__ import annotations

import argparse
import gc
import os
import statistics
import time
from pathlib import Path

import autodrive
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.sensors.camera.camera import Camera
from autodrive.physics.sensors.camera.view import View
from autodrive.world.factory import compile_scenario
from autodrive.world.views.cameras import camera_rig

ROUNDS, WARM = 60, 6
LIMITS = {
    ("day", "software", 2): 20.0,
    ("day", "software-fxaa", 2): 27.0,
    ("night", "software", 2): 32.0,
    ("night", "software-fxaa", 2): 38.0,
    ("day", "software", 1): 1e3 / 90.0,
}
"""[ms]."""


def states() -> dict[str, list[RenderState]]:
    """A drive by day, and one by night with low beams."""
    world = autodrive.make("two_cars")
    drives = {}
    for light in ("day", "night"):
        world.reset()
        world.set_scene_light(light == "day")
        lamps = autodrive.Headlights.LOW if light == "night" else autodrive.Headlights.OFF
        command = {"V1": autodrive.Command(0.6, 0.1, lamps)}
        drives[light] = [RenderState.of(world.step(command)) for _ in range(ROUNDS)]
    return drives


def resident() -> float:
    """Resident memory [MB]."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--frames", type=int, default=0)
    options = parser.parse_args()
    compiled = compile_scenario("two_cars")
    rig = camera_rig(compiled)
    cameras = [Camera(s.spec, vehicle=s.vehicle, name=s.camera, substep=rig.substep) for s in rig.slots[:2]]
    drives = states()

    def views(state: RenderState, count: int) -> list[View]:
        return [view for camera in cameras[:count] for view in camera.views(state.vehicles[0], state.time)]

    before, started = resident(), time.perf_counter()
    first = Renderer(scene_of(compiled), "software")
    first.draw(drives["day"][0], views(drives["day"][0], 2))
    print(f"start to the first images {time.perf_counter() - started:.2f} s, {resident() - before:.0f} MB resident")
    print(f"drawn by {first.name}")
    renderers = {"software": first, "software-fxaa": Renderer(scene_of(compiled), "software-fxaa")}
    walls: dict[tuple[str, str, int], list[float]] = {}
    cpus: dict[tuple[str, str, int], list[float]] = {}
    for round_ in range(ROUNDS):
        for light, drive in drives.items():
            for quality, renderer in renderers.items():
                for count in (2, 1):
                    wall, cpu = time.perf_counter(), time.process_time()
                    renderer.draw(drive[round_], views(drive[round_], count))
                    if round_ >= WARM:
                        key = light, quality, count
                        walls.setdefault(key, []).append(1e3 * (time.perf_counter() - wall))
                        cpus.setdefault(key, []).append(1e3 * (time.process_time() - cpu))
    print(f"{'light':6} {'quality':14} {'cameras':>7} {'wall':>7} {'cpu':>7} {'limit':>7} {'wall/limit':>10}")
    for key, values in walls.items():
        wall, limit = statistics.median(values), LIMITS.get(key)
        ratio = f"{limit:7.1f} {wall / limit:10.2f}" if limit else ""
        print(f"{key[0]:6} {key[1]:14} {key[2]:7} {wall:7.1f} {statistics.median(cpus[key]):7.1f} {ratio}")
    if options.frames:
        held = resident()
        for number in range(options.frames):
            first.draw(drives["night"][number % ROUNDS], views(drives["night"][number % ROUNDS], 2))
        print(f"{options.frames} more frames: {resident() - held:+.1f} MB of memory")


if __name__ == "__main__":
    main()
