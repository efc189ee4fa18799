"""Indoor Positioning System: position of the vehicle in the map, a scaled form of GNSS (report, table 5)."""

from __future__ import annotations

from typing import Any, ClassVar

from autodrive.base.arrays import Floats
from autodrive.base.jit import inlined
from autodrive.base.transforms import rotate
from autodrive.physics.sensors.columns import Due, Memory, ReadingColumns, add_noise, mount_position
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.sensor import Mount, Reader, Sampled, SensorSpec
from autodrive.protocol.messages import IpsReading


@inlined
def sample(due: Due, values: Floats, row: Any, memory: Memory) -> None:
    """The position of the mount [m]."""
    lever = rotate(memory.motion.vehicle_orientation[due.i], mount_position(due, row))
    for axis in range(3):
        values[axis] = memory.motion.vehicle_position[due.i, axis] + lever[axis]
    add_noise(due, memory, values)


class IpsSpec(SensorSpec, Sampled):
    """Measures the position of one point of the vehicle, by default the centre of the rear axle."""

    VALUES: ClassVar[int] = 3
    NOISY_VALUES: ClassVar[int] = 3
    STRONG: ClassVar[float] = 0.05
    sample: ClassVar[Any] = sample

    mount: Mount = Mount()
    """The measured point; the rotation is not used."""
    noise: NoiseSpec = NoiseSpec()
    """Noise of each coordinate [m]."""

    def reader(self, readings: ReadingColumns, vehicle: int, first: int) -> Reader:
        """The function that makes an `IpsReading` from time and values, see `Sampled.reader`."""
        position = slice(first, first + 3)
        return lambda time, values: IpsReading(time, values[position])
