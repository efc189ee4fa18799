"""A renderer that stops smoothing edges where that takes too long."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Sequence

from autodrive.graphics.render.quality import PROFILES, Quality
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import RenderScene

TRIAL = 20
"""Number of states whose drawing times decide."""

SMOOTH, PLAIN = "software-fxaa", "software"
"""The profile that 'auto' starts with in software, and the one that it changes to."""


class AdaptiveRenderer:
    """Draws a scene; with quality 'auto' it changes from `SMOOTH` to `PLAIN` if a state takes longer than `period`."""

    def __init__(self, scene: RenderScene, quality: str, period: float) -> None:
        """`period` [s]: time between two states to draw; 0: as short as possible."""
        self._scene, self._quality, self._period = scene, quality, period
        self._draw_times: deque[float] = deque(maxlen=TRIAL)
        self.renderer = Renderer(scene, quality)

    def add_draw_time(self, seconds: float) -> None:
        """Call this after each state was drawn."""
        self._draw_times.append(seconds)
        if self._quality == "auto" and is_too_slow(self.renderer.quality, self._draw_times, self._period):
            self.renderer.release()
            self.renderer = Renderer(self._scene, PLAIN)

    def release(self) -> None:
        """Free all graphics memory."""
        self.renderer.release()


def is_too_slow(quality: Quality, draw_times: Sequence[float], period: float) -> bool:
    """Whether edges are smoothed in software and `TRIAL` states took longer than the period [s], in the median."""
    is_judged = len(draw_times) >= TRIAL and quality == PROFILES[SMOOTH]
    return is_judged and statistics.median(draw_times) > period
