"""Records a World or a Simulation into a file."""

from __future__ import annotations

import contextlib
import functools
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from autodrive import __version__
from autodrive.graphics.cameras.jpeg import JpegEncoder
from autodrive.protocol.messages import (
    CameraImage,
    Collision,
    Command,
    Frame,
    Hold,
    LidarScan,
    OwnReading,
    Reset,
    Retire,
    SaveScenario,
    SetDrivingMode,
    SetSceneLight,
    SetTimeOfDay,
    Step,
)
from autodrive.recording import foxglove, mcap, records
from autodrive.recording.about import about_here
from autodrive.recording.errors import RecordingError
from autodrive.recording.foxglove import NANOSECONDS
from autodrive.recording.mcap import Channel, Chunk, Message, Schema
from autodrive.recording.records import (
    CommandsRecord,
    EventRecord,
    Poses,
    Request,
    RequestRecord,
    ResetTo,
    Restored,
    ScenarioRecord,
    SensorAdded,
    States,
    StatusRecord,
)
from autodrive.recording.scenario_files import files_of
from autodrive.recording.wire import Message as Layout
from autodrive.recording.wire import descriptor
from autodrive.world.simulation import Simulation

if TYPE_CHECKING:
    from autodrive.scenario.vehicles.spec import VehicleSpec
    from autodrive.world import World

log = logging.getLogger(__name__)

CHUNK_TIME = 0.7
"""A chunk is written this long after its first message [s of wall time]: with `DRAIN_TIME`, less than 1 s is lost."""
CHUNK_SIZE = 2**19
"""A chunk of this size is written at once [bytes]."""
DRAIN_TIME = 0.1
"""The queue is emptied this often [s]."""
MAX_QUEUE = 2000
"""Frames that wait for the disk; then Frames are left out."""
MAX_WAITING_IMAGES = 8
"""Images that wait for the disk, of each camera; then images are left out."""
TRANSFORM_PERIOD = NANOSECONDS // 10
"""Time between two messages of the poses for other programs [ns]."""
STATUS_PERIOD = NANOSECONDS
"""Time between two messages of the status [ns]."""
AFTER_EVENT = 1.0
"""The last seconds before an event are written this long after it [s of recorded time]."""


