"""Tests of the meshes of race tracks: they are where the solid pieces are, and face outward."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from autodrive.base.errors import SpecError
from autodrive.graphics.meshes.track import barrier_nodes
from autodrive.scenario.maps.map import load_map, track_map
from autodrive.scenario.maps.track_map import barriers
from autodrive.scenario.tracks.track import Track


@pytest.mark.parametrize("name", ["practice", "fast"])
def test_barriers_are_drawn_where_they_are_and_face_outward(name: str) -> None:
    map_ = load_map(name)
    assert map_.track is not None
    nodes = list(barrier_nodes(map_.track))
    solid = shapely.union_all([shape.plan for shape in map_.statics])
    # the pieces are boxes with square ends, which leave wedges on the outside of bends
    near = solid.buffer(0.03)
    tops = []
    for node in nodes:
        for surface in node.surfaces["full"]:
            points = surface.positions.astype(np.float64)
            assert shapely.contains_xy(near, points[:, 0], points[:, 1]).all()
            a, b, c = (points[surface.triangles[:, i]] for i in range(3))
            facing = np.cross(b - a, c - a)
            area = np.linalg.norm(facing, axis=1)
            normal = surface.normals[surface.triangles].mean(axis=1)
            is_inward = np.sum(facing * normal, axis=1) < 0.0
            # where a duct begins a millimetre before a corner, strips of a millimetre overlap
            assert area[is_inward].sum() < 5e-3 * area.sum()
            tops.append(points[:, 2].max())
            assert points[:, 2].min() >= -1e-6
    assert max(tops) == pytest.approx(map_.track.barrier.height, rel=0.03)
    total = sum(len(surface.triangles) for node in nodes for surface in node.surfaces["shadow"])
    assert total < 12 * len(map_.statics)


def test_the_shadow_of_a_duct_is_nowhere_outside_of_what_is_drawn() -> None:
    """Else the duct would have dark specks: each corner of the shadow mesh is a corner of the drawn one."""
    map_ = load_map("practice")
    assert map_.track is not None
    for node in barrier_nodes(map_.track):
        drawn, shadow = (
            {tuple(p) for s in node.surfaces[detail] for p in np.round(s.positions, 5).tolist()}
            for detail in ("reduced", "shadow")
        )
        assert shadow <= drawn


def test_a_duct_is_drawn_where_a_vehicle_hits_it() -> None:
    """Up to two thirds of its height, above the LIDARs of all vehicles, its side is that of the solid pieces."""
    map_ = load_map("practice")
    assert map_.track is not None
    half = 0.5 * map_.track.barrier.height
    faces = shapely.MultiLineString([barrier.points for barrier in barriers(map_.track)])
    away = []
    for node in barrier_nodes(map_.track):
        for surface in node.surfaces["full"]:
            points = surface.positions.astype(np.float64)
            is_side = (points[:, 2] < 2.0 / 1.5 * half + 1e-6) & (surface.normals[:, 2] < 0.1)
            away.append(np.array(shapely.distance(faces, shapely.points(points[is_side, :2]))))
    of_faces = [found[found < half] for found in away]  # the other points belong to the backs
    assert sum(map(len, of_faces)) > 800
    assert max(found.max() for found in of_faces) < 1e-4


def test_a_track_without_walls_makes_no_map() -> None:
    circle = 3.0 * np.exp(2j * np.pi * np.arange(60) / 60)
    line = np.column_stack([circle.real, circle.imag, np.full((60, 2), 0.5)])
    track = Track("circle", line)
    with pytest.raises(SpecError, match="there are no walls; `autodrive import track"):
        track_map(track)
    assert list(barrier_nodes(track)) == []
