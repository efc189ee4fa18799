"""Builds the meshes of the barriers of a race track: walls with a coping, and air ducts with dark rings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from autodrive.graphics.assets.asset import AssetNode, Detail, Material, MeshSurface
from autodrive.graphics.meshes.polygons import Mesh, joined
from autodrive.protocol.labels import Label
from autodrive.scenario.maps.track_map import Barrier, barriers

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.scenario.tracks.track import BarrierSpec, Track

WALL = Material("barrier", (0.62, 0.63, 0.62), roughness=0.9, texture="plaster")
COPING = Material("barrier_top", (0.55, 0.06, 0.04), roughness=0.8)
DUCT = Material("duct", (1.0, 1.0, 1.0), roughness=0.65, texture="duct")
CHUNK = 4.0
"""Length of the barrier of one node, about [m]: what is not visible is left out node by node."""
PROFILE = (
    ((-1.0, -1.0), (-0.8, -0.6)),
    ((-1.0, 0.0), (-1.0, 0.0)),
    ((-1.0, 1.0), (-0.9, 0.44)),
    ((0.0, 1.0), (0.0, 1.0)),
    ((1.0, 1.0), (0.9, 0.44)),
    ((1.0, 0.0), (1.0, 0.0)),
    ((1.0, -1.0), (0.8, -0.6)),
)
"""Edges and normals around a duct, from its face over the top to its back: to the back and up, -1 to 1.

The edges are those of the box that vehicles and LIDARs hit; the normals shade it like a round duct.
"""
STEPS: dict[Detail, int] = {"full": 1, "reduced": 1, "shadow": 2}
"""What casts the shadow has every second edge of what is drawn, which is the same box."""
DUCT_FOOT, WALL_FOOT = 0.5, 0.65
"""Share of the sky that the foot of a duct and that of a wall see; from half the height of the duct on, it is all."""
BEHIND = 0.001
"""The back of a barrier is at least this far behind its face [m], and begins to look for other faces there."""
RING_PERIOD = 0.5
"""Distance between the dark rings of a duct, about [m]; its texture has one."""


def barrier_nodes(track: Track) -> Iterator[AssetNode]:
    """Nodes 'barrier_<i>', each a few metres of a barrier."""
    for number, levels in enumerate(_levels(track), 1):
        yield AssetNode(f"barrier_{number}", surfaces=levels)


def _levels(track: Track) -> Iterator[dict[Detail, tuple[MeshSurface, ...]]]:
    """The surfaces of each node."""
    found = barriers(track)
    for barrier, back in zip(found, _backs(found) if found else [], strict=True):
        for part, first, last in _chunks(barrier):
            yield _solid(track.barrier, barrier.points[part], back[part], first, last)
        for piece in _pieces_beyond(barrier, back):
            yield _solid(track.barrier, *piece, True, True)


def _solid(
    spec: BarrierSpec, points: Floats, back: Floats, first: bool, last: bool
) -> dict[Detail, tuple[MeshSurface, ...]]:
    """The surfaces between a line along the face and its back edge; `first`, `last`: whether that end is visible."""
    if spec.kind == "wall":
        return dict.fromkeys(STEPS, _wall(points, back, spec.height, first, last))
    return {detail: _duct(points, back, spec.height, first, last, detail) for detail in STEPS}


def _pieces_beyond(barrier: Barrier, back: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Face and vectors to the back edge of each solid piece that reaches out of what is drawn with mitred corners.

    It is a piece with a square end at a sharp corner or at the end of a duct, or a thick one between thin ones.
    """
    step = np.diff(barrier.points, axis=0)
    ahead = step / np.linalg.norm(step, axis=1)[:, None]
    deep = np.column_stack([ahead[:, 1], -ahead[:, 0]]) * barrier.depth[:, None]
    begin, end, behind = barrier.points[:-1], barrier.points[1:], barrier.points + back
    drawn = shapely.STRtree(shapely.polygons(np.stack([begin, end, behind[1:], behind[:-1]], axis=1)))
    corners = shapely.points(np.vstack([begin + deep, end + deep]))
    inside, _ = drawn.query(corners, predicate="dwithin", distance=2.0 * BEHIND)
    is_beyond = ~np.isin(np.arange(2 * len(deep)), inside).reshape(2, -1)
    for k in np.flatnonzero(is_beyond.any(axis=0)).tolist():
        yield barrier.points[k : k + 2], deep[[k, k]]