class Recorder:
    """Records a World or a Simulation into an MCAP file, from now until `close` or the end of a `with` block.

    ```python
    world = autodrive.make("mini_map")
    with Recorder("drive.mcap", world):
        for _ in range(100):
            world.step({"V1": Command(throttle=0.5)})
    ```

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
        self._clock = _RecordedTime(frame_rate)
        self._encoding = _Encoding(encoder or JpegEncoder(quality=image_quality), image_quality, image_rate, has_meshes)
        self._status = status
        self._is_threaded = self._simulation is not None and self._simulation.speed is not None
        self._queue: deque[Callable[[], None]] = deque()
        self._latest_images: dict[tuple[str, str], CameraImage] = {}
        """Of each camera, by vehicle and camera."""
        self._queued_images = self._written_images = 0
        self._are_images_dropped = False
        self._next_status = 0
        self._output: _Output
        if last is None:
            self._output = _FileOutput(self.path, self._encoding)
            self.files.append(self.path)
        else:
            self._output = _RingOutput(self.path, self._encoding, last, self.files)
        self._world: World | None = None
        self._taps = _WorldTaps(self)
        self._is_closing = threading.Event()
        self._thread: threading.Thread | None = None
        if self._is_threaded:
            self._thread = threading.Thread(target=self._drain, name="autodrive-recorder", daemon=True)
            self._thread.start()
        self._publish(self.world, self.world.frame)
        if isinstance(source, Simulation):
            source.add_observer(self)
        else:
            self._taps.attach(source)

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
        if self._simulation is not None:
            self._simulation.remove_observer(self)
        self._taps.detach()
        self._is_closing.set()
        if self._thread is not None:
            self._thread.join()
        else:
            self._empty_queue()
        with self._errors():
            self._output.close()

    def status(self) -> str:
        """In a few words, for a status line."""
        if self.error:
            return "not recording"
        lost = self.dropped_frames + self.dropped_images
        return f"recording {self._clock.now / NANOSECONDS:.1f} s" + (f", {lost} left out" if lost else "")

    def save(self) -> None:
        """With `last`: write the last seconds to a file; their events do that, too."""
        if isinstance(self._output, _RingOutput):
            self._add(functools.partial(self._output.trigger, self._clock.now))

    # -- what happens, in the thread of the simulation ------------------------------------------------------------

    def given(self, commands: Mapping[str, Command]) -> None:
        """The next tick runs with these commands."""
        if commands:
            tick, now = self._clock.tick, self._clock.now
            record = CommandsRecord(tick, dict(commands))
            self._add(lambda: self._encoding.json(self._output, records.COMMANDS, record, now, tick))

    def executed(self, request: Request) -> None:
        """A request was executed."""
        if isinstance(request, Step | SaveScenario):
            return  # the commands of a Step come with its ticks; a SaveScenario changes nothing
        tick, now = self._clock.tick, self._clock.now
        self._add(lambda: self._encoding.json(self._output, records.REQUESTS, RequestRecord(tick, request), now, tick))
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
            self._add(lambda: self._encoding.scenario(self._output, world, scenario, now))
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
        self._encoding.frame(self._output, frame, now, is_due=is_due, has_new_images=has_new_images)
        self._written_images += new

    def _count_new_images(self, frame: Frame) -> int:
        """How many images are not in the Frame before."""
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
        self._add(lambda: self._encoding.json(self._output, records.STATUS, record, now, record.tick))

    def _scenario(self, world: World, frame: Frame) -> ScenarioRecord:
        try:
            files = files_of(world.spec)
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
        while not self._is_closing.wait(DRAIN_TIME):
            self._empty_queue()
        self._empty_queue()

    def _empty_queue(self) -> None:
        with self._errors():
            while self._queue:
                self._queue.popleft()()
            self._output.flush_if_old()

    @contextlib.contextmanager
    def _errors(self) -> Any:
        """An error of the disk ends the recording and is reported once; the simulation goes on."""
        if self.error:
            self._queue.clear()
            return (yield)
        try:
            yield
        except OSError as error:
            self._fail(f"cannot write: {error.strerror or error}")
        except Exception as error:
            log.exception("the recording failed")
            self._fail(str(error))

    def _fail(self, problem: str) -> None:
        self.error = f"the recording ended at {self._clock.now / NANOSECONDS:.2f} s: {problem}  ({self.path})"
        log.error("%s; the simulation goes on", self.error)
        self._queue.clear()
        with contextlib.suppress(OSError):
            self._output.abandon()


class _RecordedTime:
    """The time in the recording: the simulated time of all ticks, which a reset does not set back."""

    def __init__(self, frame_rate: float | None) -> None:
        if frame_rate is not None and not frame_rate > 0:
            raise RecordingError(f"the rate of Frames must be a positive number [Hz], not {frame_rate}")
        self._period = Fraction(0) if frame_rate is None else NANOSECONDS / Fraction(frame_rate)
        self._time = Fraction(0)
        self._due = Fraction(0)
        self._tick: int | None = None

    def set_tick_duration(self, seconds: float) -> None:
        self._tick_duration = Fraction(str(seconds)) * NANOSECONDS

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


# -- encoding ------------------------------------------------------------------------------------------------------


class _Encoding:
    """Turns what happens into messages."""

    def __init__(self, jpeg: JpegEncoder, quality: int, image_rate: float | None, has_meshes: bool) -> None:
        if image_rate is not None and not image_rate > 0:
            raise RecordingError(f"the rate of images must be a positive number [Hz], not {image_rate}")
        self._jpeg, self._quality = jpeg, quality
        self._image_period = 0 if image_rate is None else round(NANOSECONDS / image_rate)
        self._has_meshes = has_meshes
        self._states = States()
        self._scans: dict[str, LidarScan] = {}
        self._own: dict[tuple[str, str], OwnReading] = {}
        self._own_message = Layout(OwnReading)
        self._images: dict[tuple[str, str], _WrittenImage] = {}
        self._next_transforms = 0
        self._mounts: dict[str, Any] = {}
        self.about: dict[str, str] = {}

    def json(self, output: _Output, topic: str, record: Any, now: int, tick: int) -> None:
        """Write a record."""
        output.add(topic, now, now, tick, records.encode_json(record))

    def scenario(self, output: _Output, world: World, record: ScenarioRecord, now: int) -> None:
        """Write the scenario of a World and its meshes."""
        self.about = {
            "format": str(records.FORMAT),
            **about_here(),
            "scenario": record.name,
            "seed": str(record.spec.get("seed", 0)),
            "tick": str(world.tick_duration),
            "image_quality": str(self._quality),
            "recorded_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "time": "nanoseconds of simulated time since the start of the recording; a reset does not set them back",
        }
        output.begin(self.about)
        self._scans.clear()
        self._own.clear()
        self._mounts = {name: spec.sensors.lidar for name, spec in world.vehicle_specs.items()}
        attachments: dict[str, str] = {}
        if self._has_meshes:
            for part, name, data in _meshes(world):
                attachments[part] = name
                output.attach(name, "model/gltf-binary", data)
            for vehicle, files in _descriptions(world):
                attachments[f"urdf/{vehicle}"] = next(iter(files))
                for name, data in files.items():
                    output.attach(name, "model/stl" if name.endswith(".stl") else "application/xml", data)
        self.json(
            output,
            records.SCENARIO,
            replace(record, attachments=attachments),
            now,
            record.tick,
        )

    def frame(
        self, output: _Output, frame: Frame, now: int, *, is_due: bool = True, has_new_images: bool = True
    ) -> None:
        """Write a Frame, with the scans and images that are new in it; only its events unless it is due."""
        simulated, tick = round(frame.time * NANOSECONDS), frame.tick & 0xFFFFFFFF
        for event in frame.events:
            output.add(records.EVENTS, now, simulated, tick, records.encode_json(EventRecord(frame.tick, event)))
            if isinstance(event, Collision):
                output.trigger(now)
        if not is_due:
            return
        for name, vehicle in frame.vehicles.items():
            scan = vehicle.lidar
            if scan is not None and scan is not self._scans.get(name):
                self._scans[name] = scan
                message = foxglove.laser_scan(scan, now, f"{name}/lidar")
                output.add(
                    records.scan_topic(name),
                    now,
                    simulated,
                    tick,
                    foxglove.LASER_SCAN.encode(message),
                    foxglove.LASER_SCAN,
                )
            for sensor, reading in vehicle.own.items():
                if reading is not self._own.get((name, sensor)):
                    self._own[name, sensor] = reading
                    topic, data = records.own_topic(name, sensor), self._own_message.encode(reading)
                    output.add(topic, now, simulated, tick, data, self._own_message)
            times: dict[str, float] = {}
            for camera, image in vehicle.cameras.items():
                written = self._image(output, name, camera, image, now, simulated, tick, is_wanted=has_new_images)
                if written is not None:
                    times[camera] = written
            data = self._states.encode_vehicle(vehicle, None if scan is None else scan.time, times)
            output.add(records.state_topic(name), now, simulated, tick, data, self._states.vehicle)
        if now >= self._next_transforms:
            self._next_transforms = now + TRANSFORM_PERIOD
            self._transforms(output, frame, now, simulated, tick)
        data = self._states.encode_frame(frame)
        output.add(records.FRAME, now, simulated, tick, data, self._states.frame)
        output.end_frame(now)

    def _image(
        self,
        output: _Output,
        vehicle: str,
        camera: str,
        image: Any,
        now: int,
        simulated: int,
        tick: int,
        *,
        is_wanted: bool,
    ) -> float | None:
        """Write an image if it is new and due; the time of the latest one that is written."""
        before = self._images.get((vehicle, camera))
        if before is not None and (before.image is image or now < before.due):
            return before.time
        if not is_wanted:
            return None if before is None else before.time
        due = now + self._image_period if before is None else max(before.due + self._image_period, now)
        self._images[vehicle, camera] = _WrittenImage(image, image.time, due)
        jpeg = self._jpeg.encode(vehicle, camera, image, size=image.rgba.shape[1::-1], quality=self._quality)
        frame_id = f"{vehicle}/{camera}_optical_frame"
        message = foxglove.compressed_image(image, jpeg, now, frame_id)
        if before is None:
            calibration = foxglove.calibration(image.intrinsics, now, frame_id)
            output.add(
                records.calibration_topic(vehicle, camera),
                now,
                simulated,
                tick,
                foxglove.CAMERA_CALIBRATION.encode(calibration),
                foxglove.CAMERA_CALIBRATION,
            )
        output.add(
            records.image_topic(vehicle, camera),
            now,
            simulated,
            tick,
            foxglove.COMPRESSED_IMAGE.encode(message),
            foxglove.COMPRESSED_IMAGE,
            is_packed=True,
        )
        return image.time

    def _transforms(self, output: _Output, frame: Frame, now: int, simulated: int, tick: int) -> None:
        """Poses for other programs: map from vehicles and objects, vehicle from LIDAR, map from cameras."""
        poses: list[tuple[str, str, Any]] = [("map", name, one.pose) for name, one in frame.vehicles.items()]
        poses += [("map", name, one.pose) for name, one in frame.objects.items()]
        for name, lidar in self._mounts.items():
            if lidar is not None and name in frame.vehicles:
                poses.append((name, f"{name}/lidar", lidar.mount))
        for name, vehicle in frame.vehicles.items():
            for camera, image in vehicle.cameras.items():
                poses.append(("map", f"{name}/{camera}_optical_frame", image.pose))
        data = foxglove.FRAME_TRANSFORMS.encode(foxglove.transforms_message(poses, now))
        output.add(records.TRANSFORMS, now, simulated, tick, data, foxglove.FRAME_TRANSFORMS)


class _WrittenImage:
    def __init__(self, image: Any, time: float, due: int) -> None:
        self.image, self.time, self.due = image, time, due


def _meshes(world: World) -> list[tuple[str, str, bytes]]:
    """Part of the scene, name and content of its .glb file."""
    from autodrive.graphics.meshes import store  # noqa: PLC0415  what builds meshes waits until one is needed

    return [
        ("map", *store.file("map", world.map)),
        *((f"vehicle/{name}", *store.file("vehicle", spec)) for name, spec in world.vehicle_specs.items()),
        *((f"object/{name}", *store.file("box", box.size)) for name, box in world.boxes.items()),
    ]


def _descriptions(world: World) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Each vehicle and the files of its robot description, which begin with the URDF; equal vehicles have the same."""
    from autodrive.graphics.meshes import store  # noqa: PLC0415  likewise

    known: dict[str, VehicleSpec] = {}
    for vehicle, spec in world.vehicle_specs.items():
        stem = Path(world.spec.vehicles[vehicle].type).stem
        names = (stem if number == 1 else f"{stem}_{number}" for number in count(1))
        name = next(name for name in names if known.setdefault(name, spec) == spec)
        yield vehicle, store.description(spec, name)


