"""The vehicles that are real cars predict logs of these cars, and the parts of the evaluation are right."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from autodrive.base.arrays import Floats
from autodrive.experiments.identification.accuracy import Accuracy, constant_motion, kinematic, measure_accuracy
from autodrive.experiments.identification.starts import Starts, starts_of
from autodrive.experiments.identification.synthetic import synthetic_drive
from autodrive.recording.drives import Drive, LogOptions, read_drives
from autodrive.scenario.kinds import find
from autodrive.scenario.vehicles.spec import load_vehicle

HERE = Path(__file__).parent
PLACES = [folder / "shared" / "data" / "real_cars" for folder in HERE.parents[3:]]
"""Where logs may be that are not part of the repository: that of the F1TENTH has no licence."""
DART = LogOptions(
    columns="time=vicon time,x=vicon x,y=vicon y,yaw=vicon yaw,safety=safety_value,command_time=elapsed time sensors",
    tracked_point=(0.115, -0.01),
    heading_offset=0.0077,
)
MOCAP = LogOptions(
    columns="throttle=speed_command [m/s],steering=steering_command [rad]",
    tracked_point=(0.152, 0.0),
    heading_offset=-0.0192,
    clock_offset=-0.06,
)
INSTANTS = (0.5, 1.0, 2.0)


def accuracy_of(vehicle: str, drives: list[Drive], every: float) -> Accuracy:
    spec = load_vehicle(vehicle)
    return measure_accuracy(starts_of(drives, spec, INSTANTS, every), spec, threads=1)


@pytest.fixture(scope="module")
def dart() -> Accuracy:
    """Of two parts of logs of DART: a ramp of the throttle up to 3 m/s, and slow circles."""
    drives = [drive for name in ("ramp", "slow") for drive in read_drives(HERE / "dart" / f"{name}.csv.gz", DART)]
    return accuracy_of("dart", drives, 1.5)


def test_dart_predicts_its_logs(dart: Accuracy) -> None:
    """The targets of free driving are 3.5, 12 and 35 cm; the battery and the trim of the day are not known."""
    medians = [dart.vehicle.at(time)[0] for time in INSTANTS]
    assert all(median < target for median, target in zip(medians, (0.035, 0.12, 0.35), strict=True)), dart.table()
    assert dart.vehicle.at(2.0)[0] < 0.7 * dart.others[1].at(2.0)[0], dart.table()  # of a kinematic car
    assert np.median(dart.circles.errors) < 0.05, dart.table()


def test_the_f1tenth_predicts_its_log() -> None:
    paths = [place / "mocap" / "teleop.csv.gz" for place in PLACES]
    path = next((path for path in paths if path.exists()), None)
    if path is None:
        pytest.skip(f"the logs of real cars are not beside the repository: {paths[0]}")
    drives = [drive for drive in read_drives(path, MOCAP) if drive.source.endswith((" 2", " 5", " 8"))]
    accuracy = accuracy_of("f1tenth_mocap", drives, 3.0)
    medians = [accuracy.vehicle.at(time)[0] for time in INSTANTS]
    assert all(median < target for median, target in zip(medians, (0.008, 0.025, 0.07), strict=True)), accuracy.table()
    assert accuracy.vehicle.at(1.0)[2] < np.radians(2.0), accuracy.table()
    assert accuracy.vehicle.at(1.0)[4] < 0.02, accuracy.table()
    assert np.median(accuracy.circles.errors) < 0.03, accuracy.table()
    assert accuracy.vehicle.at(2.0)[0] < 0.3 * accuracy.others[0].at(2.0)[0], accuracy.table()


@pytest.mark.parametrize("vehicle", ["f1tenth_mocap", "dart"])
def test_the_head_of_the_file_states_the_error(vehicle: str) -> None:
    head = find("vehicle", vehicle).read_text(encoding="utf-8").partition("\ntitle:")[0]
    assert re.search(r"[\d.]+ / [\d.]+ / [\d.]+ / [\d.]+ cm after 0\.5 / 1 / 2 / 5 s", head.replace("\n# ", " "))
    assert "Command.throttle" in head
    assert "Command.steering" in head


def test_constant_motion_is_that_of_a_circle(dart: Accuracy) -> None:
    starts = dart.starts
    motion = np.array([[2.0, 0.3, 0.8], [1.0, 0.0, 0.0]])
    two = Starts(**{**vars(starts.chosen(np.arange(2))), "motion": motion})
    predicted = constant_motion(two)
    for time, (along, across, heading, speed) in zip(INSTANTS, predicted[0].tolist(), strict=True):
        # a fine sum of the velocity, turned by the heading
        at = (np.arange(20000) + 0.5) * time / 20000
        velocity = (2.0 + 0.3j) * np.exp(0.8j * at)
        assert complex(along, across) == pytest.approx(complex(velocity.mean() * time), abs=1e-6)
        assert (heading, speed) == pytest.approx((0.8 * time, abs(2.0 + 0.3j)))
    assert predicted[1, :, 0].tolist() == pytest.approx(list(INSTANTS))


def test_a_kinematic_car_drives_circles_of_the_wheelbase(dart: Accuracy) -> None:
    spec = load_vehicle("dart")
    predicted = kinematic(dart.starts, spec)
    steering = dart.starts.commands(0.0, dart.starts.ticks)[..., 1]
    is_constant = np.ptp(steering, axis=1) < 1e-9
    assert is_constant.any()
    radius = spec.wheelbase / np.tan(spec.steering.angles(steering[is_constant, 0]))
    turned = predicted[is_constant, -1, 2]
    assert turned == pytest.approx(dart.starts.motion[is_constant, 0] * INSTANTS[-1] / radius)
    # the chord of a circle; 200 steps of a middle point rule
    chord = 2.0 * np.abs(radius * np.sin(0.5 * turned))
    assert np.hypot(predicted[is_constant, -1, 0], predicted[is_constant, -1, 1]) == pytest.approx(chord, rel=1e-4)


def test_a_vehicle_predicts_its_own_drive_exactly() -> None:
    """Starts, past commands, full scales and instants agree: what is left is the error of the parabola."""
    spec = load_vehicle("f1tenth_mocap")

    def commands(time: Floats) -> Floats:
        return np.column_stack((0.2 + 0.1 * np.sin(time), 0.6 * np.sign(np.sin(2.0 * time))))

    drive = synthetic_drive(spec, commands, 8.0, "synthetic")
    accuracy = measure_accuracy(starts_of([drive], spec, INSTANTS, 0.5), spec, threads=1)
    assert accuracy.vehicle.at(1.0)[0] < 0.004, accuracy.table()  # the yaw rate at a start is a mean over 0.2 s
    assert accuracy.others[1].at(1.0)[0] > 0.03, accuracy.table()
