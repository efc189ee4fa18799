"""Random maps and tracks: what cameras see and what LIDARs measure is at the same place within 5 mm.

The tests of LIDARs compare them with the rays of another engine, those of contacts the shapes that vehicles hit.
AUTODRIVE_HARDENING=long looks at 200 of them instead of 4.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import autodrive
from autodrive.base.arrays import Floats
from autodrive.base.transforms import quaternion_from_yaw, rotation_from_quaternion
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.sensors.rays import cast_rays
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.map import Map
from autodrive.scenario.maps.props import SIGNS
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.track import BarrierSpec
from autodrive.world.compile import CompiledScenario
from tests.support.hardening import cases
from tests.support.scenes import needs_gl, pinhole, view

pytestmark = needs_gl

TOLERANCE = 0.005
"""Largest distance of a surface that is drawn from the one that LIDARs hit, along a ray [m]."""
AT_RIMS = 0.05
"""Largest share of rays that may differ: at a rim one of two rays misses, and a ray along a wall is long."""
REACH = 8.0
"""Hits farther than this are ignored [m]."""
VIEWS = 6
FAR_AWAY = (300.0, 300.0, 50.0)
"""Where the car is, so that nothing sees it [m]."""

CELL = 2.0
"""Each object of a random map has a square of its own, of this edge length [m]."""
MODULES = ("straight_road", "curved_road", "dead_end", "three_way_intersection", "four_way_intersection", "parking_lot")


def random_map(rng: np.random.Generator) -> dict[str, Any]:
    """Walls, blocks, signs, traffic lights, boxes and roads at random poses; the car starts in the middle."""
    tree: dict[str, Any] = {"title": "Random", "is_draft": True, "ground": {"length": 30.0, "width": 30.0}}
    cells = [(CELL * i, CELL * j) for i in range(-3, 4) for j in range(-3, 4) if (i, j) != (0, 0)]
    kinds = rng.permutation(["walls"] * 12 + ["blocks"] * 6 + ["props"] * 18 + ["boxes"] * 6)
    for (x, y), kind in zip(rng.permutation(cells).tolist(), kinds, strict=False):
        yaw = float(rng.uniform(-180.0, 180.0))
        if kind == "walls":
            tree.setdefault("walls", []).append(_wall(rng, x, y))
        elif kind == "blocks":
            length, width = rng.uniform(0.02, 1.2, 2).tolist()
            block = {"x": x, "y": y, "yaw_deg": yaw, "length": length, "width": width}
            tree.setdefault("blocks", []).append(block | {"height": float(rng.uniform(0.02, 0.8))})
        elif kind == "props":
            sign = str(rng.choice([*SIGNS, "traffic_light"]))
            tree.setdefault("props", []).append({"kind": sign, "x": x, "y": y, "yaw_deg": yaw})
        else:
            size = dict(zip(("length", "width", "height"), rng.uniform(0.03, 0.6, 3).tolist(), strict=True))
            box = {"module": "construction_box", "x": x, "y": y, "yaw_deg": yaw, "z": float(rng.choice([0.0, 0.1]))}
            tree.setdefault("placements", []).append(box | size)
    for k, name in enumerate(rng.choice(MODULES, 3).tolist()):
        place = {"module": name, "x": 9.0 * (k - 1), "y": 11.0, "yaw_deg": float(rng.uniform(-180.0, 180.0))}
        tree.setdefault("placements", []).append(place)
    return tree


def _wall(rng: np.random.Generator, x: float, y: float) -> dict[str, Any]:
    """Up to eight points: far from each other, or a millimetre apart; corners may be sharp, ends open."""
    points = [np.array([x, y]) + rng.uniform(-0.8, 0.8, 2)]
    for _ in range(int(rng.integers(1, 8))):
        if rng.random() < 0.2:
            points.append(points[-1] + rng.uniform(-0.002, 0.002, 2))
        else:
            points.append(np.array([x, y]) + rng.uniform(-0.8, 0.8, 2))
    return {
        "points": [point.tolist() for point in points],
        "is_closed": bool(rng.random() < 0.3),
        "thickness": float(rng.choice([0.001, 0.01, 0.05, 0.1, 0.3])),
        "height": float(rng.uniform(0.05, 0.6)),
        "name": f"wall_{x:g}_{y:g}".replace("-", "m"),
    }


def random_track(rng: np.random.Generator) -> str:
    """The file of a generated track with walls or ducts."""
    width, height = rng.uniform(0.02, 0.4), rng.uniform(0.2, 0.5)
    barrier = BarrierSpec(kind="duct", width=width, height=height, length=rng.uniform(0.5, 3.0), gap=0.1)
    if rng.random() < 0.5:
        barrier = BarrierSpec(kind="wall", width=width, height=height)
    return generate_track(int(rng.integers(10_000)), length=30.0, width=1.2, area=(14.0, 10.0), barrier=barrier).text()


@pytest.mark.filterwarnings("ignore:.*is outside the walls of map", "ignore:map.* is not connected")
@pytest.mark.parametrize("seed", cases((9, 28, 134, 135), tuple(range(200))))
def test_cameras_and_lidars_agree(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    file = tmp_path / f"shapes_{seed}.yaml"
    file.write_text(random_track(rng) if seed % 2 else yaml.safe_dump(random_map(rng)), encoding="utf-8")
    compiled = autodrive.make(ScenarioSpec(map=str(file), vehicles={"V1": VehiclePlacement()})).compiled
    renderer = Renderer(scene_of(compiled), "software")
    hit = differs = 0
    try:
        for _ in range(VIEWS):
            camera, lidar = ranges(compiled, renderer, eye(compiled.map, rng), rng)
            if (lidar > 0.0).all():  # it is not inside of something
                hit += int(np.isfinite(lidar).sum())
                differs += int((~np.isclose(camera, lidar, rtol=0.0, atol=TOLERANCE)).sum())
    finally:
        renderer.release()
    assert hit > 30
    assert differs < AT_RIMS * hit


def eye(map_: Map, rng: np.random.Generator) -> tuple[float, float, float]:
    """Where a vehicle can see from: anywhere on a map; on a track, lower than its barriers."""
    if map_.track is None:
        x, y = rng.uniform(-8.0, 8.0, 2).tolist()
        return x, y, float(rng.choice([0.101, 0.146, 0.207, 0.301, 0.601, 1.201]))  # no top of a box
    x, y, _ = map_.track.pose_at(float(rng.uniform(0.0, map_.track.length)), float(rng.uniform(-0.3, 0.3)))
    return x, y, float(rng.uniform(0.03, 0.98)) * map_.track.barrier.height


def ranges(
    compiled: CompiledScenario, renderer: Renderer, position: tuple[float, float, float], rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """What a camera there sees, looking in a random direction, and rays of LIDARs through its pixels [m].

    Infinity: nothing within `REACH`, or the floor, which is drawn with an end and measured without.
    """
    camera = view(*position, rng.uniform(-180.0, 180.0), rng.choice([0.0, 10.0, 30.0]), pinhole(49, 25, 60.0))
    state = RenderState.empty(1, len(compiled.boxes))
    state.vehicles["position"][0], state.vehicles["orientation"][:, 0] = FAR_AWAY, 1.0
    for row, box in zip(state.objects, compiled.boxes, strict=True):
        row["position"], row["orientation"] = box.position, quaternion_from_yaw(box.yaw)
    own = camera.intrinsics
    v, u = np.mgrid[0 : own.height, 0 : own.width] + 0.5
    optical = np.stack([(u - own.cx) / own.fx, (v - own.cy) / own.fy, np.ones_like(u)], axis=-1).reshape(-1, 3)
    length = np.linalg.norm(optical, axis=1)
    directions = optical @ np.array(rotation_from_quaternion(camera.orientation)).reshape(3, 3).T / length[:, None]
    depth = renderer.draw(state, [camera], depth=True)[0].depth
    assert depth is not None
    seen, measured = depth.ravel().astype(float) * length, np.full(len(directions), np.nan)
    shapes = compiled.model.shapes
    cast_rays(
        np.array(position),
        np.array([1.0, 0.0, 0.0, 0.0]),
        np.zeros((len(directions), 3)),
        np.ascontiguousarray(directions),
        2.0 * REACH,
        0,
        shapes,
        compiled.state.shape_position,
        compiled.state.shape_rotation,
        np.zeros(len(shapes.kind), np.int64),
        measured,
    )
    with np.errstate(invalid="ignore"):
        is_floor = np.abs(position[2] + measured * directions[:, 2]) < 1e-6
    is_far = (np.fmin(seen, measured) > REACH) | is_floor
    return np.where(is_far, np.inf, seen), np.where(is_far, np.inf, measured)
