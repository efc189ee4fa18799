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

from autodrive.base.arrays import Floats
from autodrive.base.cache import make_folder
from autodrive.base.errors import SpecError
from autodrive.base.specs import is_yaml
from autodrive.base.suggest import suggesting
from autodrive.scenario.tracks import checks
from autodrive.scenario.tracks.contours import contours, free_area
from autodrive.scenario.tracks.line import closed_line
from autodrive.scenario.tracks.ros_map import RosMap, read_picture, read_ros_map, ros_map_of, write_ros_map
from autodrive.scenario.tracks.shape import heading, resampled, steps, straightest, walls_along
from autodrive.scenario.tracks.tables import read_centre_line, read_race_line, write_centre_line, write_race_line
from autodrive.scenario.tracks.track import POINT_GAP, BarrierSpec, Track

SPACING = 0.1
"""Distance of the points of a centre line that is computed from a map [m]; more on a track that is longer than 1 km."""
MAX_POINTS = 20_000
"""On both walls, for the computation of the centre line."""


@suggesting
@dataclass(frozen=True)
class ImportOptions:
    """How a track is imported."""

    name: str = ""
    """Of the track; left out: that of the folder or file."""
    tolerance: float = 0.02
    """Largest distance of a wall from the contour in the image [m]."""
    width: float | None = None
    """From edge to edge [m], for centre lines without widths."""
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
    """Instead of all others."""

    @property
    def files(self) -> list[Path]:
        """Those that there are."""
        files = (self.map, self.centre_line, self.race_line, self.picture)
        return [file for file in files if file is not None]


def find_sources(path: Path) -> Sources:
    """The files of a folder, or the one file. Raises `SpecError`."""
    if path.is_dir():

        def one(*patterns: str) -> Path | None:
            found = [file for pattern in patterns for file in sorted(path.glob(pattern))]
            if len(found) > 1 and len({*found}) > 1:
                name = path.resolve().name
                same = [file for file in found if file.name in [pattern.replace("*", name) for pattern in patterns]]
                same = same or [file for file in found if file.name.startswith(f"{name}_")]
                if len({*same}) != 1:
                    names = ", ".join(file.name for file in found)
                    raise SpecError([f"the folder has several tracks: {names}. Name one of the files"], str(path))
                return same[0]
            return found[0] if found else None

        map_ = one("*_map.yaml") or one("*.yaml")
        found = Sources(path.resolve().name, map_, one("*_centerline.csv"), one("*_raceline.csv"))
        if found.map is None and found.centre_line is None:
            raise SpecError(["the folder has neither NAME_map.yaml nor NAME_centerline.csv"], str(path))
        return found
    if not path.is_file():
        raise SpecError([f"'{path}' {'is not a file' if path.exists() else 'does not exist'}"])
    if is_yaml(path):
        return Sources(path.stem.removesuffix("_map"), map=path)
    if path.suffix.lower() in {".csv", ".txt"}:
        return Sources(path.stem.removesuffix("_centerline"), centre_line=path)
    if path.suffix.lower() in {".png", ".pgm"}:
        return Sources(path.stem.removesuffix("_map"), picture=path)
    text = (
        f"'{path.name}' is not a track: expected a folder, a .yaml file of map_server, its picture "
        "(.png, .pgm) with the resolution, or a .csv file of a centre line"
    )
    raise SpecError([text])


