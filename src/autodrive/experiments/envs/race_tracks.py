"""Random race tracks side by side in one map, so that each episode of a batch can be on another one."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.cache import cache_folder, check_writable, make_folder, write_file
from autodrive.base.elementary import atan2
from autodrive.base.errors import AutodriveError, SpecError
from autodrive.experiments.envs.path import table
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.track import Pose, Track

AREA = 20.0, 10.0
"""Of the ground of each track [m] if nothing is chosen. A longer track on it has more and tighter curves."""
APART = 12.0
"""Between the grounds of two tracks [m]: farther than a LIDAR of the car sees."""
ROWS = 16
"""Tracks above each other; the next ones are beside them."""
DRAWS = 20
"""Of width, length and radius of a track, until one fits on its ground."""
SPACING = 0.05
"""Of the points of the centre lines [m], about."""


class RaceTracks:
    """`count` tracks with the seeds `seed`, `seed` + 1, ... The map is a file in the cache.

    Where the cache cannot be written, the map is in a temporary folder until this process ends.

    `width`: between the barriers, `length`, and `radius`: least of the centre line in curves [m]; of each the least and
    the greatest: each track has its own. `radius` None: see `generate_track`. `area`: of the ground of each track [m].
    Raises `SpecError` if no track fits.
    """

    def __init__(
        self,
        count: int,
        seed: int,
        width: tuple[float, float],
        length: tuple[float, float],
        radius: tuple[float, float] | None,
        area: tuple[float, float] = AREA,
    ) -> None:
        ranges = (width, length) if radius is None else (width, length, radius)
        folder = cache_folder("race_tracks", "scenario/tracks", also=f"{count} {seed} {ranges} {area} {APART} {ROWS}")
        if not _is_complete(folder, count):
            folder = _writable(folder)
        if not _is_complete(folder, count):
            write_tracks(count, seed, ranges, area, folder)
        self.file, *files = _files(folder, count)
        """The map. Its road and its start line are those of the first track; it has the barriers of all."""
        tracks = [Track.load(file) for file in files]
        self.length = np.array([track.length for track in tracks])
        """Of the centre lines [m], shape (n,)."""
        self.count = np.array([round(length / SPACING) for length in self.length.tolist()])
        """Number of points, shape (n,)."""
        self.lines = np.zeros((count, int(self.count.max()), 4))
        """See `path.table`; shape (n, most points, 4)."""
        for k, track in enumerate(tracks):
            self.lines[k, : self.count[k]] = table(track.line.along, track.line.points, int(self.count[k]))

    def pose(self, track: int, place: int, lateral: float = 0.0) -> Pose:
        """x, y [m] and yaw [rad] at a point of a centre line, `lateral` [m] to the left of it."""
        x, y, c, s = self.lines[track, place % self.count[track]].tolist()
        return x - lateral * s, y + lateral * c, atan2(s, c)


def _files(folder: Path, count: int) -> list[Path]:
    """The map, and each track."""
    return [folder / "tracks.yaml", *(folder / f"track_{k}.yaml" for k in range(count))]


def _is_complete(folder: Path, count: int) -> bool:
    return all(file.is_file() for file in _files(folder, count))


def _writable(folder: Path) -> Path:
    """The folder, or a temporary one of the same name if it cannot be written."""
    try:
        make_folder(folder)
        check_writable(folder / "tracks.yaml")
    except AutodriveError:
        return Path(_temporary().name, folder.name)
    return folder


@cache
def _temporary() -> TemporaryDirectory[str]:
    """Is deleted when this process ends."""
    return TemporaryDirectory(prefix="autodrive-")


def write_tracks(
    count: int, seed: int, ranges: Sequence[tuple[float, float]], area: tuple[float, float], folder: Path
) -> None:
    """Generate the tracks. The map is written last: what it consists of is complete."""
    make_folder(folder)
    walls: list[Floats] = []
    tracks: list[Track] = []
    for k in range(count):
        one = _track(seed + k, ranges, area)
        column, row = divmod(k, ROWS)
        aside = np.array([column * (area[0] + APART), row * (area[1] + APART)])
        line = one.centre_line + np.array([*aside, 0.0, 0.0])
        moved = Track(one.name, line, walls=tuple(wall + aside for wall in one.walls), barrier=one.barrier)
        write_file(folder / f"track_{k}.yaml", moved.text())
        tracks.append(moved)
        walls += moved.walls
    first = tracks[0]
    title = f"Tracks {seed} to {seed + count - 1}"
    whole = Track("tracks", first.centre_line, walls=tuple(walls), title=title, barrier=first.barrier)
    write_file(folder / "tracks.yaml", whole.text())


def _track(seed: int, ranges: Sequence[tuple[float, float]], area: tuple[float, float]) -> Track:
    """The first that fits on its ground of those whose width, length and radius are drawn from the ranges."""
    rng = np.random.default_rng([seed, 0, 1])

    def drawn() -> Track:
        width, length, *radius = (round(least + rng.random() * (most - least), 3) for least, most in ranges)
        return generate_track(seed, width=width, length=length, area=area, min_radius=next(iter(radius), None))

    for _ in range(DRAWS - 1):
        with contextlib.suppress(SpecError):
            return drawn()
    return drawn()
