"""The scene to render: assets, their skeletons, and their triangles as flat arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.transforms import Quaternion, Vector, rotation_from_quaternion
from autodrive.graphics.assets.asset import Asset, AssetNode, Detail, Material, MeshSurface, NodeJoint
from autodrive.physics.actuators.lights import LAMPS, LightsSpec
from autodrive.protocol.messages import WHEEL_NAMES

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIGNALS = ("steering", "spin", "compression")
"""Fields of `render_state.VEHICLE` with a number for each wheel, which moves joints."""

VERTEX = np.dtype(
    [
        ("position", np.float32, 3),
        ("normal", np.float32, 3),
        ("color", np.float32, 3),
        ("emission", np.float32, 3),
        ("uv", np.float32, 2),
        ("open", np.float32),
        ("finish", np.float32, 4),  # roughness, metallic, texture layer, label
        ("bone_lamp", np.float32, 2),  # bone, lamp
        ("instance", np.float32),  # of the static mesh: number of the object of the map, from 1; 0: none
    ]
)


@dataclass(frozen=True)
class RenderScene:
    """Vehicles and objects are in the order of the rows of a `RenderState`; equal ones may be the same Asset."""

    static: Asset
    vehicles: Sequence[Asset]
    objects: Sequence[Asset]
    lights: Sequence[LightsSpec]
    """Lights of each vehicle."""
    map_objects: Sequence[str] = ()
    """Names of the objects of the map that have an instance number, in the order of the numbers from 1."""


LENS_GAP = 0.001
"""A lit lens of a traffic light is drawn so far ahead of the dark one [m], which depth and labels show."""


def lit_lenses(static: Asset) -> list[Asset]:
    """The lit lenses of the traffic lights of a map: red, yellow and green of each, in the order of the Frame."""
    return [Asset(node.name, (_lit(node),)) for node in static.nodes if node.lamp]


def _lit(node: AssetNode) -> AssetNode:
    place = rigid(node.position, node.orientation)
    x, y, z = (place[:3, 3] + LENS_GAP * place[:3, 0]).tolist()
    surfaces = {level: tuple(s for s in own if any(s.material.emission)) for level, own in node.surfaces.items()}
    return replace(node, position=(x, y, z), lamp="", surfaces=surfaces)


# -- bones ------------------------------------------------------------------------------------------------------


class Skeleton:
    """The bones of an asset: the nodes with a joint, each relative to its parent bone. Bone 0 is the asset itself."""

    def __init__(self, asset: Asset) -> None:
        self.bone_of: dict[str, int] = {"": 0}
        """Node -> its bone."""
        self.place_of: dict[str, Floats] = {"": np.eye(4)}
        """Node -> its pose in the axes of that bone at rest, shape (4, 4)."""
        self._parents: list[int] = []
        self._joints: list[NodeJoint] = []
        places: list[Floats] = []
        for node in asset.nodes:
            place = self.place_of[node.parent] @ rigid(node.position, node.orientation)
            bone = self.bone_of[node.parent]
            if node.joint is not None:
                self._parents.append(bone)
                self._joints.append(node.joint)
                places.append(place)
                bone, place = len(places), np.eye(4)
            self.bone_of[node.name], self.place_of[node.name] = bone, place
        self._places = np.array(places).reshape(-1, 4, 4)
        self._gains = np.array([joint.gain for joint in self._joints])
        self._arms = np.array([joint.arm[:2] if joint.kind == "crank" else (0.0, 0.0) for joint in self._joints])
        self._slides = np.array([joint.axis if joint.kind == "slide" else (0.0,) * 3 for joint in self._joints])
        self._turns = np.array(
            [_cross(joint.axis) if joint.kind == "hinge" else np.zeros((3, 3)) for joint in self._joints]
        )
        self._turns = self._turns.reshape(-1, 3, 3)
        self._turns_twice = self._turns @ self._turns

    @property
    def size(self) -> int:
        """Number of bones."""
        return 1 + len(self._joints)

    def pose(self, root: Floats, signals: Mapping[str, float | Floats]) -> Floats:
        """Map from each bone, shape (..., size, 4, 4), for the asset at `root`, shape (..., 4, 4).

        `signals`: of the joints, shape (...).
        """
        poses = np.empty((*root.shape[:-2], self.size, 4, 4))
        poses[..., 0, :, :] = root
        if not self._joints:
            return poses
        amounts = self._gains * np.stack([signals[joint.signal] for joint in self._joints], axis=-1)
        c, s = np.cos(amounts)[..., None], np.sin(amounts)[..., None]
        moved = np.zeros((*amounts.shape, 4, 4))
        moved[..., 3, 3] = 1.0
        moved[..., :3, :3] = (
            np.eye(3) + s[..., None] * self._turns + (1.0 - c[..., None]) * self._turns_twice
        )  # Rodrigues
        moved[..., :3, 3] = amounts[..., None] * self._slides
        moved[..., :2, 3] += (c - 1.0) * self._arms + s * self._arms[:, ::-1] * (-1.0, 1.0)
        moved = self._places @ moved
        for i, parent in enumerate(self._parents):
            poses[..., i + 1, :, :] = poses[..., parent, :, :] @ moved[..., i, :, :]
        return poses


def _cross(axis: Vector) -> Floats:
    """Cross-product matrix of that axis, shape (3, 3)."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def signals_of(rows: np.void | np.ndarray) -> dict[str, Any]:
    """Every joint signal of a vehicle, from a row of dtype `render_state.VEHICLE`, or from an array of them."""
    steering = rows["steering"]
    return {
        "steering": 0.5 * (steering[..., 0] + steering[..., 1]),
        **{f"{kind}_{wheel}": rows[kind][..., i] for kind in SIGNALS for i, wheel in enumerate(WHEEL_NAMES)},
    }