def import_track(path: Path, options: ImportOptions | None = None) -> tuple[Track, list[str]]:
    """The track of a file or folder, and warnings about probable mistakes. Raises `SpecError` with all errors."""
    options = options or ImportOptions()
    sources = find_sources(path)
    warnings: list[str] = []
    if options.resolution is not None and sources.picture is None:
        raise SpecError(["the resolution is for a picture without a YAML file; this track states its own"], str(path))
    ros_map = read_ros_map(sources.map) if sources.map else None
    if sources.picture:
        ros_map = read_picture(sources.picture, options.resolution)
    rows: Floats | None = None
    if sources.centre_line:
        rows = _cleaned(read_centre_line(sources.centre_line, options.width), sources.centre_line, warnings)
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
    walls: tuple[Floats, ...] = ()
    if ros_map is not None:
        if ros_map.warning:
            warnings.append(ros_map.warning)
        if ros_map.spec.origin[2:] and ros_map.spec.origin[2]:
            warnings.append(
                f"the map is turned by {math.degrees(ros_map.spec.origin[2]):.4g} degrees, as origin states"
            )
        known = rows[0] if rows is not None else race[0, 1:] if race is not None else None
        inside = options.start if known is None else (float(known[0]), float(known[1]))
        hint = "the map and the centre line have different origins, or negate is wrong"
        if known is None:
            hint = "the start point is on a wall or outside of the track"
        try:
            walls = _walls(ros_map, inside, options, hint)
        except SpecError as error:
            raise SpecError(error.errors, path) from None
    if rows is None:
        rows = _middle_line(walls, path)
        text = "direction and start line are guesses"
        if race is not None:
            rows, text = _along(rows, race), "direction and start line are those of the race line"
        warnings.append(f"the file has no centre line: it is the middle between the walls; {text}")
    rows = _turned(rows, options)
    if not walls:
        walls = walls_along(rows, min(options.tolerance, 0.01))
    track = Track(name, np.round(rows, 4) + 0.0, None, walls, title=name, barrier=options.barrier)
    errors = checks.track_errors(track)
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


def _walls(
    ros_map: RosMap, inside: tuple[float, float] | None, options: ImportOptions, hint: str
) -> tuple[Floats, ...]:
    """The contours around the free area that contains a point, in the map frame; `hint`: why it may not be free."""
    spec = ros_map.spec
    tolerance, gap = options.tolerance / spec.resolution, options.gap / spec.resolution
    if inside is None:
        # of the areas that are certainly free, the largest ring
        rings = free_area(contours(ros_map.occupancy, spec.free_thresh), None, tolerance, gap)
        place = shapely.Polygon(rings[0], rings[1:]).point_on_surface() if rings else None
    else:
        place = shapely.Point(ros_map.pixels(*inside))
    lines = contours(ros_map.occupancy, spec.occupied_thresh)
    found = free_area(lines, (place.x, place.y), tolerance, gap) if place else []
    if not found and inside:
        text = f"the map is not free at ({inside[0]:.2f}, {inside[1]:.2f}), where the start line is"
        raise SpecError([f"{text}: {hint}"])
    if not found:
        raise SpecError(["the map has no free area that is a ring; give a start point or a centre line"])
    return tuple(np.round(ros_map.metres(line), 4) + 0.0 for line in found)


def _cleaned(rows: Floats, path: Path, warnings: list[str]) -> Floats:
    """The points without those that are equal to the one before; the first one is not repeated."""
    gaps = steps(rows[:, :2])
    kept = rows[gaps >= 2.0 * POINT_GAP]
    if len(kept) < 4:
        raise SpecError(["the points of the centre line are all at the same place"], str(path))
    if gaps[-1] < 2.0 * POINT_GAP:
        warnings.append("the first point of the centre line was repeated at the end; it is left out there")
        kept = rows[:-1][gaps[:-1] >= 2.0 * POINT_GAP]
    gap, usual = float(np.hypot(*(kept[0] - kept[-1])[:2])), float(np.median(gaps))
    if gap > 20.0 * usual + 1.0:
        text = (
            f"the centre line is not closed: its last point is {gap:.2f} m from the first one, the others {usual:.2f} m"
        )
        raise SpecError([text], str(path))
    if (kept[:, 2:] <= 0.0).any():
        row = int(np.flatnonzero((kept[:, 2:] <= 0.0).any(axis=1))[0])
        raise SpecError([f"row {row + 1}: the widths to the right and to the left must be above 0"], str(path))
    return kept


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


