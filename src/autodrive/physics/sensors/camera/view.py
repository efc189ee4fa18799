"""A view of an ideal camera, and the image that the renderer makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from autodrive.base.transforms import Quaternion, Vector

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from autodrive.protocol.messages import CameraIntrinsics


@dataclass(frozen=True)
class View:
    """Pose and intrinsics of an ideal pinhole camera; the renderer does not apply distortion."""

    position: Vector
    """Position in the map frame [m]."""
    orientation: Quaternion
    """Quaternion wxyz, map from optical frame (x right, y down, z forward)."""
    intrinsics: CameraIntrinsics
    near: float = 0.01
    """Near clipping distance [m]."""
    far: float = 1000.0
    """Far clipping distance [m]."""
    is_outlined: bool = False
    """Whether vehicles have faint outlines at night, for people: not in the images of sensors."""


@dataclass(frozen=True)
class RenderedImage:
    """The rendered image of a View; arrays as in `CameraImage`, owned by the caller."""

    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32] | None = None
    labels: NDArray[np.uint8] | None = None
    instances: NDArray[np.uint16] | None = None
