"""Makes a film of a recording: draws its Frames again, with a scene camera or a sensor camera of a vehicle."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from autodrive.base.cache import check_writable
from autodrive.base.errors import AutodriveError
from autodrive.base.suggest import suggest, suggesting
from autodrive.graphics.cameras.overlays import NONE, strokes_of_drawings
from autodrive.graphics.cameras.rig import CameraArray
from autodrive.graphics.cameras.scene_camera import CAMERAS, SceneCamera, check_view
from autodrive.graphics.render.look import is_day_at
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.strokes import Strokes
from autodrive.protocol.native import Drawn, SetCamera
from autodrive.recording.film.overlay import with_overlay
from autodrive.recording.film.video import Video
from autodrive.world.compile import CompiledScenario
from autodrive.world.factory import compile_scenario
from autodrive.world.views.cameras import camera_rig

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame
    from autodrive.recording.replay.tape import Tape
    from autodrive.scenario import ScenarioSpec

MAX_IMAGES = 24 * 3600 * 60
"""Longest film: a day at 60 images per second."""


@suggesting
@dataclass(frozen=True)
class FilmOptions:
    """What a film shows, and how it is written."""

    camera: str = "Driver's Eye"
    """A scene camera, or a camera of a vehicle: 'front', 'V2/front'."""
    vehicle: str | None = None
    """The vehicle that the camera follows or is mounted on; None: the first one."""
    start: float = 0.0
    """Time of the recording [s]."""
    end: float | None = None
    """Time of the recording [s]; None: its end."""
    speed: float = 1.0
    """Recorded seconds per second of the film."""
    rate: float = 30.0
    """Images per second of the film [Hz]."""
    size: tuple[int, int] | None = None
    """Width and height [pixels]; None: 1280 x 720, or those of the sensor camera."""
    light: str | None = None
    """'day', 'night' or a time of day in hours, such as '18.5'; None: the recorded light."""
    overlay: bool = False
    """Whether speed and steering are shown."""
    codec: str | None = None
    """'av1' or 'vp9'; None: AV1 in .mp4 and .mkv, VP9 in .webm."""
    quality: str = "auto"
    """One of `autodrive.graphics.render.quality.NAMES`."""
    view: SetCamera = field(default_factory=lambda: SetCamera(None))
    """Height, orbit, position and zoom of a scene camera; its other fields are not used."""


def film(
    tape: Tape,
    output: str | Path,
    options: FilmOptions | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Write a film of a recording; returns the number of its images. Raises `AutodriveError`.

    `on_progress(done, total)` is called after each image.
    """
    options, path = options or FilmOptions(), Path(output)
    times = image_times(tape.duration, options)
    check_writable(path)
    shooting: _Shooting | None = None
    try:
        shooting = _Shooting(tape.scenario_at(times[0])[1], options)
        with Video(path, shooting.size, options.rate, options.codec) as video:
            for number, time in enumerate(times, 1):
                _, spec = tape.scenario_at(time)
                if spec is not shooting.spec:
                    shooting.release()
                    shooting = _Shooting(spec, options, shooting.size)
                video.write(shooting.image(tape.frame_at(time), tape.drawings_at(time), number / options.rate))
                on_progress(number, len(times))
            return video.images
    finally:
        if shooting is not None:
            shooting.release()


def image_times(duration: float, options: FilmOptions) -> NDArray[np.float64]:
    """Time of the recording that each image shows [s]. Raises `AutodriveError`."""
    end = duration if options.end is None else min(options.end, duration)
    if not (math.isfinite(options.start) and 0 <= options.start < end):
        raise AutodriveError(
            f"a film must begin before it ends, not from {options.start:g} s to {end:g} s; "
            f"the recording has {duration:.2f} s"
        )
    if not (0 < options.speed < math.inf and 0 < options.rate <= 240):
        raise AutodriveError("speed must be more than 0, and rate from 0 to 240 Hz")
    count = math.floor((end - options.start) * options.rate / options.speed + 1e-9) + 1
    if count > MAX_IMAGES:
        raise AutodriveError(f"a film of {count} images is too long; at most {MAX_IMAGES}")
    return options.start + np.arange(count, dtype=np.float64) * (options.speed / options.rate)


