"""Simple solids as triangle meshes: plates, boxes, solids of revolution, wires; closed, with faces outward."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import shapely
import trimesh
from shapely.geometry.base import BaseGeometry

from autodrive.base.transforms import Vector
from autodrive.base.units import DEGREE
from autodrive.graphics.assets.asset import Material, MeshSurface
from autodrive.protocol.labels import Label

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats

Axis: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]
CREASE = 40 * DEGREE
"""Adjacent faces at a greater angle are shaded with a hard edge [rad]."""

_TURNS = {
    "z": np.eye(3),
    "-z": np.diag([1.0, -1.0, -1.0]),
    "x": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "-x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotations that turn z to that axis."""


def plate(outline: BaseGeometry, bottom: float, top: float) -> trimesh.Trimesh:
    """The outline extruded along z between two heights [m]."""
    mesh = trimesh.creation.extrude_polygon(outline, top - bottom, engine="manifold")
    mesh.apply_translation((0.0, 0.0, bottom))
    return mesh


def box(size: Vector, at: Vector = (0.0, 0.0, 0.0), bevel: float = 0.0, n: int = 2) -> trimesh.Trimesh:
    """A box with its centre at `at`; a bevel [m] rounds its vertical edges."""
    if bevel <= 0.0 or n < 1:
        mesh = trimesh.creation.box(size)
    else:
        x, y = 0.5 * size[0] - bevel, 0.5 * size[1] - bevel
        mesh = plate(shapely.box(-x, -y, x, y).buffer(bevel, quad_segs=n), -0.5 * size[2], 0.5 * size[2])
    mesh.apply_translation(at)
    return mesh


def cylinder(
    radius: float, length: float, at: Vector = (0.0, 0.0, 0.0), axis: Axis = "z", n: int = 16
) -> trimesh.Trimesh:
    """A cylinder with its centre at `at`."""
    return lathe(
        [(0.0, -0.5 * length), (radius, -0.5 * length), (radius, 0.5 * length), (0.0, 0.5 * length)], at, axis, n
    )


def lathe(
    profile: Sequence[tuple[float, float]], at: Vector = (0.0, 0.0, 0.0), axis: Axis = "z", n: int = 24
) -> trimesh.Trimesh:
    """A solid of revolution. `profile`: radius and height, from the bottom up; a ring ends with its first point."""
    mesh = trimesh.creation.revolve(np.array(profile), sections=n)
    if mesh.volume < 0.0:
        mesh.invert()
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = _TURNS[axis], at
    mesh.apply_transform(turn)
    return mesh


def wire(points: Sequence[Vector], radius: float, n: int = 6, steps: int = 6) -> trimesh.Trimesh:
    """A wire through points, along a Catmull-Rom spline."""
    path = _curve(np.array(points), steps)
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.empty_like(path)
    across[0] = np.cross(along[0], (0.0, 0.0, 1.0) if abs(along[0, 2]) < 0.9 else (1.0, 0.0, 0.0))
    for i in range(1, len(path)):  # without twist
        across[i] = across[i - 1] - along[i] * (across[i - 1] @ along[i])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    third = np.cross(along, across)
    angle = np.arange(n) * 2.0 * np.pi / n
    ring = np.cos(angle)[None, :, None] * across[:, None] + np.sin(angle)[None, :, None] * third[:, None]
    vertices = np.concatenate([(path[:, None] + radius * ring).reshape(-1, 3), path[[0, -1]]])
    i, j = np.meshgrid(np.arange(len(path) - 1), np.arange(n), indexing="ij")
    a, b = i * n + j, i * n + (j + 1) % n
    sides = np.stack([np.stack([a, b, b + n], -1), np.stack([a, b + n, a + n], -1)]).reshape(-1, 3)
    j, last = np.arange(n), (len(path) - 1) * n
    lids = np.concatenate(
        [
            np.column_stack([np.full(n, len(vertices) - 2), (j + 1) % n, j]),
            np.column_stack([np.full(n, len(vertices) - 1), last + j, last + (j + 1) % n]),
        ]
    )
    mesh = trimesh.Trimesh(vertices, np.concatenate([sides, lids]), process=False)
    if mesh.volume < 0.0:
        mesh.invert()
    return mesh


