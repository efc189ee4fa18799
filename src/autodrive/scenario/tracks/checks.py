"""Checks that a track can be driven: start line, direction, crossings, walls, width, and the race line."""

from __future__ import annotations

import math

import numpy as np
import shapely

from autodrive.base.arrays import Floats
from autodrive.scenario.tracks.shape import crossings, heading, steps
from autodrive.scenario.tracks.track import Track

WIDTH_MIN = 0.9
"""A narrower place is reported [m]."""
WIDTH_ERROR = 0.15
"""A greater difference between the widths of the file and the distance to the walls is reported [m]."""
VARIATION = 4.0
"""A greater ratio of the greatest and the least width is reported."""
NO_WALLS = "there are no walls; `autodrive import track LINE.csv` makes walls along the rows of a centre line"
TOO_WIDE = "the width is greater than the bend or the distance to another part of the track allows"
START_ERROR = 0.5
"""A first checkpoint farther from the start line is an error [m]."""
PSI_ERROR = math.radians(10.0)
"""A greater mean difference between psi and the direction of the points is reported [rad]."""


def track_errors(track: Track, *, has_map: bool = True) -> list[str]:
    """What makes the track impossible to drive. `has_map`: its walls are those of a map, not the edges of its line."""
    points = track.centre_line[:, :2]
    errors = [
        f"the centre line crosses itself at ({x:.2f}, {y:.2f}); a track is flat and has no bridge"
        for x, y in crossings((points,))[:3]
    ]
    if not errors:
        text = "" if has_map else f": {TOO_WIDE}, so that the edges cross"
        errors += [
            f"walls cross or touch each other at ({x:.2f}, {y:.2f}){text}" for x, y in crossings(track.walls)[:3]
        ]
    errors += checkpoint_errors(track)
    x, y, _ = track.start_pose
    if not track.walls:
        errors.append(NO_WALLS)
    else:
        faces = shapely.multilinestrings([shapely.LinearRing(wall) for wall in track.walls])
        blocked = np.flatnonzero(shapely.intersects(faces, _segments(points)))
        if len(blocked):
            i = int(blocked[0])
            where = "the start line is" if i == 0 else f"point {i} of the centre line is"
            text = "the centre line meets a wall" if has_map else f"{TOO_WIDE}, so that an edge crosses the centre line"
            errors.append(f"{where} at a wall: {text} near ({points[i, 0]:.2f}, {points[i, 1]:.2f})")
        elif not _is_free(track, x, y):
            errors.append(f"the start line at ({x:.2f}, {y:.2f}) is inside a wall or outside of the track")
    return errors


def checkpoint_errors(track: Track) -> list[str]:
    """Which checkpoint of a track is not where its number says."""
    if track.checkpoints is None:
        return []
    first, *others = (track.project(x, y)[0] for x, y in track.checkpoints[:, :2].tolist())
    if (away := min(first, track.length - first)) > START_ERROR:
        return [f"the first checkpoint must be at the start line, not {away:.2f} m from it along the centre line"]
    at = [0.0, *others]
    late = [i for i in range(1, len(at)) if at[i] <= at[i - 1]]
    return [f"checkpoint {i + 1} must be after checkpoint {i} along the centre line" for i in late[:3]]


