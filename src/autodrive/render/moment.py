"""What moves, at one moment: all that a picture needs of a Frame, in one flat array that can be shared or sent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from autodrive.actuators.lights import LAMPS, lamp_levels

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame
    from autodrive.state import Floats

VEHICLE = np.dtype(
    [
        ("position", np.float64, 3),
        ("orientation", np.float64, 4),  # wxyz
        ("velocity", np.float64, 3),  # in vehicle axes [m/s]
        ("angular_velocity", np.float64, 3),  # in vehicle axes [rad/s]
        ("steering", np.float64, 4),  # front left, front right, rear left, rear right [rad]
        ("spin", np.float64, 4),
        ("compression", np.float64, 4),  # [m]
        ("lamps", np.float64, len(LAMPS)),
    ]
)
OBJECT = np.dtype([("position", np.float64, 3), ("orientation", np.float64, 4)])
HEADER = np.dtype([("time", np.float64), ("is_day", np.float64)])


@dataclass(frozen=True)
class Moment:
    """Views of one flat array `data`: change it and they change."""

    data: Floats
    header: np.ndarray
    vehicles: np.ndarray
    """Shape (n_vehicle,), dtype `VEHICLE`, in the order of the Frame."""
    objects: np.ndarray
    """Shape (n_object,), dtype `OBJECT`, in the order of the Frame."""

    @staticmethod
    def of(frame: Frame) -> Moment:
        """The moment of that Frame."""
        moment = Moment.empty(len(frame.vehicles), len(frame.objects))
        moment.header["time"], moment.header["is_day"] = frame.time, frame.scene_light
        for row, vehicle in zip(moment.vehicles, frame.vehicles.values(), strict=True):
            row["position"], row["orientation"] = vehicle.pose.position, vehicle.pose.orientation
            row["velocity"], row["angular_velocity"] = vehicle.velocity, vehicle.angular_velocity
            wheels = vehicle.wheels
            row["steering"], row["spin"] = wheels.steering_angle, wheels.rotation_angle
            row["compression"] = wheels.compression
            row["lamps"] = lamp_levels(vehicle.lights)
        for row, thing in zip(moment.objects, frame.objects.values(), strict=True):
            row["position"], row["orientation"] = thing.pose.position, thing.pose.orientation
        return moment

    @staticmethod
    def empty(vehicles: int, objects: int) -> Moment:
        """All zero, for that many vehicles and movable objects."""
        sizes = [HEADER.itemsize, vehicles * VEHICLE.itemsize, objects * OBJECT.itemsize]
        return Moment.on(np.zeros(sum(sizes) // 8), vehicles, objects)

    @staticmethod
    def on(data: Floats, vehicles: int, objects: int) -> Moment:
        """Over an array that is there already, for example in shared memory."""
        cut = np.cumsum([HEADER.itemsize // 8, vehicles * VEHICLE.itemsize // 8])
        header, cars, things = np.split(data, cut)
        return Moment(data, header.view(HEADER)[0], cars.view(VEHICLE), things.view(OBJECT))

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.header["time"])

    @property
    def is_day(self) -> bool:
        """Whether the scene light is on."""
        return bool(self.header["is_day"])
