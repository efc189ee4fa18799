"""The world: `World.step(commands)` moves the State by one tick and returns a Frame."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import reprlib
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from msgspec.structs import replace

from autodrive.base.arrays import Floats
from autodrive.base.compile_ahead import compile_ahead
from autodrive.base.errors import CommandError, EngineError
from autodrive.base.jit import resolved
from autodrive.base.pinned import Pinned
from autodrive.base.transforms import (
    Quaternion,
    Vector,
    euler_from_quaternion,
    quaternion_from_yaw,
    yaw_from_quaternion,
)
from autodrive.physics.sensors.own import OwnSensor, problem
from autodrive.physics.state import BODY_COLUMNS, State, VehicleView, numbers
from autodrive.physics.tick import place
from autodrive.physics.weather import ChangingWeather
from autodrive.protocol.commands import MAX_DISTANCE, check_flag, check_seed, check_weather, is_number
from autodrive.protocol.drawing import DrawCalls, drawn_after
from autodrive.protocol.messages import (
    Command,
    Draw,
    Event,
    Frame,
    RaceStatus,
    Reset,
    Retire,
    SetDrivingMode,
    SetSceneLight,
    SetTimeOfDay,
    SetTrafficLight,
    SetWeather,
    TrafficLightState,
    Weather,
)
from autodrive.protocol.native import ContactForces, Drawn
from autodrive.protocol.weather import is_clear
from autodrive.scenario import FACTOR_LIMITS
from autodrive.world.columns import Rows, restore_row, rows_of_world, saved_row, without_tables
from autodrive.world.compile import CompiledScenario
from autodrive.world.conditions import set_factors, set_weather, weather_effects, wheels_in
from autodrive.world.contacts import contact_forces
from autodrive.world.controls import Controls
from autodrive.world.frames import FrameBuilder
from autodrive.world.observer import Observer, Request, ResetTo, Restored, SensorAdded, SetPoses, hold, plain
from autodrive.world.one_thread import OneThread, by_one_thread
from autodrive.world.poses import Poses
from autodrive.world.racing import Move
from autodrive.world.rules import daylight, lights, radio, rules, stop_lines
from autodrive.world.rules.daylight import SceneLight
from autodrive.world.rules.traffic.rule import switch_lamps
from autodrive.world.snapshot import Snapshot, check_snapshot, identity
from autodrive.world.tick import drive_traffic, judge, move, sense, show_lights

if TYPE_CHECKING:
    from autodrive.graphics.cameras.backend import CameraBackend


WEATHER_PERIOD = 0.1
"""Tyres and LIDARs follow a ground that becomes wet or dry in steps of this time [s]."""
DRAWING_WIDTH = 400.0
"""Width of the map in a notebook [pixels]."""


class World(OneThread):
    """Vehicles, a map and movable objects in simulated time. Same scenario, seed and commands: same bits.

    Several threads may use it in turn. While one is inside a method, a call of another thread raises
    `WorldInUseError` at once and changes nothing.
    """

    def __init__(
        self,
        compiled: CompiledScenario,
        cameras: CameraBackend | None = None,
        *,
        engine: Literal["auto", "always"] = "auto",
    ) -> None:
        """`engine`: see `autodrive.make`."""
        super().__init__()
        if engine not in ("auto", "always"):
            raise CommandError(f"engine must be 'auto' or 'always', not {engine!r}")
        self.observers: list[Observer] = []
        """Told each command, change and Frame of this World, as long as they are in the list."""
        self.draw = DrawCalls(self.show_drawings)
        """Draws points, lines and texts into the view."""
        self.drawings: dict[str, Drawn] = {}
        """By name; each change makes another dictionary. They belong neither to the State nor to a Snapshot."""
        self.contact_forces: dict[str, ContactForces] = {}
        """What pushed each vehicle in the last tick, while `watch_contacts` is on."""
        self.watches_contacts = False
        """See `watch_contacts`."""
        self.compiled = compiled
        """Model, State and engine; what changes them changes the results."""
        self._cameras = cameras
        self.specs = compiled.specs
        """Of the scenario and of its files."""
        self.spec = compiled.spec
        """The scenario from which `reset` starts."""
        self.map = compiled.map
        self.vehicle_specs = compiled.vehicles
        self.sensors = compiled.configured
        """Sensors and cameras, also those that are off, by vehicle and name."""
        self.vehicle_names = list(compiled.vehicles)
        self.boxes = dict(zip(compiled.objects, compiled.boxes, strict=True))
        """The movable objects of a Frame, as they were placed."""
        self.warnings = compiled.warnings
        """Probable mistakes in the scenario, as parts of their texts; see `autodrive.base.specs.joined`."""
        self.tick_duration = compiled.spec.tick
        self._seed = compiled.spec.seed
        self._weather, self._weather_now = ChangingWeather(), None
        self._weather_ticks = max(1, round(WEATHER_PERIOD / compiled.spec.tick))
        self._follows_weather = False
        """Whether wetness or snow cover of the ground are changing."""
        self._start: Floats = compiled.engine.start
        """`State.qpos` after a reset."""
        self._substeps = compiled.spec.substeps
        tick = Fraction(str(compiled.spec.tick))
        self._tick_ratio = tick.numerator, tick.denominator
        self._controls = Controls(
            {name: placement.is_autonomous for name, placement in compiled.spec.vehicles.items()},
            traffic=compiled.spec.traffic.names,
            timeout=math.floor(Fraction(str(compiled.spec.command_timeout)) / tick),
        )
        self.race = compiled.race
        """The race of the scenario; None if it has none."""
        self._frames = FrameBuilder(compiled)
        self._poses = Poses(compiled, self._controls)
        self.rows = rows_of_world(compiled, self._controls.throttle, self._controls.steering, engine)
        """All numbers of the tick; what changes them changes the results."""
        self._pinned = Pinned(self.rows)
        self._row = self.rows.worlds.rules
        compile_ahead(sense, self._pinned, 0)  # beside `move`, which takes as long to compile
        self._move, self._judge = resolved(move, self._pinned, 0), resolved(judge, self._pinned, 0)
        self._sense = resolved(sense, self._pinned, 0)
        self._drive_traffic = resolved(drive_traffic, self._pinned, 0) if compiled.fleet.names else None
        self._show_lights = resolved(show_lights, self._pinned, 0) if compiled.map.traffic_lights else None
        self.reset()

    def __repr__(self) -> str:
        cameras = "no cameras" if self._cameras is None else "with cameras"
        return (
            f"<World of map '{self.spec.map_name}' at {self.time:g} s: vehicles {', '.join(self.vehicle_names)}; "
            f"{len(self.boxes)} objects; {cameras}>"
        )

    def _repr_html_(self) -> str:
        """For a notebook: the map from above with vehicles and objects where they are now, and the Frame."""
        from autodrive.scenario.maps.draw import to_svg  # noqa: PLC0415  its libraries are needed only here

        poses = self.frame.objects
        boxes = (
            dataclasses.replace(
                box,
                position=tuple(poses[name].pose.position.tolist()),
                yaw=yaw_from_quaternion(poses[name].pose.orientation),
            )
            for name, box in self.boxes.items()
        )
        x0, _, x1, _ = self.map.bounds
        drawing = to_svg(
            dataclasses.replace(self.map, boxes=tuple(boxes)),
            pixels_per_metre=DRAWING_WIDTH / (x1 - x0),
            starts=[
                (*one.pose.position.tolist()[:2], yaw_from_quaternion(one.pose.orientation))
                for one in self.frame.vehicles.values()
            ],
        )
        return drawing + self.frame._repr_html_()

    # -- the tick ------------------------------------------------------------------------------------------------

    @by_one_thread
    def step(self, commands: Mapping[str, Command] | None = None) -> Frame:
        """Run one tick with these commands; a vehicle without a command keeps its last one until its time-out.

        Raises `CommandError` for anything but a dictionary of Commands, an unknown vehicle or a value that is not
        finite; nothing has moved then. Raises `EngineError` if the physics cannot continue, and `SensorError` if a
        sensor of the user fails; after that, call `reset` or `restore`.
        """
        self._check_open()
        c, controls, race = self.compiled, self._controls, self.race
        if commands is not None:
            controls.accept(commands, self._tick)
        controls.update(self._tick)
        if self._drive_traffic is not None:
            self._drive_traffic(self._pinned, 0)
            self._switch_lamps()
        if race is not None:
            race.restrain(self.time, controls.throttle)
        if self._follows_weather and self._tick % self._weather_ticks == 0:
            self._apply_weather()
        is_sound = self._move(self._pinned, 0)
        self._tick += 1
        time = self.time
        if self._poses.held:
            self._poses.apply_held()
        if not is_sound:
            raise EngineError(
                f"the physics became unstable at {time:.3f} s; reset the world, and use a shorter substep or "
                "a vehicle with softer springs"
            )
        if self.watches_contacts:
            self.contact_forces = contact_forces(c, self.tick_duration)
        events: tuple[Event, ...] = ()
        if self._judge(self._pinned, 0):
            events = tuple(rules.events(c, self._row, self.rows.thread.rules, time))
        is_moved = False
        if race is not None:
            news, moves = race.judge(time, c.state.vehicle_position, events)
            events += tuple(news)
            is_moved = bool(moves) and self._set_back(moves)
        self._sample()
        if commands is not None:
            for observer in self.observers:
                observer.given(commands)
        return self._show(events, is_moved=is_moved)

    @by_one_thread
    def reset(
        self,
        seed: int | None = None,
        *,
        poses: Mapping[str, tuple[float, float, float]] | None = None,
        weather: Weather | None = None,
    ) -> Frame:
        """Return to the initial state; a new seed stays until the next one.

        `poses`: x, y [m] and yaw [rad] on the ground at which vehicles and objects start this time, by name. `weather`:
        from this start on, as after a long time of it; None: that of the scenario. Raises `CommandError` for a wrong
        seed or weather, and for a pose that is wrong or overlaps something; then nothing has changed.
        """
        self._check_open()
        c = self.compiled
        if seed is not None:
            check_seed(seed)
        if weather is not None:
            check_weather(weather)
        on_ground = {} if poses is None else self._start_poses(poses)
        if c.fleet.names:
            on_ground = self._traffic_starts(self._seed if seed is None else int(seed), on_ground) | on_ground
        start = self._poses.start(self._start, on_ground) if on_ground else self._start
        if seed is not None:
            self._seed = int(seed)
        c.engine.forget_warnings()
        numbers(c.state)[:] = 0.0
        c.state.qpos[:] = start
        fixed = c.model.shapes.n_fixed
        c.state.shape_position[:fixed] = c.model.shapes.position[:fixed]
        c.state.shape_rotation[:fixed] = c.model.shapes.rotation[:fixed]
        c.contacts.impulse[:] = 0.0
        c.contacts.pair_count[0] = 0
        self._set_tick(0)
        self.drawings, self.contact_forces = {}, {}
        self._controls.reset()
        rules.begin(c, self._row, rules.FIRST, [self._seed])
        self._light = daylight.light_of(self._row.daylight)
        self._switch_lamps()
        self._poses.held = {}
        place(c.model, c.state, c.views)
        if self.race is not None:
            self.race.reset(self._ground_poses(), c.state.vehicle_position)
        c.sensors.reset(self._seed)
        self._weather = ChangingWeather.settled(self.spec.weather.message if weather is None else weather)
        self._apply_weather(is_reset=True)
        c.own_sensors.reset(self._seed)
        if self._cameras is not None:
            self._cameras.reset(self._seed)
        self._heard = radio.readings(c, self._row.radio)
        self._show_lights_now()
        self._sample()
        self._tell(lambda: ResetTo(seed, plain(poses or {}), weather) if poses or weather else Reset(seed))
        return self._show()

    @property
    def time(self) -> float:
        """Simulated time since the reset [s]."""
        numerator, denominator = self._tick_ratio
        return self._tick * numerator / denominator

    @property
    def seed(self) -> int:
        """Seed of all noise since the last reset."""
        return self._seed

    # -- changes between ticks -----------------------------------------------------------------------------------

    @by_one_thread
    def teleport(self, name: str, x: float, y: float, yaw: float = 0.0) -> None:
        """Place a vehicle or an object, at rest, on the ground at x, y [m] with heading yaw [rad].

        Encoders keep their counts. Raises `CommandError` if it would overlap something there; then nothing has moved.
        """
        self.set_poses({name: self._on_ground(name, x, y, yaw)})

    def _start_poses(self, poses: Mapping[str, tuple[float, float, float]]) -> dict[str, Floats]:
        """See `reset`. Raises `CommandError`."""
        if not isinstance(poses, Mapping):
            raise CommandError(f"poses must be a dictionary with x, y, yaw for each name, not {reprlib.repr(poses)}")
        for name, pose in poses.items():
            if not isinstance(pose, Sequence | np.ndarray) or isinstance(pose, str) or len(pose) != 3:
                raise CommandError(f"the pose of '{name}' must be x, y [m] and yaw [rad], not {reprlib.repr(pose)}")
        return {name: self._on_ground(name, *pose) for name, pose in poses.items()}

    def _traffic_starts(self, seed: int, placed: Mapping[str, Floats]) -> dict[str, Floats]:
        """Where the traffic starts with that seed, away from other vehicles and objects; `placed`: those elsewhere."""
        fleet = self.compiled.fleet
        others: list[tuple[float, float]] = []
        for name in (*self.vehicle_names, *self.boxes):
            if name not in fleet.names:
                qpos = self.compiled.engine.body(name)[1]
                x, y = placed.get(name, self._start[qpos : qpos + 2])[:2]
                others.append((float(x), float(y)))
        starts = fleet.start_poses(seed, others)
        return {name: self._on_ground(name, *pose) for name, pose in starts.items()}

    def _on_ground(self, name: str, x: float, y: float, yaw: float) -> Floats:
        """The pose of a vehicle or an object on the ground. Raises `CommandError`."""
        self._poses.check_name(name)
        if not all(is_number(value, MAX_DISTANCE) for value in (x, y, yaw)):
            raise CommandError(
                f"{self._poses.noun(name)} cannot be placed at x={x}, y={y}, yaw={yaw}: they must be numbers from "
                f"{-MAX_DISTANCE:g} to {MAX_DISTANCE:g}"
            )
        x, y, yaw = float(x), float(y), float(yaw)
        box = self.boxes.get(name)
        height = 0.5 * box.size[2] if box else self.vehicle_specs[name].ride_height
        return np.array([x, y, height, *quaternion_from_yaw(yaw)])

    @by_one_thread
    def pose(self, name: str) -> Floats:
        """Position [m] and orientation (wxyz) of a vehicle or an object, shape (7,). Raises `CommandError`."""
        return self._poses.get(name)

    @by_one_thread
    def set_poses(self, poses: Mapping[str, Floats]) -> None:
        """Place vehicles and objects, at rest, at these poses (position [m] and quaternion wxyz, shape (7,)).

        Raises `CommandError` for values that are not a pose, and if one of them would overlap something there; then
        nothing has moved.
        """
        self._poses.place(poses)
        for name in self.vehicle_names:
            if name in poses:
                self._note_moved(self._controls.index(name))
        self._tell(lambda: SetPoses(plain(poses)))
        self._show(is_moved=True)

    @by_one_thread
    def start_from(self, compiled: CompiledScenario) -> None:
        """Let `reset` start from that scenario, which may differ from the present one in its poses only."""
        self._start = compiled.engine.start
        self.spec = compiled.spec
        self.boxes = dict(zip(compiled.objects, compiled.boxes, strict=True))
        self.warnings = compiled.warnings

    @by_one_thread
    def set_factors(self, factors: Mapping[str, Mapping[str, float]]) -> None:
        """Let `reset` start with these factors ('mass', 'grip', 'noise') of vehicles, in addition to the scenario's.

        What is left out has the factor 1. The bits are those of a new World of the scenario with these `mass_factor`,
        `grip_factor` and `noise_factor`. Raises `CommandError`.
        """
        for vehicle, given in factors.items():
            self._controls.index(vehicle)
            for name, factor in given.items():
                least, most = FACTOR_LIMITS.get(name, (math.inf, -math.inf))
                if not (is_number(factor) and least <= factor <= most):
                    raise CommandError(f"factor {name} of vehicle '{vehicle}' cannot be {factor!r}")
        self.spec, self.vehicle_specs = set_factors(self.compiled, factors)
        self.__dict__.pop("_identity", None)

    @cached_property
    def _identity(self) -> str:
        """Of the world, for its snapshots."""
        return identity(self.compiled, wheels_in(self.compiled, self.spec, self.vehicle_specs, Weather()))

    @by_one_thread
    def continue_from(self, before: World) -> None:
        """Continue at the time and in the state of another world, which has the same vehicles.

        Objects that both worlds have keep their poses and velocities; other objects are at their start. Sensors with
        other settings start now; all images are rendered again.
        """
        c, b = self.compiled, before.compiled
        for name in (*self.vehicle_names, *self.boxes):
            if name in before.vehicle_names or name in before.boxes:
                _, qpos, dof = c.engine.body(name)
                _, old_qpos, old_dof = b.engine.body(name)
                c.state.qpos[qpos : qpos + 7] = b.state.qpos[old_qpos : old_qpos + 7]
                c.state.qvel[dof : dof + 6] = b.state.qvel[old_dof : old_dof + 6]
        for name, column, old in zip(State._fields, c.state, b.state, strict=True):
            if name not in BODY_COLUMNS and not name.startswith("shape_"):
                column[:] = old
        self._set_tick(before._tick)
        self._seed = before._seed
        self._poses.held = dict(before._poses.held)
        self._weather = before._weather
        self.drawings = before.drawings
        self._controls.restore(before._controls.save())
        rules.take_over(c, self._row, b, before._row, self._seed)
        self._light = before._light
        if self.race is not None and before.race is not None and self.race.identity == before.race.identity:
            self.race.restore(before.race.save())
        place(c.model, c.state, c.views)
        self._apply_weather()
        starting = c.sensors.take_over(b.sensors, self._seed, self._tick * self._substeps)
        self._show_lights_now()
        self._sense_with(Pinned(self.rows._replace(sensors=starting)))
        c.sensors.read()
        c.own_sensors.continue_from(b.own_sensors)
        if self._cameras is not None:
            self._cameras.reset(self._seed)
        self._tell(Restored)
        self._show(is_moved=True)

    @by_one_thread
    def add_sensor(self, vehicle: str, name: str, sensor: OwnSensor) -> None:
        """Add a sensor of your own to a vehicle: an object with `rate`, `columns` and `sample(view, random)`.

        It samples now, and then at its rate; the readings are in `VehicleFrame.own`. The object belongs to this world:
        a reset and `restore` set its attributes back. Raises `CommandError` for an unknown vehicle, a name that is
        taken, and what is no sensor, and `SensorError` if it cannot sample; then nothing has changed.
        """
        self._controls.index(vehicle)
        own = self.compiled.own_sensors
        if wrong := problem(name, sensor, own.names(vehicle)):
            raise CommandError(f"sensor {reprlib.repr(name)} of vehicle '{vehicle}': {wrong}")
        own.add(vehicle, name, sensor, self._seed, self._tick * self._substeps)
        self._tell(lambda: SensorAdded(vehicle, name))
        self._show()

    def watch_sensors(self, clock: Callable[[], float]) -> None:
        """Log a warning for each sensor of the user that is slow; `clock` returns the wall time [s]."""
        self.compiled.own_sensors.clock = clock

    @by_one_thread
    def set_driving_mode(self, vehicle: str, is_autonomous: bool) -> None:
        """Let a script (True) or a person (False) drive; the World itself obeys all commands given to `step`."""
        check_flag(is_autonomous, f"the driving mode of vehicle '{vehicle}'")
        number = self._controls.index(vehicle)
        self._controls.check_obeys(vehicle)
        self._controls.vehicles[number].is_autonomous = bool(is_autonomous)
        self._tell(lambda: SetDrivingMode(vehicle, bool(is_autonomous)))
        self._show()

    @by_one_thread
    def hold(self, vehicle: str, position: Vector | None, orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Hold a vehicle at rest at a pose (position [m], quaternion wxyz of any length), from the next tick on.

        None ends the hold. Raises `CommandError` for values that are not a pose.
        """
        self._poses.hold(vehicle, position, orientation)
        self._tell(lambda: hold(vehicle, position, orientation))

    @by_one_thread
    def retire(self, vehicle: str, reason: str = "", *, is_disqualified: bool = False) -> None:
        """End the race of a vehicle. Raises `CommandError` without a race; does nothing if its race has ended."""
        i = self._controls.index(vehicle)
        if self.race is None:
            raise CommandError(f"vehicle '{vehicle}' cannot retire: the scenario has no race")
        check_flag(is_disqualified, f"is_disqualified of vehicle '{vehicle}'")
        if not isinstance(reason, str):
            raise CommandError(f"the reason to retire vehicle '{vehicle}' must be a text, not {reprlib.repr(reason)}")
        if self.race.status(i) in (RaceStatus.WAITING, RaceStatus.RACING):
            status = RaceStatus.DISQUALIFIED if is_disqualified else RaceStatus.RETIRED
            event, moves = self.race.end(i, status, reason, self.time, self.compiled.state.vehicle_position)
            self._tell(lambda: Retire(vehicle, reason, is_disqualified))
            self._show((event,), is_moved=self._set_back(moves))

    @property
    def scene_light(self) -> bool:
        """True by day, False by night."""
        return self._light.at(self.time)[0]

    @property
    def time_of_day(self) -> float | None:
        """Time since midnight [s]; None if the light is fixed."""
        return self._light.at(self.time)[1]

    @by_one_thread
    def set_scene_light(self, enabled: bool) -> None:
        """Day (True) or night (False), instead of a time of day."""
        check_flag(enabled, "the scene light")
        self._tell(lambda: SetSceneLight(bool(enabled)))
        self._set_light(SceneLight(bool(enabled)))

    @by_one_thread
    def set_time_of_day(self, time_of_day: float | None, scale: float = 0.0) -> None:
        """Let the light follow a time of day [s since midnight] from now on; None keeps it, at first noon.

        `scale`: seconds of the day per simulated second. Raises `CommandError` if a value is not finite.
        """
        light = self._light.following(time_of_day, scale, self.time)
        self._tell(lambda: SetTimeOfDay(time_of_day, scale))
        self._set_light(light)

    @by_one_thread
    def show_drawings(self, request: Draw) -> None:
        """Show, replace and remove drawings in the view; `draw` has a method for each kind. Raises `CommandError`."""
        self.drawings = drawn_after(self.drawings, request, self.time)
        self._tell(lambda: request)

    def watch_contacts(self, is_watched: bool = True) -> None:
        """Whether `contact_forces` follows each tick, about 10 us for each vehicle; no result depends on it.

        Forces of the ground on each wheel, and of all contacts of the body of the vehicle, in the vehicle frame. Any
        thread may call this.
        """
        self.watches_contacts = is_watched
        if not is_watched:
            self.contact_forces = {}

    @property
    def weather(self) -> Weather | None:
        """The weather with wetness and snow cover of the ground; None: clear, over dry ground."""
        return self._weather_now

    @by_one_thread
    def set_weather(self, weather: Weather | None = None, *, keeps_ground: bool = False) -> None:
        """Set the weather from now on; None: clear. The ground becomes wet, white or dry with its time constants.

        `keeps_ground`: wetness and snow cover that are held stay so, unless `weather` has others. Raises `CommandError`
        if an amount is not a number from 0 to 1.
        """
        weather = Weather() if weather is None else weather
        check_weather(weather)
        if keeps_ground:
            held = {name: getattr(self._weather.weather, name) for name in ("wetness", "snow_cover")}
            weather = replace(weather, **{name: held[name] for name in held if getattr(weather, name) is None})
        self._weather = self._weather.following(weather, self.time)
        self._tell(lambda: SetWeather(weather))
        before = self._weather_now
        self._apply_weather()
        self._show(is_moved=before != self._weather_now)

    @by_one_thread
    def set_traffic_light(self, light: str, state: TrafficLightState | None) -> None:
        """Let a traffic light of the map show that state until a reset; None: what its program says.

        Raises `CommandError` for an unknown light and for a value that is no state.
        """
        given = lights.set_light(self.map.traffic_lights, self._row.lights, light, state)
        self._show_lights_now()
        self._tell(lambda: SetTrafficLight(light, given))
        self._show(is_moved=True)

    def _apply_weather(self, *, is_reset: bool = False) -> None:
        """Let tyres, LIDARs and Frames have the weather of now, or of the latest multiple of `WEATHER_PERIOD`.

        `is_reset`: tyres and LIDARs are as in clear weather.
        """
        numerator, denominator = self._tick_ratio
        latest = (self._tick - self._tick % self._weather_ticks) * numerator / denominator
        time = max(latest, self._weather.since)
        now = self._weather.at(time)
        self._follows_weather = not self._weather.is_settled(time)
        shown = None if is_clear(now) else now
        if shown != self._weather_now or (is_reset and shown is not None):
            self._weather_now = shown
            set_weather(self.compiled, self.spec, self.vehicle_specs, now, self._seed)
            first = self.vehicle_specs[self.vehicle_names[0]]
            self._frames.weather = shown
            self._frames.weather_effects = weather_effects(now, self.map.ground, first)

    def _set_light(self, light: SceneLight) -> None:
        before = self.scene_light, self.time_of_day
        self._light = light
        daylight.write(self._row.daylight, 0, light)
        self._show_lights_now()
        self._show(is_moved=before != (self.scene_light, self.time_of_day))

    @by_one_thread
    def save(self) -> Snapshot:
        """Everything that the future depends on. Can be pickled, also for another process."""
        c = self.compiled
        return Snapshot(
            world=self._identity,
            seed=self._seed,
            row=saved_row(self.rows.worlds),
            race=self.race and self.race.save(),
            own_sensors=c.own_sensors.save(),
            cameras=self._cameras and self._cameras.save(),
            controls=self._controls.save(),
            weather=self._weather,
            held=dict(self._poses.held),
            frame=self.frame,
        )

    @by_one_thread
    def restore(self, saved: Snapshot) -> Frame:
        """Continue from a snapshot of this world or of another world of the same scenario, with the same bits.

        Raises `SnapshotError` if the snapshot is of another scenario; then nothing has changed.
        """
        check_snapshot(
            saved,
            self._identity,
            self.spec.map_name,
            without_tables(self.rows.worlds),
            needs_cameras=self._cameras is not None and self._cameras.save() is not None,
        )
        c = self.compiled
        c.own_sensors.check(saved.own_sensors)
        c.engine.forget_warnings()
        self._seed = saved.seed
        c.contacts.impulse[:] = 0.0
        c.contacts.pair_count[0] = 0
        restore_row(self.rows.worlds, saved.row)
        self._tick = int(self.rows.worlds.tick[0])
        if self.race is not None:
            self.race.restore(saved.race)
        c.sensors.restore(saved.frame.vehicles.values())
        c.own_sensors.restore(saved.own_sensors)
        if self._cameras is not None:
            self._cameras.restore(saved.cameras)
        self._controls.restore(saved.controls)
        self._light = daylight.light_of(self._row.daylight)
        self._heard = radio.readings(c, self._row.radio)
        self._poses.held, self._weather = dict(saved.held), saved.weather
        self._apply_weather()
        self._tell(Restored)
        return self._publish(saved.frame)

    # -- views and cameras ---------------------------------------------------------------------------------------

    def vehicle(self, name: str) -> VehicleView:
        """A read-only view of one vehicle's state, for prompts and tests."""
        return VehicleView(self.compiled.state, self._controls.index(name))

    @property
    def is_looking(self) -> bool:
        """Whether images of the current Frame are still being rendered; `look` adds them. Only in real time."""
        return self._cameras is not None and self._cameras.has_pending_images

    @property
    def belongs_to_thread(self) -> bool:
        """Whether only the thread that called `step` first may call it: an OpenGL context is bound to its thread."""
        return self._cameras is not None and self._cameras.is_thread_bound

    @by_one_thread
    def look(self) -> Frame:
        """The current Frame with the images that have arrived since; a new Frame, without events, if there are any."""
        if self._cameras is not None:
            seen = self._cameras.update(self.frame)
            if seen is not self.frame:
                self._publish(replace(seen, events=()))
        return self.frame

    @by_one_thread
    def close(self) -> None:
        """Release the camera renderer; no step can follow."""
        self._is_closed = True
        if self._cameras is not None:
            self._cameras.close()

    # -- parts of a tick -----------------------------------------------------------------------------------------

    def _set_back(self, moves: Sequence[Move]) -> bool:
        """Place vehicles where the rules of the race want them; whether one was placed."""
        is_moved = False
        for i, poses in moves:
            name = self.vehicle_names[i]
            for pose in poses:
                with contextlib.suppress(CommandError):  # the place is taken
                    self._poses.place({name: self._on_ground(name, *pose)})
                    self._note_moved(i)
                    is_moved = True
                    break
        return is_moved

    def _note_moved(self, i: int) -> None:
        """Vehicle i was placed by hand: it has crossed no line."""
        if self.race is not None:
            self.race.moved(i, self.compiled.state.vehicle_position)
        stop_lines.forget(self._row.stop_lines, i)

    def _ground_poses(self) -> list[tuple[float, float, float]]:
        """x, y [m] and heading [rad] of the vehicles."""
        state = self.compiled.state
        return [
            (*position[:2], euler_from_quaternion(orientation)[2])
            for position, orientation in zip(
                state.vehicle_position.tolist(), state.vehicle_orientation.tolist(), strict=True
            )
        ]

    def _set_tick(self, tick: int) -> None:
        self._tick = tick
        self.rows.worlds.tick[0] = tick

    def _switch_lamps(self) -> None:
        """Let the traffic switch its lamps."""
        switch_lamps(
            self.rows.rules.traffic, self._row.traffic, self._controls.vehicles, self._tick, is_day=self.scene_light
        )

    def _show_lights_now(self) -> None:
        """Let the traffic lights follow a change between two ticks."""
        if self._show_lights is not None:
            self._show_lights(self._pinned, 0)

    def _sample(self) -> None:
        """Sample all sensors that are due, and let the radio send and deliver."""
        self._sense_with(self._pinned)
        self.compiled.sensors.read()
        if self.compiled.own_sensors.placed:
            self.compiled.own_sensors.sample(self._tick * self._substeps)

    def _sense_with(self, pinned: Pinned[Rows]) -> None:
        if self.spec.v2x is not None:
            lamps = self._frames.lamps(self._tick, self._controls.vehicles)
            self.rows.thread.rules.radio.messages[: len(lamps), radio.LAMPS] = [*map(radio.lamps_number, lamps)]
        if self._sense(pinned, 0):
            self._heard = radio.readings(self.compiled, self._row.radio)

    def _show(self, events: tuple[Event, ...] = (), *, is_moved: bool = False) -> Frame:
        """Make the current Frame, with camera images; `is_moved`: changed by hand, so that all images are outdated."""
        time = self.time
        scene_light, time_of_day = self._light.at(time)
        frame = self._frames.build(
            self._tick,
            time,
            self._controls.vehicles,
            self._row.collisions.total[0].tolist(),
            events,
            scene_light,
            time_of_day,
            races=self.race and self.race.states(time),
            traffic_lights=lights.frames(self.map.traffic_lights, self._row.lights),
            heard=self._heard,
        )
        return self._publish(frame if self._cameras is None else self._cameras.update(frame, redraw=is_moved))

    def _publish(self, frame: Frame) -> Frame:
        """Make that the current Frame."""
        self.frame = frame
        for observer in self.observers:
            observer.publish(frame)
        return frame

    def _tell(self, request: Callable[[], Request]) -> None:
        """Tell the observers of a change; it is described only for them."""
        for observer in self.observers:
            observer.executed(request())
