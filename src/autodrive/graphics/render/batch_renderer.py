"""Renders small images of many states of one scene, seen by the same camera of a vehicle, and reads them at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from autodrive.graphics.render.draw_list import (
    BEAM_COUNTS,
    CASTER_COUNTS,
    LAMP_COUNTS,
    NO_BEAM,
    NO_CASTER,
    NO_LAMP,
    OUTLINE,
    Illumination,
    best,
    filled,
    shadow_distances,
)
from autodrive.graphics.render.fxaa import smoothed
from autodrive.graphics.render.gl import current
from autodrive.graphics.render.lighting import lights_view, reach, strength
from autodrive.graphics.render.parts import in_sight, sight_planes
from autodrive.graphics.render.render_state import VEHICLE
from autodrive.graphics.render.renderer import IndexRange, Renderer, clip_from_optical
from autodrive.graphics.render.scene import LEVEL, rigid, rigid_all, signals_of
from autodrive.graphics.render.shadows import BEAMS, BONES, DIM

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.graphics.render.gpu_mesh import GpuMesh
    from autodrive.graphics.render.look import Daylight
    from autodrive.graphics.render.renderer import DrawCall
    from autodrive.graphics.render.scene import Kind, RenderScene
    from autodrive.physics.sensors.camera.view import View

PART = 32
"""States that are prepared together."""
RING = 8
"""Images in flight: llvmpipe draws them while the next ones are prepared."""
CASTERS, LAMPS = 4, 8
"""Number of vehicles whose shadows an image shows, and of its lamps besides headlights."""
SLACK = 0.05
"""How far the joints of a vehicle can move its parts [m], with a margin."""
STEP = 0.02
"""A vehicle dims ground that is so much higher than the road [m]."""

Piece: TypeAlias = tuple[bool, IndexRange]
"""Triangles, and whether vehicles cast shadows on them."""


class PreparedStates(NamedTuple):
    """Some states, prepared for drawing: m states, v vehicles, o objects, r ranges of the static mesh."""

    vehicles: np.ndarray
    """Shape (m, v), dtype `render_state.VEHICLE`."""
    roots: Floats
    """Poses of the vehicles, shape (m, v, 4, 4)."""
    places: Floats
    """Poses of the objects, shape (m, o, 4, 4)."""
    bones: NDArray[np.float32]
    """Columns of the bones of vehicles and objects, shape (m, v + o, BONES, 4, 4)."""
    glow: NDArray[np.float32]
    """Brightness of the lamps, see `PosedMesh`, shape (m, v + o, lamps)."""
    eyes: Floats
    """Poses of the camera, shape (m, 4, 4)."""
    clips: Floats
    """Clip space from map axes, shape (m, 4, 4)."""
    centers: Floats
    """Centres of vehicles and objects [m], shape (m, v + o, 3)."""
    near: NDArray[np.intp]
    """Vehicles, the nearest to the camera first, shape (m, v)."""
    is_seen: NDArray[np.bool_]
    """Ranges, vehicles and objects, shape (m, r + v + o)."""
    is_dimmed: NDArray[np.bool_]
    """Whether the shadow of each vehicle can be seen on each of these, shape (m, r + v + o, v)."""


class BatchRenderer(Renderer):
    """Draws images of one camera of one vehicle.

    The formulas are those of `Renderer`. All meshes of an image have the same lamps, and shadows of the same vehicles
    if any: then few draw calls are needed.

    Each image is drawn at the origin of a framebuffer of its own: at another place OpenGL rounds differently, and some
    pixels would depend on the place of the image in the batch.
    """

    def __init__(self, scene: RenderScene, quality_name: str, *, vehicle: int, view: View) -> None:
        """`vehicle`: number of the vehicle that has the camera; `view`: of the camera, in the axes of that vehicle."""
        super().__init__(scene, quality_name)
        self._row, self._view = vehicle, view
        self._models = [*self._vehicles, *self._objects]
        self._radii = np.array([model.radius for model in self._models])
        self._groups = self._grouped()
        k = view.intrinsics
        self._image_size = 3 * k.width * k.height
        with current(self._context) as context:
            self._indices = context.buffer(reserve=4 * PART * max(len(self._static.geometry.indices), 1), dynamic=True)
            self._pixels = context.buffer(reserve=PART * self._image_size, dynamic=True)
            self._seen_static = self._static.with_indices(self._indices)
            self._own, self._own_pieces = self._own_vehicle()

    def draw_batch(
        self, looks: Sequence[Daylight], vehicles: np.ndarray, objects: np.ndarray, *, is_day: bool
    ) -> NDArray[np.uint8]:
        """One image of each of n states, RGB, shape (n, height, width, 3).

        `looks`: of each, with the same direction towards the sun. `vehicles`: shape (n, v), dtype
        `render_state.VEHICLE`; `objects`: shape (n, o), dtype `render_state.OBJECT`.
        """
        k, n = self._view.intrinsics, len(vehicles)
        images = np.empty((n, k.height, k.width, 3), np.uint8)
        if n == 0:
            return images
        # states with equal poses of the objects and near cameras share a shadow map
        eyes = rigid_all(vehicles[:, self._row]) @ rigid(self._view.position, self._view.orientation)
        keys = [(row.tobytes(), self._shadows.area(eye[None]) or ()) for row, eye in zip(objects, eyes, strict=True)]
        order = np.array(sorted(range(n), key=keys.__getitem__), np.intp)
        with current(self._context):
            if is_day:
                self._shadows.set_sun(looks[0].sun_direction)
            for numbers in np.split(order, range(PART, n, PART)):
                part = self._prepared(vehicles[numbers], objects[numbers])
                own = [looks[k] for k in numbers.tolist()]
                images[numbers] = self._draw_part(part, own, is_day).reshape(-1, *images.shape[1:])
        if self.quality.antialiasing == "fxaa":
            opaque = np.full((k.height, k.width, 1), 255, np.uint8)
            for image in images:
                image[...] = smoothed(np.dstack([image, opaque]))[..., :3]
        return images

    # -- preparation ------------------------------------------------------------------------------------------------

    def _prepared(self, vehicles: np.ndarray, objects: np.ndarray) -> PreparedStates:
        m, v, o = len(vehicles), vehicles.shape[1], objects.shape[1]
        roots, places = rigid_all(vehicles), rigid_all(objects)
        bones = np.zeros((m, v + o, BONES, 4, 4), np.float32)
        for i, skeleton in enumerate(self._skeletons):
            poses = skeleton.pose(roots[:, i], signals_of(vehicles[:, i]))
            bones[:, i, : skeleton.size] = np.swapaxes(poses, -1, -2)
        bones[:, v:, 0] = np.swapaxes(places, -1, -2)
        glow = np.zeros((m, v + o, 1 + vehicles["lamps"].shape[-1]), np.float32)
        glow[..., 0] = 1.0
        glow[:, :v, 1:] = vehicles["lamps"]
        eyes = roots[:, self._row] @ rigid(self._view.position, self._view.orientation)
        clips = clip_from_optical(self._view) @ np.linalg.inv(eyes)
        middles = np.array([middle for middle, _ in self._draw_list.outlines]).reshape(v, 3, 1)
        vehicle_centers = roots[..., :3, 3] + (roots[..., :3, :3] @ middles)[..., 0]
        centers = np.concatenate([vehicle_centers, places[..., :3, 3]], axis=1)
        away = np.linalg.norm(roots[..., :3, 3] - eyes[:, None, :3, 3], axis=-1)
        planes, static = sight_planes(clips), self._static.geometry
        is_seen = np.concatenate([in_sight(planes, *static.spheres), in_sight(planes, centers, self._radii)], axis=1)
        is_seen[:, len(static.ranges) + self._row] &= len(self._own_pieces) > 0
        return PreparedStates(
            vehicles=vehicles,
            roots=roots,
            places=places,
            bones=bones,
            glow=glow,
            eyes=eyes,
            clips=clips,
            centers=centers,
            near=np.argsort(away, axis=1, kind="stable"),
            is_seen=is_seen,
            is_dimmed=is_seen[..., None] & self._dims(roots, centers, planes),
        )

    def _dims(self, roots: Floats, centers: Floats, planes: Floats) -> NDArray[np.bool_]:
        """Whether the shadow of each vehicle can fall on each range, vehicle and object, in sight if it is ground."""
        (m, v), static, drift = roots.shape[:2], self._static.geometry, self._shadows.drift
        n, own = len(static.ranges), self._radii[:, None]
        low = np.concatenate([np.broadcast_to(static.boxes[:, 0], (m, n, 3)), centers - own], axis=1)
        high = np.concatenate([np.broadcast_to(static.boxes[:, 1], (m, n, 3)), centers + own], axis=1)
        away, limit = shadow_distances(low, high, centers[:, :v], drift)
        dims = away < limit
        corners = np.array([(x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
        level = np.zeros((2, v, 4, 3))
        for i, (middle, half) in enumerate(self._draw_list.outlines):
            level[0, i, :, :2] = middle[:2] + corners * (half / OUTLINE + DIM)
            level[1, i, :, :2] = middle[:2] + corners * (half / OUTLINE + STEP)
        turns = np.swapaxes(roots[..., :3, :3], -1, -2)
        below, shade = (outlines @ turns + roots[..., None, :3, 3] for outlines in level)
        points = np.concatenate([below, shade + np.array([*drift, 0.0])], axis=2)
        points = np.concatenate([points - np.array([0.0, 0.0, DIM]), points + np.array([0.0, 0.0, STEP])], axis=2)
        inside = points @ np.swapaxes(planes[:, None, :, :3], -1, -2) + planes[:, None, None, :, 3] > 0.0
        is_ground = [i for i, r in enumerate(static.ranges) if r.kind in LEVEL]
        dims[:, is_ground] &= np.all(np.any(inside, axis=2), axis=2)[:, None]
        return dims

    def _grouped(self) -> dict[tuple[Kind, str], NDArray[np.intp]]:
        """Numbers of the ranges of the static mesh that look alike, level ground last as in `Renderer`."""
        ranges = self._static.geometry.ranges
        keys: list[tuple[Kind, str]] = [(r.kind, r.textures) for r in ranges]
        order = sorted(dict.fromkeys(keys), key=lambda key: key[0] in LEVEL)
        return {key: np.array([i for i, other_key in enumerate(keys) if other_key == key]) for key in order}

    def _own_vehicle(self) -> tuple[GpuMesh, list[IndexRange]]:
        """What the camera can see of its own vehicle: the vehicle moves with it, but for wheels and levers."""
        model = self._vehicles[self._row]
        own = model.geometry
        eye = rigid(self._view.position, self._view.orientation)
        planes = sight_planes(clip_from_optical(self._view) @ np.linalg.inv(eye))
        rest = self._skeletons[self._row].pose(np.eye(4), signals_of(np.zeros((), VEHICLE)))
        bone = own.vertices["bone_lamp"][:, 0].astype(np.intp)
        points, margins = own.vertices["position"].astype(np.float64), np.full(len(bone), 1e-3)
        is_jointed = bone > 0
        margins[is_jointed] = np.linalg.norm(points[is_jointed], axis=1) + SLACK
        points[is_jointed] = rest[bone[is_jointed], :3, 3]
        inside = points @ planes[:, :3].T + planes[:, 3] > -margins[:, None]
        kept, pieces = [np.zeros(0, np.uint32)], list[IndexRange]()
        for r in own.ranges:
            triangles = own.indices[r.first : r.first + r.length].reshape(-1, 3)
            seen = triangles[np.all(np.any(inside[triangles], axis=1), axis=1)].ravel()
            if len(seen):
                pieces.append((sum(map(len, kept)), len(seen), r.kind, r.textures))
                kept.append(seen)
        return model.with_indices(self._context.buffer(np.concatenate(kept).tobytes() or bytes(4))), pieces

    # -- drawing ----------------------------------------------------------------------------------------------------

    def _draw_part(self, part: PreparedStates, looks: Sequence[Daylight], is_day: bool) -> NDArray[np.uint8]:
        m = len(part.roots)
        casters = [self._casters(part, k) for k in range(m)]
        is_dimmed = np.array([dims[:, own].any(1) for dims, own in zip(part.is_dimmed, casters, strict=True)])
        static = self._static_pieces(part, is_dimmed)
        size = self._view.intrinsics.width, self._view.intrinsics.height
        targets = [self._target(number, *size) for number in range(min(RING, m))]
        for k in range(m):
            if k % RING == 0:  # for as many images as there are targets: llvmpipe waits for what a shader reads
                for later in range(k, min(k + RING, m)):
                    self._write_camera(part.clips[later], part.eyes[later, :3, 3])
                    self._draw_behind(later % RING, self._view, part.clips[later])
            if k >= RING:
                targets[k % RING].read_rgb_into(self._pixels, (k - RING) * self._image_size)
            self._draw_list.frame[...] = 0
            self._draw_list.set_sky(looks[k], 0.0)
            weather = looks[k].air.effects
            lit = self._illumination(part, k, casters[k], is_day)
            light = lit._replace(casters=()), lit
            self._frame.write(self._draw_list.frame.tobytes())
            self._write_camera(part.clips[k], part.eyes[k, :3, 3])
            self._bind()
            targets[k % RING].begin()
            self._use_behind(k % RING, self._view)
            ground = ((self._seen_static, piece, None, None, light[is_in]) for is_in, piece in static[k])
            self._draw_calls([*self._posed(part, k, is_dimmed[k], light), *ground], is_day, weather=weather)
            self._draw_sky(part.clips[k], looks[k])
            own = replace(self._view, position=part.eyes[k, :3, 3].tolist())
            self._draw_air(part.clips[k], looks[k].air, 0.0, own)
            targets[k % RING].finish()
        for k in range(max(m - RING, 0), m):
            targets[k % RING].read_rgb_into(self._pixels, k * self._image_size)
        pixels = np.empty((m, self._image_size), np.uint8)
        self._pixels.read_into(pixels, size=pixels.nbytes)
        return pixels

    def _static_pieces(self, part: PreparedStates, is_dimmed: NDArray[np.bool_]) -> list[list[Piece]]:
        """What each image shows of the static mesh; fills the buffer of the triangles.

        `is_dimmed`: ranges, vehicles and objects on which shadows of vehicles fall, shape (m, r + v + o).
        """
        own = self._static.geometry
        chosen: list[NDArray[np.uint32]] = []
        pieces: list[list[Piece]] = []
        first = 0
        for seen, dimmed in zip(part.is_seen, is_dimmed, strict=True):
            pieces.append([])
            for (kind, textures), numbers in self._groups.items():
                for is_in in (False, True):
                    ranges = [own.ranges[i] for i in numbers[seen[numbers] & (dimmed[numbers] == is_in)].tolist()]
                    length = sum(r.length for r in ranges)
                    if length:
                        pieces[-1].append((is_in, (first, length, kind, textures)))
                        chosen += [own.indices[r.first : r.first + r.length] for r in ranges]
                        first += length
        if chosen:
            self._indices.orphan()
            self._indices.write(np.concatenate(chosen).tobytes())
        return pieces

    def _casters(self, part: PreparedStates, k: int) -> list[int]:
        """Vehicles whose shadows image k shows, the nearest first."""
        is_casting = part.is_dimmed[k].any(0)
        return [i for i in part.near[k].tolist() if is_casting[i]][:CASTERS]

    def _illumination(self, part: PreparedStates, k: int, casters: list[int], is_day: bool) -> Illumination:
        """Light and shadow in image k; draws the shadow maps."""
        draws, v = self._draw_list, len(self._vehicles)
        roots, places, near = part.roots[k], part.places[k], part.near[k].tolist()
        bones = [part.bones[k, i].tobytes() for i in range(v)]
        if is_day:
            self._shadows.draw_still(places, part.eyes[k : k + 1])
        draws.set_casters(casters, roots, part.centers[k, :v], bones, is_day=is_day)
        lamps, n_beam = draws.set_lamps(part.vehicles[k], near, roots, places, bones, is_day=is_day)
        beams: list[int] = []
        others: list[int] = []
        if len(lamps):
            static, posed = np.split(part.is_seen[k], [len(self._static.geometry.ranges)])
            boxes, centers = self._static.geometry.boxes[static], part.centers[k, posed]
            low = np.concatenate([boxes[:, 0], centers - self._radii[posed, None]])
            high = np.concatenate([boxes[:, 1], centers + self._radii[posed, None]])
            lights = reach(lamps, low, high) & lights_view(lamps, part.clips[k], part.eyes[k, :3, 3])
            power = np.where(lights, strength(lamps, 0.5 * (low + high)), 0.0).max(0, initial=0.0)
            beams = np.nonzero(lights[:, :n_beam].any(0))[0].tolist()
            others = [BEAMS + i for i in best(np.any(lights[:, n_beam:], axis=0), power[n_beam:], LAMPS)]
        return Illumination(
            filled(list(range(len(casters))), CASTER_COUNTS, NO_CASTER),
            filled(beams, BEAM_COUNTS, NO_BEAM),
            filled(others, LAMP_COUNTS, NO_LAMP),
            is_day,
        )

    def _posed(
        self, part: PreparedStates, k: int, is_dimmed: NDArray[np.bool_], light: tuple[Illumination, Illumination]
    ) -> Iterator[DrawCall]:
        """Vehicles and objects in image k. `light`: without and with shadows of vehicles."""
        n = len(self._static.geometry.ranges)
        for i in np.nonzero(part.is_seen[k, n:])[0].tolist():
            model = self._models[i]
            pieces: list[IndexRange] = [(r.first, r.length, r.kind, r.textures) for r in model.geometry.ranges]
            if i == self._row:
                model, pieces = self._own, self._own_pieces
            bones, glow, lit = part.bones[k, i].tobytes(), part.glow[k, i].tobytes(), light[int(is_dimmed[n + i])]
            yield from ((model, piece, bones, glow, lit) for piece in pieces)
