"""Imports tracks from ROS map_server files, folders of f1tenth_racetracks, and centre lines, and exports them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from autodrive.base.arrays import Floats
from autodrive.base.cache import make_folder
from autodrive.base.errors import SpecError
from autodrive.base.specs import is_yaml
from autodrive.base.suggest import suggesting
from autodrive.scenario.tracks import checks
from autodrive.scenario.tracks.areas import track_area
from autodrive.scenario.tracks.line import closed_line
from autodrive.scenario.tracks.middle_line import SPACING, inner_wall, middle_line
from autodrive.scenario.tracks.ros_map import RosMap, read_picture, read_ros_map, ros_map_of, write_ros_map
from autodrive.scenario.tracks.shape import crossings, edges_of, heading, simplified, steps, walls_along
from autodrive.scenario.tracks.tables import read_centre_line, read_race_line, write_centre_line, write_race_line
from autodrive.scenario.tracks.track import MAX_POINTS, MAX_WALLS, POINT_GAP, BarrierSpec, Track

DENSE = 0.04
"""Points that are nearer to each other than this [m] are replaced by others: their noise would bend the walls."""
LEAST_AREA = 1e-8
"""Least area of an obstacle [m^2]."""
LEAST_HOLE = 0.01
"""Smaller holes between edges that cross are no infield [m^2]."""


@suggesting
@dataclass(frozen=True)
class ImportOptions:
    """How a track is imported."""

    name: str = ""
    """Name of the track; left out: that of the folder or file."""
    tolerance: float = 0.02
    """Largest distance of a wall from the contour in the image [m]."""
    width: float | None = None
    """Width of the track from edge to edge [m], for centre lines without widths."""
    gap: float = 0.0
    """Openings of the walls in a map that are narrower than this are closed [m], such as gaps between air ducts."""
    barrier: BarrierSpec = field(default_factory=BarrierSpec)
    start: tuple[float, float] | None = None
    """A point near the start line [m]; left out: the first point of the centre line."""
    is_reversed: bool = False
    """True: the track is driven in the other direction."""
    resolution: float | None = None
    """Edge of a pixel [m], of a picture without the YAML file of map_server."""


@dataclass(frozen=True)
class Sources:
    """The files that a track comes from."""

    name: str
    map: Path | None = None
    centre_line: Path | None = None
    race_line: Path | None = None
    picture: Path | None = None
    """A picture of the track, instead of all other files."""

    @property
    def files(self) -> list[Path]:
        """All files of the track that there are."""
        files = (self.map, self.centre_line, self.race_line, self.picture)
        return [file for file in files if file is not None]


def find_sources(path: Path) -> Sources:
    """The files of a folder, or the one file. Raises `SpecError`."""
    if path.is_dir():

        def only_file(*patterns: str) -> Path | None:
            files = [file for pattern in patterns for file in sorted(path.glob(pattern))]
            if len(files) > 1 and len({*files}) > 1:
                name = path.resolve().name
                same = [file for file in files if file.name in [pattern.replace("*", name) for pattern in patterns]]
                same = same or [file for file in files if file.name.startswith(f"{name}_")]
                if len({*same}) != 1:
                    names = ", ".join(file.name for file in files)
                    raise SpecError([f"the folder has several tracks: {names}. Name one of the files"], str(path))
                return same[0]
            return files[0] if files else None

        map_ = only_file("*_map.yaml") or only_file("*.yaml")
        sources = Sources(path.resolve().name, map_, only_file("*_centerline.csv"), only_file("*_raceline.csv"))
        if sources.map is None and sources.centre_line is None:
            raise SpecError(["the folder has neither NAME_map.yaml nor NAME_centerline.csv"], str(path))
        return sources
    if not path.is_file():
        raise SpecError([f"'{path}' {'is not a file' if path.exists() else 'does not exist'}"])
    if is_yaml(path):
        return Sources(path.stem.removesuffix("_map"), map=path)
    if path.suffix.lower() in {".csv", ".txt"}:
        return Sources(path.stem.removesuffix("_centerline"), centre_line=path)
    if path.suffix.lower() in {".png", ".pgm"}:
        return Sources(path.stem.removesuffix("_map"), picture=path)
    text = (
        f"'{path.name}' is not a track: expected a folder, a .yaml file of map_server, a picture "
        "(.png, .pgm) with the resolution, or a .csv file of a centre line"
    )
    raise SpecError([text])


def import_track(path: Path, options: ImportOptions | None = None) -> tuple[Track, list[str]]:
    """The track of a file or folder, and warnings about probable mistakes. Raises `SpecError` with all errors."""
    options = options or ImportOptions()
    sources = find_sources(path)
    warnings: list[str] = []
    if options.resolution is not None and sources.picture is None:
        raise SpecError(
            ["the resolution is for a picture without a YAML file; this track states its resolution"], str(path)
        )
    ros_map = read_ros_map(sources.map) if sources.map else None
    if sources.picture:
        ros_map = read_picture(sources.picture, options.resolution)
    rows: Floats | None = None
    if sources.centre_line:
        rows = _cleaned(read_centre_line(sources.centre_line, options.width, warnings), sources.centre_line, warnings)
    race = _race_line(sources.race_line, warnings) if sources.race_line else None
    return _track(options.name or sources.name, ros_map, rows, race, options, warnings, str(path)), warnings


def import_picture(
    picture: bytes, text: str, options: ImportOptions, *, start: tuple[float, float] | None = None
) -> tuple[Track, list[str]]:
    """The track of the picture of a map, PNG or PGM, and the text of its YAML file of map_server; as `import_track`.

    `start`: that of the options, but in pixels from the upper left corner of the picture to the right and down.
    """
    warnings: list[str] = []
    ros_map = ros_map_of(text, picture)
    if start is not None:
        right, down = start
        ((x, y),) = ros_map.metres(np.array([[right, len(ros_map.occupancy) - down]])).tolist()
        options = replace(options, start=(x, y))
    return _track(options.name or "track", ros_map, None, None, options, warnings, "the picture"), warnings


def _track(
    name: str,
    ros_map: RosMap | None,
    rows: Floats | None,
    race: Floats | None,
    options: ImportOptions,
    warnings: list[str],
    path: str,
) -> Track:
    """The track of a map, a centre line `rows`, or both, and perhaps a race line; adds to the warnings."""
    line = rows[:, :2] if rows is not None else race[:, 1:3] if race is not None else None
    walls: tuple[Floats, ...] = ()
    try:
        if ros_map is not None:
            walls = _walls(ros_map, line, options, warnings)
        if rows is None:
            rows = middle_line(walls)
            text = "the direction is a guess" if options.start else "direction and start line are guesses"
            if race is not None:
                rows, text = _along(rows, race), "direction and start line are those of the race line"
            warnings.append(
                f"the file has no centre line: the middle between the walls becomes the centre line; {text}"
            )
    except SpecError as error:
        raise SpecError(error.errors, path) from None
    rows = _turned(rows, options)
    if options.start is not None:
        warnings += _far_start(rows[0], options.start)
    if not walls:
        walls = _edges(rows, min(options.tolerance, 0.01), warnings)
    track = Track(name, np.round(rows, 4) + 0.0, None, walls, title=name, barrier=options.barrier)
    errors = checks.track_errors(track, has_map=ros_map is not None)
    if errors:
        raise SpecError([f"track '{name}': {error}" for error in errors], path)
    if race is not None:
        track = _with_race_line(track, race, warnings)
    warnings += checks.track_warnings(track)
    return track


def export_files(track: Track, folder: Path) -> list[Path]:
    """NAME_map.png, NAME_map.yaml, NAME_centerline.csv and, if the track has one, NAME_raceline.csv."""
    ends = ["map.png", "map.yaml", "centerline.csv", *([] if track.race_line is None else ["raceline.csv"])]
    return [folder / f"{track.name}_{end}" for end in ends]


def export_track(track: Track, folder: Path, *, resolution: float = 0.05) -> list[Path]:
    """Write the files `export_files`, and return them; in the map, the gaps between ducts are closed."""
    make_folder(folder)
    files = export_files(track, folder)
    solid, free = solid_and_free(track, resolution)
    write_ros_map(folder, track.name, solid, free, resolution=resolution)
    write_centre_line(files[2], track.centre_line)
    if track.race_line is not None:
        write_race_line(files[3], track.race_line)
    return files


def solid_and_free(track: Track, resolution: float) -> tuple[BaseGeometry, BaseGeometry]:
    """The barriers without gaps, at least two pixels of `resolution` [m] thick, and the area between them."""
    right, left = (shapely.Polygon(edge).buffer(0) for edge in track.edges)
    free = shapely.symmetric_difference(right, left)
    if track.walls:
        # the walls of a draft may cross themselves
        rings = (shapely.make_valid(shapely.Polygon(wall)) for wall in track.walls)
        free = functools.reduce(shapely.symmetric_difference, rings)
    return shapely.difference(shapely.buffer(free, max(track.barrier.width, 2.0 * resolution)), free), free


def _walls(ros_map: RosMap, line: Floats | None, options: ImportOptions, warnings: list[str]) -> tuple[Floats, ...]:
    """The contours around the track, the outer one first, in the map frame; adds to the warnings.

    `line`: places on the track, shape (n, 2) [m], in driving direction.
    """
    warnings += [ros_map.warning] if ros_map.warning else []
    if yaw := ros_map.yaw:
        warnings.append(f"the map is turned by {math.degrees(yaw):.4g} degrees, as origin states")
    place: BaseGeometry | None = None
    if line is not None:
        place = shapely.LinearRing([ros_map.pixels(x, y) for x, y in line.tolist()])
    elif options.start is not None:
        place = shapely.Point(ros_map.pixels(*options.start))
    area, reasons = track_area(ros_map, place, options.gap)
    if area is None:
        x, y = line[0] if line is not None else options.start or (0.0, 0.0)
        hint = "the start point is on a wall or outside of the track"
        if line is not None:
            hint = "the map and the centre line have different origins, or negate is wrong"
        raise SpecError([f"the map is not free at ({x:.2f}, {y:.2f}), where the start line is: {hint}"])
    walls = _lines_around(area, ros_map, options.tolerance)
    warnings += reasons if line is not None else [*reasons, *_obstacles(walls)]
    return walls


def _lines_around(area: shapely.Polygon, ros_map: RosMap, tolerance: float) -> tuple[Floats, ...]:
    """The outer line around an area, and the inner ones, in the map frame, at most `tolerance` [m] away from them.

    They are nearer if they would cross otherwise.
    """
    oriented = orient(area)
    if len(oriented.interiors) >= MAX_WALLS:
        text = f"the map has {len(oriented.interiors) + 1} separate walls; a track has at most {MAX_WALLS}"
        raise SpecError([f"{text}: remove the specks from the image"])
    lines = [ros_map.metres(shapely.get_coordinates(ring)[:-1]) for ring in (oriented.exterior, *oriented.interiors)]
    walls: tuple[Floats, ...] = ()
    for share in (1.0, 0.5, 0.25, 0.1):
        simple = [_simplified(line, share * tolerance) for line in lines]
        walls = tuple(line for line in simple if len(line) >= 3 and shapely.Polygon(line).area > LEAST_AREA)
        if not crossings(walls):
            break
    return walls


def _simplified(line: Floats, tolerance: float) -> Floats:
    """A line with fewer points, see `simplified`, of which none is too near to the next one."""
    points = simplified(line, tolerance)
    return points[steps(points) >= 2.0 * POINT_GAP] + 0.0


def _obstacles(walls: tuple[Floats, ...]) -> list[str]:
    """A warning about the walls that are neither the outer nor the inner one."""
    inner = inner_wall(walls)
    sizes = [(float(np.ptp(wall, axis=0).max()), wall) for k, wall in enumerate(walls) if k not in (0, inner)]
    if not sizes:
        return []
    size, wall = max(sizes, key=lambda sized: sized[0])
    x, y = wall.mean(axis=0)
    count = f"{len(sizes)} obstacle{'s' if len(sizes) > 1 else ''}"
    text = f"the map has {count} between the walls, the largest one {size:.2g} m long, at ({x:.2f}, {y:.2f})"
    return [f"{text}: the centre line leads past the obstacles; remove noise from the image"]


def _far_start(first: Floats, start: tuple[float, float]) -> list[str]:
    """A warning if the start line, at the row `first` of the centre line, does not go past the wanted start."""
    distance = math.hypot(first[0] - start[0], first[1] - start[1])
    if distance <= max(first[2:]):
        return []
    x, y = first[:2]
    text = f"the start point ({start[0]:.2f}, {start[1]:.2f}) is not on the way around the track: the start line is"
    return [f"{text} at ({x:.2f}, {y:.2f}), {distance:.2f} m from the start point"]


def _edges(rows: Floats, tolerance: float, warnings: list[str]) -> tuple[Floats, ...]:
    """The walls along a centre line; if its edges cross, those around the area between them, with a warning."""
    walls = walls_along(rows, tolerance)
    places = crossings(walls)
    if not places or crossings((rows[:, :2],)):
        return walls
    right, left = edges_of(rows)
    corners: Any = np.stack([right, left, np.roll(left, -1, axis=0), np.roll(right, -1, axis=0)], axis=1)
    area = shapely.union_all(shapely.convex_hull(shapely.multipoints(corners)))
    holes = [hole for hole in shapely.get_rings(area)[1:] if shapely.Polygon(hole).area > LEAST_HOLE]
    if not isinstance(area, shapely.Polygon) or len(holes) != 1:
        return walls
    x, y = places[0]
    text = f"the edges of the track cross, first at ({x:.2f}, {y:.2f}): the width is greater than the bends allow"
    warnings.append(f"{text}. The walls are around the area between the edges")
    oriented = orient(shapely.Polygon(area.exterior, holes))
    outlines = oriented.exterior, *oriented.interiors
    return tuple(_simplified(shapely.get_coordinates(outline)[:-1], tolerance) for outline in outlines)


def _cleaned(rows: Floats, path: Path, warnings: list[str]) -> Floats:
    """The points without those that are equal to the one before; the first one is not repeated."""
    gaps = steps(rows[:, :2])
    kept = rows[gaps >= 2.0 * POINT_GAP]
    if len(kept) < 4:
        raise SpecError(["the points of the centre line are all at the same place"], str(path))
    if gaps[-1] < 2.0 * POINT_GAP:
        warnings.append("the first point of the centre line was repeated at the end; the repeated point is left out")
        kept = rows[:-1][gaps[:-1] >= 2.0 * POINT_GAP]
    gap, usual = float(np.hypot(*(kept[0] - kept[-1])[:2])), float(np.median(gaps))
    if gap > 20.0 * usual + 1.0:
        text = (
            f"the centre line is not closed: its last point is {gap:.2f} m from its first point, other neighbouring "
            f"points are {usual:.2f} m apart"
        )
        raise SpecError([text], str(path))
    if (kept[:, 2:] <= 0.0).any():
        row = int(np.flatnonzero((kept[:, 2:] <= 0.0).any(axis=1))[0])
        raise SpecError([f"row {row + 1}: the widths to the right and to the left must be above 0"], str(path))
    spaced = _spaced(kept)
    if spaced is not kept:
        text = f"the centre line has {len(kept)} points, {100.0 * usual:.2g} cm apart"
        warnings.append(f"{text}: they are replaced by {len(spaced)} means of neighbouring points at equal distances")
    return spaced


def _spaced(rows: Floats) -> Floats:
    """The rows of a centre line, or means at equal distances if they are too dense or too many."""
    gap = float(np.median(steps(rows[:, :2])))
    if gap < DENSE:
        reach = min(round(SPACING / gap), len(rows) // 8)
        rows = np.mean([np.roll(rows, shift, axis=0) for shift in range(-reach, reach + 1)], axis=0)
    elif len(rows) <= MAX_POINTS:
        return rows
    along = closed_line(rows[:, :2]).along
    count = min(max(math.ceil(along[-1] / SPACING), 4), MAX_POINTS)
    at = np.linspace(0.0, along[-1], count, endpoint=False)
    return np.column_stack([np.interp(at, along, np.append(column, column[0])) for column in rows.T])


def _turned(rows: Floats, options: ImportOptions) -> Floats:
    """The centre line in the wanted direction, from the point that is nearest to the wanted start."""
    if options.is_reversed:
        rows = np.roll(rows[::-1][:, [0, 1, 3, 2]], 1, axis=0)
    if options.start is not None:
        first = int(np.argmin(np.hypot(rows[:, 0] - options.start[0], rows[:, 1] - options.start[1])))
        rows = np.roll(rows, -first, axis=0)
    return rows


def _along(rows: Floats, race: Floats) -> Floats:
    """The centre line in the direction of a race line, from its first point on."""
    points, race_points = rows[:, :2], race[:, 1:3]
    nearest = np.array([int(np.argmin(np.hypot(*(points - point).T))) for point in race_points])
    along = np.diff(nearest)
    forward = np.sum(along - len(rows) * np.round(along / len(rows)))
    start = float(race_points[0, 0]), float(race_points[0, 1])
    return _turned(rows, ImportOptions(start=start, is_reversed=bool(forward < 0)))


def _race_line(path: Path, warnings: list[str]) -> Floats:
    """The rows of the file, without a repeated first point."""
    rows = read_race_line(path)
    gaps = steps(rows[:, 1:3])
    if gaps[-1] < 2.0 * POINT_GAP:
        warnings.append("the first point of the race line was repeated at the end; the repeated point is left out")
        rows, gaps = rows[:-1], gaps[:-1]
    return rows[gaps >= 2.0 * POINT_GAP]


def _with_race_line(track: Track, rows: Floats, warnings: list[str]) -> Track:
    """The track with a race line that starts at its start line; a line in the other direction is left out."""
    if checks.runs_against(rows, track):
        warnings.append("the race line runs against the direction of the centre line; the race line is left out")
        return track
    if text := checks.psi_problem(rows):
        warnings.append(f"{text}; psi is computed from the points")
        rows = rows.copy()
        rows[:, 3] = heading(rows[:, 1:3])
    at = np.array([s for s, _ in checks.placed(rows, track)])
    rows = np.roll(rows, -int(np.argmin(at)), axis=0)
    rows[:, 0] = closed_line(rows[:, 1:3]).along[:-1]
    return replace(track, race_line=np.round(rows, 4) + 0.0)
