"""The fractions that floats in files are meant as, and the whole parts of one of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

SIMPLE = 10**6
"""Greatest denominator of a fraction that is read from the digits of its float."""


def exact_fraction(number: float | Fraction) -> Fraction:
    """The fraction that a number is meant as: 0.1 is one tenth, and 0.03333333333333333, the float of 1/30, is 1/30.

    That is the nearest fraction with a denominator of at most `SIMPLE` if it has the same float, and otherwise the
    decimal fraction as which the float prints.
    """
    printed = Fraction(str(number))
    nearest = printed.limit_denominator(SIMPLE)
    return nearest if float(nearest) == number else printed


def whole_parts(whole: float | Fraction, *, longest: float, shortest: float) -> Iterator[float]:
    """The floats from `longest` down to `shortest` of which `whole` is a whole number."""
    exact = exact_fraction(whole)
    for count in range(math.ceil(exact / exact_fraction(longest)), math.floor(exact / exact_fraction(shortest)) + 1):
        part = float(exact / count)
        if exact_fraction(part) * count == exact:
            yield part
