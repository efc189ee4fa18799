"""Hidden cars are found from noisy drives; the fit in stages writes a vehicle, a report and a program."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from autodrive.base.arrays import Floats
from autodrive.experiments.identification import design, staged
from autodrive.experiments.identification.advice import MANOEUVRES, advice
from autodrive.experiments.identification.drive import IdentificationError
from autodrive.experiments.identification.fit_report import write_report
from autodrive.experiments.identification.gauss_newton import NormalEquations, Point, Solver, resampled_steps
from autodrive.experiments.identification.parameters import VehicleFile
from autodrive.experiments.identification.staged import fit_in_stages
from autodrive.experiments.identification.starts import DriveValues, starts_of
from autodrive.experiments.identification.synthetic import synthetic_drive
from autodrive.recording.drives import Drive
from autodrive.scenario.vehicles.spec import load_vehicle

CAR = "f1tenth_mocap"
BOUNDS = {"steering.offset_deg": (-4.0, 4.0), "drivetrain.speed_gain": (0.6, 1.4)}


def commanded(time: Floats) -> Floats:
    """Steps of speed and steering."""
    speed = np.array([0.2, 0.3, 0.15, 0.25])[(time / 2.5).astype(int) % 4]
    angle = np.array([0.0, 0.5, -0.5, 0.0, 0.8, -0.8, 0.2])[(time / 1.2).astype(int) % 7]
    return np.column_stack((speed, angle))


def noisy_drive(values: dict[str, float], seed: int, duration: float = 20.0, trim: float = 0.0) -> Drive:
    """A drive of a car with hidden values: 10 commands and 50 poses in a second, with the noise of a motion capture."""
    hidden = VehicleFile(CAR).with_values(values)
    noise = {"position_noise": 0.001, "heading_noise": 0.002}
    return synthetic_drive(
        hidden, commanded, duration, f"hidden {seed}", pose_period=0.02, trim=trim, lead=1.0, seed=seed, **noise
    )


def solver_of(drives: list[Drive], session: tuple[str, ...] = ()) -> tuple[Solver, Point]:
    file = VehicleFile(CAR)
    starts = starts_of(drives, file.spec, (0.5, 1.0, 1.5), 1.0)
    free = file.free(BOUNDS)
    point = Point({parameter.path: parameter.start for parameter in free}, DriveValues.neutral(len(drives)))
    return Solver(file, starts, free, session, {}, threads=1), point


def test_the_values_of_hidden_cars_are_found_and_lie_in_their_intervals() -> None:
    contained = 0
    rng = np.random.default_rng(4)
    for seed in range(2):
        truth = {"steering.offset_deg": float(rng.uniform(-2.0, 2.0)), "drivetrain.speed_gain": rng.uniform(0.8, 1.1)}
        solver, point = solver_of([noisy_drive(truth, seed)])
        before = solver.error(point, solver.residuals([point])[0])
        point, error = solver.solve(point, 4, "both")
        assert error < 0.2 * before
        # 1.2 mm and 2.4 mrad of noise over 1 m and 1 rad of way and turn, in 20 starts
        assert point.values["steering.offset_deg"] == pytest.approx(truth["steering.offset_deg"], abs=0.15)
        assert point.values["drivetrain.speed_gain"] == pytest.approx(truth["drivetrain.speed_gain"], rel=0.01)
        steps = resampled_steps(solver.equations(point, solver.residuals([point])[0]), seed=0)
        for i, parameter in enumerate(solver.free):
            share = parameter.share(point.values[parameter.path])
            low, high = (parameter.at(share + float(np.percentile(steps[:, i], end))) for end in staged.INTERVAL)
            assert low < high
            contained += low <= truth[parameter.path] <= high
        solver.close()
    assert contained >= 3  # of 4 intervals of 90 %


def test_the_trim_of_each_drive_is_found_beside_the_vehicle() -> None:
    drives = [noisy_drive({"drivetrain.speed_gain": 1.0}, seed, 12.0, trim) for seed, trim in ((0, 0.01), (1, -0.01))]
    solver, point = solver_of(drives, ("trim",))
    point, _ = solver.solve(point, 4, "trim")
    solver.close()
    difference = float(point.session.trim[0] - point.session.trim[1])
    assert difference == pytest.approx(0.02, rel=0.25)  # the prior of 0.01 rad pulls both to 0
    assert point.values["drivetrain.speed_gain"] == pytest.approx(1.0, rel=0.01)


def test_resampled_groups_have_the_deviation_of_a_mean() -> None:
    """The estimate of a mean of n numbers has the deviation s / sqrt(n)."""
    numbers = np.random.default_rng(2).normal(3.0, 2.0, 40)
    ones = np.ones((40, 1, 1))
    equations = NormalEquations(
        ones, -(numbers - numbers.mean())[:, None], np.zeros(1), np.zeros(1), np.ones(1, np.bool_), 1.0
    )
    deviation = float(resampled_steps(equations, seed=1)[:, 0].std())
    wider = 1.0 + 0.92 / 39  # Student's distribution
    assert deviation == pytest.approx(wider * numbers.std(ddof=1) / np.sqrt(40), rel=0.1)  # 400 samples: 3.5 %


def test_an_interval_is_as_wide_as_data_and_prior_say() -> None:
    """Two means of normal numbers of deviation 2, of which the second has no number: 1/v = n/4 + 1/p^2 (Bayes)."""
    numbers = np.random.default_rng(2).normal(0.0, 2.0, 400)
    curvatures, slopes = np.zeros((400, 2, 2)), np.zeros((400, 2))
    curvatures[:, 0, 0], slopes[:, 0] = 1.0, -(numbers - numbers.mean())
    priors = np.array([0.1, 0.3])
    equations = NormalEquations(curvatures, slopes, 4.0 / priors**2, np.zeros(2), np.ones(2, np.bool_), 4.0)
    expected = (400 / 4.0 + 0.1**-2) ** -0.5, 0.3
    assert resampled_steps(equations, seed=1).std(axis=0) == pytest.approx(expected, rel=0.1)  # 400 samples: 3.5 %


def test_advice_names_the_manoeuvres_of_both_parameters() -> None:
    both = advice("steering.dead_time", "wheels.magic_formula.sideways.friction")
    assert both == f"{MANOEUVRES['steps']}; {MANOEUVRES['circles']}"
    assert advice("body.drag", "wheels.rolling_resistance") == MANOEUVRES["coasting"]


def test_the_fit_in_stages_writes_vehicle_report_and_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, number in (("STEPS", 1), ("MOST_STARTS", 6)):
        monkeypatch.setattr(staged, name, number)
    few = design.manoeuvres(0.15, 0.3)[:2]
    monkeypatch.setattr(design, "manoeuvres", lambda slow, fast: few)
    drive = noisy_drive({"drivetrain.speed_gain": 0.85, "steering.offset_deg": 1.0}, 7, 30.0)
    progress: list[str] = []
    fit = fit_in_stages([drive], CAR, threads=1, progress=progress.append)
    assert any(text.startswith("steering at low speed: step 1") for text in progress)
    assert fit.values["drivetrain.speed_gain"] == pytest.approx(0.85, rel=0.05)
    fit.write(tmp_path / "fitted.yaml")
    text = (tmp_path / "fitted.yaml").read_text()
    assert text.startswith(f"# Vehicle '{CAR}' fitted by autodrive identify")
    assert "cm and" in text.partition("\ntitle:")[0]
    assert load_vehicle(str(tmp_path / "fitted.yaml")) == fit.spec
    page = write_report(fit, tmp_path / "report")
    html = page.read_text()
    for words in ("constant motion", "kinematic car", "Largest errors", "prefers-color-scheme"):
        assert words in html
    numbers = json.loads((page.parent / "report.json").read_text())
    after, before = (numbers["held out"][name]["1"]["position"] for name in ("this vehicle", "vehicle before the fit"))
    assert after < 0.5 * before
    chosen = design.design(fit, threads=1)
    assert len(chosen) == design.TOTAL / design.SEGMENT
    design.write_script(chosen, CAR, tmp_path / "next.py")
    table = subprocess.run([sys.executable, tmp_path / "next.py", "--csv"], capture_output=True, text=True, check=True)
    rows = np.array([line.split(",") for line in table.stdout.split()[1:]], float)
    assert rows[-1, 0] == pytest.approx(30.0, abs=0.03)
    middle = rows[rows[:, 0] < 5.9]
    assert middle[:, 1:] == pytest.approx(chosen[0].at(middle[:, 0]), abs=2e-3)


def test_wrong_values_of_a_drive_are_refused() -> None:
    drive = noisy_drive({}, 0, 6.0)
    with pytest.raises(IdentificationError, match="wind: values of a drive are trim, drive, grip, delay"):
        fit_in_stages([drive], CAR, session=["wind"])
