"""Recorded drives are compared with our simulation of their commands."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.recording import Recorder, Recording, RecordingError
from autodrive.recording import open as open_recording
from autodrive.recording.drives import LogOptions, read_drives
from autodrive.recording.drives.recorder_log import DriveLog, read
from autodrive.recording.exports import export
from autodrive.recording.exports.comparison import Comparison, compare_drive, compare_log, compare_recording
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.exports.twin import record_twin
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.command_line import call, refused

TIME = np.arange(201, dtype=np.float64) * np.float64(0.01)


def straight_log(speed: float, heading: float) -> DriveLog:
    """A drive straight on without throttle, which no car can do."""
    zero, zeros = np.zeros(len(TIME)), np.zeros((len(TIME), 3))
    direction = np.array([math.cos(heading), math.sin(heading), 0.0])
    return DriveLog(
        time=TIME,
        throttle=zero,
        steering=zero,
        ticks=np.zeros((len(TIME), 2)),
        position=np.array([0.3, -0.2, 0.0]) + speed * TIME[:, None] * direction,
        euler=zeros + np.array([0.0, 0.0, heading]),
        speed=zero + speed,
        angular_velocity=zeros,
        acceleration=zeros,
        images=(("", ""),) * len(TIME),
        ranges=(np.empty(0),) * len(TIME),
    )


def test_known_offsets_give_the_errors_of_the_formula() -> None:
    """Ours is 0.3 m ahead, 0.4 m to the right, turned by 0.2 rad, and faster by a sine of 0.5 m/s."""
    heading = 3.0  # with the offset, it passes pi
    x, y = np.cos(heading) * TIME, np.sin(heading) * TIME
    recorded = {"x": x, "y": y, "heading": np.full(201, heading), "speed": np.ones(201), "yaw rate": np.zeros(201)}
    simulated = {
        "x": x + 0.3 * np.cos(heading) + 0.4 * np.sin(heading),
        "y": y + 0.3 * np.sin(heading) - 0.4 * np.cos(heading),
        "heading": np.full(201, heading + 0.2 - 2.0 * math.pi),
        "speed": 1.0 + 0.5 * np.sin(2.0 * math.pi * np.arange(201) / 201),
        "yaw rate": np.full(201, -0.1),
    }
    found = Comparison(TIME, recorded, simulated)
    assert found.length == pytest.approx(2.0)
    expected = {
        "along": (0.3, 0.3),
        "across": (0.4, 0.4),
        "distance": (0.5, 0.5),
        "heading": (0.2, 0.2),
        "speed": (0.5 / math.sqrt(2.0), 0.5),
        "yaw rate": (0.1, 0.1),
    }
    for name, errors in expected.items():
        assert found.errors[name] == pytest.approx(errors, rel=1e-4), name  # the sine has its maximum between two times
    np.testing.assert_allclose(found.differences["across"], -0.4)
    table = found.table().splitlines()
    assert table[0] == "201 rows, 2.00 s, length 2.000 m"
    assert table[2].split() == ["along", "0.3000", "0.3000", "m", "15.00", "15.00"]
    assert table[5].split() == ["heading", "11.4592", "11.4592", "deg"]


def test_a_car_without_throttle_is_behind_by_the_whole_drive() -> None:
    found = compare_log(straight_log(0.5, 0.7))
    # the car settles on its suspension, less than 0.1 mm
    assert found.length == pytest.approx(1.0)
    assert found.errors["along"] == pytest.approx((math.sqrt(np.mean((0.5 * TIME) ** 2)), 1.0), abs=1e-4)
    assert found.errors["across"].largest < 1e-4
    assert found.errors["speed"] == pytest.approx((0.5, 0.5), abs=1e-2)  # while it settles
    assert found.errors["heading"].largest < 1e-3
    assert found.differences["along"][-1] == pytest.approx(-1.0, abs=1e-4)


def test_the_log_of_our_drive_is_the_same_but_for_its_feedback(lap: Recording, tmp_path: Path) -> None:
    folder = export(lap, "autodrive", tmp_path / "log", ExportOptions(rate=100.0))
    log = read(folder / "V1 Log.csv")
    errors = compare_log(log, "mini_map").errors
    # the log has the angle of the steering actuator, which lags behind its command, as the command: it lags twice
    assert errors["speed"].largest < 0.1
    assert errors["yaw rate"].largest < 0.5
    assert errors["distance"].largest < 0.05
    other = compare_log(log, "mini_map", type_="nigel_2023")
    assert other.errors["distance"].largest > errors["distance"].largest
    mirrored = compare_log(replace(log, steering=-log.steering), "mini_map").errors
    assert mirrored["across"].largest > 3.0 * errors["across"].largest


def test_the_log_of_a_race_car_is_simulated_with_a_race_car(tmp_path: Path) -> None:
    """Its positions are those of its positioning sensor; both directions of the 22 columns."""
    scenario = autodrive.Scenario(vehicles={"V1": {"type": "roboracer", "x": 1.0, "yaw_deg": 30.0}})  # type: ignore[dict-item]  # pyright: ignore
    path = tmp_path / "race.mcap"
    world = autodrive.make(scenario)
    with Recorder(path, world, has_meshes=False):
        for _ in range(150):
            world.step({"V1": Command(0.1, 0.0)})
    with open_recording(path) as recording:
        log = read(export(recording, "autodrive", tmp_path / "log", ExportOptions(rate=100.0)) / "V1 Log.csv")
    assert log.vehicle_type == "roboracer"
    found = compare_log(log)
    assert found.length > 0.5
    assert found.errors["distance"].largest < 0.02 * found.length  # throttle of a row is that of the tick before it


def test_a_recording_is_the_same_as_its_simulation_and_differs_with_another_car(file: Path, tmp_path: Path) -> None:
    plot = tmp_path / "errors.svg"
    same = call("compare", str(file), "--output", str(plot))
    assert same.returncode == 0, same.stderr
    lines = same.stdout.splitlines()
    assert [line.split()[1:3] for line in lines[2:6]] == [["0.0000", "0.0000"]] * 4
    assert lines[-1] == f"wrote {plot}"
    svg = plot.read_text()
    assert svg.count('fill="none" stroke-width="1.3"') + svg.count('stroke-width="1.3"') == 6  # 2 paths, 4 errors
    with open_recording(file) as recording:
        exact = compare_recording(recording)
        assert all(error == (0.0, 0.0) for error in exact.errors.values())
        other = compare_recording(recording, "V1", type_="nigel_2023")
        assert 0.0 < other.errors["distance"].rms < other.errors["distance"].largest < exact.length
        other.plot(tmp_path / "errors.png")
    assert (tmp_path / "errors.png").read_bytes()[:4] == b"\x89PNG"


def test_what_cannot_be_compared_is_one_line(file: Path, lap: Recording, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("1,2,3\n")
    for words, reason in (
        ((str(file), "--vehicle", "V9"), "vehicle 'V9' is not in the recording"),
        ((str(file), "--output", "a.pdf"), "must end in .png or .svg"),
        ((str(file), "--type", "nigle"), "Did you mean 'nigel'"),
        ((str(log),), "line 1 has 3 columns"),
        ((str(log), "--vehicle", "V1"), "--vehicle is for recordings"),
        ((str(tmp_path / "a.mcap"),), "No such file"),
    ):
        assert reason in refused("compare", *words)
    with pytest.raises(RecordingError, match="has no vehicle 'V1'"):
        compare_recording(lap, scenario=autodrive.Scenario(vehicles={"V7": {}}))  # type: ignore[dict-item]  # pyright: ignore
    with pytest.raises(RecordingError, match=r"a tick of 0.02 s; that of the recording is 0.01 s"):
        compare_recording(lap, scenario=autodrive.Scenario(tick=0.02))


def test_a_table_of_our_drive_is_simulated_as_it_was(file: Path, tmp_path: Path) -> None:
    """The commands in other units, and the poses of a point of the car; the commands of a recording are exact."""
    (drive,) = read_drives(file)
    errors = compare_drive(drive, "mini_map").errors
    assert errors["distance"].largest < 1e-3  # the first tick of the recording settles the car on its suspension
    assert errors["heading"].largest < 1e-3
    full = load_vehicle("nigel").steering.limit
    held = np.searchsorted(drive.command_time, drive.time, side="right") - 1
    rows = ["t [ms],px,py,psi [deg],v [km/h],Yaw rate [deg/s],throttle,delta [deg]"]
    held[0] = 0  # no command yet, so that the throttle rises after the first row, as in the recording
    for i, command in enumerate(held.tolist()):
        x = drive.x[i] + 0.1 * math.cos(drive.heading[i])
        y = drive.y[i] + 0.1 * math.sin(drive.heading[i])
        pose = (1e3 * drive.time[i], x, y, math.degrees(drive.heading[i]))
        motion = (3.6 * drive.speed[i], math.degrees(drive.yaw_rate[i]))
        commands = (drive.throttle[command], math.degrees(full * drive.steering[command]))
        rows.append(",".join(map(repr, map(float, (*pose, *motion, *commands)))))
    table = tmp_path / "drive.csv"
    table.write_text("\n".join(rows))
    columns = "time=t,x=px,y=py,yaw=psi,speed=v,steering=delta"
    (read_back,) = read_drives(table, LogOptions(columns=columns, tracked_point=(0.1, 0.0)))
    again = compare_drive(read_back, "mini_map").errors
    assert again["distance"].largest < 1.01 * 0.01 * drive.speed.max()  # the throttle rises a tick later
    options = ("--columns", columns, "--tracked-point", "0.1,0", "--type", "nigel", "--scenario", "mini_map")
    done = call("compare", str(table), *options, "--output", str(tmp_path / "plot.svg"))
    assert done.returncode == 0, done.stderr
    assert f"distance {again['distance'].rms:11.4f}" in done.stdout
    for words, reason in (
        (options[:4], "name the vehicle that is simulated: --type, or --scenario"),
        ((*options[:2], "--tracked-point", "0.1"), "--tracked-point must be two numbers such as 0.15,-0.01"),
        ((*options, "--run", "2"), "the table has no column 'run'"),
        ((), "the table has no column 'time'; name it, such as --columns time=t [ms]"),
    ):
        assert reason in refused("compare", str(table), *words)


def test_the_twin_of_a_recording_is_the_car_itself(file: Path, tmp_path: Path) -> None:
    (drive,) = read_drives(file)
    gaps = record_twin(drive, "nigel", tmp_path / "twin.mcap", restart=0.4)
    assert len(gaps) == 101
    assert gaps[[0, 40, 80]] == pytest.approx([0.0] * 3, abs=1e-12)  # where the prediction starts
    # the state of the wheels is not in the log, so that a prediction starts 1 tick of the motion wrong at most
    assert gaps.max() < 0.01 * drive.speed.max()
    other = record_twin(drive, "nigel_2023", tmp_path / "other.mcap", restart=5.0)
    assert other[-1] == pytest.approx(compare_drive(drive, type_="nigel_2023").differences["distance"][-1], abs=1e-9)
    with open_recording(tmp_path / "other.mcap") as recording:
        assert recording["V1/own/twin"][-1, 0] == pytest.approx(other[-1], abs=0.05 * other.max())  # each 40 ms
        positions = recording["V1/pose/position"]
        np.testing.assert_allclose(positions[-1, :2], (drive.x[-1], drive.y[-1]), atol=0.01)
    with pytest.raises(RecordingError, match="must be positive, not 0 s"):
        record_twin(drive, "nigel", tmp_path / "no.mcap", restart=0.0)


def test_the_command_twin_needs_the_log_and_the_vehicle(file: Path, tmp_path: Path) -> None:
    output = ("--output", str(tmp_path / "twin.mcap"), "--no-show")
    assert "the drive is too short" in refused("twin", "--replay", str(file), "--vehicle", "nigel", *output)
    assert "must end in .mcap" in refused("twin", "--replay", str(file), "--vehicle", "nigel", "--output", "a.csv")
    assert "--replay" in refused("twin", "--vehicle", "nigel")
