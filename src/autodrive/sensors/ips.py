"""Indoor Positioning System: locates the vehicle within the map, a scaled form of GNSS (report, table 5)."""

from __future__ import annotations

from autodrive.model import Shapes
from autodrive.protocol.messages import IpsReading
from autodrive.sensors.noise import Noise, NoiseSpec
from autodrive.sensors.sensor import Mount, Sensor, SensorSpec
from autodrive.state import State
from autodrive.transforms import rotate


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
        position = state.vehicle_position[vehicle].copy()
        if any(self._offset):
            position += rotate(state.vehicle_orientation[vehicle], self._offset)
        if self._noise is not None:
            self._noise.add(position, time)
        position.setflags(write=False)
        return IpsReading(time, position)
