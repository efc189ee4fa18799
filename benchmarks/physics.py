"""What a physics substep of 1 ms costs in the compiled loop, beside MuJoCo's own step of the same bodies.

    uv run benchmarks/physics.py

CPU time of one core, medians; the engine's step alone is the part that no wheel model can save.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable

import mujoco

import autodrive
from autodrive.physics.tick import advance
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World

ROUNDS, SUBSTEPS = 21, 500


def medians_us(runs: list[Callable[[], None]], prepare: Callable[[], None]) -> list[float]:
    """Median CPU time of a substep [us] for each of the runs, which take turns."""
    figures: list[list[float]] = [[] for _ in runs]
    for _ in range(ROUNDS):
        for run, kept in zip(runs, figures, strict=True):
            prepare()
            start = time.process_time()
            run()
            kept.append((time.process_time() - start) / SUBSTEPS * 1e6)
    return [statistics.median(kept) for kept in figures]


def loop(world: World) -> Callable[[], None]:
    """The compiled substep loop, without sensors and Frame."""
    c = world._compiled
    world._throttle[:] = 0.4

    def run() -> None:
        advance(c.model, c.state, c.views, c.touches, c.scratch, world._throttle, world._steering, 0, SUBSTEPS)

    return run


def engine_alone(world: World) -> Callable[[], None]:
    """As many steps of the engine, with the wheels' last forces."""
    engine = world._compiled.engine

    def run() -> None:
        mujoco.mj_step(engine.model, engine.data, SUBSTEPS)

    return run


def measured(title: str, world: World, stir: Callable[[], None]) -> None:
    snapshot = world.save()

    def prepare() -> None:
        world.restore(snapshot)
        stir()

    ours, alone = medians_us([loop(world), engine_alone(world)], prepare)
    print(f"{title:45s} {ours:6.2f} us   engine alone {alone:6.2f} us   ratio {ours / alone:.2f}")


def main() -> None:
    town = autodrive.make(ScenarioSpec(map="tiny_town", vehicles={"V1": VehiclePlacement(x=-1.1, y=-0.15)}))
    for _ in range(100):
        town.step()
    measured("car on tiny_town, boxes asleep", town, lambda: None)
    boxes = {
        f"box_{i}": BoxSpec(
            x=1.5 * math.cos(i), y=1.5 * math.sin(i), z=0.05 + 0.1 * (i % 3) if i < 6 else None, mass=0.1 + 0.04 * i
        )
        for i in range(10)
    }
    yard = autodrive.make(ScenarioSpec(boxes=boxes))
    for _ in range(100):
        yard.step()
    measured("car and ten boxes asleep, plane", yard, lambda: None)
    views, model = yard._compiled.views, yard._compiled.engine.model

    def stir() -> None:
        model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        yard._compiled.engine.update()
        views.qvel[:] += 1e-9

    measured("car and ten boxes awake, plane", yard, stir)


if __name__ == "__main__":
    main()
