"""Tests that the columns of centre lines and race lines are found by their names, and refused if they are not known.

The drawn line is an ellipse with half axes of 6 and 4 m, anticlockwise, 0.6 m wide to the right and 1.2 m to the left.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import ScenarioSpec, VehiclePlacement
from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.tracks.checks import track_errors
from autodrive.scenario.tracks.importer import ImportOptions, import_track
from autodrive.scenario.tracks.track import Track

DATA = Path(__file__).parent / "data"
T: Floats = np.arange(200, dtype=np.float64) * (2.0 * math.pi / 200)
LINE: Floats = np.column_stack([6.0 * np.cos(T), 4.0 * np.sin(T), np.full(200, 0.6), np.full(200, 1.2)]).round(4)


def write(path: Path, header: str, rows: Floats, separator: str = ",") -> Path:
    path.write_text("\n".join([header, *(separator.join(map(str, row)) for row in rows.tolist())]))
    return path


def assert_the_ellipse(track: Track) -> None:
    assert track.centre_line[0].tolist() == [6.0, 0.0, 0.6, 1.2]
    assert np.abs(track.centre_line[:, :2]).max(axis=0) == pytest.approx((6.0, 4.0), abs=0.01)
    assert track.pose_at(1.0)[1] > 0.0  # anticlockwise


@pytest.mark.parametrize("name", ["left_before_right", "y_before_x"])
def test_columns_in_another_order_are_found_by_their_names(name: str) -> None:
    track, warnings = import_track(DATA / f"{name}.csv")
    assert_the_ellipse(track)
    assert warnings == []


@pytest.mark.parametrize(
    ("header", "columns", "separator"),
    [
        ("# y_m; x_m; w_tr_left_m; w_tr_right_m", (1, 0, 3, 2), "; "),
        ("# made by a program\n# y x w_left w_right", (1, 0, 3, 2), " "),
        ('"Y [m]","X [m]","Width left (m)","Width right (m)"', (1, 0, 3, 2), ","),
        ("left_width\tright_width\tx\ty", (3, 2, 0, 1), "\t"),
        ("# drawn in 2024, by hand\n# at the club", (0, 1, 2, 3), ", "),
        ("", (0, 1, 2, 3), ","),
    ],
)
def test_forms_of_a_header(header: str, columns: tuple[int, ...], separator: str, tmp_path: Path) -> None:
    track, warnings = import_track(write(tmp_path / "line.csv", header, LINE[:, columns], separator))
    assert_the_ellipse(track)
    assert warnings == []


@pytest.mark.parametrize(
    ("header", "columns", "message"),
    [
        ("x,y,yaw,v", 4, r"has no widths .* in its columns x, y, yaw, v; give the width of the track with --width"),
        ("a,b,c,d", 4, r"the header 'a, b, c, d' has no column for x, y\. Names that are known.*pos_x"),
        ("# east_m, north_m, w_tr_right_m, w_tr_left_m", 4, "has no column for x, y"),
        ("x_cm,y_cm,w_tr_right_cm,w_tr_left_cm", 4, "has no column for x, y"),
        ("x,y,right", 4, "the header names 3 columns .*; the rows have 4"),
        ("# x_m, y_m, w_tr_left_m", 4, "the header names 3 columns .*; the rows have 4"),
        ("x,pos_x,y,right", 4, "two columns have the same meaning: x and pos_x"),
        ("", 3, "the file has 3 columns without names"),
    ],
)
def test_a_header_that_is_not_known_is_refused(header: str, columns: int, message: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=message):
        import_track(write(tmp_path / "line.csv", header, LINE[:, :columns]))


@pytest.mark.parametrize("separator", [";", " ", "\t"])
def test_decimal_commas_are_refused_in_words(separator: str, tmp_path: Path) -> None:
    path = write(tmp_path / "line.csv", "", LINE, separator)
    path.write_text(path.read_text().replace(".", ","))
    with pytest.raises(SpecError, match=r"line 2: .* has decimal commas; write 1\.5, not 1,5"):
        import_track(path)


def test_a_missing_value_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "line.csv", "", LINE)
    path.write_text(path.read_text().replace(",0.6,", ",,0.6,"))
    with pytest.raises(SpecError, match="line 3: expected numbers"):
        import_track(path)


def test_the_option_is_stronger_than_the_widths_of_the_file(tmp_path: Path) -> None:
    track, warnings = import_track(DATA / "left_before_right.csv", ImportOptions(width=1.0))
    assert track.centre_line[:, 2:] == pytest.approx(0.5)
    assert warnings == ["the widths of the file are not used: --width makes the track 1 m wide"]
    track, warnings = import_track(DATA / "waypoint_logger.csv", ImportOptions(width=1.2))
    assert track.centre_line[:, 2:] == pytest.approx(0.6)
    assert warnings == []
    whole = np.column_stack([LINE[:, :2], np.full(200, 1.6)])
    track, _ = import_track(write(tmp_path / "line.csv", "x_m,y_m,width_m", whole))
    assert track.centre_line[:, 2:] == pytest.approx(0.8)


def test_the_columns_of_a_race_line_are_found_by_their_names(tmp_path: Path) -> None:
    track, _ = import_track(DATA / "race_line")
    assert track.race_line is not None
    assert track.race_line[:, 5] == pytest.approx(5.0)
    assert track.race_line[:, 6] == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("; ax_mps2; vx_mps", "; vx_mps; ax_mps2", r"row 1: the speed vx of a race line must be above 0, not -1 m/s"),
        ("; vx_mps", "; fast", "has no column for vx. Names that are known"),
        ("s_m; ", "", "the header names 6 columns .*; the rows have 7"),
    ],
)
def test_a_race_line_that_is_not_known_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    for file in (DATA / "race_line").iterdir():
        (tmp_path / file.name).write_text(
            file.read_text().replace(old, new) if "raceline" in file.name else file.read_text()
        )
    with pytest.raises(SpecError, match=message):
        import_track(tmp_path)


# -- edges and walls -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_points_one_centimetre_apart_give_walls(noise: float, tmp_path: Path) -> None:
    t = np.arange(3170) * (2.0 * math.pi / 3170)
    points = np.column_stack([6.0 * np.cos(t), 4.0 * np.sin(t)]) + np.random.default_rng(1).normal(
        0.0, noise, (3170, 2)
    )
    path = write(tmp_path / "line.csv", "x_m,y_m", points.round(4))
    track, warnings = import_track(path, ImportOptions(width=1.2))
    # perimeter of the ellipse: Ramanujan's second formula
    h = (2.0 / 10.0) ** 2
    assert track.length == pytest.approx(
        math.pi * 10.0 * (1.0 + 3.0 * h / (10.0 + math.sqrt(4.0 - 3.0 * h))), rel=0.002
    )
    assert len(track.walls) == 2
    (text,) = warnings
    assert " cm apart: they are replaced by 318 means of neighbouring points" in text


def test_edges_that_cross_in_a_bend_become_the_line_around_their_area(tmp_path: Path) -> None:
    """The least radius of the ellipse is 2^2 / 5 = 0.8 m, less than half the width."""
    points = np.column_stack([5.0 * np.cos(T), 2.0 * np.sin(T)])
    track, warnings = import_track(write(tmp_path / "line.csv", "x,y", points.round(4)), ImportOptions(width=1.8))
    (text,) = warnings
    assert "the edges of the track cross" in text
    assert track_errors(track) == []
    path = write(tmp_path / "line.csv", "x,y", (points * (1.0, 0.25)).round(4))
    with pytest.raises(SpecError, match="the width is greater than the bend or the distance to another part"):
        import_track(path, ImportOptions(width=1.2))


def test_a_track_file_without_walls_gets_a_sentence(tmp_path: Path) -> None:
    Track("bare", LINE).save(tmp_path / "bare.yaml")
    assert track_errors(Track.load(tmp_path / "bare.yaml"))[0].startswith("there are no walls")
    path = tmp_path / "bare.yaml"
    whole = rf"track 'bare': centre_line \(line 2\): there are no walls; .*\({re.escape(str(path))}\)$"
    with pytest.raises(SpecError, match=f"^{whole}"):
        load_map(path)
    scenario = ScenarioSpec(map=str(path), vehicles={"V1": VehiclePlacement(type="no_car")})
    with pytest.raises(SpecError, match=r"(?s)2 errors.*there are no walls.*vehicle 'no_car' is not known"):
        autodrive.make(scenario)
