"""The parity report of drives in worlds, whose differences from the simulated vehicle are known."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from autodrive.base.errors import SpecError
from autodrive.experiments.deployment.deploy import deploy
from autodrive.experiments.deployment.driver import CarLog, CarSettings
from autodrive.experiments.deployment.parity import Parity, ParityLog, compare_with_simulator, steering_delay
from tests.experiments.deployment.test_driver import drive_on
from tests.support.command_line import call, refused

LATENCY = 0.06


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Logs of the car that the vehicle describes, and of one with less grip that obeys later."""
    folder = tmp_path_factory.mktemp("parity")
    deploy("race", folder)
    settings = CarSettings(speed_cap=3.0)
    files = {}
    for name, latency, grip in (("same", 0.0, 1.0), ("other", LATENCY, 0.75)):
        files[name] = folder / f"{name}.csv"
        log = CarLog(files[name], settings)
        driver, collisions, _ = drive_on(
            "practice", folder, 9.0, settings=settings, latency=latency, grip=grip, log=log
        )
        log.close(driver.summary())
        assert collisions == 0
    return files


def compared(file: Path, track: str | None = "practice") -> Parity:
    return compare_with_simulator(ParityLog.read(file), vehicle="roboracer", policy="race", track=track)


@pytest.fixture(scope="module")
def parities(logs: dict[str, Path]) -> dict[str, Parity]:
    return {name: compared(file) for name, file in logs.items()}


def test_the_same_car_drives_as_the_simulator(parities: dict[str, Parity]) -> None:
    parity = parities["same"]
    columns, used = parity.log.columns, parity.used
    told = np.column_stack([columns["command_speed"][used], columns["command_angle"][used]])
    # the log has four digits of a range, and six of the other numbers
    assert parity.on_scan == pytest.approx(told, abs=2e-3)
    assert parity.places is not None
    assert np.abs(parity.places.across).max() < 0.03  # the scan of the map has no noise
    after = round(1.0 / parity.settings.period)
    faster = parity.places.speed[:, after] - columns["wheel_speed"][parity.places.rows[:, after]]
    assert abs(np.median(faster)) < 0.15
    assert parity.places.touched == 0
    assert parity.delays["car"] == pytest.approx(parity.delays["simulated vehicle"], abs=0.0151)


def test_the_scan_of_the_map_is_that_of_the_car_but_for_its_noise(parities: dict[str, Parity]) -> None:
    residuals = parities["same"].residuals
    assert residuals is not None
    known = residuals[np.isfinite(residuals)]
    # 20 rays with a standard deviation of 10 mm: the least is 19 mm below the mean if all see the same distance
    assert -0.02 < np.median(known) < 0.0
    assert np.mean(abs(known) < 0.05) > 0.98


def test_a_car_that_obeys_later_has_a_greater_delay(parities: dict[str, Parity]) -> None:
    delays = parities["other"].delays
    assert delays["car"] - delays["simulated vehicle"] == pytest.approx(LATENCY, abs=0.035)
    assert delays["car"] > parities["same"].delays["car"] + 0.02


@pytest.mark.parametrize("delay", [0.0, 0.055, 0.2])
def test_the_delay_is_that_by_which_a_signal_is_shifted(delay: float) -> None:
    def command(time: np.ndarray) -> np.ndarray:
        return np.sin(3.0 * time) + 0.5 * np.sin(7.3 * time + 1.0)

    times = [np.arange(0.0, 4.0, 0.025) + start for start in (0.0, 10.0)]
    shifted = [2.0 * command(time - delay) + 0.3 for time in times]
    assert steering_delay(times, [command(time) for time in times], shifted) == pytest.approx(delay, abs=0.0051)


def test_poses_that_are_off_show_in_the_scan(logs: dict[str, Path], tmp_path: Path) -> None:
    rows = list(csv.reader(logs["same"].open(encoding="utf-8")))
    x, y, yaw = (rows[0].index(name) for name in ("x", "y", "yaw"))
    for row in rows[1:]:  # 6 cm to the left
        heading = float(row[yaw])
        row[x] = str(float(row[x]) - 0.06 * math.sin(heading))
        row[y] = str(float(row[y]) + 0.06 * math.cos(heading))
    moved = tmp_path / "moved.csv"
    csv.writer(moved.open("w", encoding="utf-8", newline="")).writerows(rows[:200])
    residuals = compared(moved).residuals
    assert residuals is not None
    right, left = (np.nanmedian(residuals[:, sectors]) for sectors in (slice(6, 14), slice(40, 48)))
    assert left - right == pytest.approx(0.12, abs=0.03)


class Texts(HTMLParser):
    """The texts of a page, and whether its tags are closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_the_command_writes_a_page(logs: dict[str, Path], tmp_path: Path) -> None:
    page = tmp_path / "parity.html"
    words = ["parity", logs["same"], "--vehicle", "roboracer", "--policy", "race"]
    printed = call(*words, "--track", "practice", "-o", page).stdout
    for heading in ("The drive", "The scan against the map", "The commands", "The motion", "Latency"):
        assert heading in printed
    parser = Texts()
    parser.feed(page.read_text(encoding="utf-8"))
    assert parser.open == []
    assert {"The motion", "steering [deg]", "with the scan of the map"} <= {*parser.texts}
    assert "NaN" not in page.read_text(encoding="utf-8")
    call(*words, "-o", page, "--force")
    assert "The motion" not in page.read_text(encoding="utf-8")  # without a map


def changed(change: Callable[[list[list[str]]], None], source: Path, file: Path) -> Path:
    rows = list(csv.reader(source.open(encoding="utf-8")))
    change(rows)
    csv.writer(file.open("w", encoding="utf-8", newline="")).writerows(rows)
    return file


def test_wrong_logs_are_refused(logs: dict[str, Path], tmp_path: Path) -> None:
    def read(change: Callable[[list[list[str]]], None]) -> None:
        ParityLog.read(changed(change, logs["same"], tmp_path / "log.csv"))

    for change, text in [
        (lambda rows: rows[0].__setitem__(0, "t"), "no column 'time'"),
        (lambda rows: rows[5].pop(), "line 6: there are 70 cells, and 71 columns"),
        (lambda rows: rows[5].__setitem__(1, "left"), "not a number"),
        (lambda rows: rows.__delitem__(slice(10, None)), "fewer than 24 rows"),
    ]:
        with pytest.raises(SpecError, match=text):
            read(change)

    def blinded(rows: list[list[str]]) -> None:
        for row in rows[1:]:
            row[1] = ""

    blind = changed(blinded, logs["same"], tmp_path / "blind.csv")
    with pytest.raises(SpecError, match="the log has no poses"):
        compared(blind)
    assert compared(blind, track=None).places is None
    words = ["--vehicle", "roboracer", "--policy", "crossing"]
    assert "was trained for the task 'crossing'" in refused("parity", logs["same"], *words)
