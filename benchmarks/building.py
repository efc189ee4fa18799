"""How long an edit of a map takes until a client has the new Frame and the new Scene, and where the time goes.

    uv run benchmarks/building.py [--modules 100] [--edits 12] [--running] [--every 2] [--profile 30]

The map has that many modules. Each edit moves one of them, as somebody does who builds. `--running`: time runs
meanwhile; otherwise the simulation is paused. `--every`: least time between two edits [s], as of a person: while time
runs, the requests of a client have a fifth of the time. The server and the client are in one process. `--profile`:
prints that many functions that take the most time in an edit without server and client.
"""

from __future__ import annotations

import argparse
import cProfile
import math
import pstats
import statistics
import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import autodrive
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import EditMap, MapModule, MapPart
from autodrive.world import World
from autodrive.world.factory import new_world
from autodrive.world.simulation import Simulation
from autodrive.world.views.scene_files import SceneFiles

P = ParamSpec("P")
T = TypeVar("T")

KINDS = {
    "four_way_intersection": 0.0,
    "straight_road": 1.0,
    "road_patch": 1.4,
    "parking_lot": 2.2,
    "straight_road ": 3.2,
    "curved_road": 4.0,
}
"""A row of modules, with their x [m]; rows are 4 m apart."""


def town(modules: int) -> dict[str, MapPart]:
    """Rows of joined modules with open ends, and a lawn."""
    parts: dict[str, MapPart] = {"lawn": MapModule("lawn", 5.5, 16.0, length=14.0, width=38.0)}
    for i in range(modules - 1):
        (kind, x), row = [*KINDS.items()][i % len(KINDS)], i // len(KINDS)
        y = {"parking_lot": 1.0, "curved_road": 0.2}.get(kind, 0.0)
        parts[f"m{i}"] = MapModule(kind.strip(), x + 7.0 * (row % 2), y + 4.0 * (row // 2))
    return parts


def moved(parts: dict[str, MapPart], i: int) -> dict[str, MapPart | None]:
    """The last module at another place, which differs in each edit."""
    (name, last) = [*parts.items()][-1]
    assert isinstance(last, MapModule)
    return {name: MapModule(last.module, last.x + 0.2 + 0.01 * i, last.y, math.pi * (i % 2))}


def timed(spent: list[float], work: Callable[P, T]) -> Callable[P, T]:
    """The same function, whose times [s] are noted."""

    def measured(*args: P.args, **kwargs: P.kwargs) -> T:
        start = time.perf_counter()
        try:
            return work(*args, **kwargs)
        finally:
            spent.append(time.perf_counter() - start)

    return measured


def scenery(world: World) -> SceneFiles:
    """What clients get to draw a world."""
    return SceneFiles.of(world, "plane")


def measure(modules: int, edits: int, *, every: float, is_running: bool) -> dict[str, list[float]]:
    """Times of each edit [s], by what was done."""
    times: dict[str, list[float]] = {"world": [], "scene files": [], "request to Frame": [], "request to Scene": []}
    simulation = Simulation(new_world("plane"), is_paused=not is_running, load=timed(times["world"], new_world))
    served = Served(simulation, timed(times["scene files"], scenery))
    with simulation, SimulationServer(served, PageOptions(port=0)) as server, autodrive.Client(server.url) as client:
        parts = town(modules)
        client.edit_map(parts)
        time.sleep(3.0)  # the first edit takes longest
        for one in times.values():
            one.clear()
        for i in range(edits):
            change = moved(parts, i)
            start = time.perf_counter()
            client.edit_map(change)
            times["request to Frame"].append(time.perf_counter() - start)
            while not (scene := client.scene.map_scene) or any(scene.parts[name] == parts[name] for name in change):
                time.sleep(0.002)
            times["request to Scene"].append(time.perf_counter() - start)
            parts |= {name: part for name, part in scene.parts.items() if name in change}
            time.sleep(max(start + every - time.perf_counter(), 0.0))
    return times


def profile(modules: int, functions: int) -> None:
    """The functions that take the most time in an edit."""
    simulation = Simulation(new_world("plane"), load=new_world)
    parts = town(modules)

    def edit(change: dict[str, MapPart] | dict[str, MapPart | None]) -> World:
        done = simulation.request(EditMap({**change}))
        simulation.execute_requests()
        done.result(0)
        return simulation.world

    scenery(edit(parts))
    scenery(edit(moved(parts, 0)))
    with cProfile.Profile() as profiler:
        scenery(edit(moved(parts, 1)))
    pstats.Stats(profiler).sort_stats("cumulative").print_stats(functions)
    simulation.world.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--modules", type=int, default=100)
    parser.add_argument("--edits", type=int, default=12)
    parser.add_argument("--running", action="store_true")
    parser.add_argument("--every", type=float, default=0.0)
    parser.add_argument("--profile", type=int, default=0)
    given = parser.parse_args()
    if given.profile:
        profile(given.modules, given.profile)
        return
    for name, times in measure(given.modules, given.edits, every=given.every, is_running=given.running).items():
        print(f"{name:18} median {1e3 * statistics.median(times):6.0f} ms, greatest {1e3 * max(times):6.0f} ms")


if __name__ == "__main__":
    main()
