"""Reads a recording: Frames by time, events, commands, pictures, signals."""

from __future__ import annotations

import bisect
import re
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import simplejpeg
import yaml
from numpy.typing import NDArray

from autodrive.base.arrays import read_only
from autodrive.base.errors import SpecError
from autodrive.base.specs import checked
from autodrive.base.suggest import ByName
from autodrive.protocol.messages import CameraImage, Event, Frame, Images, LidarScan, OwnReading, VehicleFrame
from autodrive.protocol.native import Picture
from autodrive.recording import mcap, records, tables
from autodrive.recording.errors import RecordingError
from autodrive.recording.foxglove import NANOSECONDS, CompressedImage, LaserScan, lidar_scan
from autodrive.recording.records import CommandsRecord, RequestRecord, ScenarioRecord, States, StatusRecord
from autodrive.recording.signals import Signals
from autodrive.recording.wire import WireMessage, pool_of
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.files import write_to

MAX_IN_VAIN = 2**29
"""Work of a search that finds nothing [bytes of chunks]."""
MAX_WORK, WORK_PER_BYTE = 2**30, 4
"""Work to read all events, or where scenarios are [bytes of chunks]: at most so much, and so much for each byte of the
file."""
MAX_SIZE, MESSAGE_WORK = 2**25, 2**9
"""Size of all messages of such a topic, and what a message counts besides its size [bytes]."""
MAX_PIXELS = 2**24
"""Most pixels of a picture that is decoded; no camera has more."""
MAX_BROKEN = 1000
"""Frames one after the other that cannot be read."""


class Moment(NamedTuple):
    """A Frame, and its time in the recording [s], which a reset does not set back."""

    time: float
    frame: Frame


class TimedEvent(NamedTuple):
    """An event, its tick, and its time in the recording [s]."""

    time: float
    tick: int
    event: Event