class _Shooting:
    """Draws the Frames of one scenario."""

    def __init__(self, spec: ScenarioSpec, options: FilmOptions, size: tuple[int, int] | None = None) -> None:
        self.spec = spec
        self._options = options
        self._compiled = compiled = compile_scenario(spec)
        self._rig = camera_rig(compiled, options.quality)
        self.vehicle, camera = _names(compiled, options)
        slots = [(slot.vehicle, slot.camera) for slot in self._rig.slots]
        self._slot = None if camera in CAMERAS else slots.index((self.vehicle, camera))
        self._cameras = CameraArray(self._rig)
        self._cameras.reset(spec.seed)
        self._scene_camera = SceneCamera(compiled.vehicles)
        self._view = msgspec.structs.replace(options.view, camera=camera, vehicle=self.vehicle)
        self.size = size or options.size or self._standard_size()
        if self._slot is None:
            check_view(self._view, list(compiled.vehicles))
        elif self.size != self._standard_size():
            raise AutodriveError(
                "a film of a sensor camera has the size of the images of the camera: leave out the size"
            )
        self._renderer = Renderer(self._rig.scene, options.quality)

    def release(self) -> None:
        """Free all graphics memory."""
        self._renderer.release()

    def image(self, frame: Frame, drawings: Mapping[str, Drawn], now: float) -> NDArray[np.uint8]:
        """The image of a Frame, at time `now` of the film [s], with what programs have drawn."""
        state = RenderState.of(frame)
        _set_light(state, self._options.light)
        if self._slot is None:
            viewpoint = self._scene_camera.viewpoint(self._view, frame, now)
            strokes = Strokes(strokes_of_drawings(drawings.values(), frame.time), NONE)
            rgba = self._renderer.draw(state, [viewpoint.view(*self.size)], strokes=strokes)[0].rgba
        else:
            rgba = self._cameras.capture(self._renderer, state, frame.tick, [self._slot])[0].rgba
        image = rgba[..., :3]
        if not self._options.overlay:
            return image
        vehicle, spec = frame.vehicles[self.vehicle], self._compiled.vehicles[self.vehicle]
        limit = spec.full_throttle_speed
        return with_overlay(
            image,
            speed=vehicle.speed,
            speed_limit=limit,
            steering=vehicle.steering,
            steering_limit=spec.steering.limit,
        )

    def _standard_size(self) -> tuple[int, int]:
        if self._slot is None:
            return 1280, 720
        spec = self._rig.slots[self._slot].spec
        return spec.width, spec.height


def _names(compiled: CompiledScenario, options: FilmOptions) -> tuple[str, str]:
    """The vehicle and the camera. Raises `AutodriveError`."""
    vehicle, _, camera = options.camera.rpartition("/")
    vehicle = vehicle or options.vehicle or next(iter(compiled.vehicles), "")
    if vehicle not in compiled.vehicles:
        raise AutodriveError(f"vehicle '{vehicle}' is not known. {suggest(vehicle, list(compiled.vehicles))}")
    known = [*CAMERAS, *compiled.cameras[vehicle]]
    if camera not in known:
        raise AutodriveError(f"camera '{camera}' is not known. {suggest(camera, known)}")
    return vehicle, camera


def _set_light(state: RenderState, light: str | None) -> None:
    """Replace the light of a state. Raises `AutodriveError`."""
    if light is None:
        return
    if light in {"day", "night"}:
        state.header["is_day"], state.header["time_of_day"] = light == "day", math.nan
        return
    try:
        hours = float(light)
    except ValueError:
        hours = math.nan
    if not 0 <= hours <= 24:
        raise AutodriveError(f"the light must be 'day', 'night' or a time of day in hours, such as 18.5, not '{light}'")
    time_of_day = 3600.0 * hours
    state.header["is_day"], state.header["time_of_day"] = is_day_at(time_of_day), time_of_day
