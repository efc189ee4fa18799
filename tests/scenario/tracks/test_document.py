"""The programs, the file and the figures of docs/tracks.md are right."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.scenario.kinds import names
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.tracks.checks import track_errors
from autodrive.scenario.tracks.shape import curvature
from autodrive.scenario.tracks.track import Track

TEXT = (Path(__file__).parents[3] / "docs" / "tracks.md").read_text()


def test_the_programs_of_the_document_run() -> None:
    found: dict[str, Any] = {}
    for program in re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL):
        exec(program, found)
    assert found["s"] == pytest.approx(found["track"].length - 0.5, abs=1e-3)
    assert found["speed"] > 1.0


@pytest.mark.parametrize("text", re.findall(r"```yaml\n(.*?)```", TEXT, flags=re.DOTALL))
def test_the_files_of_the_document_are_tracks(text: str, tmp_path: Path) -> None:
    path = tmp_path / "oval.yaml"
    path.write_text(text)
    track = Track.load(path)
    assert track_errors(track) == []
    assert len({shape.name.split("/")[0] for shape in load_map(path).statics}) > 10  # ducts with gaps between them


def test_the_table_of_the_document_is_that_of_the_shipped_tracks() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| (\d+) m \| ([\d.]+) m \| ([\d.]+) m \| (.*?) \| ([\d.]+) m x ([\d.]+) m", TEXT, re.M
    )
    assert sorted(row[0] for row in rows) == names("track")
    for name, *figures, barriers, across, up in rows:
        track = Track.load(name)
        radius = 1.0 / np.abs(curvature(track.centre_line[:, :2])).max()
        width = track.centre_line[:, 2:].sum(axis=1).min()
        # positions are rounded to 0.1 mm, which changes a radius of 3 m by some centimetres
        assert [float(figure) for figure in figures] == pytest.approx([track.length, width, radius], rel=0.03)
        assert barriers == {"wall": "walls", "duct": "air ducts"}[track.barrier.kind]
        x0, y0, x1, y1 = load_map(name).bounds
        assert x1 - x0 <= float(across) + 0.01
        assert y1 - y0 <= float(up) + 0.01