def rigid_all(rows: np.ndarray) -> Floats:
    """The poses of an array with fields `position` and `orientation` as matrices, shape (..., 4, 4)."""
    poses = np.zeros((*rows.shape, 4, 4))
    turns = rotation_from_quaternion(np.moveaxis(rows["orientation"], -1, 0))
    poses[..., :3, :3] = np.stack(turns, axis=-1).reshape(*rows.shape, 3, 3)
    poses[..., :3, 3] = rows["position"]
    poses[..., 3, 3] = 1.0
    return poses


def rigid(position: Vector | Floats, orientation: Quaternion | Floats) -> Floats:
    """The pose as a matrix, shape (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3] = np.reshape(rotation_from_quaternion(orientation), (3, 3))
    pose[:3, 3] = position
    return pose


# -- triangles --------------------------------------------------------------------------------------------------


Kind: TypeAlias = Literal["ground", "flat", "matt", "shiny"]
"""The ground z = 0; others whose normals all point up; others without gloss; the rest. The first draws fastest."""
LEVEL = frozenset[Kind]({"ground", "flat"})
GROUND = 1e-3
"""Level surfaces that are nearer to z = 0 are ground [m]."""


class MeshRange(NamedTuple):
    """Triangles that are drawn together: `length` indices from `first`."""

    first: int
    length: int
    kind: Kind
    textures: str
    """Name of the texture array; none if empty."""
    center: Floats
    radius: float
    """Radius of a bounding sphere [m]."""


@dataclass(frozen=True)
class Geometry:
    """All triangles of an asset at one level of detail."""

    vertices: NDArray[np.void]
    """dtype `VERTEX`."""
    indices: NDArray[np.uint32]
    ranges: tuple[MeshRange, ...]

    @cached_property
    def spheres(self) -> tuple[Floats, Floats]:
        """Centres, shape (n, 3), and radii, shape (n,), of the ranges."""
        return np.array([r.center for r in self.ranges]).reshape(-1, 3), np.array([r.radius for r in self.ranges])

    @cached_property
    def boxes(self) -> Floats:
        """Lowest and highest coordinates of each range, shape (n, 2, 3)."""
        points = self.vertices["position"].astype(np.float64)
        own = [points[self.indices[r.first : r.first + r.length]] for r in self.ranges]
        return np.array([(p.min(0), p.max(0)) for p in own]).reshape(-1, 2, 3)


def geometry(
    asset: Asset,
    skeleton: Skeleton,
    detail: Detail,
    layers: dict[str, tuple[str, int]],
    *,
    is_whole: bool = False,
    instances: Mapping[str, int] = MappingProxyType({}),
) -> Geometry:
    """Flat arrays of the asset. `layers`: texture array and layer of each texture; `instances`: see `instance_of`.

    Surfaces that look alike are merged within each node, so that invisible nodes can be skipped, or with `is_whole`
    within the asset.
    """
    vertices: list[NDArray[np.void]] = []
    indices: list[NDArray[np.uint32]] = []
    ranges: list[MeshRange] = []
    n_vertex = n_index = 0
    for nodes in [asset.nodes] if is_whole else [[node] for node in asset.nodes]:
        groups: dict[tuple[Kind, str], list[tuple[MeshSurface, AssetNode]]] = {}
        pairs = [(surface, node) for node in nodes for surface in node.surfaces.get(detail, ())]
        texture_names = [_material(surface).texture for surface, _ in pairs]
        textured = next((layers[name][0] for name in texture_names if name), "")
        for (surface, node), name in zip(pairs, texture_names, strict=True):
            own = layers[name][0] if name else textured
            kind = _kind(surface, skeleton.place_of[node.name])
            kind = "matt" if kind in LEVEL and is_whole else kind  # what moves is not level ground
            groups.setdefault((kind, own), []).append((surface, node))
        for (kind, array), members in groups.items():
            parts = [_vertices(surface, node, skeleton, layers, instances) for surface, node in members]
            starts = n_vertex + np.cumsum([0, *(len(part) for part in parts[:-1])])
            own_indices = np.concatenate(
                [s.triangles.ravel() + start for (s, _), start in zip(members, starts, strict=True)]
            )
            points = np.concatenate([part["position"] for part in parts])
            center = 0.5 * (points.min(0) + points.max(0)).astype(np.float64)
            radius = float(np.linalg.norm(points - center, axis=1).max())
            ranges.append(MeshRange(n_index, len(own_indices), kind, array, center, radius))
            vertices += parts
            indices.append(own_indices.astype(np.uint32))
            n_vertex, n_index = n_vertex + len(points), n_index + len(own_indices)
    return Geometry(
        np.concatenate(vertices) if vertices else np.empty(0, VERTEX),
        np.concatenate(indices) if indices else np.empty(0, np.uint32),
        tuple(ranges),
    )


def _material(surface: MeshSurface) -> Material:
    """What is drawn; paint is in `Asset.strips`."""
    return surface.material.beneath or surface.material


def _kind(surface: MeshSurface, place: Floats) -> Kind:
    if np.all(surface.normals[:, 2] > 0.999):
        height = surface.positions @ place[2, :3] + place[2, 3]
        return "ground" if np.all(np.abs(height) < GROUND) else "flat"
    return "matt" if surface.material.roughness >= 0.6 and surface.material.metallic == 0.0 else "shiny"


def _vertices(
    surface: MeshSurface,
    node: AssetNode,
    skeleton: Skeleton,
    layers: dict[str, tuple[str, int]],
    instances: Mapping[str, int],
) -> NDArray[np.void]:
    place, material = skeleton.place_of[node.name], _material(surface)
    part = np.zeros(len(surface.positions), VERTEX)
    part["position"] = surface.positions @ place[:3, :3].T + place[:3, 3]
    part["normal"] = surface.normals @ place[:3, :3].T
    part["color"] = material.color
    if not node.lamp or node.lamp in LAMPS:  # lenses of traffic lights are dark: see `lit_lenses`
        part["emission"] = material.window_light if any(material.window_light) else material.emission
    if surface.uvs is not None:
        part["uv"] = surface.uvs
    part["open"] = 1.0 if surface.open is None else surface.open
    layer = layers[material.texture][1] if material.texture else 0
    part["finish"] = material.roughness, material.metallic, layer, surface.label
    part["bone_lamp"] = skeleton.bone_of[node.name], 1 + LAMPS.index(node.lamp) if node.lamp in LAMPS else 0
    part["instance"] = instance_of(node.name, instances)
    return part


def instance_of(node: str, instances: Mapping[str, int]) -> int:
    """Instance number of a node of a map; 0: none. `instances`: numbers of objects, to which a post does not belong."""
    name, _, part = node.rpartition(".")
    return instances.get(node) or instances.get("" if part == "post" else name, 0)
