"""Tests of the meshes of race tracks: they are where the solid pieces are, and face outward."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
import shapely

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.graphics.meshes.track import barrier_nodes
from autodrive.scenario.maps.map import load_map, track_map
from autodrive.scenario.maps.track_map import barriers
from autodrive.scenario.tracks.track import BarrierSpec, Track


@pytest.mark.parametrize("name", ["practice", "fast"])
def test_barriers_are_drawn_where_they_are_and_face_outward(name: str) -> None:
    map_ = load_map(name)
    assert map_.track is not None
    nodes = list(barrier_nodes(map_.track))
    solid = shapely.union_all([shape.plan for shape in map_.statics])
    # the pieces are boxes with square ends, which leave wedges on the outside of bends: only the top covers them
    side, top = solid.buffer(0.002), solid.buffer(0.03)
    tops = []
    for node in nodes:
        for surface in node.surfaces["full"]:
            points = surface.positions.astype(np.float64)
            is_top = points[:, 2] > 0.99 * map_.track.barrier.height
            assert shapely.contains_xy(side, *points[~is_top, :2].T).all()
            assert shapely.contains_xy(top, *points[:, :2].T).all()
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
    """At all heights its side is that of the solid pieces."""
    map_ = load_map("practice")
    assert map_.track is not None
    spec = map_.track.barrier
    faces = shapely.MultiLineString([barrier.points for barrier in barriers(map_.track)])
    points = np.concatenate(
        [s.positions for node in barrier_nodes(map_.track) for s in node.surfaces["full"]], dtype=np.float64
    )
    away = np.array(shapely.distance(faces, shapely.points(points[:, :2])))
    is_side = away < 0.4 * spec.width  # the other points belong to the middle of the top and to the back
    assert is_side.sum() > 800
    assert away[is_side].max() < 1e-4
    assert points[is_side, 2].max() == pytest.approx(spec.height)


def test_what_is_drawn_of_a_duct_encloses_its_volume() -> None:
    """Its ends face outward, too: else they are not drawn, and a camera looks through the gap into a hollow duct."""
    square = np.array([[2.0, 2.0], [-2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]])
    barrier = BarrierSpec(kind="duct", width=0.1, height=0.2, length=0.9, gap=0.1)  # the gaps are at the corners
    nodes = list(barrier_nodes(Track("square", circle(1.0), walls=(square[::-1],), barrier=barrier)))
    assert len(nodes) == 16
    for node in nodes:
        for detail in ("full", "reduced", "shadow"):
            (surface,) = node.surfaces[detail]
            a, b, c = np.moveaxis(surface.positions.astype(np.float64)[surface.triangles], 1, 0)
            # the divergence theorem; the open bottom is in the plane of the origin, where it adds nothing
            volume = np.sum(a * np.cross(b, c)) / 6.0
            assert volume == pytest.approx(0.9 * 0.1 * 0.2, rel=1e-5)  # float32


@pytest.mark.parametrize("kind", ["wall", "duct"])
def test_all_solid_pieces_of_a_barrier_are_drawn(kind: Literal["wall", "duct"]) -> None:
    """A piece of a millimetre between two thin ones has the full depth of the barrier."""
    island = np.array([[-0.6612, -3.6729], [-0.8779, -3.3534], [-0.3972, -3.3909], [-0.397, -3.3924]])
    track = Track("island", circle(3.5), walls=(island,), barrier=BarrierSpec(kind=kind, width=0.23, height=0.3))
    plans = [shape.plan for shape in track_map(track).statics]
    corners = np.vstack([np.array(plan.exterior.coords) for plan in plans])
    drawn = []
    for node in barrier_nodes(track):
        for surface in node.surfaces["reduced"]:
            triangles = surface.positions.astype(np.float64)[surface.triangles]
            is_top = (triangles[..., 2] > 0.299).all(axis=1)
            drawn.append(shapely.union_all(shapely.polygons(triangles[is_top, :, :2])))
    away = shapely.distance(shapely.union_all(drawn), shapely.points(corners))
    assert np.max(away) < 0.003  # pieces are longer by a millimetre at both ends


def test_a_track_without_walls_makes_no_map() -> None:
    track = Track("circle", circle(3.0))
    with pytest.raises(SpecError, match="there are no walls; `autodrive import track"):
        track_map(track)
    assert list(barrier_nodes(track)) == []


def circle(radius: float) -> Floats:
    """A centre line of that radius [m], shape (60, 4)."""
    points = radius * np.exp(2j * np.pi * np.arange(60) / 60)
    return np.column_stack([points.real, points.imag, np.full((60, 2), 0.5)])
