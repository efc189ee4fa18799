"""A closed line that cars follow, as points at equal distances: the nearest point, the progress, and the way ahead."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.elementary import atan2
from autodrive.base.jit import jit
from autodrive.experiments.envs.task import CarReadings, Feature, heading, turned

PLACE, BEYOND, DRIVEN = 0, 1, 2
"""Places in the memory of `follow`: number of the nearest point; distance beyond it, from the start [m]."""


def line_features(preview: Sequence[float], name: str, limit: float, most_offset: float) -> tuple[Feature, ...]:
    """The features that `look` writes, of a line that is called `name`. `limit`, `most_offset`: greatest values [m]."""
    return (
        Feature(
            "offset",
            -most_offset,
            most_offset,
            "distance from the centre line [m], positive to the left of the centre line",
        ),
        Feature("direction_cos", -1.0, 1.0, f"cosine of the angle from the car to the direction of the {name}"),
        Feature(
            "direction_sin", -1.0, 1.0, f"sine of the angle from the car to the direction of the {name}, left positive"
        ),
        *(
            Feature(
                f"ahead_{distance:g}_{axis}",
                -limit,
                limit,
                f"{axis} of the {name} {distance:g} m on, vehicle frame [m]",
            )
            for distance in preview
            for axis in "xy"
        ),
    )


def table(along: Floats, points: Floats, count: int) -> Floats:
    """x, y [m], cosine and sine of the direction at `count` points at equal distances, shape (count, 4).

    `points`, shape (n, 2) [m], with the distances `along` the closed line [m]; the last point is the first one.
    """
    at = np.arange(count) * (float(along[-1]) / count)
    x, y = (np.interp(at, along, points[:, axis]) for axis in (0, 1))
    dx, dy = (np.roll(values, -1) - np.roll(values, 1) for values in (x, y))
    length = np.sqrt(dx * dx + dy * dy)
    return np.column_stack([x, y, dx / length, dy / length])


@jit
def follow(
    cars: CarReadings, i: int, line: Floats, count: int, spacing: float, reach: int, memory: Floats
) -> tuple[float, float, float, float]:
    """Progress in the step [m], offset to the left [m], cosine and sine of the angle from car i to the line.

    The line has `count` points `spacing` [m] apart. The nearest one is sought at most `reach` points from the last
    one, because other parts of the line may be near. `memory`, shape (3,), is updated.
    """
    x, y = cars.position[i, 0], cars.position[i, 1]
    before, moved, least = int(memory[PLACE]), 0, math.inf
    # the nearest point around the last one
    for steps in range(-reach, reach + 1):
        point = line[(before + steps) % count]
        square = (point[0] - x) * (point[0] - x) + (point[1] - y) * (point[1] - y)
        if square < least:
            least, moved = square, steps
    place = (before + moved) % count
    point = line[place]
    # the car in the axes of that point: how far beyond it along the line, and how far to the left
    beyond, offset = turned(x - point[0], y - point[1], point[2], point[3])
    c, s = heading(cars, i)
    direction_cos, direction_sin = turned(point[2], point[3], c, s)
    # whole points, and the change of the part beyond the nearest one
    progress = moved * spacing + beyond - memory[BEYOND]
    memory[PLACE], memory[BEYOND] = place, beyond
    memory[DRIVEN] += progress
    return progress, offset, direction_cos, direction_sin


def beside(cars: CarReadings, points: Floats) -> dict[str, Floats]:
    """`offset` of each car to the left of its nearest point [m], and `angle` from its direction to the left [rad].

    `points`: x, y [m], cosine and sine of the direction there, shape (n, 4).
    """
    offset, angle = np.empty(len(points)), np.empty(len(points))
    _write_beside(cars, points, offset, angle)
    return {"offset": offset, "angle": angle}


@jit
def _write_beside(cars: CarReadings, points: Floats, offset: Floats, angle: Floats) -> None:
    for i in range(len(points)):
        x, y, c, s = points[i]
        _, offset[i] = turned(cars.position[i, 0] - x, cars.position[i, 1] - y, c, s)
        ahead, aside = turned(*heading(cars, i), c, s)
        angle[i] = atan2(aside, ahead)


@jit
def look_ahead(
    cars: CarReadings, i: int, line: Floats, count: int, place: int, preview: Integers, ahead: Floats
) -> None:
    """Write x, y [m] in the axes of car i of the points `preview` after `place`, into `ahead`, shape (2 n,)."""
    c, s = heading(cars, i)
    for k in range(len(preview)):
        there = line[(place + preview[k]) % count]
        x, y = there[0] - cars.position[i, 0], there[1] - cars.position[i, 1]
        ahead[2 * k], ahead[2 * k + 1] = turned(x, y, c, s)