def _backs(found: list[Barrier]) -> list[Floats]:
    """For each barrier the vectors from its points to its back edge [m], shape (n, 2), with mitred corners.

    They are shorter where the back would else reach through another face into the free space: a mitred corner is
    farther behind its face than the solid pieces, which have square ends.
    """
    mitres, depths = zip(*(_mitres(barrier) for barrier in found), strict=True)
    mitre, depth, points = np.vstack(mitres), np.concatenate(depths), np.vstack([one.points for one in found])
    is_start = np.ones(len(points), bool)
    is_start[np.cumsum([len(one.points) for one in found]) - 1] = False
    a = np.flatnonzero(is_start)
    tree = shapely.STRtree(_lines(points[a], points[a + 1]))
    todo = a
    while len(todo):
        ends = [(points[i], mitre[i], depth[i, None]) for i in (todo, todo + 1)]
        (a0, a1), (b0, b1) = ((at + BEHIND * back, at + deep * back) for at, back, deep in ends)
        reaches, _ = tree.query(_lines(a0, a1, b1, b0), predicate="intersects")
        todo = todo[np.unique(reaches)]
        todo = todo[np.maximum(depth[todo], depth[todo + 1]) > 2.0 * BEHIND]
        both = np.unique([todo, todo + 1])
        depth[both] = np.maximum(0.8 * depth[both], 1.5 * BEHIND)
    splits = np.cumsum([len(one.points) for one in found])[:-1]
    backs = np.split(mitre * depth[:, None], splits)
    for barrier, back in zip(found, backs, strict=True):
        if barrier.is_closed:
            back[0] = back[-1] = min(back[0], back[-1], key=np.linalg.norm)
    return backs


def _lines(*points: Floats) -> Any:
    """Lines through the first, second ... points, shape (n, 2) each."""
    return shapely.linestrings(np.stack(points, axis=1))


def _mitres(barrier: Barrier) -> tuple[Floats, Floats]:
    """At each point of a face: the vector to a line 1 m behind it, mitred, and the thickness of the barrier [m]."""
    step = np.diff(barrier.points, axis=0)
    step /= np.linalg.norm(step, axis=1)[:, None]
    before = np.vstack([step[-1:] if barrier.is_closed else step[:1], step])
    after = np.vstack([step, step[:1] if barrier.is_closed else step[-1:]])
    along = before + after
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    back = np.column_stack([along[:, 1], -along[:, 0]])
    stretch = 1.0 / np.maximum(np.sum(along * after, axis=1), 0.5)  # the mitre of a corner, at most twice as long
    thick = np.concatenate([barrier.depth[-1:] if barrier.is_closed else barrier.depth[:1], barrier.depth])
    depth = np.minimum(thick, np.append(barrier.depth, thick[0] if barrier.is_closed else barrier.depth[-1]))
    return back * stretch[:, None], depth


def _chunks(barrier: Barrier) -> Iterator[tuple[slice, bool, bool]]:
    """The points of each node, and whether the barrier begins or ends there."""
    points = barrier.points
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    cuts = [0]
    for i in range(1, len(points) - 1):
        if length[i] - length[cuts[-1]] > CHUNK:
            cuts.append(i)
    cuts.append(len(points) - 1)
    for a, b in itertools.pairwise(cuts):
        yield slice(a, b + 1), a == 0 and not barrier.is_closed, b == len(points) - 1 and not barrier.is_closed


