"""Renders states of a scene without a screen: a small forward renderer on OpenGL 3.3."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from autodrive.graphics.render import texture_arrays
from autodrive.graphics.render.draw_list import FRAME, DrawList, Illumination
from autodrive.graphics.render.gl import current, is_forked, moderngl, open_context, source, write
from autodrive.graphics.render.gpu_mesh import GpuMesh
from autodrive.graphics.render.ground_shadows import GroundShadows
from autodrive.graphics.render.ground_strips import GroundStrips
from autodrive.graphics.render.lighting import lights_view, perspective
from autodrive.graphics.render.parts import Parts, in_sight, sight_planes
from autodrive.graphics.render.quality import quality
from autodrive.graphics.render.scene import LEVEL, Kind, Skeleton, geometry, lit_lenses, rigid
from autodrive.graphics.render.shadows import BONES, DIM, Shadows, columns
from autodrive.graphics.render.strokes import StrokePass
from autodrive.graphics.render.target import ExactImage, ExactTarget, RenderTarget
from autodrive.physics.sensors.camera.view import RenderedImage, View
from autodrive.protocol.labels import Label

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.base.transforms import Vector
    from autodrive.graphics.assets.asset import Asset, Detail
    from autodrive.graphics.render.look import Air, Daylight
    from autodrive.graphics.render.render_state import RenderState
    from autodrive.graphics.render.scene import RenderScene
    from autodrive.graphics.render.strokes import Strokes

STREAKS, FLAKES, DROPS = 260, 500, 14
"""Rain streaks, snow flakes, and drops on the lens, in an image of the heaviest rain and snow."""
BEAM_FOG_CELLS = 48, 36
"""Cells of the beams in fog along the image and up, `CELLS` in shaders/beam_fog.vert."""
STARRY = 0.125
"""Brightness of the zenith (its green part) below which there are stars."""
COARSE_WIDTH = 400
"""The sky of wider images is drawn with fewer pixels [pixels]; see `Quality.sky_step`."""
PART_SIZE = 0.06
"""Size of the parts of a vehicle [m]."""

UNITS = {"textures": 0, "still_map": 1, "caster_map": 2, "beam_map": 3, "behind": 4}
"""Texture unit of each sampler."""


IndexRange: TypeAlias = tuple[int, int, Kind, str]
"""First index, number of indices, kind, texture array."""


DrawCall: TypeAlias = "tuple[GpuMesh, IndexRange, bytes | None, bytes | None, Illumination]"
"""What is drawn at once. Bones and glow are None for the static mesh."""


SeenLit: TypeAlias = Callable[[Illumination], Illumination]
"""`DrawList.seen_lit` in a view."""


class ShaderVariant(NamedTuple):
    """Compile-time options of a shader program."""

    is_jointed: bool
    kind: Kind
    is_textured: bool
    is_day: bool
    is_shaded: bool
    casters: int
    beams: int
    lamps: int
    weather: tuple[str, ...]


class Renderer:
    """Renders one `RenderScene`, for one caller at a time.

    `quality_name` is one of `render.quality.NAMES`. Raises `GlUnavailable`.
    """

    def __init__(self, scene: RenderScene, quality_name: str = "auto") -> None:
        self._context = context = open_context()
        self.name = str(context.info["GL_RENDERER"])
        """The OpenGL renderer, for example 'llvmpipe (...)'."""
        self.quality = quality(quality_name, self.name)
        assets = [scene.static, *scene.vehicles, *scene.objects]
        self._textures, layers = texture_arrays.load(context, assets, self.quality)
        lit = lit_lenses(scene.static)
        skeletons = {id(asset): Skeleton(asset) for asset in [*assets, *lit]}
        models: dict[tuple[int, Detail], GpuMesh] = {}
        instances = {name: number for number, name in enumerate(scene.map_objects, 1)}
        self._n_map_object = len(instances)

        def model(asset: Asset, detail: Detail) -> GpuMesh:
            key = id(asset), detail
            if key not in models:
                whole = asset is not scene.static
                own = geometry(asset, skeletons[id(asset)], detail, layers, is_whole=whole, instances=instances)
                models[key] = GpuMesh(context, own)
            return models[key]

        detail = self.quality.detail
        self._static = model(scene.static, detail)
        self._vehicles = [model(asset, detail) for asset in scene.vehicles]
        self._objects = [model(asset, detail) for asset in scene.objects]
        lenses = [model(asset, detail) for asset in lit]
        self._lenses = frozenset(lenses)
        """Lenses of traffic lights, lit; depth and labels show the dark ones, which are in the static mesh."""
        self._shadows = Shadows(
            context,
            self.quality,
            model(scene.static, "shadow"),
            [model(asset, "shadow") for asset in scene.vehicles],
            [model(asset, "shadow") for asset in scene.objects],
        )
        self._skeletons = [skeletons[id(asset)] for asset in scene.vehicles]
        self._draw_list = DrawList(
            scene, self.quality, self._skeletons, self._static, self._vehicles, self._objects, lenses, self._shadows
        )
        ranges = self._static.geometry.ranges
        looks = sorted({(r.kind in LEVEL, r.kind, r.textures) for r in ranges})
        self._looks = np.array([looks.index((r.kind in LEVEL, r.kind, r.textures)) for r in ranges], np.intp)
        """Number of the look of each range of the static mesh; level ground has the highest numbers."""
        self._parts = {id(mesh): Parts.of(mesh.geometry, PART_SIZE) for mesh in self._vehicles}
        self._parts[id(self._static)] = Parts.of(self._static.geometry, math.inf)
        """Parts of each mesh that is drawn in parts, by its id."""
        size = sum(mesh.geometry.indices.nbytes for mesh in (self._static, *self._vehicles))
        self._view_indices = context.buffer(reserve=max(size, 4), dynamic=True)
        self._meshes = {id(mesh): mesh.with_indices(self._view_indices) for mesh in (self._static, *self._vehicles)}
        """Meshes with the triangles that a view draws, by the id of the mesh with all triangles."""
        self._chosen: list[NDArray[np.uint32]] = []
        """Indices of those triangles."""
        self._frame = context.buffer(reserve=FRAME.itemsize)
        self._camera = context.buffer(reserve=80)
        self._clouds = layers.get("clouds")
        """Texture array and layer of their noise."""
        strips = scene.static.strips
        self._strips = None if strips is None else GroundStrips(context, strips)
        self._ground_shadows = cache(self._new_ground_shadows)
        self._behind = cache(self._new_behind)
        self._program, self._target = cache(self._new_program), cache(self._new_target)
        self._label_program = cache(lambda is_jointed: self._linked("scene.vert", "label.frag", is_jointed))
        self._exact_target = cache(lambda width, height: ExactTarget(context, width, height))
        self._sky = cache(self._new_sky)
        self._plain = cache(self._new_plain)
        self._stroke_pass = cache(lambda: StrokePass(context))
        context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        context.depth_func = "<="

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """Free all graphics memory; a forked process has none."""
        if not is_forked():
            self._context.release()

    def draw(
        self,
        state: RenderState,
        views: Sequence[View],
        *,
        depth: bool = False,
        labels: bool = False,
        instances: bool = False,
        strokes: Strokes | None = None,
    ) -> list[RenderedImage]:
        """One image of that state for each view, in the order of the views; `strokes` are drawn into all."""
        with current(self._context):  # only while it draws: the next call may come from another thread
            images = self._drawn(state, views, strokes)
            if not (depth or labels or instances):
                return images
            exact = [self._draw_exact(view) for view in views]
        return [
            replace(
                image,
                depth=own.depth if depth else None,
                labels=own.labels if labels else None,
                instances=own.instances if instances else None,
            )
            for image, own in zip(images, exact, strict=True)
        ]

    def instances(self, state: RenderState, view: View) -> tuple[NDArray[np.uint16], dict[int, NDArray[np.bool_]]]:
        """Instance number of each pixel, and for each number that is there, which pixels it has if nothing hides it.

        All arrays have the shape (height, width).
        """
        with current(self._context):
            self._set(state, [view])
            seen = self._draw_exact(view).instances
            numbers = [int(number) for number in np.unique(seen) if number]
            return seen, {number: self._draw_exact(view, only=number).instances > 0 for number in numbers}

    def _set(self, state: RenderState, views: Sequence[View]) -> None:
        self._context.front_face = "ccw"
        self._draw_list.set(state, views)
        self._frame.write(self._draw_list.frame.tobytes())
        self._bind()

    def _drawn(self, state: RenderState, views: Sequence[View], strokes: Strokes | None) -> list[RenderedImage]:
        self._set(state, views)
        targets = [self._target(i, view.intrinsics.width, view.intrinsics.height) for i, view in enumerate(views)]
        clips: list[Floats] = []
        for number, view in enumerate(views):  # all before the images: llvmpipe waits for what a shader reads
            clips.append(self._look(view))
            self._draw_behind(number, view, clips[-1], state.look, is_day=state.is_day)
        for number, (target, view, clip) in enumerate(zip(targets, views, clips, strict=True)):
            target.begin()
            self._use_behind(number, view)
            self._write_camera(clip, view.position)
            self._draw_colors(view, clip, state.look, state.time, state.is_day)
            if strokes is not None:
                self._stroke_pass().draw(strokes, view)
        for target in targets:
            target.finish()
        return [RenderedImage(target.read()) for target in targets]

    def _bind(self) -> None:
        """Bind uniform blocks and shadow maps, after the shadow maps have been drawn."""
        self._frame.bind_to_uniform_block(0)
        self._camera.bind_to_uniform_block(1)
        self._shadows.still.use(UNITS["still_map"])
        self._shadows.caster.use(UNITS["caster_map"])
        self._shadows.beam.use(UNITS["beam_map"])
        self._context.front_face = "cw"  # the first row is at the top, which mirrors the triangles

    # -- a view -----------------------------------------------------------------------------------------------------

    def _new_target(self, number: int, width: int, height: int) -> RenderTarget:
        """Make the target of the view with that number: each has its own."""
        del number
        return RenderTarget(self._context, width, height, self.quality.antialiasing)

    def _new_behind(self, number: int, width: int, height: int) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        """Make an image of strips and shade on the ground; after its rows are those of a coarse image of the sky."""
        del number
        texture = self._context.texture((width, height + self._sky_size(height)), 4)  # llvmpipe reads others slowly
        texture.repeat_x = texture.repeat_y = False
        return texture, self._context.framebuffer([texture])

    def _sky_size(self, size: int) -> int:
        """Columns or rows of the coarse image of the sky, for an image with so many."""
        return -(-size // self.quality.sky_step) if self.quality.sky_step > 1 else 0

    def _draw_behind(
        self, number: int, view: View, clip: Floats, look: Daylight | None = None, *, is_day: bool = True
    ) -> None:
        """Draw what `_new_behind` says, for the view with that number. Without `look` neither sky nor shade.

        First what reads textures, as in `_draw_calls`.
        """
        width, height = view.intrinsics.width, view.intrinsics.height
        frame = self._behind(number, width, height)[1]
        frame.use()
        frame.clear()
        if look is not None and self._is_sky_coarse(view):
            frame.viewport = 0, height, self._sky_size(width), self._sky_size(height)
            self._draw_sky(clip, look, step=self.quality.sky_step)
        frame.viewport = 0, 0, width, height
        self._camera.bind_to_uniform_block(1)
        self._context.disable(moderngl.CULL_FACE | moderngl.DEPTH_TEST)
        self._context.enable(moderngl.BLEND)
        if look is not None:
            self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_COLOR
            vertices = 6 * self._draw_list.n_caster
            self._draw_plain("ground_shade", vertices, {"reach": np.float32(DIM).tobytes()})
            if is_day:
                self._context.blend_equation = moderngl.MAX, moderngl.MAX
                self._ground_shadows().draw(self._shadows.shades, clip)
                shadows = {"along": self._shadows.along.astype(np.float32), "areas": self._draw_list.shadow_areas}
                self._draw_plain("ground_shade", vertices, {k: v.tobytes() for k, v in shadows.items()}, is_day=True)
                self._context.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        if self._strips is not None:
            self._context.blend_func = moderngl.ONE, moderngl.ONE
            self._strips.draw(clip, width, height)
        self._context.disable(moderngl.BLEND)
        self._context.enable(moderngl.CULL_FACE | moderngl.DEPTH_TEST)

    def _use_behind(self, number: int, view: View) -> None:
        self._behind(number, view.intrinsics.width, view.intrinsics.height)[0].use(UNITS["behind"])

    def _draw_colors(self, view: View, clip: Floats, look: Daylight, time: float, is_day: bool) -> None:
        outlines = ("OUTLINED",) if view.is_outlined and not is_day else ()
        self._draw_calls(self._seen(clip, view), is_day, weather=look.effects, of_vehicles=outlines)
        self._draw_sky_and_air(view, clip, look, time)

    def _draw_sky_and_air(self, view: View, clip: Floats, look: Daylight, time: float) -> None:
        if self._is_sky_coarse(view):
            self._draw_coarse_sky(clip, look, view)
        else:
            self._draw_sky(clip, look)
        self._draw_air(clip, look.air, time, view)

    def _draw_calls(
        self, calls: list[DrawCall], is_day: bool, *, weather: tuple[str, ...], of_vehicles: tuple[str, ...] = ()
    ) -> None:
        """Draw these, a textured one first: llvmpipe waits for all earlier draw calls before its first texture."""
        textured = next((i for i, (_, piece, *_) in enumerate(calls) if piece[3]), 0)
        order = [*calls[textured : textured + 1], *calls[:textured], *calls[textured + 1 :]]
        used: tuple[ShaderVariant, str, Illumination] | None = None
        for model, piece, bones, glow, lit in order:
            first, count, kind, textures = piece
            counts = len(lit.casters), len(lit.beams), len(lit.lamps)
            looks = bones is not None, kind, bool(textures), is_day, lit.is_shaded
            variant = ShaderVariant(*looks, *counts, weather if bones is None else weather + of_vehicles)
            program = self._program(variant)
            if (variant, textures, lit) != used:
                used = variant, textures, lit
                if textures:
                    self._textures[textures].use(UNITS["textures"])
                for name, slots in zip(("casters", "beams", "lamp_numbers"), lit[:3], strict=True):
                    if slots:
                        write(program, name, np.array(slots, np.int32).tobytes())
            if bones is not None and glow is not None:
                write(program, "bones", bones)
                write(program, "lamps", glow)
            model.draw(program, first, count)

    def _is_sky_coarse(self, view: View) -> bool:
        """The sun in a small image is too small for it."""
        return self.quality.sky_step > 1 and view.intrinsics.width >= COARSE_WIDTH

    def _draw_sky(self, clip: Floats, look: Daylight, *, step: int = 1) -> None:
        """`step`: see `Quality.sky_step`; stars do not fit into an image with fewer pixels."""
        is_starry = _is_starry(look)
        flags = {
            "AIR": "AIR" in look.air.effects,
            "STARS": is_starry and step == 1,
            "WIDE": is_starry and step > 1,
            "DAWN": any(look.dawn),
            "CLOUDS": self._clouds is not None,
            "QUICK": self.quality.detail == "reduced",
        }
        program, corners = self._sky("sky.frag", tuple(name for name, is_set in flags.items() if is_set), step)
        if self._clouds is not None:
            array, layer = self._clouds
            self._textures[array].use(UNITS["textures"])
            write(program, "layer", np.float32(layer).tobytes())
        self._fill(program, corners, clip)

    def _draw_coarse_sky(self, clip: Floats, look: Daylight, view: View) -> None:
        """The sky of `_draw_behind`, and its stars."""
        program, corners = self._sky("coarse_sky.frag", ("STARS",) if _is_starry(look) else (), 1)
        k = view.intrinsics
        size = np.array([self._sky_size(k.width), self._sky_size(k.height), k.width, k.height], np.float32)
        write(program, "size", size.tobytes())
        self._fill(program, corners, clip)

    def _fill(self, program: moderngl.Program, corners: moderngl.VertexArray, clip: Floats) -> None:
        """Draw the far plane."""
        write(program, "map_from_clip", columns(np.asarray(np.linalg.inv(clip), np.float64)))
        self._context.disable(moderngl.CULL_FACE)
        corners.render(moderngl.TRIANGLES, 3)
        self._context.enable(moderngl.CULL_FACE)

    def _draw_air(self, clip: Floats, air: Air, time: float, view: View) -> None:
        """What is in the air before the camera: light of headlights in fog, rain and snow, and drops on the lens.

        Other places in each image, the same for the same time.
        """
        streaks, flakes, drops = round(STREAKS * air.rain), round(FLAKES * air.snow), round(DROPS * air.rain)
        heads = self._draw_list.n_beam
        is_foggy = heads > 0 and "AIR" in air.effects
        if streaks + flakes == 0 and not is_foggy:
            return
        self._context.disable(moderngl.CULL_FACE)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_COLOR
        common = {
            "map_from_clip": columns(np.asarray(np.linalg.inv(clip), np.float64)),
            "heads": np.int32(heads).tobytes(),
        }
        if is_foggy:
            self._context.fbo.depth_mask = False
            self._draw_plain("beam_fog", -1, common)
            self._context.fbo.depth_mask = True
        self._context.disable(moderngl.DEPTH_TEST)
        k = view.intrinsics
        place = f"{view.position} {view.orientation}".encode()
        seed = zlib.crc32(place, round(1e4 * time)) & 0x7FFFFFFF
        pixel = 2.0 * max(1.0, k.height / 480.0)
        shape = pixel / k.width, pixel / k.height, 0.1 + 0.9 * air.wind, time
        numbers = {"seed": seed, "flakes": streaks, "drops": streaks + flakes}
        common |= {name: np.int32(number).tobytes() for name, number in numbers.items()}
        common["shape"] = np.array(shape, np.float32).tobytes()
        self._draw_plain("precipitation", 6 * (streaks + flakes + drops), common)
        self._context.disable(moderngl.BLEND)
        self._context.enable(moderngl.CULL_FACE | moderngl.DEPTH_TEST)

    def _draw_plain(self, name: str, vertices: int, uniforms: dict[str, bytes], *, is_day: bool = False) -> None:
        """Draw triangles that the shaders of that name place by the numbers of their vertices."""
        program, array = self._plain(name, is_day)
        for uniform, data in uniforms.items():
            write(program, uniform, data)
        if vertices:
            array.render(moderngl.TRIANGLES, vertices)

    def _draw_exact(self, view: View, *, only: int = 0) -> ExactImage:
        """The exact image of a view; `only`: of the instance with that number alone."""
        target = self._exact_target(view.intrinsics.width, view.intrinsics.height)
        target.begin()
        numbers = {id(posed.bones): number for number, posed in enumerate(self._draw_list.posed, 1)}
        for model, piece, bones, _, _ in self._seen(self._look(view), view):
            if model in self._lenses:
                continue
            program = self._label_program(bones is not None)
            if bones is not None:
                write(program, "bones", bones)
                write(program, "number", np.float32(self._n_map_object + numbers[id(bones)]).tobytes())
            write(program, "only", np.float32(only).tobytes())
            model.draw(program, *piece[:2])
        return target.read()

    def _look(self, view: View) -> Floats:
        """Clip space from map axes for that view; also writes it to the uniform block."""
        clip = clip_from_optical(view) @ np.linalg.inv(rigid(view.position, view.orientation))
        self._write_camera(clip, view.position)
        return clip

    def _write_camera(self, clip: Floats, eye: Vector | Floats) -> None:
        self._camera.write(columns(clip) + np.array([*eye, 1.0], np.float32).tobytes())

    def _seen(self, clip: Floats, view: View) -> list[DrawCall]:
        """Visible meshes: first those that move, which are near, then the static ones, the ground last."""
        self._chosen = []
        draws = self._draw_list
        is_lit = lights_view(draws.lamps, clip, np.array(view.position))
        seen_lit = cache(lambda lit: draws.seen_lit(lit, is_lit))
        calls = [*self._seen_posed(clip, seen_lit), *self._seen_ranges(clip, seen_lit)]
        if self._chosen:
            self._view_indices.orphan()
            self._view_indices.write(np.concatenate(self._chosen).tobytes())
        return calls

    def _seen_posed(self, clip: Floats, seen_lit: SeenLit) -> Iterator[DrawCall]:
        posed = self._draw_list.posed
        if not posed:
            return
        centers, radii = np.array([p.center for p in posed]), np.array([p.radius for p in posed])
        seen = np.flatnonzero(in_sight(sight_planes(clip), centers, radii))
        for i in seen[np.argsort(centers[seen] @ clip[3, :3], kind="stable")].tolist():
            mesh, bones, glow, _, _, reached = posed[i]
            lit = seen_lit(reached)
            ranges = mesh.geometry.ranges
            parts = self._parts.get(id(mesh))
            if parts is None:
                yield from ((mesh, (r.first, r.length, r.kind, r.textures), bones, glow, lit) for r in ranges)
                continue
            places = np.swapaxes(np.frombuffer(bones, np.float32).reshape(-1, 4, 4), -1, -2).astype(np.float64)
            numbers = parts.in_sight(clip, places)
            own_range = parts.range[numbers]
            for k, first, count in self._choose(parts, numbers, own_range):
                r = ranges[own_range[k]]
                yield self._meshes[id(mesh)], (first, count, r.kind, r.textures), bones, glow, lit

    def _seen_ranges(self, clip: Floats, seen_lit: SeenLit) -> Iterator[DrawCall]:
        """Ranges that look alike and have the same light are drawn at once."""
        parts, ranges = self._parts[id(self._static)], self._static.geometry.ranges
        numbers = parts.in_sight(clip)
        own_range = parts.range[numbers]
        lit = [seen_lit(self._draw_list.static_lit[i]) for i in own_range.tolist()]
        groups = {illumination: k for k, illumination in enumerate(dict.fromkeys(lit))}
        looks = self._looks[own_range] * len(groups) + np.array([groups[illumination] for illumination in lit], np.intp)
        for i, first, count in self._choose(parts, numbers, looks):
            r = ranges[own_range[i]]
            yield self._meshes[id(self._static)], (first, count, r.kind, r.textures), None, None, lit[i]

    def _choose(
        self, parts: Parts, numbers: NDArray[np.intp], keys: NDArray[np.intp]
    ) -> Iterator[tuple[int, int, int]]:
        """Draw these parts in the present view, those with the same key (at least 0) at once, in the order of the keys.

        For each key: which of `numbers` is the first one with it, the first of their indices, and how many.
        """
        order = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
        if len(starts):
            own, before = numbers[order], sum(map(len, self._chosen))
            self._chosen.append(parts.indices_of(own))
            count = np.add.reduceat(parts.length[own], starts)
            yield from zip(
                order[starts].tolist(), (before + np.cumsum(count) - count).tolist(), count.tolist(), strict=True
            )

    # -- programs ---------------------------------------------------------------------------------------------------

    def _new_sky(
        self, fragment: str, flags: tuple[str, ...], step: int
    ) -> tuple[moderngl.Program, moderngl.VertexArray]:
        program = self._linked("sky.vert", fragment, False, SHARPER=math.log2(step), **dict.fromkeys(flags, 1))
        return program, self._context.vertex_array(program, [])

    def _new_plain(self, name: str, is_day: bool) -> tuple[moderngl.Program, moderngl.VertexArray]:
        # the first row is at the top
        definitions = {"DOWN": "1.0", "TAPS": self.quality.taps} | ({"SUNLIT": 1} if is_day else {})
        program = self._linked(f"{name}.vert", f"{name}.frag", False, **definitions)
        if name != "beam_fog":
            return program, self._context.vertex_array(program, [])
        return program, self._context.vertex_array(program, [], self._context.buffer(grid(*BEAM_FOG_CELLS).tobytes()))

    def _new_ground_shadows(self) -> GroundShadows:
        program = self._linked("ground_shadow.vert", "ground_shadow.frag", TAPS=self.quality.taps)
        return GroundShadows(self._context, program)

    def _new_program(self, variant: ShaderVariant) -> moderngl.Program:
        is_quick = self.quality.detail == "reduced"
        flags = {
            "QUICK": is_quick,
            "FLAT": variant.kind in LEVEL,
            "GROUND": variant.kind == "ground",
            "FINE": variant.kind in LEVEL and variant.is_textured and not is_quick,
            "MATT": variant.kind == "matt" and is_quick,
            "TEXTURED": variant.is_textured,
            "SUNLIT": variant.is_day,
            "STILL": variant.is_shaded,
        }
        definitions = {name: 1 for name, is_set in flags.items() if is_set} | dict.fromkeys(variant.weather, 1)
        definitions |= {
            "VEHICLE": int(Label.VEHICLE),
            "CASTERS": variant.casters,
            "BEAMS": variant.beams,
            "LAMPS": variant.lamps,
        }
        definitions["TAPS"] = self.quality.taps
        texel = f"vec2({1.0 / self._shadows.beam.size[0]}, {1.0 / self._shadows.beam.size[1]})"
        return self._linked("scene.vert", "scene.frag", variant.is_jointed, BEAM_TEXEL=texel, **definitions)

    def _linked(self, vertex: str, fragment: str, is_jointed: bool = False, **definitions: object) -> moderngl.Program:
        joints = {"JOINTED": 1, "BONES": BONES} if is_jointed else {}
        definitions |= joints
        program = self._context.program(source(vertex, **definitions), source(fragment, **definitions))
        for name, binding in (("Frame", 0), ("Camera", 1)):
            block = program.get(name, None)
            if isinstance(block, moderngl.UniformBlock):
                block.binding = binding
        for name, unit in UNITS.items():
            if name in program:
                program[name] = unit
        return program


def grid(width: int, height: int) -> NDArray[np.uint32]:
    """Numbers of the vertices of two triangles for each cell, in rows of vertices; shape (6 * cells,)."""
    first = (np.arange(height)[:, None] * (width + 1) + np.arange(width)).reshape(-1, 1)
    return (first + np.array([0, 1, width + 2, 0, width + 2, width + 1])).astype(np.uint32).ravel()


def _is_starry(look: Daylight) -> bool:
    return look.zenith[1] < STARRY


def clip_from_optical(view: View) -> Floats:
    """Clip space from the optical frame (x right, y down, z forward); the first row of the image is at its bottom."""
    k = view.intrinsics
    shift = {"shift_x": 2.0 * k.cx / k.width - 1.0, "shift_y": 2.0 * k.cy / k.height - 1.0}
    return perspective(2.0 * k.fx / k.width, 2.0 * k.fy / k.height, view.near, view.far, **shift)
