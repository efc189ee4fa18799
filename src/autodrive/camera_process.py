"""Eyes in a process of their own, for real time: physics never waits for a picture.

Moments go to the process, and pictures come from it, through memory that both share and that has no name, so that
nothing is left behind however the two end. Orders and answers are lines of JSON on its stdin and stdout; it ends when
its stdin does.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import signal
import statistics
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from autodrive.camera_link import Answer, Failed, Order, Ready, Shared, Shot, Taken, line, read_answer, read_order
from autodrive.cameras import Film, Sight, sight_of, with_images
from autodrive.child import Process, become_child, spawn
from autodrive.errors import AutodriveError
from autodrive.protocol.messages import CameraImage, Frame, Pose
from autodrive.render.moment import Moment
from autodrive.render.quality import PROFILES
from autodrive.render.renderer import Renderer
from autodrive.sensors.sensor import Schedule

if TYPE_CHECKING:
    from autodrive.compile import Compiled

log = logging.getLogger(__name__)

PATIENCE = 5.0
"""The process is ended by force if it does not end by itself within that wall time [s]."""

TRIAL = 20
"""After so many moments it is judged whether the machine is quick enough for smooth edges."""

SMOOTH, PLAIN = "software-fxaa", "software"
"""What `auto` begins with where the processor draws, and what it goes over to on a slow machine."""

LOOK_BACK = 2.0
"""Wall time over which a rate is told [s]."""


# -- in the simulator -------------------------------------------------------------------------------------------


class CameraStatistics(NamedTuple):
    """How the drawing goes."""

    renderer: str
    """Empty before the process is ready."""
    rate: float
    """Moments drawn in a second of wall time, during the last two [Hz]."""
    draw_time: float
    """Median wall time for all pictures of a moment [s]; NaN before the first."""
    fault: str
    """Why there are no pictures; empty if there are."""


class CameraProcess:
    """Eyes that look when they are free: each Frame has the latest finished pictures, with their own time and pose.

    A moment is sent when a picture is due and the one before is finished, so that the rate is what the machine can do.
    Where nothing can be drawn, or the process dies, one line of the log says so and Frames have no pictures. They have
    none, too, while pictures are not wanted; the process begins when they are first wanted.
    """

    def __init__(self, sight: Sight, *, is_wanted: bool = True) -> None:
        self._sight = sight
        self._is_wanted = is_wanted
        self._names = [(seat.vehicle, seat.camera) for seat in sight.seats]
        self._schedules = [
            None if seat.spec.rate is None else Schedule.of(seat.spec.rate, sight.substep) for seat in sight.seats
        ]
        self._lock = threading.Lock()
        self._images: dict[tuple[str, str], CameraImage] = {}
        self._shown = self._images
        self._sent_at: list[int | None] = [None] * len(sight.seats)
        self._ordered: list[int] = []
        self._seed: int | None = None
        self._life, self._ordered_life = 0, 0
        self._is_ready = threading.Event()
        self._is_free = False
        self._is_closing = False
        self._renderer = self._fault = ""
        self._arrivals: deque[float] = deque(maxlen=1000)
        self._draw_times: deque[float] = deque(maxlen=1000)
        self._process: Process | None = None
        if is_wanted:
            self._begin()

    @classmethod
    def of(cls, compiled: Compiled, quality: str = "auto", *, is_wanted: bool = True) -> CameraProcess:
        """For the cameras of that world."""
        return cls(sight_of(compiled, quality), is_wanted=is_wanted)

    @property
    def is_wanted(self) -> bool:
        """Whether anybody looks at the pictures; while not, nothing is drawn. May be set in any thread."""
        return self._is_wanted

    @is_wanted.setter
    def is_wanted(self, wanted: bool) -> None:
        with self._lock:
            if wanted == self._is_wanted:
                return
            self._is_wanted = wanted
            self._forget()  # what was seen before is old by now
            if wanted and self._process is None and not self._is_closing:
                self._begin()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the process can draw, or has failed; whether it can. It cannot before it is wanted."""
        if self._process is not None:
            self._is_ready.wait(timeout)
        return bool(self._renderer) and not self._fault

    @property
    def pid(self) -> int:
        """Number of the process; 0 before it begins."""
        return self._process.pid if self._process else 0

    @property
    def statistics(self) -> CameraStatistics:
        """How it goes, at this moment."""
        with self._lock:
            now = time.perf_counter()
            recent = sum(arrival > now - LOOK_BACK for arrival in self._arrivals)
            draw_time = statistics.median(self._draw_times) if self._draw_times else float("nan")
            return CameraStatistics(self._renderer, recent / LOOK_BACK, draw_time, self._fault)

    # -- as Eyes ------------------------------------------------------------------------------------------------

    def see(self, frame: Frame, *, anew: bool = False) -> Frame:
        """The Frame with the latest pictures; sends its moment if a picture is due and the last one is finished."""
        now = frame.tick * self._sight.substeps
        with self._lock:
            if anew:
                self._sent_at = [None] * len(self._names)
            if self._is_free and self._is_wanted:
                due = [n for n in range(len(self._names)) if self._is_due(n, now)]
                if due:
                    self._send(frame, now, due)
            self._shown = images = self._images
        return with_images(frame, images)

    def reset(self, seed: int) -> None:
        """Forget every picture, and those under way; noise follows from `seed`."""
        with self._lock:
            self._seed = seed
            self._forget()

    def save(self) -> Any:
        """Nothing: what a real-time run sees depends on the machine."""
        return None

    def restore(self, saved: Any) -> None:
        """Forget every picture, and those under way."""
        del saved
        with self._lock:
            self._forget()

    @property
    def is_awaited(self) -> bool:
        """Whether a picture is under way or has come since, or one of what was moved by hand is still to be taken."""
        with self._lock:
            is_at_work = self._is_wanted and not self._fault and (not self._is_free or None in self._sent_at)
            return is_at_work or self._shown is not self._images

    @property
    def belongs_to_thread(self) -> bool:
        """It draws elsewhere."""
        return False

    def close(self) -> None:
        """End the process."""
        self._is_closing = True
        if self._process is None:
            return
        if not self._is_ready.is_set():
            self._process.kill()  # it may not even listen yet
        with contextlib.suppress(OSError, ValueError):
            self._stdin.close()
        if threading.current_thread() is not self._thread:
            self._thread.join(PATIENCE)
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    # -- orders -------------------------------------------------------------------------------------------------

    def _is_due(self, number: int, now: int) -> bool:
        schedule, before = self._schedules[number], self._sent_at[number]
        return now != before if schedule is None else before is None or schedule.is_due(now, before)

    def _send(self, frame: Frame, now: int, due: list[int]) -> None:
        self._shared.moment.data[:] = Moment.of(frame).data
        for number in due:
            self._sent_at[number] = now
        self._ordered, self._ordered_life, self._is_free = due, self._life, False
        order, self._seed = Order(frame.tick, due, self._seed), None
        with contextlib.suppress(OSError, ValueError):  # it has just died; whoever reads its answers will say so
            self._stdin.write(line(order))
            self._stdin.flush()

    def _forget(self) -> None:
        self._life += 1
        self._images = {}
        self._sent_at = [None] * len(self._names)

    # -- answers, in a thread of their own ----------------------------------------------------------------------

    def _begin(self) -> None:
        descriptor = Shared.descriptor(self._sight)
        try:
            self._shared = Shared(descriptor, self._sight)
            process = spawn("autodrive.camera_process", str(descriptor), descriptors=[descriptor])
        finally:
            os.close(descriptor)
        assert process.stdin is not None
        self._process, self._stdin = process, process.stdin
        self._thread = threading.Thread(target=self._attend, args=(process,), name="autodrive-cameras", daemon=True)
        self._thread.start()

    def _attend(self, process: Process) -> None:
        """Tell the process what to draw, then take its answers until it ends."""
        with contextlib.suppress(OSError, ValueError):  # it may be closed before it has begun
            pickle.dump(self._sight, self._stdin, pickle.HIGHEST_PROTOCOL)
            self._stdin.flush()
        for answer in _answers(process):
            match answer:
                case Ready(renderer=renderer):
                    self._renderer, self._is_free = renderer, True
                    self._is_ready.set()
                case Taken():
                    self._take(answer)
                case Failed(reason=reason):
                    self._fault = reason
        self._end(process)

    def _take(self, taken: Taken) -> None:
        images = [self._image(number, shot) for number, shot in zip(self._ordered, taken.shots, strict=True)]
        with self._lock:
            if self._ordered_life == self._life:
                names = [self._names[number] for number in self._ordered]
                self._images = {**self._images, **dict(zip(names, images, strict=True))}
            self._arrivals.append(time.perf_counter())
            self._draw_times.append(taken.seconds)
            self._is_free = True

    def _image(self, number: int, shot: Shot) -> CameraImage:
        pose = Pose(_kept(np.array(shot.position)), _kept(np.array(shot.orientation)))
        return CameraImage(shot.time, pose, shot.intrinsics, *map(_kept, self._shared.plates[number]))

    def _end(self, process: Process) -> None:
        """The process is gone, because it was asked to or because it failed."""
        with self._lock:
            self._is_free = False
            self._images = {}
            self._arrivals.clear()
        code = process.wait()
        if not self._is_closing:
            how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            self._fault = self._fault or f"cameras are unavailable: their process ended unexpectedly ({how})"
            log.warning("%s", self._fault)
        self._is_ready.set()


