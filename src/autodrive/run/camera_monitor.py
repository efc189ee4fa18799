"""Cameras of a run: makes a world with camera rendering, counts its images for status line and summary."""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING

from autodrive.graphics.cameras.process_cameras import ProcessCameras
from autodrive.graphics.render.gl import GlUnavailable, probe
from autodrive.run.summary import CamerasSummary, ImageCount
from autodrive.world import World
from autodrive.world.factory import world_of
from autodrive.world.views.cameras import process_cameras

if TYPE_CHECKING:
    from autodrive.protocol.messages import CameraImage, Frame
    from autodrive.world.compile import CompiledScenario

log = logging.getLogger(__name__)

START_TIMEOUT = 30.0
"""Wall time to wait for the camera process [s]; after that the run starts without images."""


def world_with_cameras(
    compiled: CompiledScenario, *, quality: str, draws_in_tick: bool, is_wanted: bool = True
) -> tuple[World, CameraMonitor | None]:
    """A world that renders its cameras, and their monitor; the monitor is None if the world has no cameras.

    Images are rendered in the tick, or in a `ProcessCameras` that can be paused (`is_wanted`). If OpenGL is unavailable
    the world has no images, and one warning is logged.
    """
    if draws_in_tick:
        try:
            world = world_of(compiled, cameras=quality)
        except GlUnavailable as error:
            log.warning("%s", error)
            return world_of(compiled), CameraMonitor(str(error))
        return world, CameraMonitor()
    processes: list[ProcessCameras] = []

    def start_process(compiled: CompiledScenario) -> ProcessCameras:
        processes.append(process_cameras(compiled, quality, is_wanted=is_wanted))
        return processes[0]

    world = world_of(compiled, cameras=start_process)
    return world, CameraMonitor(process=processes[0]) if processes else None


class CameraMonitor:
    """Sink: counts the images of each camera. `process` is None if images are rendered in the tick.

    `error` says why there are no images; empty if there are.
    """

    def __init__(self, error: str = "", process: ProcessCameras | None = None) -> None:
        self._error = error
        self._process = process
        self._latest: dict[tuple[str, str], CameraImage] = {}
        self._counts: dict[str, dict[str, int]] = {}

    def set_wanted(self, is_wanted: bool) -> None:
        """Resume or pause rendering in the camera process; may be called from any thread."""
        if self._process is not None:
            self._process.is_wanted = is_wanted

    def wait(self) -> None:
        """Wait until the camera process is ready, so that images start with the first Frames."""
        if self._process is not None:
            self._process.process.wait(START_TIMEOUT)

    def publish(self, frame: Frame) -> None:
        """Count the new images of a Frame."""
        for name, vehicle in frame.vehicles.items():
            for camera, image in vehicle.cameras.items():
                if self._latest.get((name, camera)) is not image:
                    self._latest[name, camera] = image
                    counts = self._counts.setdefault(name, {})
                    counts[camera] = counts.get(camera, 0) + 1

    @property
    def error(self) -> str:
        """Why there are no images; empty if there are."""
        return self._error or (self._process.statistics.error if self._process else "")

    def status(self) -> str:
        """Text for the status line."""
        if self.error:
            return "cameras unavailable"
        if self._process is None:
            return f"{sum(n for counts in self._counts.values() for n in counts.values())} images"
        if not self._process.is_wanted:
            return "cameras idle"
        statistics = self._process.statistics
        draw_time = "" if math.isnan(statistics.draw_time) else f" in {1e3 * statistics.draw_time:.0f} ms"
        return f"cameras {statistics.rate:.1f} Hz{draw_time}"

    def summary(self, simulated_time: float) -> CamerasSummary:
        """Counts and rates over that simulated time [s]."""
        draw_time = self._process.statistics.draw_time if self._process else math.nan
        return CamerasSummary(
            error=self.error or None,
            drawn_in="process" if self._process else "tick",
            renderer=self._renderer() or None,
            draw_time=None if math.isnan(draw_time) else draw_time,
            images={
                name: {
                    camera: ImageCount(count, count / simulated_time if simulated_time else 0.0)
                    for camera, count in counts.items()
                }
                for name, counts in self._counts.items()
            },
        )

    def _renderer(self) -> str:
        if self._process is not None:
            return self._process.statistics.renderer
        return "" if self._error else probe()
