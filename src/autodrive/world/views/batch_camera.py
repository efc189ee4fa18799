"""Small images of one camera in many worlds of a scenario, drawn in one call: observations for learning."""

from __future__ import annotations

import weakref
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from autodrive.base.errors import AutodriveError, CommandError
from autodrive.base.suggest import suggest
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.batch_renderer import BatchRenderer
from autodrive.graphics.render.render_state import RenderState
from autodrive.physics.sensors.camera.camera import MAX_PIXELS, Camera, CameraSpec
from autodrive.physics.sensors.camera.imperfections import CameraImperfections
from autodrive.protocol.messages import CameraIntrinsics
from autodrive.world.compile import CompiledScenario
from autodrive.world.factory import compile_scenario

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.scenario import ScenarioSpec


class BatchCamera:
    """One camera of one vehicle in n worlds of a scenario: `render(batch.pictures())` returns n small images.

    The images are those of an ideal camera with the mount and the vertical field of view (or focal length and sensor)
    of that camera: without lens distortion, vignetting, exposure, motion blur, rolling shutter and noise. There is no
    depth, no label and no schedule.

    The same state gives the same bits, whichever worlds are drawn with it. The images equal those of an ideal camera in
    `autodrive.make(..., cameras=quality)` at the same size that is drawn alone, but for rounding: with the qualities
    'small' and 'software', a value differs by at most 1 of 255. One thread may use it at a time.
    """

    def __init__(
        self,
        scenario: ScenarioSpec | CompiledScenario,
        vehicle: str,
        camera: str,
        *,
        size: tuple[int, int] = (84, 84),
        quality: str = "small",
    ) -> None:
        """`size`: width and height [pixels]; `quality`: one of `autodrive.graphics.render.quality.NAMES`.

        Raises `AutodriveError` if there is no such camera, and `GlUnavailable` without OpenGL.
        """
        compiled = scenario if isinstance(scenario, CompiledScenario) else compile_scenario(scenario)
        spec = _ideal(compiled, vehicle, camera, size)
        self._camera = Camera(spec, vehicle=vehicle, name=camera, substep=Fraction(1))
        at_origin = RenderState.empty(1, 0).vehicles[0]
        at_origin["orientation"][0] = 1.0
        self._row = list(compiled.vehicles).index(vehicle)
        [view] = self._camera.views(at_origin, 0.0)
        self._renderer = BatchRenderer(scene_of(compiled), quality, vehicle=self._row, view=view)
        self._release = weakref.finalize(self, self._renderer.release)
        self._shape = len(compiled.vehicles), len(compiled.boxes)
        self.intrinsics: CameraIntrinsics = spec.intrinsics
        """Pinhole parameters in pixels."""

    def render(self, states: RenderState) -> NDArray[np.uint8]:
        """One image of each world, RGB, shape (n, height, width, 3).

        `states`: what is shown of n worlds of the scenario, from `BatchWorld.pictures`, or from Frames with
        `RenderState.of_all`. Raises `CommandError` for anything else.
        """
        shape = v, o = self._shape
        if not isinstance(states, RenderState):
            raise CommandError(f"render takes the pictures of worlds, batch.pictures(), not {type(states).__name__}")
        if states.header.ndim != 1 or (states.vehicles.shape[1], states.objects.shape[1]) != shape:
            raise CommandError(
                f"render takes the pictures of n worlds of this scenario, with {v} vehicles and {o} objects"
            )
        # a world whose physics has diverged must not disturb the others; no time of day is not a number either
        finite = RenderState.from_buffer(np.nan_to_num(states.data, posinf=0.0, neginf=0.0), v)
        finite.header[...] = states.header
        views = [self._camera.views(vehicle, 0.0)[0] for vehicle in finite.vehicles[:, self._row]]
        return self._renderer.draw_batch(finite, views)

    def close(self) -> None:
        """Free all graphics memory; `render` cannot be called any more."""
        self._release()


def _ideal(compiled: CompiledScenario, vehicle: str, camera: str, size: tuple[int, int]) -> CameraSpec:
    """The Spec of that camera without imperfections, for images of that size."""
    if vehicle not in compiled.vehicles:
        raise AutodriveError(
            f"vehicle '{vehicle}' is not in this scenario. {suggest(vehicle, list(compiled.vehicles))}"
        )
    cameras = compiled.vehicles[vehicle].cameras
    if camera not in cameras:
        raise AutodriveError(f"vehicle '{vehicle}' has no camera '{camera}'. {suggest(camera, list(cameras))}")
    width, height = size
    if min(size) < 1 or width * height > MAX_PIXELS:
        raise AutodriveError(f"images of {width} x {height} pixels are not possible: from 1 x 1 to {MAX_PIXELS} pixels")
    changes = {"width": width, "height": height, "imperfections": CameraImperfections()}
    return cameras[camera].model_copy(update=changes)
