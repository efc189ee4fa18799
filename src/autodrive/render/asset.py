"""A thing to be drawn: named nodes with surfaces of named materials, and how its nodes move.

Lengths in metres; x forward, y left, z up. Node names are a contract between whoever builds a thing and whoever draws
it; `render/glb.py` writes the same as a file that any glTF viewer shows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.transforms import Quaternion, Vector

Points: TypeAlias = NDArray[np.float32]


class Label(IntEnum):
    """What a pixel shows: the value in a camera's semantic picture."""

    NOTHING = 0
    """The sky."""
    GROUND = 1
    LAWN = 2
    ROAD = 3
    KERB = 4
    EDGE_LINE = 5
    SEPARATION_LINE = 6
    STOP_LINE = 7
    CROSSING = 8
    BAY_LINE = 9
    WALL = 10
    BLOCK = 11
    BOX = 12
    SIGN = 13
    TRAFFIC_LIGHT = 14
    POST = 15
    VEHICLE = 16


@dataclass(frozen=True)
class Material:
    """A metallic-roughness material, as glTF means it."""

    name: str
    color: Vector
    """Linear RGB, each in [0, 1]; a factor of the texture's where there is one."""
    roughness: float = 0.8
    metallic: float = 0.0
    emission: Vector = (0.0, 0.0, 0.0)
    """Linear RGB that it gives off where it glows by itself; of a lamp: when fully lit."""
    texture: str = ""
    """Name of a picture in the asset's `textures`; none if empty."""


@dataclass(frozen=True)
class Surface:
    """Triangles of one material."""

    material: Material
    positions: Points
    """Of the vertices [m], shape (n, 3)."""
    normals: Points
    """Unit vectors, shape (n, 3)."""
    triangles: NDArray[np.uint32]
    """Indices of vertices, counter-clockwise seen from outside, shape (m, 3)."""
    label: Label
    uvs: Points | None = None
    """Texture coordinates, (0, 0) is the picture's upper left corner; shape (n, 2). Needed with a texture."""


Detail: TypeAlias = Literal["full", "reduced", "shadow"]
"""For whom a node's surfaces are: close looks (pages, pictures), the cameras of a car, shadow maps."""


@dataclass(frozen=True)
class Joint:
    """How a node moves against its place: by a signal of the vehicle, named below.

    'hinge': turns about `axis` by signal x gain [rad]. 'slide': moves along `axis` by signal x gain [m]. 'crank':
    moves, without turning, as the end of the lever `arm` [m] does when that turns about z by signal x gain [rad].
    """

    kind: Literal["hinge", "slide", "crank"]
    signal: str
    """'steering' (mean of the front wheels), 'steering_<wheel>', 'spin_<wheel>' or 'compression_<wheel>', where <wheel>
    is front_left, front_right, rear_left or rear_right."""
    axis: Vector = (0.0, 0.0, 1.0)
    gain: float = 1.0
    arm: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Node:
    """A rigid piece of an asset, placed in its parent's axes."""

    name: str
    parent: str = ""
    """Name of a node listed before; none if empty."""
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    joint: Joint | None = None
    lamp: str = ""
    """Of a lamp's glass: which (`actuators.lights.LAMPS`); its surfaces give off light when that lamp is lit."""
    surfaces: dict[Detail, tuple[Surface, ...]] = field(default_factory=dict)
    """By detail; a detail that is not there is not drawn."""


@dataclass(frozen=True)
class Asset:
    """A thing to be drawn."""

    name: str
    nodes: tuple[Node, ...]
    textures: dict[str, NDArray[np.uint8]] = field(default_factory=dict)
    """sRGB pictures by name, shape (height, width, 3), first row on top."""

    def triangle_count(self, detail: Detail) -> int:
        """Of all nodes."""
        return sum(len(s.triangles) for node in self.nodes for s in node.surfaces.get(detail, ()))
