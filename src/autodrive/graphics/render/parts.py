"""The parts of a mesh that a view draws: those in sight, the nearest first, so that few pixels are drawn twice."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.graphics.render.scene import Geometry


class Parts(NamedTuple):
    """Triangles of a geometry, sorted into n parts: neighbours within one range that move with one bone."""

    indices: NDArray[np.uint32]
    first: NDArray[np.intp]
    """First index of each part, shape (n,)."""
    length: NDArray[np.intp]
    """Number of indices, shape (n,)."""
    range: NDArray[np.intp]
    """Number of its range, shape (n,)."""
    bone: NDArray[np.intp]
    center: Floats
    """Centre of a bounding sphere in the axes of the bone [m], shape (n, 3)."""
    radius: Floats
    """Shape (n,) [m]."""

    @staticmethod
    def of(own: Geometry, size: float) -> Parts:
        """Parts of about that size [m]; one for each range and bone if it is infinite."""
        triangles = own.indices.reshape(-1, 3)
        corners = own.vertices["position"][triangles].astype(np.float64)
        bone = own.vertices["bone_lamp"][triangles[:, 0], 0]
        number = np.repeat(np.arange(len(own.ranges)), [r.length // 3 for r in own.ranges])
        return Parts.of_triangles(triangles, corners, number, bone, size)

    @staticmethod
    def of_triangles(
        triangles: NDArray[np.uint32],
        corners: Floats,
        number: NDArray[np.intp],
        bone: NDArray[np.float32] | NDArray[np.intp],
        size: float,
    ) -> Parts:
        """Parts of n triangles with these corners, shape (n, 3, 3) [m], and the range and bone of each."""
        keys, part = np.unique(
            np.column_stack([number, bone, np.floor(corners.mean(1) / size)]), axis=0, return_inverse=True
        )
        order = np.argsort(part.ravel(), kind="stable")
        count = np.bincount(part.ravel(), minlength=len(keys))
        first = np.cumsum(count) - count
        low, high = np.minimum.reduceat(corners.min(1)[order], first), np.maximum.reduceat(corners.max(1)[order], first)
        return Parts(
            indices=triangles[order].ravel(),
            first=3 * first,
            length=3 * count,
            range=keys[:, 0].astype(np.intp),
            bone=keys[:, 1].astype(np.intp),
            center=0.5 * (low + high),
            radius=0.5 * np.linalg.norm(high - low, axis=1),
        )

    def in_sight(self, clip: Floats, bones: Floats | None = None) -> NDArray[np.intp]:
        """Numbers of the parts that may be visible, the nearest first. `bones`: map from each bone, shape (b, 4, 4).

        `clip`: clip space from map axes.
        """
        centers = self.center
        if bones is not None:
            own = bones[self.bone]
            centers = (own[:, :3, :3] @ centers[..., None])[..., 0] + own[:, :3, 3]
        seen = np.flatnonzero(in_sight(sight_planes(clip), centers, self.radius))
        return seen[np.argsort(centers[seen] @ clip[3, :3], kind="stable")]

    def indices_of(self, numbers: NDArray[np.intp]) -> NDArray[np.uint32]:
        """The indices of these parts, one after the other."""
        length = self.length[numbers]
        start = np.cumsum(length) - length
        return self.indices[np.repeat(self.first[numbers] - start, length) + np.arange(length.sum())]


def sight_planes(clip: Floats) -> Floats:
    """Left, right, bottom, top and near plane of what is seen, shape (..., 5, 4): inward normal, and offset [m].

    `clip`: clip space from map axes, shape (..., 4, 4).
    """
    return _sight_planes(np.asarray(clip, np.float64).tobytes()) if clip.ndim == 2 else _planes(clip)


@lru_cache(maxsize=8)  # a view asks for its planes many times
def _sight_planes(clip: bytes) -> Floats:
    return _planes(np.frombuffer(clip).reshape(4, 4))


def _planes(clip: Floats) -> Floats:
    x, y, z, w = (clip[..., i, :] for i in range(4))
    planes = np.stack([w + x, w - x, w + y, w - y, w + z], axis=-2)
    planes /= np.linalg.norm(planes[..., :3], axis=-1, keepdims=True)
    return planes


def in_sight(planes: Floats, centers: Floats, radii: Floats) -> np.ndarray:
    """Whether each sphere intersects the space inside all planes, shape (..., n).

    `centers`: shape (n, 3) or (..., n, 3); `radii`: shape (n,).
    """
    inside = centers @ np.swapaxes(planes[..., :3], -1, -2) + planes[..., None, :, 3]
    return np.all(inside > -radii[:, None], axis=-1)
