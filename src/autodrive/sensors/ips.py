"""Indoor Positioning System: position of the vehicle in the map, a scaled form of GNSS (report, table 5)."""

from __future__ import annotations

import numpy as np

from autodrive.arrays import Floats
from autodrive.jit import jit_uncounted
from autodrive.model import Shapes
from autodrive.protocol.messages import IpsReading
from autodrive.sensors.noise import Noise, NoiseSpec
from autodrive.sensors.sensor import Mount, Sensor, SensorSpec
from autodrive.state import State
from autodrive.transforms import Vector, rotate


class IpsSpec(SensorSpec):
    """Measures the position of one point of the vehicle, by default the centre of the rear axle."""

    mount: Mount = Mount()
    """The measured point; the rotation is not used."""
    noise: NoiseSpec = NoiseSpec()
    """Noise of each coordinate [m]."""


class Ips(Sensor[IpsReading]):
    """Reports the position of the origin of its mount in the map frame."""

    def __init__(self, spec: IpsSpec) -> None:
        self._noise = Noise.of((spec.noise, 3))
        super().__init__(self._noise)
        self._offset = spec.mount.position

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading:
        """Position in the map frame."""
        position = np.empty(3)
        measure_position(state.vehicle_position[vehicle], state.vehicle_orientation[vehicle], self._offset, position)
        if self._noise is not None:
            self._noise.add(position, time)
        position.setflags(write=False)
        return IpsReading(time, position)


@jit_uncounted
def measure_position(position: Floats, orientation: Floats, offset: Vector, out: Floats) -> None:
    """Write the position of the point at `offset` in the frame of a vehicle [m]."""
    lever = rotate(orientation, offset)
    for axis in range(3):
        out[axis] = position[axis] + lever[axis]
