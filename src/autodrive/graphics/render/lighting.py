"""Lamps and shadow projections of one state as numbers for the shaders; draws nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from autodrive.graphics.render.look import BEAMS
from autodrive.graphics.render.parts import in_sight, sight_planes
from autodrive.physics.actuators.lights import LAMPS, LightsSpec

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats

HEADLIGHTS = tuple(i for i, name in enumerate(LAMPS) if name.startswith(("head", "high_beam")))
"""Indices in `LAMPS` of the lamps that reach far and cast shadows."""

LAMP = np.dtype(
    [
        ("place", np.float64, 3),
        ("range", np.float64),
        ("aim", np.float64, 3),
        ("cos_outer", np.float64),
        ("color", np.float64, 3),
        ("sharpness", np.float64),
        ("up", np.float64, 3),
        ("cutoff", np.float64),
    ]
)


def lamp_table(spec: LightsSpec) -> np.ndarray:
    """Every lamp of a vehicle at full level, in vehicle axes, shape (len(LAMPS),), dtype `LAMP`."""
    table = np.zeros(len(LAMPS), LAMP)
    for row, lamp in zip(table, LAMPS, strict=True):
        name, side = lamp.rsplit("_", 1)
        own, beam = getattr(spec, name), BEAMS[name]
        x, y, z = own.position
        ahead = 1.0 if beam.is_forward else -1.0
        c, s = np.cos(beam.pitch), np.sin(beam.pitch)
        row["place"] = x + 0.006 * ahead, y if side == "left" else -y, z
        row["range"] = own.range
        row["aim"], row["up"] = (ahead * c, 0.0, -s), (ahead * s, 0.0, c)
        row["cos_outer"] = np.cos(beam.outer)
        row["sharpness"] = 1.0 / (np.cos(beam.inner) - row["cos_outer"])
        row["color"] = beam.intensity * np.array(own.color)
        row["cutoff"] = beam.cutoff
    return table


def burning(tables: Sequence[np.ndarray], roots: Floats, levels: Floats) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lit lamps in map axes (dtype `LAMP`), the vehicle of each, and whether each is a headlight.

    `roots`: vehicle poses, shape (n, 4, 4); `levels`: of each lamp, 0 to 1, shape (n, len(LAMPS)).
    """
    vehicle, lamp = np.nonzero(levels)
    lit = np.stack(tables)[vehicle, lamp]
    turn = roots[vehicle, :3, :3]
    lit["place"] = np.einsum("nij,nj->ni", turn, lit["place"]) + roots[vehicle, :3, 3]
    for axis in ("aim", "up"):
        lit[axis] = np.einsum("nij,nj->ni", turn, lit[axis])
    lit["color"] *= levels[vehicle, lamp, None]
    return lit, vehicle, np.isin(lamp, HEADLIGHTS)


def reach(lit: np.ndarray, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Whether each lamp can light a part of each box, shape (n_box, n_lamp). `low`, `high`: corners, shape (n_box, 3).

    The box is in range, and the sphere around it is not entirely outside the cone.
    """
    place = lit["place"]
    near = np.linalg.norm(np.maximum(np.maximum(low[:, None] - place, place - high[:, None]), 0.0), axis=2)
    to = 0.5 * (low + high)[:, None] - place
    along = np.einsum("bnk,nk->bn", to, lit["aim"])
    aside = np.sqrt(np.maximum(np.sum(to**2, axis=2) - along**2, 0.0))
    cos = lit["cos_outer"]
    beyond = aside * cos - along * np.sqrt(1.0 - cos**2)
    return (near < lit["range"]) & (beyond < 0.5 * np.linalg.norm(high - low, axis=1)[:, None])


def lights_view(lit: np.ndarray, clip: Floats, eye: Floats) -> NDArray[np.bool_]:
    """Whether each lamp can light something that a view shows, shape (n_lamp,).

    Its range is in sight, and what is in sight is not all behind it. `clip`: clip space from map axes; `eye`: place of
    the camera, shape (3,).
    """
    if len(lit) == 0:
        return np.zeros(0, np.bool_)
    far = np.linalg.inv(clip) @ np.array([(x, y, 1.0, 1.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]).T
    corners = np.concatenate([eye[None], (far[:3] / far[3]).T])
    ahead = np.einsum("cnk,nk->cn", corners[:, None] - lit["place"], lit["aim"])
    return in_sight(sight_planes(clip), lit["place"], lit["range"]) & np.any(ahead > 0.0, axis=0)


def strength(lit: np.ndarray, centers: Floats) -> Floats:
    """Approximate illuminance of each place by each lamp, for choosing the strongest: shape (n_place, n_lamp)."""
    to = centers[:, None] - lit["place"][None]
    return lit["color"].sum(1) / (np.sum(to**2, axis=2) + 0.05)


def beam_matrix(place: Floats, aim: Floats, up: Floats, cos_outer: float, range_: float) -> Floats:
    """Clip space of a headlight's shadow map from map axes, shape (4, 4)."""
    near, tangent = 0.03, 1.05 * float(np.sqrt(1.0 - cos_outer**2) / cos_outer)
    side = np.cross(up, aim)
    look = np.eye(4)
    look[:3, :3] = np.stack([side, up, aim])
    look[:3, 3] = -look[:3, :3] @ place
    return perspective(1.0 / tangent, 1.0 / tangent, near, range_) @ look


def perspective(
    scale_x: float, scale_y: float, near: float, far: float, *, shift_x: float = 0.0, shift_y: float = 0.0
) -> Floats:
    """Clip space from a camera that looks along +z, shape (4, 4); at a distance of 1, clip x is scale_x x + shift_x."""
    return np.array(
        [
            [scale_x, 0.0, shift_x, 0.0],
            [0.0, scale_y, shift_y, 0.0],
            [0.0, 0.0, (far + near) / (far - near), -2.0 * far * near / (far - near)],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )


def sun_axes(direction: Sequence[float]) -> Floats:
    """Sun axes from map axes, shape (3, 3): x and y across the light, z away from the sun."""
    z = -np.asarray(direction, np.float64)
    x = np.cross((0.0, 0.0, 1.0), z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])
