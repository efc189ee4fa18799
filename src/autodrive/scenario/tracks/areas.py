"""Finds the free area of a map that is the track: a ring between two walls of about the same shape."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.errors import SpecError
from autodrive.scenario.tracks.contours import areas_of, contours
from autodrive.scenario.tracks.ros_map import RosMap

CLOSED = 0.1, 0.2, 0.4
"""Openings that are narrower are closed if the walls make no ring otherwise [m]: no car fits through."""
SUGGESTED = 0.8, 1.6
"""Openings that are narrower are closed only on request [m]."""
MAX_POINTS = 60_000
"""Most points of the lines around all areas. In a larger map, openings are closed only on request: it takes seconds."""
NARROW = 0.35
"""A narrower ring is the inside of a wall whose two sides are drawn as lines [m]."""
SPECK = 0.05
"""A hole whose convex hull has a smaller share of the length of that of the area is a speck: the area is no ring."""
SMALL = 0.1
"""A ring around a smaller share of what the largest one is around is a detail of the map."""
LONG = 0.3
"""An obstacle around a greater share of what the inner wall is around is a part of an open outer wall."""
VARIATION = 0.5
"""A ring is taken at once if the distance between its walls varies by a smaller share."""
PENALTY = 0.1
"""The distance must vary by so much less if unknown pixels end the ring, or if openings are closed."""
DARK = 0.03
"""The surroundings have a grey of their own if their occupancy is greater."""
MAX_RINGS = 40
"""Most rings that are compared: those that are around most."""
SAMPLES = 200
"""Places on a wall where its distance to the other one is measured."""
MAX_NAMED = 3
"""Other rings that a warning names."""


class Level(NamedTuple):
    """A probability that ends the track: pixels that are more probably occupied do not belong to it."""

    value: float
    reason: str
    """Why the track ends there if there is no wall, for a warning."""


@dataclass(frozen=True, eq=False)
class Area:
    """A free area of a map, and how much it is like a track."""

    polygon: shapely.Polygon
    """[pixel]."""
    ros_map: RosMap
    level: Level
    closed: float
    """Openings that are narrower are closed [m]."""
    penalty: float
    """Is added to the variation."""

    @cached_property
    def hole(self) -> shapely.LinearRing:
        """The hole around most. A thin wall with an opening is a hole, too, so that its convex hull counts."""
        return max(self.polygon.interiors, key=lambda hole: hole.convex_hull.area, default=shapely.LinearRing())

    @cached_property
    def surrounded(self) -> float:
        """Length of the line around the hole [pixel]; 0: the area is no ring."""
        length = float(self.hole.convex_hull.length)
        return length if length > SPECK * self.polygon.convex_hull.length else 0.0

    @cached_property
    def walls(self) -> tuple[float, float]:
        """Median of the distance between the outer line and the hole [m], and the share by which it varies."""
        places = np.arange(SAMPLES) / SAMPLES
        middles = []
        for line, other in ((self.polygon.exterior, self.hole), (self.hole, self.polygon.exterior)):
            away = shapely.distance(other, shapely.line_interpolate_point(line, places, normalized=True))
            low, middle, high = np.percentile(away, (10, 50, 90)).tolist()
            middles.append((middle * self.ros_map.spec.resolution, (high - low) / middle))
        (outer, outer_share), (inner, inner_share) = middles
        return (outer + inner) / 2.0, (outer_share + inner_share) / 2.0

    @cached_property
    def variation(self) -> float:
        """The share by which the distance between the walls varies, with the penalty; infinite for no ring."""
        return self.walls[1] + self.penalty if self.surrounded else np.inf

    @cached_property
    def on_border(self) -> float:
        """The share of the border of the image along which the area lies."""
        height, width = self.ros_map.occupancy.shape
        border = shapely.buffer(shapely.box(0.0, 0.0, width, height).exterior, 1.0)
        return float(shapely.intersection(self.polygon.exterior, border).length) / (2.0 * (width + height))

    @property
    def is_surroundings(self) -> bool:
        """Whether it lies along most of the border of the image."""
        return self.on_border > 0.5

    def is_around(self, other: Area) -> bool:
        """Whether another ring is inside of the hole."""
        return bool(other.surrounded) and shapely.Polygon(self.hole).contains(other.polygon.representative_point())

    @property
    def place(self) -> str:
        """A point in the middle of the ring, for a message."""
        point = shapely.Polygon(self.polygon.exterior, [self.hole]).representative_point()
        ((x, y),) = self.ros_map.metres(np.array([[point.x, point.y]])).tolist()
        return f"({x:.2f}, {y:.2f})"


def track_area(ros_map: RosMap, known: BaseGeometry | None, gap: float) -> tuple[shapely.Polygon | None, list[str]]:
    """The free area of a map that is the track [pixel], and warnings; None if `known` is not free.

    `known`: a point or a closed line on the track [pixel]; None: the area is the ring whose two walls have most nearly
    the same shape. Unknown pixels are free, unless only they end the track. An area at the border of the image is not
    the track if another ring is inside of it. Openings narrower than `gap` [m] are closed; others only if the walls
    make no ring otherwise. Raises `SpecError` if no area is like a track.
    """
    is_line = known is not None and known.geom_type != "Point"
    point = None if known is None else shapely.Point(shapely.get_coordinates(known)[0])
    levels = [(level, areas_of(contours(ros_map.occupancy, level.value))) for level in _levels(ros_map)]
    areas: list[Area] = []
    rings: list[Area] = []
    ranked: list[Area] = []
    count = sum(int(shapely.get_num_coordinates(polygons).sum()) for _, polygons in levels)
    wider = [] if is_line or count > MAX_POINTS * len(levels) else [*CLOSED, *SUGGESTED]
    for step, closed in enumerate([gap, *(width for width in wider if width > gap)]):
        for number, (level, polygons) in enumerate(levels):
            parts = _parts(polygons, closed / ros_map.spec.resolution)
            areas += [Area(part, ros_map, level, closed, PENALTY * (number + step)) for part in parts]
        rings = sorted((area for area in areas if area.surrounded), key=lambda area: -area.surrounded)[:MAX_RINGS]
        wanted = rings if point is None else [area for area in areas if area.polygon.contains(point)]
        ranked = sorted(wanted, key=lambda area: (is_line and not area.polygon.contains(known), *_doubt(area, rings)))
        if ranked and not any(_doubt(ranked[0], rings)[:2]) and ranked[0].variation < VARIATION:
            break
    if not ranked and point is None:
        raise SpecError(["the map has no free area that is a ring; give a start point or a centre line"])
    if not ranked:
        return None, []
    area = ranked[0]
    if is_line:
        return area.polygon, []
    if not area.surrounded:
        raise SpecError(["the free area has no inner wall: the track is not a ring; give a centre line"])
    _check(area, rings, gap, has_point=point is not None)
    return area.polygon, _warnings(area, [] if point else rings, gap)


def _levels(ros_map: RosMap) -> list[Level]:
    """Occupancies above which a pixel may belong to a wall, in the order in which they are preferred."""
    spec, image = ros_map.spec, ros_map.occupancy
    levels = [Level(spec.occupied_thresh, "")]
    if ((image > spec.free_thresh) & (image <= spec.occupied_thresh)).any():
        levels.append(Level(spec.free_thresh, "the walls have openings to unknown pixels: the track ends there"))
    border = float(np.median(np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])))
    if DARK < border <= levels[-1].value:
        grey = round(255.0 * (border if spec.negate else 1.0 - border))
        text = f"the walls have openings to the grey {grey} of the border of the image: the track ends there, although"
        levels.append(Level(border / 2.0, f"{text} free_thresh {spec.free_thresh:g} makes that grey free"))
    return levels


def _parts(polygons: list[shapely.Polygon], gap: float) -> Iterator[shapely.Polygon]:
    """The parts of areas between which a disc of the diameter `gap` [pixel] cannot pass.

    Each part grows again on its own, because those on both sides of a thin wall meet in its openings.
    """
    if gap <= 0.0:
        yield from polygons
        return
    shrunk: Any = shapely.get_parts(shapely.buffer(polygons, -gap / 2.0))
    for part in shapely.get_parts(shapely.buffer(shrunk, gap / 2.0)).tolist():
        if isinstance(part, shapely.Polygon) and not part.is_empty:
            yield part


def _doubt(area: Area, rings: list[Area]) -> tuple[bool, bool, float]:
    """Why an area may not be the track, the strongest reason first."""
    return _is_detail(area, rings), area.is_surroundings or _is_outside(area, rings), area.variation


def _is_outside(area: Area, rings: list[Area]) -> bool:
    """Whether it is at the border of the image, around a ring that is like a track."""
    return area.on_border > 0.0 and any(
        area.is_around(ring) for ring in rings if not _is_detail(ring, rings) and ring.variation < VARIATION
    )


def _is_detail(area: Area, rings: list[Area]) -> bool:
    """Whether it is no ring, or a narrow or a small one."""
    largest = max((ring.surrounded for ring in rings), default=0.0)
    return not area.surrounded or area.surrounded < SMALL * largest or area.walls[0] < NARROW


def _check(area: Area, rings: list[Area], gap: float, *, has_point: bool) -> None:
    """Raises `SpecError` if the best area is not a track."""
    if area.closed > max(gap, *CLOSED):
        text = "the walls have an opening that joins the track with its surroundings; --close"
        raise SpecError([f"{text} {area.closed:g} closes openings that are narrower than {area.closed:g} m"])
    others = [ring for ring in rings if not ring.is_surroundings and not _is_detail(ring, rings)]
    if has_point and (_is_outside(area, rings) or (area.is_surroundings and others)):
        raise SpecError(["the start point is outside of the walls"])
    if area.is_surroundings and (area.variation > VARIATION + area.penalty or _has_other_walls(area)):
        text = "the only free area that is a ring lies along the border of the image: the walls are open, or missing"
        raise SpecError([f"{text}. Close the walls in the image or with --close, or give a centre line"])


def _has_other_walls(area: Area) -> bool:
    """Whether it has another long hole, or a large one inside of the convex hull of its hole: parts of open walls."""
    hull = area.hole.convex_hull
    others = [hole.convex_hull for hole in area.polygon.interiors if not hole.equals(area.hole)]
    return any(other.length > (SMALL if hull.contains(other) else LONG) * area.surrounded for other in others)


def _warnings(area: Area, rings: list[Area], gap: float) -> list[str]:
    """What was decided, and by which rule; `rings`: those among which the area was chosen."""
    warnings = [area.level.reason] if area.level.reason else []
    if area.closed > gap:
        text = f"the walls have openings narrower than {area.closed:g} m that join the track with another area"
        warnings.append(f"{text}: these openings are closed")
    if area.is_surroundings:
        warnings.append("the map has no outer wall: the border of the image is the outer wall")
    others = [ring for ring in rings if not any(_doubt(ring, rings)[:2]) and ring.variation < VARIATION]
    apart: list[Area] = []
    for ring in others:
        if not any(ring.polygon.intersects(other.polygon) for other in (area, *apart)):
            apart.append(ring)
    if apart:
        places = ", ".join(ring.place for ring in apart[:MAX_NAMED])
        warnings.append(f"the map has other rings, at {places}: choose another ring with --start")
    return warnings
