"""Random race tracks side by side in one map, so that each episode of a batch can be on another one."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.cache import cache_folder, make_folder, write_file
from autodrive.base.elementary import atan2
from autodrive.base.errors import SpecError
from autodrive.experiments.envs.path import table
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.track import Pose, Track

AREA = 20.0, 10.0
"""Sides of the ground of each track [m] if nothing is chosen. A longer track on it has more and tighter curves."""
APART = 12.0
"""Distance between the grounds of two tracks [m]: farther than a LIDAR of the car sees."""
ROWS = 16
"""Tracks above each other; the next ones are beside them."""
DRAWS = 20
"""Greatest number of draws of width, length and radius of a track until it fits on its ground."""
SPACING = 0.05
"""Distance between the points of the centre lines [m], about."""
CAR_ROOM = 0.3
"""A car that starts up to 0.2 rad off the direction of a track needs so much on both sides of it [m]."""
MOST_ASIDE = 0.1
"""Greatest distance of a start from the centre line [m]."""


class Tracks:
    """Tracks side by side in one map."""

    def __init__(self, file: Path, tracks: Sequence[Track]) -> None:
        """`file`: path of the map with all tracks."""
        self.file = file
        """The map. Its road and its start line are those of the first track; it has the barriers of all."""
        self.length = np.array([track.length for track in tracks])
        """Length of each centre line [m], shape (n,)."""
        self.count = np.array([round(length / SPACING) for length in self.length.tolist()])
        """Number of points of each centre line, shape (n,)."""
        self.lines = np.zeros((len(tracks), int(self.count.max()), 4))
        """x, y [m], cosine and sine of the direction at each point, shape (n, most points, 4); see `path.table`."""
        self.starts: list[Integers] = []
        """Numbers of the points of each track where a car fits between the barriers."""
        self.room: list[Floats] = []
        """Distance beside each point of each track at which a car may start [m], at most `MOST_ASIDE`."""
        for k, (track, count) in enumerate(zip(tracks, self.count.tolist(), strict=True)):
            self.lines[k, :count] = table(track.line.along, track.line.points, count)
            widths = np.vstack([track.centre_line[:, 2:], track.centre_line[:1, 2:]]).min(axis=1)
            at = np.arange(count) * (track.length / count)
            room = np.interp(at, track.line.along, widths) - CAR_ROOM
            self.starts.append(np.flatnonzero(room >= 0.0))
            self.room.append(np.clip(room, 0.0, MOST_ASIDE))
            if len(self.starts[k]) == 0:
                raise SpecError(
                    [f"track '{track.name}': a car does not fit: the track must be at least {2.0 * CAR_ROOM:g} m wide"]
                )

    def pose(self, track: int, place: int, lateral: float = 0.0) -> Pose:
        """x, y [m] and yaw [rad] at a point of a centre line, `lateral` [m] to the left of it."""
        x, y, c, s = self.lines[track, place % self.count[track]].tolist()
        return x - lateral * s, y + lateral * c, atan2(s, c)


class RaceTracks(Tracks):
    """`count` tracks with the seeds `seed`, `seed` + 1, ... The map is a file in the cache.

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
            write_tracks(count, seed, ranges, area, folder)
        file, *files = _files(folder, count)
        super().__init__(file, [Track.load(path) for path in files])


class OwnTracks(Tracks):
    """Tracks of the user: names, files, or tracks that are already made. The map is a file in the cache.

    Raises `SpecError` for what is no track, and for tracks with different barriers.
    """

    def __init__(self, sources: Sequence[str | Path | Track]) -> None:
        tracks = [source if isinstance(source, Track) else Track.load(source) for source in sources]
        if not tracks:
            raise SpecError(["track: must be a track or several, not an empty list"])
        if any(track.barrier != tracks[0].barrier for track in tracks):
            raise SpecError(["track: tracks that share a map must have the same barrier"])
        right, placed = 0.0, []
        for track in tracks:  # each one to the right of those before
            points = np.vstack([track.centre_line[:, :2], *track.walls])
            by = np.array([right + APART - points[:, 0].min(), 0.0])
            placed.append(track if track is tracks[0] else moved(track, by))
            right = max(right, float(np.vstack([placed[-1].centre_line[:, :2], *placed[-1].walls])[:, 0].max()))
        text = whole(placed, tracks[0].title).text()
        super().__init__(cached_file("own_tracks", f"{tracks[0].name}.yaml", text), placed)


def cached_file(kind: str, name: str, text: str) -> Path:
    """The file of that name with this text in the cache."""
    folder = cache_folder(kind, "scenario/tracks", also=text)
    make_folder(folder)
    write_file(folder / name, text)
    return folder / name


def moved(track: Track, by: Floats) -> Track:
    """The track at another place, `by` x, y [m] from its own, without its race line."""
    line = track.centre_line + np.array([*by, 0.0, 0.0])
    return Track(track.name, line, walls=tuple(wall + by for wall in track.walls), barrier=track.barrier)


def whole(tracks: Sequence[Track], title: str) -> Track:
    """One map of several tracks."""
    walls = tuple(wall for track in tracks for wall in track.walls)
    return Track("tracks", tracks[0].centre_line, walls=walls, title=title, barrier=tracks[0].barrier)


def _files(folder: Path, count: int) -> list[Path]:
    """The map, and each track."""
    return [folder / "tracks.yaml", *(folder / f"track_{k}.yaml" for k in range(count))]


def _is_complete(folder: Path, count: int) -> bool:
    return all(file.is_file() for file in _files(folder, count))


def write_tracks(
    count: int, seed: int, ranges: Sequence[tuple[float, float]], area: tuple[float, float], folder: Path
) -> None:
    """Generate the tracks. The map is written last: what it consists of is complete."""
    make_folder(folder)
    file, *files = _files(folder, count)
    tracks: list[Track] = []
    for k, path in enumerate(files):
        column, row = divmod(k, ROWS)
        aside = np.array([column * (area[0] + APART), row * (area[1] + APART)])
        tracks.append(moved(_track(seed + k, ranges, area), aside))
        write_file(path, tracks[k].text())
    write_file(file, whole(tracks, f"Tracks {seed} to {seed + count - 1}").text())


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
