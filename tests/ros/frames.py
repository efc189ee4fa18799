"""Poses as 4x4 matrices, and trees of them: what tf2 does, written again for the tests."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from autodrive.ros import Message

Matrix = NDArray[np.float64]


def matrix(position: Iterable[float], quaternion_xyzw: Iterable[float]) -> Matrix:
    """By the formula of Rodrigues: R = 1 + 2 w [u] + 2 [u]^2."""
    x, y, z, w = quaternion_xyzw
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] += 2.0 * w * cross + 2.0 * cross @ cross
    pose[:3, 3] = [*position]
    return pose


class Tree:
    """Of TFMessages; the latest of each frame counts."""

    def __init__(self, *messages: Message) -> None:
        self._of: dict[str, tuple[str, Matrix]] = {}
        for message in messages:
            for one in message.fields["transforms"]:
                moved = one.fields["transform"]
                pose = matrix(moved["translation"].values(), moved["rotation"].values())
                self._of[one.fields["child_frame_id"]] = one.fields["header"]["frame_id"], pose

    def pose(self, frame: str, of: str) -> Matrix:
        """Of frame `of` in `frame`, its ancestor."""
        parent, pose = self._of[of]
        return pose if parent == frame else self.pose(frame, parent) @ pose
