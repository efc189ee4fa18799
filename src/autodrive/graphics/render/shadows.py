"""Shadow maps: of static meshes and objects, of each vehicle, and of each headlight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.graphics.render.gl import moderngl, source, write
from autodrive.graphics.render.lighting import beam_matrix, sun_axes
from autodrive.graphics.render.look import DAY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.base.transforms import Vector
    from autodrive.graphics.render.gpu_mesh import GpuMesh
    from autodrive.graphics.render.quality import Quality
    from autodrive.graphics.render.scene import Geometry

TILES = 4
"""The shadow map of the vehicles has `TILES` x `TILES` tiles."""
CASTERS = TILES * TILES
BEAMS = 8
"""Slots for headlights that cast shadows."""
Area: TypeAlias = tuple[float, float, float, float]

BONES = 24
"""Maximum number of bones of a vehicle."""

FINE = 0.006
"""Largest texels [m] of a static shadow map of the whole map; else it covers only what is near the cameras."""
NEAR, NEAR_STEP = 4.0, 2.0
"""How far around the middle of a view it reaches then, for a camera on the ground, and the step of its place [m]."""
DIM = 0.1
"""A vehicle dims the ground so far around it [m]."""
SKIN = 1.2
"""Surfaces are moved so far towards the sun, against shadow acne: texels of the coarsest map."""

CLIP_TO_MAP = np.array([[0.5, 0.0, 0.0, 0.5], [0.0, 0.5, 0.0, 0.5], [0.0, 0.0, 0.5, 0.5], [0.0, 0.0, 0.0, 1.0]])
"""Map coordinates, [0, 1], from clip space, [-1, 1]."""


def columns(matrix: Floats) -> bytes:
    """One matrix or several in column-major order, as OpenGL reads them."""
    return np.ascontiguousarray(np.swapaxes(matrix, -1, -2), np.float32).tobytes()


class Shadows:
    """Draws and stores the shadow maps, from meshes of the detail 'shadow'."""

    def __init__(
        self,
        context: moderngl.Context,
        quality: Quality,
        static: GpuMesh,
        vehicles: Sequence[GpuMesh],
        objects: Sequence[GpuMesh],
    ) -> None:
        self._context = context
        self._static, self._vehicles, self._objects = static, vehicles, objects
        fragment = source("depth.frag")
        self._fixed = context.program(source("depth.vert"), fragment)
        self._jointed = context.program(source("depth.vert", JOINTED=1, BONES=BONES), fragment)
        self.still_size, self.caster_size, self.beam_size = quality.still_map, quality.caster_map, quality.beam_map
        self.still, self._still_frame = self._map(self.still_size, self.still_size)
        self.caster, self._caster_frame = self._map(self.caster_size, self.caster_size)
        self.beams = min(4 * quality.beam_vehicles, BEAMS - 2)
        """Number of headlights that can cast shadows: low and high beams of both sides; two slots stay empty."""
        self.beam, self._beam_frame = self._map(self.beam_size * self.beams, self.beam_size)
        self._rest = context.framebuffer([context.renderbuffer((1, 1), 4)])
        self._drawn_objects: bytes | None = None
        self._drawn_area: Area | None = None
        self.sun_direction: Vector = DAY.sun_direction
        """Unit vector towards the sun."""
        self.sun = sun_axes(self.sun_direction)
        """Sun axes from map axes, shape (3, 3)."""
        extent = np.ptp(static.geometry.vertices["position"][:, :2], axis=0) if len(static.geometry.vertices) else 0.0
        self._is_large = bool(np.linalg.norm(extent) > FINE * quality.still_map)
        self._object_points: list[Floats] = []
        """Vertices of each object in the static shadow map, in map axes."""
        self.shades: tuple[BaseGeometry, ...] = ()
        """Areas of the ground in the shadow of static meshes and of objects; a new tuple whenever they change."""
        self._static_shade: BaseGeometry = shapely.GeometryCollection()
        self._shade_margin = 0.0
        """Margin by which `shades` are too large [m]."""
        self.still_scale, self.still_offset = np.ones(3), np.full(3, 9.0)
        """Coordinates in the static shadow map, from 0 to 1: sun axes * scale + offset."""
        extent = max([0.05, *(1.05 * model.radius for model in vehicles)])
        self.caster_scale = np.array([0.5 / extent, 0.5 / extent, 1.0 / (2.0 * extent + 0.6)])
        self._extent = extent
        self._bone_boxes = [_bone_boxes(model.geometry) for model in vehicles]

    def set_sun(self, direction: Vector) -> None:
        """Set the direction towards the sun; the static shadow map is redrawn if it has changed."""
        if self.sun_direction != direction:
            self.sun_direction = direction
            self.sun = sun_axes(direction)
            self._drawn_objects = None
            self.shades = ()

    @property
    def drift(self) -> Floats:
        """How far the shadow of a vehicle reaches on level ground, shape (2,): its height over the sun's slope [m]."""
        x, y, z = self.sun_direction
        return -0.25 * np.array([x, y]) / z

    @property
    def along(self) -> Floats:
        """Level direction of the sunlight, a unit vector of shape (2,)."""
        return np.array([self.sun[0, 1], -self.sun[0, 0]])

    def areas(self, vehicles: Sequence[int], bones: Sequence[bytes]) -> Floats:
        """Rectangles of the ground that contain the shadows of these vehicles, shape (CASTERS, 4) [m].

        The first corner, `along` the sunlight and to its left, and the opposite one. `bones`: of all vehicles, columns.
        """
        x, y, z = self.sun_direction
        margin, corners = self.margin, np.zeros((CASTERS, 4))
        for slot, vehicle in enumerate(vehicles):
            owner, points = self._bone_boxes[vehicle]
            places = np.frombuffer(bones[vehicle], np.float32).reshape(-1, 4, 4)[owner].astype(np.float64)
            at = (points @ places[:, :3, :3] + places[:, 3:, :3]).reshape(-1, 3)
            fallen = at[:, :2] - np.maximum(at[:, 2:], 0.0) * np.array([[x / z, y / z]])
            level = fallen @ np.column_stack([self.along, self.sun[0, :2]])
            corners[slot] = *(level.min(0, initial=np.inf) - margin), *(level.max(0, initial=-np.inf) + margin)
        return corners

    def _map(self, width: int, height: int) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        texture = self._context.depth_texture((width, height))
        texture.compare_func = "<="
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        return texture, self._context.framebuffer(depth_attachment=texture)

    @property
    def skin(self) -> float:
        """How far surfaces are moved towards the sun, against shadow acne [m]."""
        texels = 1.0 / (self.still_scale[:2].min() * self.still_size), TILES / (self.caster_scale[0] * self.caster_size)
        return SKIN * float(max(texels))

    @property
    def margin(self) -> float:
        """How far a shadow on the ground can reach beyond its mesh, by `skin` and the filter of the map [m]."""
        return 2.0 * self.skin / self.sun_direction[2]

    def draw_still(self, objects: Floats, eyes: Floats) -> bool:
        """Redraw the static shadow map if an object or the area has changed; whether an object has.

        `objects`: poses, shape (n, 4, 4); `eyes`: poses of the cameras, shape (m, 4, 4). Only the places where an
        object was and is are drawn again: a new map takes milliseconds in software.
        """
        key, area = objects.tobytes(), self.area(eyes)
        if key == self._drawn_objects and area == self._drawn_area:
            return False
        is_moved = key != self._drawn_objects
        self._drawn_area = area
        before = self._object_points
        self._object_points = [
            model.geometry.vertices["position"] @ pose[:3, :3].T + pose[:3, 3]
            for model, pose in zip(self._objects, objects, strict=True)
        ]
        is_changed = self._fit_still() or self._drawn_objects is None
        self._drawn_objects = key
        frame = self._still_frame
        areas = [(0, 0, *frame.size)] if is_changed else list(self._moved(before))
        with self._drawing(frame):
            clip = self._sun_clip(self.still_scale, self.still_offset)
            for area in areas:
                frame.clear(viewport=area)
                frame.scissor = area
                frame.use()
                write(self._fixed, "clip_from_map", columns(clip))
                self._static.draw(self._fixed)
                self._draw_objects(clip, objects)
            frame.scissor = 0, 0, *frame.size
        if is_moved or self.margin > self._shade_margin:
            self._set_shades()
        return is_moved

    def area(self, eyes: Floats) -> Area | None:
        """Part of the ground that the static shadow map covers for these cameras; None: all. A function of `eyes` only.

        x_min, y_min, x_max, y_max [m]; as `draw_still`.
        """
        if not self._is_large or len(eyes) == 0:
            return None
        height = np.clip(eyes[:, 2, 3], 0.0, 10.0)
        ahead = np.minimum(height / np.maximum(-eyes[:, 2, 2], 1e-3), NEAR - 1.0 + 4.0 * height)
        middle = eyes[:, :2, 3] + ahead[:, None] * eyes[:, :2, 2]
        reach = (NEAR + 1.5 * height)[:, None]
        low, high = np.floor((middle - reach) / NEAR_STEP).min(0), np.ceil((middle + reach) / NEAR_STEP).max(0)
        x0, y0, x1, y1 = (NEAR_STEP * np.concatenate([low, high])).tolist()
        return x0, y0, x1, y1

    def _fit_still(self) -> bool:
        """Fit the static shadow map to the static meshes and the objects in its area; whether that changed it."""
        points = np.concatenate([self._static.geometry.vertices["position"].astype(np.float64), *self._object_points])
        if len(points) == 0:
            return False
        in_sun = points @ self.sun.T
        low, high = in_sun.min(0) - 0.02, in_sun.max(0) + 0.02
        top = points[:, 2].max()
        high[2] += top / self.sun_direction[2] + 0.2  # as far as shadows reach
        if self._drawn_area is not None:
            x0, y0, x1, y1 = self._drawn_area
            corners = np.array([(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (0.0, top)]) @ self.sun.T
            near_low, near_high = np.maximum(low[:2], corners.min(0)[:2]), np.minimum(high[:2], corners.max(0)[:2])
            if np.all(near_low < near_high):
                low[:2], high[:2] = near_low, near_high
        before = self.still_scale, self.still_offset
        self.still_scale = 1.0 / (high - low)
        self.still_offset = -low * self.still_scale
        return not (np.array_equal(before[0], self.still_scale) and np.array_equal(before[1], self.still_offset))

    def _moved(self, before: Sequence[Floats]) -> Iterator[tuple[int, int, int, int]]:
        """Rectangles of the static shadow map where an object was or is: corner, width and height [pixels]."""
        for old, new in zip(before, self._object_points, strict=True):
            if not np.array_equal(old, new):
                for points in (old, new):
                    at = self.still_size * (points @ self.sun.T * self.still_scale + self.still_offset)[:, :2]
                    low = np.clip(np.floor(at.min(0)) - 2, 0, self.still_size).astype(int)
                    high = np.clip(np.ceil(at.max(0)) + 2, 0, self.still_size).astype(int)
                    yield (*low.tolist(), *(high - low).tolist())

    def falls_on(self, low: Floats, high: Floats) -> NDArray[np.bool_]:
        """Whether a static shadow falls on each rectangle of level ground. `low`, `high`: corners, shape (n, 2)."""
        grounds = shapely.box(*(low - 0.02).T, *(high + 0.02).T)
        return np.any(shapely.intersects(grounds[:, None], np.array(self.shades, object)), axis=1)

    def _set_shades(self) -> None:
        """Set `shades`, for the sun and the objects as drawn last."""
        static, self._shade_margin = self._static.geometry, self.margin
        if not self.shades:
            points = static.vertices["position"].astype(np.float64)
            meshes = [points[static.indices[r.first : r.first + r.length]] for r in static.ranges]
            self._static_shade = shapely.union_all([_shade(mesh, self.sun_direction) for mesh in meshes])
        objects = shapely.union_all([_shade(points, self.sun_direction) for points in self._object_points])
        both = np.array([self._static_shade, objects])
        self.shades = tuple(shapely.buffer(both, self._shade_margin, quad_segs=2).tolist())

    def draw_casters(self, vehicles: Sequence[int], roots: Floats, bones: Sequence[bytes]) -> tuple[Floats, Floats]:
        """Draw a tile for each of these vehicles; offsets from sun axes * caster_scale to the tile, and its place.

        `roots`: of all vehicles, shape (n, 4, 4); `bones`: columns. The results have the shapes (n_tile, 3) and
        (n_tile, 2), the corner of the tile.
        """
        offsets, corners = np.zeros((len(vehicles), 3)), np.zeros((len(vehicles), 2))
        edge = self.caster_size // TILES
        with self._drawing(self._caster_frame):
            for slot, vehicle in enumerate(vehicles):
                center = self.sun @ roots[vehicle, :3, 3]
                low = center - self._extent
                offsets[slot] = -low * self.caster_scale
                row, column = divmod(slot, TILES)
                corners[slot] = column / TILES, row / TILES
                tile = (column * edge, row * edge, edge, edge)
                self._caster_frame.clear(viewport=tile)
                self._caster_frame.viewport = tile
                clip = self._sun_clip(self.caster_scale, offsets[slot])
                self._draw_vehicle(vehicle, clip, bones[vehicle])
        return offsets, corners

    def draw_beams(
        self, lamps: np.ndarray, owners: Sequence[int], objects: Floats, roots: Floats, bones: Sequence[bytes]
    ) -> Floats:
        """Draw a tile for each of these headlights (dtype `lighting.LAMP`); shadow map from map axes, shape (n, 4, 4).

        `owners`: their vehicles, which cast no shadow in their own light. Shadow map coordinates are from 0 to 1.
        """
        matrices = np.zeros((len(lamps), 4, 4))
        with self._drawing(self._beam_frame):
            for slot, (lamp, owner) in enumerate(zip(lamps, owners, strict=True)):
                clip = beam_matrix(lamp["place"], lamp["aim"], lamp["up"], lamp["cos_outer"], lamp["range"])
                place = (slot * self.beam_size, 0, self.beam_size, self.beam_size)
                self._beam_frame.clear(viewport=place)
                self._beam_frame.viewport = place
                write(self._fixed, "clip_from_map", columns(clip))
                self._static.draw(self._fixed)
                self._draw_objects(clip, objects)
                ahead = (roots[:, :3, 3] - lamp["place"]) @ lamp["aim"]
                for vehicle in np.nonzero((ahead > -self._extent) & (ahead < lamp["range"]))[0].tolist():
                    if vehicle != owner:
                        self._draw_vehicle(vehicle, clip, bones[vehicle])
                tile = np.diag([1.0 / self.beams, 1.0, 1.0, 1.0])
                tile[0, 3] = slot / self.beams
                matrices[slot] = tile @ CLIP_TO_MAP @ clip
        return matrices

    # -- within ---------------------------------------------------------------------------------------------------

    @contextmanager
    def _drawing(self, frame: moderngl.Framebuffer) -> Iterator[None]:
        """Offsets depths against shadow acne and draws both sides of triangles: thin parts cast shadows too."""
        frame.viewport = (0, 0, *frame.size)
        frame.use()
        self._context.polygon_offset = 1.5, 2.0
        self._context.disable(moderngl.CULL_FACE)
        yield
        self._rest.clear()  # a change of the framebuffer makes llvmpipe start drawing, in parallel with this thread
        self._context.enable(moderngl.CULL_FACE)
        self._context.polygon_offset = 0.0, 0.0

    def _sun_clip(self, scale: Floats, offset: Floats) -> Floats:
        clip = np.eye(4)
        clip[:3, :3] = 2.0 * scale[:, None] * self.sun
        clip[:3, 3] = 2.0 * offset - 1.0
        return clip

    def _draw_objects(self, clip: Floats, objects: Floats) -> None:
        for model, pose in zip(self._objects, objects, strict=True):
            write(self._fixed, "clip_from_map", columns(clip @ pose))
            model.draw(self._fixed)

    def _draw_vehicle(self, vehicle: int, clip: Floats, bones: bytes) -> None:
        write(self._jointed, "clip_from_map", columns(clip))
        write(self._jointed, "bones", bones)
        self._vehicles[vehicle].draw(self._jointed)


def _bone_boxes(own: Geometry) -> tuple[NDArray[np.intp], Floats]:
    """Bones that move vertices, shape (n,), and the corners of a box around these, in their axes, shape (n, 8, 3)."""
    points, bones = own.vertices["position"].astype(np.float64), own.vertices["bone_lamp"][:, 0].astype(np.intp)
    used = np.unique(bones)
    boxes = [np.array([points[bones == bone].min(0), points[bones == bone].max(0)]) for bone in used.tolist()]
    corners = [np.stack(np.meshgrid(*box.T), axis=-1).reshape(8, 3) for box in boxes]
    return used, np.array(corners).reshape(-1, 8, 3)


def _shade(points: Floats, sun: Vector) -> BaseGeometry:
    """Shadow of a mesh on the plane z = 0, joined with its footprint; `sun`: unit vector towards it."""
    x, y, z = sun
    fallen = points[:, :2] - np.maximum(points[:, 2:], 0.0) * np.array([[x / z, y / z]])
    return shapely.MultiPoint(np.concatenate([fallen, points[:, :2]])).convex_hull
