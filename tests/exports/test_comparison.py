"""A drive of the data recorder is compared with our simulation of it."""

from __future__ import annotations

from pathlib import Path

from autodrive.exports import export
from autodrive.exports.comparison import compare
from autodrive.exports.options import ExportOptions
from autodrive.exports.recorder_layout import read
from autodrive.recording import Recording


def test_our_own_drive_is_the_same_but_for_the_rate_of_its_log(lap: Recording, tmp_path: Path) -> None:
    folder = export(lap, "autodrive", tmp_path / "log", ExportOptions(rate=100.0))
    log = read(folder / "V1 Log.csv")
    errors = compare(log, "mini_map").errors
    # the log has the angle of the steering actuator, which lags behind its command, as the command: it lags twice
    assert errors["speed"][1] < 0.1
    assert errors["yaw rate"][1] < 0.5
    assert errors["path"][1] < 0.05
    other = compare(log, "nigel_2023")
    assert other.errors["path"][1] > errors["path"][1]
    assert other.table().splitlines()[-1].startswith("path ")
