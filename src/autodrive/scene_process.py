"""Scene cameras drawn by the simulator, in a process of their own, for viewers of the page who cannot draw themselves.

Orders and answers are lines of JSON, pictures in them are JPEG; the process ends when its stdin does.
"""

from __future__ import annotations

import contextlib
import io
import logging
import pickle
import signal
import statistics
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import msgspec
import numpy as np
import simplejpeg

from autodrive.assets import scene_of
from autodrive.camera_link import Failed, Ready
from autodrive.camera_process import PATIENCE, PLAIN, SMOOTH, TRIAL
from autodrive.child import Process, become_child, spawn
from autodrive.errors import AutodriveError
from autodrive.render.moment import Moment
from autodrive.render.quality import PROFILES
from autodrive.render.renderer import Renderer
from autodrive.render.viewpoints import Viewpoint
from autodrive.scene_camera import SceneCamera, check_wish, picture_size

if TYPE_CHECKING:
    from autodrive.maps.map import Map
    from autodrive.maps.solids import BoxPlacement
    from autodrive.protocol.messages import Frame
    from autodrive.protocol.native import SetCamera
    from autodrive.vehicles.spec import VehicleSpec
    from autodrive.world import World

log = logging.getLogger(__name__)

JPEG_QUALITY = 80

PERIOD = 1.0 / 30.0
"""Where pictures take longer than that [s], `auto` draws them without smooth edges."""


class Things(NamedTuple):
    """What there is to draw of a world; it can be sent to another process."""

    map: Map
    vehicles: dict[str, VehicleSpec]
    boxes: list[BoxPlacement]
    quality: str


class Order(msgspec.Struct, array_like=True):
    """Draw that moment (the bytes of `Moment.data`) from there; `width` and `height` [pixels]."""

    moment: bytes
    viewpoint: Viewpoint
    width: int
    height: int


class Drawn(msgspec.Struct, tag=True):
    """The picture that was ordered."""

    jpeg: bytes


Answer: TypeAlias = Ready | Drawn | Failed

_read_answer = msgspec.json.Decoder(Answer).decode
_read_order = msgspec.json.Decoder(Order).decode


# -- in the simulator -------------------------------------------------------------------------------------------


class Wish(NamedTuple):
    """A picture that is waited for."""

    camera: SetCamera
    frame: Frame
    picture: Future[bytes]


