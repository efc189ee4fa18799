"""Logs of AutoDRIVE's data recorder with gaps, jumps of the clock, another sign of the steering, a byte order mark."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.experiments.identification import identify, read_drive
from autodrive.recording import Recorder, RecordingError
from autodrive.recording import open as open_recording
from autodrive.recording.drives.recorder_log import TIME_FORMAT, read
from autodrive.recording.exports import export
from autodrive.recording.exports.comparison import compare_log
from autodrive.recording.exports.options import ExportOptions
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from tests.support.command_line import call, refused

STEERING = (0.0, 0.6, -0.6, 1.0, -1.0, 0.3, -0.3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a drive of 8 s, with 50 rows in a second."""
    folder = tmp_path_factory.mktemp("logs")
    off = {"lidar": SensorSettings(is_on=False)}
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(sensors=off)}))
    with Recorder(folder / "drive.mcap", world, name="plane", has_meshes=False):
        for tick in range(800):
            world.step({"V1": Command(0.9, STEERING[tick // 90 % len(STEERING)])})
    with open_recording(folder / "drive.mcap") as recording:
        return export(recording, "autodrive", folder / "log", ExportOptions(rate=50.0)) / "V1 Log.csv"


def changed(
    log: Path,
    target: Path,
    *,
    shift: Mapping[int, float] = MappingProxyType({}),
    sign: float = 1.0,
    without: range = range(0),
) -> Path:
    """A copy of a log. `shift`: from a row on, the clock is so much later [s]; `without`: rows that are missing."""
    rows = [line.split(",") for line in log.read_text().splitlines()]
    for first, seconds in shift.items():
        for row in rows[first:]:
            time = datetime.strptime(row[0] + "000", TIME_FORMAT) + timedelta(seconds=seconds)
            row[0] = time.strftime(TIME_FORMAT)[:-3]
    for row in rows:
        row[2] = str(sign * float(row[2]))
    target.write_text("".join(",".join(row) + "\n" for i, row in enumerate(rows) if i not in without))
    return target


@pytest.mark.parametrize("shift", [{200: 3600.0}, {200: -3600.0}, {120: 7200.0, 300: -2.5}, {200: 3.2e8}], ids=str)
def test_the_same_car_is_the_same_in_a_log_whose_clock_jumps(
    shift: dict[int, float], whole: Path, tmp_path: Path
) -> None:
    usual = compare_log(read(whole))
    found = compare_log(read(changed(whole, tmp_path / "log.csv", shift=shift)))
    assert found.length == pytest.approx(usual.length, rel=0.02)  # without the step at each jump
    # a part that starts again has the rounded speed and the late position of a row: 0.6 % instead of 0.1 %
    assert found.errors["distance"].rms < 0.01 * found.length
    lines = ", ".join(str(row + 1) for row in shift)
    assert (
        f"note: the log has gaps or jumps of its clock before lines {lines}: each part of the drive starts"
        in found.table()
    )
    assert "note" not in usual.table()


def test_after_rows_that_are_missing_the_car_starts_as_recorded(whole: Path, tmp_path: Path) -> None:
    log = read(changed(whole, tmp_path / "log.csv", without=range(150, 250)))
    assert log.breaks == (150,)
    found = compare_log(log)
    assert found.differences["distance"][150] < 1e-3
    assert abs(found.differences["speed"][150]) < 1e-3
    assert found.errors["distance"].rms < 0.02 * found.length
    whole_log = read(whole)
    assert found.length == pytest.approx(compare_log(whole_log).length - way(whole_log.position[149:251]), rel=1e-6)


def way(positions: np.ndarray) -> float:
    """Length of a path [m]."""
    return float(np.hypot(*np.diff(positions[:, :2], axis=0).T).sum())


def test_a_gap_is_no_part_of_the_drive_that_is_fitted(whole: Path, tmp_path: Path) -> None:
    file = changed(whole, tmp_path / "log.csv", shift={200: 3.2e7})  # a year
    drive = read_drive(file)
    assert drive.duration == pytest.approx(read_drive(whole).duration, abs=0.02)
    assert drive.breaks.tolist() == [pytest.approx(drive.time[200])]
    free = {"wheels.damping_rate": None}
    found = identify(file, "nigel", free, trials=1, window=0.5, warm_up=0.2, threads=1)
    usual = identify(whole, "nigel", free, trials=1, window=0.5, warm_up=0.2, threads=1)
    assert found.values == pytest.approx(usual.values, rel=0.05)
    assert found.after.time[-1] - found.after.time[0] < 4.1
    assert "jumps of its clock before lines 201" in found.table()


def test_steering_with_the_other_sign_is_refused_and_not_fitted(whole: Path, tmp_path: Path) -> None:
    mirrored = changed(whole, tmp_path / "log.csv", sign=-1.0)
    for log, wrong, right in ((mirrored, "left", "right"), (whole, "right", "left")):
        said = f"the car turns to the opposite side of its steering: a positive angle in this log points to the {right}"
        with pytest.raises(RecordingError, match=said):
            read(log, is_left_positive=wrong == "left")
        assert f"use --steering {right}" in refused("compare", log, "--steering", wrong)
        fit = ("identify", log, "--vehicle", "nigel", "--free", "wheels.damping_rate", "-o", tmp_path / "fit.yaml")
        assert f"use --steering {right}" in refused(*fit, "--steering", wrong)
        assert call("compare", log, "--steering", right).returncode == 0
    assert np.array_equal(read(mirrored, is_left_positive=False).steering, read(whole).steering)


def test_lines_that_are_not_in_the_order_of_time_are_refused(whole: Path, tmp_path: Path) -> None:
    lines = whole.read_text().splitlines(keepends=True)
    (tmp_path / "log.csv").write_text("".join(lines[::-1]))
    with pytest.raises(RecordingError, match="line 2: the time stamp is earlier than the one before; sort the lines"):
        read(tmp_path / "log.csv")


def test_a_byte_order_mark_is_no_part_of_the_first_time(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(b"\xef\xbb\xbf" + whole.read_bytes())
    assert np.array_equal(read(tmp_path / "log.csv").time, read(whole).time)
