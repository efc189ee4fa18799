"""The world: `World.step(commands)` moves the State by one tick and returns a Frame."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from autodrive.actuators.lights import lit_lamps
from autodrive.compile import Compiled, compile_scenario
from autodrive.descriptions import suggest
from autodrive.errors import CommandError, EngineError
from autodrive.jit import resolved
from autodrive.physics.tick import advance, observe
from autodrive.protocol.messages import (
    Command,
    Event,
    Frame,
    Headlights,
    Indicators,
    ObjectFrame,
    Pose,
    VehicleFrame,
    WheelsReading,
)
from autodrive.referee import Referee
from autodrive.scenario import ScenarioSpec, load_scenario
from autodrive.sensors import feedback
from autodrive.state import Floats, State
from autodrive.transforms import quaternion_from_yaw
from autodrive.units import RPM
from autodrive.vehicles.mjcf import WHEEL_NAMES

if TYPE_CHECKING:
    from autodrive.cameras import Eyes

NO_COMMAND = Command()

REVERSE_SPEED = -0.05 * RPM
"""Rear wheels slower than this are in reverse [rad/s]."""


def make(
    scenario: str | Path | ScenarioSpec = "plane",
    seed: int | None = None,
    *,
    cameras: bool | str | Callable[[Compiled], Eyes] = False,
) -> World:
    """A World of that scenario (name, file or Spec), at its initial state. Raises `SpecError`.

    `cameras`: True draws each camera's picture in the tick that it is due in, of exactly that state, and so does the
    name of a quality (`autodrive.render.quality.NAMES`); raises `GlUnavailable` where that cannot be. False leaves the
    cameras out, which costs nothing. Or a function that makes other eyes, such as `camera_process.CameraProcess.of`.
    """
    spec = scenario if isinstance(scenario, ScenarioSpec) else load_scenario(scenario)
    if seed is not None:
        spec = spec.model_copy(update={"seed": seed})
    compiled = compile_scenario(spec)
    return World(compiled, _eyes(compiled, cameras))


class World:
    """Vehicles, a map and movable things in simulated time. Same scenario, seed and commands: same bits."""

    def __init__(self, compiled: Compiled, eyes: Eyes | None = None) -> None:
        self._compiled = compiled
        self._eyes = eyes
        self.spec = compiled.spec
        self.map = compiled.map
        self.vehicle_specs = compiled.vehicles
        self.vehicle_names = list(compiled.vehicles)
        self.boxes = dict(zip(compiled.objects, compiled.boxes, strict=True))
        """The movable objects of a Frame, as they were placed."""
        self.tick_duration = compiled.spec.tick
        self._seed = compiled.spec.seed
        self._substeps = compiled.spec.substeps
        self._tick_length = Fraction(str(compiled.spec.tick))
        self._timeout = math.floor(Fraction(str(compiled.spec.command_timeout)) / self._tick_length)  # in ticks
        self._referee = Referee(
            self.vehicle_names, compiled.owners, compiled.map.drivable_edges, 1.0 / compiled.spec.tick
        )
        self._throttle = np.zeros(len(self.vehicle_names))
        self._steering = np.zeros(len(self.vehicle_names))
        c = compiled
        self._advance = resolved(
            advance, c.model, c.state, c.views, c.touches, c.scratch, self._throttle, self._steering, 0, 0
        )
        self.reset()

    # -- the tick ------------------------------------------------------------------------------------------------

    def step(self, commands: Mapping[str, Command] | None = None) -> Frame:
        """One tick with these commands; a vehicle without one keeps its last until that is too old.

        Raises `CommandError` for an unknown vehicle or a value that is not finite; nothing has moved then. Raises
        `EngineError` where the physics cannot go on; `reset` or `restore` brings the world back.
        """
        if commands:
            self._accept(commands)
        self._expire_commands()
        c = self._compiled
        is_sound = self._advance(
            c.model,
            c.state,
            c.views,
            c.touches,
            c.scratch,
            self._throttle,
            self._steering,
            self._tick * self._substeps,
            self._substeps,
        )
        self._tick += 1
        if not is_sound:
            raise EngineError(
                f"the physics became unstable at {self.time:.3f} s; reset the world, and use a shorter substep or "
                "a vehicle with softer springs"
            )
        events = self._referee.judge(self._tick, self.time, c.model, c.state, c.touches)
        self._sample()
        return self._show(events)

    def reset(self, seed: int | None = None) -> Frame:
        """The initial state; a new seed stays until the next one."""
        if seed is not None:
            self._seed = seed
        c = self._compiled
        c.engine.reset()
        c.engine.update()
        for column in c.state:
            column[:] = 0.0
        c.touches.impulse[:] = 0.0
        c.touches.pair_count[0] = 0
        self._tick = 0
        self._drivers = {name: _Driver(NO_COMMAND, -math.inf) for name in self.vehicle_names}
        self._headlights = dict.fromkeys(self.vehicle_names, Headlights.OFF)
        self._indicators = dict.fromkeys(self.vehicle_names, Indicators.OFF)
        self._indicators_since = dict.fromkeys(self.vehicle_names, 0)
        self._is_autonomous = {name: placement.is_autonomous for name, placement in self.spec.vehicles.items()}
        self.scene_light = self.spec.scene_light
        self._referee.reset()
        observe(c.model, c.state, c.views)
        for sensors in c.sensors.values():
            sensors.reset(self._seed)
        if self._eyes is not None:
            self._eyes.reset(self._seed)
        self._sample()
        return self._show()

    @property
    def time(self) -> float:
        """Simulated time since reset [s]."""
        return self._tick * self._tick_length.numerator / self._tick_length.denominator

    # -- what else can be done to it -----------------------------------------------------------------------------

    def teleport(self, vehicle: str, x: float, y: float, yaw: float = 0.0) -> None:
        """Puts a vehicle, at rest, on the ground at x, y [m] with heading yaw [rad]. Its encoders keep their count.

        Raises `CommandError`, and leaves it where it is, if it would stand in something there.
        """
        i = self._index(vehicle)
        if not all(math.isfinite(value) for value in (x, y, yaw)):
            raise CommandError(f"vehicle '{vehicle}' cannot be put at x={x}, y={y}, yaw={yaw}: these are not numbers")
        c = self._compiled
        row = c.model.vehicles[i]
        qpos, dof = int(row["qpos"]), int(row["dof"])
        before = c.views.qpos[qpos : qpos + 7].copy()
        c.views.qpos[qpos : qpos + 7] = (x, y, self.vehicle_specs[vehicle].ride_height, *quaternion_from_yaw(yaw))
        c.engine.update()
        if others := _in_the_way(c, vehicle):
            c.views.qpos[qpos : qpos + 7] = before
            c.engine.update()
            raise CommandError(f"vehicle '{vehicle}' cannot be put at x={x}, y={y}: it would stand in {others}")
        c.views.qvel[dof : dof + 6] = 0.0
        for column in (c.state.wheel_angular_velocity, c.state.wheel_force, c.state.wheel_hold):
            column[4 * i : 4 * i + 4] = 0.0
        c.engine.update()
        observe(c.model, c.state, c.views)
        self._show(is_moved=True)

    @property
    def is_looking(self) -> bool:
        """Whether pictures of the Frame at hand are still to come, which `look` will bring; in real time only."""
        return self._eyes is not None and self._eyes.is_awaited

    @property
    def belongs_to_thread(self) -> bool:
        """Whether only the thread that has stepped it may step it again: what draws in the tick is bound to one."""
        return self._eyes is not None and self._eyes.belongs_to_thread

    def look(self) -> Frame:
        """The Frame at hand with the pictures that have come meanwhile; a new one, without events, if some have."""
        if self._eyes is not None:
            seen = self._eyes.see(self.frame)
            self.frame = seen if seen is self.frame else replace(seen, events=())
        return self.frame

    def set_driving_mode(self, vehicle: str, is_autonomous: bool) -> None:
        """Who drives from now on: a script or a person. The World obeys whoever calls `step`."""
        self._index(vehicle)
        self._is_autonomous[vehicle] = is_autonomous
        self._show()

    def set_scene_light(self, enabled: bool) -> None:
        """Day (True) or night (False)."""
        is_switched = enabled != self.scene_light
        self.scene_light = enabled
        self._show(is_moved=is_switched)

    def save(self) -> Snapshot:
        """All that the future depends on."""
        c = self._compiled
        return Snapshot(
            tick=self._tick,
            seed=self._seed,
            engine=c.engine.save(),
            state=State(*(column.copy() for column in c.state)),
            referee=self._referee.save(),
            sensors={name: sensors.save() for name, sensors in c.sensors.items()},
            eyes=self._eyes and self._eyes.save(),
            driving=copy.deepcopy([getattr(self, name) for name in _DRIVING]),
            frame=self.frame,
        )

    def restore(self, saved: Snapshot) -> Frame:
        """Back to the moment of `save`: the same future, bit for bit."""
        c = self._compiled
        self._tick, self._seed, self.frame = saved.tick, saved.seed, saved.frame
        c.engine.restore(saved.engine)
        c.touches.impulse[:] = 0.0
        c.touches.pair_count[0] = 0
        for column, kept in zip(c.state, saved.state, strict=True):
            column[:] = kept
        self._referee.restore(saved.referee)
        for name, sensors in c.sensors.items():
            sensors.restore(saved.sensors[name])
        if self._eyes is not None:
            self._eyes.restore(saved.eyes)
        for name, value in zip(_DRIVING, copy.deepcopy(saved.driving), strict=True):
            setattr(self, name, value)
        return self.frame

    def close(self) -> None:
        """Give back what draws the cameras' pictures; a world without cameras holds nothing."""
        if self._eyes is not None:
            self._eyes.close()

    def vehicle(self, name: str) -> VehicleView:
        """A read-only look at one vehicle's state, for prompts and tests."""
        return VehicleView(self._compiled.state, self._index(name))

    # -- the parts of a tick -------------------------------------------------------------------------------------

    def _index(self, vehicle: str) -> int:
        if vehicle not in self._compiled.vehicles:
            raise CommandError(f"vehicle '{vehicle}' is not in this world. {suggest(vehicle, self.vehicle_names)}")
        return self.vehicle_names.index(vehicle)

    def _accept(self, commands: Mapping[str, Command]) -> None:
        for name, command in commands.items():
            self._index(name)
            _check(name, command)
        for name, command in commands.items():
            self._drivers[name] = _Driver(command, self._tick)
            if command.headlights is not None:
                self._headlights[name] = Headlights(command.headlights)
            if command.indicators is not None and command.indicators != self._indicators[name]:
                if self._indicators[name] == Indicators.OFF:
                    self._indicators_since[name] = self._tick
                self._indicators[name] = Indicators(command.indicators)

    def _expire_commands(self) -> None:
        for i, driver in enumerate(self._drivers.values()):
            command = driver.command if self._tick - driver.since <= self._timeout else NO_COMMAND
            self._throttle[i] = min(1.0, max(-1.0, command.throttle))
            self._steering[i] = min(1.0, max(-1.0, command.steering))

    def _sample(self) -> None:
        c = self._compiled
        for sensors in c.sensors.values():
            sensors.sample(c.model.shapes, c.state, self._tick * self._substeps)

    def _show(self, events: tuple[Event, ...] = (), *, is_moved: bool = False) -> Frame:
        """The state as a Frame, with what the cameras see; `is_moved`: by hand, so that they must look anew."""
        frame = self._frame(events)
        self.frame = frame if self._eyes is None else self._eyes.see(frame, anew=is_moved)
        return self.frame

    def _frame(self, events: tuple[Event, ...]) -> Frame:
        c = self._compiled
        return Frame(
            time=self.time,
            tick=self._tick,
            vehicles={name: self._vehicle_frame(i, name) for i, name in enumerate(self.vehicle_names)},
            objects={name: ObjectFrame(_pose(c.views.qpos, start)) for name, start in c.objects.items()},
            events=events,
            scene_light=self.scene_light,
        )

    def _vehicle_frame(self, i: int, name: str) -> VehicleFrame:
        state = self._compiled.state
        sensors = self._compiled.sensors[name]
        wheels = slice(4 * i, 4 * i + 4)
        rear = state.wheel_angular_velocity[4 * i + 2] + state.wheel_angular_velocity[4 * i + 3]
        phase = (
            (self._tick - self._indicators_since[name]) * self.spec.tick / self.vehicle_specs[name].lights.blink_period
        )
        return VehicleFrame(
            pose=Pose(_frozen(state.vehicle_position[i]), _frozen(state.vehicle_orientation[i])),
            velocity=_frozen(state.vehicle_velocity[i]),
            angular_velocity=_frozen(state.vehicle_angular_velocity[i]),
            throttle=feedback.throttle(state, i),
            steering=feedback.steering(state, i),
            encoders=sensors.encoders.reading,
            ips=sensors.ips.reading,
            imu=sensors.imu.reading,
            lidar=sensors.lidar and sensors.lidar.latest,
            lights=lit_lamps(
                self._headlights[name],
                self._indicators[name],
                phase % 1.0,
                is_braking=state.throttle[i] == 0.0,
                is_reversing=bool(state.throttle[i] < 0.0 or 0.5 * rear < REVERSE_SPEED),
            ),
            wheels=WheelsReading(
                steering_angle=_frozen(state.wheel_steering_angle[wheels]),
                rotation_angle=_frozen(state.wheel_rotation[wheels]),
                angular_velocity=_frozen(state.wheel_angular_velocity[wheels]),
                compression=_frozen(state.wheel_compression[wheels]),
                normal_load=_frozen(state.wheel_normal_load[wheels]),
                slip_ratio=_frozen(state.wheel_slip_ratio[wheels]),
                slip_angle=_frozen(state.wheel_slip_angle[wheels]),
            ),
            is_autonomous=self._is_autonomous[name],
            collision_count=self._referee.collision_counts[i],
        )


