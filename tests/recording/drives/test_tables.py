"""Tables with a header become drives: columns, units, commands that are repeated or sparse, runs, poses only."""

from __future__ import annotations

import gzip
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from autodrive.recording import RecordingError
from autodrive.recording.drives import Drive, LogOptions, read_drives
from tests.recording.drives.logs import RADIUS, SPEED, circle, write


def read(path: Path, columns: str = "", **options: object) -> Drive:
    (drive,) = read_drives(path, LogOptions(columns=columns, **options))  # type: ignore[arg-type]  # pyright: ignore
    return drive


def same(drive: Drive, other: Drive, tolerance: float = 1e-9) -> bool:
    names = [field.name for field in fields(Drive)]
    values = [(getattr(drive, name), getattr(other, name)) for name in names if name != "source"]
    return all(np.allclose(a, b, rtol=0.0, atol=tolerance) if isinstance(a, np.ndarray) else a == b for a, b in values)


def test_poses_of_a_circle_give_its_speed_and_its_yaw_rate(tmp_path: Path) -> None:
    drive = read(write(tmp_path / "a.csv", circle()))
    assert drive.is_differentiated
    assert drive.problems == ()
    # the parabola through +-h takes (w h)^2 / 10 of the speed: 0.06 % at 0.75 rad/s; at the ends 4 times as much
    np.testing.assert_allclose(drive.speed, SPEED, rtol=3e-3)
    np.testing.assert_allclose(drive.yaw_rate, SPEED / RADIUS, rtol=1e-9)
    assert drive.lines[[0, -1]].tolist() == [2, 401]
    assert drive.throttle_unit == drive.steering_unit == "share"


@pytest.mark.parametrize(("point", "offset"), [((0.152, 0.0), -0.02), ((0.1, -0.05), 0.0), ((-0.3, 0.2), math.pi / 2)])
def test_the_rear_axle_follows_from_the_tracked_point(
    tmp_path: Path, point: tuple[float, float], offset: float
) -> None:
    log = circle(tracked_point=point)
    log["yaw"] = np.remainder(log["yaw"] - offset + math.pi, 2.0 * math.pi) - math.pi
    drive = read(write(tmp_path / "a.csv", log), tracked_point=point, heading_offset=offset)
    wanted = circle()
    np.testing.assert_allclose(drive.x, wanted["x"], atol=1e-12)
    np.testing.assert_allclose(drive.y, wanted["y"], atol=1e-12)
    np.testing.assert_allclose(drive.heading, wanted["yaw"], atol=1e-12)
    np.testing.assert_allclose(drive.speed, SPEED, rtol=3e-3)
    assert (drive.tracked_point, drive.heading_offset) == (point, offset)


def test_order_names_and_units_of_the_columns_do_not_matter(tmp_path: Path) -> None:
    log = circle()
    usual = read(write(tmp_path / "a.csv", log))
    turned = {
        "steer (us)": (log["steering"] - 0.5) / -0.001,
        "Yaw [deg]": np.degrees(log["yaw"]),
        "vicon y": log["y"] * 1000.0,
        "t [ms]": log["time"] * 1000.0,
        "vicon x [cm]": log["x"] * 100.0,
        "Throttle [%]": log["throttle"] * 100.0,
    }
    columns = "time=t,x=vicon x,y=vicon y [mm],steering=-steer (us)*0.001+0.5"
    assert same(read(write(tmp_path / "b.csv", turned), columns), usual)
    text = (tmp_path / "b.csv").read_text()
    (tmp_path / "c.csv").write_bytes(b"\xef\xbb\xbf" + text.replace(",", ";").replace("\n", "\r\n").encode())
    assert same(read(tmp_path / "c.csv", columns), usual)
    (tmp_path / "d.csv.gz").write_bytes(gzip.compress(text.encode()))
    assert same(read(tmp_path / "d.csv.gz", columns), usual)


def test_commands_in_units_keep_them_until_a_vehicle_takes_them(tmp_path: Path) -> None:
    log = circle()
    write(tmp_path / "a.csv", log | {"throttle": np.full(400, 5.4), "steering": np.degrees(log["steering"])})
    drive = read(tmp_path / "a.csv", "throttle=throttle [km/h],steering=steering [deg]")
    assert (drive.throttle_unit, drive.steering_unit) == ("m/s", "rad")
    assert drive.throttle == pytest.approx(1.5)
    assert drive.steering == pytest.approx(0.3)
    taken = drive.in_shares(6.0, 0.6)
    assert taken.throttle == pytest.approx(0.25)
    assert taken.steering == pytest.approx(0.5)
    assert taken.throttle_unit == taken.steering_unit == "share"
    assert drive.in_shares(1.0, 0.1).steering == pytest.approx(1.0)  # a command beyond the limit


