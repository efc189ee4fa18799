"""Parts by material, while a car is being built, and how finely."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import trimesh

from autodrive.render.asset import Detail, Label, Material, Surface
from autodrive.render.solids import surface


@dataclass(frozen=True)
class Fineness:
    """How finely parts are made: `n` segments around a large round thing; whether small things are there at all."""

    n: int
    has_small: bool

    def around(self, share: float) -> int:
        """Segments of something smaller."""
        return max(5, round(share * self.n))


class Pile:
    """Meshes by material."""

    def __init__(self) -> None:
        self._meshes: defaultdict[Material, list[trimesh.Trimesh]] = defaultdict(list)

    def add(self, material: Material, *meshes: trimesh.Trimesh) -> None:
        """Put meshes to those of their material."""
        self._meshes[material].extend(meshes)

    def items(self) -> Iterable[tuple[Material, list[trimesh.Trimesh]]]:
        """Material, and all meshes of it."""
        return self._meshes.items()

    def surfaces(self) -> tuple[Surface, ...]:
        """One for each material."""
        return tuple(surface(meshes, material, Label.VEHICLE) for material, meshes in self._meshes.items())


FINENESS: dict[Detail, Fineness] = {"full": Fineness(72, has_small=True), "reduced": Fineness(20, has_small=False)}


def made(build: Callable[[Pile, Fineness], None]) -> dict[Detail, tuple[Surface, ...]]:
    """The same thing finely and coarsely."""
    details: dict[Detail, tuple[Surface, ...]] = {}
    for detail, fine in FINENESS.items():
        pile = Pile()
        build(pile, fine)
        details[detail] = pile.surfaces()
    return details