def _eyes(compiled: Compiled, cameras: bool | str | Callable[[Compiled], Eyes]) -> Eyes | None:
    if cameras is False or not any(compiled.cameras.values()):
        return None
    if callable(cameras):
        return cameras(compiled)
    from autodrive.cameras import Cameras, sight_of

    return Cameras(sight_of(compiled, "auto" if cameras is True else cameras))


def _check(vehicle: str, command: Command) -> None:
    """Raises `CommandError` where a vehicle cannot obey."""
    if not (_is_number(command.throttle) and _is_number(command.steering)):
        raise CommandError(
            f"vehicle '{vehicle}': throttle {command.throttle} and steering {command.steering} must be numbers, "
            "best in [-1, 1]"
        )
    for name, kind, value in (
        ("headlights", Headlights, command.headlights),
        ("indicators", Indicators, command.indicators),
    ):
        if value is not None and value not in list(kind):
            known = ", ".join(f"{one.value} {one.name}" for one in kind)
            raise CommandError(f"vehicle '{vehicle}': {name} {value} are not known. Known: {known}, or None")


def _is_number(value: object) -> bool:
    return isinstance(value, float | int | np.number) and math.isfinite(value)


class _Driver(NamedTuple):
    """A vehicle's latest command and the tick that it was given at."""

    command: Command
    since: float