def rotated(mesh: trimesh.Trimesh, angle: float, axis: Vector, about: Vector = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    """The mesh rotated by an angle [rad] about an axis through a point."""
    copy = mesh.copy()
    copy.apply_transform(trimesh.transformations.rotation_matrix(angle, axis, about))
    return copy


def rotated_by(mesh: trimesh.Trimesh, rotation: Floats) -> trimesh.Trimesh:
    """The mesh rotated about the origin by a matrix, shape (3, 3)."""
    transform = np.eye(4)
    transform[:3, :3] = rotation
    copy = mesh.copy()
    copy.apply_transform(transform)
    return copy


def without_faces(mesh: trimesh.Trimesh, direction: Vector) -> trimesh.Trimesh:
    """The mesh without the faces whose normal is that unit vector, for example because nothing can see them."""
    copy = mesh.copy()
    copy.update_faces(np.asarray(copy.face_normals) @ np.array(direction) < 1.0 - 1e-6)
    return copy


def surface(meshes: Iterable[trimesh.Trimesh], material: Material, label: Label, crease: float = CREASE) -> MeshSurface:
    """The meshes as one surface, with smooth normals where faces meet at less than `crease` [rad]."""
    parts = [_shaded(mesh, crease) for mesh in meshes]
    starts = np.cumsum([0, *(len(points) for points, _, _ in parts[:-1])])
    return MeshSurface(
        material,
        np.concatenate([points for points, _, _ in parts]).astype(np.float32),
        np.concatenate([normals for _, normals, _ in parts]).astype(np.float32),
        np.concatenate([faces + start for (_, _, faces), start in zip(parts, starts, strict=True)]).astype(np.uint32),
        label,
    )


def _shaded(mesh: trimesh.Trimesh, crease: float) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Vertices, normals and faces; a vertex with several normals is duplicated."""
    mesh.merge_vertices()
    faces = np.asarray(mesh.faces)
    # weighted by the angle of the corner, so that the triangulation of a flat face does not matter
    weights = np.repeat(np.asarray(mesh.face_normals), 3, axis=0) * np.asarray(mesh.face_angles).reshape(-1, 1)
    corner_vertex, corner_face = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex, minlength=len(mesh.vertices))
    starts = np.cumsum(counts) - counts
    # pairs of a corner and a face around its vertex
    around = counts[corner_vertex]
    corner = np.repeat(np.arange(len(corner_vertex)), around)
    step = np.arange(len(corner)) - np.repeat(np.cumsum(around) - around, around)
    other_corner = order[starts[corner_vertex[corner]] + step]
    other = corner_face[other_corner]
    unit = np.asarray(mesh.face_normals)
    is_soft = np.einsum("ij,ij->i", unit[corner_face[corner]], unit[other]) > math.cos(crease)
    normals = np.zeros((len(corner_vertex), 3))
    np.add.at(normals, corner[is_soft], weights[other_corner[is_soft]])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
    keys = np.column_stack([corner_vertex, np.round(normals * 500.0).astype(np.int64)])
    _, first, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return np.asarray(mesh.vertices)[corner_vertex[first]], normals[first], index.reshape(-1, 3)


def _curve(points: Floats, steps: int) -> Floats:
    """A Catmull-Rom spline through all points, with `steps` segments between two points."""
    padded = np.concatenate([[2.0 * points[0] - points[1]], points, [2.0 * points[-1] - points[-2]]])
    t = np.arange(steps)[:, None] / steps
    pieces = []
    for p0, p1, p2, p3 in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        quadratic, cubic = 2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3, 3.0 * p1 - p0 - 3.0 * p2 + p3
        pieces.append(0.5 * (2.0 * p1 + (p2 - p0) * t + quadratic * t**2 + cubic * t**3))
    return np.concatenate([*pieces, points[-1:]])
