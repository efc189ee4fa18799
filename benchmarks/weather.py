"""CPU time of a tick and of the images of two cameras in clear air, rain, fog and snow.

    uv run benchmarks/weather.py [--only-clear]

A tick is `world.step` of 10 ms with a scan of 1080 rays and the complete Frame; the images are both 640x480 cameras of
a car on the mini-map by day, with shadows. Weathers take turns, so that the load of the machine affects all equally; a
figure is the median of the rounds, and its ratio the median of the ratios to clear air in the same round. Limits: a
tick in rain at most 1.25 times, an image at most 1.15 times that in clear air. --only-clear: to compare clear air with
another version of the simulator.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from step import with_fast_lidar

import autodrive
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.sensors.camera.camera import Camera
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world.factory import compile_scenario
from autodrive.world.views.cameras import camera_rig

ROUNDS, TICKS = 15, 100
WEATHERS = {
    "clear": None,
    "rain": {"clouds": 1.0, "rain": 0.8},
    "fog": {"clouds": 0.5, "fog": 0.8},
    "snow": {"clouds": 1.0, "snow": 0.8},
}
LIMITS = {"tick": 1.25, "images": 1.15}
"""In rain, relative to clear air."""


def ticks(world: autodrive.World) -> None:
    """Drive in a circle."""
    for _ in range(TICKS):
        world.step({"V1": autodrive.Command(throttle=0.4, steering=0.2)})


def in_turn(works: Mapping[str, Callable[[], None]], count: int, what: str) -> None:
    """Print the CPU time of each piece of work, which has `count` parts, relative to the first one."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for done in range(-1, ROUNDS):  # the first round warms caches up
        for name, work in works.items():
            start = time.process_time()
            work()
            if done >= 0:
                times[name].append((time.process_time() - start) / count)
    clear = next(iter(times.values()))
    for name, its in times.items():
        ratio = statistics.median(one / other for one, other in zip(its, clear, strict=True))
        limit = f", limit {LIMITS[what]}" if name == "rain" else ""
        print(f"{what:<7} {name:<6} {1e6 * statistics.median(its):9.1f} us   {ratio:5.3f} times clear{limit}")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--only-clear", action="store_true")
    weathers = {"clear": None} if parser.parse_args().only_clear else WEATHERS
    settled = {name: {"weather": amounts} if amounts else {} for name, amounts in weathers.items()}
    with tempfile.TemporaryDirectory() as folder:
        car = VehiclePlacement(type=with_fast_lidar(Path(folder)), x=-1.1, y=-0.15)
        worlds = {
            name: autodrive.make(ScenarioSpec(map="mini_map", vehicles={"V1": car}, **more))
            for name, more in settled.items()
        }
    in_turn({name: lambda world=world: ticks(world) for name, world in worlds.items()}, TICKS, "tick")

    compiled = compile_scenario("mini_map")
    rig = camera_rig(compiled)
    cameras = [Camera(s.spec, vehicle=s.vehicle, name=s.camera, substep=rig.substep) for s in rig.slots[:2]]
    renderer = Renderer(scene_of(compiled), "software-fxaa")
    states = {
        name: RenderState.of(autodrive.make(ScenarioSpec(map="mini_map", **more)).step())
        for name, more in settled.items()
    }

    def draw(state: RenderState) -> None:
        renderer.draw(state, [view for camera in cameras for view in camera.views(state.vehicles[0], state.time)])

    in_turn({name: lambda state=state: draw(state) for name, state in states.items()}, 1, "images")


if __name__ == "__main__":
    main()
