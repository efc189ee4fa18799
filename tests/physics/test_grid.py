"""The grid over the fixed shapes finds each shape near a place, once, and few others; it changes no reading."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autodrive.physics.grid import shapes_near
from autodrive.physics.model import BOX, CYLINDER, SPHERE, ShapeTable
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.range import RangeSpec
from tests.support.one_sensor import OneSensor
from tests.support.sensor_scenes import Solid, scene, shapes_of


def turned(yaw: float) -> list[float]:
    return [math.cos(yaw), -math.sin(yaw), 0.0, math.sin(yaw), math.cos(yaw), 0.0, 0.0, 0.0, 1.0]


def solids(seed: int, count: int, extent: float) -> list[Solid]:
    """Boxes, cylinders and spheres; some of the boxes are long walls."""
    rng = np.random.default_rng(seed)
    made: list[Solid] = []
    for _ in range(count):
        kind = int(rng.choice([BOX, BOX, CYLINDER, SPHERE]))
        length = float(rng.choice([0.3, 0.3, 0.3, 10.0]))
        size = {BOX: [rng.uniform(0.05, length), 0.1, 0.3], CYLINDER: [0.1, 0.3], SPHERE: [0.2]}[kind]
        made.append(Solid(kind, size, [*rng.uniform(-extent, extent, 2), 0.2], turned(rng.uniform(-math.pi, math.pi))))
    return made


def found(shapes: ShapeTable, x: float, y: float, distance: float) -> list[int]:
    room = np.full(len(shapes.kind), -1, np.int64)
    count = shapes_near(shapes, x, y, distance, room)
    return room[:count].tolist()


def corners(solid: Solid) -> Sequence[np.ndarray]:
    """Of a box, seen from above."""
    length, width = solid.rotation[:2, 0] * solid.size[0], solid.rotation[:2, 1] * solid.size[1]
    return [solid.position[:2] + a * length + b * width for a in (-1, 1) for b in (-1, 1)]


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(0, 60),
    x=st.floats(-60.0, 60.0),
    y=st.floats(-60.0, 60.0),
    distance=st.floats(0.0, 30.0),
)
def test_each_shape_with_a_point_in_the_square_is_found_once(
    seed: int, count: int, x: float, y: float, distance: float
) -> None:
    several = solids(seed, count, extent=20.0)
    moving = [Solid(SPHERE, [0.1], [99.0, 99.0, 0.0])]
    near = found(shapes_of([*several, *moving], n_fixed=count), x, y, distance)
    assert len(near) == len(set(near))
    assert count in near  # what moves is found everywhere
    for number, solid in enumerate(several):
        points = [solid.position[:2], *(corners(solid) if solid.kind == BOX else [])]
        if any(max(abs(point - (x, y))) <= distance for point in points):
            assert number in near


def test_no_more_shapes_are_found_on_a_larger_map() -> None:
    counts = []
    for side in (20, 100):
        blocks = [Solid(BOX, [0.2, 0.2, 0.2], [x, y, 0.2]) for x in range(side) for y in range(side)]
        counts.append(len(found(shapes_of(blocks, n_fixed=len(blocks)), 10.0, 10.0, 3.0)))
    assert counts[0] == counts[1] <= 100


@pytest.mark.parametrize("where", [(1e8, 0.0), (-1e8, -1e8), (0.0, 1e300)])
def test_a_place_far_outside_of_the_map_is_no_error(where: tuple[float, float]) -> None:
    several = solids(1, 30, extent=5.0)
    assert len(found(shapes_of(several, n_fixed=30), *where, 1.0)) < 30


@pytest.mark.parametrize("seed", range(4))
def test_range_sensors_have_the_same_readings_with_and_without_the_grid(seed: int) -> None:
    several = solids(seed, 80, extent=8.0)
    for is_rolling in (False, True):
        readings = []
        for n_fixed in (0, 80):
            where = scene(several, n_fixed=n_fixed, vehicle_position=[(0.1, 0.2, 0.15)])
            lidar = OneSensor(LidarSpec(range_max=6.0, is_rolling=is_rolling), where).sample()
            distance = OneSensor(RangeSpec(), where).sample()
            readings.append((lidar.ranges.tobytes(), distance.range))
        assert readings[0] == readings[1]
        assert np.isfinite(np.frombuffer(readings[0][0])).any()
