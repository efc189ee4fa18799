"""Mounts, schedules, independence of the random streams, and save and restore."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import autodrive
from autodrive.base.arrays import Floats
from autodrive.base.transforms import rotate
from autodrive.physics.sensors.catalog import SensorSuiteSpec
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuNoise, ImuSpec
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.lidar.noise import RPLIDAR_A1M8
from autodrive.physics.sensors.sensor import Mount, Schedule, random_generator
from autodrive.physics.sensors.settings import configured_sensors
from autodrive.physics.sensors.suite import SensorSuite
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from tests.support.cars import car_file
from tests.support.sensor_scenes import SensorScene, scene

MILLISECOND = Fraction(1, 1000)


@pytest.mark.parametrize(
    ("mount", "ahead"),
    [
        (Mount(rotation_deg=(0, 0, 90)), (0, 1, 0)),  # positive yaw: to the left
        (Mount(rotation_deg=(0, 10, 0)), (math.cos(math.radians(10)), 0, -math.sin(math.radians(10)))),  # down
        (Mount(quaternion=(0.7071, 0, 0, 0.7071)), (0, 1, 0)),  # it is normalised
    ],
)
def test_the_orientation_of_a_mount_turns_its_axis(mount: Mount, ahead: tuple[float, ...]) -> None:
    np.testing.assert_allclose(rotate(mount.orientation, (1, 0, 0)), ahead, atol=1e-15)


@given(st.fractions(min_value=Fraction(1, 10), max_value=500, max_denominator=1000), st.integers(1, 50))
def test_sample_is_due_at_the_first_tick_at_or_after_its_time(rate: Fraction, substeps_a_tick: int) -> None:
    schedule = Schedule.of(rate, MILLISECOND)
    before: int | None = None
    taken = 0
    for now in range(0, 1000, substeps_a_tick):
        due = int(now * MILLISECOND * rate)  # samples with n / rate up to now
        assert schedule.is_due(now, before) == (before is None or due > int(before * MILLISECOND * rate))
        taken += schedule.is_due(now, before)
        before = now
    assert before is not None
    assert taken <= 1 + int(before * MILLISECOND * rate)


def test_seven_hertz_does_not_drift() -> None:
    schedule = Schedule.of(7.0, MILLISECOND)
    end = 360_000
    due = [now for now in range(10, end, 10) if schedule.is_due(now, now - 10)]
    assert len(due) == 7 * 360 - 1  # the last one is due exactly at the end
    assert due[0] == 150  # 1/7 s = 142.86 ms
    assert due[6] == 1000


def test_a_rate_is_read_as_its_decimal_fraction() -> None:
    assert Schedule.of(0.1, MILLISECOND) == Schedule(1, 10_000)


def test_streams_differ_by_seed_vehicle_and_sensor() -> None:
    keys = [(1, "V1", "imu"), (2, "V1", "imu"), (1, "V2", "imu"), (1, "V1", "lidar"), (1, "imu", "V1")]
    assert len({random_generator(*key).random() for key in keys}) == len(keys)


def test_streams_are_the_same_on_every_machine_and_in_every_run() -> None:
    # unlike Python's hash() of a string, these values must not change from run to run
    assert random_generator(7, "V1", "imu").integers(1 << 30, size=2).tolist() == [878656864, 50006556]


NOISY = SensorSuiteSpec(
    imu=ImuSpec(noise=ImuNoise.realistic()), lidar=LidarSpec(rays=90, rate=40.0, noise=RPLIDAR_A1M8)
)
TWO_CARS = scene([], vehicles=2, vehicle_position=[[0.0, 0.0, 0.2]] * 2)
ALONE = scene([], vehicle_position=[[0.0, 0.0, 0.2]])


def suite_of(*specs: SensorSuiteSpec, where: SensorScene = ALONE, seed: int = 3) -> SensorSuite:
    """The sensors of vehicles V1, V2 and so on."""
    configured = {
        f"V{i + 1}": configured_sensors(spec, {}, {}, is_realistic=False) for i, spec in enumerate(specs or [NOISY])
    }
    suite = SensorSuite(configured, *where, substep=MILLISECOND, substeps=10, gravity=9.81)
    suite.reset(seed)
    return suite


def run(suite: SensorSuite, ticks: Iterable[int], vehicle: int = 0) -> Floats:
    for now in ticks:
        suite.sample(now)
    imu = suite.readings(vehicle)["imu"]
    return np.concatenate([imu.angular_velocity, imu.linear_acceleration])


def test_readings_do_not_depend_on_other_sensors_and_vehicles() -> None:
    ticks = range(0, 1000, 10)
    alone = run(suite_of(), ticks)
    beside = suite_of(NOISY, SensorSuiteSpec(), where=TWO_CARS)
    np.testing.assert_array_equal(alone, run(suite_of(NOISY.model_copy(update={"lidar": None})), ticks))
    np.testing.assert_array_equal(alone, run(beside, ticks))
    assert not run(beside, [1000], vehicle=1).any()  # a sensor without noise, at rest


def test_readings_depend_on_the_seed_only() -> None:
    ticks = range(0, 500, 10)
    np.testing.assert_array_equal(run(suite_of(), ticks), run(suite_of(), ticks))
    assert not np.array_equal(run(suite_of(), ticks), run(suite_of(seed=4), ticks))


def test_sensor_with_a_low_rate_keeps_its_latest_reading() -> None:
    suite = suite_of(SensorSuiteSpec(encoders=EncoderSpec(rate=10.0)))
    run(suite, range(0, 160, 10))
    assert suite.readings(0)["encoders"].time == 0.1
    assert suite.readings(0)["imu"].time == 0.15


def test_readings_are_read_only() -> None:
    suite = suite_of()
    run(suite, range(0, 100, 10))
    arrays = [
        suite.readings(0)["encoders"].ticks,
        suite.readings(0)["encoders"].angles,
        suite.readings(0)["ips"].position,
    ]
    imu, scan = suite.readings(0)["imu"], suite.readings(0)["lidar"]
    arrays += [imu.orientation, imu.euler, imu.angular_velocity, imu.linear_acceleration, scan.ranges, scan.intensities]
    assert not any(array.flags.writeable for array in arrays)


def test_a_rate_of_many_digits_is_kept_in_a_long_run(tmp_path: Path) -> None:
    """The products of time and rate are integers of 64 bits in compiled code."""
    rate = 12.345678901234567
    car = VehiclePlacement(type=car_file(tmp_path, {"sensors.lidar.rate": rate}))
    world = autodrive.make(ScenarioSpec(vehicles={"V1": car}))
    scans = [world.step().vehicles["V1"].lidar for _ in range(300)]
    times = {scan.time for scan in scans if scan is not None}
    assert sorted(times) == [math.ceil(n / rate * 100) / 100 for n in range(math.floor(3.0 * rate) + 1)]
