"""Observations and actions of one vehicle at a fixed rate, for datasets of learning libraries."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from autodrive.protocol.messages import Command, Frame
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.recording import LazyImages

STATE = (
    *("position.x", "position.y", "yaw", "speed", "yaw_rate"),
    *("acceleration.x", "acceleration.y", "throttle_feedback", "steering_feedback"),
)
"""Elements of the observation: what IPS, IMU, encoders and actuators give. [m], [rad], [m/s], [rad/s], [m/s^2]."""
ACTION = ("throttle", "steering")
"""Elements of the action: the latest command of the vehicle."""


@dataclass(frozen=True)
class Step:
    """One time step."""

    time: float
    """In the recording [s]."""
    episode: int
    """Resets before it."""
    state: NDArray[np.float32]
    """See `STATE`."""
    action: NDArray[np.float32]
    """See `ACTION`."""
    images: LazyImages


def steps(recording: Recording, options: ExportOptions, rate: float) -> Iterator[Step]:
    """The steps of one vehicle. Raises `RecordingError` if there are none."""
    vehicle = options.vehicles(recording)[0]
    commands = list(recording.commands)
    next_command, command, episode, tick = 0, Command(), 0, -1
    for time, frame in options.moments(recording, rate):
        while next_command < len(commands) and commands[next_command][0] <= time + 1e-9:
            command = commands[next_command][1].commands.get(vehicle, command)
            next_command += 1
        if frame.tick < tick:
            episode += 1
        tick = frame.tick
        action = np.clip(np.array([command.throttle, command.steering], np.float32), -1.0, 1.0)
        images = frame.vehicles[vehicle].cameras
        assert isinstance(images, LazyImages)
        yield Step(time, episode, _state(frame, vehicle), action, images)


def checked(found: list[Step]) -> list[Step]:
    """Raises `RecordingError` if a dataset needs more steps."""
    if len(found) < 2:
        raise RecordingError(f"the dataset would have {len(found)} steps; record a longer drive")
    return found


def _state(frame: Frame, vehicle: str) -> NDArray[np.float32]:
    one = frame.vehicles[vehicle]
    return np.array(
        [
            *one.ips.position[:2],
            one.imu.euler[2],
            one.speed,
            one.imu.angular_velocity[2],
            *one.imu.linear_acceleration[:2],
            one.throttle,
            one.steering,
        ],
        np.float32,
    )
