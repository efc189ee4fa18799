"""Triangles of the asset of a vehicle, grouped by URDF link, and STL export."""

from __future__ import annotations

import struct
from collections import defaultdict
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.transforms import Quaternion, Vector, compose, rotate, rotation_from_quaternion
from autodrive.graphics.assets.asset import Asset, Material

Triangles: TypeAlias = NDArray[np.float64]
"""Corners in the link frame [m], shape (n, 3, 3), counter-clockwise seen from outside."""

TURNING = {"steer": "steering", "wheel": "wheel"}
"""Prefixes of the asset nodes that also move in the URDF, and the suffixes of their links."""

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def meshes_by_link(asset: Asset) -> dict[str, dict[Material, Triangles]]:
    """Triangles of the full level of detail at rest, by link and material."""
    parts: defaultdict[str, defaultdict[Material, list[Triangles]]] = defaultdict(lambda: defaultdict(list))
    places: dict[str, tuple[str, Vector, Quaternion]] = {"": ("base_link", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))}
    for node in asset.nodes:
        link, origin, turn = places[node.parent]
        x, y, z = rotate(turn, node.position)
        place = (origin[0] + x, origin[1] + y, origin[2] + z)
        orientation = compose(turn, node.orientation)
        kind, _, place_name = node.name.partition("_")
        if kind in TURNING:
            link, place, orientation = f"{place_name}_{TURNING[kind]}", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
        places[node.name] = link, place, orientation
        rotation = np.array(rotation_from_quaternion(orientation)).reshape(3, 3)
        for surface in node.surfaces.get("full", ()):
            corners = surface.positions.astype(np.float64)[surface.triangles]
            parts[link][surface.material].append(corners @ rotation.T + place)
    return {
        link: {material: np.concatenate(pieces) for material, pieces in by_material.items()}
        for link, by_material in parts.items()
    }


def stl(triangles: Triangles) -> bytes:
    """The triangles as a binary STL file."""
    facets = np.zeros(len(triangles), _FACET)
    a, b, c = np.moveaxis(triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    facets["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    facets["corners"] = triangles
    return bytes(80) + struct.pack("<I", len(triangles)) + facets.tobytes()
