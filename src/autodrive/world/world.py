"""The world: `World.step(commands)` moves the State by one tick and returns a Frame."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from msgspec.structs import replace

from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError, EngineError
from autodrive.base.exact_fraction import exact_fraction
from autodrive.base.transforms import Quaternion, Vector
from autodrive.graphics.cameras.backend import NoCameras
from autodrive.graphics.meshes.instances import Instance, instances_of
from autodrive.physics.sensors.columns import SensorTables
from autodrive.physics.sensors.own import OwnSensor, problem
from autodrive.physics.state import VehicleView
from autodrive.protocol.drawing import DrawCalls
from autodrive.protocol.messages import (
    Command,
    Draw,
    Event,
    Frame,
    Hold,
    Reset,
    Retire,
    SetDrivingMode,
    SetSceneLight,
    SetTimeOfDay,
    SetTrafficLight,
    SetWeather,
    Teleport,
    TrafficLightState,
    Weather,
)
from autodrive.protocol.native import ContactForces, Drawn
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.columns import saved_row, without_tables
from autodrive.world.compile import CompiledScenario
from autodrive.world.conditions import WorldConditions
from autodrive.world.contacts import contact_forces
from autodrive.world.controls import Controls
from autodrive.world.frames import FrameBuilder
from autodrive.world.motion import checked_motions
from autodrive.world.notebook import html_of
from autodrive.world.observer import Observer, Request, ResetTo, Restored, SensorAdded, SetPoses
from autodrive.world.one_thread import OneThread, by_one_thread
from autodrive.world.poses import Poses
from autodrive.world.racing import Move
from autodrive.world.requests import EXECUTE
from autodrive.world.row import Row
from autodrive.world.snapshot import Snapshot, check_snapshot, identity

if TYPE_CHECKING:
    from autodrive.graphics.cameras.backend import CameraBackend


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
        """Drawings in the view by name, outside of State and Snapshots; each change makes another dictionary."""
        self.contact_forces: dict[str, ContactForces] = {}
        """What pushed each vehicle in the last tick, while `watch_contacts` is on."""
        self.watches_contacts = False
        """Whether `contact_forces` follows each tick; see `watch_contacts`."""
        self.compiled = compiled
        """Model, State and engine; what changes them changes the results."""
        self.specs = compiled.specs
        """The Specs of the scenario and of its files."""
        self.map = compiled.map
        self.sensors = compiled.configured
        """Sensors and cameras, also those that are off, by vehicle and name."""
        self.vehicle_names = list(compiled.vehicles)
        self.boxes = dict(zip(compiled.objects, compiled.boxes, strict=True))
        """The movable objects of a Frame, as they were placed."""
        self.warnings = compiled.warnings
        """Probable mistakes in the scenario, as parts of their texts; see `autodrive.base.specs.joined`."""
        self.tick_duration = compiled.spec.tick
        self.seed = compiled.spec.seed
        """Seed of all noise since the last reset."""
        self.race = compiled.race
        """The race of the scenario; None if it has none."""
        tick = exact_fraction(compiled.spec.tick)
        self._tick_ratio = tick.numerator, tick.denominator
        self.controls = Controls(
            {name: placement.is_autonomous for name, placement in compiled.spec.vehicles.items()},
            traffic=compiled.spec.traffic.names,
            timeout=compiled.spec.command_ticks,
        )
        """Commands, driving modes and lamps of the vehicles."""
        self.row = Row(compiled, self.controls, engine)
        """The numbers of the World, and the stages of the tick that change them."""
        self.conditions = WorldConditions(compiled, self.row.rules.daylight)
        """Light, weather and the factors of the vehicles; change them with requests."""
        self.poses = Poses(compiled, self.controls)
        """Poses of vehicles and objects; change them with requests."""
        self._cameras = cameras or NoCameras()
        self._frames = FrameBuilder(compiled, self.conditions)
        self.reset()

    def __repr__(self) -> str:
        cameras = "no cameras" if isinstance(self._cameras, NoCameras) else "with cameras"
        return (
            f"<World of map '{self.spec.map_name}' at {self.time:g} s: vehicles {', '.join(self.vehicle_names)}; "
            f"{len(self.boxes)} objects; {cameras}>"
        )

    def _repr_html_(self) -> str:
        return html_of(self.map, self.boxes, self.frame)

    @property
    def time(self) -> float:
        """Simulated time since the reset [s]."""
        numerator, denominator = self._tick_ratio
        return self._tick * numerator / denominator

    @property
    def spec(self) -> ScenarioSpec:
        """The scenario from which `reset` starts."""
        return self.conditions.spec

    @property
    def vehicle_specs(self) -> dict[str, VehicleSpec]:
        """Specs of the vehicles by name, with the factors of `set_factors`."""
        return self.conditions.vehicles

    @property
    def instances(self) -> tuple[Instance, ...]:
        """The objects with the instance numbers 1, 2, ... in the images of cameras: those of the map first."""
        return instances_of(self.map, self.vehicle_names, self.boxes)

    # -- the tick ------------------------------------------------------------------------------------------------

    @by_one_thread
    def step(self, commands: Mapping[str, Command] | None = None) -> Frame:
        """Run one tick with these commands; a vehicle without a command keeps its last one until its time-out.

        Raises `CommandError` for anything but a dictionary of Commands, an unknown vehicle or a value that is not
        finite; nothing has moved then. Raises `EngineError` if the physics cannot continue, and `SensorError` if a
        sensor of the user fails; after that, call `reset` or `restore`.
        """
        self._check_open()
        c, controls, race = self.compiled, self.controls, self.race
        if commands is not None:
            controls.accept(commands, self._tick)
        controls.update(self._tick)
        self.row.drive_traffic(self.time, self.conditions.light, self.conditions.shown)
        if race is not None:
            race.restrain(self.time, controls.throttle)
        if self.conditions.is_changing:
            self.conditions.follow(self._tick, self.seed)
        is_sound = self.row.move()
        self._tick += 1
        time = self.time
        if self.poses.held:
            self.poses.apply_held()
        if not is_sound:
            raise EngineError(
                f"the physics became unstable at {time:.3f} s; reset the world, and use a shorter substep or "
                "a vehicle with softer springs"
            )
        if self.watches_contacts:
            self.contact_forces = contact_forces(c, self.tick_duration)
        events = self.row.judge(time)
        is_moved = False
        if race is not None:
            news, moves = race.judge(time, c.state.vehicle_position, events)
            events += tuple(news)
            is_moved = bool(moves) and self.set_back(moves)
        self._sense()
        c.own_sensors.sample(self._tick * self.row.rows.substeps)
        if commands is not None:
            for observer in self.observers:
                observer.given(commands)
        return self._show(events, is_moved=is_moved)

    def _sense(self, sensors: SensorTables | None = None) -> None:
        """Sample the sensors that are due, and let the radio send and deliver; see `Row.sense`."""
        lamps = self._frames.lamps(self._tick, self.controls.vehicles) if self.spec.v2x else ()
        self.row.sense(lamps, sensors)

    def _show(self, events: tuple[Event, ...] = (), *, is_moved: bool = False) -> Frame:
        """Make the current Frame, with camera images; `is_moved`: changed by hand, so that all images are outdated."""
        time = self.time
        frame = self._frames.build(
            self._tick,
            time,
            self.controls.vehicles,
            self.row.rules.collisions.total[0].tolist(),
            events,
            races=self.race and self.race.states(time),
            traffic_lights=self.row.lights,
            heard=self.row.heard,
        )
        return self._publish(self._cameras.update(frame, redraw=is_moved))

    def _publish(self, frame: Frame) -> Frame:
        """Make `frame` the current Frame, and tell the observers."""
        self.frame = frame
        for observer in self.observers:
            observer.publish(frame)
        return frame

    def set_back(self, moves: Sequence[Move]) -> bool:
        """Place vehicles where the rules of the race want them; whether one was placed."""
        placed = self.poses.place_at_first({self.vehicle_names[i]: poses for i, poses in moves})
        for name in placed:
            self.note_moved(self.vehicle_names.index(name))
        return bool(placed)

    def note_moved(self, i: int) -> None:
        """Vehicle i was placed by hand: it has crossed no line."""
        if self.race is not None:
            self.race.moved(i, self.compiled.state.vehicle_position)
        self.row.note_moved(i)

    # -- changes between ticks -----------------------------------------------------------------------------------

    @by_one_thread
    def apply(self, request: Request) -> Frame:
        """Execute a request, tell the observers, and return the current Frame, which the request may have made.

        Raises `CommandError` for wrong values, and for a request that is not for a World, such as `Pause`; then nothing
        has changed.
        """
        execute = EXECUTE.get(type(request))
        if execute is None:
            raise CommandError(f"a World cannot execute {reprlib.repr(request)}; give this request to a Simulation")
        if (change := execute(self, request)) is not None:
            self._tell(change.request)
            if change.has_frame:
                self._show(change.events, is_moved=change.is_moved)
        return self.frame

    def _tell(self, request: Request) -> None:
        for observer in self.observers:
            observer.executed(request)

    def reset(
        self,
        seed: int | None = None,
        *,
        poses: Mapping[str, tuple[float, float, float]] | None = None,
        weather: Weather | None = None,
        motions: Mapping[str, Sequence[float]] | None = None,
        past_commands: Mapping[str, Sequence[Sequence[float]]] | None = None,
    ) -> Frame:
        """Return to the initial state; a new seed stays until the next one.

        `poses`: x, y [m] and yaw [rad] on the ground at which vehicles and objects start this time, by name. `weather`:
        from this start on, as after a long time of it; None: that of the scenario. `motions`: vehicles start in motion,
        with rolling wheels: forward and left speed [m/s], yaw rate [rad/s], and the throttle and the steering that they
        have obeyed. `past_commands`: throttle and steering in the ticks before the start, oldest first, shape (t, 2);
        actuators and dead times follow them, from those of `motions` on. Raises `CommandError` for wrong values, and
        for a pose that overlaps something; then nothing has changed.
        """
        is_plain = poses is None and weather is None and motions is None and past_commands is None
        unchecked: Any = (poses, weather, motions, past_commands)
        return self.apply(Reset(seed) if is_plain else ResetTo(seed, *unchecked))

    def begin(self, seed: int, start: ResetTo) -> None:
        """Execute a reset; see `reset`, which checks seed and weather, and makes the Frame."""
        self._check_open()
        motions = checked_motions(start.motions, start.past_commands, 1)  # pyright: ignore[reportArgumentType]
        moving = {self.controls.index(name): motion for name, motion in motions.items()}
        c, qpos = self.compiled, self.poses.at_start(seed, start.poses)
        self.seed = seed
        self.row.begin(qpos, seed, moving)
        self._tick = 0
        self.drawings, self.contact_forces, self.poses.held = {}, {}, {}
        self.controls.reset()
        c.sensors.reset(self.seed)
        self.conditions.reset(start.weather, self.seed)
        self.row.switch_lamps(0.0, self.conditions.light, self.conditions.shown)
        if self.race is not None:
            self.race.reset(c.state.vehicle_position)
        c.own_sensors.reset(self.seed)
        self._cameras.reset(self.seed)
        self.row.show_lights()
        self._sense()
        c.own_sensors.sample(0)

    def teleport(self, name: str, x: float, y: float, yaw: float = 0.0) -> None:
        """Place a vehicle or an object, at rest, on the ground at x, y [m] with heading yaw [rad].

        Encoders keep their counts. Raises `CommandError` if it would overlap something there; then nothing has moved.
        """
        self.apply(Teleport(name, x, y, yaw))

    def set_poses(self, poses: Mapping[str, Floats]) -> None:
        """Place vehicles and objects, at rest, at these poses (position [m] and quaternion wxyz, shape (7,)).

        Raises `CommandError` for values that are not a pose, and if one of them would overlap something there; then
        nothing has moved.
        """
        unchecked: Any = poses
        self.apply(SetPoses(unchecked))

    @by_one_thread
    def pose(self, name: str) -> Floats:
        """Position [m] and orientation (wxyz) of a vehicle or an object, shape (7,). Raises `CommandError`."""
        return self.poses.get(name)

    def hold(self, vehicle: str, position: Vector | None, orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Hold a vehicle at a pose (position [m], quaternion wxyz of any length), from the next tick on.

        The vehicle is at rest there. A vehicle that was held somewhere else before reports the velocity from there, for
        as long as it was held there: a co-simulation that moves it in every tick, or in every third, sees it move.
        None ends the hold. Raises `CommandError` for values that are not a pose.
        """
        self.apply(Hold(vehicle, position, orientation))

    def set_driving_mode(self, vehicle: str, is_autonomous: bool) -> None:
        """Let a script (True) or a person (False) drive; the World itself obeys all commands given to `step`."""
        self.apply(SetDrivingMode(vehicle, is_autonomous))

    def retire(self, vehicle: str, reason: str = "", *, is_disqualified: bool = False) -> None:
        """End the race of a vehicle. Raises `CommandError` without a race; does nothing if its race has ended."""
        self.apply(Retire(vehicle, reason, is_disqualified))

    @property
    def scene_light(self) -> bool:
        """True by day, False by night."""
        return self.conditions.light.at(self.time)[0]

    @property
    def time_of_day(self) -> float | None:
        """Time since midnight [s]; None if the light is fixed."""
        return self.conditions.light.at(self.time)[1]

    def set_scene_light(self, enabled: bool) -> None:
        """Day (True) or night (False), instead of a time of day."""
        self.apply(SetSceneLight(enabled))

    def set_time_of_day(self, time_of_day: float | None, scale: float = 0.0) -> None:
        """Let the light follow a time of day [s since midnight] from now on; None keeps it, at first noon.

        `scale`: seconds of the day per simulated second. Raises `CommandError` if a value is not finite.
        """
        self.apply(SetTimeOfDay(time_of_day, scale))

    @property
    def weather(self) -> Weather | None:
        """The weather with wetness and snow cover of the ground; None: clear, over dry ground."""
        return self.conditions.shown

    def set_weather(self, weather: Weather | None = None, *, keeps_ground: bool = False) -> None:
        """Set the weather from now on; None: clear. The ground becomes wet, white or dry with its time constants.

        `keeps_ground`: wetness and snow cover that are held stay so, unless `weather` has others. Raises `CommandError`
        if an amount is not a number from 0 to 1.
        """
        self.apply(SetWeather(Weather() if weather is None else weather, keeps_ground))

    def set_traffic_light(self, light: str, state: TrafficLightState | None) -> None:
        """Let a traffic light of the map show that state until a reset; None: what its program says.

        Raises `CommandError` for an unknown light and for a value that is no state.
        """
        self.apply(SetTrafficLight(light, state))

    def show_drawings(self, request: Draw) -> None:
        """Show, replace and remove drawings in the view; `draw` has a method for each kind. Raises `CommandError`."""
        self.apply(request)

    def watch_contacts(self, is_watched: bool = True) -> None:
        """Whether `contact_forces` follows each tick, about 10 us for each vehicle; no result depends on it.

        Forces of the ground on each wheel, and of all contacts of the body of the vehicle, in the vehicle frame. Any
        thread may call this.
        """
        self.watches_contacts = is_watched
        if not is_watched:
            self.contact_forces = {}

    @by_one_thread
    def add_sensor(self, vehicle: str, name: str, sensor: OwnSensor) -> None:
        """Add a sensor of your own to a vehicle: an object with `rate`, `columns` and `sample(view, random)`.

        It samples now, and then at its rate; the readings are in `VehicleFrame.own`. The object belongs to this world:
        a reset and `restore` set its attributes back. Raises `CommandError` for an unknown vehicle, a name that is
        taken, and what is no sensor, and `SensorError` if it cannot sample; then nothing has changed.
        """
        self.controls.index(vehicle)
        own = self.compiled.own_sensors
        if wrong := problem(name, sensor, own.names(vehicle)):
            raise CommandError(f"sensor {reprlib.repr(name)} of vehicle '{vehicle}': {wrong}")
        own.add(vehicle, name, sensor, self.seed, self._tick * self.row.rows.substeps)
        self._tell(SensorAdded(vehicle, name))
        self._show()

    def watch_sensors(self, clock: Callable[[], float]) -> None:
        """Log a warning for each sensor of the user that is slow; `clock` returns the wall time [s]."""
        self.compiled.own_sensors.clock = clock

    @by_one_thread
    def set_factors(self, factors: Mapping[str, Mapping[str, float]]) -> None:
        """Let `reset` start with these factors of vehicles, in addition to the scenario's; see `VehiclePlacement`.

        They are 'mass', 'grip', 'noise' and 'drive', and 'trim' of the steering [rad]; left out: 1, without a trim. The
        bits are those of a new World of the scenario with these `mass_factor` ... and `steering_trim`. Raises
        `CommandError`.
        """
        for vehicle in factors:
            self.controls.index(vehicle)
        self.conditions.set_factors(factors)
        self.__dict__.pop("_identity", None)

    # -- other states --------------------------------------------------------------------------------------------

    @by_one_thread
    def start_from(self, compiled: CompiledScenario) -> None:
        """Let `reset` start from that scenario, which may differ from the present one in its poses only."""
        self.poses.initial, self.conditions.spec = compiled.engine.start, compiled.spec
        self.boxes = dict(zip(compiled.objects, compiled.boxes, strict=True))
        self.warnings = compiled.warnings

    @by_one_thread
    def continue_from(self, before: World) -> None:
        """Continue at the time and in the state of another world, which has the same vehicles.

        Objects that both worlds have keep their poses and velocities; other objects are at their start. Sensors with
        other settings start now; all images are rendered again.
        """
        c, b = self.compiled, before.compiled
        self.seed, self.drawings = before.seed, before.drawings
        self.row.take_over(before.row, self.seed)
        self._tick = self.row.tick
        self.controls.restore(before.controls.save())
        self.poses.restore(before.poses.save())
        if self.race and before.race and self.race.identity == before.race.identity:
            self.race.restore(before.race.save())
        starting = c.sensors.take_over(b.sensors, self.seed, self._tick * self.row.rows.substeps)
        self.conditions.restore(before.conditions.weather, self._tick, self.seed, is_reset=True)
        self.row.show_lights()
        self._sense(starting)
        c.own_sensors.continue_from(b.own_sensors)
        self._cameras.reset(self.seed)
        self._tell(Restored())
        self._show(is_moved=True)

    def _parts(self) -> dict[str, Any]:
        """What has a state that is not in the row, by name."""
        parts = {"controls": self.controls, "poses": self.poses, "own_sensors": self.compiled.own_sensors}
        return {**parts, "cameras": self._cameras, **({"race": self.race} if self.race else {})}

    @cached_property
    def _identity(self) -> str:
        """Hash of all that a snapshot must have in common with this world."""
        return identity(self.compiled, self.conditions.wheels(Weather()))

    @by_one_thread
    def save(self) -> Snapshot:
        """Everything that the future depends on. Can be pickled, also for another process."""
        parts = {name: part.save() for name, part in self._parts().items()}
        row, weather = saved_row(self.row.rows.worlds), self.conditions.weather
        return Snapshot(self._identity, self.seed, row, weather, parts, self.frame)

    @by_one_thread
    def restore(self, saved: Snapshot) -> Frame:
        """Continue from a snapshot of this world or of another world of the same scenario, with the same bits.

        Raises `SnapshotError` if the snapshot is of another scenario; then nothing has changed.
        """
        c, parts = self.compiled, self._parts()
        has_images = self._cameras.save() is not None
        check_snapshot(saved, self._identity, self.spec.map_name, without_tables(self.row.rows.worlds), has_images)
        c.own_sensors.check(saved.parts["own_sensors"])
        self.row.restore(saved.row)
        self.seed, self._tick = saved.seed, self.row.tick
        for name, part in parts.items():
            part.restore(saved.parts[name])
        c.sensors.restore(saved.frame.vehicles.values())
        self.conditions.restore(saved.weather, self._tick, self.seed)
        self._tell(Restored())
        return self._publish(saved.frame)

    # -- views and cameras ---------------------------------------------------------------------------------------

    def vehicle(self, name: str) -> VehicleView:
        """A read-only view of one vehicle's state, for prompts and tests."""
        return VehicleView(self.compiled.state, self.controls.index(name))

    @property
    def is_looking(self) -> bool:
        """Whether images of the current Frame are still being rendered; `look` adds them. Only in real time."""
        return self._cameras.has_pending_images

    @property
    def belongs_to_thread(self) -> bool:
        """Whether only the thread that called `step` first may call it: an OpenGL context is bound to its thread."""
        return self._cameras.is_thread_bound

    @by_one_thread
    def look(self) -> Frame:
        """The current Frame with the images that have arrived since; a new Frame, without events, if there are any."""
        seen = self._cameras.update(self.frame)
        return self.frame if seen is self.frame else self._publish(replace(seen, events=()))

    @by_one_thread
    def close(self) -> None:
        """Release the camera renderer; no step can follow."""
        self._is_closed = True
        self._cameras.close()
