"""Observers: told what a World is given and what it does, for example to record it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol, TypeAlias

import msgspec

from autodrive.base.transforms import Quaternion, Vector
from autodrive.protocol.messages import Command, Frame, Hold, Operation, Weather


class SetPoses(msgspec.Struct, frozen=True, tag="Poses"):
    """`World.set_poses`: position [m] and quaternion (wxyz) of each name."""

    poses: dict[str, tuple[float, ...]]


class ResetTo(msgspec.Struct, frozen=True, tag=True):
    """`World.reset` with poses, x, y [m] and yaw [rad] of each name, a weather, motions or past commands."""

    seed: int | None
    poses: Mapping[str, tuple[float, ...]] | None = None
    weather: Weather | None = None
    motions: Mapping[str, tuple[float, ...]] | None = None
    past_commands: Mapping[str, tuple[tuple[float, ...], ...]] | None = None


class Restored(msgspec.Struct, frozen=True, tag=True):
    """`World.restore` and `World.continue_from`: the World was set to a state that no request describes."""


class SensorAdded(msgspec.Struct, frozen=True, tag=True):
    """`World.add_sensor`: the sensor samples from now on."""

    vehicle: str
    name: str


Request: TypeAlias = Operation | SetPoses | ResetTo | SensorAdded | Restored
"""A change of a World between two ticks."""


class Observer(Protocol):
    """Is called in the thread that uses the World; must not change it."""

    def given(self, commands: Mapping[str, Command]) -> None:
        """The World runs a tick with these commands; its Frame follows."""

    def executed(self, request: Request) -> None:
        """A request was executed; its Frame follows, if it made one."""

    def publish(self, frame: Frame) -> None:
        """A new Frame."""


def plain(poses: Mapping[str, Iterable[float]]) -> dict[str, tuple[float, ...]]:
    """The numbers of poses by name."""
    return {name: tuple(map(float, pose)) for name, pose in poses.items()}


def hold(vehicle: str, position: Vector | None, orientation: Quaternion) -> Hold:
    """The request of `World.hold`, whose arguments may be arrays."""
    if position is None:
        return Hold(vehicle, None)  # without a pose, the orientation means nothing
    w, x, y, z = map(float, orientation)
    return Hold(vehicle, (float(position[0]), float(position[1]), float(position[2])), (w, x, y, z))
