"""Render state: all that a picture of a world depends on, in a flat array that can be shared between processes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive.graphics.render.look import Air, Daylight, air_of, fixed_look, in_air, look_at
from autodrive.physics.actuators.lights import LAMPS, lamp_levels
from autodrive.protocol.messages import Weather
from autodrive.scenario.maps.light_programs import MAX_LIGHTS

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats, Integers
    from autodrive.protocol.messages import Frame, Lights

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
    """All that a picture of a world depends on, or of n worlds; the fields are views of one array `data`."""

    data: Floats
    """Shape (k,), or (n, k) for n worlds, whose axis is also the first one of the other fields."""
    header: np.ndarray
    """Shape (), dtype `HEADER`."""
    vehicles: np.ndarray
    """Shape (n_vehicle,), dtype `VEHICLE`, in the order of the Frame."""
    objects: np.ndarray
    """Shape (n_object,), dtype `OBJECT`, in the order of the Frame."""

    @staticmethod
    def of(frame: Frame) -> RenderState:
        """The state of that Frame."""
        state = RenderState.empty(len(frame.vehicles), len(frame.objects))
        vehicles, objects = frame.vehicles.values(), frame.objects.values()
        state.write(
            {
                "time": frame.time,
                "is_day": frame.scene_light,
                "time_of_day": math.nan if frame.time_of_day is None else frame.time_of_day,
                "air": air_of(frame.weather or Weather()),
                "traffic_lights": [light.state for light in frame.traffic_lights.values()],
            },
            {
                "position": [vehicle.pose.position for vehicle in vehicles],
                "orientation": [vehicle.pose.orientation for vehicle in vehicles],
                "velocity": [vehicle.velocity for vehicle in vehicles],
                "angular_velocity": [vehicle.angular_velocity for vehicle in vehicles],
                "steering": [vehicle.wheels.steering_angle for vehicle in vehicles],
                "spin": [vehicle.wheels.rotation_angle for vehicle in vehicles],
                "compression": [vehicle.wheels.compression for vehicle in vehicles],
                "lamps": [lamp_levels(vehicle.lights) for vehicle in vehicles],
            },
            {
                "position": [object_.pose.position for object_ in objects],
                "orientation": [object_.pose.orientation for object_ in objects],
            },
        )
        return state

    @staticmethod
    def of_all(frames: Sequence[Frame]) -> RenderState:
        """The states of n Frames of a world, at least one."""
        states = [RenderState.of(frame) for frame in frames]
        return RenderState.from_buffer(np.stack([state.data for state in states]), len(states[0].vehicles))

    @staticmethod
    def empty(vehicles: int, objects: int, worlds: int | None = None) -> RenderState:
        """All zeros and no time of day, for that many vehicles and movable objects in a world, or in n of them."""
        size = sum((HEADER.itemsize, vehicles * VEHICLE.itemsize, objects * OBJECT.itemsize)) // 8
        data = np.zeros(size if worlds is None else (worlds, size))
        state = RenderState.from_buffer(data, vehicles)
        state.header["time_of_day"] = math.nan
        return state

    @staticmethod
    def from_buffer(data: Floats, vehicles: int) -> RenderState:
        """A view of an existing array, for that many vehicles."""
        first = HEADER.itemsize // 8
        last = first + vehicles * VEHICLE.itemsize // 8
        header, vehicle_rows, object_rows = data[..., :first], data[..., first:last], data[..., last:]
        return RenderState(data, header.view(HEADER)[..., 0], vehicle_rows.view(VEHICLE), object_rows.view(OBJECT))

    def __getitem__(self, worlds: int | Sequence[int] | Integers) -> RenderState:
        """The state of one of n worlds, or a copy of the states of some."""
        return RenderState.from_buffer(self.data[worlds], self.vehicles.shape[-1])

    def write(self, header: Mapping[str, Any], vehicles: Mapping[str, Any], objects: Mapping[str, Any]) -> None:
        """Write all fields, whose values are given by name; those of `traffic_lights` for the lights of the map."""
        for rows, values in ((self.header, header), (self.vehicles, vehicles), (self.objects, objects)):
            assert values.keys() == set(rows.dtype.names or ())
            for name, value in values.items():
                field = rows[name] if name != "traffic_lights" else rows[name][..., : np.shape(value)[-1]]
                field[...] = np.reshape(value, field.shape)

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
        look = fixed_look(self.is_day) if math.isnan(time_of_day) else look_at(time_of_day)
        air = Air(*self.header["air"].tolist())
        return look if air == Air() else in_air(look, air)
