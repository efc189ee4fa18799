"""Sine, cosine, tangent, arc tangent, exponential function and logarithm with the same bits on every processor.

The C library chooses its implementation for the processor, and the implementations differ in the last bit. The
functions here use only operations whose result is fixed: + - * /, comparisons, conversions, abs, copysign, frexp, ldexp
and %. They are plain scalar Python; compiled functions can call them, too. The error is less than 1 unit in the last
place. Zeros keep their sign, nan gives nan, and sine, cosine and tangent of infinity are nan.

Angles beyond 2^20 rad are first reduced by the number that is nearest to 2 pi, which is wrong by 4e-17 of the angle.
Nothing in a simulation has such angles: headings and the angles in files are below 1e4 rad, a rotation in a substep is
below 1e6 rad, or the world has diverged, and the angles of the wheels, which grow for ever, are only reported.

The methods are known: argument reduction after Cody and Waite (Software Manual for the Elementary Functions), double
numbers after Dekker, and logarithm after Tang; see Muller, Elementary Functions. `tests/base/test_elementary.py`
computes all constants again: a polynomial interpolates its function at the Chebyshev points of the interval; constants
are split from 60 digits.
"""

from __future__ import annotations

from math import copysign, frexp, inf, ldexp, nan
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numba.extending import register_jitable
else:
    try:
        from numba.extending import register_jitable
    except ImportError:  # a client without the simulator has no Numba

        def register_jitable(function=None, **_):
            """Return the function unchanged."""
            return function or register_jitable


SINE = (
    -0.1666666666666663,
    0.008333333333322137,
    -0.00019841269829576694,
    2.7557313608689723e-06,
    -2.5050744640882887e-08,
    1.5895990613081476e-10,
)
"""(sin(y) / y - 1) / z with z = y^2 in [0, 0.62]; for all |y| <= pi/4. First the constant term, as below."""

COSINE = (
    0.041666666666666644,
    -0.0013888888888881885,
    2.480158729427297e-05,
    -2.7557315711651096e-07,
    2.0875904044865593e-09,
    -1.1368783051196611e-11,
)
"""(cos(y) - 1 + z / 2) / z^2 with z = y^2 in [0, 0.62]."""

ARC_TANGENT = (
    -0.33333333333332965,
    0.19999999999898668,
    -0.14285714276030004,
    0.11111110645400818,
    -0.09090895913663022,
    0.07692069068549294,
    -0.06663764169113641,
    0.05858002638638403,
    -0.05120759840809464,
    0.04183185771209515,
    -0.02738422025426341,
    0.010082942679276898,
)
"""(atan(t) / t - 1) / z with z = t^2 in [0, 0.25]."""

EXPONENTIAL = (
    0.5000000000000016,
    0.1666666666666668,
    0.041666666666499014,
    0.00833333333332044,
    0.0013888888950716576,
    0.00019841269888818034,
    2.480148652118962e-05,
    2.7557241717515946e-06,
    2.763239620489659e-07,
    2.5109850389086566e-08,
)
"""(exp(r) - 1 - r) / r^2 with r in [-0.347, 0.347]; log(2) / 2 is 0.3466."""

LOGARITHM = (
    0.6666666666666735,
    0.3999999999941163,
    0.28571428743244637,
    0.22222198467811358,
    0.18183570667073265,
    0.15313867163861714,
    0.14797987574764562,
)
"""(log((1 + s) / (1 - s)) / s - 2) / z with z = s^2 in [0, 0.0295]; for numbers in [sqrt(1/2), sqrt(2)]."""

HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487111665e-21, 8.4784276603689e-32)
"""pi / 2 in four parts: three of 33 bits, whose products with 20 bits are exact, and the rest."""

HALF_PI_TAIL = 6.077100506506192e-11
"""pi / 2 without its first part."""

QUARTER_PI = (0.7853981633974483, 3.061616997868383e-17)
"""pi / 4 in two parts; 3 and 4 times the first, which has 50 bits, are exact."""

LOG_2 = (0.6931471803691238, 1.9082149292705877e-10)
"""log(2) in two parts; products of the first, which has 32 bits, with 21 bits are exact."""

TWO_PI = 6.283185307179586
TWO_OVER_PI = 0.6366197723675814
LOG2_E = 1.4426950408889634
SQUARE_ROOT_OF_HALF = 0.7071067811865476

EXP_RANGE = (-745.1332191019412, 709.782712893384)
"""Below the first `exp` is 0, above the second it is infinite."""

SMALL, LARGE = 2.0**-200, 2.0**200
"""Factors that change only the exponent of a number."""

