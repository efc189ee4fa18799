"""Mounts, schedules, and the independence of the streams of chance."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from autodrive.sensors.catalog import SensorSuite, SensorSuiteSpec
from autodrive.sensors.encoder import EncoderSpec
from autodrive.sensors.lidar import LidarSpec
from autodrive.sensors.sensor import Mount, Schedule, random_generator
from autodrive.transforms import rotate

from .world import scene

MILLISECOND = Fraction(1, 1000)


def test_mount_yawed_to_the_left_looks_left():
    np.testing.assert_allclose(rotate(Mount(rotation_deg=(0, 0, 90)).orientation, (1, 0, 0)), (0, 1, 0), atol=1e-15)


def test_mount_with_positive_pitch_looks_down():
    assert rotate(Mount(rotation_deg=(0, 10, 0)).orientation, (1.0, 0.0, 0.0))[2] == pytest.approx(
        -math.sin(math.radians(10.0))
    )


def test_quaternion_of_a_mount_is_made_exactly_unit():
    assert math.hypot(*Mount(quaternion=(0.7071, 0, 0, 0.7071)).orientation) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"rotation_deg": (0, 0, 1), "quaternion": (1, 0, 0, 0)}, "not by both"),
        ({"quaternion": (1, 1, 0, 0)}, "has length 1, this one 1.414"),
    ],
)
def test_faulty_mount_is_refused(fields, text):
    with pytest.raises(ValidationError, match=text):
        Mount(**fields)


@given(st.fractions(min_value=Fraction(1, 10), max_value=500, max_denominator=1000), st.integers(1, 50))
def test_sample_is_due_at_the_first_tick_not_before_its_time(rate, substeps_a_tick):
    schedule = Schedule.of(rate, MILLISECOND, first=1)
    before, taken = None, 0
    for now in range(0, 3000, substeps_a_tick):
        due = int(now * MILLISECOND * rate)  # samples whose time n / rate has come
        assert schedule.is_due(now, before) == (due > (0 if before is None else int(before * MILLISECOND * rate)))
        taken += schedule.is_due(now, before)
        before = now
    assert taken <= int(before * MILLISECOND * rate)


def test_seven_hertz_never_drifts():
    schedule = Schedule.of(7.0, MILLISECOND, first=1)
    hour = 3_600_000
    due = [now for now in range(10, hour, 10) if schedule.is_due(now, now - 10)]
    assert len(due) == 7 * 3600 - 1  # the last of the hour falls on its end
    assert due[0] == 150  # 1/7 s = 142.86 ms
    assert due[6] == 1000


def test_a_decimal_rate_means_that_decimal():
    assert Schedule.of(0.1, MILLISECOND) == Schedule(1, 10_000)


def test_first_sample_is_known_at_the_start_unless_it_takes_a_period():
    assert Schedule.of(7.0, MILLISECOND).is_due(0, None)
    assert not Schedule.of(7.0, MILLISECOND, first=1).is_due(0, None)


def test_streams_differ_by_seed_vehicle_and_sensor():
    keys = [(1, "V1", "imu"), (2, "V1", "imu"), (1, "V2", "imu"), (1, "V1", "lidar"), (1, "imu", "V1")]
    assert len({random_generator(*key).random() for key in keys}) == len(keys)


def test_streams_are_the_same_on_every_machine_and_run():
    # Python's own hash() of a text changes from run to run; these values must not
    assert random_generator(7, "V1", "imu").integers(1 << 30, size=2).tolist() == [878656864, 50006556]


NOISY = SensorSuiteSpec(lidar=LidarSpec(rays=90, rate=40.0)).realistic()
SHAPES, STATE = scene([], vehicles=2, vehicle_position=[[0.0, 0.0, 0.2]] * 2)


def suite_of(spec=NOISY, vehicle=0, name="V1", seed=3):
    suite = SensorSuite(spec, vehicle=vehicle, name=name, substep=MILLISECOND, gravity=9.81)
    suite.reset(seed)
    return suite


def run(suite, ticks):
    for now in ticks:
        suite.sample(SHAPES, STATE, now)
    return np.concatenate([suite.imu.reading.angular_velocity, suite.imu.reading.linear_acceleration])


def test_another_sensor_or_vehicle_changes_nothing():
    ticks = range(0, 1000, 10)
    alone = run(suite_of(), ticks)
    without_lidar = run(suite_of(NOISY.model_copy(update={"lidar": None})), ticks)
    beside = suite_of()
    other = suite_of(vehicle=1, name="V2")
    for now in ticks:
        run(other, [now])
        last = run(beside, [now])
    np.testing.assert_array_equal(alone, without_lidar)
    np.testing.assert_array_equal(alone, last)


def test_same_seed_gives_the_same_readings_and_another_seed_others():
    ticks = range(0, 500, 10)
    np.testing.assert_array_equal(run(suite_of(), ticks), run(suite_of(), ticks))
    assert not np.array_equal(run(suite_of(), ticks), run(suite_of(seed=4), ticks))


@pytest.mark.parametrize("is_rolling", [False, True])
def test_restored_suite_has_the_same_future(is_rolling):
    things = NOISY.model_copy(update={"lidar": NOISY.lidar.model_copy(update={"is_rolling": is_rolling})})
    suite = suite_of(things)
    run(suite, range(0, 330, 10))
    saved = suite.save()
    first = run(suite, range(330, 700, 10)), suite.lidar.reading.ranges
    suite.reset(99)
    suite.restore(saved)
    again = run(suite, range(330, 700, 10)), suite.lidar.reading.ranges
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)


def test_slower_sensor_keeps_its_latest_reading_and_its_time():
    suite = suite_of(SensorSuiteSpec(encoders=EncoderSpec(rate=10.0)))
    run(suite, range(0, 160, 10))
    assert suite.encoders.reading.time == 0.1
    assert suite.imu.reading.time == 0.15


def test_readings_cannot_be_written():
    suite = suite_of()
    run(suite, range(0, 100, 10))
    arrays = [suite.encoders.reading.ticks, suite.encoders.reading.angles, suite.ips.reading.position]
    imu, scan = suite.imu.reading, suite.lidar.reading
    arrays += [imu.orientation, imu.euler, imu.angular_velocity, imu.linear_acceleration, scan.ranges, scan.intensities]
    assert not any(array.flags.writeable for array in arrays)
