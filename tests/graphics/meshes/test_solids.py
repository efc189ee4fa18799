"""Solids against closed forms: volume, closedness, extent, shading."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
import trimesh

from autodrive.graphics.assets.asset import Material
from autodrive.graphics.meshes.solids import box, cylinder, lathe, plate, rotated, surface, wire
from autodrive.protocol.labels import Label

GREY = Material("grey", (0.5, 0.5, 0.5))
DISC = shapely.Point(0.0, 0.0).buffer(1.0)
RING = [(1.0, 0.0), (2.0, 0.0), (2.0, 0.5), (1.0, 0.5), (1.0, 0.0)]
WIRE = wire([(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 3.0)], 0.1, n=12)


def polygon_area(n: int) -> float:
    """Of a regular polygon with n corners on the unit circle."""
    return 0.5 * n * math.sin(2.0 * math.pi / n)


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (box((1.0, 2.0, 3.0), (5.0, 0.0, 0.0)), 6.0),
        (box((4.0, 4.0, 1.0), bevel=1.0, n=64), 12.0 + math.pi),
        (plate(DISC.difference(shapely.box(-0.2, -0.2, 0.2, 0.2)), -1.0, 1.0), 2.0 * (DISC.area - 0.16)),
        (cylinder(2.0, 3.0, n=20), 12.0 * polygon_area(20)),
        (lathe(RING, axis="-y", n=24), 1.5 * polygon_area(24)),
        (lathe([(0.0, 0.0), (1.0, 0.0), (0.0, 3.0)], axis="x", n=24), polygon_area(24)),
        (WIRE, 0.03 * polygon_area(12)),
        (rotated(cylinder(1.0, 1.0, axis="x", n=12), 0.7, (0.0, 1.0, 0.0)), polygon_area(12)),
    ],
)
def test_solids_are_closed_with_faces_outward(mesh: trimesh.Trimesh, volume: float) -> None:
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(volume, rel=1e-3)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_cylinder_lies_along_its_axis(axis: str) -> None:
    lengths = np.ptp(cylinder(0.5, 4.0, (1.0, 2.0, 3.0), axis, 32).bounds, axis=0)  # type: ignore[arg-type]
    assert lengths == pytest.approx([4.0 if one == axis else 1.0 for one in "xyz"], abs=0.01)


@pytest.mark.parametrize(("axis", "tip"), [("x", 0), ("-x", 0), ("y", 1), ("-y", 1), ("z", 2), ("-z", 2)])
def test_the_top_of_a_turned_part_points_along_the_axis(axis: str, tip: int) -> None:
    cone = lathe([(0.0, 0.0), (1.0, 0.0), (0.0, 3.0)], axis=axis)  # type: ignore[arg-type]
    farthest = cone.vertices[np.argmax(np.linalg.norm(cone.vertices, axis=1))]
    assert farthest[tip] == pytest.approx(-3.0 if axis.startswith("-") else 3.0)


def test_a_wire_passes_through_its_points() -> None:
    points = [(0.0, 0.0, 0.0), (1.0, 0.2, 0.0), (1.4, 1.0, 0.7), (0.0, 1.5, 1.0)]
    mesh = wire(points, 0.01, n=8)
    for point in points:
        assert np.linalg.norm(mesh.vertices - point, axis=1).min() == pytest.approx(0.01, rel=1e-6) or (
            np.linalg.norm(mesh.vertices - point, axis=1).min() < 1e-9  # the middle of a lid
        )


def test_a_box_shows_its_edges_and_a_cylinder_is_round() -> None:
    cube = surface([box((1.0, 1.0, 1.0))], GREY, Label.BOX)
    assert len(cube.positions) == 24
    assert np.abs(cube.normals).max(axis=1) == pytest.approx(1.0)
    pipe = surface([cylinder(1.0, 2.0, n=24)], GREY, Label.BOX)
    side = np.abs(pipe.normals[:, 2]) < 0.5
    radial = pipe.positions[side, :2] / np.linalg.norm(pipe.positions[side, :2], axis=1, keepdims=True)
    assert pipe.normals[side, :2] == pytest.approx(radial, abs=1e-3)
    assert np.abs(pipe.normals[~side, 2]) == pytest.approx(1.0)


def test_a_surface_holds_all_triangles_of_its_parts() -> None:
    parts = [box((1.0, 1.0, 1.0)), cylinder(1.0, 2.0, (4.0, 0.0, 0.0), n=16)]
    made = surface(parts, GREY, Label.SIGN)
    a, b, c = np.moveaxis(made.positions[made.triangles].astype(float), 1, 0)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(sum(part.volume for part in parts))
    assert np.linalg.norm(made.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert made.triangles.max() == len(made.positions) - 1
