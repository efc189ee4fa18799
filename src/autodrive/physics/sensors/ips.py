"""Indoor Positioning System: position of the vehicle in the map, a scaled form of GNSS (report, table 5)."""

from __future__ import annotations

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit_uncounted
from autodrive.base.transforms import Vector, rotate
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.sensor import Mount, SensorSpec


class IpsSpec(SensorSpec):
    """Measures the position of one point of the vehicle, by default the centre of the rear axle."""

    mount: Mount = Mount()
    """The measured point; the rotation is not used."""
    noise: NoiseSpec = NoiseSpec()
    """Noise of each coordinate [m]."""


@jit_uncounted
def measure_position(position: Floats, orientation: Floats, offset: Vector, out: Floats) -> None:
    """Write the position of the point at `offset` in the frame of a vehicle [m]."""
    lever = rotate(orientation, offset)
    for axis in range(3):
        out[axis] = position[axis] + lever[axis]