def _middle_line(walls: tuple[Floats, ...], path: str) -> Floats:
    """The line between the outer wall and the largest inner one, counter-clockwise, with its distances to the walls.

    It consists of those borders of the Voronoi cells of points on the walls that have a point of the outer and one of
    the inner wall next to them.
    """
    rings = sorted((shapely.LinearRing(wall) for wall in walls), key=lambda ring: -shapely.Polygon(ring).area)
    if len(rings) < 2:
        raise SpecError(["the free area has no inner wall, so that the track is not a ring; give a centre line"], path)
    spacing = max(SPACING, sum(ring.length for ring in rings[:2]) / MAX_POINTS)
    outer, inner = (shapely.segmentize(ring, spacing) for ring in rings[:2])
    outer_points, inner_points = shapely.MultiPoint(_points(outer)), shapely.MultiPoint(_points(inner))
    borders = shapely.voronoi_polygons(shapely.union(outer_points, inner_points), only_edges=True)
    corners, border = shapely.get_coordinates(shapely.get_parts(borders), return_index=True)
    is_segment = border[1:] == border[:-1]
    segments = np.stack([corners[:-1], corners[1:]], axis=1)[is_segment]
    parts: Any = shapely.linestrings(segments)  # an array of them
    ends = shapely.points(shapely.get_coordinates(parts))
    outer_away, inner_away = (
        shapely.STRtree(shapely.get_parts(points)).query_nearest(ends, return_distance=True, all_matches=False)[1]
        for points in (outer_points, inner_points)
    )
    is_middle = (np.abs(outer_away - inner_away) < 1e-6).reshape(-1, 2).all(axis=1)
    area = shapely.polygonize(shapely.get_parts(shapely.node(shapely.union_all(parts[is_middle]))))
    if shapely.is_empty(area):
        raise SpecError(["no middle line was found between the walls; give a centre line"], path)
    ring = shapely.union_all(shapely.get_parts(area)).exterior  # type: ignore[attr-defined]
    points = _points(ring)
    if not ring.is_ccw:
        points = points[::-1]
    points = resampled(points, spacing)
    for _ in range(10):
        points = (np.roll(points, 1, axis=0) + 2.0 * points + np.roll(points, -1, axis=0)) / 4.0
    points = np.roll(points, -straightest(points, spacing), axis=0)
    places = shapely.points(points)
    return np.column_stack([points, shapely.distance(rings[0], places), shapely.distance(rings[1], places)])


def _points(line: BaseGeometry) -> Floats:
    return shapely.get_coordinates(line)[:-1]


def _race_line(path: Path, warnings: list[str]) -> Floats:
    """The rows of the file, without a repeated first point."""
    rows = read_race_line(path)
    gaps = steps(rows[:, 1:3])
    if gaps[-1] < 2.0 * POINT_GAP:
        warnings.append("the first point of the race line was repeated at the end; it is left out there")
        rows, gaps = rows[:-1], gaps[:-1]
    return rows[gaps >= 2.0 * POINT_GAP]


def _with_race_line(track: Track, rows: Floats, warnings: list[str]) -> Track:
    """The track with a race line that starts at its start line; a line in the other direction is left out."""
    if checks.runs_against(rows, track):
        warnings.append("the race line runs against the direction of the centre line; it is left out")
        return track
    if text := checks.psi_problem(rows):
        warnings.append(f"{text}; psi is computed from the points")
        rows = rows.copy()
        rows[:, 3] = heading(rows[:, 1:3])
    at = np.array([s for s, _ in checks.placed(rows, track)])
    rows = np.roll(rows, -int(np.argmin(at)), axis=0)
    rows[:, 0] = closed_line(rows[:, 1:3]).along[:-1]
    return replace(track, race_line=np.round(rows, 4) + 0.0)
