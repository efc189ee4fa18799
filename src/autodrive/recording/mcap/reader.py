"""Reads files in the format MCAP, also damaged ones, with bounded memory and work."""

from __future__ import annotations

import bisect
import contextlib
import os
import struct
import threading
import zlib
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from autodrive.base.readable import readable
from autodrive.recording.errors import RecordingError
from autodrive.recording.lz4_frames import unpacked_lz4
from autodrive.recording.mcap.records import (
    CHANNEL_PLACE,
    CHUNK_INDEX_HEAD,
    MAGIC,
    RECORD_HEAD,
    AttachmentIndex,
    ChunkIndex,
    McapChannel,
    McapMessage,
    Opcode,
    Schema,
    zstd,
)

MAX_CHUNK = 2**26
"""Largest size of a chunk that is read [bytes]."""
MAX_MESSAGES = 2**18
"""Messages of a chunk that are read."""
MAX_DESCRIPTIONS = 2**22
"""Size of all schemas, channels, metadata and names of attachments of a file that is read [bytes]."""
MAX_METADATA = 64
"""Metadata records of a file that is read."""
MAX_PROBLEMS = 100
"""Problems of a file that are listed."""
LEAST_RECORDS, RECORD_SIZE = 2**19, 2**10
LEAST_CHUNKS, CHUNK_SIZE = 2**15, 2**11
LEAST_PLACES, PLACE_SIZE = 2**22, 2**8
"""A file that is read has at most so many records, chunks and channels of chunks, and one more for each so many bytes.

A chunk of a recording has half a megabyte or 0.7 s of wall time.
"""
CHUNK_WORK = 2**16
"""What it costs to read a chunk, besides its size [bytes]."""
CACHE_SIZE, CACHED_CHUNKS = 2**25, 8
"""Size [bytes] and number of the chunks that a reader keeps in memory."""

