"""Builds the meshes of the barriers of a race track: walls with a coping, and air ducts with dark rings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
import shapely

from autodrive.graphics.assets.asset import AssetNode, Detail, Material, MeshSurface
from autodrive.graphics.meshes.polygons import Mesh, joined
from autodrive.protocol.labels import Label
from autodrive.scenario.maps.track_map import Barrier, barriers

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.scenario.tracks.track import Track

WALL = Material("barrier", (0.62, 0.63, 0.62), roughness=0.9, texture="plaster")
COPING = Material("barrier_top", (0.55, 0.06, 0.04), roughness=0.8)
DUCT = Material("duct", (1.0, 1.0, 1.0), roughness=0.65, texture="duct")
CHUNK = 4.0
"""Length of the barrier of one node, about [m]: what is not visible is left out node by node."""
DUCT_PROFILE = (
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
WALL_PROFILE = (((-1.0, -1.0), None), ((-1.0, 1.0), None), ((1.0, 1.0), None), ((1.0, -1.0), None))
"""Cross-section of a wall, as `DUCT_PROFILE` is of a duct, but with faces that look flat."""
STEPS: dict[Detail, int] = {"full": 1, "reduced": 1, "shadow": 2}
"""What casts the shadow has every second edge of what is drawn, which is the same box."""
DUCT_FOOT, WALL_FOOT = 0.5, 0.65
"""Share of the sky that the foot of a duct and that of a wall see; from half the height of the duct on, it is all."""
BEHIND = 0.001
"""The back of a barrier is at least this far behind its face [m], and begins to look for other faces there."""
TEXTURE_SIZE = 0.5
"""Width and height of the texture of a wall [m]."""
RING_PERIOD = 0.5
"""Distance between the dark rings of a duct, about [m]; its texture has one."""


_Edge: TypeAlias = tuple[tuple[float, float], tuple[float, float] | None]
"""An edge of a profile, as in `DUCT_PROFILE`."""


def barrier_nodes(track: Track) -> Iterator[AssetNode]:
    """Nodes 'barrier_<i>', each a few metres of a barrier."""
    for number, levels in enumerate(_levels(track), 1):
        yield AssetNode(f"barrier_{number}", surfaces=levels)


def _levels(track: Track) -> Iterator[dict[Detail, tuple[MeshSurface, ...]]]:
    """The surfaces of each node."""
    spec = track.barrier
    all_barriers = barriers(track)
    for barrier, back in zip(all_barriers, _backs(all_barriers) if all_barriers else [], strict=True):
        for line in (*_chunks(barrier, back), *_pieces_beyond(barrier, back)):
            if spec.kind == "duct":
                yield {detail: _duct(line, spec.height, detail) for detail in STEPS}
            else:
                yield dict.fromkeys(STEPS, _wall(line, spec.height))


class _BarrierPart(NamedTuple):
    """A part of a barrier."""

    points: Floats
    """Points on the face [m], shape (n, 2)."""
    back: Floats
    """Vectors from these points to the back edge of the top, with mitred corners [m], shape (n, 2)."""
    deep: Floats
    """Vectors from the face of each solid piece to its back [m], shape (n - 1, 2)."""


def _deep(barrier: Barrier) -> Floats:
    """Vectors from the face of each solid piece of a barrier to its back [m], shape (n - 1, 2)."""
    ahead = np.diff(barrier.points, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    return np.column_stack([ahead[:, 1], -ahead[:, 0]]) * barrier.depth[:, None]


def _pieces_beyond(barrier: Barrier, back: Floats) -> Iterator[_BarrierPart]:
    """Each solid piece whose top is not covered by the top with mitred corners.

    It is a piece at a sharp corner, or a thick one between thin ones.
    """
    deep = _deep(barrier)
    begin, end, behind = barrier.points[:-1], barrier.points[1:], barrier.points + back
    tops = shapely.convex_hull(shapely.multipoints(np.stack([begin, end, behind[1:], behind[:-1]], axis=1)))
    covered = shapely.union_all(tops).buffer(2.0 * BEHIND)
    shapely.prepare(covered)
    pieces = shapely.polygons(np.stack([begin, end, end + deep, begin + deep], axis=1))
    for k in np.flatnonzero(~shapely.covers(covered, pieces)).tolist():
        yield _BarrierPart(barrier.points[k : k + 2], deep[[k, k]], deep[[k]])


def _backs(barriers: list[Barrier]) -> list[Floats]:
    """Vectors from the points of each barrier to its back edge [m], shape (n, 2), with mitred corners.

    They are shorter where the back would else reach through another face into the free space: a mitred corner is
    farther behind its face than the solid pieces, which have square ends.
    """
    mitres, depths = zip(*(_mitres(barrier) for barrier in barriers), strict=True)
    mitre, depth, points = (
        np.vstack(mitres),
        np.concatenate(depths),
        np.vstack([barrier.points for barrier in barriers]),
    )
    is_start = np.ones(len(points), bool)
    is_start[np.cumsum([len(barrier.points) for barrier in barriers]) - 1] = False
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
    splits = np.cumsum([len(barrier.points) for barrier in barriers])[:-1]
    backs = np.split(mitre * depth[:, None], splits)
    for barrier, back in zip(barriers, backs, strict=True):
        if barrier.is_closed:
            back[0] = back[-1] = min(back[0], back[-1], key=np.linalg.norm)
    return backs


def _lines(*points: Floats) -> Any:
    """Lines through the first, second ... points, shape (n, 2) each."""
    return shapely.linestrings(np.stack(points, axis=1))


def _mitres(barrier: Barrier) -> tuple[Floats, Floats]:
    """Vectors from the points of a face to a line 1 m behind it, mitred, and the thickness of the barrier there [m]."""
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


def _chunks(barrier: Barrier, back: Floats) -> Iterator[_BarrierPart]:
    """The barrier in parts of about `CHUNK`."""
    points, deep = barrier.points, _deep(barrier)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    cuts = [0]
    for i in range(1, len(points) - 1):
        if length[i] - length[cuts[-1]] > CHUNK:
            cuts.append(i)
    cuts.append(len(points) - 1)
    for a, b in itertools.pairwise(cuts):
        yield _BarrierPart(points[a : b + 1], back[a : b + 1], deep[a:b])


def _wall(line: _BarrierPart, height: float) -> tuple[MeshSurface, ...]:
    along = _along(line) / TEXTURE_SIZE
    front, top, rear = (_band(line, height, *edges, along) for edges in itertools.pairwise(WALL_PROFILE))
    sides = joined([front, rear, _ends(line, height)]).dim_below(height, WALL_FOOT)
    return sides.surface(WALL, Label.WALL), top.surface(COPING, Label.WALL)


def _duct(line: _BarrierPart, height: float, detail: Detail) -> tuple[MeshSurface, ...]:
    """A tube on the floor; its texture has the rings, whose contrast fades where they are smaller than a pixel.

    Its ends are as light as the duct: far gaps between ducts are then no dark dots.
    """
    along = _along(line)
    periods = along / along[-1] * max(1.0, np.round(along[-1] / RING_PERIOD))  # as many whole ones as fit
    edges = itertools.pairwise(DUCT_PROFILE[:: STEPS[detail]])
    bands = [_band(line, height, low, high, periods) for low, high in edges]
    return (joined([*bands, _ends(line, height)]).dim_below(0.5 * height, DUCT_FOOT).surface(DUCT, Label.WALL),)


def _along(line: _BarrierPart) -> Floats:
    """Way along the face to each point [m], shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line.points, axis=0), axis=1))])


