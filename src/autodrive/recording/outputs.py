"""Where a recorder writes: a file, or the last seconds in memory until there is an event."""

from __future__ import annotations

import contextlib
import logging
import time
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from autodrive.base.cache import growing_file, make_folder, new_file
from autodrive.base.errors import AutodriveError
from autodrive.base.version import __version__
from autodrive.recording import mcap, records
from autodrive.recording.errors import RecordingError
from autodrive.recording.foxglove import NANOSECONDS
from autodrive.recording.mcap import Chunk, McapChannel, McapMessage, Schema
from autodrive.recording.wire import WireMessage as Layout
from autodrive.recording.wire import descriptor

log = logging.getLogger(__name__)

START = mcap.header(f"autodrive {__version__}")
"""Header of each file."""
CHUNK_TIME = 0.7
"""A chunk is written this long after its first message [s of wall time]; less than 1 s is lost, with `DRAIN_TIME`."""
CHUNK_SIZE = 2**19
"""A chunk of this size is written at once [bytes]."""
AFTER_EVENT = 1.0
"""The last seconds before an event are written this long after it [s of recorded time]."""


class Stamp(NamedTuple):
    """When something happened: in the recording [ns], in simulated time [ns], and the tick."""

    now: int
    simulated: int
    tick: int


class Output:
    """Collects messages in chunks."""

    def __init__(self) -> None:
        self._chunk = Chunk()
        self._chunk_began = 0.0
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[str, McapChannel] = {}
        self._scenario: McapMessage | None = None
        """The latest message that a World begins."""

    def begin(self, about: Mapping[str, str]) -> None:
        """A World begins."""
        raise NotImplementedError

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file."""
        raise NotImplementedError

    def registered(self, schema: Schema | None, channel: McapChannel) -> None:
        """Called after a new channel was added, perhaps with a new schema."""

    def finished(self, chunk: Chunk) -> None:
        """A chunk is full."""
        raise NotImplementedError

    def trigger(self, now: int) -> None:
        """Called after an event of the ring mode."""

    def close(self) -> None:
        """Write what is left."""
        raise NotImplementedError

    def abandon(self) -> None:
        """Close the file after an error."""

    def add(self, topic: str, at: Stamp, data: bytes, layout: Layout | None = None, *, is_packed: bool = False) -> None:
        """Add a message: in JSON, or with that layout. `is_packed`: its data are compressed already."""
        channel = self._channels.get(topic) or self._register(topic, layout)
        if not self._chunk.data:
            self._chunk_began = time.monotonic()
        message = McapMessage(channel.id, at.tick & 0xFFFFFFFF, at.now, max(at.simulated, 0), data)
        self._chunk.add(message, is_packed=is_packed)
        if topic == records.SCENARIO:
            self._scenario = message

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

    def _register(self, topic: str, layout: Layout | None) -> McapChannel:
        name = records.schema_name(topic) if layout is None else layout.name
        schema = None
        if name not in self._schemas:
            encoding, data = (
                ("jsonschema", records.json_schema(topic)) if layout is None else ("protobuf", descriptor(layout))
            )
            schema = self._schemas[name] = Schema(len(self._schemas) + 1, name, encoding, data)
        channel = McapChannel(
            len(self._channels) + 1, self._schemas[name].id, topic, "json" if layout is None else "protobuf", {}
        )
        self._channels[topic] = channel
        self.registered(schema, channel)
        return channel


@contextlib.contextmanager
def _errors() -> Iterator[None]:
    try:
        yield
    except AutodriveError as error:
        raise RecordingError(str(error)) from None


class FileOutput(Output):
    """Writes chunks to a file at once."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        with _errors():
            self._file = growing_file(path, START)
        self._writer = mcap.Writer(self._file, len(START))
        self._attached: set[str] = set()
        self._is_begun = False
        self._is_open = True

    def begin(self, about: Mapping[str, str]) -> None:
        """Write what the recording is; the first World counts."""
        if not self._is_begun:
            self._is_begun = True
            self._writer.metadata(records.PROFILE, about)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Write a file, once."""
        if name not in self._attached:
            self._attached.add(name)
            self._writer.attachment(name, media_type, data)

    def registered(self, schema: Schema | None, channel: McapChannel) -> None:
        """Write them before their messages."""
        if schema is not None:
            self._writer.schema(schema)
        self._writer.channel(channel)

    def finished(self, chunk: Chunk) -> None:
        """Write it."""
        self._writer.chunk(chunk)

    def close(self) -> None:
        """Write the last chunk and the summary."""
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


class RingOutput(Output):
    """Keeps the chunks of the last seconds, and writes them to a new file when there is an event."""

    def __init__(self, path: Path, last: float, files: list[Path]) -> None:
        super().__init__()
        if not last > 0:
            raise RecordingError(f"the time to keep must be a positive number of seconds, not {last}")
        with _errors():
            make_folder(path.parent)
        self._path = path
        self._last = round(last * NANOSECONDS)
        self._files = files
        self._kept: deque[Chunk] = deque()
        self._attachments: dict[str, tuple[str, bytes]] = {}
        self._about: Mapping[str, str] = {}
        self._due: int | None = None

    def begin(self, about: Mapping[str, str]) -> None:
        """Keep what the recording is; the latest World counts."""
        self._about = about

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Keep a file."""
        self._attachments[name] = media_type, data

    def finished(self, chunk: Chunk) -> None:
        """Keep it, and forget those that are too old."""
        self._kept.append(chunk)
        while self._kept and self._kept[0].end < chunk.end - self._last:
            self._kept.popleft()

    def end_frame(self, now: int) -> None:
        """End a Frame; write the buffer if the second after an event has passed."""
        super().end_frame(now)
        if self._due is not None and now >= self._due:
            self._write()

    def trigger(self, now: int) -> None:
        """Write the last seconds a second after this."""
        if self._due is None:
            self._due = now + round(AFTER_EVENT * NANOSECONDS)

    def close(self) -> None:
        """Write the last seconds, if an event is waiting."""
        if self._due is not None:
            self._write()

    def _write(self) -> None:
        self._due = None
        self.flush()
        path = self._free_path()
        with new_file(path) as file:
            writer = mcap.Writer(file, file.write(START))
            writer.metadata(records.PROFILE, self._about)
            for schema in self._schemas.values():
                writer.schema(schema)
            for channel in self._channels.values():
                writer.channel(channel)
            for name, (media_type, data) in self._attachments.items():
                writer.attachment(name, media_type, data)
            if self._scenario is not None and self._kept:
                first = Chunk()
                first.add(self._scenario._replace(log_time=self._kept[0].start, publish_time=0))
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
