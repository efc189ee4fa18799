"""CPU time of a substep and of a scan beside more and more fixed shapes, which stand equally dense.

    uv run benchmarks/shapes.py

CPU time of one core, medians. Posts 1 m apart on a square lattice: the car has the same neighbours in each row, so that
the time should not grow. "With the engine": it is called in every substep. The LIDAR has 1080 rays up to 12 m.
"""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections.abc import Callable
from fractions import Fraction

import numpy as np

import autodrive
from autodrive.physics.buffers import scratch, vehicle_contacts
from autodrive.physics.engine import Engine
from autodrive.physics.model import BOX, Model, ShapeTable
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.settings import ConfiguredSensor
from autodrive.physics.sensors.suite import SensorSuite
from autodrive.physics.state import State, empty_state
from autodrive.physics.tick import advance
from autodrive.scenario.maps.mjcf import world_mjcf
from autodrive.scenario.maps.solids import StaticShape, fixed_shapes
from autodrive.scenario.vehicles.mjcf import vehicle_mjcf
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


def posts(count: int) -> ShapeTable:
    """So many posts around the origin, the nearest ones 0.7 m away."""
    side = round(math.sqrt(count))
    places = itertools.product(range(-(side // 2), side - side // 2), repeat=2)
    return fixed_shapes(
        [StaticShape("", "", BOX, (0.05, 0.05, 0.15), (x + 0.5, y + 0.5, 0.15), 0.0, "post") for x, y in places]
    )


def with_fixed(model: Model, fixed: ShapeTable) -> Model:
    """The model with these shapes in place of its fixed ones."""
    names = ("kind", "size", "bounding_radius", "position", "rotation", "vehicle", "dof", "qpos")
    old = model.shapes
    columns = {name: np.concatenate([getattr(fixed, name), getattr(old, name)[old.n_fixed :]]) for name in names}
    return model._replace(shapes=fixed._replace(**columns))


def state_of(world: World, model: Model) -> State:
    """The state of the world beside the shapes of the model."""
    state = empty_state(model, n_body=1)
    for name, column, old in zip(State._fields, state, world.compiled.state, strict=True):
        if not name.startswith("shape_"):
            column[:] = old
    for column, fixed in ((state.shape_position, model.shapes.position), (state.shape_rotation, model.shapes.rotation)):
        column[: model.shapes.n_fixed] = fixed[: model.shapes.n_fixed]
    return state


def measured(world: World, count: int) -> tuple[int, float, float, float]:
    """Number of fixed shapes, CPU time of a substep without and with the engine, and of a scan [us]."""
    c = world.compiled
    fixed = posts(count)
    car = vehicle_mjcf("V1", c.vehicles["V1"], 0.0, 0.0, 0.0)
    engine = Engine(world_mjcf(c.map, [], [car], c.spec.substep, c.spec.gravity), fixed)
    model = with_fixed(c.model, fixed)
    state = state_of(world, model)
    lidars = {"V1": {"lidar": ConfiguredSensor(LidarSpec(rays=1080, rate=100.0), is_on=True, noise="file")}}
    sensors = SensorSuite(lidars, model.shapes, state, substep=Fraction(1, 100), substeps=1, gravity=c.spec.gravity)
    sensors.reset(0)
    ticks = itertools.count()
    command = np.zeros(1)
    buffers = engine.views(), vehicle_contacts(model), scratch(model, n_body=1)

    def substeps(*, always_engine: bool) -> None:
        advance(model, state, *buffers, command, command, 0, SUBSTEPS, always_engine)

    return (
        model.shapes.n_fixed,
        median_us(lambda: substeps(always_engine=False), SUBSTEPS),
        median_us(lambda: substeps(always_engine=True), SUBSTEPS),
        median_us(lambda: [sensors.sample(next(ticks)) for _ in range(SCANS)], SCANS),
    )


def main() -> None:
    world = autodrive.make("plane")
    for count in COUNTS:
        fixed, substep, with_engine, scan = measured(world, count)
        print(
            f"{fixed:6d} fixed shapes: substep {substep:5.2f} us, with the engine {with_engine:5.2f} us, "
            f"scan {scan:6.1f} us"
        )


if __name__ == "__main__":
    main()