ROUND = 6755399441055744.0
"""1.5 * 2^52. Adding and subtracting it rounds a number to the nearest integer, if the number is below 2^51."""

SPLIT = 134217729.0
"""2^27 + 1; splits a number in two of at most 26 bits each (Dekker, after Veltkamp)."""


@register_jitable
def sin(x: float) -> float:
    """Sine of an angle [rad]."""
    if abs(x) <= QUARTER_PI[0]:
        return _sine(x, 0.0)[0]
    quadrant, y, rest = _reduced(x)
    value = _cosine(y, rest)[0] if quadrant & 1 else _sine(y, rest)[0]
    return -value if quadrant & 2 else value


@register_jitable
def cos(x: float) -> float:
    """Cosine of an angle [rad]."""
    if abs(x) <= QUARTER_PI[0]:
        return _cosine(x, 0.0)[0]
    quadrant, y, rest = _reduced(x)
    value = _sine(y, rest)[0] if quadrant & 1 else _cosine(y, rest)[0]
    return -value if (quadrant + 1) & 2 else value


@register_jitable
def tan(x: float) -> float:
    """Tangent of an angle [rad]."""
    if abs(x) < 1e-9:
        return x
    quadrant, y, rest = 0, x, 0.0
    if abs(x) > QUARTER_PI[0]:
        quadrant, y, rest = _reduced(x)
    s, s_rest = _sine(y, rest)
    c, c_rest = _cosine(y, rest)
    if quadrant & 1:
        return _quotient(-c, -c_rest, s, s_rest)[0]
    return _quotient(s, s_rest, c, c_rest)[0]


@register_jitable
def atan(x: float) -> float:
    """Arc tangent [rad], in [-pi/2, pi/2]."""
    a = abs(x)
    if a <= 0.5:
        return copysign(_arc(0.0, 1.0, a, 0.0), x)
    if a <= 2.0:  # pi/4 + atan((a - 1) / (a + 1))
        b, b_rest = _sum(a, 1.0)
        t, t_rest = _quotient(a - 1.0, 0.0, b, b_rest)
        return copysign(_arc(1.0, 1.0, t, t_rest), x)
    t, t_rest = 0.0, 0.0
    if not a > 1e17:  # pi/2 - atan(1 / a); beyond, 1 / a is less than the rounding error
        t, t_rest = _quotient(1.0, 0.0, a, 0.0)
    return copysign(_arc(2.0, -1.0, t, t_rest), x)


@register_jitable
def atan2(y: float, x: float) -> float:
    """Angle of the vector x, y [rad], in [-pi, pi]; signed zeros and infinities as in IEEE 754."""
    if x != x or y != y:  # noqa: PLR0124 (nan)
        return nan
    a, b = min(abs(x), abs(y)), max(abs(x), abs(y))
    eighths, sign, t, t_rest = 0.0, 1.0, 0.0, 0.0
    if a == inf:
        eighths = 1.0
    elif b > 0.0:
        t = a / b
        if t > 1e-9:  # otherwise the arc tangent is the quotient
            if not 1e-200 < b < 1e200:
                scale = SMALL if b > 1.0 else LARGE  # against overflow and underflow in the quotient
                a, b = a * scale, b * scale
            if t > 0.5:  # pi/4 + atan((a - b) / (a + b)), where a - b is exact
                eighths = 1.0
                c, c_rest = _sum(b, a)
                t, t_rest = _quotient(a - b, 0.0, c, c_rest)
            else:
                t, t_rest = _quotient(a, 0.0, b, 0.0)
    if abs(y) > abs(x):
        eighths, sign = 2.0 - eighths, -sign
    if copysign(1.0, x) < 0.0:
        eighths, sign = 4.0 - eighths, -sign
    return copysign(_arc(eighths, sign, t, t_rest), y)


@register_jitable
def exp(x: float) -> float:
    """E to the power of x; 0 and infinity beyond the range of numbers."""
    if x > EXP_RANGE[1]:
        return inf
    if not x >= EXP_RANGE[0]:
        return 0.0 if x < EXP_RANGE[0] else nan
    n = (x * LOG2_E + ROUND) - ROUND
    high, low = x - n * LOG_2[0], n * LOG_2[1]
    r = high - low
    rest = (high - r) - low
    c0, c1, c2, c3, c4, c5, c6, c7, c8, c9 = EXPONENTIAL
    p = c0 + r * (c1 + r * (c2 + r * (c3 + r * (c4 + r * (c5 + r * (c6 + r * (c7 + r * (c8 + r * c9))))))))
    w = 1.0 + r
    return ldexp(w + (((1.0 - w) + r) + (rest + rest * r + r * r * p)), int(n))


