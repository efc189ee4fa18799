"""Render state: poses and lamp states of one Frame in a flat array that can be shared between processes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from autodrive.graphics.render.look import DAY, NIGHT, Air, Daylight, air_of, in_air, look_at
from autodrive.physics.actuators.lights import LAMPS, lamp_levels
from autodrive.scenario.maps.light_programs import MAX_LIGHTS

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.protocol.messages import Frame, Lights, TrafficLightFrame

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
HEADER = np.dtype(
    [
        ("time", np.float64),
        ("is_day", np.float64),
        ("time_of_day", np.float64),
        ("air", np.float64, len(Air._fields)),
        ("traffic_lights", np.float64, MAX_LIGHTS),
    ]
)
"""`time_of_day` [s] is nan if the light is fixed. `air`: see `look.Air`. `traffic_lights`: the `TrafficLightState` of
each, in the order of the Frame."""


@dataclass(frozen=True)
class RenderState:
    """The fields are views of one flat array `data`."""

    data: Floats
    header: np.ndarray
    vehicles: np.ndarray
    """Shape (n_vehicle,), dtype `VEHICLE`, in the order of the Frame."""
    objects: np.ndarray
    """Shape (n_object,), dtype `OBJECT`, in the order of the Frame."""

    @staticmethod
    def of(frame: Frame) -> RenderState:
        """The state of that Frame."""
        state = RenderState.empty(len(frame.vehicles), len(frame.objects))
        state.header["time"], state.header["is_day"] = frame.time, frame.scene_light
        if frame.time_of_day is not None:
            state.header["time_of_day"] = frame.time_of_day
        if frame.weather is not None:
            state.header["air"] = air_of(frame.weather)
        state.show(frame.traffic_lights)
        for row, vehicle in zip(state.vehicles, frame.vehicles.values(), strict=True):
            row["position"], row["orientation"] = vehicle.pose.position, vehicle.pose.orientation
            row["velocity"], row["angular_velocity"] = vehicle.velocity, vehicle.angular_velocity
            wheels = vehicle.wheels
            row["steering"], row["spin"] = wheels.steering_angle, wheels.rotation_angle
            row["compression"] = wheels.compression
            row["lamps"] = lamp_levels(vehicle.lights)
        for row, object_ in zip(state.objects, frame.objects.values(), strict=True):
            row["position"], row["orientation"] = object_.pose.position, object_.pose.orientation
        return state

    @staticmethod
    def empty(vehicles: int, objects: int) -> RenderState:
        """All zeros and no time of day, for that many vehicles and movable objects."""
        sizes = [HEADER.itemsize, vehicles * VEHICLE.itemsize, objects * OBJECT.itemsize]
        state = RenderState.from_buffer(np.zeros(sum(sizes) // 8), vehicles, objects)
        state.header["time_of_day"] = math.nan
        return state

    @staticmethod
    def from_buffer(data: Floats, vehicles: int, objects: int) -> RenderState:
        """A view of an existing array."""
        cut = np.cumsum([HEADER.itemsize // 8, vehicles * VEHICLE.itemsize // 8])
        header, vehicle_rows, object_rows = np.split(data, cut)
        return RenderState(data, header.view(HEADER)[0], vehicle_rows.view(VEHICLE), object_rows.view(OBJECT))

    def show(self, lights: Mapping[str, TrafficLightFrame]) -> None:
        """Set what the traffic lights show."""
        self.header["traffic_lights"][: len(lights)] = [light.state for light in lights.values()]

    def switch_lamps(self, lights: Lights) -> None:
        """Set the lamps of all vehicles."""
        self.vehicles["lamps"] = lamp_levels(lights)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.header["time"])

    @property
    def is_day(self) -> bool:
        """Whether the scene light is on."""
        return bool(self.header["is_day"])

    @property
    def look(self) -> Daylight:
        """Sun, sky and exposure."""
        time_of_day = float(self.header["time_of_day"])
        fixed = DAY if self.is_day else NIGHT
        look = fixed if math.isnan(time_of_day) else look_at(time_of_day)
        air = Air(*self.header["air"].tolist())
        return look if air == Air() else in_air(look, air)