class SceneProcess:
    """Draws the scene cameras of any number of viewers, one picture at a time, each viewer in turn.

    It begins with the first `draw`. If it dies, another one draws the picture that it was at; if that cannot begin, as
    without OpenGL, each `draw` fails and `fault` says why. Any thread may call all methods.
    """

    def __init__(self, things: Things) -> None:
        self._things = things
        self._cameras: dict[int, SceneCamera] = {}
        self._waiting: dict[int, Wish] = {}
        self._mail = threading.Condition()
        self._process: Process | None = None
        self._thread: threading.Thread | None = None
        self._is_closed = False
        self._fault = self._renderer = ""
        self._is_hopeless = False

    @classmethod
    def of(cls, world: World, quality: str = "auto") -> SceneProcess:
        """For that world; another world needs another one. `quality`: one of `render.quality.NAMES`."""
        return cls(Things(world.map, world.vehicle_specs, list(world.boxes.values()), quality))

    def check(self, wish: SetCamera) -> None:
        """Raises `AutodriveError` where that cannot be drawn, whatever the Frame."""
        check_wish(wish, list(self._things.vehicles))
        if self._is_hopeless:
            raise AutodriveError(self._fault)

    def draw(self, viewer: int, wish: SetCamera, frame: Frame) -> Future[bytes]:
        """The JPEG picture of that Frame, to come; `viewer`: any number that is that viewer's own.

        While a viewer's picture still waits for its turn, its wish and Frame are replaced, and the Future is the same.
        It fails with an `AutodriveError` where nothing can be drawn; the call itself never raises.
        """
        picture: Future[bytes] = Future()
        try:
            self.check(wish)
            self._check_frame(frame)
        except AutodriveError as error:
            picture.set_exception(error)
            return picture
        with self._mail:
            if self._is_closed:
                picture.set_exception(AutodriveError("scene cameras are no longer drawn for this world"))
                return picture
            before = self._waiting.get(viewer)
            if before is not None and not before.picture.cancelled():
                picture = before.picture
            self._waiting[viewer] = Wish(wish, frame, picture)
            if self._thread is None:
                self._thread = threading.Thread(target=self._attend, name="autodrive-scene", daemon=True)
                self._thread.start()
            self._mail.notify()
        return picture

    def forget(self, viewer: int) -> None:
        """That viewer is gone, or draws itself; its picture that waits fails."""
        with self._mail:
            self._cameras.pop(viewer, None)
            wish = self._waiting.pop(viewer, None)
        _fail(wish, "the viewer is gone")

    @property
    def fault(self) -> str:
        """Why there are no pictures; empty if there are, or if nobody wanted one yet."""
        return self._fault

    @property
    def renderer(self) -> str:
        """Name of what draws; empty before the first picture."""
        return self._renderer

    @property
    def pid(self) -> int:
        """Number of the process; 0 if there is none."""
        process = self._process
        return process.pid if process else 0

    def close(self) -> None:
        """End the process; pictures that wait, or are being drawn, fail."""
        with self._mail:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()  # it keeps nothing that could be lost
            self._mail.notify()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(PATIENCE)

    # -- in a thread of its own: one order, one answer ------------------------------------------------------------

    def _attend(self) -> None:
        while (turn := self._next()) is not None:
            viewer, wish = turn
            if not wish.picture.set_running_or_notify_cancel():
                continue
            try:
                wish.picture.set_result(self._drawn(viewer, wish))
            except Exception as error:
                self._end()
                if not isinstance(error, AutodriveError):
                    log.exception("a scene camera could not be drawn")
                    error = AutodriveError(f"the scene camera cannot be drawn: {error}")
                wish.picture.set_exception(error)
        self._end()
        with self._mail:
            left, self._waiting = list(self._waiting.values()), {}
        for wish in left:
            _fail(wish, "scene cameras are no longer drawn for this world")

    def _next(self) -> tuple[int, Wish] | None:
        """Who has waited longest, and for what; None: it is over."""
        with self._mail:
            self._mail.wait_for(lambda: self._waiting or self._is_closed)
            if self._is_closed:
                return None
            viewer = next(iter(self._waiting))
            return viewer, self._waiting.pop(viewer)

    def _drawn(self, viewer: int, wish: Wish) -> bytes:
        """Raises `AutodriveError` where the process has failed, and another one too."""
        self.check(wish.camera)
        with self._mail:
            camera = self._cameras.setdefault(viewer, SceneCamera(self._things.vehicles))
        viewpoint = camera.viewpoint(wish.camera, wish.frame, time.monotonic())
        moment = Moment.of(wish.frame).data.tobytes()
        order = Order(moment, viewpoint, *picture_size(wish.camera.width))
        if self._process is not None:
            try:
                return self._ordered(self._process, order)
            except AutodriveError:
                if self._is_closed:
                    raise
                self._end()
        return self._ordered(self._begin(), order)

    def _ordered(self, process: Process, order: Order) -> bytes:
        _send(process, _line(order))
        answer = self._answer(process)
        if not isinstance(answer, Drawn):
            raise AutodriveError("the scene camera cannot be drawn: its process answered something else")
        return answer.jpeg

    def _begin(self) -> Process:
        """A process that can draw."""
        with self._mail:
            if self._is_closed:
                raise AutodriveError("scene cameras are no longer drawn for this world")
            self._process = process = spawn("autodrive.scene_process")
        _send(process, pickle.dumps(self._things, pickle.HIGHEST_PROTOCOL))
        try:
            ready = self._answer(process)
        except AutodriveError:
            self._is_hopeless = True
            raise
        if isinstance(ready, Ready):
            self._renderer, self._fault = ready.renderer, ""
        return process

    def _answer(self, process: Process) -> Answer:
        """Raises `AutodriveError` where there is none."""
        assert process.stdout is not None
        text = process.stdout.readline()
        answer = _read_answer(text) if text.endswith(b"\n") else Failed(_how_it_ended(process))
        if isinstance(answer, Failed):
            if not self._is_closed:
                self._fault = answer.reason
                log.warning("%s", answer.reason)
            raise AutodriveError(answer.reason)
        return answer

    def _end(self) -> None:
        """Without a trace."""
        with self._mail:
            process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                if pipe is not None:
                    pipe.close()
        process.wait()

    def _check_frame(self, frame: Frame) -> None:
        if list(frame.vehicles) != list(self._things.vehicles) or len(frame.objects) != len(self._things.boxes):
            raise AutodriveError("the Frame is one of another world than the scene that is drawn")


