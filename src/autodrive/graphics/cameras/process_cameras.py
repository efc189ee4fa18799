"""Renders cameras in a separate process, for real time: physics never waits for an image."""

from __future__ import annotations

import statistics
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any, NamedTuple

from autodrive.graphics.cameras.backend import with_images
from autodrive.graphics.cameras.render_process import RenderProcess
from autodrive.graphics.cameras.render_worker import CameraImages, RenderResult
from autodrive.graphics.cameras.rig import CameraRig
from autodrive.physics.sensors.sensor import Schedule
from autodrive.protocol.messages import CameraImage, Frame

RATE_WINDOW = 2.0
"""Wall time over which a rate is measured [s]."""


class CameraStatistics(NamedTuple):
    """State and speed of the process."""

    renderer: str
    """OpenGL renderer; empty before the process is ready."""
    rate: float
    """States drawn in a second of wall time, over the last `RATE_WINDOW` [Hz]."""
    draw_time: float
    """Median wall time for all images of one state [s]; NaN before the first."""
    error: str
    """Why there are no images; empty if there are."""


class ProcessCameras:
    """A camera backend whose images arrive later: each Frame has the latest finished images, each with its own time.

    A state is sent when an image is due and the previous state is finished, so the rate is what the machine can do.
    While the process starts, also again, and after it has failed for good, Frames have no images. While images are not
    wanted, Frames have none either; the process starts when they are first wanted.
    """

    def __init__(
        self, rig: CameraRig, *, is_wanted: bool = True, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        """`clock`: wall time [s], for statistics only."""
        self._rig = rig
        self._is_wanted = is_wanted
        self._clock = clock
        self._names = [(slot.vehicle, slot.camera) for slot in rig.slots]
        self._schedules = [
            None if slot.spec.rate is None else Schedule.of(slot.spec.rate, rig.substep) for slot in rig.slots
        ]
        self._lock = threading.RLock()
        self._images: dict[tuple[str, str], CameraImage] = {}
        self._shown = self._images
        self._sent_at: list[int | None] = [None] * len(rig.slots)
        self._noise = (0, 0)
        self._epoch = self._deaths = 0
        """Images of an earlier epoch are discarded when they arrive."""
        self._is_drawing = False
        self._arrivals: deque[float] = deque(maxlen=1000)
        self._draw_times: deque[float] = deque(maxlen=1000)
        self.process = RenderProcess(rig, "cameras")
        if is_wanted:
            self.process.start()

    @property
    def is_wanted(self) -> bool:
        """Whether images are used; nothing is drawn while they are not. May be set in any thread."""
        return self._is_wanted

    @is_wanted.setter
    def is_wanted(self, wanted: bool) -> None:
        with self._lock:
            if wanted == self._is_wanted:
                return
            self._is_wanted = wanted
            self._discard_images()  # they are outdated by now
        if wanted:
            self.process.start()

    @property
    def statistics(self) -> CameraStatistics:
        """State and speed of the process now."""
        with self._lock:
            now = self._clock()
            recent = sum(arrival > now - RATE_WINDOW for arrival in self._arrivals)
            draw_time = statistics.median(self._draw_times) if self._draw_times else float("nan")
            return CameraStatistics(self.process.renderer, recent / RATE_WINDOW, draw_time, self.process.error)

    # -- CameraBackend --------------------------------------------------------------------------------------------

    def update(self, frame: Frame, *, redraw: bool = False) -> Frame:
        """The Frame with the latest images; sends its state if an image is due and the process is free."""
        now = frame.tick * self._rig.substeps
        with self._lock:
            if self._deaths != self.process.deaths:
                self._deaths = self.process.deaths
                self._arrivals.clear()
                self._discard_images()
            if redraw:
                self._sent_at = [None] * len(self._names)
            if self._is_wanted and not self._is_drawing and self.process.is_ready:
                due = [n for n in range(len(self._names)) if self._is_due(n, now)]
                if due:
                    self._request(frame, now, due)
            self._shown = images = self._images
        return with_images(frame, images)

    def reset(self, seed: int) -> None:
        """Discard all images, also those being drawn; image noise restarts from `seed`."""
        with self._lock:
            self._noise = self._noise[0] + 1, seed
            self._discard_images()

    def save(self) -> Any:
        """Nothing: in real time, images depend on the machine."""
        return None

    def restore(self, saved: Any) -> None:
        """Discard all images, also those being drawn."""
        del saved
        with self._lock:
            self._discard_images()

    @property
    def has_pending_images(self) -> bool:
        """Whether an image is being drawn, has arrived since the last `update`, or is due to a `redraw`."""
        with self._lock:
            is_starting = not self.process.is_ready
            is_busy = is_starting or self._is_drawing or None in self._sent_at
            return (self._is_wanted and not self.process.error and is_busy) or self._shown is not self._images

    @property
    def is_thread_bound(self) -> bool:
        """False: drawing happens in another process."""
        return False

    def close(self) -> None:
        """End the process."""
        self.process.close()

    # -- requests and their images ----------------------------------------------------------------------------------

    def _is_due(self, number: int, now: int) -> bool:
        schedule, before = self._schedules[number], self._sent_at[number]
        return now != before if schedule is None else before is None or schedule.is_due(now, before)

    def _request(self, frame: Frame, now: int, due: list[int]) -> None:
        for number in due:
            self._sent_at[number] = now
        self._is_drawing = True
        drawn = self.process.draw(0, frame, CameraImages(frame.tick, due, self._noise))
        drawn.add_done_callback(partial(self._accept, self._epoch, due))

    def _discard_images(self) -> None:
        self._epoch += 1
        self._images = {}
        self._sent_at = [None] * len(self._names)

    def _accept(self, epoch: int, due: Sequence[int], future: Future[RenderResult]) -> None:
        """Called in the thread of the process."""
        with self._lock:
            self._is_drawing = False
            if future.exception() is not None:
                self._discard_images()
                return
            drawn = future.result()
            self._arrivals.append(self._clock())
            self._draw_times.append(drawn.seconds)
            if epoch == self._epoch:
                names = [self._names[number] for number in due]
                self._images = {**self._images, **dict(zip(names, drawn.answer, strict=True))}
