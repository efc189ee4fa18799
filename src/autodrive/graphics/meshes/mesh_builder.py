"""Collects meshes by material while a vehicle is built, at each level of detail."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable

import trimesh

from autodrive.base.units import DEGREE
from autodrive.graphics.assets.asset import Detail, Material, MeshSurface
from autodrive.graphics.meshes.solids import rotated, surface
from autodrive.graphics.meshes.vehicle_materials import VEHICLE_MATERIALS
from autodrive.physics.sensors.sensor import Mount
from autodrive.protocol.labels import Label


class MeshBuilder:
    """Meshes grouped by material, for one level of detail."""

    def __init__(self, n: int, *, has_small_parts: bool) -> None:
        """`n`: segments around a large round part; `has_small_parts`: whether small parts are included."""
        self.n = n
        self.has_small_parts = has_small_parts
        self._meshes: defaultdict[Material, list[trimesh.Trimesh]] = defaultdict(list)

    def around(self, share: float) -> int:
        """Number of segments of a smaller round part."""
        return max(5, round(share * self.n))

    def add(self, material: Material | str, *meshes: trimesh.Trimesh) -> None:
        """Add meshes of a material, or of the one with that name in `VEHICLE_MATERIALS`."""
        self._meshes[VEHICLE_MATERIALS[material] if isinstance(material, str) else material].extend(meshes)

    def add_mounted(self, material: str, mount: Mount, *meshes: trimesh.Trimesh, back: float = 0.0) -> None:
        """Add meshes in the axes of a mount, moved back along x of the vehicle [m]."""
        x, y, z = mount.position
        _, pitch, yaw = (angle * DEGREE for angle in mount.rotation_deg)
        for mesh in meshes:
            turned = rotated(rotated(mesh, pitch, (0.0, 1.0, 0.0)), yaw, (0.0, 0.0, 1.0))
            turned.apply_translation((x - back, y, z))
            self.add(material, turned)

    def surfaces(self) -> tuple[MeshSurface, ...]:
        """One surface for each material."""
        return tuple(surface(meshes, material, Label.VEHICLE) for material, meshes in self._meshes.items())


def surfaces_by_detail(build: Callable[[MeshBuilder], None]) -> dict[Detail, tuple[MeshSurface, ...]]:
    """Calls `build` for each level of detail; returns the surfaces of each."""
    builders: dict[Detail, MeshBuilder] = {
        "full": MeshBuilder(72, has_small_parts=True),
        "reduced": MeshBuilder(20, has_small_parts=False),
    }
    for builder in builders.values():
        build(builder)
    return {detail: builder.surfaces() for detail, builder in builders.items()}
