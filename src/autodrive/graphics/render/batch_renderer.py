"""Renders small images of many states of one scene, seen by the same camera of a vehicle, and reads them at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
    Slots,
    best,
    filled,
    shadow_distances,
)
from autodrive.graphics.render.fxaa import smoothed
from autodrive.graphics.render.gl import current
from autodrive.graphics.render.lighting import lights_view, reach, strength
from autodrive.graphics.render.parts import in_sight, sight_planes
from autodrive.graphics.render.render_state import VEHICLE, RenderState
from autodrive.graphics.render.renderer import IndexRange, Renderer, clip_from_optical
from autodrive.graphics.render.scene import LEVEL, rigid, rigid_all, signals_of
from autodrive.graphics.render.shadows import BEAMS, BONES, CASTERS, DIM

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
SLACK = 0.05
"""How far the joints of a vehicle can move its parts [m], with a margin."""
STEP = 0.02
"""A vehicle dims ground that is so much higher than the road [m]."""

Lit: TypeAlias = dict[int, Illumination]
"""Light and shadow on ranges of the static mesh, vehicles and objects, by their numbers in this order."""


class PreparedStates(NamedTuple):
    """Some states, prepared for drawing: m states, v vehicles, o objects, r ranges of the static mesh."""

    worlds: Sequence[RenderState]
    """Each state."""
    views: Sequence[View]
    """The camera in each state."""
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
    low: Floats
    """Lowest corners of ranges, vehicles and objects [m], shape (m, r + v + o, 3)."""
    high: Floats
    """Highest corners of ranges, vehicles and objects [m], shape (m, r + v + o, 3)."""
    to_shadow: Floats
    """Distances from ranges, vehicles and objects to the shadow of each vehicle, see `shadow_distances`, shape
    (m, r + v + o, v)."""
    is_seen: NDArray[np.bool_]
    """Ranges, vehicles and objects, shape (m, r + v + o)."""
    is_dimmed: NDArray[np.bool_]
    """Whether the shadow of each vehicle can be seen on each of these, shape (m, r + v + o, v)."""


class BatchRenderer(Renderer):
    """Draws images of one camera of one vehicle.

    The formulas are those of `Renderer`.

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
        kinds = [r.kind for r in self._static.geometry.ranges]
        self._is_ground = np.array([kind == "ground" for kind in kinds] + [False] * len(self._models), np.bool_)
        """Whether a range, vehicle or object is ground, on which all vehicles cast shadows."""
        k = view.intrinsics
        self._image_size = 3 * k.width * k.height
        with current(self._context) as context:
            self._indices = context.buffer(reserve=4 * max(len(self._static.geometry.indices), 1), dynamic=True)
            self._pixels = context.buffer(reserve=PART * self._image_size, dynamic=True)
            self._seen_static = self._static.with_indices(self._indices)
            self._own, self._own_pieces = self._own_vehicle()

    def draw_batch(self, states: RenderState, views: Sequence[View]) -> NDArray[np.uint8]:
        """One image of each of n states, RGB, shape (n, height, width, 3). `views`: of the camera in each state."""
        k, n = self._view.intrinsics, len(views)
        worlds = [states[i] for i in range(n)]
        images = np.empty((n, k.height, k.width, 3), np.uint8)
        eyes = np.array([rigid(view.position, view.orientation) for view in views]).reshape(-1, 4, 4)
        suns = [(state.is_day, state.look.sun_direction) for state in worlds]
        # states with the same sun, equal poses of the objects and near cameras share a shadow map
        with current(self._context):
            for is_day, sun in sorted({*suns}):
                if is_day:
                    self._shadows.set_sun(sun)
                keys = {
                    i: (states.objects[i].tobytes(), self._shadows.area(eyes[i : i + 1]) or ())
                    for i in range(n)
                    if suns[i] == (is_day, sun)
                }
                order = np.array(sorted(keys, key=keys.__getitem__), np.intp)
                for numbers in np.split(order, range(PART, len(order), PART)):
                    own = [worlds[i] for i in numbers], [views[i] for i in numbers]
                    part = self._prepared(states[numbers], *own, eyes[numbers])
                    images[numbers] = self._draw_part(part).reshape(-1, *images.shape[1:])
        if self.quality.antialiasing == "fxaa":
            opaque = np.full((k.height, k.width, 1), 255, np.uint8)
            for image in images:
                image[...] = smoothed(np.dstack([image, opaque]))[..., :3]
        return images

    # -- preparation ------------------------------------------------------------------------------------------------

    def _prepared(
        self, states: RenderState, worlds: Sequence[RenderState], views: Sequence[View], eyes: Floats
    ) -> PreparedStates:
        """`worlds`: each of the `states`; `eyes`: poses of the `views`."""
        vehicles, objects = states.vehicles, states.objects
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
        clips = np.array([clip_from_optical(self._view) @ np.linalg.inv(eye) for eye in eyes])
        middles = np.array([middle for middle, _ in self._draw_list.outlines]).reshape(v, 3, 1)
        vehicle_centers = roots[..., :3, 3] + (roots[..., :3, :3] @ middles)[..., 0]
        centers = np.concatenate([vehicle_centers, places[..., :3, 3]], axis=1)
        away = np.linalg.norm(roots[..., :3, 3] - eyes[:, None, :3, 3], axis=-1)
        planes, static = sight_planes(clips), self._static.geometry
        is_seen = np.concatenate([in_sight(planes, *static.spheres), in_sight(planes, centers, self._radii)], axis=1)
        is_seen[:, len(static.ranges) + self._row] &= len(self._own_pieces) > 0
        low, high = self._boxes(centers)
        to_shadow, limit = shadow_distances(low, high, vehicle_centers, self._shadows.drift)
        return PreparedStates(
            worlds=worlds,
            views=views,
            roots=roots,
            places=places,
            bones=bones,
            glow=glow,
            eyes=eyes,
            clips=clips,
            centers=centers,
            near=np.argsort(away, axis=1, kind="stable"),
            is_seen=is_seen,
            low=low,
            high=high,
            to_shadow=to_shadow,
            is_dimmed=is_seen[..., None] & self._dims(to_shadow < limit, roots, planes),
        )

    def _dims(self, dims: NDArray[np.bool_], roots: Floats, planes: Floats) -> NDArray[np.bool_]:
        """Whether the shadow of each vehicle can fall on each range, vehicle and object, in sight if it is ground.

        `dims`: the same, in sight or not; is written.
        """
        v, static, drift = roots.shape[1], self._static.geometry, self._shadows.drift
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

    def _boxes(self, centers: Floats) -> tuple[Floats, Floats]:
        """Lowest and highest corners of ranges, vehicles and objects, shape (m, r + v + o, 3) each."""
        own, radii = self._static.geometry.boxes, self._radii[:, None]
        shape = len(centers), len(own), 3
        low = np.concatenate([np.broadcast_to(own[:, 0], shape), centers - radii], axis=1)
        return low, np.concatenate([np.broadcast_to(own[:, 1], shape), centers + radii], axis=1)

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

    def _draw_part(self, part: PreparedStates) -> NDArray[np.uint8]:
        m = len(part.roots)
        size = self._view.intrinsics.width, self._view.intrinsics.height
        targets = [self._target(number, *size) for number in range(min(RING, m))]
        for k in range(m):
            if k % RING == 0:  # for as many images as there are targets: llvmpipe waits for what a shader reads
                for later in range(k, min(k + RING, m)):
                    look = None
                    if self._is_sky_coarse(self._view):
                        look = self._begin_frame(part.worlds[later])
                        self._frame.write(self._draw_list.frame.tobytes())
                    self._write_camera(part.clips[later], part.eyes[later, :3, 3])
                    self._draw_behind(later % RING, self._view, part.clips[later], look, is_day=False)
            if k >= RING:
                targets[k % RING].read_rgb_into(self._pixels, (k - RING) * self._image_size)
            state = part.worlds[k]
            look = self._begin_frame(state)
            lit = self._illuminations(part, k)
            self._frame.write(self._draw_list.frame.tobytes())
            self._write_camera(part.clips[k], part.eyes[k, :3, 3])
            self._bind()
            targets[k % RING].begin()
            self._use_behind(k % RING, self._view)
            calls = [*self._posed(part, k, lit), *self._ranges(part, k, lit)]
            self._draw_calls(calls, state.is_day, weather=look.effects)
            self._draw_sky_and_air(part.views[k], part.clips[k], look, state.time)
            targets[k % RING].finish()
        for k in range(max(m - RING, 0), m):
            targets[k % RING].read_rgb_into(self._pixels, k * self._image_size)
        pixels = np.empty((m, self._image_size), np.uint8)
        self._pixels.read_into(pixels, size=pixels.nbytes)
        return pixels

    def _begin_frame(self, state: RenderState) -> Daylight:
        """Set the uniform block to the sun and sky of a state, which are returned."""
        look = state.look
        self._draw_list.frame[...] = 0
        self._draw_list.set_sky(look, state.time)
        return look

    def _ranges(self, part: PreparedStates, k: int, lit: Lit) -> Iterator[DrawCall]:
        """What image k shows of the static mesh; fills the buffer of the triangles."""
        own, seen = self._static.geometry, part.is_seen[k]
        chosen: list[NDArray[np.uint32]] = []
        pieces: list[tuple[IndexRange, Illumination]] = []
        first = 0
        for (kind, textures), numbers in self._groups.items():
            of_light: dict[Illumination, list[int]] = {}
            for i in numbers[seen[numbers]].tolist():
                of_light.setdefault(lit[i], []).append(i)
            for light, alike in of_light.items():
                ranges = [own.ranges[i] for i in alike]
                length = sum(r.length for r in ranges)
                pieces.append(((first, length, kind, textures), light))
                chosen += [own.indices[r.first : r.first + r.length] for r in ranges]
                first += length
        if chosen:
            self._indices.orphan()
            self._indices.write(np.concatenate(chosen).tobytes())
        return ((self._seen_static, piece, None, None, light) for piece, light in pieces)

    def _illuminations(self, part: PreparedStates, k: int) -> Lit:
        """Light and shadow on what image k shows; draws the shadow maps.

        All meshes have the same lamps and casters of shadows, because then few draw calls are needed. Only if a mesh
        has more of them than `Renderer` draws, each mesh has those that `Renderer` draws.
        """
        draws, state = self._draw_list, part.worlds[k]
        roots, places, near, is_day = part.roots[k], part.places[k], part.near[k].tolist(), state.is_day
        bones = [bone.tobytes() for bone in part.bones[k, : len(roots)]]
        is_casting = part.is_dimmed[k].any(0)
        casters = [i for i in near if is_casting[i]][: CASTERS - 1]
        if is_day:
            self._shadows.draw_still(places, part.eyes[k : k + 1])
        draws.set_casters(casters, roots, part.centers[k, : len(roots)], bones, is_day=is_day)
        are_lit = state.look.are_lamps_lit
        lamps, n_beam = draws.set_lamps(state.vehicles, near, roots, places, bones, are_lit=are_lit)
        numbers = np.flatnonzero(part.is_seen[k])
        low, high = part.low[k, numbers], part.high[k, numbers]
        dimmed, away = part.is_dimmed[k, numbers][:, casters], part.to_shadow[k, numbers][:, casters]
        shades = self._shades(dimmed, away, self._is_ground[numbers])
        beams, small = self._lights(lamps, n_beam, low, high, lights_view(lamps, part.clips[k], part.eyes[k, :3, 3]))
        return {
            number: Illumination(shade, beams, slots, is_day)
            for number, shade, slots in zip(numbers.tolist(), shades, small, strict=True)
        }

    def _shades(self, dimmed: NDArray[np.bool_], away: Floats, is_ground: NDArray[np.bool_]) -> list[Slots]:
        """Slots of the vehicles that cast shadows on each of b meshes.

        `dimmed`, `away`: whether each of c vehicles does, and at which distance [m], shape (b, c).
        """
        every = filled([*range(dimmed.shape[1])], CASTER_COUNTS, NO_CASTER)
        shades = [every if row.any() else () for row in dimmed]
        if np.any(dimmed[~is_ground].sum(1) > self.quality.casters):
            for i in np.flatnonzero(~is_ground).tolist():
                shades[i] = filled(best(dimmed[i], -away[i], self.quality.casters), CASTER_COUNTS, NO_CASTER)
        return shades

    def _lights(
        self, lamps: np.ndarray, n_beam: int, low: Floats, high: Floats, is_lit: NDArray[np.bool_]
    ) -> tuple[Slots, list[Slots]]:
        """Slots of the headlights with shadows, and those of the other lamps of each of b meshes.

        `low`, `high`: corners of the meshes, shape (b, 3); `is_lit`: whether each lamp lights something in the view.
        """
        if len(lamps) == 0:
            return (), [()] * len(low)
        reached = reach(lamps, low, high)
        lights = np.flatnonzero(reached.any(0) & is_lit)
        beams = filled(lights[lights < n_beam].tolist(), BEAM_COUNTS, NO_BEAM)
        small, others = reached[:, n_beam:], [lights[lights >= n_beam] - n_beam] * len(low)
        if np.any(small.sum(1) > self.quality.lamps) or len(others[0]) > LAMP_COUNTS[-1]:
            power = strength(lamps[n_beam:], 0.5 * (low + high))
            others = [np.array(best(small[i], power[i], self.quality.lamps), np.intp) for i in range(len(small))]
            others = [chosen[is_lit[n_beam + chosen]] for chosen in others]
        return beams, [filled((BEAMS + chosen).tolist(), LAMP_COUNTS, NO_LAMP) for chosen in others]

    def _posed(self, part: PreparedStates, k: int, lit: Lit) -> Iterator[DrawCall]:
        """Vehicles, objects and lit lenses in image k."""
        n = len(self._static.geometry.ranges)
        for i in np.nonzero(part.is_seen[k, n:])[0].tolist():
            model = self._models[i]
            pieces: list[IndexRange] = [(r.first, r.length, r.kind, r.textures) for r in model.geometry.ranges]
            if i == self._row:
                model, pieces = self._own, self._own_pieces
            bones, glow = part.bones[k, i].tobytes(), part.glow[k, i].tobytes()
            yield from ((model, piece, bones, glow, lit[n + i]) for piece in pieces)
        planes = sight_planes(part.clips[k])
        for lens in self._draw_list.lit_lenses(part.worlds[k]):
            if in_sight(planes, lens.center[None], np.array([lens.radius]))[0]:
                [ball] = lens.model.geometry.ranges
                piece = ball.first, ball.length, ball.kind, ball.textures
                yield lens.model, piece, lens.bones, lens.glow, lens.lit