def _answers(process: Process) -> Iterator[Answer]:
    assert process.stdout is not None
    with process.stdout as stdout:
        for text in stdout:
            yield read_answer(text)


def _kept(array: Any) -> Any:
    """A copy that nobody can change."""
    if array is None:
        return None
    copied = array.copy()
    copied.setflags(write=False)
    return copied


# -- in the process ---------------------------------------------------------------------------------------------


def main() -> None:
    """Draw what is ordered until there are no more orders."""
    answers = become_child()
    try:
        for answer in _work():
            answers.write(line(answer))
    except BrokenPipeError:  # the simulator is gone
        pass
    except AutodriveError as error:
        answers.write(line(Failed(str(error))))
    except Exception as error:
        reason = " ".join(f"cameras are unavailable: {type(error).__name__}: {error}".split())
        answers.write(line(Failed(reason)))


def _work() -> Iterator[Answer]:
    sight: Sight = pickle.load(sys.stdin.buffer)
    shared, film = Shared(int(sys.argv[1]), sight), Film(sight)
    draw_times: deque[float] = deque(maxlen=TRIAL)
    renderer = Renderer(sight.scene, sight.quality)
    try:
        yield Ready(renderer.name)
        for text in sys.stdin.buffer:
            if _is_too_slow(sight, renderer, draw_times):
                renderer.release()
                renderer = Renderer(sight.scene, PLAIN)
            order = read_order(text)
            if order.seed is not None:
                film.reset(order.seed)
            start = time.perf_counter()
            images = film.take(renderer, shared.moment, order.tick, order.cameras)
            for number, image in zip(order.cameras, images, strict=True):
                for plate, array in zip(shared.plates[number], (image.rgba, image.depth, image.labels), strict=True):
                    if plate is not None:
                        plate[:] = array
            draw_times.append(time.perf_counter() - start)
            yield Taken([_shot(image) for image in images], draw_times[-1])
    finally:
        renderer.release()


def _is_too_slow(sight: Sight, renderer: Renderer, draw_times: Sequence[float]) -> bool:
    """Whether pictures that nobody asked to be smooth take longer than their cameras' period."""
    if sight.quality != "auto" or renderer.quality != PROFILES[SMOOTH] or len(draw_times) < TRIAL:
        return False
    rate = max((seat.spec.rate or 0.0 for seat in sight.seats), default=0.0)
    return rate == 0.0 or statistics.median(draw_times) > 1.0 / rate


def _shot(image: CameraImage) -> Shot:
    pose = image.pose
    return Shot(image.time, tuple(pose.position.tolist()), tuple(pose.orientation.tolist()), image.intrinsics)


if __name__ == "__main__":
    main()
