"""Records a World or a Simulation into a file."""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError
from autodrive.base.exact_fraction import exact_fraction
from autodrive.graphics.cameras.jpeg import JpegEncoder
from autodrive.protocol.drawing import drawings_now
from autodrive.protocol.messages import (
    CameraImage,
    Command,
    Draw,
    Frame,
    LoadScenario,
    Reset,
    SaveMap,
    SaveScenario,
    Step,
)
from autodrive.recording import records
from autodrive.recording.encoding import Encoding
from autodrive.recording.errors import RecordingError
from autodrive.recording.foxglove import NANOSECONDS
from autodrive.recording.outputs import FileOutput, Output, RingOutput
from autodrive.recording.records import CommandsRecord, RequestRecord, ScenarioRecord, StatusRecord
from autodrive.scenario.files import files_of
from autodrive.world import saved_world
from autodrive.world.observer import Request, ResetTo, Restored
from autodrive.world.simulation import Simulation
from autodrive.world.simulation.checks import check_world

if TYPE_CHECKING:
    from autodrive.world import World

log = logging.getLogger(__name__)

DRAIN_TIME = 0.1
"""The queue is emptied this often [s]."""
MAX_QUEUE = 2000
"""Frames that wait for the disk; then Frames are left out."""
MAX_WAITING_IMAGES = 8
"""Images that wait for the disk, of each camera; then images are left out."""
STATUS_PERIOD = NANOSECONDS
"""Time between two messages of the status [ns]."""


