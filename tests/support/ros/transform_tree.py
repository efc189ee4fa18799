"""Transforms as 4x4 matrices and trees of them: an independent implementation of what tf2 computes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from autodrive.connect.ros import Message

Matrix = NDArray[np.float64]


def matrix(position: Iterable[float], quaternion_xyzw: Iterable[float]) -> Matrix:
    """Formula of Rodrigues: R = 1 + 2 w [u] + 2 [u]^2."""
    x, y, z, w = quaternion_xyzw
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] += 2.0 * w * cross + 2.0 * cross @ cross
    pose[:3, 3] = [*position]
    return pose


class Tree:
    """Built from TFMessages; the last transform of each frame is used."""

    def __init__(self, *messages: Message) -> None:
        self._poses: dict[str, tuple[str, Matrix]] = {}
        for message in messages:
            for one in message.fields["transforms"]:
                transform = one.fields["transform"]
                pose = matrix(transform["translation"].values(), transform["rotation"].values())
                self._poses[one.fields["child_frame_id"]] = one.fields["header"]["frame_id"], pose

    def pose(self, ancestor: str, frame: str) -> Matrix:
        """Pose of a frame in one of its ancestors."""
        parent, pose = self._poses[frame]
        return pose if parent == ancestor else self.pose(ancestor, parent) @ pose
