"""The cameras of a run: a world that has them, and counts of their pictures for status line and summary."""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Any

from autodrive.camera_process import CameraProcess
from autodrive.render.gl import GlUnavailable, probe
from autodrive.render.quality import quality as checked_quality
from autodrive.world import World, make

if TYPE_CHECKING:
    from autodrive.compile import Compiled
    from autodrive.protocol.messages import CameraImage, Frame
    from autodrive.scenario import ScenarioSpec

log = logging.getLogger(__name__)

START = 30.0
"""The process that draws is there within that wall time [s], or the run begins without it."""


def watched_world(
    scenario: ScenarioSpec, *, quality: str, draws_in_tick: bool, is_wanted: bool = True
) -> tuple[World, CameraWatch | None]:
    """A world whose cameras see, and who watches them; nobody if it has no cameras.

    Pictures that are not wanted are drawn from `CameraWatch.want` on; those of the tick are always drawn.
    Where nothing can be drawn the world has no pictures, and one line of the log says why. Raises `AutodriveError` for
    a quality that is not known.
    """
    checked_quality(quality, "")
    if draws_in_tick:
        try:
            world = make(scenario, cameras=quality)
        except GlUnavailable as error:
            log.warning("%s", error)
            return make(scenario), CameraWatch(str(error))
        return world, CameraWatch()
    made: list[CameraProcess] = []

    def eyes(compiled: Compiled) -> CameraProcess:
        made.append(CameraProcess.of(compiled, quality, is_wanted=is_wanted))
        return made[0]

    world = make(scenario, cameras=eyes)
    return world, CameraWatch(process=made[0]) if made else None


class CameraWatch:
    """A sink: how many pictures each camera took, in the tick or, with a `process`, beside it.

    `fault` says why there are none; empty if there are.
    """

    def __init__(self, fault: str = "", process: CameraProcess | None = None) -> None:
        self._fault = fault
        self._process = process
        self._latest: dict[tuple[str, str], CameraImage] = {}
        self._counts: dict[str, dict[str, int]] = {}

    def want(self, is_wanted: bool) -> None:
        """Whether anybody looks at the pictures; any thread may say so."""
        if self._process is not None:
            self._process.is_wanted = is_wanted

    def wait(self) -> None:
        """Until pictures can be drawn, so that the first second has them too."""
        if self._process is not None:
            self._process.wait(START)

    def publish(self, frame: Frame) -> None:
        """Count the pictures that are new."""
        for name, vehicle in frame.vehicles.items():
            for camera, image in vehicle.cameras.items():
                if self._latest.get((name, camera)) is not image:
                    self._latest[name, camera] = image
                    counts = self._counts.setdefault(name, {})
                    counts[camera] = counts.get(camera, 0) + 1

    @property
    def fault(self) -> str:
        """Why there are no pictures; empty if there are."""
        return self._fault or (self._process.statistics.fault if self._process else "")

    def status(self) -> str:
        """For the status line."""
        if self.fault:
            return "cameras unavailable"
        if self._process is None:
            return f"{sum(n for counts in self._counts.values() for n in counts.values())} pictures"
        if not self._process.is_wanted:
            return "cameras rest"
        statistics = self._process.statistics
        drawn_in = "" if math.isnan(statistics.draw_time) else f" in {1e3 * statistics.draw_time:.0f} ms"
        return f"cameras {statistics.rate:.1f} Hz{drawn_in}"

    def summary(self, simulated_time: float) -> dict[str, Any]:
        """What was drawn, by whom, and how often a simulated second; `draw_time` [s] is that of all due at once."""
        draw_time = self._process.statistics.draw_time if self._process else math.nan
        return {
            "fault": self.fault or None,
            "drawn_in": "process" if self._process else "tick",
            "renderer": self._renderer() or None,
            "draw_time": None if math.isnan(draw_time) else draw_time,
            "pictures": {
                name: {
                    camera: {"count": count, "rate": count / simulated_time if simulated_time else 0.0}
                    for camera, count in counts.items()
                }
                for name, counts in self._counts.items()
            },
        }

    def _renderer(self) -> str:
        if self._process is not None:
            return self._process.statistics.renderer
        return "" if self._fault else probe()