class Recorder:
    """Records a World or a Simulation into an MCAP file, from now until `close` or the end of a `with` block.

    For example::

        world = autodrive.make("mini_map")
        with Recorder("drive.mcap", world):
            for _ in range(100):
                world.step({"V1": Command(throttle=0.5)})

    `frame_rate` of Frames in simulated time [Hz]; None: each tick. `image_rate` of images of each camera; None: each
    image. `last`: keep only that many seconds in memory, and write them to a new file at each collision and `save`.
    `has_meshes`: whether the file contains the .glb files of the scene, and the URDF of the vehicles with its meshes.
    `name`: name or file of the scenario, or a function that returns it.

    Steps of a World, and of a Simulation that runs as fast as it can, wait for the recorder. A Simulation in real time
    never does: if disk or processor are too slow, images and then Frames are left out and counted. An error of the disk
    ends the recording, not the simulation; `error` says why.
    """

    def __init__(
        self,
        path: str | Path,
        source: World | Simulation,
        *,
        name: str | Callable[[], str] = "",
        frame_rate: float | None = None,
        image_rate: float | None = None,
        image_quality: int = 75,
        last: float | None = None,
        has_meshes: bool = True,
        encoder: JpegEncoder | None = None,
        status: Callable[[], str] = lambda: "closed",
    ) -> None:
        """Raises `RecordingError` if the file cannot be written or a package is not installed.

        `encoder`: shared with other receivers of the images. `status`: state of the connection to a devkit script.
        """
        check_world(source, "Recorder")
        self.path = Path(path)
        self.error = ""
        """Why the recording ended early; empty if it did not."""
        self.dropped_frames = 0
        """Frames that were left out."""
        self.dropped_images = 0
        """Images that were left out."""
        self.files: list[Path] = []
        """Files that were written."""
        self._name = name
        self._source = source
        self._simulation = source if isinstance(source, Simulation) else None
        self._clock = _RecordedTime(_period(frame_rate, "Frames"))
        image_period = round(_period(image_rate, "images"))
        self._status = status
        self._is_threaded = self._simulation is not None and self._simulation.speed is not None
        self._queue: deque[Callable[[], None]] = deque()
        self._latest_images: dict[tuple[str, str], CameraImage] = {}
        """Latest image of each camera, by vehicle and camera."""
        self._queued_images = self._written_images = 0
        self._are_images_dropped = False
        self._next_status = 0
        self._has_drawings = False
        self.output: Output
        if last is None:
            self.output = FileOutput(self.path)
            self.files.append(self.path)
        else:
            self.output = RingOutput(self.path, last, self.files)
        jpeg = encoder or JpegEncoder(quality=image_quality)
        self._encoding = Encoding(self.output, jpeg, image_quality, image_period, has_meshes)
        self._world: World | None = None
        self._is_closing = threading.Event()
        self._thread: threading.Thread | None = None
        has_begun = threading.Event()
        if isinstance(source, Simulation):
            source.between_ticks(lambda: self._begin(source, has_begun, is_whole=last is None))
        else:
            self._begin(source, has_begun, is_whole=last is None)
        if self._is_threaded:
            self._thread = threading.Thread(target=self._drain, name="autodrive-recorder", daemon=True)
            self._thread.start()
            while not (self.error or has_begun.wait(DRAIN_TIME)):
                pass  # a process that is ended from now on leaves a file with its scenario

    def _begin(self, source: World | Simulation, has_begun: threading.Event, *, is_whole: bool) -> None:
        """Record the present state, and all that happens from now on; called between two ticks.

        `is_whole`: the file contains all Frames from the first one on.
        """
        world = self.world
        if is_whole and world.frame.tick > 0 and (state := saved_world.saved(world)) is not None:
            self._add(lambda: self.output.attach(records.STATE, records.STATE_TYPE, state))
        self._publish(world, world.frame)
        if present := drawings_now(world.drawings, world.time):
            self.executed(present)
        self._add(self.output.flush)
        self._add(has_begun.set)
        if isinstance(source, Simulation):
            source.add_observer(self)
        else:
            source.observers.append(self)

    @property
    def world(self) -> World:
        """The World that is recorded."""
        return self._source.world if isinstance(self._source, Simulation) else self._source

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the recording; may be called again."""
        if self._is_closing.is_set():
            return
        if isinstance(self._source, Simulation):
            self._source.remove_observer(self)
        else:
            self._source.observers.remove(self)
        self._is_closing.set()
        if self._thread is not None:
            self._thread.join()
        else:
            self._empty_queue()
        with self._errors():
            self.output.close()

    def status(self) -> str:
        """The status in a few words, for a status line."""
        if self.error:
            return "not recording"
        lost = self.dropped_frames + self.dropped_images
        return f"recording {self._clock.now / NANOSECONDS:.1f} s" + (
            f", {lost} Frames and images left out" if lost else ""
        )

    def save(self) -> None:
        """Write the last seconds to a file, with `last`; events do that, too."""
        if isinstance(self.output, RingOutput):
            self._add(functools.partial(self.output.trigger, self._clock.now))

    # -- what happens, in the thread of the simulation ------------------------------------------------------------

    def given(self, commands: Mapping[str, Command]) -> None:
        """The next tick runs with these commands."""
        if commands:
            tick, now = self._clock.tick, self._clock.now
            record = CommandsRecord(tick, dict(commands))
            self._add(lambda: self._encoding.json(records.COMMANDS, record, now, tick))

    def executed(self, request: Request) -> None:
        """A request was executed."""
        if isinstance(request, Step | SaveScenario | SaveMap):
            return  # the commands of a Step come with its ticks; saving changes nothing
        tick, now = self._clock.tick, self._clock.now
        self._add(lambda: self._encoding.json(records.REQUESTS, RequestRecord(tick, request), now, tick))
        if isinstance(request, Draw):
            self._has_drawings = True
            self._add(lambda: self._encoding.drawings(request, now, tick))
        elif isinstance(request, Reset | ResetTo | LoadScenario) and self._has_drawings:
            self._has_drawings = False
            self._add(lambda: self._encoding.drawings(None, now, tick))
        if isinstance(request, Restored):
            self._clock.forget_tick()

    def publish(self, frame: Frame) -> None:
        """A new Frame."""
        self._publish(self.world, frame)

    def _publish(self, world: World, frame: Frame) -> None:
        is_new = world is not self._world
        if is_new:
            self._world = world
            self._clock.set_tick_duration(world.tick_duration)
        is_due = self._clock.advance(frame.tick) or is_new
        now = self._clock.now
        if is_new:
            scenario = self._scenario(world, frame)
            self._add(lambda: self._encoding.scenario(world, scenario, now))
        new = 0
        if self._is_threaded and is_due:
            if len(self._queue) > MAX_QUEUE:
                self.dropped_frames += 1
                is_due = False
            else:
                new = self._count_new_images(frame)
        if new:
            waiting = self._queued_images - self._written_images
            self._are_images_dropped = waiting >= MAX_WAITING_IMAGES * len(self._latest_images)
            if self._are_images_dropped:
                self.dropped_images += new
                new = 0
        self._queued_images += new
        if is_due or frame.events:
            has_new_images = not self._are_images_dropped
            self._add(lambda: self._encode(frame, now, is_due, has_new_images, new))
        self._add_status(frame, now)

    def _encode(self, frame: Frame, now: int, is_due: bool, has_new_images: bool, new: int) -> None:
        self._encoding.frame(frame, now, is_due=is_due, has_new_images=has_new_images)
        self._written_images += new

    def _count_new_images(self, frame: Frame) -> int:
        """Number of images in a Frame that were not in the Frame before it."""
        latest = {
            (name, camera): image
            for name, vehicle in frame.vehicles.items()
            for camera, image in vehicle.cameras.items()
        }
        before, self._latest_images = self._latest_images, latest
        return sum(before.get(key) is not image for key, image in latest.items())

    def _add_status(self, frame: Frame, now: int) -> None:
        if now < self._next_status or self._simulation is None:
            return
        self._next_status = now + STATUS_PERIOD
        record = StatusRecord(
            tick=frame.tick,
            real_time_factor=self._simulation.real_time_factor if self._is_threaded else 0.0,
            late_ticks=self._simulation.late_ticks if self._is_threaded else 0,
            dropped_frames=self.dropped_frames,
            dropped_images=self.dropped_images,
            bridge=self._status(),
        )
        self._add(lambda: self._encoding.json(records.STATUS, record, now, record.tick))

    def _scenario(self, world: World, frame: Frame) -> ScenarioRecord:
        try:
            files = files_of(world.specs)
        except Exception as error:
            files = {}
            log.warning("the recording does not contain the files of the scenario: %s", error)
        return ScenarioRecord(
            tick=frame.tick,
            name=self._name if isinstance(self._name, str) else self._name(),
            spec=world.spec.model_dump(mode="json") | {"seed": world.seed},
            files=files,
            is_start=frame.tick == 0,
            own_sensors={name: [*vehicle.own] for name, vehicle in frame.vehicles.items() if vehicle.own},
        )

    # -- the queue -------------------------------------------------------------------------------------------------

    def _add(self, write: Callable[[], None]) -> None:
        if self.error or self._is_closing.is_set():
            return
        self._queue.append(write)
        if not self._is_threaded:
            self._empty_queue()

    def _drain(self) -> None:
        self._empty_queue()
        while not self._is_closing.wait(DRAIN_TIME):
            self._empty_queue()
        self._empty_queue()

    def _empty_queue(self) -> None:
        with self._errors():
            while self._queue:
                self._queue.popleft()()
            self.output.flush_if_old()

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        """An error of the disk ends the recording and is reported once; the simulation goes on."""
        if self.error:
            self._queue.clear()
            return (yield)
        try:
            yield
        except OSError as error:
            self._fail(f"cannot write: {error.strerror or error}")
        except AutodriveError as error:
            self._fail(str(error))
        except Exception as error:
            log.exception("the recording failed")
            self._fail(str(error))

    def _fail(self, problem: str) -> None:
        self.error = f"the recording ended at {self._clock.now / NANOSECONDS:.2f} s: {problem}  ({self.path})"
        log.error("%s; the simulation goes on", self.error)
        self._queue.clear()
        with contextlib.suppress(OSError):
            self.output.abandon()


class _RecordedTime:
    """The time in the recording: the simulated time of all ticks, which a reset does not set back."""

    def __init__(self, period: Fraction) -> None:
        self._period = period
        self._time = Fraction(0)
        self._due = Fraction(0)
        self._tick: int | None = None

    def set_tick_duration(self, seconds: float) -> None:
        self._tick_duration = exact_fraction(seconds) * NANOSECONDS

    def forget_tick(self) -> None:
        """The next Frame continues at another tick."""
        self._tick = None

    def advance(self, tick: int) -> bool:
        """Go on to the Frame of that tick; whether it is to be recorded."""
        steps = 0 if self._tick is None else max(tick - self._tick, 0)
        is_jump = self._tick is None or steps == 0
        self._tick = tick
        self._time += steps * self._tick_duration
        if self._time < self._due and not is_jump:
            return False
        self._due = max(self._due + self._period, self._time) if self._period else self._time
        return True

    @property
    def tick(self) -> int:
        """Tick of the latest Frame."""
        return self._tick or 0

    @property
    def now(self) -> int:
        """[ns]."""
        return round(self._time)


def _period(rate: float | None, subject: str) -> Fraction:
    """Time between two recorded messages [ns]; 0: each is recorded."""
    if rate is None:
        return Fraction(0)
    if not 0.0 < rate < math.inf:
        raise RecordingError(f"the rate of {subject} must be a positive number [Hz], not {rate}")
    return NANOSECONDS / exact_fraction(rate)
