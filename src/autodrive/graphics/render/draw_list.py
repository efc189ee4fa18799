"""Prepares one render state for drawing: poses, lit lamps, and which light and shadow reaches which mesh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from autodrive.graphics.render.lighting import LAMP, burning, lamp_table, reach, strength
from autodrive.graphics.render.look import Daylight
from autodrive.graphics.render.scene import LEVEL, rigid, rigid_all, signals_of
from autodrive.graphics.render.shadows import BEAMS, BONES, CASTERS, TILES, columns
from autodrive.physics.actuators.lights import LAMPS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.graphics.render.gpu_mesh import GpuMesh
    from autodrive.graphics.render.quality import Quality
    from autodrive.graphics.render.render_state import RenderState
    from autodrive.graphics.render.scene import RenderScene, Skeleton
    from autodrive.graphics.render.shadows import Shadows
    from autodrive.physics.sensors.camera.view import View

LAMP_SLOTS = 48
NO_CASTER, NO_BEAM, NO_LAMP = CASTERS - 1, BEAMS - 1, LAMP_SLOTS - 1
"""Slots that stay empty; they pad lists."""

FRAME = np.dtype(
    [
        *((name, "f4", 4) for name in ("sun_direction", "sun_color", "zenith", "horizon", "floor_glow", "exposure")),
        *((name, "f4", 4) for name in ("sun_place", "dawn", "extent")),
        ("sun_from_map", "f4", (4, 4)),
        *((name, "f4", 4) for name in ("still_scale", "still_offset")),
        *((name, "f4", (CASTERS, 4)) for name in ("caster_offset", "caster_tile", "caster_place")),
        ("tile_scale", "f4", 4),
        *((name, "f4", (LAMP_SLOTS, 4)) for name in ("lamp_place", "lamp_aim", "lamp_color")),
        ("beam_up", "f4", (BEAMS, 4)),
        ("beam_from_map", "f4", (BEAMS, 4, 4)),
    ]
)
"""Uniform block of shaders/frame.glsl; matrices are column-major."""

CASTER_COUNTS, BEAM_COUNTS, LAMP_COUNTS = (1, 2, 4, 8, 16), (2, 4, 8), (2, 4, 8)
"""Numbers of casters of shadows, beams and lamps that a draw call can have, besides 0: each needs a shader."""

OUTLINE = 0.92
"""A vehicle dims the ground around a rectangle that is smaller than its mesh by this factor."""

CLOUD_DRIFT = 0.004
"""Drift of the clouds in the strongest wind: parts of their pattern by second."""

Slots: TypeAlias = tuple[int, ...]


class Illumination(NamedTuple):
    """Light and shadow that reach a mesh: slots of vehicles that cast shadows on it, of headlights, of other lamps."""

    casters: Slots = ()
    beams: Slots = ()
    lamps: Slots = ()
    is_shaded: bool = False
    """Whether shadows of static meshes fall on it."""


UNREACHED, SHADED = Illumination(), Illumination(is_shaded=True)
"""Illumination of most meshes: no lamp and no shadow of a vehicle, without and with shadows of static meshes."""


class PosedMesh(NamedTuple):
    """A vehicle or an object at its pose."""

    model: GpuMesh
    bones: bytes
    """Columns of `BONES` matrices."""
    glow: bytes
    """Level of each lamp, 0 to 1, after a 1 for surfaces that always glow; float32."""
    center: Floats
    radius: float
    lit: Illumination


class DrawList:
    """Prepares one state of a scene after another."""

    def __init__(
        self,
        scene: RenderScene,
        quality: Quality,
        skeletons: Sequence[Skeleton],
        static: GpuMesh,
        vehicles: Sequence[GpuMesh],
        objects: Sequence[GpuMesh],
        lenses: Sequence[GpuMesh],
        shadows: Shadows,
    ) -> None:
        """`skeletons`: one for each vehicle; `lenses`: see `scene.lit_lenses`."""
        self._quality, self._skeletons, self._shadows = quality, skeletons, shadows
        self._vehicles, self._objects, self._lenses = vehicles, objects, lenses
        self._tables = [lamp_table(spec) for spec in scene.lights]
        self._spheres = static.geometry.spheres
        self._boxes = static.geometry.boxes
        self._is_ground = np.array([r.kind == "ground" for r in static.geometry.ranges], bool)
        self._is_flat = np.array([r.kind in LEVEL for r in static.geometry.ranges], bool)
        self._is_shaded = np.zeros(0, bool)
        """Whether shadows of static meshes can fall on each range of the static mesh."""
        self.outlines = [outline(model) for model in vehicles]
        """Outline of each vehicle; see `outline`."""
        self.frame = np.zeros((), FRAME)
        self._extent = scene.static.extent or (-1e9, -1e9, 1e9, 1e9)
        self.n_beam = 0
        """Number of headlights in the first slots of the lamps."""
        self.n_caster = 0
        """Number of vehicles that cast shadows."""
        self.shadow_areas = np.zeros((CASTERS, 4), np.float32)
        """Where they cast them by day, see `Shadows.areas`."""
        self.posed: list[PosedMesh] = []
        self.static_lit: list[Illumination] = []
        """Illumination of each range of the static mesh."""
        self.lamps = np.zeros(0, LAMP)
        """Lit lamps, in the order of their slots."""

    def set(self, state: RenderState, views: Sequence[View]) -> None:
        """Prepare that state for these views; draws the shadow maps."""
        roots = rigid_all(state.vehicles)
        places = rigid_all(state.objects)
        bones = [self._bones(i, root, row) for i, (root, row) in enumerate(zip(roots, state.vehicles, strict=True))]
        cameras = np.array([view.position for view in views])
        near = np.argsort(_distances(roots[:, :3, 3], cameras), kind="stable").tolist()
        centers = np.array([root[:3, 3] + root[:3, :3] @ c for root, (c, _) in zip(roots, self.outlines, strict=True)])
        self.frame[...] = 0
        if state.is_day:
            self._shadows.set_sun(state.look.sun_direction)
            if self._shadows.draw_still(places, np.array([rigid(view.position, view.orientation) for view in views])):
                falls = self._shadows.falls_on(self._boxes[:, 0, :2], self._boxes[:, 1, :2])
                self._is_shaded = ~self._is_ground & (~self._is_flat | falls)  # the ground: see ground_shadows.py
        self.set_sky(state.look, state.time)
        casters = near[: CASTERS - 1]
        self.n_caster = len(casters)
        self.set_casters(casters, roots, centers.reshape(-1, 3), bones, is_day=state.is_day)
        if state.is_day:
            self.shadow_areas = self._shadows.areas(casters, bones).astype(np.float32)
        are_lit = state.look.are_lamps_lit
        self.lamps, n_beam = self.set_lamps(state.vehicles, near, roots, places, bones, are_lit=are_lit)

        spheres = [self._spheres]
        spheres.append((centers.reshape(-1, 3), np.array([m.radius for m in self._vehicles])))
        spheres.append((places[:, :3, 3], np.array([m.radius for m in self._objects])))
        all_centers = np.concatenate([c for c, _ in spheres])
        all_radii = np.concatenate([r for _, r in spheres])
        n = len(self._spheres[0])
        low, high = all_centers - all_radii[:, None], all_centers + all_radii[:, None]
        low[:n], high[:n] = self._boxes[:, 0], self._boxes[:, 1]
        reached = self._reached(low, high, centers.reshape(-1, 3)[casters], self.lamps, n_beam)
        if state.is_day:
            for i in (*np.nonzero(self._is_shaded)[0].tolist(), *range(n, len(reached))):
                reached[i] = SHADED if reached[i] is UNREACHED else reached[i]._replace(is_shaded=True)
        self.static_lit = reached[:n]
        levels = np.concatenate([np.ones((len(roots), 1)), state.vehicles["lamps"]], axis=1).astype(np.float32)
        glow = [row.tobytes() for row in levels]
        dark = _dark()
        models = [*self._vehicles, *self._objects]
        own_bones = [*bones, *(_padded(place[None]) for place in places)]
        glows = [*glow, *(dark for _ in places)]
        self.posed = [
            PosedMesh(*each)
            for each in zip(models, own_bones, glows, all_centers[n:], all_radii[n:], reached[n:], strict=True)
        ]
        self.posed += self.lit_lenses(state)

    def lit_lenses(self, state: RenderState) -> Iterator[PosedMesh]:
        """The lenses of the traffic lights that are lit."""
        at_rest, dark = _padded(np.eye(4)[None]), _dark()
        light = SHADED if state.is_day else UNREACHED
        for number, shown in enumerate(state.header["traffic_lights"][: len(self._lenses) // 3].astype(int).tolist()):
            if shown:
                lens = self._lenses[3 * number + shown - 1]
                [ball] = lens.geometry.ranges
                yield PosedMesh(lens, at_rest, dark, ball.center, ball.radius, light)

    def seen_lit(self, lit: Illumination, is_lit: NDArray[np.bool_]) -> Illumination:
        """An illumination without lamps that light nothing in a view.

        `is_lit`: whether each lamp lights something there, see `lights_view`.
        """
        if not lit.beams and not lit.lamps:
            return lit
        slots = [*range(self.n_beam), *range(BEAMS, BEAMS + len(self.lamps) - self.n_beam)]
        seen = {slot for slot, is_seen in zip(slots, is_lit.tolist(), strict=True) if is_seen}
        beams, lamps = ([slot for slot in own if slot in seen] for own in (lit.beams, lit.lamps))
        return lit._replace(beams=filled(beams, BEAM_COUNTS, NO_BEAM), lamps=filled(lamps, LAMP_COUNTS, NO_LAMP))

    # -- parts ----------------------------------------------------------------------------------------------------

    def _bones(self, i: int, root: Floats, row: np.void) -> bytes:
        return _padded(self._skeletons[i].pose(root, signals_of(row)))

    def set_sky(self, look: Daylight, time: float) -> None:
        """Write sun and sky into `frame`, at a simulated time [s]."""
        for name in ("sun_direction", "sun_color", "zenith", "horizon", "floor_glow", "sun_place", "dawn"):
            self.frame[name][:3] = getattr(look, name)
        self.frame["exposure"] = look.exposure, look.glow, look.air.extinction, look.air.wetness
        self.frame["floor_glow"][3] = look.air.snow_cover
        self.frame["horizon"][3] = look.dusk
        self.frame["sun_place"][3] = (CLOUD_DRIFT * look.air.wind * time) % 1000.0
        self.frame["dawn"][3] = look.air.clouds
        self.frame["extent"] = self._extent
        self.frame["sun_from_map"][:3, :3] = self._shadows.sun.T

    def set_casters(
        self, casters: list[int], roots: Floats, centers: Floats, bones: Sequence[bytes], *, is_day: bool
    ) -> None:
        """Write the slots of the vehicles that cast shadows into `frame`; by day, draws their shadow maps.

        `casters`: those vehicles, in the order of the slots; the rest: of all vehicles, see `set`.
        """
        frame, shadows = self.frame, self._shadows
        for slot, vehicle in enumerate(casters):
            heading = roots[vehicle, :2, 0] / max(np.linalg.norm(roots[vehicle, :2, 0]), 1e-6)
            frame["caster_place"][slot] = *centers[vehicle, :2], *heading
            frame["caster_tile"][slot, 2:] = self.outlines[vehicle][1]
        if not is_day:
            return
        frame["still_scale"][:3], frame["still_offset"][:3] = shadows.still_scale, shadows.still_offset
        frame["still_scale"][3], frame["still_offset"][3] = 1.0 / shadows.still_size, shadows.skin
        frame["tile_scale"] = 1.0 / TILES, 1.0 / shadows.caster_size, *shadows.caster_scale[[0, 2]]
        if casters:
            offsets, corners = shadows.draw_casters(casters, roots, bones)
            frame["caster_offset"][: len(casters), :3] = offsets
            frame["caster_tile"][: len(casters), :2] = corners

    def set_lamps(
        self,
        vehicles: np.ndarray,
        near: list[int],
        roots: Floats,
        places: Floats,
        bones: Sequence[bytes],
        *,
        are_lit: bool,
    ) -> tuple[np.ndarray, int]:
        """Write the lamps into `frame`; draws the shadow maps of headlights.

        Returns the lamps in the order of their slots, and how many of them are headlights with shadows. `are_lit`: see
        `Daylight.are_lamps_lit`; by day there are none. `vehicles`: dtype `render_state.VEHICLE`; `near`: their
        numbers, the nearest to a camera first.
        """
        self.n_beam = 0
        if not are_lit or not vehicles["lamps"].any():
            return np.zeros(0, LAMP), 0
        lit, owner, is_headlight = burning(self._tables, roots, vehicles["lamps"])
        rank = np.argsort(np.array(near))[owner]  # 0: the vehicle nearest to a camera
        casting = is_headlight & (rank < self._quality.beam_vehicles)
        order = np.lexsort((rank, ~casting))
        beams = order[: min(int(casting.sum()), self._shadows.beams)]
        others = [i for i in order if i not in set(beams.tolist())][: NO_LAMP - BEAMS]
        frame = self.frame
        if len(beams):
            tiles = self._shadows.draw_beams(lit[beams], owner[beams].tolist(), places, roots, bones)
            frame["beam_from_map"][: len(beams)] = np.swapaxes(tiles, 1, 2)
            frame["beam_up"][: len(beams)] = np.column_stack([lit["up"][beams], lit["cutoff"][beams]])
        for chosen, first in ((beams, 0), (others, BEAMS)):
            slots = slice(first, first + len(chosen))
            frame["lamp_place"][slots] = np.column_stack([lit["place"][chosen], lit["range"][chosen]])
            frame["lamp_aim"][slots] = np.column_stack([lit["aim"][chosen], lit["cos_outer"][chosen]])
            frame["lamp_color"][slots] = np.column_stack([lit["color"][chosen], lit["sharpness"][chosen]])
        self.n_beam = len(beams)
        return np.concatenate([lit[beams], lit[others]]), len(beams)

    def _reached(
        self, low: Floats, high: Floats, casters: Floats, lamps: np.ndarray, n_beam: int
    ) -> list[Illumination]:
        """What reaches each box; `low`, `high`: its corners [m], shape (n, 3)."""
        n = len(low)
        away, limit = shadow_distances(low, high, casters, self._shadows.drift)
        shaded = away < limit
        shaded[: len(self._is_ground)] &= ~self._is_ground[:, None]  # see shaders/ground_shade.frag
        lights, power = reach(lamps, low, high), strength(lamps, 0.5 * (low + high))
        reached = [UNREACHED] * n
        for i in np.nonzero(shaded.any(1) | lights.any(1))[0].tolist():
            nearest = best(shaded[i], -away[i], self._quality.casters)
            small = best(lights[i, n_beam:], power[i, n_beam:], self._quality.lamps)
            reached[i] = Illumination(
                filled(nearest, CASTER_COUNTS, NO_CASTER),
                filled(np.nonzero(lights[i, :n_beam])[0].tolist(), BEAM_COUNTS, NO_BEAM),
                filled([slot + BEAMS for slot in small], LAMP_COUNTS, NO_LAMP),
            )
        return reached


def shadow_distances(low: Floats, high: Floats, casters: Floats, drift: Floats) -> tuple[Floats, float]:
    """Level distance from each box to the middle of each vehicle's shadow, and where the shadow ends [m].

    `low`, `high`: corners of the boxes, shape (..., n, 3); `casters`: centres of the vehicles, shape (..., v, 3);
    `drift`: see `Shadows.drift`. The result has the shape (..., n, v).
    """
    middle = casters[..., None, :, :2] + 0.5 * drift
    gap = np.maximum(np.maximum(low[..., :, None, :2] - middle, middle - high[..., :, None, :2]), 0.0)
    return np.linalg.norm(gap, axis=-1), 0.5 * float(np.linalg.norm(drift)) + 0.25


def best(is_candidate: np.ndarray, merit: Floats, limit: int) -> list[int]:
    """Indices of the candidates; only the `limit` of highest merit if there are more."""
    numbers = np.nonzero(is_candidate)[0].tolist()
    if len(numbers) > limit:
        numbers = sorted(numbers, key=lambda i: -merit[i])[:limit]
    return numbers


def filled(slots: list[int], levels: tuple[int, ...], empty: int) -> Slots:
    """The list padded to one of a few lengths, so that few shader variants are needed."""
    if not slots:
        return ()
    length = next(level for level in levels if level >= len(slots))
    return (*sorted(slots), *[empty] * (length - len(slots)))


def _dark() -> bytes:
    """`PosedMesh.glow` without a lamp that is lit."""
    return np.eye(1, 1 + len(LAMPS), dtype=np.float32).tobytes()


def _padded(poses: Floats) -> bytes:
    full = np.zeros((BONES, 4, 4))
    full[: len(poses)] = poses
    return columns(full)


def _distances(places: Floats, cameras: Floats) -> Floats:
    """Distance from each place to the nearest camera [m]."""
    return np.linalg.norm(places[:, None] - cameras[None], axis=2).min(1)


def outline(model: GpuMesh) -> tuple[Floats, Floats]:
    """Centre, shape (3,), and half length and half width, shape (2,), of a vehicle at rest [m]."""
    points = model.geometry.vertices["position"].astype(np.float64)
    if len(points) == 0:
        return np.zeros(3), np.zeros(2)
    low, high = points.min(0), points.max(0)
    return 0.5 * (low + high), 0.5 * (high - low)[:2] * OUTLINE