def track_warnings(track: Track) -> list[str]:
    """What is probably a mistake, but can be driven."""
    warnings: list[str] = []
    points, widths = track.centre_line[:, :2], track.centre_line[:, 2:]
    gaps = steps(points)
    if gaps.max() > 5.0 * np.median(gaps) + 0.5:
        i = int(np.argmax(gaps))
        where = "the last and the first point" if i == len(points) - 1 else f"points {i} and {i + 1}"
        warnings.append(
            f"centre line: {where} are {gaps[i]:.2f} m apart, other neighbouring points {np.median(gaps):.2f} m"
        )
    total = widths.sum(axis=1)
    if total.min() < WIDTH_MIN:
        i = int(np.argmin(total))
        warnings.append(f"the track is only {total[i]:.2f} m wide at ({points[i, 0]:.2f}, {points[i, 1]:.2f})")
    if total.max() > VARIATION * total.min():
        text = f"the width varies from {total.min():.2f} to {total.max():.2f} m"
        warnings.append(f"{text}: the walls may be other walls than those of the track, or may have openings")
    if track.walls:
        faces = shapely.multilinestrings([shapely.LinearRing(wall) for wall in track.walls])
        away = shapely.distance(faces, shapely.points(points))
        difference = np.abs(away - widths.min(axis=1))
        if np.median(difference) > WIDTH_ERROR:
            warnings.append(
                f"the widths of the centre line and the walls differ by {np.median(difference):.2f} m (median): the "
                "map and the centre line may have different scales or origins"
            )
    if track.race_line is not None:
        warnings += race_line_warnings(track.race_line, track)
    return warnings


def race_line_warnings(rows: Floats, track: Track) -> list[str]:
    """What is wrong with the race line of a track."""
    warnings: list[str] = []
    if runs_against(rows, track):
        warnings.append("the race line runs against the direction of the centre line")
    right, left = zip(*(track.widths_at(s) for s, _ in placed(rows, track)), strict=True)
    lateral = np.array([lateral for _, lateral in placed(rows, track)])
    outside = np.flatnonzero((lateral > np.array(left)) | (lateral < -np.array(right)))
    if len(outside):
        x, y = rows[outside[0], 1:3]
        warnings.append(f"the race line leaves the track at {len(outside)} points, first at ({x:.2f}, {y:.2f})")
    if text := psi_problem(rows):
        warnings.append(text)
    return warnings


def placed(rows: Floats, track: Track) -> list[tuple[float, float]]:
    """S and lateral offset of the points of a race line [m]."""
    return [track.project(x, y) for x, y in rows[:, 1:3].tolist()]


def runs_against(rows: Floats, track: Track) -> bool:
    """Whether a race line has the opposite direction of its centre line."""
    at = np.array([s for s, _ in placed(rows, track)])
    forward = np.remainder(np.diff(at) + track.length / 2.0, track.length) - track.length / 2.0
    return bool(np.median(forward) < 0.0)


def psi_problem(rows: Floats) -> str:
    """How the column psi differs from the direction of the points; '' if it does not."""
    psi, true = rows[:, 3], heading(rows[:, 1:3])
    conventions = {
        "": psi,
        "from +y, counter-clockwise": psi + math.pi / 2.0,
        "from +y, clockwise": math.pi / 2.0 - psi,
        "from +x, clockwise": -psi,
        "against the driving direction": psi + math.pi,
        "in degrees": np.radians(psi),
    }
    errors = {name: _mean_angle(angle - true) for name, angle in conventions.items()}
    best = min(errors, key=lambda name: errors[name])
    if errors[""] <= PSI_ERROR:
        return ""
    fitting = f"; the values of psi fit angles {best}" if errors[best] <= PSI_ERROR else ""
    return (
        f"psi differs from the direction of the points by {math.degrees(errors['']):.0f} degrees on average{fitting}. "
        "psi must be the heading from +x, counter-clockwise, in radians"
    )


def _mean_angle(angles: Floats) -> float:
    return float(np.abs(np.remainder(angles + math.pi, 2.0 * math.pi) - math.pi).mean())


def _segments(points: Floats) -> Floats:
    return shapely.linestrings(np.stack([points, np.roll(points, -1, axis=0)], axis=1))  # type: ignore[return-value]


def _is_free(track: Track, x: float, y: float) -> bool:
    """Whether a point is inside an odd number of closed walls, which it is between an outer and its inner walls."""
    return sum(shapely.Polygon(wall).buffer(0).contains(shapely.Point(x, y)) for wall in track.walls) % 2 == 1
