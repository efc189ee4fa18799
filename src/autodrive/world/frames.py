"""Builds Frames from the State of a world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from msgspec.structs import replace

from autodrive.base.arrays import Floats, Integers, read_only, read_only_copy
from autodrive.base.suggest import ByName
from autodrive.base.units import RPM
from autodrive.physics.actuators.lights import lit_lamps
from autodrive.physics.state import State, numbers, places
from autodrive.protocol.messages import (
    Event,
    Frame,
    Lights,
    ObjectFrame,
    Pose,
    RaceState,
    TrafficLightFrame,
    V2xReading,
    VehicleFrame,
    WheelsReading,
)
from autodrive.world.compile import CompiledScenario
from autodrive.world.conditions import WorldConditions
from autodrive.world.controls import VehicleControls

REVERSE_SPEED = -0.05 * RPM
"""The reverse lights are on while the rear wheels turn slower than this [rad/s]."""


def braking_and_reversing(throttle: Any, rear_spin: Any, is_braking: Any, coasts: Any) -> tuple[Any, Any]:
    """Whether the brake lights and the reverse lights are on, of one vehicle or of arrays of them.

    `rear_spin`: mean of the rear wheels [rad/s]; `is_braking`: whether a driver of the traffic brakes; `coasts`:
    whether the vehicle does not brake at zero throttle.
    """
    return ((throttle == 0.0) & (coasts ^ True)) | is_braking, (throttle < 0.0) | (rear_spin < REVERSE_SPEED)


class FrameBuilder:
    """Builds the Frames of one world; each Frame has copies of the State, which later ticks do not change."""

    def __init__(self, compiled: CompiledScenario, conditions: WorldConditions) -> None:
        self._conditions = conditions
        self._own_sensors = compiled.own_sensors
        self._numbers = numbers(compiled.state)
        self._state, self._qpos = compiled.state, compiled.state.qpos
        self._sensors = compiled.sensors
        self._objects = compiled.objects
        where = places(compiled.state)
        self._places = [_places_of(where, i) for i in range(len(compiled.vehicles))]
        self._names = list(compiled.vehicles)
        self._blink_periods = [vehicle.lights.blink_period for vehicle in compiled.vehicles.values()]
        self._coasts = [vehicle.drivetrain.coasts for vehicle in compiled.vehicles.values()]
        self._tick_duration = compiled.spec.tick
        traffic = set(compiled.spec.traffic.names)
        self._is_traffic = [name in traffic for name in compiled.vehicles]
        self._lights: list[tuple[object, Lights | None]] = [(None, None) for _ in compiled.vehicles]
        """The latest lights of each vehicle, and what they depend on: they seldom change."""

    def build(
        self,
        tick: int,
        time: float,
        controls: Sequence[VehicleControls],
        collision_counts: Sequence[int],
        events: tuple[Event, ...],
        *,
        races: Sequence[RaceState] | None = None,
        traffic_lights: dict[str, TrafficLightFrame],
        heard: Sequence[V2xReading],
    ) -> Frame:
        """The Frame of the State at `time` [s]; what is given of the vehicles is by their number."""
        conditions = self._conditions
        scene_light, time_of_day = conditions.light.at(time)
        frame = Frame(
            time=time,
            tick=tick,
            vehicles=ByName(
                {
                    name: self._vehicle_frame(
                        i,
                        tick,
                        controls[i],
                        collision_counts[i],
                        races[i] if races else None,
                        heard[i] if heard else None,
                    )
                    for i, name in enumerate(self._names)
                }
            ),
            objects={name: ObjectFrame(_pose(self._qpos, start)) for name, start in self._objects.items()},
            events=events,
            scene_light=scene_light,
            time_of_day=time_of_day,
            traffic_lights=traffic_lights,
        )
        if conditions.shown is None:
            return frame
        return replace(frame, weather=conditions.shown, weather_effects=conditions.effects)

    def _vehicle_frame(
        self,
        i: int,
        tick: int,
        controls: VehicleControls,
        collision_count: int,
        race: RaceState | None,
        heard: V2xReading | None,
    ) -> VehicleFrame:
        values = read_only(self._numbers[self._places[i]])  # one copy: many small ones take longer than all the rest
        throttle, steering, *rear_spins = values[SCALARS].tolist()
        position, orientation, velocity, angular_velocity, *wheels = _arrays_of(values)
        return VehicleFrame(
            pose=Pose(position, orientation),
            velocity=velocity,
            angular_velocity=angular_velocity,
            throttle=throttle,
            steering=steering,
            lights=self._lit_lamps(i, tick, controls, throttle, rear_spins),
            wheels=WheelsReading(*wheels),
            is_autonomous=controls.is_autonomous,
            collision_count=collision_count,
            race=race,
            own=self._own_sensors.readings(i) if self._own_sensors.placed else {},
            is_traffic=self._is_traffic[i],
            v2x=heard,
            **self._sensors.readings(i),
        )

    def lamps(self, tick: int, controls: Sequence[VehicleControls]) -> list[Lights]:
        """The lamps of all vehicles at that tick."""
        throttle, spin = self._state.throttle.tolist(), self._state.wheel_angular_velocity.reshape(-1, 4).tolist()
        return [self._lit_lamps(i, tick, controls[i], throttle[i], spin[i][2:]) for i in range(len(self._names))]

    def _lit_lamps(
        self, i: int, tick: int, controls: VehicleControls, throttle: float, rear_spins: Sequence[float]
    ) -> Lights:
        """The lamps of vehicle i; `rear_spins`: angular velocities of its rear wheels [rad/s]."""
        left, right = rear_spins
        is_braking, is_reversing = braking_and_reversing(
            throttle, 0.5 * (left + right), controls.is_braking, self._coasts[i]
        )
        blinks = (tick - controls.indicators_since) * self._tick_duration / self._blink_periods[i]
        key = controls.headlights, controls.indicators, blinks % 1.0 >= 0.5, is_braking, is_reversing
        before, lights = self._lights[i]
        if lights is None or key != before:
            lights = lit_lamps(controls.headlights, controls.indicators, blinks % 1.0, is_braking, is_reversing)
            self._lights[i] = key, lights
        return lights


SCALARS = slice(0, 4)
"""Where throttle, steering and the spin of the rear wheels are in `_places_of`."""
ARRAYS = (slice(4, 7), slice(7, 11), slice(11, 14), slice(14, 17), *(slice(k, k + 4) for k in range(17, 45, 4)))
"""Where position, orientation, both velocities and the fields of `WheelsReading` are."""
_arrays_of: Callable[[Floats], tuple[Floats, ...]] = itemgetter(*ARRAYS)


def _places_of(where: State, i: int) -> Integers:
    """Where the numbers of vehicle i are; throttle and steering are virtual sensors (report, tables 2 and 3)."""
    wheels = slice(4 * i, 4 * i + 4)
    parts = (
        where.throttle[i : i + 1],
        where.steering_angle[i : i + 1],
        where.wheel_angular_velocity[4 * i + 2 : 4 * i + 4],
        where.vehicle_position[i],
        where.vehicle_orientation[i],
        where.vehicle_velocity[i],
        where.vehicle_angular_velocity[i],
        where.wheel_steering_angle[wheels],
        where.wheel_rotation[wheels],
        where.wheel_angular_velocity[wheels],
        where.wheel_compression[wheels],
        where.wheel_normal_load[wheels],
        where.wheel_slip_ratio[wheels],
        where.wheel_slip_angle[wheels],
    )
    return np.concatenate(parts).astype(np.int64)


def _pose(qpos: Floats, start: int) -> Pose:
    return Pose(read_only_copy(qpos[start : start + 3]), read_only_copy(qpos[start + 3 : start + 7]))
