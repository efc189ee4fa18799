"""The world: `World.step(commands)` moves the State by one tick and returns a Frame."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from autodrive.arrays import Floats
from autodrive.compile import Compiled
from autodrive.controls import Controls, VehicleControls
from autodrive.errors import CommandError, EngineError, SnapshotError
from autodrive.frames import FrameBuilder
from autodrive.jit import resolved
from autodrive.physics.one_thread import OneThread, by_one_thread
from autodrive.physics.tick import advance, observe
from autodrive.protocol.commands import MAX_DISTANCE, MAX_TIME_SCALE, check_flag, check_seed, is_number
from autodrive.protocol.display import yaw
from autodrive.protocol.messages import Command, Event, Frame
from autodrive.referee import Referee
from autodrive.render.look import DAY_LENGTH, is_day_at
from autodrive.state import State, VehicleView
from autodrive.transforms import Quaternion, Vector, quaternion_from_yaw

if TYPE_CHECKING:
    from autodrive.cameras.backend import CameraBackend


DRAWING_WIDTH = 400.0
"""Width of the map in a notebook [pixels]."""


class World(OneThread):
    """Vehicles, a map and movable objects in simulated time. Same scenario, seed and commands: same bits.

    Several threads may use it in turn. While one is inside a method, a call of another thread raises
    `WorldInUseError` at once and changes nothing.
    """

    def __init__(self, compiled: Compiled, cameras: CameraBackend | None = None) -> None:
        super().__init__()
        self._compiled = compiled
        self._cameras = cameras
        self.spec = compiled.spec
        """The scenario from which `reset` starts."""
        self.map = compiled.map
        self.vehicle_specs = compiled.vehicles
        self.sensors = compiled.configured
        """Sensors and cameras, also those that are off, by vehicle and name."""
        self.vehicle_names = list(compiled.vehicles)
        self.boxes = dict(zip(compiled.objects, compiled.boxes, strict=True))
        """The movable objects of a Frame, as they were placed."""
        self.tick_duration = compiled.spec.tick
        self._seed = compiled.spec.seed
        self._start: Floats | None = None
        """Poses of all movable bodies at the start, as qpos, if they are not those of the model."""
        self._substeps = compiled.spec.substeps
        self._tick_length = Fraction(str(compiled.spec.tick))
        self._controls = Controls(
            {name: placement.is_autonomous for name, placement in compiled.spec.vehicles.items()},
            timeout=math.floor(Fraction(str(compiled.spec.command_timeout)) / self._tick_length),
        )
        self._referee = Referee(
            self.vehicle_names, compiled.owners, compiled.map.drivable_edges, 1.0 / compiled.spec.tick
        )
        self._frames = FrameBuilder(compiled)
        self._identity = _identity(compiled)
        c, controls = compiled, self._controls
        self._advance = resolved(
            advance, c.model, c.state, c.views, c.contacts, c.scratch, controls.throttle, controls.steering, 0, 0
        )
        self.reset()

    def __repr__(self) -> str:
        cameras = "no cameras" if self._cameras is None else "with cameras"
        return (
            f"<World of map '{self.spec.map}' at {self.time:g} s: vehicles {', '.join(self.vehicle_names)}; "
            f"{len(self.boxes)} objects; {cameras}>"
        )

    def _repr_html_(self) -> str:
        """For a notebook: the map from above with vehicles and objects where they are now, and the Frame."""
        from autodrive.maps.draw import to_svg  # noqa: PLC0415  its libraries are needed only here

        poses = self.frame.objects
        boxes = (
            dataclasses.replace(box, position=tuple(poses[name].pose.position.tolist()), yaw=yaw(poses[name].pose))
            for name, box in self.boxes.items()
        )
        x0, _, x1, _ = self.map.bounds
        drawing = to_svg(
            dataclasses.replace(self.map, boxes=tuple(boxes)),
            pixels_per_metre=DRAWING_WIDTH / (x1 - x0),
            starts=[(*one.pose.position.tolist()[:2], yaw(one.pose)) for one in self.frame.vehicles.values()],
        )
        return drawing + self.frame._repr_html_()

    # -- the tick ------------------------------------------------------------------------------------------------

    @by_one_thread
    def step(self, commands: Mapping[str, Command] | None = None) -> Frame:
        """Run one tick with these commands; a vehicle without a command keeps its last one until its time-out.

        Raises `CommandError` for anything but a dictionary of Commands, an unknown vehicle or a value that is not
        finite; nothing has moved then. Raises `EngineError` if the physics cannot go on; `reset` or `restore` brings
        the world back.
        """
        c, controls = self._compiled, self._controls
        if commands is not None:
            controls.accept(commands, self._tick)
        controls.update(self._tick)
        is_sound = self._advance(
            c.model,
            c.state,
            c.views,
            c.contacts,
            c.scratch,
            controls.throttle,
            controls.steering,
            self._tick * self._substeps,
            self._substeps,
        )
        self._tick += 1
        self._hold_vehicles()
        if not is_sound:
            raise EngineError(
                f"the physics became unstable at {self.time:.3f} s; reset the world, and use a shorter substep or "
                "a vehicle with softer springs"
            )
        events = self._referee.judge(self._tick, self.time, c.model, c.state, c.contacts)
        self._sample()
        return self._show(events)

    @by_one_thread
    def reset(self, seed: int | None = None) -> Frame:
        """Return to the initial state; a new seed stays until the next one. Raises `CommandError` for a wrong seed."""
        if seed is not None:
            check_seed(seed)
            self._seed = int(seed)
        c = self._compiled
        c.engine.reset()
        if self._start is not None:
            c.views.qpos[:] = self._start
        c.engine.update()
        for column in c.state:
            column[:] = 0.0
        c.contacts.impulse[:] = 0.0
        c.contacts.pair_count[0] = 0
        self._tick = 0
        self._controls.reset()
        self._light = Light(self.spec.scene_light)
        self._held: dict[str, tuple[float, ...]] = {}
        self._referee.reset()
        observe(c.model, c.state, c.views)
        for sensors in c.sensors.values():
            sensors.reset(self._seed)
        if self._cameras is not None:
            self._cameras.reset(self._seed)
        self._sample()
        return self._show()

    @property
    def time(self) -> float:
        """Simulated time since the reset [s]."""
        return self._tick * self._tick_length.numerator / self._tick_length.denominator

    # -- changes between ticks -----------------------------------------------------------------------------------

    @by_one_thread
    def teleport(self, name: str, x: float, y: float, yaw: float = 0.0) -> None:
        """Place a vehicle or an object, at rest, on the ground at x, y [m] with heading yaw [rad].

        Encoders keep their counts. Raises `CommandError` if it would overlap something there; then nothing has moved.
        """
        self._check_name(name)
        if not all(is_number(value, MAX_DISTANCE) for value in (x, y, yaw)):
            raise CommandError(
                f"{self._noun(name)} cannot be placed at x={x}, y={y}, yaw={yaw}: they must be numbers from "
                f"{-MAX_DISTANCE:g} to {MAX_DISTANCE:g}"
            )
        x, y, yaw = float(x), float(y), float(yaw)
        box = self.boxes.get(name)
        height = 0.5 * box.size[2] if box else self.vehicle_specs[name].ride_height
        self.set_poses({name: np.array([x, y, height, *quaternion_from_yaw(yaw)])})

    @by_one_thread
    def pose(self, name: str) -> Floats:
        """Position [m] and orientation (wxyz) of a vehicle or an object, shape (7,). Raises `CommandError`."""
        self._check_name(name)
        qpos = self._compiled.engine.body(name)[1]
        return self._compiled.views.qpos[qpos : qpos + 7].copy()

    @by_one_thread
    def set_poses(self, poses: Mapping[str, Floats]) -> None:
        """Place vehicles and objects, at rest, at these poses (position [m] and quaternion wxyz, shape (7,)).

        Raises `CommandError` for values that are not a pose, and if one of them would overlap something there; then
        nothing has moved.
        """
        c = self._compiled
        if not isinstance(poses, Mapping):
            raise CommandError(f"poses must be a dictionary with a pose for each name, not {reprlib.repr(poses)}")
        for name in poses:
            self._check_name(name)
        poses = {name: self._checked_pose(name, pose) for name, pose in poses.items()}
        before = {name: self.pose(name) for name in poses}
        self._write_poses(poses)
        for name, pose in poses.items():
            if others := _overlaps(c, name):
                self._write_poses(before)
                x, y = (float(f"{value:.6g}") for value in pose[:2])
                raise CommandError(f"{self._noun(name)} cannot be placed at x={x}, y={y}: it would overlap {others}")
        for name in poses:
            dof = c.engine.body(name)[2]
            c.views.qvel[dof : dof + 6] = 0.0
            if name not in self.boxes:
                i = self._controls.index(name)
                for column in (c.state.wheel_angular_velocity, c.state.wheel_force, c.state.wheel_hold):
                    column[4 * i : 4 * i + 4] = 0.0
        c.engine.update()
        observe(c.model, c.state, c.views)
        self._show(is_moved=True)

    @by_one_thread
    def start_from(self, compiled: Compiled) -> None:
        """Let `reset` start from that scenario, which may differ from the present one in its poses only."""
        self._start = compiled.views.qpos.copy()
        self.spec = compiled.spec
        self.boxes = dict(zip(compiled.objects, compiled.boxes, strict=True))

    @by_one_thread
    def continue_from(self, before: World) -> None:
        """Go on at the time and in the state of another world, which has the same vehicles.

        Objects that both worlds have keep their poses and velocities; other objects are at their start. Sensors with
        other settings start now; all images are rendered anew.
        """
        c, b = self._compiled, before._compiled
        for name in (*self.vehicle_names, *self.boxes):
            if name in before.vehicle_names or name in before.boxes:
                _, qpos, dof = c.engine.body(name)
                _, old_qpos, old_dof = b.engine.body(name)
                c.views.qpos[qpos : qpos + 7] = b.views.qpos[old_qpos : old_qpos + 7]
                c.views.qvel[dof : dof + 6] = b.views.qvel[old_dof : old_dof + 6]
        for name, column, old in zip(State._fields, c.state, b.state, strict=True):
            if not name.startswith("shape_"):
                column[:] = old
        self._tick, self._seed = before._tick, before._seed
        self._light, self._held = before._light, dict(before._held)
        self._controls.restore(before._controls.save())
        self._referee.restore(before._referee.save())
        c.engine.update()
        observe(c.model, c.state, c.views)
        for name, sensors in c.sensors.items():
            sensors.continue_from(b.sensors[name], self._seed, c.model.shapes, c.state, self._tick * self._substeps)
        if self._cameras is not None:
            self._cameras.reset(self._seed)
        self._show(is_moved=True)

    @by_one_thread
    def set_driving_mode(self, vehicle: str, is_autonomous: bool) -> None:
        """Let a script (True) or a person (False) drive; the World itself obeys all commands given to `step`."""
        check_flag(is_autonomous, f"the driving mode of vehicle '{vehicle}'")
        self._controls.vehicles[self._controls.index(vehicle)].is_autonomous = bool(is_autonomous)
        self._show()

    @by_one_thread
    def hold(self, vehicle: str, position: Vector | None, orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Hold a vehicle at rest at a pose (position [m], quaternion wxyz of any length), from the next tick on.

        None lets it go. Raises `CommandError` for values that are not a pose.
        """
        self._controls.index(vehicle)
        if position is None:
            self._held.pop(vehicle, None)
            return
        try:
            pose = self._checked_pose(vehicle, [*position, *orientation])
        except (CommandError, TypeError):
            raise CommandError(f"vehicle '{vehicle}' cannot be held at {position}, {orientation}: not a pose") from None
        self._held[vehicle] = tuple(pose.tolist())

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
        """Day (True) or night (False), whatever the time of day."""
        check_flag(enabled, "the scene light")
        self._set_light(Light(bool(enabled)))

    @by_one_thread
    def set_time_of_day(self, time_of_day: float | None, scale: float = 0.0) -> None:
        """Let the light follow a time of day [s since midnight] from now on; None keeps it, at first noon.

        `scale`: seconds of the day per simulated second. Raises `CommandError` if a value is not finite.
        """
        now = self.time_of_day if time_of_day is None else time_of_day
        now = 0.5 * DAY_LENGTH if now is None else now
        if not (is_number(now) and is_number(scale, MAX_TIME_SCALE)):
            raise CommandError(
                f"a time of day and its scale must be finite numbers, the scale at most {MAX_TIME_SCALE:g}, "
                f"not {now} and {scale}"
            )
        self._set_light(Light(self._light.is_on, float(now) % DAY_LENGTH, float(scale), self.time))

    def _set_light(self, light: Light) -> None:
        before = self.scene_light, self.time_of_day
        self._light = light
        self._show(is_moved=before != (self.scene_light, self.time_of_day))

    @by_one_thread
    def save(self) -> Snapshot:
        """Everything that the future depends on. Can be pickled, also for another process."""
        c = self._compiled
        saved = Snapshot(
            world=self._identity,
            contents="",
            tick=self._tick,
            seed=self._seed,
            engine=c.engine.save(),
            state=State(*(column.copy() for column in c.state)),
            referee=self._referee.save(),
            sensors={name: sensors.save() for name, sensors in c.sensors.items()},
            cameras=self._cameras and self._cameras.save(),
            controls=self._controls.save(),
            light=self._light,
            held=dict(self._held),
            frame=self.frame,
        )
        return saved._replace(contents=saved.outline())

    @by_one_thread
    def restore(self, saved: Snapshot) -> Frame:
        """Go back to the state of `save`, of this world or another of the same scenario: the same future, bit for bit.

        Raises `SnapshotError` if the snapshot is of another scenario or has been changed; then nothing has changed.
        """
        self._check(saved)
        c = self._compiled
        c.engine.restore(saved.engine)
        self._tick, self._seed, self.frame = saved.tick, saved.seed, saved.frame
        c.contacts.impulse[:] = 0.0
        c.contacts.pair_count[0] = 0
        for column, kept in zip(c.state, saved.state, strict=True):
            column[:] = kept
        self._referee.restore(saved.referee)
        for name, sensors in c.sensors.items():
            sensors.restore(saved.sensors[name])
        if self._cameras is not None:
            self._cameras.restore(saved.cameras)
        self._controls.restore(saved.controls)
        self._light, self._held = saved.light, dict(saved.held)
        return self.frame

    def _check(self, saved: object) -> None:
        """Raises `SnapshotError` unless it is an unchanged snapshot that fits this world."""
        if not isinstance(saved, Snapshot):
            raise SnapshotError(f"restore() needs a Snapshot, which save() returns, not {type(saved).__name__}")
        if saved.world != self._identity:
            raise SnapshotError(
                "the snapshot is of another world: scenario, vehicles, map, sensors and version of the engine must be "
                f"the same as in this world of map '{self.spec.map}'"
            )
        if saved.contents != saved.outline():
            raise SnapshotError("the snapshot has been changed since save(); give restore() what save() returned")
        if saved.cameras is None and self._cameras is not None and self._cameras.save() is not None:
            raise SnapshotError("the snapshot is of a world without cameras; save it in a world with cameras")

    # -- views and cameras ---------------------------------------------------------------------------------------

    def vehicle(self, name: str) -> VehicleView:
        """A read-only view of one vehicle's state, for prompts and tests."""
        return VehicleView(self._compiled.state, self._controls.index(name))

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
            self.frame = seen if seen is self.frame else replace(seen, events=())
        return self.frame

    @by_one_thread
    def close(self) -> None:
        """Release the camera renderer; a world without cameras holds nothing."""
        if self._cameras is not None:
            self._cameras.close()

    # -- parts of a tick -----------------------------------------------------------------------------------------

    def _noun(self, name: str) -> str:
        return f"object '{name}'" if name in self.boxes else f"vehicle '{name}'"

    def _check_name(self, name: object) -> None:
        """Raises `CommandError` if there is no vehicle or object of that name."""
        if not (isinstance(name, str) and name in self.boxes):
            self._controls.index(name)  # pyright: ignore[reportArgumentType]

    def _checked_pose(self, name: str, pose: Any) -> Floats:
        """As an array with a quaternion of length 1. Raises `CommandError`."""
        values = list(pose) if isinstance(pose, Sequence | np.ndarray) and np.ndim(pose) == 1 else []
        if len(values) == 7 and all(is_number(value, MAX_DISTANCE) for value in values):
            checked = np.array(values, dtype=np.float64)
            length = math.hypot(*checked[3:].tolist())
            if abs(length - 1.0) > 1e-9:  # otherwise a pose of this world keeps its bits
                checked[3:] /= max(length, 1e-300)
            if length > 1e-6:
                return checked
        raise CommandError(
            f"{self._noun(name)} cannot be placed at {reprlib.repr(pose)}: a pose is x, y, z [m] up to "
            f"{MAX_DISTANCE:g} and a quaternion wxyz"
        )

    def _write_poses(self, poses: Mapping[str, Floats]) -> None:
        c = self._compiled
        for name, pose in poses.items():
            qpos = c.engine.body(name)[1]
            c.views.qpos[qpos : qpos + 7] = pose
        c.engine.update()

    def _hold_vehicles(self) -> None:
        """Put the vehicles that are held back to their poses, at rest."""
        if not self._held:
            return
        c = self._compiled
        for vehicle, pose in self._held.items():
            row = c.model.vehicles[self._controls.index(vehicle)]
            qpos, dof = int(row["qpos"]), int(row["dof"])
            c.views.qpos[qpos : qpos + 7] = pose
            c.views.qvel[dof : dof + 6] = 0.0
        c.engine.update()
        observe(c.model, c.state, c.views)

    def _sample(self) -> None:
        c = self._compiled
        for sensors in c.sensors.values():
            sensors.sample(c.model.shapes, c.state, self._tick * self._substeps)

    def _show(self, events: tuple[Event, ...] = (), *, is_moved: bool = False) -> Frame:
        """Make the current Frame, with camera images; `is_moved`: changed by hand, so that all images are outdated."""
        time = self.time
        frame = self._frames.build(
            self._tick, time, self._controls.vehicles, self._referee.collision_counts, events, *self._light.at(time)
        )
        self.frame = frame if self._cameras is None else self._cameras.update(frame, redraw=is_moved)
        return self.frame


