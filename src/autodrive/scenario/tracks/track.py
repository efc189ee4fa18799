"""A race track: centre line, race line and the faces of its barriers, and its YAML file."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, model_validator

from autodrive.base import specs
from autodrive.base.arrays import Floats, read_only_copy
from autodrive.base.cache import write_file
from autodrive.base.elementary import atan2
from autodrive.base.errors import SpecError
from autodrive.base.specs import Length, Spec
from autodrive.scenario.tracks import points as by_points
from autodrive.scenario.tracks.line import ClosedLine, closed_line, nearest_on_line, point_on_line
from autodrive.scenario.tracks.shape import edges_of, steps, walls_along

MAX_POINTS = 20_000
"""Most points of the centre line, of the race line, and of all walls of a track."""
MAX_WALLS = 1000
POINT_GAP = 1e-3
"""Least distance of neighbouring points [m]."""
MAX_COORDINATE = 1e4
"""[m]."""

Pose: TypeAlias = tuple[float, float, float]
"""x [m], y [m], heading [rad]."""


class BarrierSpec(Spec):
    """What stands along the edges of a track, behind the faces that `Track.walls` gives."""

    kind: Literal["wall", "duct"] = "wall"
    """'duct': a flexible air duct on the floor, as on RoboRacer tracks; its solid shape is the box around it."""
    width: Length = 0.1
    """Thickness of a wall, or diameter of a duct [m]. It is thinner where another face is behind it."""
    height: Length = 0.33
    """[m]; for a duct its diameter."""
    length: Length | None = None
    """Length of one duct [m]; left out: without end."""
    gap: float = Field(default=0.0, ge=0.0, le=10.0)
    """Gap between two ducts [m], through which LIDAR beams pass."""

    @model_validator(mode="after")
    def _fits(self) -> BarrierSpec:
        if self.kind == "wall" and (self.length is not None or self.gap):
            raise ValueError("length and gap are for ducts; a wall has no length or gap")
        if self.gap and self.length is None:
            raise ValueError("a gap needs the length of a duct")
        return self


DUCT = BarrierSpec(kind="duct", width=0.33, height=0.33, length=3.0, gap=0.03)
"""Air ducts of 0.33 m, 3 m long, with gaps of 3 cm."""


def _numbers(row: Any) -> Any:
    """The numbers of a row such as '0.0 1.0 0.5 0.5'."""
    if not isinstance(row, str):
        return row
    try:
        return tuple(map(float, row.replace(",", " ").split()))
    except ValueError:
        raise ValueError(f"expected numbers with spaces between them, found '{row[:50]}'") from None


def _row_text(row: Iterable[float]) -> str:
    return " ".join(map(_number, row))


_Number: TypeAlias = Annotated[float, Field(ge=-1e6, le=1e6)]
_TEXT = PlainSerializer(_row_text, return_type=str, when_used="json")
_Row4: TypeAlias = Annotated[tuple[_Number, _Number, _Number, _Number], BeforeValidator(_numbers), _TEXT]
_Row7: TypeAlias = Annotated[
    tuple[_Number, _Number, _Number, _Number, _Number, _Number, _Number], BeforeValidator(_numbers), _TEXT
]
_Row3: TypeAlias = Annotated[tuple[_Number, _Number, _Number], BeforeValidator(_numbers), _TEXT]
_Row2: TypeAlias = Annotated[tuple[_Number, _Number], BeforeValidator(_numbers), _TEXT]


class TrackSpec(Spec):
    """The file of a track. A row of numbers is a text with spaces between them, such as '0.0 1.0 0.5 0.5'."""

    title: str = ""
    note: str = ""
    is_draft: bool = False
    """True: it is being built; what is wrong with its `points` is a warning."""
    barrier: BarrierSpec = BarrierSpec()
    centre_line: Annotated[tuple[_Row4, ...], Field(min_length=4, max_length=MAX_POINTS)] = ()
    """x [m], y [m], width to the right [m], width to the left [m]; closed, the first point is not repeated."""
    points: Annotated[tuple[_Row2, ...], Field(min_length=by_points.MIN_POINTS, max_length=by_points.MAX_POINTS)] = ()
    """Points x [m], y [m] of a smooth closed line in driving direction, instead of centre line and walls. The start
    line goes through the first one, which is not repeated."""
    width: float | None = Field(default=None, ge=0.2, le=50.0)
    """Width of a track by points, between the barriers [m]."""
    race_line: Annotated[tuple[_Row7, ...], Field(max_length=MAX_POINTS)] = ()
    """s [m], x [m], y [m], psi [rad], kappa [1/m], vx [m/s], ax [m/s^2]."""
    walls: Annotated[
        tuple[Annotated[tuple[_Row2, ...], Field(min_length=3, max_length=MAX_POINTS)], ...],
        Field(max_length=MAX_WALLS),
    ] = ()
    """Closed lines along the faces of the barriers: x [m], y [m]; the free side is on the left."""
    checkpoints: Annotated[tuple[_Row4, ...], Field(min_length=3, max_length=1000)] = ()
    """Checkpoints in driving order, instead of those that the rules of a race place: x [m], y [m] of the middle,
    heading psi [rad], width across [m]. The first is the finish line; it is at the start line."""
    start: _Row3 | None = None
    """Where the centre of the rear axle of a vehicle without a pose starts that has no other vehicle beside it: x [m],
    y [m], heading psi [rad]. Left out, and of several vehicles: behind the start line."""

    @model_validator(mode="after")
    def _is_valid(self) -> TrackSpec:
        if errors := _wrong_points(self) or _problems(*_arrays(self)):
            raise specs.RuleError(errors)
        return self


@dataclass(frozen=True, eq=False)
class Track:
    """A closed track in the map frame [m]; the start line goes through the first point of the centre line.

    Raises `SpecError` if an array has the wrong shape or impossible values. The arrays are read-only copies.
    """

    name: str
    centre_line: Floats
    """x [m], y [m], width to the right [m], width to the left [m], shape (n, 4), in driving direction; closed, the
    first point is not repeated."""
    race_line: Floats | None = None
    """s [m], x [m], y [m], heading psi [rad], curvature kappa [1/m], speed vx [m/s], acceleration ax [m/s^2], shape
    (m, 7); s starts at 0 at the start line; closed, the first point is not repeated."""
    walls: tuple[Floats, ...] = ()
    """Faces of the barriers as closed lines, shape (k, 2) each; the free side is on the left."""
    title: str = ""
    note: str = ""
    barrier: BarrierSpec = field(default_factory=BarrierSpec)
    checkpoints: Floats | None = None
    """x [m], y [m], heading psi [rad], width across [m] of each checkpoint in driving order, shape (c, 4); the first is
    the finish line. None: the rules of a race place them."""
    start: Pose | None = None
    """Where a single vehicle starts; None: behind the start line, as several vehicles do."""

    def __post_init__(self) -> None:
        def array(values: Any) -> Floats:
            return read_only_copy(np.ascontiguousarray(values, np.float64))

        object.__setattr__(self, "centre_line", array(self.centre_line))
        object.__setattr__(self, "race_line", None if self.race_line is None else array(self.race_line))
        object.__setattr__(self, "walls", tuple(map(array, self.walls)))
        object.__setattr__(self, "checkpoints", None if self.checkpoints is None else array(self.checkpoints))
        errors = [
            f"{place[0]}{''.join(f'[{part}]' for part in place[1:])}: {text}"
            for place, text in _problems(self.centre_line, self.race_line, self.walls, self.checkpoints)
        ]
        if errors:
            raise SpecError([f"track '{self.name}': {error}" for error in errors])

    def __repr__(self) -> str:
        width = self.centre_line[:, 2:].sum(axis=1)
        race_line = "no race line" if self.race_line is None else "a race line"
        return (
            f"<Track '{self.name}' of {self.length:.1f} m: {width.min():.2f} to {width.max():.2f} m wide, "
            f"{len(self.walls)} walls, {race_line}>"
        )

    @classmethod
    def load(cls, name: str | Path) -> Track:
        """The track of that name, or of that YAML file. Raises `SpecError` with all errors."""
        from autodrive.scenario import kinds  # noqa: PLC0415  compiling needs no files

        path = kinds.find("track", name)
        return cls.of(kinds.read("track", path, TrackSpec), path.stem)

    @classmethod
    def of(cls, spec: TrackSpec, name: str) -> Track:
        """The track of the contents of a file."""
        centre_line, race_line, walls, checkpoints = _arrays(spec)
        return cls(name, centre_line, race_line, walls, spec.title, spec.note, spec.barrier, checkpoints, spec.start)

    def save(self, path: str | Path) -> None:
        """Write the YAML file; `Track.load` of it returns the same numbers."""
        write_file(Path(path), self.text())

    def text(self) -> str:
        """The contents of the YAML file."""
        barrier = ", ".join(f"{key}: {value}" for key, value in self.barrier.model_dump(exclude_none=True).items())
        lines = [f"{key}: {_quoted(value)}" for key, value in (("title", self.title), ("note", self.note)) if value]
        lines += [f"barrier: {{{barrier}}}", "centre_line:  # x y width_right width_left [m]"]
        lines += _rows(self.centre_line, "  ")
        if self.race_line is not None:
            lines += ["race_line:  # s x y psi kappa vx ax", *_rows(self.race_line, "  ")]
        lines += [f"start: {_row_text(self.start)}  # x y psi"] if self.start else []
        if self.checkpoints is not None:
            lines += ["checkpoints:  # x y psi width; the first is the finish line", *_rows(self.checkpoints, "  ")]
        lines += ["walls:  # x y [m]; the free side is on the left"] if self.walls else []
        for wall in self.walls:
            first, *others = _rows(wall, "    ")
            lines += [f"  - {first.lstrip()}", *others]
        return "\n".join(lines) + "\n"

    @cached_property
    def length(self) -> float:
        """Length of the centre line [m]."""
        return float(self.line.along[-1])

    @property
    def start_pose(self) -> Pose:
        """Pose on the centre line at the start line."""
        return self.pose_at(0.0)

    def pose_at(self, s: float, lateral: float = 0.0) -> Pose:
        """Position and heading at the distance `s` [m] along the centre line, `lateral` [m] to the left of it."""
        x, y, dx, dy = point_on_line(self.line, s)
        return x - lateral * dy, y + lateral * dx, atan2(dy, dx)

    def project(self, x: float, y: float) -> tuple[float, float]:
        """Distance s [m] along the centre line of its point nearest to x, y, and how far x, y is to the left of it.

        s is from 0 up to `length`. Takes about 2 us.
        """
        return nearest_on_line(self.line, float(x), float(y))

    def widths_at(self, s: float) -> tuple[float, float]:
        """Width of the track to the right and to the left of the centre line [m]."""
        at = s % self.length
        along, rows = self.line.along, self.centre_line
        i = min(max(int(np.searchsorted(along, at, side="right")) - 1, 0), len(rows) - 1)
        f = (at - along[i]) / (along[i + 1] - along[i])
        right, left = (1.0 - f) * rows[i, 2:] + f * rows[(i + 1) % len(rows), 2:]
        return float(right), float(left)

    def grid_pose(self, place: int, vehicles: int = 1) -> Pose:
        """Where the vehicle in that place, from 0, starts: behind the start line, in two rows if there are several.

        The pose is that of the centre of the rear axle, with room for 0.5 m of the vehicle in front of it. A single
        vehicle starts at `start`, if the track has one.
        """
        if vehicles == 1 and self.start is not None:
            return self.start
        back = GRID_FRONT + GRID_STEP * place
        right, left = self.widths_at(-back)
        if vehicles == 1:
            return self.pose_at(-back)
        return self.pose_at(-back, left / 2.0 if place % 2 == 0 else -right / 2.0)

    @cached_property
    def line(self) -> ClosedLine:
        """The centre line for compiled functions."""
        return closed_line(self.centre_line[:, :2])

    @cached_property
    def edges(self) -> tuple[Floats, Floats]:
        """Right and left edge: the centre line, moved by its widths, shape (n, 2) each."""
        return edges_of(self.centre_line)


GRID_FRONT, GRID_STEP = 0.5, 0.8
"""Distance of the first rear axle from the start line, and between places on the grid, along the centre line [m]."""


def _arrays(spec: TrackSpec) -> tuple[Floats, Floats | None, tuple[Floats, ...], Floats | None]:
    """Centre line, race line, walls and checkpoints of a file."""
    race_line = np.array(spec.race_line) if spec.race_line else None
    checkpoints = np.array(spec.checkpoints) if spec.checkpoints else None
    if spec.width is not None:
        rows = by_points.centre_line(np.array(spec.points), spec.width)
        return rows, race_line, walls_along(rows), checkpoints
    return np.array(spec.centre_line), race_line, tuple(map(np.array, spec.walls)), checkpoints


def _wrong_points(spec: TrackSpec) -> list[specs.Rule]:
    """Which keys do not belong together, and which points cannot be used."""
    if not spec.points:
        errors: list[specs.Rule] = [(("centre_line",), "is required; or give points and a width")]
        errors = [] if spec.centre_line else errors
        return (
            [*errors, (("width",), "is for a track with points; a centre line contains widths")]
            if spec.width
            else errors
        )
    names = [name for name in ("centre_line", "walls") if getattr(spec, name)]
    errors = [((name,), f"is computed from the points: leave out {name}") for name in names]
    errors += [] if spec.width else [(("width",), "is required with points")]
    points = np.array(spec.points)
    if np.abs(points).max() > by_points.REACH:
        errors.append((("points",), f"positions must be at most {by_points.REACH:g} m"))
    if len(near := np.flatnonzero(steps(points) < by_points.POINT_GAP)):
        text = f"neighbouring points must be at least {by_points.POINT_GAP * 100:g} cm apart"
        errors.append((("points", int(near[0])), text))
    return errors


def _problems(
    centre_line: Floats, race_line: Floats | None, walls: tuple[Floats, ...], checkpoints: Floats | None
) -> list[specs.Rule]:
    """What is wrong with the arrays of a track, and where."""
    errors: list[specs.Rule] = []
    arrays: list[tuple[tuple[str | int, ...], Floats, int, int]] = [(("centre_line",), centre_line, 4, 4)]
    arrays += [(("race_line",), race_line, 4, 7)] if race_line is not None else []
    arrays += [(("walls", i), wall, 3, 2) for i, wall in enumerate(walls)]
    arrays += [(("checkpoints",), checkpoints, 3, 4)] if checkpoints is not None else []
    for place, rows, least, columns in arrays:
        if len(rows) > MAX_POINTS:
            errors.append((place, f"must have at most {MAX_POINTS} points, not {len(rows)}"))
        if rows.ndim != 2 or rows.shape[1] != columns or len(rows) < least:
            errors.append((place, f"must have at least {least} rows of {columns} numbers; its shape is {rows.shape}"))
            continue
        points = rows[:, 1:3] if columns == 7 else rows[:, :2]
        if not np.isfinite(rows).all() or np.abs(points).max() > MAX_COORDINATE:
            errors.append((place, f"all numbers must be finite and positions at most {MAX_COORDINATE:g} m"))
            continue
        near = np.flatnonzero(steps(points) < POINT_GAP)
        if len(near):
            last = int(near[0]) == len(rows) - 1
            mistake = (
                "the first point must not be repeated at the end" if last else "the next point is at the same place"
            )
            errors.append(((*place, int(near[0])), f"{mistake}: neighbouring points must be at least 1 mm apart"))
    if not errors and (narrow := np.flatnonzero((centre_line[:, 2:] <= 0.0).any(axis=1))).size:
        errors.append((("centre_line", int(narrow[0])), "the widths to the right and to the left must be above 0"))
    if not errors and checkpoints is not None and (narrow := np.flatnonzero(checkpoints[:, 3] <= 0.0)).size:
        errors.append((("checkpoints", int(narrow[0])), "the width must be above 0"))
    if not errors and race_line is not None and not np.all(np.diff(race_line[:, 0]) > 0.0):
        row = int(np.flatnonzero(np.diff(race_line[:, 0]) <= 0.0)[0]) + 1
        errors.append((("race_line", row), "s must increase from row to row"))
    return errors


def _rows(rows: Floats, indent: str) -> list[str]:
    return [f"{indent}- {_row_text(row)}" for row in rows.tolist()]


def _number(value: float) -> str:
    """The shortest text with the same value."""
    return repr(value + 0.0).removesuffix(".0") if math.isfinite(value) else str(value)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
