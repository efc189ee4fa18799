"""CPU time of a physics substep of 1 ms in the compiled loop, compared with MuJoCo's step of the same bodies.

    uv run benchmarks/physics.py

CPU time of one core, medians. "always": the engine is called in every substep, also while nothing can touch. The step
of the engine alone is the lower limit for any wheel model then.
"""

# pyright: reportAttributeAccessIssue=false
# (the bindings of MuJoCo have no types)

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable

import mujoco

import autodrive
from autodrive.physics.engine import AWAKE
from autodrive.physics.tick import advance
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World

ROUNDS, SUBSTEPS = 21, 500


def medians_us(runs: list[Callable[[], None]], prepare: Callable[[], None]) -> list[float]:
    """Median CPU time of a substep [us] for each of the runs, which alternate."""
    figures: list[list[float]] = [[] for _ in runs]
    for _ in range(ROUNDS):
        for run, times in zip(runs, figures, strict=True):
            prepare()
            start = time.process_time()
            run()
            times.append((time.process_time() - start) / SUBSTEPS * 1e6)
    return [statistics.median(times) for times in figures]


def loop(world: World, substeps: int = SUBSTEPS, *, always_engine: bool = True) -> Callable[[], None]:
    """The compiled substep loop, without sensors and Frame."""
    c = world.compiled
    controls = world.controls
    controls.throttle[:] = 0.4

    def run() -> None:
        its = c.model, c.state, c.views, c.contacts, c.scratch
        advance(*its, controls.throttle, controls.steering, 0, substeps, always_engine)

    return run


def engine_alone(world: World) -> Callable[[], None]:
    """The same number of steps of the engine, with constant wheel forces."""
    engine = world.compiled.engine

    def run() -> None:
        mujoco.mj_step(engine.model, engine.data, SUBSTEPS)

    return run


def measured(title: str, world: World, stir: Callable[[], None]) -> None:
    snapshot = world.save()

    def prepare() -> None:
        world.restore(snapshot)
        stir()
        loop(world, substeps=1)()  # brings the engine to that state

    runs = [loop(world, always_engine=False), loop(world), engine_alone(world)]
    auto_us, always_us, engine_us = medians_us(runs, prepare)
    print(f"{title:37s} {auto_us:6.2f} us   always {always_us:6.2f} us   engine alone {engine_us:6.2f} us")


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
    state, model = yard.compiled.state, yard.compiled.engine.model

    def stir() -> None:
        model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        state.asleep[:] = AWAKE

    measured("car and ten boxes awake, plane", yard, stir)


if __name__ == "__main__":
    main()
