"""From where a picture is drawn, and the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from autodrive.transforms import Quaternion, Vector

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from autodrive.protocol.messages import CameraIntrinsics


@dataclass(frozen=True)
class View:
    """An ideal pinhole camera at a place; distortion is not the renderer's."""

    position: Vector
    """In the map [m]."""
    orientation: Quaternion
    """Map from optical frame (x right, y down, z forward)."""
    intrinsics: CameraIntrinsics
    near: float = 0.01
    """Nothing nearer is drawn [m]."""
    far: float = 1000.0
    """Nothing farther is drawn [m]."""


@dataclass(frozen=True)
class Picture:
    """What a View sees; arrays as in `CameraImage`, and the caller's own."""

    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32] | None = None
    labels: NDArray[np.uint8] | None = None