class Recording:
    """A recording; `autodrive.recording.open` makes it.

    All times are seconds since the start of the recording, counted in simulated time; a reset does not set them back.
    A damaged or truncated file gives what is whole; `problems` says what is not.
    """

    def __init__(self, path: Path) -> None:
        """Raises `RecordingError`."""
        self.path = path
        self._file = mcap.Reader(path)
        try:
            self._check()
        except BaseException:
            self._file.close()
            raise
        self._ids = {channel.topic: channel.id for channel in self._file.channels.values()}
        schemas = {
            schema.name: pool_of(schema.data) for schema in self._file.schemas.values() if schema.encoding == "protobuf"
        }
        self._states = States(schemas)
        self.scan_message = WireMessage(LaserScan, schemas=schemas)
        self._image = WireMessage(CompressedImage, schemas=schemas, max_size=mcap.MAX_CHUNK)
        self.own_message = WireMessage(OwnReading, schemas=schemas)
        self._frame_channel = self._ids.get(records.FRAME, -1)
        self._scenarios: dict[int, ScenarioRecord] = {}

    def _check(self) -> None:
        problems = f": {self._file.problems[0]}" if self._file.problems else ""
        about = self._file.metadata.get(records.PROFILE)
        if about is None:
            if not self._file.library.startswith("autodrive"):
                origin = f" (written by '{self._file.library}')" if self._file.library else ""
                raise RecordingError(f"this MCAP file is not a recording of AutoDRIVE{origin}{problems}  ({self.path})")
            raise RecordingError(f"the recording has no content{problems}  ({self.path})")
        self.about: Mapping[str, str] = about
        """Versions, platform, tick and settings of the recording, by name."""
        version, format_ = (about.get(name, "?")[:100] for name in ("version", "format"))
        if format_ not in map(str, range(1, records.FORMAT + 1)):
            raise RecordingError(
                f"the recording is of AutoDRIVE {version} in format {format_}; "
                f"this version reads formats up to {records.FORMAT}: install a newer version  ({self.path})"
            )

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Recording '{self.path}': {self.duration:g} s, vehicles {', '.join(self.vehicles)}>"

    # -- about -----------------------------------------------------------------------------------------------------

    @property
    def problems(self) -> list[str]:
        """What is missing or damaged; empty for a whole file. Grows while damaged parts are found."""
        return self._file.problems

    @property
    def version(self) -> str:
        """Version of AutoDRIVE that made it."""
        return self.about.get("version", "")

    @cached_property
    def start(self) -> float:
        """Time of the first Frame [s]: 0, but for the recording of the last seconds before an event."""
        return self._edge(0)[0] / NANOSECONDS

    @cached_property
    def end(self) -> float:
        """Time of the last Frame [s]."""
        return self._edge(-1)[0] / NANOSECONDS

    @property
    def duration(self) -> float:
        """Simulated time from the first Frame to the last one [s]."""
        return self.end - self.start

    @cached_property
    def start_tick(self) -> int:
        """Tick of the first Frame; 0 if the recording began with the run."""
        return self._edge(0)[1]

    @cached_property
    def end_tick(self) -> int:
        """Tick of the last Frame; a reset sets ticks back."""
        return self._edge(-1)[1]

    def _edge(self, end: int) -> tuple[int, int]:
        """Time [ns] and tick of the Frame with that number: 0, the first one, or -1, the last one."""
        chunks = range(len(self._file.chunks))
        for _, messages, places in self._search(self._frame_channel, chunks[:: 1 if end == 0 else -1]):
            message = messages[int(places[end])]
            return message.log_time, self._states.decode_frame(message.data)["tick"]
        self._no_frames()

    def _no_frames(self) -> NoReturn:
        problems = f": {'; '.join(self.problems)}" if self.problems else ""
        raise RecordingError(f"the recording has no Frames{problems}  ({self.path})")

    @property
    def scenarios(self) -> list[tuple[float, ScenarioRecord]]:
        """Time and scenario of each World: of the start, of other scenarios, and of edits that make a new World."""
        return [(time, self._scenario(number)) for number, (time, _, _) in enumerate(self._scenario_places)]

    def scenario_at(self, time: float) -> ScenarioRecord:
        """The scenario at that time [s], the same object while it is the same. Raises `RecordingError`."""
        times = [start for start, _, _ in self._scenario_places]
        if not times:
            raise RecordingError(f"the recording has no scenario  ({self.path})")
        return self._scenario(max(bisect.bisect_right(times, time) - 1, 0))

    @cached_property
    def _scenario_places(self) -> list[tuple[float, int, int]]:
        """Time [s], chunk and place in it of each scenario."""
        places = self._all_of(records.SCENARIO)
        return [(int(messages.log_times[i]) / NANOSECONDS, chunk, i) for chunk, messages, i in places]

    def _scenario(self, number: int) -> ScenarioRecord:
        if number not in self._scenarios:
            _, chunk, i = self._scenario_places[number]
            self._scenarios[number] = records.decode_json(records.SCENARIO, self._messages(chunk)[i].data)
        return self._scenarios[number]

    @property
    def scenario(self) -> ScenarioRecord:
        """The first scenario."""
        return self.scenario_at(-1.0)

    def scenario_of(self, vehicle: str) -> ScenarioRecord:
        """The first scenario that has that vehicle."""
        return next((record for _, record in self.scenarios if vehicle in record.spec["vehicles"]), self.scenario)

    @contextmanager
    def scenario_spec(self, record: ScenarioRecord | None = None) -> Iterator[ScenarioSpec]:
        """A scenario that can be run: its files are those of the recording, in a folder that exists in the block."""
        with tempfile.TemporaryDirectory(prefix="autodrive-") as folder:
            yield _written(record or self.scenario, Path(folder))

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles of the first Frame, then of those that came later, by another scenario or an edit."""
        return self._vehicles

    @cached_property
    def _vehicles(self) -> tuple[str, ...]:
        recorded = [topic.split("/")[1] for topic in self._ids if re.fullmatch(r"/\w+/state", topic)]
        return tuple(dict.fromkeys([*self.frame_at(self.start).vehicles, *recorded]))

    def cameras(self, vehicle: str) -> tuple[str, ...]:
        """Names of the cameras of a vehicle that have pictures."""
        start = records.image_topic(vehicle, "")
        names = (topic.removeprefix(start) for topic in self._ids if topic.startswith(start))
        return tuple(sorted(name for name in names if "/" not in name))

    def own_sensors(self, vehicle: str) -> dict[str, tuple[str, ...]]:
        """Names of the sensors of the user on a vehicle, and the columns of the first reading of each."""
        start = records.own_topic(vehicle, "")
        columns: dict[str, tuple[str, ...]] = {}
        for topic in sorted(topic for topic in self._ids if topic.startswith(start)):
            for _, message in islice(self._of_topic(topic), 1):
                columns[topic.removeprefix(start)] = self.own_message.struct(message.data).columns
        return columns

    @property
    def attachments(self) -> tuple[str, ...]:
        """Names of the files in the recording, such as meshes."""
        return tuple(attachment.name for attachment in self._file.attachments)

    def attachment(self, name: str) -> bytes:
        """Content of a file in the recording. Raises `RecordingError`."""
        return self._file.attachment(name)

    # -- Frames ----------------------------------------------------------------------------------------------------

    def frame_at(self, time: float) -> Frame:
        """The last Frame at that time [s] or before; the first one before the start. Raises `RecordingError`."""
        return self.moment_at(time).frame

    def moment_at(self, time: float) -> Moment:
        """The last Frame at that time [s] or before, with its time; the first one before the start.

        Raises `RecordingError`.
        """
        limit = _nanoseconds(time)
        for chunk, _, places in self._search(self._frame_channel, range(self._file.chunk_at(limit), -1, -1), limit):
            return self._moment(chunk, int(places[-1]))
        return next(self.moments(), None) or self._no_frames()

    def frames(self, start: float | None = None, end: float | None = None) -> Iterator[Frame]:
        """The Frames from a time to another [s], both included."""
        return (frame for _, frame in self.moments(start, end))

    def moments(self, start: float | None = None, end: float | None = None) -> Iterator[Moment]:
        """The Frames from a time to another [s], both included, each with its time."""
        first = -1 if start is None else _nanoseconds(start)
        last = None if end is None else _nanoseconds(end)
        broken = 0
        for chunk, messages, places in self._search(self._frame_channel, self._chunks(first, last)):
            for i in places.tolist():
                if messages.log_times[i] < first:
                    continue
                if last is not None and messages.log_times[i] > last:
                    break
                try:
                    moment = self._moment(chunk, i)
                except RecordingError as error:
                    self._file.report(str(error))
                    broken += 1
                    if broken > MAX_BROKEN:
                        raise
                else:
                    broken = 0
                    yield moment

    @cached_property
    def times(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Times of all Frames [s], shape (n,)."""
        return self._log_times(self._frame_channel)

    def _moment(self, chunk: int, i: int) -> Moment:
        messages = self._messages(chunk)
        message = messages[i]
        values = self._states.decode_frame(message.data)
        start = messages.last(self._frame_channel, i) + 1
        own = messages[start:i]
        event_channel = self._ids.get(records.EVENTS, -1)
        events = [
            records.decode_json(records.EVENTS, message.data).event
            for message in own
            if message.channel == event_channel
        ]
        topics = {message.channel: message.data for message in own}
        states: dict[str, bytes] = {}
        for name in values["vehicles"]:
            channel = self._ids.get(records.state_topic(name), -1)
            if channel in topics:
                states[name] = topics[channel]
            elif (place := messages.last(channel, start)) >= 0:
                states[name] = messages[place].data
        missing = [name for name in values["vehicles"] if name not in states]
        if missing:
            raise RecordingError(
                f"the state of {', '.join(missing[:5])} at {message.log_time / NANOSECONDS:g} s is missing"
            )
        values["vehicles"] = ByName({name: self._vehicle(name, states[name], chunk, i) for name in values["vehicles"]})
        values["events"] = tuple(events)
        return Moment(message.log_time / NANOSECONDS, Frame(**values))

    def _vehicle(self, name: str, data: bytes, chunk: int, i: int) -> VehicleFrame:
        values = self._states.decode_vehicle(data)
        values["lidar"] = self._lidar(name, values["lidar"], chunk, i)
        times: Mapping[str, float] = values["cameras"]
        values["cameras"] = LazyImages(times, lambda camera: self._picture(name, camera, chunk, i))
        values["own"] = self._own(name, values["own"], chunk, i)
        return VehicleFrame(**values)

    def _lidar(self, vehicle: str, time: float | None, chunk: int, i: int) -> LidarScan | None:
        if time is None:
            return None
        message = self._last(records.scan_topic(vehicle), chunk, i)
        scan = None if message is None else lidar_scan(self.scan_message.struct(message.data))
        return scan if scan is not None and scan.time == time else None

    def _own(self, vehicle: str, times: Mapping[str, float], chunk: int, i: int) -> dict[str, OwnReading]:
        """The latest reading of each sensor of the user; without those that were not recorded."""
        messages = {name: self._last(records.own_topic(vehicle, name), chunk, i) for name in times}
        readings = {
            name: self.own_message.struct(message.data) for name, message in messages.items() if message is not None
        }
        return {name: reading for name, reading in readings.items() if reading.time == times[name]}

    def _last(self, topic: str, chunk: int, i: int) -> mcap.McapMessage | None:
        """The last message of a topic before message i of a chunk."""
        channel = self._ids.get(topic, -1)
        messages = self._messages(chunk)
        if (place := messages.last(channel, i)) >= 0:
            return messages[place]
        for _, earlier, places in self._search(channel, range(chunk - 1, -1, -1)):
            return earlier[int(places[-1])]
        return None

    # -- pictures --------------------------------------------------------------------------------------------------

    def picture_at(self, vehicle: str, camera: str, time: float) -> Picture | None:
        """The last picture of a camera at that time [s] or before, as JPEG; None if there is none."""
        channel, limit = self._ids.get(records.image_topic(vehicle, camera), -1), _nanoseconds(time)
        for _, messages, places in self._search(channel, range(self._file.chunk_at(limit), -1, -1), limit):
            return self._decoded_picture(vehicle, camera, messages[int(places[-1])].data)
        return None

    def pictures(
        self, vehicle: str, camera: str, start: float | None = None, end: float | None = None
    ) -> Iterator[tuple[float, Picture]]:
        """Time [s] and picture, as JPEG, of each image of a camera from a time to another, both included."""
        topic = records.image_topic(vehicle, camera)
        if topic not in self._ids:
            known = ", ".join(self.cameras(vehicle)) or "none"
            raise RecordingError(f"the recording has no pictures of camera '{camera}' of '{vehicle}'. Known: {known}")
        for time, message in self._of_topic(topic):
            if (start is None or time >= start) and (end is None or time <= end):
                yield time, self._decoded_picture(vehicle, camera, message.data)

    def _picture(self, vehicle: str, camera: str, chunk: int, i: int) -> Picture | None:
        message = self._last(records.image_topic(vehicle, camera), chunk, i)
        return None if message is None else self._decoded_picture(vehicle, camera, message.data)

    def _decoded_picture(self, vehicle: str, camera: str, data: bytes) -> Picture:
        image: CompressedImage = self._image.struct(data)
        return Picture(vehicle, camera, image.time, image.pose, image.intrinsics, image.data)

    # -- events, commands, requests, status ------------------------------------------------------------------------

    @cached_property
    def events(self) -> list[TimedEvent]:
        """All events, in order."""
        messages = (
            (messages_of_chunk[i].log_time / NANOSECONDS, messages_of_chunk[i])
            for _, messages_of_chunk, i in self._all_of(records.EVENTS)
        )
        return [TimedEvent(time, record.tick, record.event) for time, record in self._decoded(records.EVENTS, messages)]

    @property
    def commands(self) -> Iterator[tuple[float, CommandsRecord]]:
        """Time [s] and commands of each tick in which the World was given any."""
        return self._records(records.COMMANDS)

    @property
    def requests(self) -> Iterator[tuple[float, RequestRecord]]:
        """Time [s] and each request that was executed."""
        return self._records(records.REQUESTS)

    @property
    def statuses(self) -> Iterator[tuple[float, StatusRecord]]:
        """Time [s] and status of the run, about once a second."""
        return self._records(records.STATUS)

    def next_event(self, time: float) -> TimedEvent | None:
        """The first event after that time [s]; None if there is none."""
        i = bisect.bisect_right([event.time for event in self.events], time)
        return self.events[i] if i < len(self.events) else None

    def sequence(self) -> Iterator[tuple[float, object]]:
        """Everything that a simulation needs to run again, in order: scenarios, requests, commands and Frames."""
        return self.records_of(records.SCENARIO, records.REQUESTS, records.COMMANDS, records.FRAME)

    def records_of(self, *topics: str) -> Iterator[tuple[float, object]]:
        """Time and record of all messages of these topics, in order; of `records.FRAME`, the Frames."""
        json = {self._ids[topic]: topic for topic in topics if topic in self._ids}
        has_frames = json.pop(self._frame_channel, "")
        for chunk in range(len(self._file.chunks)):
            for i, message in enumerate(self._messages(chunk)):
                if has_frames and message.channel == self._frame_channel:
                    yield message.log_time / NANOSECONDS, self._moment(chunk, i).frame
                elif message.channel in json:
                    yield message.log_time / NANOSECONDS, records.decode_json(json[message.channel], message.data)

    def _records(self, topic: str) -> Iterator[tuple[float, Any]]:
        return self._decoded(topic, self._of_topic(topic))

    def _decoded(self, topic: str, messages: Iterable[tuple[float, mcap.McapMessage]]) -> Iterator[tuple[float, Any]]:
        for time, message in messages:
            try:
                yield time, records.decode_json(topic, message.data)
            except RecordingError as error:
                self._file.report(str(error))

    def _all_of(self, topic: str) -> Iterator[tuple[int, mcap.ChunkMessages, int]]:
        """Chunk, its messages and the place of each message of a topic, without those beyond the limits of a recording.

        They are read when a recording is opened, so that the work must be bounded.
        """
        size, work = 0, self._file.work + MAX_WORK + WORK_PER_BYTE * self._file.size
        for chunk, messages, places in self._search(self._ids.get(topic, -1), self._chunks()):
            for i in places.tolist():
                size += MESSAGE_WORK + len(messages[i].data)
                if size > MAX_SIZE or self._file.work > work:
                    time = messages[i].log_time / NANOSECONDS
                    self._file.report(
                        f"the recording has too many messages of '{topic}': messages after {time:g} s are not read"
                    )
                    return
                yield chunk, messages, i

    def _of_topic(self, topic: str) -> Iterator[tuple[float, mcap.McapMessage]]:
        for _, messages, places in self._search(self._ids.get(topic, -1), self._chunks()):
            for i in places.tolist():
                message = messages[i]
                yield message.log_time / NANOSECONDS, message

    # -- signals ---------------------------------------------------------------------------------------------------

    @cached_property
    def signals(self) -> Signals:
        """Signals of the vehicles by name, such as 'V1/ips/position'."""
        return Signals(self, self._states)

    def __getitem__(self, name: str) -> Any:
        """A signal as an array, its first axis along `times`: `recording["V1/ips/position"]`."""
        return self.signals[name]

    def columns(self, vehicle: str) -> dict[str, np.ndarray[Any, Any]]:
        """Arrays of shape (n,) of a vehicle: 'time' [s], then each element of each signal, such as 'ips.position.x'."""
        return tables.columns(self.signals, vehicle)

    def table(self, vehicle: str, library: tables.Library = "pandas") -> Any:
        """The `columns` as a data frame of pandas or polars, if it is installed."""
        return tables.table(self.signals, vehicle, library)

    def messages_of(self, topic: str) -> list[bytes]:
        """The data of all messages of a topic, in order."""
        return [message.data for _, message in self._of_topic(topic)]

    def blocks(self, topics: Collection[str], start: float, end: float) -> Iterator[dict[str, list[mcap.McapMessage]]]:
        """Messages by topic, for each chunk of the file that has any from a time to another [s]."""
        first, last = _nanoseconds(start), _nanoseconds(end)
        names = {self._ids[topic]: topic for topic in topics if topic in self._ids}
        for chunk in self._chunks(first, last):
            if not any(self._may_have(channel, chunk) for channel in names):
                continue
            block: dict[str, list[mcap.McapMessage]] = {}
            messages = self._messages(chunk)
            for channel, topic in names.items():
                if len(places := messages.on(channel)):
                    block[topic] = [messages[i] for i in places.tolist()]
            yield block

    def log_times(self, topic: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The times of all messages of a topic [s], in order."""
        return self._log_times(self._ids.get(topic, -1))

    def _log_times(self, channel: int) -> np.ndarray[Any, np.dtype[np.float64]]:
        log_times = [np.empty(0, np.uint64)]
        log_times += [messages.log_times[places] for _, messages, places in self._search(channel, self._chunks())]
        return np.concatenate(log_times) / NANOSECONDS

    # -- chunks ----------------------------------------------------------------------------------------------------

    def _chunks(self, first: int = -1, last: int | None = None) -> Iterator[int]:
        """The chunks with messages from a time to another [ns]."""
        for chunk, index in enumerate(self._file.chunks):
            if last is not None and index.start > last:
                break
            if index.end >= first:
                yield chunk

    def _may_have(self, channel: int, chunk: int) -> bool:
        """Whether a chunk has messages of a channel by its index; that of the last chunk may be cut off."""
        return channel in self._file.chunks[chunk].channels or (chunk == len(self._file.chunks) - 1 and channel >= 0)

    def _search(
        self, channel: int, chunks: Iterable[int], until: int | None = None
    ) -> Iterator[tuple[int, mcap.ChunkMessages, NDArray[np.intp]]]:
        """The chunks with messages of a channel, up to a time [ns]: number, messages, places of those of the channel.

        Raises `RecordingError` if too many chunks are read for nothing.
        """
        in_vain = 0
        for chunk in chunks:
            if not self._may_have(channel, chunk):
                continue
            before = self._file.work
            messages = self._messages(chunk)
            places = messages.on(channel)
            if until is not None:
                places = places[messages.log_times[places] <= until]
            if len(places):
                in_vain = 0
                yield chunk, messages, places
            else:
                in_vain += self._file.work - before
                if in_vain > MAX_IN_VAIN:
                    raise RecordingError(f"the index names channels that the chunks do not have  ({self.path})")

    def _messages(self, chunk: int) -> mcap.ChunkMessages:
        """The messages of a chunk; none, and a problem, if it is damaged."""
        try:
            return self._file.messages(chunk)
        except RecordingError as error:
            self._file.report(str(error))
            return mcap.NO_MESSAGES


class LazyImages(Images):
    """The images of a Frame; each is decoded when it is read. `times` are the times of the images by camera [s]."""

    def __init__(self, times: Mapping[str, float], picture: Callable[[str], Picture | None]) -> None:
        super().__init__(dict.fromkeys(times))  # type: ignore[arg-type]
        self.times = dict(times)
        self._picture = picture

    def picture(self, camera: str) -> Picture | None:
        """The picture as it is in the recording; None if it is not there."""
        picture = self._picture(camera)
        return picture if picture is not None and picture.time == self.times[camera] else None

    def __getitem__(self, camera: str) -> CameraImage:
        image: CameraImage | None = super().__getitem__(camera)
        if image is None:
            picture = self.picture(camera)
            if picture is None:
                return self.__missing__(camera)
            image = decoded(picture)
            super().__setitem__(camera, image)
        return image

    def get(self, camera: str, default: Any = None) -> Any:  # type: ignore[override]
        """The image; `default` if there is none."""
        return self[camera] if camera in self and self.picture(camera) is not None else default

    def values(self) -> list[CameraImage]:  # type: ignore[override]
        """The images."""
        return [self[camera] for camera in self]

    def items(self) -> list[tuple[str, CameraImage]]:  # type: ignore[override]
        """Names and images."""
        return [(camera, self[camera]) for camera in self]


def decoded(picture: Picture) -> CameraImage:
    """The image of a picture. Raises `RecordingError`."""
    try:
        height, width, _, _ = simplejpeg.decode_jpeg_header(picture.jpeg)
        if int(height) * int(width) > MAX_PIXELS:
            raise RecordingError(
                f"a picture of camera '{picture.camera}' has {width} x {height} pixels; at most {MAX_PIXELS} are read"
            )
        rgba = simplejpeg.decode_jpeg(picture.jpeg, colorspace="RGBA")
    except ValueError as error:
        raise RecordingError(f"a picture of camera '{picture.camera}' is damaged: {error}") from None
    return CameraImage(picture.time, picture.pose, picture.intrinsics, read_only(rgba))


def _nanoseconds(time: float) -> int:
    return round(min(max(time, -1.0), 9e9) * NANOSECONDS)


def _written(record: ScenarioRecord, folder: Path) -> ScenarioSpec:
    """The scenario of a recording, with its files written to a folder. Raises `RecordingError`.

    Without the sensors of the user: a recording neither contains nor runs their code.
    """
    try:
        spec = write_to(folder, checked(dict(record.spec), ScenarioSpec), record.files)
        vehicles = {name: placement.model_copy(update={"own_sensors": {}}) for name, placement in spec.vehicles.items()}
        return spec.model_copy(update={"vehicles": vehicles})
    except KeyError as error:
        raise RecordingError(f"the recording does not contain the file {error} of its scenario") from None
    except SpecError as error:
        raise RecordingError(f"the scenario of the recording is not valid here: {error}") from None
    except ValueError as error:
        raise RecordingError(f"the recording contains {error}") from None
    except (OSError, yaml.YAMLError, AttributeError, TypeError) as error:
        raise RecordingError(f"the files of the recording's scenario cannot be written: {error}") from None
