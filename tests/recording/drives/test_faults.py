"""What is wrong in a log is found, named with its line, and left out; wrong units and signs are refused."""

from __future__ import annotations

import gzip
import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.base.arrays import Floats
from autodrive.recording import RecordingError
from autodrive.recording.drives import Drive, LogOptions, read_drives
from autodrive.recording.drives.text_lines import MAX_TEXT
from tests.recording.drives.logs import RADIUS, SPEED, circle, write

HEADER = b"time,x,y,yaw,throttle,steering\n"


def read(path: Path, columns: str = "") -> Drive:
    (drive,) = read_drives(path, LogOptions(columns=columns))
    return drive


def turns(drive: Drive) -> None:
    """The motion is that of the circle, also beside the faults."""
    np.testing.assert_allclose(drive.speed, SPEED, rtol=0.01)
    np.testing.assert_allclose(drive.yaw_rate, SPEED / RADIUS, rtol=0.01)


def delayed(seconds: float, first: int) -> Callable[[dict[str, Floats]], dict[str, Floats]]:
    def change(log: dict[str, Floats]) -> dict[str, Floats]:
        return log | {"time": log["time"] + np.where(np.arange(len(log["time"])) >= first, seconds, 0.0)}

    return change


def test_missing_rows_are_a_gap(tmp_path: Path) -> None:
    rows = [*range(100), *range(150, 400)]
    drive = read(write(tmp_path / "a.csv", circle(), rows))
    assert [(problem.kind, problem.line, problem.text) for problem in drive.problems] == [
        ("gap", 102, "1.02 s without rows before line 102")
    ]
    assert drive.breaks == pytest.approx([2.0])  # the gap is shortened to the usual step
    assert drive.duration == pytest.approx(6.98)
    assert drive.note == "problems of the log: gap (1)"
    turns(drive)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (3600.0, "the clock jumps by 3600.02 s before line 202: the position goes on"),
        (-3600.0, "the clock is set back by 3599.98 s before line 202"),
        (-0.5, "the clock is set back by 0.48 s before line 202"),
    ],
)
def test_a_jump_of_the_clock_leaves_the_drive_as_long_as_it_is(tmp_path: Path, seconds: float, text: str) -> None:
    drive = read(write(tmp_path / "a.csv", delayed(seconds, 200)(circle())))
    assert [(problem.kind, problem.text) for problem in drive.problems] == [("clock", text)]
    assert drive.duration == pytest.approx(7.98)
    assert drive.breaks == pytest.approx([4.0])
    turns(drive)


def test_poses_with_the_same_time_count_once(tmp_path: Path) -> None:
    log = circle()
    log["time"][[50, 51, 300]] = log["time"][[49, 49, 299]]
    drive = read(write(tmp_path / "a.csv", log))
    assert drive.problem_texts() == [
        "3 poses have the time of the pose before, the first in line 52; they are left out"
    ]
    assert len(drive.time) == 397
    turns(drive)


def test_a_pose_that_is_stuck_is_left_out(tmp_path: Path) -> None:
    log = circle()
    for name in ("x", "y", "yaw"):
        log[name][100:140] = log[name][100]
    drive = read(write(tmp_path / "a.csv", log))
    (problem,) = drive.problems
    assert problem.kind == "frozen"
    assert problem.text.startswith("the pose is stuck from line 102 to 141 (0.78 s), and then 1.18 m away")
    assert not set(range(103, 142)) & set(drive.lines.tolist())
    turns(drive)


def test_a_car_that_stops_is_not_stuck(tmp_path: Path) -> None:
    log = circle()
    way = np.where(log["time"] < 3.0, 0.5 * log["time"] - log["time"] ** 2 / 12.0, 0.75)
    log |= {"x": way, "y": 0.0 * way, "yaw": 0.0 * way, "steering": 0.0 * way}
    assert [problem.kind for problem in read(write(tmp_path / "a.csv", log)).problems] == ["standing"]


def test_repeated_poses_count_once(tmp_path: Path) -> None:
    log = circle()
    for name in ("x", "y", "yaw"):
        log[name] = np.repeat(log[name][::5], 5)
    drive = read(write(tmp_path / "a.csv", log))
    assert drive.problem_texts() == ["each pose is repeated in 5 rows; the first of them is used"]
    assert len(drive.time) == 80
    turns(drive)


