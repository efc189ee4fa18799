"""The elementary functions: their error in 60 digits, special values, constants, and the same bits when compiled."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from autodrive.base import elementary
from autodrive.base.arrays import Floats
from autodrive.base.jit import jit

DIGITS = 60
MOST = 2.0**20
"""Angles up to here are reduced exactly [rad]."""

LARGE = (math.nextafter(MOST, math.inf), -1234567.0, 1e7, 3e9, -1e12, 1.79e308)
"""Angles that are reduced approximately [rad]."""

COUNT = 100
"""Of random arguments in each range."""


def of_any_size(rng: random.Random) -> float:
    return rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-323.0, 308.0)


def angles(rng: random.Random) -> Iterator[tuple[float]]:
    for reach in (0.79, 7.0, 1e5, MOST):
        yield from ((rng.uniform(-reach, reach),) for _ in range(COUNT))
    for _ in range(COUNT):
        yield (rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-323.0, 6.0),)
        multiple = rng.randrange(1, 660_000) * math.pi / 2.0
        yield (multiple,)
        yield (math.nextafter(multiple / 2.0, rng.choice((0.0, math.inf))),)
    yield from ((x,) for x in (5e-324, 2.2e-308, MOST))


def ratios(rng: random.Random) -> Iterator[tuple[float]]:
    for reach in (0.51, 2.1, 100.0):
        yield from ((rng.uniform(-reach, reach),) for _ in range(COUNT))
    yield from ((of_any_size(rng),) for _ in range(COUNT))
    for x in (0.5, 1.0, 2.0, 1e17):
        yield from ((math.nextafter(x, side),) for side in (0.0, x, math.inf))


def vectors(rng: random.Random) -> Iterator[tuple[float, float]]:
    yield from ((rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)) for _ in range(4 * COUNT))
    yield from ((of_any_size(rng), of_any_size(rng)) for _ in range(COUNT))
    for _ in range(2 * COUNT):  # both are very small or very large
        y, x, size = rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), 10.0 ** rng.uniform(-322.0, 307.0)
        yield y * size, x * size


def exponents(rng: random.Random) -> Iterator[tuple[float]]:
    for reach in (0.35, 10.0, 700.0):
        yield from ((rng.uniform(-reach, reach),) for _ in range(COUNT))
    yield from ((rng.uniform(-745.0, -700.0),) for _ in range(COUNT))
    yield from ((10.0 ** rng.uniform(-320.0, 0.0),) for _ in range(COUNT))
    yield from ((x,) for x in (709.782712893384, -745.1332191019411, -708.4))


def positives(rng: random.Random) -> Iterator[tuple[float]]:
    yield from ((abs(of_any_size(rng)),) for _ in range(COUNT))
    yield from ((rng.uniform(0.5, 2.0),) for _ in range(COUNT))
    yield from ((1.0 + rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-15.0, -1.0),) for _ in range(COUNT))
    yield from ((x,) for x in (5e-324, 2.2e-308, 1.79e308, 0.7071067811865475, 0.7071067811865476))


FUNCTIONS: dict[str, Callable[[random.Random], Iterator[tuple[float, ...]]]] = {
    "sin": angles,
    "cos": angles,
    "tan": angles,
    "atan": ratios,
    "atan2": vectors,
    "exp": exponents,
    "log": positives,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_error_is_less_than_one_unit_in_the_last_place(name: str) -> None:
    ours, exact = getattr(elementary, name), getattr(mpmath, name)
    with mpmath.workdps(DIGITS):
        for arguments in FUNCTIONS[name](random.Random(name)):
            true = exact(*map(mpf, arguments))
            error = abs(mpf(ours(*arguments)) - true) / mpf(math.ulp(float(true)))
            assert error < 1, f"{name}{arguments}: {float(error):.2f} units"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_special_values_are_those_of_the_c_library(name: str) -> None:
    ours, library = getattr(elementary, name), getattr(math, name)
    large = () if FUNCTIONS[name] is angles else (1.79e308, -1.79e308)
    special = (0.0, -0.0, 1.0, -1.0, 5e-324, -5e-324, math.inf, -math.inf, math.nan, -1e-320, *large)
    for arguments in [(y, x) for y in special for x in special] if name == "atan2" else [(x,) for x in special]:
        value = ours(*arguments)
        try:
            expected = library(*arguments)
        except (ValueError, OverflowError):  # Python raises where the C library returns nan or infinity
            overflows, is_pole = name == "exp", name == "log" and arguments[0] == 0.0
            expected = math.inf if overflows else -math.inf if is_pole else math.nan
        assert value == pytest.approx(expected, rel=3e-16, abs=0.0, nan_ok=True), arguments
        if expected == 0.0:
            assert math.copysign(1.0, value) == math.copysign(1.0, expected), arguments


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_larger_angles_are_wrong_by_the_error_of_2_pi(name: str) -> None:
    """2 pi as a number is wrong by 3.9e-17 of itself. 1.1 of that: the reduced angle is rounded, too."""
    exact, slope = getattr(math, name), {"sin": 1.0, "cos": 1.0, "tan": 200.0}[name]
    for x in LARGE[:-1]:
        assert getattr(elementary, name)(x) == pytest.approx(exact(x), rel=0.0, abs=slope * 1.1 * 3.9e-17 * abs(x))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_compiled_functions_return_the_same_bits(name: str) -> None:
    function = getattr(elementary, name)
    arguments = np.array(
        [*FUNCTIONS[name](random.Random(name)), *([(x,) for x in LARGE] if FUNCTIONS[name] is angles else [])]
    )

    @jit
    def of_one(rows: Floats, out: Floats) -> None:
        for i in range(len(rows)):
            out[i] = function(rows[i, 0])

    @jit
    def of_two(rows: Floats, out: Floats) -> None:
        for i in range(len(rows)):
            out[i] = function(rows[i, 0], rows[i, 1])

    out = np.full(len(arguments), np.inf)
    (of_one if arguments.shape[1] == 1 else of_two)(arguments, out)
    assert out.tobytes() == np.array([function(*row) for row in arguments.tolist()]).tobytes()


# -- constants -------------------------------------------------------------------------------------------------------

Function = Callable[[Any], Any]


def interpolation(function: Function, points: list[Any]) -> tuple[float, ...]:
    """Coefficients of the polynomial through the function at these points, the constant term first."""
    n = len(points)
    powers = mpmath.matrix([[x**j for j in range(n)] for x in points])
    return tuple(float(c) for c in mpmath.lu_solve(powers, mpmath.matrix([function(x) for x in points])))


def chebyshev(count: int) -> list[Any]:
    """Zeros of the Chebyshev polynomial of this degree, in [-1, 1], the largest first."""
    return [mpmath.cos((2 * i + 1) * mpmath.pi / (2 * count)) for i in range(count)]


def from_zero(count: int, end: str) -> list[Any]:
    """Chebyshev points scaled to [0, end] such that the smallest is 0; without it, as a factor z is exact there."""
    points = chebyshev(count + 1)
    return [mpf(end) * (x - points[-1]) / (1 - points[-1]) for x in points[:-1]]


def around_zero(count: int, end: str) -> list[Any]:
    """Chebyshev points in [-end, end] without the two next to 0, as a factor r^2 is exact there."""
    points = chebyshev(count + 2)
    return [mpf(end) * x for x in points if x not in sorted(points, key=abs)[:2]]


def root(function: Function) -> Function:
    return lambda z: function(mpmath.sqrt(z))


POLYNOMIALS: dict[str, tuple[Callable[[int, str], list[Any]], str, Function]] = {
    "SINE": (from_zero, "0.62", root(lambda y: (mpmath.sin(y) / y - 1) / y**2)),
    "COSINE": (from_zero, "0.62", root(lambda y: (mpmath.cos(y) - 1 + y**2 / 2) / y**4)),
    "ARC_TANGENT": (from_zero, "0.25", root(lambda t: (mpmath.atan(t) / t - 1) / t**2)),
    "LOGARITHM": (from_zero, "0.0295", root(lambda s: (mpmath.log((1 + s) / (1 - s)) / s - 2) / s**2)),
    "EXPONENTIAL": (around_zero, "0.347", lambda r: (mpmath.exp(r) - 1 - r) / r**2),
}


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_polynomials_interpolate_their_functions(name: str) -> None:
    points, end, function = POLYNOMIALS[name]
    with mpmath.workdps(DIGITS):
        coefficients = getattr(elementary, name)
        assert coefficients == interpolation(function, points(len(coefficients), end))


def parts(value: Any, bits: list[int]) -> tuple[float, ...]:
    """Consecutive parts of a number with so many bits each; the last part is what remains, rounded."""
    found = []
    for count in bits:
        unit = mpf(2) ** (int(mpmath.floor(mpmath.log(value, 2))) + 1 - count)
        found.append(float(mpmath.floor(value / unit) * unit))
        value -= mpf(found[-1])
    return *found, float(value)


def test_constants_are_exact() -> None:
    with mpmath.workdps(DIGITS):
        half_pi = mpmath.pi / 2
        assert parts(half_pi, [33, 33, 33]) == elementary.HALF_PI
        assert parts(half_pi, [33])[1] == elementary.HALF_PI_TAIL
        assert parts(half_pi / 2, [50]) == elementary.QUARTER_PI
        assert float(4 * half_pi) == elementary.TWO_PI
        assert parts(mpmath.log(2), [32]) == elementary.LOG_2
        assert float(1 / half_pi) == elementary.TWO_OVER_PI
        assert float(1 / mpmath.log(2)) == elementary.LOG2_E
        assert float(mpmath.sqrt(mpf("0.5"))) == elementary.SQUARE_ROOT_OF_HALF
