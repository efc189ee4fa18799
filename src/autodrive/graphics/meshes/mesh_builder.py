"""Collects meshes by material while a vehicle is built, at each level of detail."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import trimesh

from autodrive.graphics.assets.asset import Detail, Material, MeshSurface
from autodrive.graphics.meshes.solids import surface
from autodrive.protocol.labels import Label


@dataclass(frozen=True)
class Resolution:
    """Resolution of parts: `n` segments around a large round part, and whether small parts are included."""

    n: int
    has_small_parts: bool

    def around(self, share: float) -> int:
        """Number of segments of a smaller round part."""
        return max(5, round(share * self.n))


class MeshBuilder:
    """Meshes grouped by material."""

    def __init__(self) -> None:
        self._meshes: defaultdict[Material, list[trimesh.Trimesh]] = defaultdict(list)

    def add(self, material: Material, *meshes: trimesh.Trimesh) -> None:
        """Add meshes of a material."""
        self._meshes[material].extend(meshes)

    def items(self) -> Iterable[tuple[Material, list[trimesh.Trimesh]]]:
        """Each material with its meshes."""
        return self._meshes.items()

    def surfaces(self) -> tuple[MeshSurface, ...]:
        """One surface for each material."""
        return tuple(surface(meshes, material, Label.VEHICLE) for material, meshes in self._meshes.items())


RESOLUTIONS: dict[Detail, Resolution] = {
    "full": Resolution(72, has_small_parts=True),
    "reduced": Resolution(20, has_small_parts=False),
}


def surfaces_by_detail(build: Callable[[MeshBuilder, Resolution], None]) -> dict[Detail, tuple[MeshSurface, ...]]:
    """Calls `build` for each level of detail; returns the surfaces of each."""
    details: dict[Detail, tuple[MeshSurface, ...]] = {}
    for detail, resolution in RESOLUTIONS.items():
        builder = MeshBuilder()
        build(builder, resolution)
        details[detail] = builder.surfaces()
    return details
