"""Renders cameras in a separate process, for real time: physics never waits for an image."""

from __future__ import annotations

import logging
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from autodrive.base.arrays import read_only_copy
from autodrive.graphics.cameras.backend import with_images
from autodrive.graphics.cameras.camera_worker import DrawCameras, Drawn, ImageHeader, WorkerMessage
from autodrive.graphics.cameras.image_buffers import SharedBuffers
from autodrive.graphics.cameras.rig import CameraRig
from autodrive.graphics.cameras.shared_memory import SharedMemory, allocate
from autodrive.graphics.cameras.worker import RESTARTS, SHUTDOWN_TIME, Failed, Ready, Worker
from autodrive.graphics.render.render_state import RenderState
from autodrive.physics.sensors.sensor import Schedule
from autodrive.protocol.messages import CameraImage, Frame, Pose

log = logging.getLogger(__name__)

RATE_WINDOW = 2.0
"""Wall time over which a rate is measured [s]."""


class CameraStatistics(NamedTuple):
    """State and speed of the worker."""

    renderer: str
    """OpenGL renderer; empty before the worker is ready."""
    rate: float
    """States drawn in a second of wall time, over the last `RATE_WINDOW` [Hz]."""
    draw_time: float
    """Median wall time for all images of one state [s]; NaN before the first."""
    error: str
    """Why there are no images; empty if there are."""


