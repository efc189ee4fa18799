"""Random maps and tracks: what cameras see, LIDARs measure and vehicles hit is at the same place within 5 mm.

AUTODRIVE_HARDENING=long looks at 200 of them instead of 3.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from autodrive.base.arrays import Floats
from autodrive.scenario.maps.map import Map
from tests.support.hardening import cases
from tests.support.scenes import needs_gl
from tests.support.shapes import PROBE, TOLERANCE, Hits, Shapes, nearest_triangle, random_scenario

pytestmark = needs_gl

VIEWS = cases(2, 6)
PROBES = 10
"""Of a view: places in it at which a cube looks for contacts."""


@pytest.mark.filterwarnings("ignore:.*is outside the walls of map", "ignore:.*map .* is a draft")
@pytest.mark.parametrize("seed", cases((9, 28, 135), tuple(range(200))))
def test_cameras_lidars_and_contacts_agree(seed: int, tmp_path: Path) -> None:
    shapes = Shapes(random_scenario(seed, tmp_path))
    rng = np.random.default_rng(seed + 1000)
    hit = 0
    try:
        for _ in range(VIEWS):
            position = eye(shapes.compiled.map, rng)
            hits = shapes.hits(*position, float(rng.uniform(-180.0, 180.0)), float(rng.choice([0.0, 10.0, 30.0])))
            if (hits.contact < 0.01).any() or (hits.lidar == 0.0).any():
                continue  # it is inside of something
            hit += int(np.isfinite(hits.lidar).sum())
            check_surfaces(shapes, hits)
            check_contacts(shapes, hits, rng)
            measured, expected = shapes.scan(np.array(position))
            assert_equal_but_at_one_rim(measured, expected)
    finally:
        shapes.release()
    assert hit > 100


def eye(map_: Map, rng: np.random.Generator) -> tuple[float, float, float]:
    """Where a vehicle can see from: anywhere on a map; on a track, lower than its barriers."""
    if map_.track is None:
        x, y = rng.uniform(-8.0, 8.0, 2).tolist()
        return x, y, float(rng.choice([0.101, 0.146, 0.207, 0.301, 0.601, 1.201]))  # no top of a box
    x, y, _ = map_.track.pose_at(float(rng.uniform(0.0, map_.track.length)), float(rng.uniform(-0.3, 0.3)))
    return x, y, float(rng.uniform(0.03, 0.98)) * map_.track.barrier.height


def check_surfaces(shapes: Shapes, hits: Hits) -> None:
    """What is drawn is where the rays of LIDARs and of MuJoCo end."""
    assert_equal_but_at_one_rim(hits.lidar, hits.contact)
    apart = shapes.apart(hits)
    assert apart.max() < TOLERANCE, (hits.origin, hits.directions[int(np.argmax(apart))])


def assert_equal_but_at_one_rim(a: Floats, b: Floats) -> None:
    """One ray at the rim of a shape may hit or miss it: rounding decides."""
    assert (~np.isclose(a, b, rtol=0.0, atol=1e-7)).sum() <= 1


def check_contacts(shapes: Shapes, hits: Hits, rng: np.random.Generator) -> None:
    """The cube touches something with its middle on what is drawn, and nothing where nothing is drawn."""
    touches = free = 0
    for k in rng.permutation(np.flatnonzero(np.isfinite(hits.camera)))[:PROBES].tolist():
        point = hits.point(float(hits.camera[k]), k)
        _, normal = nearest_triangle(shapes.triangles, point)
        if abs(normal[2]) < 1e-3 or abs(normal[2]) > 0.999:
            assert shapes.touched(point, math.atan2(normal[1], normal[0])), point
            touches += 1
        ahead = hits.point(float(hits.camera[k] * rng.uniform(0.3, 1.0)), k)
        clearance, _ = nearest_triangle(shapes.triangles, ahead)
        if clearance > math.sqrt(0.75) * PROBE + TOLERANCE:
            assert not shapes.touched(ahead, float(rng.uniform(-3.0, 3.0))), ahead
            free += 1
    assert touches + free > 0 or np.isinf(hits.camera).all()
