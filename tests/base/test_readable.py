"""A file that is no regular file is refused at once by everything that reads a file by its name."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from autodrive.base import python_files, yaml_files
from autodrive.base.readable import reading_only
from autodrive.experiments.policies import Policy
from autodrive.recording import open as open_recording
from autodrive.recording.drives import recorder_log
from autodrive.scenario import kinds
from autodrive.scenario.tracks.image import read_grey
from autodrive.scenario.tracks.importer import import_track

READERS: dict[str, Callable[[Path], object]] = {
    "YAML": yaml_files.source,
    "Python": lambda path: python_files.load(path, "Sensor"),
    "policy": Policy.load,
    "recording": open_recording,
    "log": recorder_log.read,
    "image": read_grey,
    "centre line": lambda path: import_track(path.parent),
}


@pytest.mark.parametrize("kind", ["pipe", "socket", "folder", "device"])
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_regular_file_is_refused(tmp_path: Path, reader: str, kind: str) -> None:
    path = tmp_path / "a_centerline.csv"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("/dev/zero")
    with pytest.raises(Exception, match="it is not a regular file"):
        READERS[reader](path)


def test_a_refused_file_is_not_read_and_not_said_to_be_there(tmp_path: Path) -> None:
    (tmp_path / "car.yaml").write_text("title: Secret")
    with reading_only(lambda path: f"'{path.name}' is refused"):
        for name in ("car.yaml", "missing.yaml"):
            with pytest.raises(Exception, match=f"^'{name}' is refused"):
                kinds.find("vehicle", tmp_path / name)
            with pytest.raises(Exception, match=f"'{name}' is refused"):
                yaml_files.source(tmp_path / name)
    assert yaml_files.source(tmp_path / "car.yaml").tree == {"title": "Secret"}
