"""Indoor Positioning System: locates the vehicle within the map, a scaled form of GNSS (report, table 5)."""

from __future__ import annotations

import numpy as np

from autodrive.jit import jit
from autodrive.model import Shapes
from autodrive.protocol.messages import IpsReading
from autodrive.sensors.noise import Noise, NoiseSpec
from autodrive.sensors.sensor import Mount, Sensor, SensorSpec
from autodrive.state import Floats, State
from autodrive.transforms import Vector, rotate


class IpsSpec(SensorSpec):
    """Position of one point of the vehicle; by default of the centre of the rear axle."""

    mount: Mount = Mount()
    """The point whose position is reported (its rotation does not matter)."""
    noise: NoiseSpec = NoiseSpec()
    """[m], of each coordinate."""


class Ips(Sensor[IpsReading]):
    """Reports the position of its mount's origin in the map."""

    def __init__(self, spec: IpsSpec) -> None:
        self._noise = Noise.of((spec.noise, 3))
        super().__init__(self._noise)
        self._offset = spec.mount.position

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> IpsReading:
        """Position in the map."""
        position = np.empty(3)
        _locate(state.vehicle_position, state.vehicle_orientation, vehicle, self._offset, position)
        if self._noise is not None:
            self._noise.add(position, time)
        position.flags.writeable = False
        return IpsReading(time, position)


@jit
def _locate(positions: Floats, orientations: Floats, vehicle: int, offset: Vector, out: Floats) -> None:
    lever = rotate(orientations[vehicle], offset)
    for i in range(3):
        out[i] = positions[vehicle, i] + lever[i]
