"""The uniform grid over the fixed shapes: wheels, range sensors and the contact test look only at shapes near them."""

from __future__ import annotations

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined
from autodrive.physics.model import BOX, CYLINDER, Grid, ShapeTable

CELL_MIN = 1.0
"""Least side of a cell [m]; otherwise there are about as many cells as shapes."""

MEMBERSHIPS_MAX = 8
"""Mean number of cells of a shape; with more, as for long diagonal walls, the cells become larger."""


FINEST = 1000
"""Most rows and columns of cells in `most_within`."""

ROUNDING = 1e-6
"""More than the rounding error of a distance [m]."""


def fixed_grid(kind: Integers, size: Floats, position: Floats, rotation: Floats) -> Grid:
    """The grid of these shapes, which are all fixed; arguments as in `ShapeTable`, shape (n_fixed, ...)."""
    low, high = _rectangles(kind, size, position, rotation)
    origin = low.min(axis=0) if len(kind) else np.zeros(2)
    extent = high.max(axis=0) - origin if len(kind) else np.zeros(2)
    cell = max(CELL_MIN, float(np.sqrt(extent[0] * extent[1] / max(len(kind), 1))))
    while True:
        first = ((low - origin) / cell).astype(np.int64)
        last = ((high - origin) / cell).astype(np.int64)
        if np.prod(last - first + 1, axis=1).sum() <= MEMBERSHIPS_MAX * len(kind) + 100:
            break
        cell *= 1.5
    columns, rows = (int(count) for count in (extent / cell).astype(np.int64) + 1)
    cells: list[list[int]] = [[] for _ in range(rows * columns)]
    for s, ((column0, row0), (column1, row1)) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        for row in range(row0, row1 + 1):
            for column in range(column0, column1 + 1):
                cells[row * columns + column].append(s)
    return Grid(
        x=float(origin[0]),
        y=float(origin[1]),
        cells_per_metre=1.0 / cell,
        rows=rows,
        columns=columns,
        starts=np.cumsum([0, *(len(members) for members in cells)], dtype=np.int64),
        members=np.array([s for members in cells for s in members], dtype=np.int64),
        first_row=np.ascontiguousarray(first[:, 1]),
        first_column=np.ascontiguousarray(first[:, 0]),
    )


def most_within(fixed: ShapeTable, distance: float) -> int:
    """An upper limit of the number of shapes, all fixed, that are within `distance` [m] of the same point."""
    if len(fixed.kind) == 0:
        return 0
    low, high = _rectangles(fixed.kind, fixed.size, fixed.position, fixed.rotation)
    low, high = low - distance - ROUNDING, high + distance + ROUNDING
    cell = max(distance, float((high.max(axis=0) - low.min(axis=0)).max()) / FINEST)
    first, last = (((corner - low.min(axis=0)) / cell).astype(np.int64) for corner in (low, high))
    counts = np.zeros(last.max(axis=0) + 2, np.int64)
    for rows, columns, change in (
        (first[:, 0], first[:, 1], 1),
        (last[:, 0] + 1, last[:, 1] + 1, 1),
        (first[:, 0], last[:, 1] + 1, -1),
        (last[:, 0] + 1, first[:, 1], -1),
    ):
        np.add.at(counts, (rows, columns), change)
    return int(counts.cumsum(axis=0).cumsum(axis=1).max())


@inlined
def shapes_near(shapes: ShapeTable, x: float, y: float, distance: float, nearby: Integers) -> int:
    """Writes the numbers of all shapes that may be within `distance` [m] of a point, and returns how many they are.

    Seen from above; these are more than the shapes within a square of that half side, and all shapes that move. Each is
    written once. `nearby` has room for all shapes.
    """
    count = 0
    for s in range(shapes.n_fixed, shapes.kind.shape[0]):
        nearby[count] = s
        count += 1
    return fixed_near(shapes.grid, x, y, distance, nearby, count)


@inlined
def fixed_near(grid: Grid, x: float, y: float, distance: float, nearby: Integers, count: int) -> int:
    """Writes the fixed shapes that may be within `distance` [m] of a point; returns how many numbers there are then.

    The new numbers come after the first `count` ones in `nearby`; see `shapes_near`.
    """
    low_row = _cell(y - distance - grid.y, grid.cells_per_metre, grid.rows)
    high_row = _cell(y + distance - grid.y, grid.cells_per_metre, grid.rows)
    low_column = _cell(x - distance - grid.x, grid.cells_per_metre, grid.columns)
    high_column = _cell(x + distance - grid.x, grid.cells_per_metre, grid.columns)
    for row in range(low_row, high_row + 1):
        for column in range(low_column, high_column + 1):
            cell = row * grid.columns + column
            for k in range(grid.starts[cell], grid.starts[cell + 1]):
                s = grid.members[k]
                # a shape in several cells counts in the first of them
                if row == max(low_row, grid.first_row[s]) and column == max(low_column, grid.first_column[s]):
                    nearby[count] = s
                    count += 1
    return count


def _rectangles(kind: Integers, size: Floats, position: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """Lower left and upper right corner of the rectangle around each shape, seen from above [m], shape (n, 2) each."""
    half = np.select(
        [(kind == BOX)[:, None], (kind == CYLINDER)[:, None]],
        [size, size[:, [0, 0, 1]]],
        size[:, [0, 0, 0]],
    )
    reach = np.sum(np.abs(rotation.reshape(-1, 3, 3)[:, :2]) * half[:, None], axis=2)
    return position[:, :2] - reach, position[:, :2] + reach


@inlined
def _cell(offset: float, cells_per_metre: float, count: int) -> int:
    """Row or column of a place, the nearest one outside of the grid; the first one of a place that is not a number."""
    return int(min(max(0.0, offset * cells_per_metre), count - 1.0))
