"""The commands `generate track`, `export track` and `import track`: files, output, and errors for bad input."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from autodrive.scenario.maps.map import load_map
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.track import DUCT, Track
from tests.support.command_line import call, refused

OPTIONS = ("--seed", "7", "--length", "30", "--width", "1.0", "--area", "14x8")
OVAL = "\n".join(f"{4.0 * np.cos(t):.3f},{2.5 * np.sin(t):.3f}" for t in np.linspace(0.0, 6.2, 80))


def test_a_track_is_generated_exported_and_imported(tmp_path: Path) -> None:
    done = call("generate", "track", *OPTIONS, "--race-line", "-o", "mine.yaml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    made = Track.load(tmp_path / "mine.yaml")
    assert done.stdout == f"wrote mine.yaml: {made.length:.1f} m. Next:\n  autodrive show mine.yaml\n"
    expected = generate_track(7, length=30.0, width=1.0, area=(14.0, 8.0), barrier=DUCT)
    assert np.array_equal(made.centre_line, expected.centre_line)
    assert made.barrier == expected.barrier
    assert made.race_line is not None

    done = call("export", "track", "mine.yaml", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        f"wrote out/mine_{one}" for one in ("map.png", "map.yaml", "centerline.csv", "raceline.csv")
    ]
    assert (tmp_path / "out" / "mine_map.png").read_bytes().startswith(b"\x89PNG")

    done = call("import", "track", "out", "-o", "again.yaml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    again = Track.load(tmp_path / "again.yaml")
    assert again.length == pytest.approx(made.length, abs=0.01)
    assert again.race_line is not None
    assert done.stdout.startswith(f"wrote again.yaml: {again.length:.1f} m, 2 walls of ")


def test_generated_tracks_differ_by_seed_and_barrier_only_as_asked(tmp_path: Path) -> None:
    def made(*options: str) -> Track:
        assert call("generate", "track", *OPTIONS, *options, "--force", "-o", "one.yaml", cwd=tmp_path).returncode == 0
        return Track.load(tmp_path / "one.yaml")

    same, other = made("--gap", "0"), made("--seed", "8")
    assert same.barrier.gap == 0.0
    assert same.barrier.length is None
    assert made("--barrier", "wall", "--seed", "7").barrier.kind == "wall"
    assert not np.array_equal(same.centre_line, other.centre_line)
    assert call("show", "one.yaml", "-o", "one.png", cwd=tmp_path).returncode == 0
    assert len(load_map(tmp_path / "one.yaml").statics) > 20


def test_a_centre_line_becomes_a_track_between_walls_or_ducts(tmp_path: Path) -> None:
    (tmp_path / "oval.csv").write_text(f"# x_m, y_m\n{OVAL}\n")
    done = call("import", "track", "oval.csv", "--width", "1.2", "--barrier", "duct", "--gap", "0.05", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    track = Track.load(tmp_path / "oval.yaml")
    assert (track.barrier.kind, track.barrier.gap, track.barrier.length) == ("duct", 0.05, 3.0)
    assert track.centre_line[:, 2:].sum(axis=1) == pytest.approx(1.2)
    ahead = track.start_pose[:2]
    reverse = call(
        "import", "track", "oval.csv", "--width", "1.2", "--reverse", "--start", "-4,0", "--name", "back", cwd=tmp_path
    )
    assert reverse.returncode == 0, reverse.stderr
    back = Track.load(tmp_path / "back.yaml")
    assert back.start_pose[:2] == pytest.approx((-4.0, 0.0), abs=0.3)
    assert ahead != pytest.approx((-4.0, 0.0), abs=1.0)
    assert np.sin(back.start_pose[2]) > 0.9  # clockwise: upwards at the left end


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("generate", "track", "--area", "big"), "--area must be AxB such as 30x10, not 'big'"),
        (("generate", "track", "--barrier", "hedge"), "--barrier must be wall or duct, not 'hedge'"),
        (("generate", "track", "--width", "0.5"), "width 0.5 m: it must be from 0.9 m to 10 m"),
        (("generate", "track", "--length", "nan"), "length nan m"),
        (("generate", "track", "--seed", "-1"), "Invalid value for '--seed'"),
        (("generate", "track", *OPTIONS, "-o", "no/such/folder/one.yaml"), "No such file or directory"),
        (("export", "track", "practise"), "Did you mean 'practice'?"),
        (("export", "track", "practice", "--resolution", "0"), "Invalid value for '--resolution'"),
        (("export", "track", "practice", "-o", "line.csv"), "line.csv"),
        (("import", "track", "nowhere"), "'nowhere' does not exist"),
        (("import", "track", "."), "the folder has neither NAME_map.yaml nor NAME_centerline.csv"),
        (("import", "track", "line.csv", "--start", "1;2"), "--start must be X,Y such as 1.5,-2, not '1;2'"),
        (("import", "track", "line.csv", "--barrier", "hedge"), "--barrier must be wall or duct, not 'hedge'"),
        (("import", "track", "line.csv", "--tolerance", "0"), "Invalid value for '--tolerance'"),
        (("import", "track", "line.csv"), "width"),
        (("import", "track", "words.csv"), "words.csv"),
        (("import", "track", "film.mp4"), "'film.mp4' is not a track: expected a folder"),
        (("import", "track", "picture.png", "--resolution", "0.05"), "picture.png"),
        (
            ("import", "track", "line.csv", "--width", "1", "--resolution", "0.05"),
            "is for a picture without a YAML file",
        ),
        (("import", "track", "line.csv", "--width", "1", "-o", "line.csv"), "--output must end in .yaml or .yml"),
    ],
)
def test_bad_input_is_refused_with_one_line_and_writes_nothing(
    arguments: tuple[str, ...], text: str, tmp_path: Path
) -> None:
    (tmp_path / "line.csv").write_text(OVAL)
    (tmp_path / "words.csv").write_text("here,there\neverywhere\n")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "film.mp4").write_bytes(b"")
    before = sorted(tmp_path.iterdir())
    assert text in refused(*arguments, cwd=tmp_path)
    assert sorted(tmp_path.iterdir()) == before


def test_the_error_of_a_bare_picture_has_the_lines_that_make_it_a_map(tmp_path: Path) -> None:
    assert call("export", "track", "practice", "-o", tmp_path).returncode == 0
    sheet = tmp_path / "practice_map.yaml"
    expected = sheet.read_text()
    done = call("import", "track", "practice_map.png", cwd=tmp_path)
    assert "import 'practice_map.yaml' in the same folder" in done.stderr
    sheet.unlink()
    done = call("import", "track", "practice_map.png", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    lines = re.findall("^  (.*)$", done.stderr, re.MULTILINE)
    assert yaml.safe_load("\n".join(lines)).keys() == yaml.safe_load(expected).keys()
    sheet.write_text("\n".join(lines))
    assert call("import", "track", "practice_map.yaml", "-o", "a.yaml", cwd=tmp_path).returncode == 0
    sheet.unlink()
    assert (
        call("import", "track", "practice_map.png", "--resolution", "0.05", "-o", "b.yaml", cwd=tmp_path).returncode
        == 0
    )
    assert (tmp_path / "a.yaml").read_text() == (tmp_path / "b.yaml").read_text()
    assert Track.load(tmp_path / "b.yaml").length == pytest.approx(Track.load("practice").length, rel=0.01)