_HEAD = np.dtype(
    [
        ("kind", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish", "<u8"),
    ]
)
"""A message in a chunk, before its data."""


class Reader:
    """Reads an MCAP file by its summary; a file without a whole summary is read record by record as far as it goes.

    `problems` are texts that say what is missing or damaged. Whatever the file contains, memory and work are bounded: a
    file with more chunks, records or channels than a recording of that size can have is refused.
    """

    def __init__(self, path: Path) -> None:
        """Raises `RecordingError` if it cannot be read or is not an MCAP file."""
        self.path = path
        self.problems: list[str] = []
        self.work = 0
        """Bytes of chunks that were unpacked so far, with `CHUNK_WORK` for each chunk."""
        self._cache: OrderedDict[int, ChunkMessages] = OrderedDict()
        self._data = _McapFile(path)
        try:
            if self._data[0 : len(MAGIC)] != MAGIC:
                raise RecordingError(f"this is not an MCAP file  ({path})")
            self._read()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._data.close()

    @property
    def size(self) -> int:
        """[bytes]."""
        return len(self._data)

    def report(self, problem: str) -> None:
        """Add a problem, once."""
        if problem not in self.problems and len(self.problems) < MAX_PROBLEMS:
            self.problems.append(problem)

    def _read(self) -> None:
        self._begin()
        if not self._read_summary():
            self._begin()
            self._read_records(len(MAGIC), len(self._data), is_summary=False)
        self._end_chunk()
        self.chunks.sort(key=lambda chunk: chunk.offset)
        for chunk, following in pairwise(self.chunks):
            if chunk.offset + chunk.length > following.offset:
                raise RecordingError(
                    f"the chunks at bytes {chunk.offset} and {following.offset} overlap  ({self.path})"
                )

    def _begin(self) -> None:
        self.library = ""
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, McapChannel] = {}
        self.chunks: list[ChunkIndex] = []
        self.attachments: list[AttachmentIndex] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self._places: list[tuple[int, int]] = []
        """Channels of the last chunk, and the places of their indexes."""
        self._left = {
            "records": LEAST_RECORDS + self.size // RECORD_SIZE,
            "chunks": LEAST_CHUNKS + self.size // CHUNK_SIZE,
            "channels of chunks": LEAST_PLACES + self.size // PLACE_SIZE,
            "bytes of schemas, channels and metadata": MAX_DESCRIPTIONS,
            "metadata records": MAX_METADATA,
        }
        """Number of chunks, channels, bytes of descriptions and metadata records that may still be read."""

    def _count(self, plural: str, number: int = 1) -> None:
        """Raises `RecordingError` if there are too many."""
        self._left[plural] -= number
        if self._left[plural] < 0:
            raise RecordingError(f"the file has more {plural} than a recording of its size can have  ({self.path})")

    def _read_summary(self) -> bool:
        """Whether the file has a whole summary."""
        data, end = self._data, len(self._data)
        footer = end - len(MAGIC) - 29
        if footer < len(MAGIC) or data[end - len(MAGIC) : end] != MAGIC or data[footer : footer + 1] != b"\x02":
            self.report("the file has no summary: the recording did not end properly, or its end is missing")
            return False
        try:
            start, _, checksum = struct.unpack("<QQI", _Cursor(data, footer + 9, footer + 29).take(20))
            if not len(MAGIC) <= start <= footer or (checksum and data.checksum(start, footer + 25) != checksum):
                raise _CutOffError
        except _CutOffError:
            self.report("the summary at the end of the file is damaged")
            return False
        with contextlib.suppress(_CutOffError, UnicodeDecodeError):
            self._read_record(Opcode.HEADER, self._record(len(MAGIC), Opcode.HEADER), len(MAGIC))
        return self._read_records(start, footer, is_summary=True)

    def _read_records(self, at: int, end: int, *, is_summary: bool) -> bool:
        """Read the index of records, and of attachments and chunks that are in the data section."""
        while at + RECORD_HEAD.size <= end:
            head = self._data[at : at + RECORD_HEAD.size]
            if len(head) < RECORD_HEAD.size:
                break
            kind, length = RECORD_HEAD.unpack(head)
            start, at_next = at + 9, at + 9 + length
            if at_next > end or kind == 0:
                break
            self._count("records")
            try:
                self._read_record(kind, _Cursor(self._data, start, at_next), at)
            except (_CutOffError, UnicodeDecodeError):
                self.report(f"the record at byte {at} is damaged")
                if is_summary:
                    return False
            at = at_next
            if kind in {Opcode.DATA_END, Opcode.FOOTER} and not is_summary:
                return True
        if at < end and not is_summary:
            self.report(f"the file is cut off or damaged at byte {at} of {end}")
        return at >= end

    def _read_record(self, kind: int, cursor: _Cursor, offset: int) -> None:
        if kind in {
            Opcode.HEADER,
            Opcode.SCHEMA,
            Opcode.CHANNEL,
            Opcode.METADATA,
            Opcode.METADATA_INDEX,
            Opcode.ATTACHMENT_INDEX,
        }:
            self._count("bytes of schemas, channels and metadata", cursor.left)
        if kind == Opcode.HEADER:
            cursor.text()
            self.library = cursor.text()
        elif kind == Opcode.SCHEMA:
            id_ = cursor.number("<H")
            self.schemas.setdefault(id_, Schema(id_, cursor.text(), cursor.text(), cursor.block()))
        elif kind == Opcode.CHANNEL:
            id_, schema = cursor.number("<H"), cursor.number("<H")
            channel = McapChannel(id_, schema, cursor.text(), cursor.text(), cursor.texts())
            self.channels.setdefault(id_, channel)
        elif kind == Opcode.CHUNK:
            self._count("chunks")
            self._end_chunk()
            start, end = cursor.number("<Q"), cursor.number("<Q")
            self.chunks.append(ChunkIndex(start, end, offset, cursor.end - offset, NO_PLACES))
        elif kind == Opcode.MESSAGE_INDEX and self.chunks:
            self._places.append((cursor.number("<H"), offset))
        elif kind == Opcode.CHUNK_INDEX:
            self._count("chunks")
            start, end, place, length, size = CHUNK_INDEX_HEAD.unpack(cursor.take(CHUNK_INDEX_HEAD.size))
            self._count("channels of chunks", size // CHANNEL_PLACE.itemsize)
            places = cursor.take(size)
            if place + length > len(self._data) or size % CHANNEL_PLACE.itemsize:
                raise _CutOffError
            self.chunks.append(ChunkIndex(start, end, place, length, np.frombuffer(places, CHANNEL_PLACE)))
        elif kind == Opcode.ATTACHMENT:
            cursor.take(16)
            name, media_type = cursor.text(), cursor.text()
            self._count("bytes of schemas, channels and metadata", 16 + len(name) + len(media_type))
            self.attachments.append(AttachmentIndex(name, media_type, offset))
        elif kind == Opcode.ATTACHMENT_INDEX:
            place = cursor.number("<Q")
            cursor.take(32)
            self.attachments.append(AttachmentIndex(cursor.text(), cursor.text(), place))
        elif kind == Opcode.METADATA:
            self._count("metadata records")
            name = cursor.text()
            self.metadata[name] = cursor.texts()
        elif kind == Opcode.METADATA_INDEX:
            place = cursor.number("<Q")
            self._read_record(Opcode.METADATA, self._record(place, Opcode.METADATA), place)

    def _end_chunk(self) -> None:
        """Note the indexes of the last chunk, which are complete; used while a file without summary is read."""
        if self._places:
            self.chunks[-1] = self.chunks[-1]._replace(places=np.array(self._places, CHANNEL_PLACE))
            self._places = []

    def _record(self, offset: int, kind: int) -> _Cursor:
        """The content of the record at a place. Raises `_CutOffError` if it is not there, or of another kind."""
        cursor = _Cursor(self._data, offset, len(self._data))
        opcode, length = RECORD_HEAD.unpack(cursor.take(RECORD_HEAD.size))
        if opcode != kind:
            raise _CutOffError(": a record of another kind was expected")
        return _Cursor(self._data, cursor.at, cursor.at + length)

    # -- contents --------------------------------------------------------------------------------------------------

    def attachment(self, name: str) -> bytes:
        """The content of an attachment. Raises `RecordingError`."""
        named = [attachment for attachment in self.attachments if attachment.name == name]
        if not named:
            raise RecordingError(f"the file has no attachment '{name}'  ({self.path})")
        try:
            cursor = self._record(named[0].offset, Opcode.ATTACHMENT)
            start = cursor.at
            cursor.take(16)
            cursor.text()
            cursor.text()
            data = cursor.take(cursor.number("<Q"))
            content = self._data[start : cursor.at]
            if (checksum := cursor.number("<I")) and zlib.crc32(content) != checksum:
                raise _CutOffError
        except (_CutOffError, UnicodeDecodeError):
            raise RecordingError(f"the attachment '{name}' is damaged  ({self.path})") from None
        return data

    def messages(self, chunk: int) -> ChunkMessages:
        """The messages of a chunk, in order. Raises `RecordingError` if it is damaged."""
        if chunk in self._cache:
            self._cache.move_to_end(chunk)
            return self._cache[chunk]
        index = self.chunks[chunk]
        self.work += CHUNK_WORK
        try:
            content = self._content(index)
            messages = self._indexed(index, content) or ChunkMessages(content, _places(content))
        except (_CutOffError, UnicodeDecodeError) as error:
            raise RecordingError(f"the chunk at byte {index.offset} is damaged{error}") from None
        self._cache[chunk] = messages
        while (
            len(self._cache) > CACHED_CHUNKS
            or sum(messages_of_chunk.size for messages_of_chunk in self._cache.values()) > CACHE_SIZE
        ):
            self._cache.popitem(last=False)
        return messages

    def _indexed(self, index: ChunkIndex, content: bytes) -> ChunkMessages | None:
        """The messages of a chunk by the indexes of its channels; None if these do not name all that is in it."""
        places = [np.empty(0, np.int64)]
        count = 0
        try:
            for offset in index.places["place"].tolist():
                cursor = self._record(offset, Opcode.MESSAGE_INDEX)
                cursor.take(2)
                size = cursor.number("<I")
                count += size // 16
                if count > MAX_MESSAGES:
                    return None
                places.append(np.frombuffer(cursor.take(size), "<i8").reshape(-1, 2)[:, 1])
        except (_CutOffError, ValueError):
            return None
        starts = np.sort(np.concatenate(places))
        if len(starts) == 0 or starts[0] != 0 or starts[-1] > len(content) - _HEAD.itemsize:
            return None
        messages = ChunkMessages(content, starts)
        return messages if messages.are_whole else None

    def chunk_at(self, time: int) -> int:
        """Number of the last chunk that starts at that time [ns] or before; -1 if there is none."""
        return bisect.bisect_right(self.chunks, time, key=lambda chunk_index: chunk_index.start) - 1

    def _content(self, index: ChunkIndex) -> bytes:
        if self._data.closed:
            raise RecordingError(f"the recording is closed; read images before you close the recording  ({self.path})")
        cursor = self._record(index.offset, Opcode.CHUNK)
        if cursor.end - index.offset != index.length:
            raise _CutOffError(": the length of the chunk differs from the length in the index")
        cursor.take(16)
        size, checksum = cursor.number("<Q"), cursor.number("<I")
        compression, length = cursor.text(), cursor.number("<Q")
        if max(size, length) > MAX_CHUNK:
            raise _CutOffError(f": the chunk has {max(size, length)} bytes; at most {MAX_CHUNK} are read")
        self.work += size
        content = _decompressed(compression, cursor.take(length), size)
        if len(content) != size or (checksum and zlib.crc32(content) != checksum):
            raise _CutOffError(": its checksum is wrong")
        return content


def _decompressed(compression: str, data: bytes, size: int) -> bytes:
    """The unpacked data, at most `size` bytes, whatever the data are."""
    if compression == "zstd":
        try:
            if zstd.get_frame_info(data).decompressed_size not in {None, size}:  # None: the data do not say
                raise _CutOffError(f": the content does not unpack to {size} bytes")
            return zstd.ZstdDecompressor().decompress(data, size) if size else b""
        except (zstd.ZstdError, MemoryError) as error:
            raise _CutOffError(f": {error}") from None
    if compression == "lz4":  # of bags of ROS 2
        return unpacked_lz4(data, size + 1)
    if compression:
        raise RecordingError(f"the compression '{compression}' of a chunk is not known; known: zstd, lz4")
    return data


class ChunkMessages(Sequence[McapMessage]):
    """The messages of a chunk, in order. Each is taken apart when it is read."""

    def __init__(self, content: bytes, places: NDArray[np.int64]) -> None:
        """`places`: where their records begin."""
        self._content = content
        everywhere = max(len(content) - _HEAD.itemsize + 1, 0)
        heads = np.ndarray(everywhere, _HEAD, content, strides=(1,))[places]
        self._kinds, self._places = heads["kind"], places
        self._ends = places + 9 + heads["length"].astype(np.int64)
        self._heads = heads
        self.channels: NDArray[np.uint16] = heads["channel"]
        """Shape (n,)."""
        self.log_times: NDArray[np.uint64] = heads["log_time"]
        """[ns], shape (n,)."""

    @property
    def size(self) -> int:
        """Size of the chunk [bytes]."""
        return len(self._content)

    @property
    def are_whole(self) -> bool:
        """Whether they are all that the chunk contains, one after the other."""
        follows = np.array_equal(self._places[1:], self._ends[:-1]) and self._ends[-1] == len(self._content)
        return follows and bool(
            np.all(self._kinds == Opcode.MESSAGE) and np.all(self._ends - self._places >= _HEAD.itemsize)
        )

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, i: int) -> McapMessage: ...
    @overload
    def __getitem__(self, i: slice) -> list[McapMessage]: ...
    def __getitem__(self, i: int | slice) -> McapMessage | list[McapMessage]:
        if isinstance(i, slice):
            return [self[number] for number in range(*i.indices(len(self)))]
        _, _, channel, sequence, log_time, publish_time = self._heads[i].item()
        data = self._content[int(self._places[i]) + _HEAD.itemsize : int(self._ends[i])]
        return McapMessage(channel, sequence, log_time, publish_time, data)

    def __iter__(self) -> Iterator[McapMessage]:
        places = zip(self._places.tolist(), self._ends.tolist(), strict=True)
        for (_, _, *head), (start, end) in zip(self._heads.tolist(), places, strict=True):
            channel, sequence, log_time, publish_time = head
            yield McapMessage(channel, sequence, log_time, publish_time, self._content[start + _HEAD.itemsize : end])

    def on(self, channel: int) -> NDArray[np.intp]:
        """Places in this sequence of the messages of a channel."""
        return np.flatnonzero(self.channels == channel)

    def last(self, channel: int, before: int | None = None) -> int:
        """Place of the last message of a channel before a place; -1 if there is none."""
        of_channel = np.flatnonzero(self.channels[:before] == channel)
        return int(of_channel[-1]) if len(of_channel) else -1