def _wall(points: Floats, back: Floats, height: float, first: bool, last: bool) -> tuple[MeshSurface, ...]:
    rims = [_at(points, 0.0), _at(points, height), _at(points + back, height), _at(points + back, 0.0)]
    front, top, rear = (_strip(low, high) for low, high in itertools.pairwise(rims))
    sides = joined([front, rear, *_caps(rims, first, last)]).dim_below(height, WALL_FOOT)
    return sides.surface(WALL, Label.WALL), top.surface(COPING, Label.WALL)


def _duct(
    points: Floats, back: Floats, height: float, first: bool, last: bool, detail: Detail
) -> tuple[MeshSurface, ...]:
    """A tube on the floor; its texture has the rings, whose contrast fades where they are smaller than a pixel."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    periods = along / along[-1] * max(1.0, np.round(along[-1] / RING_PERIOD))  # as many whole ones as fit
    profile = PROFILE[:: STEPS[detail]]
    rims = [_at(points + back * (0.5 + 0.5 * outward), height * (0.5 + 0.5 * up)) for (outward, up), _ in profile]
    normals = [_normal(back, *normal) for _, normal in profile]
    sides = [_strip(*edges, periods=periods) for edges in zip(rims, rims[1:], normals, normals[1:], strict=False)]
    return (joined([*sides, *_caps(rims, first, last)]).dim_below(0.5 * height, DUCT_FOOT).surface(DUCT, Label.WALL),)


def _caps(rims: list[Floats], first: bool, last: bool) -> Iterator[Mesh]:
    """The first and the last end of a solid with these edges, as fans of triangles.

    Those of a duct are as light as the duct: far gaps between ducts are then no dark dots.
    """
    for k, is_end in ((0, first), (-1, last)):
        if is_end:
            outline = np.array([rim[k] for rim in rims])
            n, top = len(outline), len(outline) // 2  # a fan from the foot would have triangles without area
            around = [(top + step) % n for step in range(1, n)]
            triangles = np.array([[top, c, b] if k == 0 else [top, b, c] for b, c in itertools.pairwise(around)])
            a, b, c = outline[triangles[0]]
            facing = np.cross(b - a, c - a)
            yield Mesh(outline, np.tile(facing / np.linalg.norm(facing), (n, 1)), triangles, np.zeros((n, 2)))


def _at(points: Floats, z: float) -> Floats:
    return np.column_stack([points, np.full(len(points), z)])


def _normal(back: Floats, outward: float, up: float) -> Floats:
    flat = back / np.linalg.norm(back, axis=1)[:, None]
    return np.column_stack([flat * outward, np.full(len(back), up)])


def _strip(
    low: Floats,
    high: Floats,
    low_normal: Floats | None = None,
    high_normal: Floats | None = None,
    *,
    periods: Floats | None = None,
) -> Mesh:
    """Quadrilaterals between two lines; the outside is where `high` is to the left of, or above, `low`.

    Seen from outside, the lines run from right to left. `periods`: of a texture that is constant from `low` to `high`,
    at each point; without it, a texture is 0.5 m wide and high.
    """
    corners = np.stack([low[:-1], high[:-1], high[1:], low[1:]], axis=1)
    if low_normal is None or high_normal is None:
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        facing /= np.maximum(np.linalg.norm(facing, axis=1), 1e-12)[:, None]
        normals = np.repeat(facing[:, None], 4, axis=1)
    else:
        normals = np.stack([low_normal[:-1], high_normal[:-1], high_normal[1:], low_normal[1:]], axis=1)
    up = np.zeros(len(corners))
    if periods is None:
        periods = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(low, axis=0), axis=1))]) / 0.5
        up = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1) / 0.5
    zero = np.zeros(len(corners))
    a, b = periods[:-1], periods[1:]
    uvs = np.stack([np.column_stack(at) for at in ((a, zero), (a, -up), (b, -up), (b, zero))], axis=1)
    triangles = 4 * np.arange(len(corners))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(corners.reshape(-1, 3), normals.reshape(-1, 3), triangles.reshape(-1, 3), uvs.reshape(-1, 2))
