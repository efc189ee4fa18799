"""Builds Frames from the State of a world."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from autodrive.actuators.lights import lit_lamps
from autodrive.arrays import Floats, read_only_copy
from autodrive.compile import Compiled
from autodrive.controls import VehicleControls
from autodrive.protocol.messages import Event, Frame, Lights, ObjectFrame, Pose, VehicleFrame, WheelsReading
from autodrive.sensors import feedback
from autodrive.state import State
from autodrive.units import RPM

REVERSE_SPEED = -0.05 * RPM
"""The reverse lights are on while the rear wheels turn slower than this [rad/s]."""


class FrameBuilder:
    """Builds the Frames of one world; each Frame has copies of the State, which later ticks do not change."""

    def __init__(self, compiled: Compiled) -> None:
        self._state = compiled.state
        self._sensors = compiled.sensors
        self._objects = compiled.objects
        self._wheels = [_wheel_views(compiled.state, i) for i in range(len(compiled.vehicles))]
        self._blink_ticks = [
            (name, vehicle.lights.blink_period, compiled.spec.tick) for name, vehicle in compiled.vehicles.items()
        ]

    def build(
        self,
        tick: int,
        time: float,
        controls: Sequence[VehicleControls],
        collision_counts: Sequence[int],
        events: tuple[Event, ...],
        scene_light: bool,
        time_of_day: float | None = None,
    ) -> Frame:
        """The Frame of the State at `time` [s]; `controls` and `collision_counts` are by number of the vehicle."""
        return Frame(
            time=time,
            tick=tick,
            vehicles={
                name: self._vehicle_frame(
                    i, name, controls[i], (tick - controls[i].indicators_since) * duration / period, collision_counts[i]
                )
                for i, (name, period, duration) in enumerate(self._blink_ticks)
            },
            objects={name: ObjectFrame(_pose(self._state.qpos, start)) for name, start in self._objects.items()},
            events=events,
            scene_light=scene_light,
            time_of_day=time_of_day,
        )

    def _vehicle_frame(
        self, i: int, name: str, controls: VehicleControls, blinks: float, collision_count: int
    ) -> VehicleFrame:
        """`blinks`: periods of the indicators since they were switched on."""
        state = self._state
        return VehicleFrame(
            pose=Pose(read_only_copy(state.vehicle_position[i]), read_only_copy(state.vehicle_orientation[i])),
            velocity=read_only_copy(state.vehicle_velocity[i]),
            angular_velocity=read_only_copy(state.vehicle_angular_velocity[i]),
            throttle=feedback.throttle(state, i),
            steering=feedback.steering(state, i),
            lights=_lights(state, i, controls, blinks),
            wheels=_wheels_reading(self._wheels[i]),
            is_autonomous=controls.is_autonomous,
            collision_count=collision_count,
            **self._sensors[name].readings(),
        )


def _lights(state: State, i: int, controls: VehicleControls, blinks: float) -> Lights:
    rear = state.wheel_angular_velocity[4 * i + 2] + state.wheel_angular_velocity[4 * i + 3]
    return lit_lamps(
        controls.headlights,
        controls.indicators,
        blinks % 1.0,
        is_braking=state.throttle[i] == 0.0,
        is_reversing=bool(state.throttle[i] < 0.0 or 0.5 * rear < REVERSE_SPEED),
    )


def _wheel_views(state: State, i: int) -> list[Floats]:
    """What a `WheelsReading` holds, in its order, as views of the State."""
    wheels = slice(4 * i, 4 * i + 4)
    return [
        column[wheels]
        for column in (
            state.wheel_steering_angle,
            state.wheel_rotation,
            state.wheel_angular_velocity,
            state.wheel_compression,
            state.wheel_normal_load,
            state.wheel_slip_ratio,
            state.wheel_slip_angle,
        )
    ]


def _wheels_reading(views: list[Floats]) -> WheelsReading:
    values = np.concatenate(views).reshape(-1, 4)  # one copy: seven small ones take longer than all the rest
    values.setflags(write=False)
    return WheelsReading(*values)


def _pose(qpos: Floats, start: int) -> Pose:
    return Pose(read_only_copy(qpos[start : start + 3]), read_only_copy(qpos[start + 3 : start + 7]))
