"""Tests that the track in a map is the ring between its walls, whatever is around them, and that each choice is said.

The drawn track is a rounded rectangle, so that its length is known: 2 (a + b) - 8 r + 2 pi r.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from autodrive.base.errors import SpecError
from autodrive.base.png import encode_png
from autodrive.scenario.tracks.importer import ImportOptions, import_track
from autodrive.scenario.tracks.track import Track

A, B, RADIUS, WIDTH, WALL, PIXEL = 10.0, 6.0, 1.5, 1.6, 0.1, 0.05
"""Centre line of the track, its width, thickness of the walls, edge of a pixel [m]."""
LENGTH = 2.0 * (A + B) - 8.0 * RADIUS + 2.0 * math.pi * RADIUS
SIZE = 18.0, 12.0
"""Of the image [m]; the track is in its middle."""
ERROR = 0.06
"""Of a wall [m]: the tolerance, 0.02 m, and half the diagonal of a pixel, 0.035 m."""
FREE, OCCUPIED, UNKNOWN, GREY = 254, 0, 205, 216
SURROUNDINGS = {
    "free": (FREE, 0.196),
    "unknown": (UNKNOWN, 0.196),
    "unknown that is free": (UNKNOWN, 0.25),  # the default of the map server of ROS 2
    "grey": (GREY, 0.196),
    "transparent": (None, 0.196),
    "occupied": (OCCUPIED, 0.196),
}
"""Grey value, None for transparent, and free_thresh."""


def rounded(margin: float) -> shapely.Polygon:
    """The inside of the line at a distance to the right of the centre line, which is negative to the left [m]."""
    x, y = A / 2.0 - RADIUS, B / 2.0 - RADIUS
    return shapely.buffer(shapely.box(-x, -y, x, y), RADIUS + margin, quad_segs=64)


CENTRE, OUTER, INNER = (rounded(margin) for margin in (0.0, WIDTH / 2.0, -WIDTH / 2.0))
CORRIDOR = OUTER - INNER
OUTER_WALL, INNER_WALL = OUTER.buffer(WALL) - OUTER, INNER - INNER.buffer(-WALL)


def opening(width: float, y: float) -> shapely.Polygon:
    """Of that width through the walls at the side of that y [m]."""
    return shapely.box(-width / 2.0, y - 0.3, width / 2.0, y + 0.3)


OUTER_SIDE, INNER_SIDE = B / 2.0 + WIDTH / 2.0, B / 2.0 - WIDTH / 2.0


def draw(
    folder: Path,
    *areas: tuple[BaseGeometry, int | None],
    around: int | None = FREE,
    free_thresh: float = 0.196,
    size: tuple[float, float] = SIZE,
) -> Path:
    """A map of areas and their grey values, None for transparent, each above the ones before; its middle is (0, 0)."""
    columns, rows = (round(edge / PIXEL) for edge in size)
    x, y = np.meshgrid(
        (np.arange(columns) + 0.5) * PIXEL - size[0] / 2.0, size[1] / 2.0 - (np.arange(rows) + 0.5) * PIXEL
    )
    image = np.zeros((rows, columns, 4), np.uint8)
    image[:] = pixel(around)
    for area, value in areas:
        image[shapely.intersects_xy(area, x, y)] = pixel(value)
    (folder / "hall.png").write_bytes(encode_png(image))
    path = folder / "hall.yaml"
    path.write_text(
        f"image: hall.png\nresolution: {PIXEL}\norigin: [{-size[0] / 2.0}, {-size[1] / 2.0}, 0]\nnegate: 0\n"
        f"occupied_thresh: 0.65\nfree_thresh: {free_thresh}\n"
    )
    return path


def pixel(value: int | None) -> NDArray[np.uint8]:
    return np.array([0, 0, 0, 0] if value is None else [value, value, value, 255], np.uint8)


def walls(*holes: BaseGeometry) -> BaseGeometry:
    return shapely.difference(shapely.union(OUTER_WALL, INNER_WALL), shapely.union_all(holes))


def assert_between_the_walls(track: Track, *, length: float = LENGTH, obstacles: int = 0, bulge: float = 0.0) -> None:
    """The track is the drawn one; `bulge`: depth of a closed opening [m]."""
    assert track.length == pytest.approx(length, abs=0.3)
    outer, inner = (
        shapely.Polygon(wall) for wall in sorted(track.walls, key=lambda wall: -np.ptp(wall, axis=0).prod())[:2]
    )
    assert len(track.walls) == 2 + obstacles
    for wall, drawn in ((outer, OUTER), (inner, INNER)):
        assert shapely.hausdorff_distance(wall.exterior, drawn.exterior, densify=0.01) < ERROR + bulge
    if not obstacles:
        assert np.median(track.centre_line[:, 2:].sum(axis=1)) == pytest.approx(WIDTH, abs=0.06)
        away = shapely.distance(CENTRE.exterior, shapely.points(track.centre_line[:, :2]))
        assert away.max() < 0.1  # the middle line is smoothed in bends


def warnings_of(path: Path, options: ImportOptions | None = None) -> tuple[Track, list[str]]:
    """The track and its warnings, but the one that the centre line is the middle."""
    track, warnings = import_track(path, options)
    assert [text for text in warnings if "the middle between the walls becomes the centre line" in text]
    return track, [text for text in warnings if "the middle between the walls becomes the centre line" not in text]


def length_in(text: str) -> float:
    """The first length in a text [m]."""
    return float(text.partition(" m ")[0].rpartition(" ")[2])


@pytest.mark.parametrize("surroundings", SURROUNDINGS)
def test_the_track_is_between_its_walls_whatever_is_around_them(surroundings: str, tmp_path: Path) -> None:
    around, free_thresh = SURROUNDINGS[surroundings]
    path = draw(tmp_path, (CORRIDOR, FREE), (walls(), OCCUPIED), around=around, free_thresh=free_thresh)
    track, warnings = warnings_of(path)
    assert_between_the_walls(track)
    assert warnings == []


@pytest.mark.parametrize("surroundings", [name for name in SURROUNDINGS if name != "occupied"])
def test_an_opening_to_the_surroundings_is_closed_with_a_warning(surroundings: str, tmp_path: Path) -> None:
    around, free_thresh = SURROUNDINGS[surroundings]
    open_walls = walls(opening(0.2, OUTER_SIDE))
    path = draw(tmp_path, (CORRIDOR, FREE), (open_walls, OCCUPIED), around=around, free_thresh=free_thresh)
    for start in (None, (-5.0, 0.0)):
        track, warnings = warnings_of(path, ImportOptions(start=start))
        assert_between_the_walls(track, bulge=0.05)
        (text,) = warnings
        assert "openings" in text


def test_an_opening_to_the_infield_does_not_change_the_track(tmp_path: Path) -> None:
    island = shapely.box(-0.6, -0.6, 0.6, 0.6)
    path = draw(tmp_path, (walls(opening(0.2, INNER_SIDE)), OCCUPIED), (island, OCCUPIED))
    track, _ = warnings_of(path)
    assert track.length == pytest.approx(LENGTH, abs=0.3)
    assert all(CORRIDOR.contains(shapely.Point(place)) for place in track.centre_line[:, :2])


@pytest.mark.parametrize("thickness", [PIXEL, WALL])
@pytest.mark.parametrize("gap", [0.25, 0.6])
def test_openings_of_thin_walls_are_closed_on_request(thickness: float, gap: float, tmp_path: Path) -> None:
    both = shapely.union(OUTER.buffer(thickness) - OUTER, INNER - INNER.buffer(-thickness))
    holes = shapely.union(opening(0.2, OUTER_SIDE), opening(0.2, -INNER_SIDE))
    track, warnings = warnings_of(draw(tmp_path, (both - holes, OCCUPIED)), ImportOptions(gap=gap))
    assert_between_the_walls(track, bulge=0.05)
    assert warnings == []


def test_a_wide_opening_is_an_error_that_names_the_option(tmp_path: Path) -> None:
    path = draw(tmp_path, (walls(opening(0.7, OUTER_SIDE)), OCCUPIED))
    with pytest.raises(SpecError, match=r"--close 0\.8 closes openings"):
        import_track(path)
    track, _ = warnings_of(path, ImportOptions(gap=0.8))
    assert track.length == pytest.approx(LENGTH, abs=0.3)


def test_a_start_in_the_surroundings_of_open_walls_is_refused(tmp_path: Path) -> None:
    """As in a corridor whose ends are open to grey surroundings that free_thresh makes free."""
    holes = opening(2.0, OUTER_SIDE), opening(2.0, -OUTER_SIDE)
    path = draw(tmp_path, (CORRIDOR, FREE), (walls(*holes), OCCUPIED), around=GREY)
    track, warnings = warnings_of(path, ImportOptions(start=(-5.0, 0.0)))
    assert_between_the_walls(track)
    assert any("the grey 216 of the border" in text for text in warnings)
    with pytest.raises(SpecError, match="the start point is outside of the walls"):
        import_track(path, ImportOptions(start=(-8.0, 5.0)))


def test_open_walls_without_a_ring_are_refused(tmp_path: Path) -> None:
    path = draw(tmp_path, (walls(opening(4.0, OUTER_SIDE)), OCCUPIED))
    with pytest.raises(SpecError, match="the only free area that is a ring lies along the border of the image"):
        import_track(path)


def test_the_border_of_the_image_is_the_outer_wall_only_around_one_inner_wall(tmp_path: Path) -> None:
    block = shapely.box(-4.0, -2.0, 4.0, 2.0)
    track, warnings = warnings_of(draw(tmp_path, (block, OCCUPIED), size=(12.0, 8.0)))
    assert any("the border of the image is the outer wall" in text for text in warnings)
    assert np.median(track.centre_line[:, 2:].sum(axis=1)) == pytest.approx(2.0, abs=0.1)
    corner = shapely.box(-4.0, -2.0, -1.0, 2.0)
    with pytest.raises(SpecError, match="lies along the border of the image"):
        import_track(draw(tmp_path, (corner, OCCUPIED), size=(12.0, 8.0)))


@pytest.mark.parametrize("side", [0.0, 0.2])
def test_the_centre_line_leads_past_a_speck(side: float, tmp_path: Path) -> None:
    speck = shapely.box(-0.05, B / 2.0 + side - 0.05, 0.05, B / 2.0 + side + 0.05)
    track, warnings = warnings_of(draw(tmp_path, (walls(), OCCUPIED), (speck, OCCUPIED)))
    assert_between_the_walls(track, obstacles=1)
    line = shapely.LinearRing(track.centre_line[:, :2])
    # the middle between the speck and the wall at the wider side
    assert line.distance(speck) > 0.3
    (text,) = [text for text in warnings if "1 obstacle between the walls" in text]
    assert length_in(text) == pytest.approx(0.1, abs=0.02)
    x, y = track.centre_line[np.argmin(np.hypot(track.centre_line[:, 0], track.centre_line[:, 1] - B / 2.0)), :2]
    right, left = track.widths_at(track.project(x, y)[0])
    free = shapely.LineString([(x, y - left + 0.03), (x, y + right - 0.03)])  # there the track goes along -x
    assert not free.intersects(speck)


def test_the_centre_line_leads_between_islands_where_there_is_most_room(tmp_path: Path) -> None:
    y = B / 2.0
    near_outer, near_inner = shapely.box(-0.6, y + 0.4, -0.2, y + 0.6), shapely.box(0.2, y - 0.5, 0.6, y - 0.3)
    across = shapely.box(2.0, y - 0.6, 2.2, y + 0.2)
    path = draw(tmp_path, (walls(), OCCUPIED), *((island, OCCUPIED) for island in (near_outer, near_inner, across)))
    track, warnings = warnings_of(path)
    assert_between_the_walls(track, obstacles=3, length=LENGTH + 0.3)
    line = shapely.LinearRing(track.centre_line[:, :2])
    assert line.distance(shapely.union_all([near_outer, near_inner])) > 0.35
    assert line.distance(across) > 0.2  # 0.6 m are left
    (text,) = [text for text in warnings if "3 obstacles between the walls" in text]
    assert length_in(text) == pytest.approx(0.8, abs=0.05)


def test_of_two_rings_the_one_with_walls_of_the_same_shape_is_the_track(tmp_path: Path) -> None:
    """A hall with walls of its own around the track: its floor is a ring, too, that does not touch the border."""
    hall = shapely.box(-8.5, -5.5, 8.5, 5.0)
    path = draw(tmp_path, (hall.buffer(0.2), OCCUPIED), (hall, FREE), (walls(), OCCUPIED), around=UNKNOWN)
    track, warnings = warnings_of(path)
    assert_between_the_walls(track)
    assert warnings == []


def test_another_ring_is_named_and_can_be_wanted(tmp_path: Path) -> None:
    other = shapely.Point(6.8, 0.0).buffer(2.0)
    small = other.buffer(0.1) - other, shapely.Point(6.8, 0.0).buffer(0.8)
    shifted = [shapely.affinity.translate(area, 2.0) for area in small]
    path = draw(tmp_path, (walls(), OCCUPIED), *((area, OCCUPIED) for area in shifted), size=(24.0, 12.0))
    track, warnings = warnings_of(path)
    assert_between_the_walls(track)
    (text,) = warnings
    assert "the map has other rings" in text
    x, y = map(float, text.split("(")[1].split(")")[0].split(","))
    circle, warnings = warnings_of(path, ImportOptions(start=(x, y)))
    assert circle.length == pytest.approx(2.0 * math.pi * 1.4, rel=0.02)
    assert warnings == []


def test_lines_on_both_sides_of_thick_walls_are_not_the_walls_of_a_track(tmp_path: Path) -> None:
    thick = [(OUTER.buffer(0.25), OUTER), (INNER, INNER.buffer(-0.25))]
    lines = shapely.union_all([line.exterior.buffer(0.05) for pair in thick for line in pair])
    track, warnings = warnings_of(draw(tmp_path, (lines, OCCUPIED)))
    assert track.length == pytest.approx(LENGTH, abs=0.3)
    assert np.median(track.centre_line[:, 2:].sum(axis=1)) == pytest.approx(WIDTH - 0.1, abs=0.06)
    assert warnings == []


def test_a_start_that_is_not_on_the_track_is_refused_or_said(tmp_path: Path) -> None:
    branch = shapely.box(-0.8, OUTER_SIDE - 0.2, 0.8, OUTER_SIDE + 1.4)
    area = shapely.union(CORRIDOR, branch)
    path = draw(tmp_path, (area.buffer(0.1), OCCUPIED), (area, FREE), (INNER, OCCUPIED), around=FREE)
    _, warnings = warnings_of(path, ImportOptions(start=(5.0, 0.3)))
    assert warnings == []
    _, warnings = warnings_of(path, ImportOptions(start=(0.0, OUTER_SIDE + 1.2)))
    (text,) = [text for text in warnings if "start point" in text]
    assert length_in(text) == pytest.approx(WIDTH / 2.0 + 1.2, abs=0.5)
    with pytest.raises(SpecError, match="the start point is outside of the walls"):
        import_track(path, ImportOptions(start=(-8.0, 5.0)))
    with pytest.raises(SpecError, match=r"not free at \(0\.00, 0\.00\)"):
        import_track(path, ImportOptions(start=(0.0, 0.0)))


def test_a_width_that_varies_much_is_said(tmp_path: Path) -> None:
    room = shapely.box(-8.0, -5.0, 8.0, 5.0)
    path = draw(tmp_path, (room, FREE), (shapely.box(-7.2, -4.2, -2.0, 4.2), OCCUPIED), around=OCCUPIED)
    _, warnings = warnings_of(path)
    assert [text for text in warnings if "the width varies from" in text]


@pytest.mark.parametrize("name", ["unknown_is_free", "white_surroundings"])
def test_the_maps_of_a_concave_ring_give_the_ring(name: str) -> None:
    track, _ = warnings_of(Path(__file__).parent / "data" / f"{name}.yaml")
    # as they were drawn: 31.2 m long, 1.6 m wide, from x 0.8 to 11.2 m
    assert track.length == pytest.approx(31.2, abs=0.3)
    low, high = track.centre_line[:, 0].min(), track.centre_line[:, 0].max()
    assert (low, high) == pytest.approx((0.8, 11.2), abs=0.1)
    assert np.median(track.centre_line[:, 2:].sum(axis=1)) == pytest.approx(1.6, abs=0.1)
