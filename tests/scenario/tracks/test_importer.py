"""Tests of the import and export of tracks: round trips, foreign forms of files, and errors."""

from __future__ import annotations

import math
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import resvg_py
import shapely

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.png import decode_png, encode_png
from autodrive.scenario.tracks.image import read_grey
from autodrive.scenario.tracks.importer import ImportOptions, export_track, import_track
from autodrive.scenario.tracks.shape import walls_along
from autodrive.scenario.tracks.track import Track

PIXEL, TOLERANCE = 0.05, 0.02
WALL_ERROR = TOLERANCE + PIXEL * math.sqrt(0.5)
"""Of a wall that was drawn and read again: the tolerance, and half the diagonal of a pixel [m]."""


@pytest.fixture(scope="module")
def bean() -> Track:
    """A small track that is not symmetric, counter-clockwise, with a race line."""
    t: Floats = np.arange(300, dtype=np.float64) * (2.0 * math.pi / 300)
    radius = 2.5 + 0.5 * np.cos(2.0 * t) + 0.2 * np.sin(t)
    points: Floats = np.column_stack([radius * np.cos(t), radius * np.sin(t)])
    line: Floats = np.hstack([points, np.full((300, 1), 0.5), np.full((300, 1), 0.6)]).round(4)
    race = line[::3]
    ahead = np.roll(race, -1, axis=0) - np.roll(race, 1, axis=0)
    psi = np.arctan2(ahead[:, 1], ahead[:, 0]) % (2.0 * math.pi)
    steps = np.hypot(*(np.roll(race, -1, axis=0) - race)[:, :2].T)
    along = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    other: Floats = np.tile((0.4, 3.0, 0.0), (100, 1))
    return Track("bean", line, np.round(np.column_stack([along, race[:, :2], psi, other]), 4), walls_along(line))


@pytest.fixture
def folder(bean: Track, tmp_path: Path) -> Path:
    """The track as a folder of f1tenth_racetracks."""
    export_track(bean, tmp_path / "bean", resolution=PIXEL)
    return tmp_path / "bean"


def lines(walls: tuple[Floats, ...]) -> shapely.MultiLineString:
    return shapely.MultiLineString([shapely.LinearRing(wall) for wall in walls])


def edit(path: Path, pattern: str, text: str) -> None:
    changed, count = re.subn(pattern, text, path.read_text(), count=1, flags=re.MULTILINE)
    assert count == 1
    path.write_text(changed)


def test_an_exported_track_is_imported_as_it_was(bean: Track, folder: Path) -> None:
    track, warnings = import_track(folder)
    assert warnings == []
    assert np.array_equal(track.centre_line, bean.centre_line)
    assert bean.race_line is not None
    assert track.race_line is not None
    assert np.allclose(track.race_line, bean.race_line, atol=2e-4)  # s is computed again from rounded points
    assert shapely.hausdorff_distance(lines(track.walls), lines(bean.walls), densify=0.02) < WALL_ERROR
    # the free side is on the left: the outer wall is counter-clockwise, the inner one clockwise
    for wall in track.walls:
        is_outer = shapely.Polygon(wall).contains(shapely.Point(bean.centre_line[0, :2]))
        assert shapely.LinearRing(wall).is_ccw == is_outer


def test_scripts_that_skip_three_lines_of_an_exported_race_line_get_all_its_points(bean: Track, folder: Path) -> None:
    """The files of f1tenth_racetracks have three lines of comments; f1tenth_gym reads them without, courses skip 3."""
    for skipped in (0, 3):
        rows = np.loadtxt(folder / "bean_raceline.csv", delimiter=";", skiprows=skipped)
        np.testing.assert_array_equal(rows, bean.race_line)


def test_the_centre_line_of_a_map_alone_is_found(bean: Track, folder: Path) -> None:
    track, warnings = import_track(folder / "bean_map.yaml")
    assert [text for text in warnings if "guesses" in text]
    # the widths are 0.5 and 0.6 m, so that the middle is 0.05 m to the left, and shorter by 2 pi x 0.05 m
    assert track.length == pytest.approx(bean.length - 0.314, rel=0.01)
    for x, y in track.centre_line[:, :2]:
        assert bean.project(x, y)[1] == pytest.approx(0.05, abs=0.04)
    reverse, warnings = import_track(folder / "bean_map.yaml", ImportOptions(is_reversed=True, start=(0.0, 2.2)))
    assert not [text for text in warnings if "start line" in text]  # it was chosen
    assert bean.project(*reverse.start_pose[:2])[0] == pytest.approx(bean.project(0.0, 2.2)[0], abs=0.2)
    assert abs(math.remainder(reverse.start_pose[2], 2.0 * math.pi)) < 0.3  # at the top, clockwise: along +x
    with pytest.raises(SpecError, match=r"not free at \(0\.00, 1\.55\), .*: the start point is on a wall or outside"):
        import_track(folder / "bean_map.yaml", ImportOptions(start=(0.0, 1.55)))


