"""Flat polygons as triangle meshes with texture coordinates: quadrilaterals, level outlines, the faces of a box."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import manifold3d
import numpy as np

from autodrive.graphics.assets.asset import Material, MeshSurface
from autodrive.protocol.labels import Label

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.base.transforms import Vector


class Mesh(NamedTuple):
    """Triangles with normals and texture coordinates."""

    positions: Floats
    """Positions of the vertices [m], shape (n, 3)."""
    normals: Floats
    """Unit vectors, shape (n, 3)."""
    triangles: NDArray[np.integer]
    """Indices of vertices, counter-clockwise seen from outside, shape (m, 3)."""
    uvs: Floats
    """Texture coordinates, shape (n, 2)."""
    open: Floats | None = None
    """Share of the sky that each vertex sees, shape (n,); all of it if None."""

    def surface(self, material: Material, label: Label) -> MeshSurface:
        """The mesh in that material."""
        return MeshSurface(
            material,
            self.positions.astype(np.float32),
            self.normals.astype(np.float32),
            self.triangles.astype(np.uint32),
            label,
            self.uvs.astype(np.float32) if (material.beneath or material).texture else None,
            None if self.open is None else self.open.astype(np.float32),
        )

    def dim_below(self, height: float, least: float, *, floor: float = 0.0) -> Mesh:
        """The mesh with that least share of open sky at the floor; it grows to the whole sky at `height` above it."""
        share = np.clip((self.positions[:, 2] - floor) / height, 0.0, 1.0)
        return self._replace(open=least + (1.0 - least) * share)

    def rotated(self, rotation: Floats) -> Mesh:
        """The mesh rotated by a matrix, shape (3, 3)."""
        return self._replace(positions=self.positions @ rotation.T, normals=self.normals @ rotation.T)


def joined(meshes: Iterable[Mesh]) -> Mesh:
    """Several meshes as one."""
    parts = list(meshes)
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])
    return Mesh(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=False)]),
        np.concatenate([part.uvs for part in parts]),
        None
        if all(part.open is None for part in parts)
        else np.concatenate([np.ones(len(part.positions)) if part.open is None else part.open for part in parts]),
    )


def quad(corners: Floats, uvs: Floats | None = None) -> Mesh:
    """A flat quadrilateral; corners counter-clockwise seen from outside, shape (4, 3)."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return Mesh(
        corners,
        np.tile(normal / np.linalg.norm(normal), (4, 1)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.zeros((4, 2)) if uvs is None else uvs,
    )


def level(outline: Floats, z: float, uvs: Floats) -> Mesh:
    """A level polygon that faces up; outline counter-clockwise, shape (n, 2)."""
    triangles = np.asarray(manifold3d.triangulate([outline]))
    positions = np.column_stack([outline, np.full(len(outline), z)])
    return Mesh(positions, np.tile((0.0, 0.0, 1.0), (len(outline), 1)), triangles, uvs)


def box_faces(half: Vector) -> dict[str, Floats]:
    """Corners of the six faces of a box around the origin, each from the lower left as seen from outside."""
    x, y, z = half
    side = {
        "front": [(x, -y), (x, y)],
        "left": [(x, y), (-x, y)],
        "back": [(-x, y), (-x, -y)],
        "right": [(-x, -y), (x, -y)],
    }
    faces = {name: np.array([(*a, -z), (*b, -z), (*b, z), (*a, z)]) for name, (a, b) in side.items()}
    faces["top"] = np.array([(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)])
    faces["bottom"] = np.array([(-x, y, -z), (x, y, -z), (x, -y, -z), (-x, -y, -z)])
    return faces
