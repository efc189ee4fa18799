"""Checks requests to a Simulation before they wait for the next tick, so that the caller gets the error at once."""

from __future__ import annotations

from autodrive.base.errors import CommandError
from autodrive.base.pace import MAX_SPEED, MIN_SPEED
from autodrive.base.suggest import suggest
from autodrive.protocol.commands import MAX_DISTANCE, check_commands, check_operation, check_seed, is_number
from autodrive.protocol.messages import (
    Frame,
    LoadScenario,
    Operation,
    Reset,
    Resume,
    Retire,
    Seek,
    SetDrivingMode,
    SetSpeed,
    Step,
    Teleport,
)
from autodrive.world.controls import drives_itself


def check_request(request: Operation, frame: Frame, *, error: str, can_load: bool) -> None:
    """Raises `CommandError` for a request that cannot be executed.

    `frame`: the latest Frame. `error`: why the physics cannot continue; empty if it can. `can_load`: whether scenarios
    can be loaded.
    """
    check_operation(request)
    match request:
        case Resume() if error:
            raise CommandError(f"{error}; request Reset first")
        case Reset(seed=seed) if seed is not None:
            check_seed(seed)
        case SetSpeed(factor=factor):
            check_speed(factor)
        case Seek():
            raise CommandError(
                "a simulation shows only the present time: a Seek needs a replay, 'autodrive replay FILE'"
            )
        case Step(ticks=ticks, commands=commands):
            if ticks < 1:
                raise CommandError(f"a Step runs 1 tick or more, not {ticks}")
            for vehicle in commands:
                check_driven(vehicle, frame)
            check_commands(commands)
        case LoadScenario() if not can_load:
            raise CommandError("this Simulation was made for one World and loads no other scenario")
        case SetDrivingMode(vehicle=vehicle) | Retire(vehicle=vehicle):
            check_driven(vehicle, frame)
        case Teleport(vehicle=vehicle, x=x, y=y, yaw=yaw):
            if vehicle not in frame.objects:
                check_vehicle(vehicle, frame)
            if not all(abs(value) <= MAX_DISTANCE for value in (x, y, yaw)):
                raise CommandError(
                    f"a Teleport needs x, y [m] and yaw [rad] from {-MAX_DISTANCE:g} to {MAX_DISTANCE:g}, "
                    f"not {x}, {y}, {yaw}"
                )


def check_vehicle(vehicle: str, frame: Frame) -> None:
    """Raises `CommandError` if there is no vehicle of that name."""
    if not isinstance(vehicle, str) or vehicle not in frame.vehicles:
        raise CommandError(f"vehicle '{vehicle}' is not known. {suggest(str(vehicle), list(frame.vehicles))}")


def check_driven(vehicle: str, frame: Frame) -> None:
    """Raises `CommandError` if there is no vehicle of that name that obeys commands."""
    check_vehicle(vehicle, frame)
    if frame.vehicles[vehicle].is_traffic:
        raise drives_itself(vehicle, [name for name, other in frame.vehicles.items() if not other.is_traffic])


def check_world(world: object, user: str) -> None:
    """Raises `CommandError` for what is no World, such as the name of a scenario."""
    if not hasattr(world, "frame"):
        raise CommandError(f"a {user} needs a World, such as autodrive.make('plane'), not {world!r}")


def check_speed(speed: float | None) -> None:
    """Raises `CommandError` unless it is a number of simulated seconds per wall second, or None."""
    if speed is not None and not (is_number(speed) and MIN_SPEED <= speed <= MAX_SPEED):
        raise CommandError(
            f"speed must be a number from {MIN_SPEED:g} to {MAX_SPEED:g}, or None for as fast as possible, not {speed}"
        )