def test_a_folder_in_the_older_layout_of_f1tenth_racetracks_is_read(bean: Track, folder: Path) -> None:
    """As its `Spielberg`: no centre line, another file name of the image, psi from +y, more race lines."""
    (folder / "bean_centerline.csv").unlink()
    edit(folder / "bean_map.yaml", "image: .*", "image: mapBean.pgm")
    assert bean.race_line is not None
    race = np.roll(bean.race_line[::-1], -30, axis=0)  # clockwise
    race[:, 3] = (race[:, 3] + 0.5 * math.pi) % (2.0 * math.pi)
    rows = ["; ".join(f"{value:.7f}" for value in row) for row in race.tolist()]
    header = "# 17b4\n# 603f\n# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n"
    for name in ("bean_raceline.csv", "bean_map_raceline.csv", "bean_raceline_newconv.csv"):
        (folder / name).write_text(header + "\n".join(rows if name == "bean_raceline.csv" else rows[:9]))
    track, warnings = import_track(folder)
    assert track.name == "bean"
    x, y, heading = track.start_pose
    assert math.hypot(x - race[0, 1], y - race[0, 2]) < 0.2
    assert math.cos(heading - math.atan2(*(race[1, 1:3] - race[0, 1:3])[::-1])) > 0.95
    assert track.race_line is not None
    assert len(track.race_line) == len(race)
    texts = ("'bean_map.png' is read instead", "direction and start line are those of the race line", "psi is computed")
    assert [any(text in warning for warning in warnings) for text in texts] == [True] * 3
    assert len(warnings) == 3


def test_a_map_without_its_image_is_refused(folder: Path) -> None:
    (folder / "bean_map.png").unlink()
    with pytest.raises(SpecError, match=r"the file 'bean_map\.png' does not exist"):
        import_track(folder)


def test_the_yaw_of_a_map_turns_its_walls(bean: Track, folder: Path) -> None:
    yaw = 0.3
    c, s = math.cos(yaw), math.sin(yaw)
    file = folder / "bean_map.yaml"
    x, y = map(float, re.findall(r"origin: \[([-\d.]+), ([-\d.]+)", file.read_text())[0])
    edit(file, "origin: .*", f"origin: [{c * x - s * y}, {s * x + c * y}, {yaw}]")
    turned = bean.centre_line.copy()
    turned[:, :2] = bean.centre_line[:, :2] @ np.array([[c, s], [-s, c]])
    (folder / "bean_centerline.csv").write_text("\n".join(",".join(map(str, row)) for row in turned.tolist()))
    (folder / "bean_raceline.csv").unlink()
    track, warnings = import_track(folder)
    assert any("turned by 17.19 degrees" in text for text in warnings)
    expected = tuple(wall @ np.array([[c, s], [-s, c]]) for wall in bean.walls)
    assert shapely.hausdorff_distance(lines(track.walls), lines(expected), densify=0.02) < WALL_ERROR


def test_a_negated_portable_graymap_is_the_same_map(folder: Path) -> None:
    before, _ = import_track(folder)
    image = decode_png((folder / "bean_map.png").read_bytes())[..., 0]
    header = f"P5\n# made by a test\n{image.shape[1]} {image.shape[0]}\n255\n"
    (folder / "bean_map.pgm").write_bytes(header.encode() + (255 - image).tobytes())
    edit(folder / "bean_map.yaml", "image: .*", "image: bean_map.pgm")
    edit(folder / "bean_map.yaml", "negate: 0", "negate: 1")
    after, _ = import_track(folder)
    assert all(np.array_equal(a, b) for a, b in zip(before.walls, after.walls, strict=True))


def test_gaps_between_barriers_are_closed_on_request(bean: Track, folder: Path) -> None:
    path = folder / "bean_map.png"
    image = decode_png(path.read_bytes())[..., 0].copy()
    image[image == 205] = 254  # outside of the barriers it is free, too, as in a map from a LIDAR
    middle = image.shape[0] // 2
    image[middle : middle + 2] = np.where(image[middle : middle + 2] == 0, 254, image[middle : middle + 2])
    path.write_bytes(encode_png(image))
    closed, _ = import_track(folder, ImportOptions(gap=0.3))
    assert shapely.hausdorff_distance(lines(closed.walls), lines(bean.walls), densify=0.02) < WALL_ERROR + 0.1
    leaking, _ = import_track(folder)
    assert len(leaking.walls) != 2 or lines(leaking.walls).length > 1.5 * lines(bean.walls).length


