"""What a camera is and where it sits."""

from __future__ import annotations

from pydantic import Field

from autodrive.descriptions import Spec
from autodrive.sensors.sensor import Mount


class CameraSpec(Spec):
    """An ideal camera (report, table 8). The optical axis is the mount's x axis."""

    mount: Mount
    width: int = Field(gt=0)
    """[pixels]."""
    height: int = Field(gt=0)
    """[pixels]."""
    field_of_view_deg: float = Field(gt=0, lt=180)
    """Vertical field of view [degree]."""
    focal_length: float = Field(gt=0)
    """[m]."""
    sensor_size: tuple[float, float]
    """Width and height [m]."""
