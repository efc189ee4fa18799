"""Speeds and rates from measured poses: a local parabola that does not cross gaps."""

from __future__ import annotations

import numpy as np

from autodrive.base.arrays import Floats

LEAST_HALF_WIDTH, HALF_STEPS = 0.1, 2.5
"""The parabola goes through the rows within this time [s], and within so many usual steps, of its row."""


def usual_half_width(time: Floats) -> float:
    """Half width of the parabola for rows at these times [s]: 0.1 s at 100 Hz, 0.25 s at 10 Hz."""
    steps = np.diff(time)
    return max(LEAST_HALF_WIDTH, HALF_STEPS * float(np.median(steps))) * (1.0 + 1e-9) if len(steps) else 0.0


def local_parabola(time: Floats, values: Floats, breaks: Floats, half_width: float) -> tuple[Floats, Floats]:
    """Value and slope of the parabola that fits the rows near each row best (least squares).

    `time` rises, shape (n,); `values` has the shape (n,) or (n, c), and angles in it are unwrapped. Rows beyond one of
    the `breaks` do not count. Where fewer than three rows count, value and slope are NaN. Savitzky and Golay, Anal.
    Chem. 36 (1964) 1627, for rows at any times.
    """
    columns = values.reshape(len(time), -1)
    piece = np.searchsorted(breaks, time, side="right")
    reach = np.searchsorted(time, time + half_width, side="right") - np.arange(len(time)) - 1
    most = int(reach.max(initial=0))
    moments = np.zeros((len(time), 5))
    products = np.zeros((len(time), 3, columns.shape[1]))
    for offset in range(-most, most + 1):
        rows = np.arange(max(0, -offset), min(len(time), len(time) - offset))
        share = (time[rows + offset] - time[rows]) / half_width
        is_near = (np.abs(share) <= 1.0) & (piece[rows + offset] == piece[rows])
        rows, share = rows[is_near], share[is_near]
        powers = share[:, None] ** np.arange(5)
        moments[rows] += powers
        products[rows] += powers[:, :3, None] * columns[rows + offset, None, :]
    matrix = moments[:, np.arange(3)[:, None] + np.arange(3)]
    is_known = moments[:, 0] > 2.5
    matrix[~is_known] = np.eye(3)
    solution: Floats = np.asarray(np.linalg.solve(matrix, products), np.float64)
    solution[~is_known] = np.nan
    value, slope = (np.reshape(solution[:, i], values.shape) for i in range(2))
    return value, slope / half_width