@pytest.mark.parametrize(
    ("file", "pattern", "text", "message"),
    [
        ("map.yaml", "resolution: .*", "resolution: 0", r"resolution \(line 2\): must be at least 0\.0001"),
        ("map.yaml", "resolution: .*", "", "resolution: is required"),
        ("map.yaml", "negate: 0", "mode: raw", "mode raw has no fixed meaning"),
        (
            "map.yaml",
            "origin: .*",
            "origin: [-30, -30, 0]",
            r"the map is not free at \(3\.00, 0\.00\), where the start",
        ),
        ("map.yaml", "negate: 0", "negate: 1", "the map is not free at"),
        ("centerline.csv", r"\A(.*\n.*\n)", r"\1one, two\n", "line 3: expected numbers, found 'one, two'"),
        ("centerline.csv", r"\A(.*\n.*\n)", r"\g<1>1, 2, 3\n", "line 3: 3 numbers; the first row has 4"),
        ("centerline.csv", r"\A(.*\n.*\n)", r"\g<1>nan, 0, 1, 1\n", "line 3: a value is not a finite number"),
        ("centerline.csv", r"\A(.*\n(.*\n){60})(.*\n)*", r"\1", "the centre line is not closed"),
        ("centerline.csv", r"(, 0\.5, 0\.6\n)", ", 0.5, -0.6\n", "row 1: the widths to the right and to the left"),
        ("raceline.csv", r"\A((?:#.*\n)+(.*); .*\n)", r"\1\2\n", "line 5: 6 numbers; the first row has 7"),
    ],
)
def test_a_wrong_file_is_refused(folder: Path, file: str, pattern: str, text: str, message: str) -> None:
    edit(folder / f"bean_{file}", pattern, text)
    with pytest.raises(SpecError, match=message):
        import_track(folder)


def test_a_centre_line_that_crosses_itself_or_a_wall_is_refused(folder: Path, tmp_path: Path) -> None:
    t = np.arange(200) * (2.0 * math.pi / 200) + 0.01
    eight = tmp_path / "eight.csv"
    eight.write_text("\n".join(f"{5.0 * math.sin(a)} {3.0 * math.sin(2.0 * a)} 0.5 0.5" for a in t))
    with pytest.raises(SpecError, match=r"crosses itself at \(-?0\.00, -?0\.00\).*no bridge"):
        import_track(eight)
    edit(folder / "bean_centerline.csv", r"\A((.*\n){100}).*\n", r"\g<1>0, 0, 0.5, 0.6\n")
    with pytest.raises(SpecError, match="of the centre line is at a wall"):
        import_track(folder)


def test_probable_mistakes_are_warnings(bean: Track, folder: Path) -> None:
    assert bean.race_line is not None
    path = folder / "bean_raceline.csv"

    def write(rows: Floats) -> None:
        path.write_text("# a\n# b\n# s_m; x_m\n" + "\n".join("; ".join(map(repr, row)) for row in rows.tolist()))

    from_y = bean.race_line.copy()
    from_y[:, 3] -= math.pi / 2.0
    write(from_y)
    track, warnings = import_track(folder)
    assert len(warnings) == 1
    assert "the values of psi fit angles from +y, counter-clockwise" in warnings[0]
    assert track.race_line is not None
    assert np.allclose(track.race_line[:, 3], bean.race_line[:, 3], atol=1e-3)

    write(bean.race_line[::-1])
    track, warnings = import_track(folder)
    assert track.race_line is None
    assert warnings == ["the race line runs against the direction of the centre line; the race line is left out"]

    path.unlink()
    text = (folder / "bean_centerline.csv").read_text()
    rows = text.splitlines()
    (folder / "bean_centerline.csv").write_text("\n".join([*rows, rows[1]]))
    track, warnings = import_track(folder)
    assert np.array_equal(track.centre_line, bean.centre_line)
    assert len(warnings) == 1
    assert "was repeated at the end" in warnings[0]
    (folder / "bean_centerline.csv").write_text(text.replace("0.5, 0.6", "0.1, 0.1"))
    _, warnings = import_track(folder)
    assert len(warnings) == 2
    assert "only 0.20 m wide" in warnings[0]
    assert re.search(r"differ by 0\.[34]\d m \(median\)", warnings[1])


def test_centre_lines_without_widths_need_one(tmp_path: Path) -> None:
    path = tmp_path / "line.csv"
    t = np.arange(100) * (2.0 * math.pi / 100)
    path.write_text("t,pos_x,pos_y\n" + "\n".join(f"{a},{4.0 * math.cos(a)},{3.0 * math.sin(a)}" for a in t))
    with pytest.raises(SpecError, match=r"the file has no widths .* --width"):
        import_track(path)
    track, warnings = import_track(path, ImportOptions(width=1.2))
    assert warnings == []
    assert track.centre_line[0].tolist() == [4.0, 0.0, 0.6, 0.6]
    assert len(track.walls) == 2


