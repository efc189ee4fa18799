"""The random numbers of sensors: their distribution, their independence, and the inverse of the normal distribution."""

import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.base.arrays import Floats
from autodrive.physics.sensors.random_stream import Stream, inverse_normal, new_stream, normal, uniform

N = 200_000


def stream(seed: int = 1) -> Stream:
    return new_stream(np.random.default_rng(seed))


def uniforms(source: Stream, count: int = N) -> Floats:
    return np.array([uniform(source) for _ in range(count)])


@given(st.floats(min_value=2.0**-54, max_value=1.0 - 2.0**-53))
def test_inverse_of_the_normal_distribution_agrees_with_python(p: float) -> None:
    assert inverse_normal(p) == pytest.approx(statistics.NormalDist().inv_cdf(p), rel=2e-15, abs=1e-16)


def test_uniform_numbers_are_uniform() -> None:
    numbers = uniforms(stream())
    assert 0.0 < numbers.min() < numbers.max() < 1.0
    # Kolmogorov and Smirnov: the distance exceeds 2.55 / sqrt(n) once in 220,000
    distance = np.abs(np.sort(numbers) - (np.arange(N) + 0.5) / N).max() + 0.5 / N
    assert distance < 2.55 / math.sqrt(N)
    pairs, _, _ = np.histogram2d(numbers[::2], numbers[1::2], bins=32, range=[[0, 1], [0, 1]])
    expected = N / 2 / 32**2
    chi_square, freedom = ((pairs - expected) ** 2 / expected).sum(), 32**2 - 1
    assert abs(chi_square - freedom) < 5 * math.sqrt(2 * freedom)


def test_each_bit_is_set_in_half_of_the_numbers() -> None:
    bits = (uniforms(stream(2)) * 2.0**52).astype(np.int64)
    shares = [np.mean(bits >> place & 1) for place in range(52)]
    assert np.abs(np.array(shares) - 0.5).max() < 5 * 0.5 / math.sqrt(N)


def test_streams_with_similar_keys_are_independent() -> None:
    keys = [np.array(key, np.uint64) for key in ((5, 9, 0), (6, 9, 0), (5, 8, 0), (5, 9, 1), (9, 5, 0))]
    numbers = np.array([uniforms(key, 40_000) for key in keys])
    numbers[3, :-1] = numbers[3, 1:].copy()  # that one begins one number later; now two later
    correlation = np.corrcoef(numbers) - np.eye(len(keys))
    assert np.abs(correlation).max() < 5 / math.sqrt(40_000)


def test_a_stream_continues_from_its_three_integers() -> None:
    one = stream(3)
    uniforms(one, 10)
    other = one.copy()
    assert int(one[2]) == 10
    assert [normal(one) for _ in range(5)] == [normal(other) for _ in range(5)]


def test_normal_numbers_have_the_moments_of_the_normal_distribution() -> None:
    source = stream(4)
    numbers = np.array([normal(source) for _ in range(N)])
    for power, moment, deviation in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert abs((numbers**power).mean() - moment) < 5 * math.sqrt(deviation / N), power
