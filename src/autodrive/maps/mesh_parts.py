"""Simple solids as triangles: boxes, cylinders, plates. Positions in metres, each with its outward normal."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import manifold3d
import numpy as np

from autodrive.render.asset import Label, Material, Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.state import Floats

Triangles = np.ndarray


class Mesh(NamedTuple):
    """Triangles of a piece."""

    positions: Floats
    normals: Floats
    triangles: NDArray[np.integer]
    uvs: Floats

    def surface(self, material: Material, label: Label) -> Surface:
        """Drawn in that material."""
        return Surface(
            material,
            self.positions.astype(np.float32),
            self.normals.astype(np.float32),
            self.triangles.astype(np.uint32),
            label,
            self.uvs.astype(np.float32) if material.texture else None,
        )


def joined(meshes: Iterable[Mesh]) -> Mesh:
    """All of them as one."""
    parts = list(meshes)
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])
    return Mesh(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=False)]),
        np.concatenate([part.uvs for part in parts]),
    )


def moved(mesh: Mesh, position: tuple[float, float, float], yaw: float = 0.0) -> Mesh:
    """Turned about z, then shifted."""
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return mesh._replace(positions=mesh.positions @ turn.T + position, normals=mesh.normals @ turn.T)


def quad(corners: Floats, uvs: Floats | None = None) -> Mesh:
    """A flat quadrilateral, counter-clockwise from outside; shape (4, 3)."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return Mesh(
        corners,
        np.tile(normal / np.linalg.norm(normal), (4, 1)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.zeros((4, 2)) if uvs is None else uvs,
    )


def box_faces(half: tuple[float, float, float]) -> dict[str, Floats]:
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


def box(half: tuple[float, float, float], period: float = 1.0, *, without: str = "") -> Mesh:
    """A box around the origin; its texture repeats every `period` metres. `without`: a face that is not seen."""
    meshes = []
    for name, corners in box_faces(half).items():
        if name != without:
            along = np.linalg.norm(corners[1] - corners[0]) / period
            up = np.linalg.norm(corners[3] - corners[0]) / period
            meshes.append(quad(corners, np.array([(0.0, 0.0), (along, 0.0), (along, -up), (0.0, -up)])))
    return joined(meshes)


def tube(radius: float, low: float, high: float, segments: int = 12) -> Mesh:
    """A cylinder about z with its upper lid."""
    angle = np.linspace(0.0, 2.0 * math.pi, segments + 1)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(segments + 1)])
    rings = [rim * radius + (0.0, 0.0, z) for z in (low, high)]
    i = np.arange(segments)
    n = segments + 1
    sides = np.vstack([np.column_stack([i, i + 1, n + i + 1]), np.column_stack([i, n + i + 1, n + i])])
    side = Mesh(np.vstack(rings), np.vstack([rim, rim]), sides, np.zeros((2 * n, 2)))
    lid = disc(radius, segments)
    return joined([side, lid._replace(positions=lid.positions + np.array((0.0, 0.0, high)))])


def disc(radius: float, segments: int = 16) -> Mesh:
    """A disc about z, seen from above."""
    angle = np.arange(segments) * (2.0 * math.pi / segments)
    outline = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return plane(outline)


def plane(outline: Floats, z: float = 0.0) -> Mesh:
    """A level polygon, counter-clockwise, seen from above; shape (n, 2). Texture coordinates are its own x, y."""
    triangles = np.asarray(manifold3d.triangulate([outline]))
    positions = np.column_stack([outline, np.full(len(outline), z)])
    return Mesh(positions, np.tile((0.0, 0.0, 1.0), (len(outline), 1)), triangles, outline.copy())


def rim(outline: Floats, low: float, high: float) -> Mesh:
    """What joins two equal level polygons, counter-clockwise, at two heights."""
    following = np.roll(outline, -1, axis=0)
    pairs = zip(outline, following, strict=True)
    return joined(quad(np.array([(*a, low), (*b, low), (*b, high), (*a, high)])) for a, b in pairs)
