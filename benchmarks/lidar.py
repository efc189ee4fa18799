"""Measures the cost of a LIDAR scan, compared with mj_multiRay of MuJoCo in the same pose and world.

    uv run benchmarks/lidar.py [SCENARIO ...]

CPU time of one core, medians over interleaved rounds; the results of both are compared first.
"""

from __future__ import annotations

import itertools
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import mujoco
import numpy as np

from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.settings import ConfiguredSensor
from autodrive.physics.sensors.suite import SensorSuite
from autodrive.protocol.messages import LidarScan
from autodrive.scenario import load_scenario
from autodrive.world.compile import CompiledScenario

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.whole_map import whole_map_world

ROUNDS, CALLS = 21, 200
RAYS = (360, 1080)


def main() -> None:
    scenarios = sys.argv[1:] or ["tiny_town"]
    print(f"{'scenario':12} {'shapes':>6} {'rays':>5} {'scan':>8} {'rolling':>8} {'mj_multiRay':>12}   [us a scan]")
    for name in scenarios:
        world = whole_map_world(load_scenario(name))  # MuJoCo's rays meet what is in the engine
        for _ in range(50):
            world.step()  # the vehicle settles and is slightly tilted
        for rays in RAYS:
            c = world.compiled
            costs = medians(candidates(c, rays))
            print(f"{name:12} {len(c.model.shapes.kind):6} {rays:5} " + " ".join(f"{cost:8.1f}" for cost in costs))


def candidates(c: CompiledScenario, rays: int) -> list[Callable[[], object]]:
    """Our instantaneous scan, our rolling scan (at rest, a whole period in one tick), and the scan of MuJoCo."""
    mounted = next(iter(c.vehicles.values())).sensors.lidar
    assert mounted is not None, "the scenario's first vehicle has no LIDAR"
    spec = LidarSpec(rays=rays, mount=mounted.mount)
    instant, rolling = lidar(c, spec), lidar(c, spec.model_copy(update={"is_rolling": True}))
    theirs = mujoco_scan(c, spec)
    ours = instant()
    rolling()
    distances = theirs().copy()
    distances[(distances < 0.0) | (distances > spec.range_max)] = np.inf
    distances[distances < spec.range_min] = -np.inf
    assert np.allclose(ours.ranges, distances, rtol=0.0, atol=1e-9), "the two scans differ"
    return [instant, rolling, theirs]


def lidar(c: CompiledScenario, spec: LidarSpec) -> Callable[[], LidarScan]:
    """A LIDAR of the first vehicle, as the World samples it, which makes one scan at each call."""
    vehicles = {name: {"lidar": ConfiguredSensor(spec, is_on=True, noise="file")} for name in list(c.vehicles)[:1]}
    period = 1 / Fraction(str(spec.rate))
    suite = SensorSuite(vehicles, c.model.shapes, c.state, substep=period, substeps=1, gravity=c.spec.gravity)
    suite.reset(0)
    periods = itertools.count()

    def scan() -> LidarScan:
        suite.sample(next(periods))
        return suite.readings(0)["lidar"]

    return scan


def mujoco_scan(c: CompiledScenario, spec: LidarSpec) -> Callable[[], np.ndarray]:
    """Rays of MuJoCo from the same LIDAR, without its own vehicle; buffers are allocated once."""
    state, model, data = c.state, c.engine.model, c.engine.data
    q = state.vehicle_orientation[0]
    turn = rotation(q)
    start = state.vehicle_position[0] + turn @ spec.mount.position
    turn = turn @ rotation(spec.mount.orientation)
    angles = spec.angle_min + spec.angle_increment * np.arange(spec.rays)
    directions = (np.stack([np.cos(angles), np.sin(angles), np.zeros(spec.rays)], axis=1) @ turn.T).ravel()
    body = c.engine.body(next(iter(c.vehicles)))[0]
    geoms, distances = np.zeros(spec.rays, np.int32), np.zeros(spec.rays)

    def run() -> np.ndarray:
        mujoco.mj_multiRay(  # pyright: ignore[reportAttributeAccessIssue]  (missing in the stubs)
            model, data, start, directions, None, True, body, geoms, distances, None, spec.rays, spec.range_max
        )
        return distances

    return run


def rotation(q: Sequence[float] | np.ndarray) -> np.ndarray:
    """Matrix of a quaternion wxyz."""
    w, (x, y, z) = q[0], q[1:]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * (w * cross + cross @ cross)


def medians(calls: list[Callable[[], object]]) -> list[float]:
    """CPU microseconds a call."""
    figures: list[list[float]] = [[] for _ in calls]
    for _ in range(ROUNDS):
        for call, figure in zip(calls, figures, strict=True):
            call()
            begin = time.process_time_ns()
            for _ in range(CALLS):
                call()
            figure.append((time.process_time_ns() - begin) / CALLS / 1e3)
    return [statistics.median(figure) for figure in figures]


if __name__ == "__main__":
    main()
