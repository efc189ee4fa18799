"""Compiles what a run may need later, in a process of low priority: traffic, races, batches, environments.

So neither another scenario nor `autodrive race` or `autodrive play` waits for it.
"""

from __future__ import annotations

import os
import sys
from contextlib import closing, suppress
from typing import TYPE_CHECKING

from autodrive.base import jit
from autodrive.base.child_process import start_module

if TYPE_CHECKING:
    import subprocess


def compile_later() -> subprocess.Popen[bytes] | None:
    """Start the process; None if its code could not be saved."""
    return start_module(__name__) if jit.can_save() else None


def main() -> None:
    """Call what is to be compiled, and an environment if its packages are installed."""
    if hasattr(os, "nice"):  # not on Windows, where the priority is low already
        os.nice(19)
    use()
    with suppress(ImportError):
        import gymnasium

        with closing(gymnasium.make("autodrive:RoboRacer-v0")) as environment:
            environment.reset(seed=0)
            environment.step(environment.action_space.sample())


def use() -> None:
    """Call what is to be compiled."""
    import autodrive
    from autodrive.scenario.scenario import TrafficSpec
    from autodrive.scenario.v2x import V2xSpec

    noisy = autodrive.ScenarioSpec(
        map="mini_map",
        vehicles={
            "V1": autodrive.VehiclePlacement(has_realistic_sensors=True),
            "V2": autodrive.VehiclePlacement(x=1.0),
        },
        v2x=V2xSpec(jitter=0.01, position_noise=0.01),
    )
    beside = {"V1": autodrive.VehiclePlacement(y=1.15)}
    traffic = autodrive.ScenarioSpec(map="oval", vehicles=beside, traffic=TrafficSpec(cars=2))
    for scenario in (noisy, "tiny_town", traffic, "practice"):  # tiny_town: stop lines; practice: a race
        world = autodrive.make(scenario)
        for _ in range(50):  # in half a second each sensor samples
            world.step({})
    autodrive.BatchWorld("mini_map", n=2).step([[[0.0, 0.0]]] * 2)
    try:
        autodrive.make("mini_map", cameras=True).step({})
    except autodrive.GlUnavailable as error:
        print(f"without the code of the cameras: {error}", file=sys.stderr)