@register_jitable
def log(x: float) -> float:
    """Natural logarithm; -infinity for 0, nan for negative numbers."""
    if not 0.0 < x < inf:
        return x if x > 0.0 else (-inf if x == 0.0 else nan)
    m, exponent = frexp(x)
    if m < SQUARE_ROOT_OF_HALF:
        m, exponent = 2.0 * m, exponent - 1
    n, f = float(exponent), m - 1.0
    s = f / (2.0 + f)
    z = s * s
    c0, c1, c2, c3, c4, c5, c6 = LOGARITHM
    r = z * (c0 + z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * (c5 + z * c6))))))
    # log(1 + f) = 2 s + s r = f - s (f - r) = f - (f^2/2 - s (f^2/2 + r))
    half = 0.5 * f * f
    return n * LOG_2[0] - ((half - (s * (half + r) + n * LOG_2[1])) - f)


# -- parts -----------------------------------------------------------------------------------------------------------
# A pair is the sum of a number and a rest that is at most half a unit in the last place of the number.


@register_jitable
def _sine(y: float, rest: float) -> tuple[float, float]:
    """Sine of the pair y, rest in [-pi/4, pi/4], as a pair."""
    z = y * y
    c0, c1, c2, c3, c4, c5 = SINE
    r = c1 + z * (c2 + z * (c3 + z * (c4 + z * c5)))
    v = z * y
    correction = (z * (0.5 * rest - v * r) - rest) - v * c0
    value = y - correction
    return value, (y - value) - correction


@register_jitable
def _cosine(y: float, rest: float) -> tuple[float, float]:
    """Cosine of the pair y, rest in [-pi/4, pi/4], as a pair."""
    z = y * y
    c0, c1, c2, c3, c4, c5 = COSINE
    r = c0 + z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * c5))))
    half = 0.5 * z
    w = 1.0 - half
    correction = ((1.0 - w) - half) + (z * z * r - y * rest)
    value = w + correction
    return value, (w - value) + correction


@register_jitable
def _arc(eighths: float, sign: float, t: float, rest: float) -> float:
    """`eighths` * pi/4 + `sign` * atan(t + rest), with t in [-0.5, 0.5]."""
    z = t * t
    c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11 = ARC_TANGENT
    w = z * z
    even = c0 + w * (c2 + w * (c4 + w * (c6 + w * (c8 + w * c10))))
    odd = c1 + w * (c3 + w * (c5 + w * (c7 + w * (c9 + w * c11))))
    high = eighths * QUARTER_PI[0]
    value = high + sign * t
    lost = (high - value) + sign * t
    return value + (lost + (eighths * QUARTER_PI[1] + sign * (rest + t * (z * (even + z * odd)))))


@register_jitable
def _sum(a: float, b: float) -> tuple[float, float]:
    """The sum of two numbers as a pair, exactly (Knuth)."""
    value = a + b
    b_there = value - a
    return value, (a - (value - b_there)) + (b - b_there)


@register_jitable
def _quotient(a: float, a_rest: float, b: float, b_rest: float) -> tuple[float, float]:
    """The quotient of two pairs as a pair: a first quotient of 26 bits, and the remainder divided by b."""
    inverse = 1.0 / b
    q = a * inverse
    c = SPLIT * q
    q = c - (c - q)
    c = SPLIT * b
    b_high = c - (c - b)
    remainder = ((a - q * b_high) - q * (b - b_high)) + (a_rest - q * b_rest)  # the first two are exact
    more = remainder * inverse
    value = q + more
    return value, (q - value) + more


@register_jitable
def _reduced(x: float) -> tuple[int, float, float]:
    """Quadrant n modulo 4, and the pair x - n pi/2 in [-pi/4, pi/4]; nan for infinity and nan."""
    if not abs(x) <= 1048576.0:
        if not abs(x) < inf:
            return 0, nan, nan
        x = copysign(abs(x) % TWO_PI, x)
    n = (x * TWO_OVER_PI + ROUND) - ROUND
    high, low = x - n * HALF_PI[0], n * HALF_PI_TAIL
    y = high - low
    rest = (high - y) - low
    if abs(y) < 0.005:  # the rounding error of `low` is too large next to a multiple of pi/2
        y, rest = _sum(high, -n * HALF_PI[1])
        high, more = _sum(y, -n * HALF_PI[2])
        low = (rest + more) - n * HALF_PI[3]
        y = high + low
        rest = (high - y) + low
    return int(n) & 3, y, rest
