"""Compiled code reads and writes the tables of a Pinned as those of an argument that Numba takes apart."""

from __future__ import annotations

import pickle
from typing import Any, NamedTuple

import numpy as np
import pytest

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit_uncounted, resolved, signature_of
from autodrive.base.pinned import Pinned, held


class Inner(NamedTuple):
    scale: float
    counts: Integers


class Tables(NamedTuple):
    values: Floats
    inner: Inner
    ratio: tuple[int, int]
    rows: Any
    empty: Floats


RECORD = np.dtype([("mass", np.float64), ("number", np.int64)])


def tables() -> Tables:
    rows = np.array([(1.5, 7), (2.5, 9)], RECORD)
    strided = np.arange(24.0).reshape(4, 6)[::2, 1:]
    return Tables(strided, Inner(-0.1, np.arange(5)), (2**62, -3), rows, np.zeros((0, 3)))


def summed(t: Tables, factor: float) -> float:
    """A figure to which all tables contribute, and a change of two of them."""
    total = t.inner.scale * factor + t.ratio[0] // 2**60 + t.ratio[1] + t.empty.shape[1]
    for i in range(t.values.shape[0]):
        for j in range(t.values.shape[1]):
            total += t.values[i, j] * (i + 10 * j)
    for count in t.inner.counts:
        total += count
    for row in range(t.rows.shape[0]):
        total += t.rows[row]["mass"] * t.rows[row]["number"]
    t.values[1, 2] = factor
    t.rows[1]["mass"] = factor
    return total


compiled_sum = jit_uncounted(summed)


@jit_uncounted
def summed_pinned(pinned: Pinned[Tables], factor: float) -> float:
    return compiled_sum(held(pinned), factor)


def test_the_tables_are_read_and_written_as_arguments_are() -> None:
    expected, given = tables(), tables()
    pinned = Pinned(given)
    call = resolved(summed_pinned, pinned, 0.5)
    for factor in (0.5, -2.0):
        assert call(pinned, factor) == summed(expected, factor)
    for column, other in zip((given.values, given.rows), (expected.values, expected.rows), strict=True):
        np.testing.assert_array_equal(column, other)
    assert held(pinned) is given


def test_the_type_is_that_of_the_tables_and_can_be_sent_to_another_process() -> None:
    first, other = Pinned(tables()), Pinned(tables())
    assert signature_of((first,)) == signature_of((other,)) == pickle.loads(pickle.dumps(signature_of((first,))))
    assert signature_of((Pinned(Inner(1.0, np.zeros(2, np.int64))),)) != signature_of((first,))
    assert " at 0x" not in str(first.type)  # compiled code is kept under that name


@pytest.mark.parametrize("wrong", [True, "text", None, [1.0]])
def test_what_a_pinned_cannot_hold_is_refused(wrong: Any) -> None:
    with pytest.raises(TypeError, match="a Pinned holds arrays, whole numbers, floats and tuples, not"):
        Pinned((np.zeros(3), wrong))
