"""Files are written whole or not at all; a full disk is one line."""

from __future__ import annotations

import os
import resource
import stat
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from autodrive.cache import check_writable, write_file
from autodrive.errors import AutodriveError
from tests.support.command_line import AUTODRIVE, call, refused
from tests.support.hardening import fill, small_disk
from tests.support.waiting import LIMIT

OLD = "old content"


@pytest.fixture
def full(tmp_path: Path) -> Iterator[Path]:
    """A disk with a file of each name that a test writes, and no room for more."""
    with small_disk(tmp_path) as disk:
        for name in ("s.json", "map.png", "map.svg", "labels.png", "mini_map.png", "mini_map.yaml"):
            (disk / name).write_text(OLD)
        fill(disk / "full")
        yield disk


def test_a_full_disk_is_one_line_and_leaves_the_old_files(full: Path) -> None:
    before = {path.name: path.read_bytes() for path in full.iterdir()}
    run = ("run", "plane", "--headless", "--no-cameras", "--speed", "max", "--duration", "0.1", "--summary", "s.json")
    done = call(*run, cwd=full)
    assert done.returncode == 2
    assert "ended by duration" in done.stdout  # the summary, which is nowhere else
    assert done.stderr.splitlines()[-1] == "autodrive: cannot write: No space left on device  (s.json)"
    for arguments in (
        ("show", "mini_map", "-o", "map.png"),
        ("show", "mini_map", "-o", "map.svg"),
        ("show", "mini_map", "--labels", "labels.png"),
        ("show", "mini_map", "--occupancy", "."),
    ):
        assert "cannot write: No space left on device" in refused(*arguments, cwd=full)
    assert {path.name: path.read_bytes() for path in full.iterdir() if path.is_file()} == before


@pytest.mark.process
def test_output_to_a_full_disk_is_one_line() -> None:
    with Path("/dev/full").open("w") as output:
        done = subprocess.run(
            [*AUTODRIVE, "list", "scenarios"],
            check=False,
            stdout=output,
            stderr=subprocess.PIPE,
            text=True,
            timeout=LIMIT,
        )
    assert done.stderr.splitlines() == ["autodrive: cannot write: No space left on device"]
    assert done.returncode == 2


def test_a_file_that_grows_too_large_leaves_the_old_one(tmp_path: Path) -> None:
    file = tmp_path / "file"
    write_file(file, OLD)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(AutodriveError, match=r"cannot write: File too large  \(.*file\)"):
            write_file(file, bytes(1001))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert file.read_text() == OLD
    assert os.listdir(tmp_path) == ["file"]


def test_a_reader_sees_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    """The one that is open stays complete."""
    file = tmp_path / "file"
    write_file(file, OLD)
    with file.open() as reader:
        write_file(file, "new")
        assert reader.read() == OLD
    assert file.read_text() == "new"


def test_links_modes_and_devices_stay_what_they_are(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    write_file(file, OLD)
    plain = tmp_path / "plain"
    plain.write_text(OLD)
    assert file.stat().st_mode == plain.stat().st_mode
    file.chmod(0o640)
    link.symlink_to(file)
    write_file(link, "new")
    assert link.is_symlink()
    assert file.read_text() == "new"
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    write_file(Path("/dev/null"), "nothing")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_a_check_before_the_run_changes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "file"
    check_writable(file)
    assert not file.exists()
    write_file(file, OLD)
    check_writable(file)
    assert file.read_text() == OLD
    for bad in (tmp_path, tmp_path / "no" / "file", file / "file"):
        with pytest.raises(AutodriveError, match="cannot write"):
            check_writable(bad)
        with pytest.raises(AutodriveError, match="cannot write"):
            write_file(bad, OLD)