# -- outputs -------------------------------------------------------------------------------------------------------


class _Output:
    """Collects messages in chunks."""

    def __init__(self, encoding: _Encoding) -> None:
        self._encoding = encoding
        self._chunk = Chunk()
        self._chunk_began = 0.0
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[str, Channel] = {}

    def begin(self, about: Mapping[str, str]) -> None:
        """A World begins."""

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file."""
        raise NotImplementedError

    def registered(self, schema: Schema | None, channel: Channel) -> None:
        """There is a new channel, perhaps with a new schema."""
        raise NotImplementedError

    def finished(self, chunk: Chunk) -> None:
        """A chunk is full."""
        raise NotImplementedError

    def trigger(self, now: int) -> None:
        """There was an event of the ring mode."""

    def close(self) -> None:
        """Write what is left."""
        raise NotImplementedError

    def abandon(self) -> None:
        """Close the file after an error."""

    def add(
        self,
        topic: str,
        now: int,
        simulated: int,
        tick: int,
        data: bytes,
        layout: Layout | None = None,
        *,
        is_packed: bool = False,
    ) -> None:
        """Add a message: in JSON, or with that layout. `is_packed`: its data are compressed already."""
        channel = self._channels.get(topic) or self._register(topic, layout)
        if not self._chunk.data:
            self._chunk_began = time.monotonic()
        self._chunk.add(Message(channel.id, tick & 0xFFFFFFFF, now, max(simulated, 0), data), is_packed=is_packed)

    def end_frame(self, now: int) -> None:
        """A Frame is complete: a chunk may end here."""
        if len(self._chunk.data) >= CHUNK_SIZE:
            self.flush()
        else:
            self.flush_if_old()

    def flush_if_old(self) -> None:
        """End the chunk if it is old."""
        if self._chunk.data and time.monotonic() - self._chunk_began >= CHUNK_TIME:
            self.flush()

    def flush(self) -> None:
        """End the chunk."""
        if self._chunk.data:
            chunk, self._chunk = self._chunk, Chunk()
            self.finished(chunk)

    def _register(self, topic: str, layout: Layout | None) -> Channel:
        name = records.schema_name(topic) if layout is None else layout.name
        schema = None
        if name not in self._schemas:
            encoding, data = (
                ("jsonschema", records.json_schema(topic)) if layout is None else ("protobuf", descriptor(layout))
            )
            schema = self._schemas[name] = Schema(len(self._schemas) + 1, name, encoding, data)
        channel = Channel(
            len(self._channels) + 1, self._schemas[name].id, topic, "json" if layout is None else "protobuf", {}
        )
        self._channels[topic] = channel
        self.registered(schema, channel)
        return channel


class _FileOutput(_Output):
    """Writes chunks to a file at once."""

    def __init__(self, path: Path, encoding: _Encoding) -> None:
        super().__init__(encoding)
        try:
            self._file = path.open("wb")
            self._writer = mcap.Writer(self._file, f"autodrive {__version__}")
        except OSError as error:
            raise RecordingError(f"cannot write: {error.strerror or error}  ({path})") from None
        self._path = path
        self._attached: set[str] = set()
        self._is_begun = False
        self._is_open = True

    def begin(self, about: Mapping[str, str]) -> None:
        if not self._is_begun:
            self._is_begun = True
            self._writer.metadata(records.PROFILE, about)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        if name not in self._attached:
            self._attached.add(name)
            self._writer.attachment(name, media_type, data)

    def registered(self, schema: Schema | None, channel: Channel) -> None:
        if schema is not None:
            self._writer.schema(schema)
        self._writer.channel(channel)

    def finished(self, chunk: Chunk) -> None:
        self._writer.chunk(chunk)

    def close(self) -> None:
        if self._is_open:
            self._is_open = False
            with self._file:
                self.flush()
                self._writer.finish()

    def abandon(self) -> None:
        """Cut off what was not written whole."""
        self._is_open = False
        try:
            self._file.truncate(self._writer.size)
        finally:
            with contextlib.suppress(OSError):
                self._file.close()


class _RingOutput(_Output):
    """Keeps the chunks of the last seconds, and writes them to a new file when there is an event."""

    def __init__(self, path: Path, encoding: _Encoding, last: float, files: list[Path]) -> None:
        super().__init__(encoding)
        if not last > 0:
            raise RecordingError(f"the time to keep must be a positive number of seconds, not {last}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"cannot write: {error.strerror or error}  ({path})") from None
        self._path = path
        self._last = round(last * NANOSECONDS)
        self._files = files
        self._kept: deque[Chunk] = deque()
        self._attachments: dict[str, tuple[str, bytes]] = {}
        self._about: Mapping[str, str] = {}
        self._scenario: tuple[int, bytes] | None = None
        self._due: int | None = None

    def begin(self, about: Mapping[str, str]) -> None:
        self._about = about

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        self._attachments[name] = media_type, data

    def registered(self, schema: Schema | None, channel: Channel) -> None:
        pass  # they are written with each file

    def add(
        self,
        topic: str,
        now: int,
        simulated: int,
        tick: int,
        data: bytes,
        layout: Layout | None = None,
        *,
        is_packed: bool = False,
    ) -> None:
        super().add(topic, now, simulated, tick, data, layout, is_packed=is_packed)
        if topic == records.SCENARIO:
            self._scenario = tick, data

    def finished(self, chunk: Chunk) -> None:
        self._kept.append(chunk)
        while self._kept and self._kept[0].end < chunk.end - self._last:
            self._kept.popleft()

    def end_frame(self, now: int) -> None:
        super().end_frame(now)
        if self._due is not None and now >= self._due:
            self._write()

    def trigger(self, now: int) -> None:
        if self._due is None:
            self._due = now + round(AFTER_EVENT * NANOSECONDS)

    def close(self) -> None:
        if self._due is not None:
            self._write()

    def _write(self) -> None:
        self._due = None
        self.flush()
        path = self._free_path()
        with path.open("wb") as file:
            writer = mcap.Writer(file, f"autodrive {__version__}")
            writer.metadata(records.PROFILE, self._about)
            for schema in self._schemas.values():
                writer.schema(schema)
            for channel in self._channels.values():
                writer.channel(channel)
            for name, (media_type, data) in self._attachments.items():
                writer.attachment(name, media_type, data)
            if self._scenario is not None and self._kept:
                first = Chunk()
                tick, data = self._scenario
                first.add(Message(self._channels[records.SCENARIO].id, tick, self._kept[0].start, 0, data))
                writer.chunk(first)
            for chunk in self._kept:
                writer.chunk(chunk)
            writer.finish()
        self._files.append(path)
        log.info("wrote the last %g s to %s", self._last / NANOSECONDS, path)

    def _free_path(self) -> Path:
        """The path with a number that no file has."""
        number = 1
        while (path := self._path.with_stem(f"{self._path.stem}-{number:03}")).exists():
            number += 1
        return path


# -- a World without a Simulation ----------------------------------------------------------------------------------


class _WorldTaps:
    """Replaces methods of one World by methods that also tell the recorder; `detach` takes them back."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._world: World | None = None

    def attach(self, world: World) -> None:
        """Begin to listen."""
        self._world = world
        record = self._recorder
        step, reset = world.step, world.reset

        def recorded_step(commands: Mapping[str, Command] | None = None) -> Frame:
            if commands is not None:
                given = dict(commands) if isinstance(commands, Mapping) else commands
                frame = step(given)
                record.given(given)
            else:
                frame = step()
            record.publish(frame)
            return frame

        def recorded_reset(seed: int | None = None, *, poses: Any = None) -> Frame:
            frame = reset(seed, poses=poses)
            record.executed(
                Reset(seed)
                if not poses
                else ResetTo(seed, {name: tuple(map(float, one)) for name, one in poses.items()})
            )
            record.publish(frame)
            return frame

        replaced: dict[str, Any] = {"step": recorded_step, "reset": recorded_reset}
        for name, request in _REQUESTS.items():
            replaced[name] = self._told(getattr(world, name), request)
        for name, method in replaced.items():
            setattr(world, name, method)

    def _told(self, method: Callable[..., Any], request: Callable[..., Request | None]) -> Callable[..., Any]:
        @functools.wraps(method)
        def told(*args: Any, **kwargs: Any) -> Any:
            assert self._world is not None
            before = self._world.frame
            result = method(*args, **kwargs)
            made = request(*args, **kwargs)
            if made is not None:
                self._recorder.executed(made)
            if self._world.frame is not before:
                self._recorder.publish(self._world.frame)
            return result

        return told

    def detach(self) -> None:
        """Give the World its own methods back."""
        if self._world is not None:
            for name in ("step", "reset", *_REQUESTS):
                self._world.__dict__.pop(name, None)


