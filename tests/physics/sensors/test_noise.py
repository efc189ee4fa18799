"""Statistics of the noise. Seeds are fixed; bounds are five standard errors (1 in 2 million fails)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.base.arrays import Floats
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.base.units import DEGREE, STANDARD_GRAVITY
from autodrive.base.yaml_files import parse
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuNoise, ImuSpec
from autodrive.physics.sensors.ips import IpsSpec
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.lidar.noise import RPLIDAR_A1M8, LidarNoise
from autodrive.physics.sensors.noise import NoiseSpec, corrupt
from autodrive.physics.sensors.random_stream import new_stream
from autodrive.physics.sensors.settings import configured_sensors
from autodrive.protocol.codec import encode
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.one_sensor import OneSensor
from tests.support.sensor_scenes import BOX, Solid, scene


def series(spec: NoiseSpec, channels: int, samples: int, dt: float = 0.01, seed: int = 1) -> Floats:
    """Errors over time, shape (samples, channels)."""
    columns = np.tile((spec.sigma, spec.offset, spec.walk, spec.step), (channels, 1))
    bias, stream = np.zeros(channels), new_stream(np.random.default_rng(seed))
    out = np.zeros((samples, channels))
    for k, row in enumerate(out):
        corrupt(row, columns, bias, stream, dt if k else 0.0)
    return out


def test_white_noise_is_white_with_the_given_sigma_and_zero_mean() -> None:
    errors = series(NoiseSpec(sigma=0.3), 1, 40_000)[:, 0]
    n = len(errors)
    assert abs(errors.mean()) < 5 * 0.3 / math.sqrt(n)
    assert errors.std() == pytest.approx(0.3, rel=5 / math.sqrt(2 * n))
    assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 5 / math.sqrt(n)


def test_offset_stays_until_reset_and_differs_between_resets() -> None:
    ips = OneSensor(IpsSpec(noise=NoiseSpec(offset=2.0)), scene([]))
    offsets: list[Floats] = []
    for seed in range(333):
        ips.reset(seed)
        offsets.append(ips.sample(0.0).position)
        np.testing.assert_array_equal(ips.sample(5.0).position, offsets[-1])
    errors = np.concatenate(offsets)
    assert errors.std() == pytest.approx(2.0, rel=5 / math.sqrt(2 * len(errors)))
    assert abs(np.corrcoef(errors[:-3], errors[3:])[0, 1]) < 5 / math.sqrt(len(errors))


@pytest.mark.parametrize("dt", [0.01, 0.04])
def test_variance_of_the_bias_walk_grows_with_time_at_any_rate(dt: float) -> None:
    walk, channels = 0.2, 4000
    errors = series(NoiseSpec(walk=walk), channels, 1 + round(4.0 / dt), dt)
    for t in (1.0, 2.0, 4.0):
        assert errors[round(t / dt)].var() == pytest.approx(walk**2 * t, rel=5 * math.sqrt(2 / channels))


def test_output_is_rounded_to_the_resolution() -> None:
    values = np.array([0.3, -0.4, 1.0])
    corrupt(values, np.tile((0.0, 0.0, 0.0, 0.25), (3, 1)), np.zeros(3), new_stream(np.random.default_rng(1)), 0.0)
    np.testing.assert_array_equal(values, (0.25, -0.5, 1.0))


def test_sensors_are_exact_by_default() -> None:
    where = scene([], vehicle_position=[[0.1, 0.2, 0.3]], wheel_rotation=[0.0, 0.0, 1.0, 1.0])
    for spec in (EncoderSpec(), IpsSpec(), ImuSpec(), LidarSpec()):
        readings = [OneSensor(spec, where), OneSensor(spec, where)]
        readings[1].reset(1)
        first, other = (encode(sensor.sample()) for sensor in readings)
        assert first == other


def test_encoders_and_ips_have_the_noise_of_their_specs() -> None:
    ips, encoders = (OneSensor(spec(noise=NoiseSpec(sigma=0.1)), scene([])) for spec in (IpsSpec, EncoderSpec))
    n = 3000
    positions = np.array([ips.sample().position for _ in range(n)])
    angles = np.array([encoders.sample().angles for _ in range(n)])
    assert positions.std() == pytest.approx(0.1, rel=5 / math.sqrt(2 * 3 * n))
    assert angles.std() == pytest.approx(0.1, rel=5 / math.sqrt(2 * 2 * n) + 0.02)  # a tick is 3 % of sigma


def test_quaternion_and_euler_angles_of_a_noisy_imu_agree() -> None:
    noise = ImuNoise(orientation=NoiseSpec(sigma=0.02))
    imu = OneSensor(ImuSpec(noise=noise), scene([]))
    tilts = []
    reading = imu.sample()
    for _ in range(2000):
        reading = imu.sample()
        m = rotation_from_quaternion(reading.orientation)
        assert reading.euler[2] == pytest.approx(math.atan2(m[3], m[0]), abs=1e-12)
        assert np.linalg.norm(reading.orientation) == pytest.approx(1.0, abs=1e-12)
        tilts.append(reading.euler)
    # Euler angles of a small turn are its components, up to its square (0.02^2)
    np.testing.assert_allclose(np.std(tilts, axis=0), 0.02, rtol=5 / math.sqrt(2 * 2000) + 0.02)
    assert not np.any(reading.angular_velocity)


def test_realistic_imu_has_the_noise_of_the_data_sheet() -> None:
    imu = OneSensor(parse("noise: realistic", ImuSpec), scene([]))
    n = 5000
    readings = [imu.sample(0.01 * k) for k in range(n)]
    gyro = np.std([r.angular_velocity for r in readings], axis=0)
    acceleration = np.std([r.linear_acceleration for r in readings], axis=0)
    # data sheet: total RMS noise of the gyroscope 0.1 deg/s; 0.01 deg/s/sqrt(Hz) at 92 Hz agrees within 5 %
    np.testing.assert_allclose(gyro, 0.1 * DEGREE, rtol=0.05 + 5 / math.sqrt(2 * n))
    np.testing.assert_allclose(acceleration, 300e-6 * math.sqrt(94) * STANDARD_GRAVITY, rtol=5 / math.sqrt(2 * n))


def wall_ranges(noise: LidarNoise, scans: int = 20, distance: float = 4.0) -> Floats:
    """Ranges of four rays perpendicular to four walls, shape (scans, 4)."""
    solids = [
        Solid(BOX, (0.5, 5.0, 5.0), (distance + 0.5, 0.0, 0.0)),
        Solid(BOX, (0.5, 5.0, 5.0), (-distance - 0.5, 0.0, 0.0)),
        Solid(BOX, (5.0, 0.5, 5.0), (0.0, distance + 0.5, 0.0)),
        Solid(BOX, (5.0, 0.5, 5.0), (0.0, -distance - 0.5, 0.0)),
    ]
    lidar = OneSensor(LidarSpec(rays=4, rate=1000.0, noise=noise), scene(solids, vehicle_position=[[0.0, 0.0, 0.2]]))
    return np.array([lidar.sample().ranges for _ in range(scans)])


@pytest.mark.parametrize("distance", [0.5, 4.0])
def test_range_noise_has_a_constant_and_a_relative_part(distance: float) -> None:
    n = 4 * 2000
    ranges = wall_ranges(LidarNoise(sigma=0.01, relative_sigma=0.02), n // 4, distance)
    expected = math.hypot(0.01, 0.02 * distance)
    assert abs(ranges.mean() - distance) < 5 * expected / math.sqrt(n)
    assert ranges.std() == pytest.approx(expected, rel=5 / math.sqrt(2 * n))


def test_dropout_is_the_probability_of_no_return() -> None:
    n, share = 4 * 2500, 0.05
    lost = np.isposinf(wall_ranges(LidarNoise(dropout=share), n // 4))
    assert lost.mean() == pytest.approx(share, abs=5 * math.sqrt(share * (1 - share) / n))


def test_scale_error_is_common_to_all_rays_and_scans() -> None:
    ranges = wall_ranges(LidarNoise(scale=0.01))
    assert np.ptp(ranges) < 1e-12
    assert ranges[0, 0] != 4.0


def test_realistic_lidar_is_within_one_percent_in_99_percent_of_the_rays() -> None:
    ranges = wall_ranges(RPLIDAR_A1M8, 500)
    seen = ranges[np.isfinite(ranges)]
    assert (abs(seen - 4.0) <= 0.04 + 0.25e-3).mean() > 0.99  # three sigma (99.7 %) plus half a step
    assert np.isposinf(ranges).mean() < 0.02


def test_the_noise_of_a_data_sheet_belongs_to_the_lidar() -> None:
    spec = parse("{noise: realistic, data_sheet: {sigma: 0.01, step: 0.001}}", LidarSpec)
    ranges = wall_ranges(spec.noise, 500)
    # rounding to 1 mm adds a variance of (1 mm)^2 / 12, 0.1 % of the total; 2000 samples
    assert ranges.std() == pytest.approx(0.01, rel=0.01 + 5 / math.sqrt(2 * 2000))
    np.testing.assert_allclose(ranges / 0.001, np.round(ranges / 0.001), atol=1e-9)
    assert parse("noise: realistic", LidarSpec).noise == RPLIDAR_A1M8


@pytest.mark.parametrize(
    ("vehicle", "noise"),
    [
        ("nigel", RPLIDAR_A1M8),
        *((vehicle, LidarNoise(sigma=0.01, step=0.001)) for vehicle in ("roboracer", "roboracer_f1tenth")),
    ],
)
def test_realistic_sensors_have_the_noise_of_the_lidar_of_their_vehicle(vehicle: str, noise: LidarNoise) -> None:
    spec = load_vehicle(vehicle)
    sensors = configured_sensors(spec.sensors, {}, {}, is_realistic=True)
    assert isinstance(sensors["lidar"].spec, LidarSpec)
    assert sensors["lidar"].spec.noise == noise
    assert spec.sensors.lidar is not None
    assert spec.sensors.lidar.noise == LidarNoise()


def test_noise_does_not_change_a_ray_without_return() -> None:
    lidar = OneSensor(LidarSpec(noise=RPLIDAR_A1M8), scene([], vehicle_position=[[0.0, 0.0, 0.2]]))
    assert np.isposinf(lidar.sample().ranges).all()
