"""Applies an edit to a track by points, and shows it to clients."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from autodrive.base.errors import CommandError
from autodrive.base.specs import joined
from autodrive.protocol.messages import MAX_TEXT, EditTrack, GenerateTrack, TrackLine, UseMap
from autodrive.protocol.native import MapProblem, TrackScene
from autodrive.protocol.own_files import ImportTrack
from autodrive.scenario.descriptions import Specs
from autodrive.scenario.files import map_titles
from autodrive.scenario.maps.spec import DescribedMap
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.importer import ImportOptions, import_picture
from autodrive.scenario.tracks.points import TOLERANCE, faults, points_on
from autodrive.scenario.tracks.track import DUCT, BarrierSpec, Track, TrackSpec

if TYPE_CHECKING:
    from autodrive.world import World

NODES = 0.05
"""A random track is generated wider by this [m], because the line through its points is not quite its own."""
ABOUT = 0.15
"""Greatest distance of the line through the points from the random track [m]; `TOLERANCE` if that has faults."""


def edited_track(specs: Specs, edit: EditTrack | GenerateTrack) -> TrackSpec:
    """The track after an edit. Raises `AutodriveError`."""
    before = specs.map.spec_or_none if isinstance(specs.map.spec_or_none, TrackSpec) else None
    if isinstance(edit, GenerateTrack):
        return _generated(edit)
    now = line_of(specs.map)
    if edit.seen is not None and edit.seen != now:
        raise CommandError(
            "the track was changed by another client in the meantime: check the track, then repeat the edit"
        )
    track = edit.track
    if not all(map(math.isfinite, (track.width, *(value for point in track.points for value in point)))):
        raise CommandError("the points and the width of a track must be finite numbers")
    barrier = before.barrier if before and before.barrier.kind == track.barrier else _barrier(track.barrier)
    points = tuple((round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in track.points)
    title = before.title if before and before.title else "My track"
    return _spec(title, points, track.width, barrier)


def imported_track(edit: ImportTrack) -> tuple[UseMap, str]:
    """The edit that makes the track in a picture the map, and warnings, one a line. Raises `AutodriveError`."""
    options = ImportOptions(name=edit.name, gap=edit.gap, is_reversed=edit.is_reversed)
    track, warnings = import_picture(edit.picture, edit.text, options, start=edit.start)
    if len(text := track.text()) > MAX_TEXT:
        raise CommandError(f"the track has {len(text)} characters; at most {MAX_TEXT} are possible")
    return UseMap(text=text), "\n".join(warnings)


def line_of(described: DescribedMap) -> TrackLine | None:
    """The track by points, or a line by points near another track; None if the map is no track."""
    return _line(described) if isinstance(described.spec_or_none, TrackSpec) else None


def name_of_track_edit(edit: EditTrack, before: Specs) -> str:
    """The edit in a few words, for the button that undoes it."""
    was, track = line_of(before.map), edit.track
    if was is None:
        return "make a track"
    if was.width != track.width:
        return "change the width of the track"
    if was.barrier != track.barrier:
        return "change the barrier of the track"
    if more := len(track.points) - len(was.points):
        return f"{'add' if more > 0 else 'remove'} {'a point' if abs(more) == 1 else 'points'} of the track"
    moved = sum(a != b for a, b in zip(was.points, track.points, strict=True))
    return "move a point of the track" if moved == 1 else "change the track"


def vehicles_beside(world: World, spec: TrackSpec) -> list[str]:
    """Vehicles that a track does not carry: a corner is not between its edges."""
    track, beside = Track.of(spec, "track"), []
    for name, vehicle in world.vehicle_specs.items():
        x, y, _, w, _, _, z = world.pose(name).tolist()
        yaw = 2.0 * math.atan2(z, w)
        reach = math.hypot(*vehicle.size[:2])
        right, left = track.widths_at(track.project(x, y)[0])
        ahead = x + vehicle.wheelbase * math.cos(yaw), y + vehicle.wheelbase * math.sin(yaw)
        lateral = [track.project(*point)[1] for point in ((x, y), ahead)]
        if max(lateral) > left - 0.5 * reach or min(lateral) < 0.5 * reach - right:
            beside.append(name)
    return beside


def track_scene(world: World) -> TrackScene | None:
    """The track of a World as clients edit it; None for another map."""
    spec, line = world.specs.map.spec_or_none, line_of(world.specs.map)
    if not isinstance(spec, TrackSpec) or line is None:
        return None
    problems = [
        MapProblem(problem.kind, joined([problem.text], {})[0], *(problem.at or (0.0, 0.0)), [], {})
        for problem in world.compiled.map_problems
    ]
    return TrackScene(line, bool(spec.points), problems, map_titles())


@functools.lru_cache(maxsize=8)
def _line(described: DescribedMap) -> TrackLine:
    spec = described.spec
    assert isinstance(spec, TrackSpec)
    if spec.width is not None:
        return TrackLine(tuple((x, y) for x, y in spec.points), spec.width, spec.barrier.kind)
    rows = Track.of(spec, described.name).centre_line
    width = round(float(np.median(rows[:, 2:].sum(axis=1))), 2)
    return TrackLine(_pairs(points_on(rows[:, :2])), width, spec.barrier.kind)


def _generated(edit: GenerateTrack) -> TrackSpec:
    barrier = _barrier(edit.barrier)
    # room for many shapes: the track and its barriers cover a quarter of it
    covered = 4.0 * edit.length * (edit.width + NODES + barrier.width)
    side = max(math.sqrt(covered / 2.0), 2.0 * (2.0 * edit.width + NODES + barrier.width + 1.0))
    track = generate_track(
        edit.seed, length=edit.length, width=edit.width + NODES, area=(2.0 * side, side), barrier=barrier
    )
    lines = (points_on(track.centre_line[:, :2], tolerance) for tolerance in (ABOUT, TOLERANCE))
    points = next((points for points in lines if not faults(points, edit.width)), None)
    if points is None:
        raise CommandError(f"seed {edit.seed} gives no track of that length and width: take another seed")
    return _spec(f"Random track {edit.seed}", _pairs(points), edit.width, barrier)


def _spec(title: str, points: tuple[tuple[float, float], ...], width: float, barrier: BarrierSpec) -> TrackSpec:
    """The Spec of a track by points, as a file would have it: without the barrier if it is the usual one."""
    spec = TrackSpec(title=title, points=points, width=round(width, 3))
    return spec if barrier == spec.barrier else spec.model_copy(update={"barrier": barrier})


def _pairs(points: np.ndarray) -> tuple[tuple[float, float], ...]:
    return tuple((x, y) for x, y in points.tolist())


def _barrier(kind: Literal["wall", "duct"]) -> BarrierSpec:
    return DUCT if kind == "duct" else BarrierSpec()