# -- images ----------------------------------------------------------------------------------------------------


def png(width: int, depth: int, colour_type: int, rows: list[bytes], *chunks: tuple[bytes, bytes]) -> bytes:
    header = struct.pack(">IIBBBBB", width, len(rows), depth, colour_type, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + row for row in rows))
    parts = [(b"IHDR", header), *chunks, (b"IDAT", data), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in parts
    )


def test_every_form_of_png_is_read(tmp_path: Path) -> None:
    def grey(data: bytes) -> list[list[float]]:
        (tmp_path / "image.png").write_bytes(data)
        return read_grey(tmp_path / "image.png").tolist()

    assert grey(png(3, 1, 0, [b"\xa0"])) == [[255.0, 0.0, 255.0]]
    assert grey(png(3, 2, 0, [b"\x1b"])) == [[0.0, 85.0, 170.0]]
    assert grey(png(1, 16, 0, [b"\xff\xff", b"\x00\x00"])) == [[255.0], [0.0]]
    assert grey(png(2, 4, 3, [b"\x10"], (b"PLTE", bytes([0, 30, 60, 255, 255, 255])))) == [[255.0, 30.0]]
    assert grey(png(1, 8, 2, [bytes([10, 20, 60])])) == [[30.0]]
    assert grey(png(2, 8, 4, [bytes([10, 255, 10, 0])])) == [[10.0, 255.0]]  # what is transparent is white
    disc = '<circle cx="40" cy="30" r="25" fill="#2a7" stroke="#fa5" stroke-opacity=".5" stroke-width="20"/>'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="97" height="61"><rect width="97" height="61"/>{disc}</svg>'
    filtered = bytes(resvg_py.svg_to_bytes(svg_string=svg))  # an encoder that filters its rows
    assert np.allclose(grey(filtered), decode_png(filtered)[..., :3].mean(axis=2))
    for damaged in (filtered[:300], png(3, 3, 0, [b"\xa0"]), png(9, 8, 0, [b"\xa0"]), b"BM", b"P5\n2 2\n255\nabc"):
        with pytest.raises(SpecError, match=r"cannot be read|neither PNG nor PGM"):
            grey(damaged)


# -- map files as map_server reads them ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pattern", "text"),
    [
        ("occupied_thresh: .*", "occupied_thresh: 0.1"),  # below free_thresh: a pixel is occupied first
        ("negate: 0", "negate: 0\nmode: Trinary"),
        ("negate: 0", "negate: 0\nmode: SCALE"),
    ],
)
def test_what_map_server_accepts_is_accepted(pattern: str, text: str, bean: Track, folder: Path) -> None:
    edit(folder / "bean_map.yaml", pattern, text)
    track, warnings = import_track(folder)
    assert warnings == []
    assert shapely.hausdorff_distance(lines(track.walls), lines(bean.walls), densify=0.02) < WALL_ERROR + PIXEL / 2.0


@pytest.mark.parametrize("image", ["/home/user/maps/plan.png", r"C:\maps\plan.png"])
def test_an_image_of_another_computer_is_read_beside_the_map(image: str, folder: Path) -> None:
    before, _ = import_track(folder)
    (folder / "bean_map.png").rename(folder / "plan.png")
    edit(folder / "bean_map.yaml", "image: .*", f"image: {image}".replace("\\", "\\\\"))
    after, warnings = import_track(folder)
    assert all(np.array_equal(a, b) for a, b in zip(before.walls, after.walls, strict=True))
    assert warnings == [f"image: the file '{image}' does not exist; 'plan.png' is read instead"]
    edit(folder / "bean_map.yaml", "image: .*", f"image: {folder / 'plan.png'}")
    assert import_track(folder)[1] == []


def test_openings_of_noisy_walls_are_closed_without_walls_that_cross(bean: Track, folder: Path) -> None:
    """As a LIDAR draws walls: ragged, with holes and specks beside them."""
    path = folder / "bean_map.png"
    image = decode_png(path.read_bytes())[..., 0].copy()
    generator = np.random.default_rng(3)
    near = np.zeros(image.shape, bool)
    for shift in ((1, 0), (-1, 0), (0, 1), (0, -1), (2, 0), (0, 2)):
        near |= np.roll(image == 0, shift, (0, 1))
    noise = generator.random(image.shape)
    image[near & (image == 254) & (noise < 0.3)] = 0
    image[(image == 0) & (noise > 0.75)] = 254
    path.write_bytes(encode_png(image))
    for gap in (0.1, 0.2, 0.3):
        track, _ = import_track(folder / "bean_map.yaml", ImportOptions(gap=gap))
        assert track.length == pytest.approx(bean.length, rel=0.05)