def _poses(poses: Mapping[str, Any]) -> Request:
    return Poses({name: tuple(map(float, pose)) for name, pose in poses.items()})


def _hold(vehicle: str, position: Any, orientation: Any = (1.0, 0.0, 0.0, 0.0)) -> Request:
    x, y, z = (0.0, 0.0, 0.0) if position is None else map(float, position)
    qw, qx, qy, qz = map(float, orientation)
    return Hold(vehicle, None if position is None else (x, y, z), (qw, qx, qy, qz))


_REQUESTS: dict[str, Callable[..., Request | None]] = {
    "set_poses": _poses,
    "add_sensor": lambda vehicle, name, sensor: SensorAdded(vehicle, name),
    "set_driving_mode": lambda vehicle, is_autonomous: SetDrivingMode(vehicle, bool(is_autonomous)),
    "hold": _hold,
    "retire": lambda vehicle, reason="", *, is_disqualified=False: Retire(vehicle, reason, is_disqualified),
    "set_scene_light": lambda enabled: SetSceneLight(bool(enabled)),
    "set_time_of_day": lambda time_of_day, scale=0.0: SetTimeOfDay(time_of_day, scale),
    "restore": lambda *_: Restored(),
    "continue_from": lambda *_: Restored(),
    "look": lambda: None,
}
"""Methods of a World that change it between ticks -> the request that repeats the change."""
