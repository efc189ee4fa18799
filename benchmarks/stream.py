"""What the simulator's own rendered stream costs: the scene cameras of two cars, drawn for viewers who cannot.

    uv run benchmarks/stream.py [--pictures N] [--quality NAME]

One viewer asks for the next picture when the last has come. Rate [Hz]; wall time of a picture [ms], median and 95 %;
CPU time of all cores that it takes in the process that draws, and here, where the world does a tick for each [ms]; its
size.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from pathlib import Path

import autodrive
from autodrive.connect.server.served import scene_renderer_factory
from autodrive.graphics.render.quality import NAMES
from autodrive.protocol.native import SetCamera

WARM = 30
"""Pictures before the first that counts: by then it is decided whether smooth edges can be afforded."""
CAMERAS = ("Driver's Eye", "Bird's Eye", "God's Eye", "Orbit")
WIDTHS = (960, 1280)


def cpu_time(pid: int) -> float:
    """Of that process so far, all threads [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--pictures", type=int, default=100)
    parser.add_argument("--quality", choices=NAMES, default="auto")
    options = parser.parse_args()
    world = autodrive.make("two_cars")
    scene = scene_renderer_factory(options.quality)(world)
    started = time.perf_counter()
    scene.draw(0, SetCamera(CAMERAS[0]), world.frame).result()
    print(f"start to the first picture {time.perf_counter() - started:.2f} s, drawn by {scene.process.renderer}")
    print(f"load of this machine before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    print(
        f"{'light':6} {'camera':12} {'size':>9} {'Hz':>5} {'median':>6} {'95 %':>5}"
        f" {'drawing':>7} {'here':>5} {'kB':>4}"
    )
    command = {"V1": autodrive.Command(0.4, 0.1, autodrive.Headlights.LOW)}
    for light in ("day", "night"):
        world.set_scene_light(light == "day")
        for width in WIDTHS:
            for camera in CAMERAS:
                walls: list[float] = []
                sizes: list[int] = []
                drawing = here = begun = 0.0
                for number in range(WARM + options.pictures):
                    if number == WARM:
                        drawing, here, begun = cpu_time(scene.process.pid), time.process_time(), time.perf_counter()
                    frame = world.step(command)
                    asked = time.perf_counter()
                    sizes.append(len(scene.draw(0, SetCamera(camera, width=width, azimuth=2.5), frame).result()))
                    walls.append(1e3 * (time.perf_counter() - asked))
                count = options.pictures
                rate = count / (time.perf_counter() - begun)
                drawing, here = (
                    1e3 * (cpu_time(scene.process.pid) - drawing) / count,
                    1e3 * (time.process_time() - here) / count,
                )
                slow = statistics.quantiles(walls[WARM:], n=20)[-1]
                print(
                    f"{light:6} {camera:12} {f'{width}x{width * 9 // 16}':>9} {rate:5.1f}"
                    f" {statistics.median(walls[WARM:]):6.1f} {slow:5.0f} {drawing:7.1f} {here:5.2f}"
                    f" {statistics.mean(sizes[WARM:]) / 1e3:4.0f}"
                )
    print(f"load of this machine after: {os.getloadavg()[0]:.1f}")
    scene.close()
    world.close()


if __name__ == "__main__":
    main()
