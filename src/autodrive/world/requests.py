"""What a World does for each request; `World.apply` is the door."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from autodrive.base.errors import CommandError
from autodrive.protocol.commands import check_flag, check_seed, check_weather
from autodrive.protocol.drawing import drawn_after
from autodrive.protocol.messages import (
    Draw,
    Event,
    Hold,
    RaceStatus,
    Reset,
    Retire,
    SetDrivingMode,
    SetSceneLight,
    SetTimeOfDay,
    SetTrafficLight,
    SetWeather,
    Teleport,
)
from autodrive.protocol.native import Drawn
from autodrive.scenario.maps.map import Map
from autodrive.world.compile import CompiledScenario
from autodrive.world.conditions import WorldConditions
from autodrive.world.controls import Controls
from autodrive.world.observer import Request, ResetTo, SetPoses, hold, plain
from autodrive.world.poses import Poses
from autodrive.world.racing import Move, Race
from autodrive.world.row import Row
from autodrive.world.rules import lights
from autodrive.world.rules.daylight import SceneLight


class RequestTarget(Protocol):
    """What requests read and change of a World; see `autodrive.world.World`."""

    map: Map
    compiled: CompiledScenario
    vehicle_names: list[str]
    race: Race | None
    seed: int
    drawings: dict[str, Drawn]
    controls: Controls
    conditions: WorldConditions
    poses: Poses
    row: Row

    @property
    def time(self) -> float:
        """Simulated time since the reset [s]."""
        ...

    def begin(self, seed: int, start: ResetTo) -> None:
        """Start again with that seed, and as `start` says otherwise; see `World.reset`."""

    def set_back(self, moves: Sequence[Move]) -> bool:
        """Place vehicles where the rules of the race want them; whether one was placed."""
        ...

    def note_moved(self, i: int) -> None:
        """Vehicle i was placed by hand."""


class AppliedRequest(NamedTuple):
    """A request that a World has executed, and what follows from it."""

    request: Request
    """The request as the observers are told it, with values that can be recorded."""
    events: tuple[Event, ...] = ()
    is_moved: bool = False
    """Whether images of the cameras are outdated."""
    has_frame: bool = True
    """Whether a Frame follows."""


def _reset(world: RequestTarget, request: Reset | ResetTo) -> AppliedRequest:
    start = ResetTo(request.seed) if isinstance(request, Reset) else request
    if start.seed is not None:
        check_seed(start.seed)
    if start.weather is not None:
        check_weather(start.weather)
    world.begin(world.seed if start.seed is None else int(start.seed), start)
    if not (start.poses or start.weather or start.motions or start.past_commands):
        return AppliedRequest(Reset(start.seed))
    past = {name: tuple(tuple(map(float, row)) for row in rows) for name, rows in (start.past_commands or {}).items()}
    return AppliedRequest(
        ResetTo(start.seed, plain(start.poses or {}), start.weather, plain(start.motions or {}) or None, past or None)
    )


def _teleport(world: RequestTarget, request: Teleport) -> AppliedRequest:
    name, x, y, yaw = request.vehicle, request.x, request.y, request.yaw
    _place(world, {name: world.poses.on_ground(name, x, y, yaw)})
    return AppliedRequest(Teleport(name, float(x), float(y), float(yaw)), is_moved=True)


def _set_poses(world: RequestTarget, request: SetPoses) -> AppliedRequest:
    _place(world, request.poses)
    return AppliedRequest(SetPoses(plain(request.poses)), is_moved=True)


def _place(world: RequestTarget, poses: Mapping[str, Any]) -> None:
    world.poses.place(poses)
    for i, name in enumerate(world.vehicle_names):
        if name in poses:
            world.note_moved(i)


def _hold(world: RequestTarget, request: Hold) -> AppliedRequest:
    world.poses.hold(request.vehicle, request.position, request.orientation)
    return AppliedRequest(hold(request.vehicle, request.position, request.orientation), has_frame=False)


def _set_driving_mode(world: RequestTarget, request: SetDrivingMode) -> AppliedRequest:
    vehicle, is_autonomous = request.vehicle, request.is_autonomous
    check_flag(is_autonomous, f"the driving mode of vehicle '{vehicle}'")
    number = world.controls.index(vehicle)
    world.controls.check_obeys(vehicle)
    world.controls.vehicles[number].is_autonomous = bool(is_autonomous)
    return AppliedRequest(SetDrivingMode(vehicle, bool(is_autonomous)))


def _retire(world: RequestTarget, request: Retire) -> AppliedRequest | None:
    vehicle, reason, race = request.vehicle, request.reason, world.race
    i = world.controls.index(vehicle)
    if race is None:
        raise CommandError(f"vehicle '{vehicle}' cannot retire: the scenario has no race")
    check_flag(request.is_disqualified, f"is_disqualified of vehicle '{vehicle}'")
    if not isinstance(reason, str):
        raise CommandError(f"the reason to retire vehicle '{vehicle}' must be a text, not {reprlib.repr(reason)}")
    if race.status(i) not in (RaceStatus.WAITING, RaceStatus.RACING):
        return None
    status = RaceStatus.DISQUALIFIED if request.is_disqualified else RaceStatus.RETIRED
    event, moves = race.end(i, status, reason, world.time, world.compiled.state.vehicle_position)
    return AppliedRequest(request, (event,), is_moved=world.set_back(moves))


def _set_scene_light(world: RequestTarget, request: SetSceneLight) -> AppliedRequest:
    check_flag(request.enabled, "the scene light")
    return _set_light(world, SceneLight(bool(request.enabled)), SetSceneLight(bool(request.enabled)))


def _set_time_of_day(world: RequestTarget, request: SetTimeOfDay) -> AppliedRequest:
    light = world.conditions.light.following(request.time, request.scale, world.time)
    return _set_light(world, light, request)


def _set_light(world: RequestTarget, light: SceneLight, request: Request) -> AppliedRequest:
    before = world.conditions.light.at(world.time)
    world.conditions.set_light(light)
    world.row.show_lights()
    return AppliedRequest(request, is_moved=before != light.at(world.time))


def _set_weather(world: RequestTarget, request: SetWeather) -> AppliedRequest:
    conditions, weather = world.conditions, request.weather
    check_weather(weather)
    if request.keeps_ground:
        weather = conditions.with_kept_ground(weather)
    before = conditions.shown
    conditions.set_weather(weather, world.row.tick, world.seed)
    return AppliedRequest(SetWeather(weather), is_moved=before != conditions.shown)


def _set_traffic_light(world: RequestTarget, request: SetTrafficLight) -> AppliedRequest:
    light, columns = request.light, world.row.rules.lights
    state = lights.set_light(world.map.traffic_lights, columns, light, request.state)
    world.row.show_lights()
    return AppliedRequest(SetTrafficLight(light, state), is_moved=True)


def _draw(world: RequestTarget, request: Draw) -> AppliedRequest:
    world.drawings = drawn_after(world.drawings, request, world.time)
    return AppliedRequest(request, has_frame=False)


EXECUTE: Mapping[type, Callable[[RequestTarget, Any], AppliedRequest | None]] = {
    Reset: _reset,
    ResetTo: _reset,
    Teleport: _teleport,
    SetPoses: _set_poses,
    Hold: _hold,
    SetDrivingMode: _set_driving_mode,
    Retire: _retire,
    SetSceneLight: _set_scene_light,
    SetTimeOfDay: _set_time_of_day,
    SetWeather: _set_weather,
    SetTrafficLight: _set_traffic_light,
    Draw: _draw,
}
"""A function for each kind of request, which returns None if nothing was to be done.

It raises `CommandError` for wrong values; then nothing has changed.
"""