class Light(NamedTuple):
    """The light of a scene."""

    is_on: bool
    """Day or night, without a time of day."""
    time_of_day: float | None = None
    """At the simulated time `since` [s since midnight]."""
    scale: float = 0.0
    """Seconds of the day per simulated second."""
    since: float = 0.0
    """[s]."""

    def at(self, time: float) -> tuple[bool, float | None]:
        """At the simulated time [s]: day (True) or night, and the time since midnight [s], None if it is fixed."""
        if self.time_of_day is None:
            return self.is_on, None
        time_of_day = (self.time_of_day + self.scale * (time - self.since)) % DAY_LENGTH
        return is_day_at(time_of_day), time_of_day


class Snapshot(NamedTuple):
    """The saved state of a World."""

    world: str
    """Identity of the world, the same for all worlds that the snapshot fits."""
    contents: str
    """The `outline` when it was saved."""
    tick: int
    seed: int
    engine: Any
    state: State
    referee: Any
    sensors: dict[str, Any]
    cameras: Any
    controls: Sequence[VehicleControls]
    light: Light
    held: dict[str, tuple[float, ...]]
    frame: Frame

    def outline(self) -> str:
        """Hash of all types, names, numbers and texts, and of the shapes of arrays, but not of their values."""
        parts = [
            text
            for field, value in zip(self._fields, self, strict=True)
            if field != "contents"
            for text in _outline(value)
        ]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _identity(c: Compiled) -> str:
    """Hash of everything that a snapshot must have in common with a world."""
    tables = c.model.vehicles.tolist(), c.model.wheels.tolist()
    parts = c.engine.identity, c.spec.tick, c.spec.command_timeout, c.configured, tables
    return hashlib.sha256(repr(parts).encode() + c.map.drivable_edges.tobytes()).hexdigest()


def _outline(value: Any) -> Iterator[str]:
    """See `Snapshot.outline`; of a message, which cannot be changed, and of types of other packages the type counts."""
    kind = type(value)
    if kind in _PLAIN:
        yield repr(value)
        return
    yield kind.__name__
    if kind is np.ndarray:
        yield f"{value.dtype.str} {value.shape}"
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield repr(key)
            yield from _outline(item)
    elif isinstance(value, tuple | list):
        yield str(len(value))
        for part in value:
            yield from _outline(part)
    elif dataclasses.is_dataclass(value):
        yield from _outline(vars(value))


_PLAIN = {type(None), bool, int, float, str}


def _overlaps(c: Compiled, name: str) -> str:
    """Names of the things that a vehicle or an object overlaps."""
    pairs = [{c.owners[a], c.owners[b]} for a, b in c.engine.overlapping()]
    return ", ".join(sorted({f"'{other}'" for pair in pairs if name in pair for other in pair - {name}}))
