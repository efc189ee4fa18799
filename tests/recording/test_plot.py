"""Plots of signals."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from autodrive.base.svg_plot import HEIGHT, LEFT, RIGHT, TOP, WIDTH
from autodrive.recording import Recording, RecordingError
from autodrive.recording.plot import plot


def test_a_plot_has_the_values(recording: Recording, tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    plot(recording, ["V1/velocity", "V1/lidar/ranges"], path)
    svg = ElementTree.fromstring(path.read_text())
    curves = [one for one in svg.iter("{http://www.w3.org/2000/svg}path") if one.get("fill") == "none"]
    assert len(curves) == 3 + 1
    points = re.findall(r"[ML]([\d.]+) ([\d.]+)", curves[0].attrib["d"])
    assert len(points) == len(recording.times)
    speed = recording["V1/velocity"][:, 0]
    lowest = min(float(y) for _, y in points)  # y points down: the greatest speed
    assert lowest == float(points[int(speed.argmax())][1])
    assert TOP <= lowest <= HEIGHT
    assert (float(points[0][0]), float(points[-1][0])) == (LEFT, WIDTH - RIGHT)
    plot(recording, ["V1/velocity"], tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_what_cannot_be_drawn_says_why(recording: Recording, tmp_path: Path) -> None:
    for signals, name, reason in (
        (["V1/velocity"], "a.pdf", "must end in .png or .svg"),
        ([], "a.png", "name at least one signal"),
        (["V1/speed"], "a.png", "signal 'V1/speed' is not known"),
    ):
        with pytest.raises(RecordingError, match=reason):
            plot(recording, signals, tmp_path / name)