NO_PLACES = np.empty(0, CHANNEL_PLACE)
NO_MESSAGES = ChunkMessages(b"", np.empty(0, np.int64))
"""The messages of a damaged chunk: none."""


def _places(content: bytes) -> NDArray[np.int64]:
    """Where the messages of a chunk begin, found from record to record."""
    starts: list[int] = []
    at, size = 0, len(content)
    for _ in range(MAX_MESSAGES):
        if at == size:
            return np.array(starts, np.int64)
        if at + 9 > size:
            raise _CutOffError(": a record is cut off")
        kind, length = RECORD_HEAD.unpack_from(content, at)
        end = at + 9 + length
        if end > size or (kind == Opcode.MESSAGE and length < 22):
            raise _CutOffError(": a record is cut off")
        if kind == Opcode.MESSAGE:
            starts.append(at)
        at = end
    raise _CutOffError(f": the chunk has more than {MAX_MESSAGES} records")


class _CutOffError(Exception):
    """A record is shorter than its content."""


class _McapFile:
    """The bytes of a file. If another program cuts it off meanwhile, what is missing is not there.

    A memory map would end the process then.
    """

    def __init__(self, path: Path) -> None:
        """Raises `RecordingError`."""
        try:
            self._file = readable(path).open("rb")
        except OSError as error:
            raise RecordingError(f"cannot read: {error.strerror or error}  ({path})") from None
        self._lock = threading.Lock()
        self._size = os.fstat(self._file.fileno()).st_size
        self._path = path
        if not self._size:
            self.close()
            raise RecordingError(f"the file is empty  ({path})")

    @property
    def closed(self) -> bool:
        return self._file.closed

    def close(self) -> None:
        self._file.close()

    def __len__(self) -> int:
        """When it was opened [bytes]."""
        return self._size

    def __getitem__(self, part: slice[int, int, None]) -> bytes:
        """Raises `RecordingError`."""
        try:
            with self._lock:
                self._file.seek(part.start)
                return self._file.read(part.stop - part.start)
        except OSError as error:
            raise RecordingError(f"cannot read: {error.strerror or error}  ({self._path})") from None

    def checksum(self, start: int, end: int) -> int:
        """CRC-32 of a part."""
        checksum = 0
        for at in range(start, end, 2**20):
            checksum = zlib.crc32(self[at : min(at + 2**20, end)], checksum)
        return checksum


class _Cursor:
    """Reads values one after the other between two places."""

    def __init__(self, data: bytes | _McapFile, at: int, end: int) -> None:
        self._data = data
        self.at = at
        self.end = min(end, len(data))

    @property
    def left(self) -> int:
        """Bytes that were not read yet."""
        return self.end - self.at

    def take(self, size: int) -> bytes:
        if self.at + size > self.end:
            raise _CutOffError
        self.at += size
        content = self._data[self.at - size : self.at]
        if len(content) < size:
            raise _CutOffError(": the file has become shorter since it was opened")
        return content

    def number(self, form: str) -> int:
        return struct.unpack(form, self.take(struct.calcsize(form)))[0]

    def block(self) -> bytes:
        return self.take(self.number("<I"))

    def text(self) -> str:
        size = self.number("<I")
        if size > MAX_DESCRIPTIONS:
            raise _CutOffError
        return self.take(size).decode()

    def texts(self) -> dict[str, str]:
        block = self.block()
        inner = _Cursor(block, 0, len(block))
        texts: dict[str, str] = {}
        while inner.at < len(block):
            key = inner.text()
            texts[key] = inner.text()
        return texts