def _fail(wish: Wish | None, reason: str) -> None:
    if wish is not None and wish.picture.set_running_or_notify_cancel():
        wish.picture.set_exception(AutodriveError(reason))


def _send(process: Process, data: bytes) -> None:
    """If it has just died, its missing answer will tell."""
    assert process.stdin is not None
    with contextlib.suppress(OSError):
        process.stdin.write(data)
        process.stdin.flush()


def _how_it_ended(process: Process) -> str:
    try:
        code = process.wait(PATIENCE)
    except Exception:  # it has closed its answers and lives on
        return "scene cameras are unavailable: their process answers no more"
    how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return f"scene cameras are unavailable: their process ended unexpectedly ({how})"


def _line(message: Order | Answer) -> bytes:
    return msgspec.json.encode(message) + b"\n"


# -- in the process ---------------------------------------------------------------------------------------------


def main() -> None:
    """Draw what is ordered until there are no more orders."""
    answers = io.BufferedWriter(become_child())  # pyright: ignore[reportArgumentType]  (a raw file, as it opens it)
    try:
        for answer in _work():
            answers.write(_line(answer))
            answers.flush()
    except BrokenPipeError:  # the simulator is gone
        pass
    except Exception as error:
        said = str(error) if isinstance(error, AutodriveError) else f"{type(error).__name__}: {error}"
        with contextlib.suppress(OSError):
            answers.write(_line(Failed(" ".join(f"scene cameras: {said}".split()))))
            answers.flush()


def _work() -> Iterator[Answer]:
    things: Things = pickle.load(sys.stdin.buffer)
    scene = scene_of(things)
    renderer = Renderer(scene, things.quality)
    times: deque[float] = deque(maxlen=TRIAL)
    try:
        yield Ready(renderer.name)
        for text in sys.stdin.buffer:
            order = _read_order(text)
            start = time.perf_counter()
            yield Drawn(_jpeg(renderer, order, len(scene.vehicles), len(scene.objects)))
            times.append(time.perf_counter() - start)
            if things.quality == "auto" and _is_too_slow(renderer, times):
                renderer.release()
                renderer = Renderer(scene, PLAIN)
    finally:
        renderer.release()


def _jpeg(renderer: Renderer, order: Order, vehicles: int, objects: int) -> bytes:
    moment = Moment.on(np.frombuffer(order.moment), vehicles, objects)
    [picture] = renderer.draw(moment, [order.viewpoint.view(order.width, order.height)])
    return simplejpeg.encode_jpeg(picture.rgba, quality=JPEG_QUALITY, colorspace="RGBX", colorsubsampling="420")


def _is_too_slow(renderer: Renderer, times: deque[float]) -> bool:
    """Whether smooth edges are what the machine cannot afford."""
    is_judged = len(times) == TRIAL and renderer.quality == PROFILES[SMOOTH]
    return is_judged and statistics.median(times) > PERIOD


if __name__ == "__main__":
    main()