def test_a_jump_of_the_pose_is_a_break(tmp_path: Path) -> None:
    log = circle()
    log["x"][200:] += 3.0
    log["yaw"][300:] += 2.0
    log["x"][300:], log["y"][300:] = (
        np.cos(2.0) * log["x"][300:] - np.sin(2.0) * log["y"][300:],
        np.sin(2.0) * log["x"][300:] + np.cos(2.0) * log["y"][300:],
    )
    drive = read(write(tmp_path / "a.csv", log))
    assert drive.problems[0].text.startswith("the pose jumps by 2.9")
    assert [problem.line for problem in drive.problems] == [202, 302]
    assert drive.breaks == pytest.approx([4.0, 6.0])
    turns(drive)


def test_a_single_wrong_pose_disappears(tmp_path: Path) -> None:
    log = circle()
    log["y"][250] += 5.0
    drive = read(write(tmp_path / "a.csv", log))
    assert [problem.line for problem in drive.problems] == [252, 253]
    assert 252 not in drive.lines
    turns(drive)


def test_rows_without_a_known_command_are_left_out(tmp_path: Path) -> None:
    log = circle()
    row = np.arange(400)
    log["sent"] = np.where((row > 200) & (row < 300), 40.0, row // 5)
    drive = read(write(tmp_path / "a.csv", log | {"throttle": np.full(400, 0.5)}), "command_time=sent")
    (problem,) = drive.problems
    assert (problem.kind, problem.line) == ("no command", 202)
    assert problem.text.startswith("2 s without a new command after line 202")
    assert ((drive.time > 4.51) & (drive.time < 5.99)).sum() == 0
    assert drive.breaks == pytest.approx([6.0])


def test_commands_at_their_limit_and_a_car_that_stands_are_named(tmp_path: Path) -> None:
    log = circle()
    log["throttle"] = np.clip(1.2 * np.sin(log["time"]), -1.0, 1.0)
    texts = read(write(tmp_path / "a.csv", log)).problem_texts()
    assert texts[0].startswith("the throttle is at its largest value 1 for 38 % of the time, first in line 52")
    still = log | dict.fromkeys(("x", "y", "yaw"), 0.0 * log["x"]) | {"throttle": 0.0 * log["x"] + 0.5}
    (text,) = read(write(tmp_path / "b.csv", still)).problem_texts()
    assert text.startswith("the car stands for 7.98 s from line 2 on although the throttle is 0.5")


@pytest.mark.parametrize(
    ("changes", "columns", "message"),
    [
        ({"steering": lambda log: log["steering"] * 60.0}, "", r"steering of line 2 is 18, but a share .* \[deg\]"),
        ({"steering": lambda log: log["steering"] * 60.0}, "steering=steering [rad]", "18 rad, .* in degrees"),
        ({}, "steering=steering [deg]", r"the largest steering is 0.3 degrees .* in rad\?"),
        ({"throttle": lambda log: log["throttle"] * 9.0}, "", r"the throttle of line \d+ is .* \[m/s\]"),
        ({"steering": lambda log: -log["steering"]}, "", "points to the right, use --steering right"),
        ({"yaw": lambda log: np.degrees(log["yaw"])}, "", r"yaw of the log is in degrees; .* 'yaw=NAME \[deg\]'"),
        ({"yaw": lambda log: -log["yaw"]}, "", "the yaw turns to the other side than the path"),
        ({"speed": lambda log: 0.0 * log["x"] + 3.6 * SPEED}, "", "it is in km/h"),
        ({"yaw_rate": lambda log: 0.0 * log["x"] + math.degrees(SPEED / RADIUS)}, "", "it is in deg/s"),
        ({"yaw_rate": lambda log: 0.0 * log["x"] - SPEED / RADIUS}, "", "the yaw rate of the log has the other sign"),
        ({"x": lambda log: log["x"] * 1000.0, "y": lambda log: log["y"] * 1000.0}, "", "are x and y in mm or cm"),
        ({"time": lambda log: log["time"] * 1000.0}, "", r"the usual step of the time is 20 s: .* 'time=NAME \[ms\]'"),
        ({"time": lambda log: log["time"][::-1]}, "", "line 3: the time is earlier than the one before; sort"),
    ],
)  # fmt: skip
def test_wrong_units_and_signs_are_refused(
    tmp_path: Path, changes: dict[str, Callable[[dict[str, Floats]], Floats]], columns: str, message: str
) -> None:
    log = circle()
    log |= {name: change(log) for name, change in changes.items()}
    with pytest.raises(RecordingError, match=message):
        read(write(tmp_path / "a.csv", log), columns)


def test_a_yaw_beside_the_course_is_named(tmp_path: Path) -> None:
    log = circle()
    (text,) = read(write(tmp_path / "a.csv", log | {"yaw": log["yaw"] - 1.2})).problem_texts()
    assert text.startswith("the car drives 69 degrees beside its yaw")
    assert text.endswith("--heading-offset 1.200")


def rows(count: int) -> bytes:
    return b"".join(b"%.2f,%.3f,0,0,0.1,0\n" % (0.02 * i, 0.01 * i) for i in range(count))


CONTENTS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "the log has 0 lines"),
    "blank": (b"\n\n\n", "has 0 columns"),
    "only a header": (HEADER, "the log has no throttle; no steering; no x, y, yaw"),
    "one row": (HEADER + rows(1), "rows with a pose and a command: 1; a drive has at least 3"),
    "numbers": (b"1,2,3\n", "line 1 has 3 columns"),
    "no time": (b"t,x,y\n1,2,3\n", r"no column 'time'; name it, such as --columns time=t\. Columns: t, x, y"),
    "binary": (bytes(range(256)) * 9, "line 1 has bytes of value 0: the file is no text"),
    "UTF-16": ("time,x\n".encode("utf-16"), "the file is UTF-16 text; save it as UTF-8"),
    "Latin": ("time,x,yaw [°]\n".encode("latin-1"), "line 1 is not UTF-8 text"),
    "NaN": (HEADER + rows(9).replace(b"0.020", b"NaN"), r"line 4: 'NaN' is not a finite number"),
    "infinite": (HEADER + rows(9).replace(b"0.020", b"-inf"), r"line 4: '-inf' is not a finite number"),
    "word": (HEADER + rows(9).replace(b"0.020", b"left"), r"line 4: 'left' is no number"),
    "comma": (HEADER.replace(b",", b";") + b"0,5;1;1;1;1;1\n", "line 2: '0,5' is no number; write a decimal point"),
    "cells": (HEADER + rows(9) + b"1,2\n", "line 11 has 2 cells, the header has 6"),
    "quote": (HEADER + b'"' + rows(9999), "cannot read the table: field larger"),
    "two columns": (b"x,time,x\n1,2,3\n", "the table has 2 columns 'x'"),
    "half a pose": (HEADER + rows(9) + b"9.0,1,,0,0,0\n", "line 11 has only one of x and y"),
    "truncated gzip": (gzip.compress(HEADER + rows(2000))[:4000], "the file is truncated or damaged"),
    "damaged gzip": (gzip.compress(HEADER + rows(99)).replace(b"\x00\x00", b"\x07", 1), "damaged|cannot read"),
}  # fmt: skip


