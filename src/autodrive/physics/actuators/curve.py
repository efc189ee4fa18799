"""Curves of actuators, given by points."""

from __future__ import annotations

from typing import Any


def interpolated(points: int, positions: Any, values: Any, position: float) -> float:
    """Value at a position of a curve with so many points, at rising positions: linear between, constant beyond."""
    value = values[0]
    for k in range(points - 1):
        if position > positions[k]:
            t = min(1.0, (position - positions[k]) / (positions[k + 1] - positions[k]))
            value = values[k] + t * (values[k + 1] - values[k])
    return value
