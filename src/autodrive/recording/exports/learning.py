"""Observations and actions of one vehicle at a fixed rate, for datasets of learning libraries."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from autodrive.protocol.messages import Command, Frame, LoadScenario, Reset
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.recording import LazyImages
from autodrive.recording.records import COMMANDS, REQUESTS, CommandsRecord, RequestRecord
from autodrive.world.observer import ResetTo

STATE = (
    *("position.x", "position.y", "yaw", "speed", "yaw_rate"),
    *("acceleration.x", "acceleration.y", "throttle_feedback", "steering_feedback"),
)
"""Elements of the observation: what IPS, IMU, encoders and actuators give. [m], [rad], [m/s], [rad/s], [m/s^2]."""
ACTION = ("throttle", "steering")
"""Elements of the action: the command that the vehicle obeys from this step on; 0 after its time-out."""


@dataclass(frozen=True)
class DatasetStep:
    """One time step."""

    time: float
    """Time of the step in the recording [s]."""
    episode: int
    """Number of the episode."""
    state: NDArray[np.float32]
    """Observation of the step, see `STATE`."""
    action: NDArray[np.float32]
    """Action of the step, see `ACTION`."""
    images: LazyImages


def steps(recording: Recording, options: ExportOptions, rate: float) -> Iterator[DatasetStep]:
    """The steps of one vehicle at that rate [Hz]. Raises `RecordingError` if the recording has fewer Frames.

    An episode ends with a reset, with another scenario, and where Frames are missing: its steps have equal intervals,
    but for the distance to the next Frame.
    """
    vehicle = options.vehicles(recording)[0]
    interval = float(np.median(np.diff(np.unique(recording.times)))) if len(recording.times) > 1 else 0.0
    if rate * interval > 1.0 + 1e-6:
        raise RecordingError(
            f"the recording has a Frame every {interval:.4g} s: choose a rate of at most {1.0 / interval:.4g} Hz"
        )
    records = recording.records_of(COMMANDS, REQUESTS)
    record = next(records, None)
    command, since, episode, last = Command(), -math.inf, 0, math.inf
    for time, frame in options.moments(recording, rate):
        has_jump = time > last + 1.0 / rate + interval + 1e-9
        while record is not None and record[0] <= time + 1e-9:
            record_content = record[1]
            if isinstance(record_content, CommandsRecord) and vehicle in record_content.commands:
                command, since = record_content.commands[vehicle], record[0]
            elif isinstance(record_content, RequestRecord) and isinstance(
                record_content.request, Reset | ResetTo | LoadScenario
            ):
                command, has_jump = Command(), record[0] > last
            record = next(records, None)
        if vehicle not in frame.vehicles:
            continue
        episode += has_jump and last < math.inf
        last = time
        limit = recording.scenario_at(time).spec.get("command_timeout", math.inf)
        obeyed = command if time - since < limit - 1e-9 else Command()
        action = np.clip(np.array([obeyed.throttle, obeyed.steering], np.float32), -1.0, 1.0)
        images = frame.vehicles[vehicle].cameras
        assert isinstance(images, LazyImages)
        yield DatasetStep(time, episode, _state(frame, vehicle), action, images)


def checked(all_steps: list[DatasetStep]) -> list[DatasetStep]:
    """Raises `RecordingError` if a dataset needs more steps."""
    if len(all_steps) < 2:
        raise RecordingError(f"the dataset would have {len(all_steps)} steps; record a longer drive")
    return all_steps


def _state(frame: Frame, vehicle: str) -> NDArray[np.float32]:
    vehicle_frame = frame.vehicles[vehicle]
    return np.array(
        [
            *vehicle_frame.ips.position[:2],
            vehicle_frame.imu.euler[2],
            vehicle_frame.speed,
            vehicle_frame.imu.angular_velocity[2],
            *vehicle_frame.imu.linear_acceleration[:2],
            vehicle_frame.throttle,
            vehicle_frame.steering,
        ],
        np.float32,
    )
