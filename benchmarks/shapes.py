"""CPU time of a substep and of a scan beside more and more fixed shapes, which stand equally dense.

    uv run benchmarks/shapes.py

CPU time of one core, medians. Posts 1 m apart on a square lattice: the car has the same neighbours in each row, so that
the time should not grow. The LIDAR has 1080 rays up to 12 m.
"""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

import autodrive
from autodrive.physics.buffers import scratch
from autodrive.physics.grid import fixed_grid
from autodrive.physics.model import BOX, Model, Shapes
from autodrive.physics.sensors.lidar import LidarSpec
from autodrive.physics.sensors.settings import ConfiguredSensor
from autodrive.physics.sensors.suite import SensorSuite
from autodrive.physics.state import State, empty_state
from autodrive.physics.tick import advance
from autodrive.world import World

COUNTS = (60, 500, 2_000, 10_000)
ROUNDS, SUBSTEPS, SCANS = 15, 300, 50


def median_us(run: Callable[[], object], count: int) -> float:
    """Median CPU time [us] of one of the `count` parts of a run."""
    figures = []
    for _ in range(ROUNDS):
        start = time.process_time()
        run()
        figures.append((time.process_time() - start) / count * 1e6)
    return statistics.median(figures)


def with_posts(model: Model, count: int) -> Model:
    """The model with so many posts around the origin in place of its fixed shapes, the nearest ones 0.7 m away."""
    side = round(math.sqrt(count))
    x, y = np.meshgrid(*2 * [np.arange(side) - side // 2 + 0.5])
    n, old = x.size, model.shapes
    kind, size = np.full(n, BOX), np.tile([0.05, 0.05, 0.15], (n, 1))
    position = np.column_stack([x.ravel(), y.ravel(), np.full(n, 0.15)]).astype(np.float64)
    rotation = np.tile(np.eye(3).ravel(), (n, 1))
    fixed: dict[str, Any] = {
        "kind": kind,
        "size": size,
        "bounding_radius": np.full(n, math.hypot(0.05, 0.05, 0.15)),
        "position": position,
        "rotation": rotation,
        **{name: np.full(n, -1) for name in ("vehicle", "dof", "qpos")},
    }
    columns = {name: np.concatenate([column, getattr(old, name)[old.n_fixed :]]) for name, column in fixed.items()}
    return model._replace(shapes=Shapes(**columns, n_fixed=n, grid=fixed_grid(kind, size, position, rotation)))


def state_of(world: World, model: Model) -> State:
    """The state of the world beside the shapes of the model."""
    state = empty_state(model, n_body=1)
    for name, column, old in zip(State._fields, state, world.compiled.state, strict=True):
        if not name.startswith("shape_"):
            column[:] = old
    for column, fixed in ((state.shape_position, model.shapes.position), (state.shape_rotation, model.shapes.rotation)):
        column[: model.shapes.n_fixed] = fixed[: model.shapes.n_fixed]
    return state


def measured(world: World, count: int) -> tuple[int, float, float]:
    """Number of fixed shapes, CPU time of a substep and of a scan [us]."""
    c = world.compiled
    model = with_posts(c.model, count)
    state = state_of(world, model)
    lidars = {"V1": {"lidar": ConfiguredSensor(LidarSpec(rays=1080, rate=100.0), is_on=True, noise="file")}}
    sensors = SensorSuite(lidars, model.shapes, state, substep=Fraction(1, 100), substeps=1, gravity=c.spec.gravity)
    sensors.reset(0)
    ticks = itertools.count()
    command = np.zeros(1)
    arguments = model, state, c.views, c.contacts, scratch(model, n_body=1), command, command, 0, SUBSTEPS, False
    return (
        model.shapes.n_fixed,
        median_us(lambda: advance(*arguments), SUBSTEPS),
        median_us(lambda: [sensors.sample(next(ticks)) for _ in range(SCANS)], SCANS),
    )


def main() -> None:
    world = autodrive.make("plane")
    for count in COUNTS:
        fixed, substep, scan = measured(world, count)
        print(f"{fixed:6d} fixed shapes: substep {substep:5.2f} us, scan {scan:6.1f} us")


if __name__ == "__main__":
    main()
