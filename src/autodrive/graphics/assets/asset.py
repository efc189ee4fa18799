"""An asset to draw: named nodes with surfaces and materials, and how its nodes move.

Lengths in metres; x forward, y left, z up. Node names are a contract between builders and renderers.
`assets/glb.py` writes assets as files that any glTF viewer shows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.transforms import Quaternion, Vector
from autodrive.protocol.labels import Label

Points: TypeAlias = NDArray[np.float32]


@dataclass(frozen=True)
class Material:
    """A metallic-roughness material, as in glTF."""

    name: str
    color: Vector
    """Linear RGB, each in [0, 1]; multiplied with the texture, if any."""
    roughness: float = 0.8
    metallic: float = 0.0
    emission: Vector = (0.0, 0.0, 0.0)
    """Emitted linear RGB; of a lamp: at full level."""
    texture: str = ""
    """Key in `Asset.textures`; none if empty."""
    window_light: Vector = (0.0, 0.0, 0.0)
    """Emitted linear RGB of a lit window, of a facade."""
    is_paint: bool = False
    """Whether the page may show it in the colour of the vehicle, if there are several vehicles."""
    beneath: Material | None = None
    """Material of the road beneath paint that is in `Asset.strips`, too: renderers draw the strips on it."""


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """Triangles of one material; equal only to itself."""

    material: Material
    positions: Points
    """Positions of the vertices [m], shape (n, 3)."""
    normals: Points
    """Unit vectors, shape (n, 3)."""
    triangles: NDArray[np.uint32]
    """Indices of vertices, counter-clockwise seen from outside, shape (m, 3)."""
    label: Label
    uvs: Points | None = None
    """Texture coordinates, shape (n, 2); (0, 0) is the upper left corner. Required with a texture."""
    open: Points | None = None
    """Share of the sky that each vertex sees (ambient occlusion), shape (n,); all of it if None."""


Detail: TypeAlias = Literal["full", "reduced", "shadow"]
"""Level of detail: close views (page, preview), cameras of a vehicle, shadow maps."""


@dataclass(frozen=True)
class NodeJoint:
    """How a node moves relative to its place at rest: by a signal of the vehicle.

    'hinge': turns about `axis` by signal x gain [rad]. 'slide': moves along `axis` by signal x gain [m]. 'crank':
    moves, without turning, like the end of the lever `arm` [m] that turns about z by signal x gain [rad].
    """

    kind: Literal["hinge", "slide", "crank"]
    signal: str
    """'steering' (mean of the front wheels), 'steering_<wheel>', 'spin_<wheel>' or 'compression_<wheel>', where <wheel>
    is front_left, front_right, rear_left or rear_right."""
    axis: Vector = (0.0, 0.0, 1.0)
    gain: float = 1.0
    arm: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class AssetNode:
    """A rigid part of an asset; its pose is in the axes of its parent."""

    name: str
    parent: str = ""
    """Name of an earlier node; none if empty."""
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    joint: NodeJoint | None = None
    lamp: str = ""
    """Name of the lamp in `actuators.lights.LAMPS` whose glass the surfaces are; they glow when it is lit.

    Of a map: 'red', 'yellow' or 'green' of a traffic light; these nodes are in the order of the lights.
    """
    surfaces: dict[Detail, tuple[MeshSurface, ...]] = field(default_factory=dict)
    """Surfaces by level of detail; nothing is drawn at a level without an entry."""


STRIP = np.dtype(
    [
        ("place", np.float32, 2),
        ("outward", np.float32, 4),  # to the side and to the end that the vertex is at: see `Strips`
        ("strip", np.float32, 4),  # distance from the middle across, half the width; the same along [m]
        ("amounts", np.float32, 2),  # of paint and of shade
    ]
)


@dataclass(frozen=True)
class Strips:
    """Paint and soft shade on the ground z = 0, as strips. A pixel shows its mean, however thin they are.

    For that, renderers move the vertices by about a pixel along both vectors of `outward`: across, a move by this
    vector changes the distance from the middle by 1 m; along, it is a unit vector at an end and 0 elsewhere.
    """

    vertices: NDArray[np.void]
    """dtype `STRIP`."""
    triangles: NDArray[np.uint32]
    """Shape (m, 3)."""


@dataclass(frozen=True)
class Asset:
    """Nodes and their textures."""

    name: str
    nodes: tuple[AssetNode, ...]
    textures: dict[str, NDArray[np.uint8]] = field(default_factory=dict)
    """sRGB images by name, shape (height, width, 3), first row at the top."""
    strips: Strips | None = None
    extent: tuple[float, float, float, float] | None = None
    """x_min, y_min, x_max, y_max of what was placed in a map [m]; level ground beyond it fades into the horizon."""
    foreign_textures: tuple[str, ...] = ()
    """Names of textures of the asset to which this one belongs as a part."""

    def triangle_count(self, detail: Detail) -> int:
        """Number of triangles of all nodes at that level of detail."""
        return sum(len(s.triangles) for node in self.nodes for s in node.surfaces.get(detail, ()))