class CameraProcess:
    """A camera backend whose images arrive later: each Frame has the latest finished images, each with its own time.

    A state is sent when an image is due and the previous state is finished, so the rate is what the machine can do.
    A worker that dies, or is killed because it does not answer, is started again, `RESTARTS` times; until it draws,
    Frames have no images. If nothing can be drawn, or the last worker dies, one line is logged and Frames have no
    images from then on. While images are not wanted, Frames have none either; the worker starts when they are first
    wanted.
    """

    def __init__(
        self,
        rig: CameraRig,
        *,
        is_wanted: bool = True,
        clock: Callable[[], float] = time.perf_counter,
        allocate_memory: Callable[[int], SharedMemory] = allocate,
    ) -> None:
        """`clock`: wall time [s], for statistics only."""
        self._rig = rig
        self._is_wanted = is_wanted
        self._clock, self._allocate_memory = clock, allocate_memory
        self._names = [(slot.vehicle, slot.camera) for slot in rig.slots]
        self._schedules = [
            None if slot.spec.rate is None else Schedule.of(slot.spec.rate, rig.substep) for slot in rig.slots
        ]
        self._lock = threading.Lock()
        self._images: dict[tuple[str, str], CameraImage] = {}
        self._shown = self._images
        self._sent_at: list[int | None] = [None] * len(rig.slots)
        self._requested: list[int] = []
        self._seed = 0
        """Of the image noise."""
        self._is_seed_sent = False
        self._restarts = 0
        self._epoch, self._requested_epoch = 0, 0
        self._has_started = threading.Event()
        self._is_free = False
        self._is_closing = False
        self._renderer = self._error = ""
        self._arrivals: deque[float] = deque(maxlen=1000)
        self._draw_times: deque[float] = deque(maxlen=1000)
        self._worker: Worker[WorkerMessage] | None = None
        if is_wanted:
            self._start()

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
            if wanted and self._worker is None and not self._is_closing:
                self._start()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the worker can draw or has failed; whether it can. Returns at once if images were never wanted."""
        if self._worker is not None:
            self._has_started.wait(timeout)
        return bool(self._renderer) and not self._error

    @property
    def pid(self) -> int:
        """Process identifier of the worker; 0 before it starts."""
        return self._worker.pid if self._worker else 0

    @property
    def statistics(self) -> CameraStatistics:
        """State and speed of the worker now."""
        with self._lock:
            now = self._clock()
            recent = sum(arrival > now - RATE_WINDOW for arrival in self._arrivals)
            draw_time = statistics.median(self._draw_times) if self._draw_times else float("nan")
            return CameraStatistics(self._renderer, recent / RATE_WINDOW, draw_time, self._error)

    # -- CameraBackend --------------------------------------------------------------------------------------------

    def update(self, frame: Frame, *, redraw: bool = False) -> Frame:
        """The Frame with the latest images; sends its state if an image is due and the worker is free."""
        now = frame.tick * self._rig.substeps
        with self._lock:
            if redraw:
                self._sent_at = [None] * len(self._names)
            if self._is_free and self._is_wanted:
                due = [n for n in range(len(self._names)) if self._is_due(n, now)]
                if due:
                    self._request(frame, now, due)
            self._shown = images = self._images
        return with_images(frame, images)

    def reset(self, seed: int) -> None:
        """Discard all images, also those being drawn; image noise restarts from `seed`."""
        with self._lock:
            self._seed, self._is_seed_sent = seed, False
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
            is_busy = self._is_wanted and not self._error and (not self._is_free or None in self._sent_at)
            return is_busy or self._shown is not self._images

    @property
    def is_thread_bound(self) -> bool:
        """False: drawing happens in another process."""
        return False

    def close(self) -> None:
        """End the worker."""
        with self._lock:
            self._is_closing = True
            worker = self._worker
        if worker is None:
            return
        if not self._has_started.is_set():
            worker.kill()  # it may not read its requests yet
        worker.request_end()
        if threading.current_thread() is not self._thread:
            self._thread.join(SHUTDOWN_TIME)
        worker.close()

    # -- requests -------------------------------------------------------------------------------------------------

    def _is_due(self, number: int, now: int) -> bool:
        schedule, before = self._schedules[number], self._sent_at[number]
        return now != before if schedule is None else before is None or schedule.is_due(now, before)

    def _request(self, frame: Frame, now: int, due: list[int]) -> None:
        assert self._worker is not None
        self._buffers.state.data[:] = RenderState.of(frame).data
        for number in due:
            self._sent_at[number] = now
        self._requested, self._requested_epoch, self._is_free = due, self._epoch, False
        seed = None if self._is_seed_sent else self._seed
        self._is_seed_sent = True
        self._worker.send(DrawCameras(frame.tick, due, seed))

    def _discard_images(self) -> None:
        self._epoch += 1
        self._images = {}
        self._sent_at = [None] * len(self._names)

    # -- messages, in a thread of their own -------------------------------------------------------------------------

    def _start(self) -> None:
        """Start a worker. If the machine cannot, one line is logged."""
        try:
            self._start_worker()
        except OSError as error:
            self._error = f"cameras are unavailable: their process cannot be started: {error.strerror}"
            log.warning("%s", self._error)
            self._has_started.set()

    def _start_worker(self) -> None:
        shared = self._allocate_memory(SharedBuffers.size(self._rig))
        try:
            self._buffers = SharedBuffers(shared.memory, self._rig)
            worker: Worker[WorkerMessage] = Worker(
                "autodrive.graphics.cameras.camera_worker",
                shared.address,
                messages=WorkerMessage,
                descriptors=shared.descriptors,
            )
        except BaseException:
            shared.detach()
            raise
        self._worker = worker
        self._thread = threading.Thread(target=self._run, args=(worker, shared), name="autodrive-cameras", daemon=True)
        self._thread.start()

    def _run(self, worker: Worker[WorkerMessage], shared: SharedMemory) -> None:
        """Set the worker up, then receive its messages until it ends."""
        try:
            worker.send_setup(self._rig)
            message = worker.receive()
        finally:
            shared.detach()
        while message is not None:
            match message:
                case Ready(renderer=renderer):
                    self._renderer, self._is_free = renderer, True
                    self._has_started.set()
                case Drawn():
                    self._accept(message)
                case Failed(reason=reason):
                    self._error = reason
            message = worker.receive()
        self._end(worker)

    def _accept(self, drawn: Drawn) -> None:
        images = [self._image(number, header) for number, header in zip(self._requested, drawn.headers, strict=True)]
        with self._lock:
            if self._requested_epoch == self._epoch:
                names = [self._names[number] for number in self._requested]
                self._images = {**self._images, **dict(zip(names, images, strict=True))}
            self._arrivals.append(self._clock())
            self._draw_times.append(drawn.seconds)
            self._is_free = True

    def _image(self, number: int, header: ImageHeader) -> CameraImage:
        pose = Pose(read_only_copy(np.array(header.position)), read_only_copy(np.array(header.orientation)))
        buffer = self._buffers.images[number]
        pixels: Any = (None if array is None else read_only_copy(array) for array in buffer)
        return CameraImage(header.time, pose, header.intrinsics, *pixels)

    def _end(self, worker: Worker[WorkerMessage]) -> None:
        """The worker has ended: `close` was called, or it failed."""
        with self._lock:
            self._is_free = False
            self._discard_images()
            self._arrivals.clear()
        status = worker.exit_status()
        with self._lock:
            if self._is_closing:
                pass
            elif self._error:
                log.warning("%s", self._error)
            elif self._restarts < RESTARTS:
                self._restarts += 1
                self._has_started.clear()
                text = "the process of the cameras ended unexpectedly (%s); it is started again (%d of %d)"
                log.warning(text, status, self._restarts, RESTARTS)
                self._is_seed_sent = False
                worker.close()
                self._start()
                return
            else:
                times = f"{RESTARTS + 1} times, now with {status}"
                self._error = f"cameras are unavailable: their process ended unexpectedly {times}"
                log.warning("%s", self._error)
        self._has_started.set()
