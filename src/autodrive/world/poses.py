"""The poses of the vehicles and objects of a World: read, checked, changed and held."""

from __future__ import annotations

import contextlib
import math
import reprlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError
from autodrive.base.transforms import (
    Quaternion,
    Vector,
    compose,
    inverse,
    rotation_vector,
)
from autodrive.physics.engine import AWAKE
from autodrive.physics.tick import observe, place
from autodrive.protocol.commands import MAX_DISTANCE, is_number
from autodrive.world.compile import CompiledScenario
from autodrive.world.controls import Controls


class Held(NamedTuple):
    """A vehicle that is held, and how it moved to where it is held."""

    pose: tuple[float, ...]
    velocity: tuple[float, ...]
    """Velocity as in `State.qvel`, shape (6,): from the former pose to this one, in the time of the former hold."""
    moves_for: int
    """The vehicle has this velocity for so many ticks."""
    age: int
    """Number of ticks for which it has been held at this pose."""


class Poses:
    """The poses of a world. A pose is a position [m] and a quaternion wxyz, shape (7,)."""

    def __init__(self, compiled: CompiledScenario, controls: Controls) -> None:
        self._compiled = compiled
        self._controls = controls
        self.initial: Floats = compiled.engine.start
        """`State.qpos` after a reset."""
        self.held: dict[str, Held] = {}
        """The vehicles that are held."""
        self._standing = compiled.standing

    def noun(self, name: str) -> str:
        """Kind and name of a vehicle or an object for messages, such as "vehicle 'V1'"."""
        return f"object '{name}'" if name in self._compiled.objects else f"vehicle '{name}'"

    def check_name(self, name: object) -> None:
        """Raises `CommandError` if there is no vehicle or object of that name."""
        if not (isinstance(name, str) and name in self._compiled.objects):
            self._controls.index(name)  # pyright: ignore[reportArgumentType]

    def get(self, name: str) -> Floats:
        """A copy of the pose of a vehicle or an object. Raises `CommandError`."""
        self.check_name(name)
        qpos = self._compiled.engine.body(name)[1]
        return self._compiled.state.qpos[qpos : qpos + 7].copy()

    def on_ground(self, name: str, x: float, y: float, yaw: float) -> Floats:
        """The pose of a vehicle or an object on the ground. Raises `CommandError`."""
        self.check_name(name)
        if not all(is_number(value, MAX_DISTANCE) for value in (x, y, yaw)):
            raise CommandError(
                f"{self.noun(name)} cannot be placed at x={x}, y={y}, yaw={yaw}: they must be numbers from "
                f"{-MAX_DISTANCE:g} to {MAX_DISTANCE:g}"
            )
        return np.array(self._standing[name](float(x), float(y), float(yaw)))

    def at_start(self, seed: int, poses: Mapping[str, Sequence[float]] | None) -> Floats:
        """`State.qpos` at the start with that seed; `poses`: see `World.reset`.

        Raises `CommandError` for a pose that is wrong or overlaps something.
        """
        placed: dict[str, Floats] = {}
        if poses is not None and not isinstance(poses, Mapping):
            raise CommandError(f"poses must be a dictionary with x, y, yaw for each name, not {reprlib.repr(poses)}")
        for name, pose in (poses or {}).items():
            if not isinstance(pose, Sequence | np.ndarray) or isinstance(pose, str) or len(pose) != 3:
                raise CommandError(f"the pose of '{name}' must be x, y [m] and yaw [rad], not {reprlib.repr(pose)}")
            placed[name] = self.on_ground(name, *pose)
        fleet = self._compiled.fleet
        if fleet.names:  # the traffic starts away from other vehicles and objects
            others: list[tuple[float, float]] = []
            for name in self._standing:
                if name not in fleet.names:
                    qpos = self._compiled.engine.body(name)[1]
                    x, y = placed.get(name, self.initial[qpos : qpos + 2])[:2]
                    others.append((float(x), float(y)))
            starts = fleet.start_poses(seed, others)
            placed = {name: self.on_ground(name, *pose) for name, pose in starts.items()} | placed
        return self._checked_start(placed) if placed else self.initial

    def _checked_start(self, poses: Mapping[str, Floats]) -> Floats:
        """`initial` with these poses instead. Raises `CommandError` if one overlaps something."""
        c = self._compiled
        start = self.initial.copy()
        for name, pose in poses.items():
            qpos = c.engine.body(name)[1]
            start[qpos : qpos + 7] = pose
        before = c.state.qpos.copy(), c.state.asleep.copy()
        c.state.qpos[:] = start
        place(c.model, c.state, c.views)
        try:
            for name in poses:
                self._check_is_free(name)
        finally:
            c.state.qpos[:], c.state.asleep[:] = before
            observe(c.model, c.state)
        return start

    def place(self, poses: Mapping[str, Floats]) -> None:
        """Place vehicles and objects, at rest, at these poses. Raises `CommandError`; then nothing has moved."""
        c = self._compiled
        if not isinstance(poses, Mapping):
            raise CommandError(f"poses must be a dictionary with a pose for each name, not {reprlib.repr(poses)}")
        for name in poses:
            self.check_name(name)
        poses = {name: self._checked(name, pose) for name, pose in poses.items()}
        before = c.state.qpos.copy(), c.state.asleep.copy()
        for name, pose in poses.items():
            qpos = c.engine.body(name)[1]
            c.state.qpos[qpos : qpos + 7] = pose
        place(c.model, c.state, c.views)
        try:
            for name in poses:
                self._check_is_free(name)
        except CommandError:
            c.state.qpos[:], c.state.asleep[:] = before
            observe(c.model, c.state)
            raise
        for name in poses:
            dof = c.engine.body(name)[2]
            c.state.qvel[dof : dof + 6] = 0.0
            if name not in c.objects:
                i = self._controls.index(name)
                for column in ("angular_velocity", "force", "lagged_slip", "hold"):
                    getattr(c.state, f"wheel_{column}")[4 * i : 4 * i + 4] = 0.0
        observe(c.model, c.state)

    def place_at_first(self, choices: Mapping[str, Sequence[tuple[float, float, float]]]) -> list[str]:
        """Place vehicles together at their first poses on the ground (x, y [m], yaw [rad]), if all of these are free.

        Else each one goes to the first of its poses that is free. Returns the vehicles that were placed.
        """
        with contextlib.suppress(CommandError):
            self.place({name: self.on_ground(name, *poses[0]) for name, poses in choices.items()})
            return list(choices)
        placed: list[str] = []
        for name, poses in choices.items():
            for pose in poses:
                with contextlib.suppress(CommandError):  # the place is taken
                    self.place({name: self.on_ground(name, *pose)})
                    placed.append(name)
                    break
        return placed

    def hold(self, vehicle: str, position: Vector | None, orientation: Quaternion) -> None:
        """Hold a vehicle at a pose, or end the hold; see `World.hold`. Raises `CommandError`."""
        self._controls.index(vehicle)
        c, before = self._compiled, self.held.get(vehicle)
        if position is None:
            if self.held.pop(vehicle, None):
                c.state.asleep[:] = AWAKE
            return
        try:
            pose = self._checked(vehicle, [*position, *orientation])
        except (CommandError, TypeError):
            raise CommandError(f"vehicle '{vehicle}' cannot be held at {position}, {orientation}: not a pose") from None
        velocity, ticks = np.zeros(6), 0
        if before is not None:
            ticks = max(1, before.age)
            seconds = ticks * c.spec.tick
            velocity[:3] = (pose[:3] - before.pose[:3]) / seconds
            turn = compose(inverse(np.array(before.pose[3:])), pose[3:])
            velocity[3:] = np.divide(rotation_vector(turn), seconds)
        if before is None or velocity.any():
            c.state.asleep[:] = AWAKE  # what stands on the vehicle loses its support
        self.held[vehicle] = Held(tuple(pose.tolist()), tuple(velocity.tolist()), ticks, age=0)

    def save(self) -> dict[str, Held]:
        """The vehicles that are held, for `restore`."""
        return dict(self.held)

    def restore(self, saved: Mapping[str, Held]) -> None:
        """Hold the vehicles that `save` returned."""
        self.held = dict(saved)

    def apply_held(self) -> None:
        """Put the vehicles that are held back to their poses."""
        c = self._compiled
        for vehicle, held in self.held.items():
            row = c.model.vehicles[self._controls.index(vehicle)]
            qpos, dof = int(row["qpos"]), int(row["dof"])
            c.state.qpos[qpos : qpos + 7] = held.pose
            c.state.qvel[dof : dof + 6] = held.velocity if held.age < held.moves_for else 0.0
            self.held[vehicle] = held._replace(age=held.age + 1)
        observe(c.model, c.state)

    def _check_is_free(self, name: str) -> None:
        """Raises `CommandError` if a vehicle or an object overlaps something where it is in the engine."""
        if others := _overlaps(self._compiled, name):
            x, y = (float(f"{value:.6g}") for value in self.get(name)[:2])
            raise CommandError(f"{self.noun(name)} cannot be placed at x={x}, y={y}: it would overlap {others}")

    def _checked(self, name: str, pose: Any) -> Floats:
        """The pose as an array (position [m], quaternion wxyz of length 1), shape (7,). Raises `CommandError`."""
        is_row = isinstance(pose, Sequence) or (isinstance(pose, np.ndarray) and pose.ndim == 1)
        values = list(pose) if is_row else []
        if len(values) == 7 and all(is_number(value, MAX_DISTANCE) for value in values):
            checked = np.array(values, dtype=np.float64)
            length = math.hypot(*checked[3:].tolist())
            if abs(length - 1.0) > 1e-9:  # otherwise a pose of this world keeps its bits
                checked[3:] /= max(length, 1e-300)
            if length > 1e-6:
                return checked
        raise CommandError(
            f"{self.noun(name)} cannot be placed at {reprlib.repr(pose)}: a pose is x, y, z [m] up to "
            f"{MAX_DISTANCE:g} and a quaternion wxyz"
        )


def overlapping(c: CompiledScenario, qpos: Floats | None = None) -> list[tuple[str, str]]:
    """Names of the things that overlap: now, or if the bodies were placed at `qpos`."""
    return [(c.owners[a], c.owners[b]) for a, b in c.engine.overlapping(qpos)]


def _overlaps(c: CompiledScenario, name: str) -> str:
    """Names of the things that a vehicle or an object overlaps."""
    pairs = [set(pair) for pair in overlapping(c)]
    return ", ".join(sorted({f"'{other}'" for pair in pairs if name in pair for other in pair - {name}}))