def test_rows_with_either_a_command_or_a_pose(tmp_path: Path) -> None:
    """Poses at 50 Hz, commands at 10 Hz between them, in the order of time and exchanged by some milliseconds."""
    log = circle()
    poses = log | {name: np.full(400, np.nan) for name in ("throttle", "steering")}
    at = np.arange(0.013, 7.9, 0.1)
    nothing = np.full(len(at), np.nan)
    commands = {"time": at, "x": nothing, "y": nothing, "yaw": nothing}
    commands |= {"throttle": 0.4 + 0.001 * np.arange(len(at)), "steering": np.full(len(at), 0.3)}
    joined = {name: np.concatenate((poses[name], commands[name])) for name in log}
    order = np.argsort(joined["time"])
    drive = read(write(tmp_path / "a.csv", joined, order.tolist()))
    assert drive.command_time == pytest.approx(at)
    assert drive.command_period == pytest.approx(0.1)
    assert drive.throttle == pytest.approx(commands["throttle"])
    assert drive.time[0] == pytest.approx(0.02)  # before the first command, no command is known
    late = np.argsort(np.where(joined["time"] == joined["time"][order[40]], joined["time"] + 0.03, joined["time"]))
    exchanged = read(write(tmp_path / "b.csv", joined, late.tolist()))
    assert np.array_equal(exchanged.time, drive.time)
    later = read(tmp_path / "a.csv", clock_offset=-0.06)
    assert later.command_time == pytest.approx(at - 0.06)
    assert later.clock_offset == -0.06


def test_commands_that_are_repeated_count_once_and_the_switch_multiplies_the_throttle(tmp_path: Path) -> None:
    log = circle()
    row = np.arange(400)
    log["throttle"] = np.full(400, 0.5)
    log["message"] = np.asarray(300.0 + 0.1 * (row // 5), np.float64)
    log["safety"] = np.where((row >= 100) & (row < 200), 0.0, 1.0)
    drive = read(write(tmp_path / "a.csv", log), "command_time=message")
    assert len(drive.command_time) == 80
    assert drive.command_time[:3] == pytest.approx([0.0, 0.1, 0.2])
    assert drive.command_period == pytest.approx(0.1)
    assert drive.command_lines[:3].tolist() == [2, 7, 12]
    assert drive.throttle[19:22].tolist() == [0.5, 0.0, 0.0]
    assert drive.throttle[39:41].tolist() == [0.0, 0.5]
    held = read(tmp_path / "a.csv")  # without times of the commands: where they change
    assert held.command_time == pytest.approx([0.0, 2.0, 4.0])
    assert held.throttle.tolist() == [0.5, 0.0, 0.5]
    renamed = write(tmp_path / "b.csv", {"dead man" if name == "safety" else name: log[name] for name in log})
    (text,) = read(renamed, "command_time=message").problem_texts()
    assert text == "column 'dead man' is not used; if the motor is off where it is 0, add --columns 'safety=dead man'"


def test_each_run_of_a_table_is_a_drive(tmp_path: Path) -> None:
    log = circle()
    runs = ["first"] * 150 + ["second"] * 250
    drives = read_drives(write(tmp_path / "a.csv", {"run": runs, **log}))
    assert [len(drive.time) for drive in drives] == [150, 250]
    assert [drive.source for drive in drives] == [f"{tmp_path / 'a.csv'}, run {name}" for name in ("first", "second")]
    assert drives[1].lines[0] == 152
    assert drives[1].time[0] == 0.0


def test_a_quaternion_is_a_yaw(tmp_path: Path) -> None:
    log = circle()
    yaw = log.pop("yaw")
    zero = np.zeros(400)
    quaternion = {"qx": zero, "qy": zero, "qz": np.sin(yaw / 2), "qw": np.cos(yaw / 2)}
    drive = read(write(tmp_path / "a.csv", log | quaternion))
    np.testing.assert_allclose(drive.heading, yaw, atol=1e-12)


def test_speed_and_yaw_rate_without_poses_give_the_path(tmp_path: Path) -> None:
    log = circle()
    columns = {name: log[name] for name in ("time", "throttle", "steering")}
    columns |= {"speed": np.full(400, SPEED), "yaw_rate": np.full(400, SPEED / RADIUS)}
    drive = read(write(tmp_path / "a.csv", columns))
    assert not drive.has_pose
    assert not drive.is_differentiated
    # trapezoidal rule: the error of the circle is (w step)^2 / 12 of its size
    np.testing.assert_allclose(drive.x, log["x"], atol=1e-4)
    np.testing.assert_allclose(drive.y, log["y"], atol=1e-4)


def test_an_encoder_without_a_sign_gets_it_from_the_poses(tmp_path: Path) -> None:
    log = circle()
    backward = {name: column[::-1].copy() for name, column in log.items()} | {"time": log["time"]}
    backward |= {"throttle": -log["throttle"], "speed": np.full(400, SPEED)}
    assert read(write(tmp_path / "a.csv", backward)).speed == pytest.approx(-SPEED)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ("tme=t", r"--columns: 'tme' is not known\. Known: .*Did you mean 'time'"),
        ("time", "'time' must be such as time=t or yaw=psi"),
        ("x=a,x=b", "'x' is named twice"),
        ("x=vicon", r"the table has no column 'vicon'\. Known: time, x, y, yaw, throttle, steering"),
        ("yaw=yaw [m]", r"'m' is no unit of 'yaw' \(column 'yaw'\)\. Known: rad, mrad, deg"),
        ("yaw=yaw/0", "'yaw' is divided by 0"),
        ("yaw=yaw*0", "the scale of 'yaw' must not be 0"),
        ("x=y*1e999", "its numbers must be finite"),
    ],
)
def test_wrong_columns_are_refused(tmp_path: Path, columns: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        read(write(tmp_path / "a.csv", circle(1.0)), columns)
