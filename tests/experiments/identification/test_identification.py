"""A drive of a car with hidden parameters and noisy sensors: the fit finds them; bad input gives clear errors."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.base.errors import AutodriveError
from autodrive.experiments.identification import Drive, IdentificationError, identify, read_drive
from autodrive.experiments.identification.windows import whole_drive
from autodrive.physics.sensors.settings import SensorSettings
from autodrive.recording import Recorder
from autodrive.recording import open as open_recording
from autodrive.recording.exports import export
from autodrive.recording.exports.options import ExportOptions
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.cars import car_file
from tests.support.command_line import call

HIDDEN = {
    "wheels.damping_rate": 0.31,
    "wheels.sideways_friction.stiffness": 0.8,
    "steering.limit_deg": 26.0,
    "steering.rate_limit": 4.0,
}
"""Of the car that drives; `nigel_2023` has 0.25, 1.0, 30 and no limit of the rate."""
THROTTLE = (0.5, 0.9, 0.25, 0.7, 1.0, 0.4)
STEERING = (0.0, 0.6, -0.6, 1.0, -1.0, 0.3, -0.3)


def commanded(time: float) -> Command:
    """Steps of throttle and steering that excite the parameters."""
    return Command(THROTTLE[int(time / 1.5) % len(THROTTLE)], STEERING[int(time / 0.9) % len(STEERING)])


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recording of 12 s and the log of the data recorder that is exported from it."""
    folder = tmp_path_factory.mktemp("identification")
    car = car_file(folder, {**HIDDEN, "sensors.ips": {"noise": {"sigma": 0.01}}}, "nigel_2023")
    off = {"lidar": SensorSettings(is_on=False)}
    placement = VehiclePlacement(type=car, has_realistic_sensors=True, sensors=off)
    world = autodrive.make(ScenarioSpec(vehicles={"V1": placement}), seed=3)
    path = folder / "drive.mcap"
    with Recorder(path, world, name="plane", has_meshes=False):
        for tick in range(1200):
            world.step({"V1": commanded(0.01 * tick)})
    with open_recording(path) as recording:
        return path, export(recording, "autodrive", folder / "log", ExportOptions()) / "V1 Log.csv"


@pytest.fixture(scope="module")
def drive(files: tuple[Path, Path]) -> Drive:
    """The recording, whose speed is exact, with noise of the speed."""
    found = read_drive(files[0])
    rng = np.random.default_rng(5)
    return replace(found, speed=found.speed + rng.normal(0.0, 0.01, len(found.time)))


@pytest.mark.slow
def test_hidden_parameters_of_a_noisy_drive_are_found_within_3_percent(drive: Drive, tmp_path: Path) -> None:
    free = [*[*HIDDEN][:3], "steering.rate_limit=1:20"]
    found = identify(drive, "nigel_2023", free, trials=16)
    for one in found.parameters:
        assert one.value == pytest.approx(HIDDEN[one.path], rel=0.03), found.table()
    assert found.after.errors["distance"].rms < 0.5 * found.before.errors["distance"].rms
    assert found.after.errors["yaw rate"].rms < 0.5 * found.before.errors["yaw rate"].rms
    found.write(tmp_path / "fitted.yaml")
    spec = load_vehicle(str(tmp_path / "fitted.yaml"))
    assert spec.wheels.damping_rate == found.values["wheels.damping_rate"]
    assert (
        (tmp_path / "fitted.yaml")
        .read_text()
        .startswith("# Vehicle 'nigel_2023' with parameters that autodrive identify")
    )
    found.plot(tmp_path / "fit.svg")
    assert (tmp_path / "fit.svg").read_text().count("<path") > 9