@pytest.mark.parametrize("name", CONTENTS)
def test_a_file_that_is_no_log_is_said_to_be_none(tmp_path: Path, name: str) -> None:
    content, message = CONTENTS[name]
    (tmp_path / "log.csv").write_bytes(content)
    with pytest.raises(RecordingError, match=message) as caught:
        read(tmp_path / "log.csv")
    assert str(caught.value).count(str(tmp_path)) == 1
    assert "\n" not in str(caught.value)


HUGE = """
import resource, sys
from pathlib import Path
from autodrive.base.errors import AutodriveError
from autodrive.recording.drives import read_drives
for name in sys.argv[1:]:
    try:
        read_drives(Path(name))
    except AutodriveError as error:
        print(error)
if sys.platform == "linux":  # the other figure contains that of the parent process
    print(next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM")) * 1024)
else:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024))
"""


def test_huge_files_are_refused_with_little_memory(tmp_path: Path) -> None:
    """A sparse file of 10 GB, a text of one endless line, a gzip file that becomes 1 GB."""
    sparse, line, bomb = tmp_path / "sparse.csv", tmp_path / "line.csv", tmp_path / "bomb.csv.gz"
    with sparse.open("wb") as file:
        file.write(HEADER)
        file.truncate(10 * 2**30)
    line.write_bytes(b"x" * (2**21))
    part = b"a" * 2**20
    with gzip.open(bomb, "wb", compresslevel=1) as file:
        for _ in range(64):
            file.write(part)
    run = subprocess.run([sys.executable, "-c", HUGE, sparse, line, bomb], capture_output=True, text=True, check=True)
    first, second, third, size = run.stdout.splitlines()
    assert first.startswith(f"the file has 10.7 GB; a log that is read has at most {MAX_TEXT / 1e9:.1f} GB")
    assert second.startswith("line 1 is longer than 1 MB: this is no log")
    assert third.startswith("line 1 is longer than 1 MB: this is no log")
    assert int(size) < 300e6


def test_the_program_of_the_document_finds_the_gap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first of identification.md."""
    document = (Path(__file__).parents[3] / "docs" / "identification.md").read_text(encoding="utf-8")
    program, _ = re.findall(r"```python\n(.*?)```", document, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(program, names)
    assert names["drive"].speed == pytest.approx(1.5)
    assert names["drive"].problem_texts() == ["0.8 s without rows before line 53"]
