"""Random numbers of sensor noise: three integers are the state, and every processor makes the same bits of them.

numpy's normal numbers use a logarithm of the C library, which is not the same on every processor. Here a number is a
hash of the stream and of its index in it (counter-based: Salmon and others, Parallel random numbers: as easy as 1, 2,
3). The hash is the finaliser of SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, figure
17), applied twice, each time with one of the two words of the key. Normal numbers come from the inverse of their
distribution (Wichura, Algorithm AS 241, PPND16).
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from autodrive.base.elementary import log
from autodrive.base.jit import jit_uncounted

Stream = NDArray[np.uint64]
"""Two words of the key and the number of random numbers that were drawn, shape (3,)."""

STEP = np.uint64(0x9E3779B97F4A7C15)
"""Odd number next to 2^64 divided by the golden ratio: successive indices differ in many bits."""

FIRST, SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
"""Factors of the finaliser."""

# fmt: off
CENTRE = (
    3.3871328727963666080, 133.14166789178437745, 1971.5909503065514427, 13731.693765509461125,
    45921.953931549871457, 67265.770927008700853, 33430.575583588128105, 2509.0809287301226727,
    42.313330701600911252, 687.18700749205790830, 5394.1960214247511077, 21213.794301586595867,
    39307.895800092710610, 28729.085735721942674, 5226.4952788528545610,
)
"""Coefficients of `_ratio` for probabilities from 0.075 to 0.925, from the constant term on."""

MIDDLE = (
    1.42343711074968357734, 4.63033784615654529590, 5.76949722146069140550, 3.64784832476320460504,
    1.27045825245236838258, 0.241780725177450611770, 0.0227238449892691845833, 7.74545014278341407640e-4,
    2.05319162663775882187, 1.67638483018380384940, 0.689767334985100004550, 0.148103976427480074590,
    0.0151986665636164571966, 5.47593808499534494600e-4, 1.05075007164441684324e-9,
)
"""Coefficients of `_ratio` for probabilities of 0.075 down to exp(-25), and their complements."""

TAIL = (
    6.65790464350110377720, 5.46378491116411436990, 1.78482653991729133580, 0.296560571828504891230,
    0.0265321895265761230930, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7,
    0.599832206555887937690, 0.136929880922735805310, 0.0148753612908506148525, 7.86869131145613259100e-4,
    1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15,
)
"""Coefficients of `_ratio` for probabilities below exp(-25), and their complements."""
# fmt: on

Ratio = tuple[float, float, float, float, float, float, float, float, float, float, float, float, float, float, float]


def new_stream(rng: np.random.Generator) -> Stream:
    """A stream whose key is drawn from `rng`; its integers are the same on every processor."""
    stream = np.zeros(3, np.uint64)
    stream[:2] = rng.bit_generator.random_raw(2)  # pyright: ignore[reportAttributeAccessIssue]  not in the stubs
    return stream


@jit_uncounted
def uniform(stream: Stream) -> float:
    """The next number: one of the centres of 2^52 equal parts of (0, 1), which are all exact."""
    stream[2] += np.uint64(1)
    bits = _mixed(_mixed(stream[2] * STEP + stream[0]) + stream[1])
    return (np.float64(bits >> np.uint64(12)) + 0.5) * 2.0**-52


@jit_uncounted
def normal(stream: Stream) -> float:
    """The next number of the standard normal distribution, between -8.2 and 8.2."""
    return inverse_normal(uniform(stream))


@jit_uncounted
def _mixed(z: np.uint64) -> np.uint64:
    """A permutation of the 64-bit numbers in which each bit depends on all."""
    z = (z ^ (z >> np.uint64(30))) * FIRST
    z = (z ^ (z >> np.uint64(27))) * SECOND
    return z ^ (z >> np.uint64(31))


@jit_uncounted
def inverse_normal(p: float) -> float:
    """The value below which a standard normal number is with probability p in (0, 1); relative error about 1e-16."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _ratio(r, CENTRE)
    r = sqrt(-log(p if q < 0.0 else 1.0 - p))
    size = _ratio(r - 1.6, MIDDLE) if r <= 5.0 else _ratio(r - 5.0, TAIL)
    return -size if q < 0.0 else size


@jit_uncounted
def _ratio(r: float, c: Ratio) -> float:
    """A polynomial of degree 7 over another one, whose constant term is 1."""
    over = ((((((c[7] * r + c[6]) * r + c[5]) * r + c[4]) * r + c[3]) * r + c[2]) * r + c[1]) * r + c[0]
    under = ((((((c[14] * r + c[13]) * r + c[12]) * r + c[11]) * r + c[10]) * r + c[9]) * r + c[8]) * r + 1.0
    return over / under