@pytest.mark.slow
def test_the_command_fits_a_log_of_the_data_recorder(files: tuple[Path, Path], tmp_path: Path) -> None:
    """At 10 Hz, and with the angle of the steering in place of the command."""
    outputs = []
    for threads in (1, 2):
        options = ["--vehicle", "nigel_2023", "--free", "wheels.damping_rate=0.2:0.4", "--trials", "4"]
        done = call("identify", str(files[1]), *options, "--threads", str(threads), "--force", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout.splitlines()[-1] == "wrote nigel_2023_fitted.yaml and nigel_2023_fitted.png"
        outputs.append((tmp_path / "nigel_2023_fitted.yaml").read_text())
    assert outputs[0] == outputs[1]  # the same search, bit by bit
    spec = load_vehicle(str(tmp_path / "nigel_2023_fitted.yaml"))
    assert spec.wheels.damping_rate == pytest.approx(HIDDEN["wheels.damping_rate"], rel=0.03)
    assert "damping_rate: 0.25" not in outputs[0]
    assert "# PhysX" in outputs[0]  # the comments of the file remain


def test_a_parameter_without_influence_is_named(drive: Drive) -> None:
    with pytest.raises(IdentificationError, match=r"^lights\.blink_period, sensors\.lidar\.intensity: no influence"):
        identify(drive, "nigel_2023", ["lights.blink_period", "wheels.damping_rate", "sensors.lidar.intensity"])


@pytest.mark.parametrize(
    ("free", "vehicle", "message"),
    [
        (["wheels.damping"], "nigel", "'wheels.damping' is not a parameter of vehicle 'nigel'. Did you mean "),
        (["a", "body.mass", "body.mass"], "nigel", "'a' is not a parameter .*; 'body.mass' is named twice$"),
        (["sensors.lidar.rays"], "nigel", "is not a real number"),
        (["steering.rate_limit"], "nigel_2023", "is left out of the file: give its bounds"),
        (["body.drag=2:1"], "nigel", "the lower one first, not 2:1"),
        (["body.drag=x:1"], "nigel", "must be such as body.drag=0.1:0.5, not 'x:1'"),
        (["body.mass=-1:1"], "nigel", r"the bounds of 'body.mass' are not valid: body.mass: must be at least 0\.01"),
        ([], "nigel", "name at least one parameter"),
        (["body.mass"], "nigell", "vehicle 'nigell' is not known.*Did you mean 'nigel'"),
    ],
)
def test_wrong_parameters_are_refused(drive: Drive, free: list[str], vehicle: str, message: str) -> None:
    with pytest.raises(AutodriveError, match=message):
        identify(drive, vehicle, free)


def test_a_log_does_not_show_the_steering(files: tuple[Path, Path]) -> None:
    with pytest.raises(IdentificationError, match=r"^steering\.limit_deg: a log of the data recorder has the angle"):
        identify(files[1], "nigel_2023", ["steering.limit_deg", "body.mass"])


def test_drives_that_show_nothing_are_refused(drive: Drive) -> None:
    free = ["wheels.damping_rate"]
    with pytest.raises(IdentificationError, match="its throttle is always 0"):
        identify(replace(drive, throttle=np.zeros_like(drive.throttle)), "nigel_2023", free)
    few = {name: getattr(drive, name)[:5] for name in ("time", "x", "y", "heading", "speed", "yaw_rate")}
    with pytest.raises(IdentificationError, match=r"the drive is too short: 5 rows in 0\.04 s"):
        identify(replace(drive, **few), "nigel_2023", free)
    x, speed = drive.x.copy(), drive.speed.copy()
    x[7], speed[2] = np.nan, np.inf
    with pytest.raises(IdentificationError, match="the x of row 8 is not a finite number; the speed of row 3"):
        identify(replace(drive, x=x, speed=speed), "nigel_2023", free)
    with pytest.raises(IdentificationError, match="the car does not move in the drive"):
        identify(replace(drive, speed=np.zeros_like(drive.speed)), "nigel_2023", ["wheels.damping_rate"])
    with pytest.raises(IdentificationError, match=r"the drive has no 2\.5 s without a collision"):
        identify(replace(drive, breaks=np.arange(0.0, 12.0)), "nigel_2023", ["wheels.damping_rate"])


def test_the_longest_part_of_a_drive_without_a_break_is_compared(drive: Drive) -> None:
    windows = whole_drive(replace(drive, breaks=np.array([0.001, 2.0, 9.0])))
    assert (windows.starts[0], windows.ticks) == (pytest.approx(2.01), 698)  # to 8.99 s
    assert drive.time[windows.rows[0, [0, -1]]].tolist() == pytest.approx([2.01, 8.99])


def test_a_command_of_a_drive_acts_as_long_as_in_the_world(tmp_path: Path) -> None:
    path = tmp_path / "one_command.mcap"
    world = autodrive.make("plane")
    with Recorder(path, world, name="plane", has_meshes=False):
        obeyed = []
        for tick in range(300):
            world.step({"V1": Command(0.7)} if tick == 0 else {})
            obeyed.append(world.controls.throttle[0])
    assert obeyed == [0.7] * 50 + [0.0] * 250
    assert read_drive(path).command_time[1:] == pytest.approx([0.0, 0.5])


def test_files_that_are_no_drive_are_one_line(files: tuple[Path, Path], tmp_path: Path) -> None:
    empty, broken, nan = tmp_path / "empty.csv", tmp_path / "broken.csv", tmp_path / "nan.csv"
    rows = [line.split(",") for line in files[1].read_text().splitlines()]
    rows[6][1], rows[8][11] = "nan", "inf"
    nan.write_text("".join(",".join(row) + "\n" for row in rows))
    empty.write_text("")
    broken.write_text(files[1].read_text().replace("\n", ",\n", 1))
    options = ["--vehicle", "nigel_2023", "--free", "wheels.damping_rate"]
    for path, message in (
        (empty, "the log has 0 lines"),
        (broken, "line 2 has 21 columns"),
        (nan, "line 7: the throttle is not a finite number; line 9: the speed is not a finite number"),
        (tmp_path / "none.mcap", "none.mcap"),
    ):
        done = call("identify", str(path), *options, cwd=tmp_path)
        assert done.returncode == 2
        assert message in done.stderr
        assert len(done.stderr.splitlines()) == 1


@pytest.mark.slow
def test_the_program_of_the_document_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last of identification.md; tests/recording/drives runs the other."""
    document = (Path(__file__).parents[3] / "docs" / "identification.md").read_text(encoding="utf-8")
    _, program = re.findall(r"```python\n(.*?)```", document, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(program, names)
    assert names["found"].values == pytest.approx({"wheels.damping_rate": 0.31, "steering.limit_deg": 26.0}, rel=0.01)
    assert (tmp_path / "fitted.png").stat().st_size > 10_000
    assert load_vehicle(str(tmp_path / "fitted.yaml")).steering.limit_deg == names["found"].values["steering.limit_deg"]