def _band(line: _BarrierPart, height: float, low: _Edge, high: _Edge, along: Floats) -> Mesh:
    """Quadrilaterals between two edges of a profile, one for each piece: mitred, but square at the back.

    `along`: horizontal texture coordinate of each point, shape (n,).
    """
    (at_low, low_normal), (at_high, high_normal) = low, high
    is_rear = at_low[0] == at_high[0] == 1.0
    begin, end = (line.deep, line.deep) if is_rear else (line.back[:-1], line.back[1:])
    sections = ((line.points[:-1], begin), (line.points[1:], end))
    a, b, d, c = (_edge(*section, height, *at) for section in sections for at in (at_low, at_high))
    normals = None
    if low_normal and high_normal:
        low_begin, high_begin, low_end, high_end = (
            _normal(back, *normal) for back in (begin, end) for normal in (low_normal, high_normal)
        )
        normals = np.stack([low_begin, high_begin, high_end, low_end], axis=1)
    return _quads(np.stack([a, b, c, d], axis=1), along[:-1], along[1:], normals)


def _ends(line: _BarrierPart, height: float) -> Mesh:
    """The square ends of all solid pieces: they show at the ends of a duct, and between two pieces behind a bend."""
    begin, end = line.points[:-1], line.points[1:]
    a, b = np.vstack([begin + line.deep, end]), np.vstack([begin, end + line.deep])
    zero = np.zeros(len(a))
    return _quads(np.stack([_at(a, 0.0), _at(a, height), _at(b, height), _at(b, 0.0)], axis=1), zero, zero)


def _edge(points: Floats, back: Floats, height: float, outward: float, up: float) -> Floats:
    """An edge of a profile [m], shape (n, 3)."""
    return _at(points + back * (0.5 + 0.5 * outward), height * (0.5 + 0.5 * up))


def _at(points: Floats, z: float) -> Floats:
    return np.column_stack([points, np.full(len(points), z)])


def _normal(back: Floats, outward: float, up: float) -> Floats:
    flat = back / np.linalg.norm(back, axis=1)[:, None]
    return np.column_stack([flat * outward, np.full(len(back), up)])


def _quads(corners: Floats, begin: Floats, end: Floats, normals: Floats | None = None) -> Mesh:
    """Quadrilaterals, shape (n, 4, 3), with corners lower right, upper right, upper left, lower left from outside.

    `begin`, `end`: horizontal texture coordinates of the right and of the left side. With normals, the texture is
    constant upwards; without them, the faces look flat, and a texture is `TEXTURE_SIZE` high.
    """
    up = np.zeros(len(corners))
    if normals is None:
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        facing /= np.maximum(np.linalg.norm(facing, axis=1), 1e-12)[:, None]
        normals = np.repeat(facing[:, None], 4, axis=1)
        up = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1) / TEXTURE_SIZE
    zero = np.zeros(len(corners))
    uvs = np.stack([np.column_stack(at) for at in ((begin, zero), (begin, -up), (end, -up), (end, zero))], axis=1)
    triangles = 4 * np.arange(len(corners))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(corners.reshape(-1, 3), normals.reshape(-1, 3), triangles.reshape(-1, 3), uvs.reshape(-1, 2))
