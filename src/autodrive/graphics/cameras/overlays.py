"""What is drawn over the image of a scene camera: drawings of programs, collision shapes, contact forces and axes."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.transforms import rotation_from_quaternion
from autodrive.graphics.render.strokes import STROKE, Strokes, dots, letters, lines
from autodrive.protocol.messages import WHEEL_NAMES

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.protocol.messages import Drawing, Frame
    from autodrive.protocol.native import CollisionShapes, ContactForces, Drawn, SetCamera, Shapes

LOOK: dict[str, Any] = json.loads((Path(__file__).parents[1] / "render" / "overlays.json").read_text(encoding="utf-8"))
"""Sizes [m], times [s] and colours, which the page reads from the same file."""
MAX_STROKES = 10_000
"""Most strokes of the drawings of programs."""
SPHERE, CYLINDER = 2, 5
NONE = np.zeros(0, STROKE)
UNMOVED = np.zeros(3), (1.0, 0.0, 0.0, 0.0)


class Marks(NamedTuple):
    """What a World knows beside its Frame."""

    drawings: Mapping[str, Drawn]
    shapes: Callable[[], Shapes]
    """Called only if they are shown."""
    contacts: Mapping[str, ContactForces]


def strokes_of_drawings(drawings: Iterable[Drawn], time: float) -> NDArray[np.void]:
    """Strokes of the drawings that have not disappeared at that simulated time [s]."""
    parts = [_of_drawing(drawn.drawing) for drawn in drawings if drawn.drawing and drawn.until > time]
    return np.concatenate([NONE, *parts])[:MAX_STROKES]


def _of_drawing(drawing: Drawing) -> NDArray[np.void]:
    points = np.array(drawing.points, np.float64)
    if drawing.kind == "points":
        return dots(points, drawing.color, drawing.size)
    if drawing.kind == "text":
        return letters(drawing.text, points[0], drawing.color, drawing.size)
    step = 1 if drawing.kind == "path" else 2
    n = len(points[1::step])
    return lines(points[:-1:step][:n], points[1::step], drawing.color, drawing.size)


class Overlays:
    """The overlays of one client: remembers for a moment what pushed the body of a vehicle."""

    def __init__(self) -> None:
        self._bumps: dict[tuple[str, str], tuple[float, NDArray[np.void]]] = {}

    def strokes(self, view: SetCamera, frame: Frame, marks: Marks, now: float) -> Strokes | None:
        """What `view` shows at wall time `now` [s]; None: nothing."""
        hidden, shown = [NONE], [NONE]
        if view.drawings and marks.drawings:
            hidden.append(strokes_of_drawings(marks.drawings.values(), frame.time))
        if view.shapes:
            hidden += self._fixed(view, frame, marks.shapes().fixed)
            shown += self._shapes(frame, marks.shapes())
        if view.axes:
            shown += self._axes(frame, marks.shapes())
        if view.force_scale:
            shown += self._forces(frame, marks.contacts, view.force_scale, now)
        strokes = Strokes(np.concatenate(hidden), np.concatenate(shown))
        return strokes if len(strokes.hidden) or len(strokes.shown) else None

    def _fixed(self, view: SetCamera, frame: Frame, fixed: CollisionShapes) -> Iterator[NDArray[np.void]]:
        followed = frame.vehicles.get(view.vehicle or next(iter(frame.vehicles), ""))
        if followed is not None:
            place, size = np.reshape(fixed.position, (-1, 3)), np.reshape(fixed.size, (-1, 3))
            far = np.linalg.norm(place - followed.pose.position, axis=1) - np.linalg.norm(size, axis=1)
            yield _outlines(fixed, LOOK["colours"]["fixed"], UNMOVED, np.flatnonzero(far < LOOK["near"]))

    def _shapes(self, frame: Frame, shapes: Shapes) -> Iterator[NDArray[np.void]]:
        for name, pose in _poses(frame):
            if name in shapes.bodies:
                tint = LOOK["colours"]["vehicle" if name in shapes.sensors else "object"]
                yield _outlines(shapes.bodies[name], tint, pose, np.arange(len(shapes.bodies[name].kind)))

    def _axes(self, frame: Frame, shapes: Shapes) -> Iterator[NDArray[np.void]]:
        for name, pose in _poses(frame):
            if name in shapes.sensors:
                yield from _axes_of(pose, pose, LOOK["axis"], name)
                for sensor, mount in shapes.sensors[name].items():
                    yield from _axes_of(pose, (mount.position, mount.orientation), LOOK["sensor_axis"], sensor)

    def _forces(
        self, frame: Frame, contacts: Mapping[str, ContactForces], scale: float, now: float
    ) -> Iterator[NDArray[np.void]]:
        self._bumps = {key: bump for key, bump in self._bumps.items() if bump[0] > now}
        for name, vehicle in frame.vehicles.items():
            if name not in contacts:
                continue
            touched, turn = contacts[name], _matrix(vehicle.pose.orientation)
            for part, place, force in zip(touched.parts, touched.position, touched.force, strict=True):
                at, along = vehicle.pose.position + turn @ place, turn @ force
                if part in WHEEL_NAMES:
                    yield _arrow(at, along, scale, LOOK["colours"]["wheel"])
                    continue
                above = at + turn @ (0.0, 0.0, 2.0 * LOOK["letter"])
                size = letters(f"{np.linalg.norm(force):.2g} N", above, LOOK["colours"]["body"], LOOK["letter"])
                drawn = np.concatenate([_arrow(at, along, scale, LOOK["colours"]["body"]), size])
                self._bumps[name, part] = now + LOOK["linger"], drawn
        for _, drawn in self._bumps.values():
            yield drawn


def _poses(frame: Frame) -> Iterator[tuple[str, tuple[Floats, Any]]]:
    """Position [m] and orientation of all bodies."""
    for name, body in (*frame.vehicles.items(), *frame.objects.items()):
        yield name, (body.pose.position, body.pose.orientation)


def _matrix(orientation: Any) -> Floats:
    return np.reshape(rotation_from_quaternion(orientation), (3, 3))


def _axes_of(body: tuple[Floats, Any], own: tuple[Floats, Any], length: float, name: str) -> Iterator[NDArray[np.void]]:
    """The axes of a body, or of a sensor at `own` in its frame, and its name above them."""
    turn, at = _matrix(body[1]), np.asarray(body[0])
    up = turn @ (0.0, 0.0, 1.1 * length + LOOK["letter"])
    if own is not body:
        at, turn = at + turn @ own[0], turn @ _matrix(own[1])
    for tint, axis in zip(LOOK["colours"]["axes"], turn.T, strict=True):
        yield lines(at[None], (at + length * axis)[None], tint, LOOK["width"])
    yield letters(name, at + up, LOOK["colours"]["name"], LOOK["letter"])


def _arrow(begin: Floats, force: Floats, scale: float, tint: Any) -> NDArray[np.void]:
    """An arrow along a force [N]; `scale`: the force of an arrow of the length `arrow` [N]."""
    size = float(np.linalg.norm(force))
    if size == 0.0:
        return NONE
    along = force / size
    length = min(size / scale * LOOK["arrow"], LOOK["longest"])
    aside = np.cross((0.0, 0.0, 1.0), along)
    aside = aside / np.linalg.norm(aside) if np.linalg.norm(aside) > 1e-3 else np.array((0.0, 1.0, 0.0))
    tip, head = begin + length * along, min(0.3 * length, 0.02)
    sides = [aside, np.cross(along, aside), -aside, -np.cross(along, aside)]
    ends = np.array([begin, *(tip - head * along + 0.5 * head * side for side in sides)])
    return lines(np.tile(tip, (5, 1)), ends, tint, 2.0 * LOOK["width"])


def _outlines(
    shapes: CollisionShapes, tint: Any, body: tuple[Floats, Any], chosen: NDArray[np.intp]
) -> NDArray[np.void]:
    """The edges of the chosen shapes of a body."""
    turn = _matrix(body[1])
    place, size = np.reshape(shapes.position, (-1, 3)), np.reshape(shapes.size, (-1, 3))
    own_turn = np.reshape(shapes.rotation, (-1, 3, 3))
    ends = [_edges(int(shapes.kind[i]), *size[i]) @ own_turn[i].T + place[i] for i in chosen]
    if not ends:
        return NONE
    begin, end = np.moveaxis(np.concatenate(ends) @ turn.T + body[0], 1, 0)
    return lines(begin, end, tint, LOOK["width"])


def _edges(kind: int, a: float, b: float, c: float) -> Floats:
    """Begin and end of the lines that show a shape, in its own axes, shape (n, 2, 3); sizes as in `CollisionShapes`."""
    if kind == SPHERE:
        return np.concatenate([a * _CIRCLE[..., order] for order in ((0, 1, 2), (0, 2, 1), (2, 0, 1))])
    if kind == CYLINDER:
        rings = [_CIRCLE * (a, a, 0.0) + (0.0, 0.0, z) for z in (-b, b)]
        return np.concatenate([*rings, _SIDES * (a, a, b)])
    return _BOX * (a, b, c)


def _circle() -> Floats:
    angles = np.linspace(0.0, 2.0 * math.pi, LOOK["around"] + 1)
    ring = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(len(angles))))
    return np.stack((ring[:-1], ring[1:]), axis=1)


def _sides() -> Floats:
    angles = 2.0 * math.pi * np.arange(LOOK["sides"]) / LOOK["sides"]
    return np.array([[(math.cos(angle), math.sin(angle), z) for z in (-1.0, 1.0)] for angle in angles])


def _box() -> Floats:
    corners = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    return np.array([(p, q) for i, p in enumerate(corners) for q in corners[i + 1 :] if np.abs(p - q).sum() == 2.0])


_CIRCLE, _SIDES, _BOX = _circle(), _sides(), _box()