_DRIVING = ("_drivers", "_headlights", "_indicators", "_indicators_since", "_is_autonomous", "scene_light")
"""What of a World is neither State nor sensor and yet decides the future."""


class Snapshot(NamedTuple):
    """A moment of a World, to go back to."""

    tick: int
    seed: int
    engine: Any
    state: State
    referee: Any
    sensors: dict[str, Any]
    eyes: Any
    driving: list[Any]
    frame: Frame


class VehicleView:
    """Reads a vehicle's columns of the State by name: `view.steering_angle`, `view.wheel("front_left").slip_ratio`."""

    def __init__(self, state: State, index: int) -> None:
        self._state = state
        self._index = index

    def __getattr__(self, name: str) -> Any:
        column = getattr(self._state, f"vehicle_{name}", None)
        if column is None:
            column = getattr(self._state, name)
        return _plain(column[self._index])

    def wheel(self, name: str) -> WheelView:
        """One of front_left, front_right, rear_left, rear_right."""
        return WheelView(self._state, 4 * self._index + WHEEL_NAMES.index(name))


class WheelView:
    """Reads a wheel's columns of the State by name, without their prefix `wheel_`."""

    def __init__(self, state: State, index: int) -> None:
        self._state = state
        self._index = index

    def __getattr__(self, name: str) -> Any:
        return _plain(getattr(self._state, f"wheel_{name}")[self._index])


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else value.copy()


def _in_the_way(c: Compiled, vehicle: str) -> str:
    """Names of the things that the vehicle is in now."""
    pairs = [{c.owners[a], c.owners[b]} for a, b in c.engine.overlapping()]
    return ", ".join(sorted({f"'{name}'" for pair in pairs if vehicle in pair for name in pair - {vehicle}}))


def _pose(qpos: Floats, start: int) -> Pose:
    return Pose(_frozen(qpos[start : start + 3]), _frozen(qpos[start + 3 : start + 7]))


def _frozen(values: Floats) -> Floats:
    """A copy that nobody can change."""
    kept = values.copy()
    kept.setflags(write=False)
    return kept
