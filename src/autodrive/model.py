"""Model: what stays while the world runs, as a NamedTuple of flat arrays that Numba takes as they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.state import Floats, Integers

PLANE, SPHERE, CYLINDER, BOX = 0, 2, 5, 6
"""Kinds of shape, numbered as in MuJoCo (mjtGeom)."""


class Shapes(NamedTuple):
    """The fixed half of the collision shapes; where they are now is `State.shape_position` and `.shape_rotation`.

    The floor (z = 0) is not among them.
    """

    kind: Integers
    """SPHERE, CYLINDER or BOX, shape (n_shape,)."""
    size: Floats
    """Sphere: radius; cylinder: radius, half height (axis z); box: half sizes [m], shape (n_shape, 3)."""
    bounding_radius: Floats
    """[m], shape (n_shape,)."""
    vehicle: Integers
    """Index of the vehicle that the shape is part of, or -1, shape (n_shape,)."""
    is_static: NDArray[np.bool_]
    """True for what never moves, shape (n_shape,)."""
