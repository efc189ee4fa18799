"""Writes files in the format MCAP: messages in compressed chunks, then a summary."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np

from autodrive.base.texts import encodable
from autodrive.recording.mcap.records import (
    CHANNEL_PLACE,
    MAGIC,
    RECORD_HEAD,
    McapChannel,
    McapMessage,
    Opcode,
    Schema,
    zstd,
)

LEVEL, PACKED_LEVEL = 3, -1
"""Levels of the compression; the second for chunks that are mostly JPEG: a quarter of the time, 2 % more bytes."""

_MESSAGE = struct.Struct("<BQHIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")


@dataclass
class Chunk:
    """Messages that are compressed together."""

    start: int = 0
    end: int = 0
    data: bytearray = field(default_factory=bytearray)
    index: dict[int, bytearray] = field(default_factory=dict)
    """Times and offsets of the messages of each channel."""
    counts: dict[int, int] = field(default_factory=dict)
    """Messages of each channel."""
    packed: int = 0
    """Bytes of data that were compressed before, such as JPEG."""

    def add(self, message: McapMessage, *, is_packed: bool = False) -> None:
        """Add a message. `is_packed`: its data are compressed already."""
        if not self.data:
            self.start = self.end = message.log_time
        self.start, self.end = min(self.start, message.log_time), max(self.end, message.log_time)
        self.index.setdefault(message.channel, bytearray()).extend(struct.pack("<QQ", message.log_time, len(self.data)))
        self.counts[message.channel] = self.counts.get(message.channel, 0) + 1
        channel, sequence, log_time, publish_time, data = message
        self.data += _MESSAGE.pack(Opcode.MESSAGE, 22 + len(data), channel, sequence, log_time, publish_time)
        self.data += data
        if is_packed:
            self.packed += len(data)


def header(library: str) -> bytes:
    """The start of an MCAP file, with the name of the program that writes it."""
    return MAGIC + _record(Opcode.HEADER, _text("") + _text(library))


class Writer:
    """Writes an MCAP file after its `header`. A method that fails with `OSError` leaves all earlier records readable.

    `start`: size of what was written [bytes].
    """

    def __init__(self, file: BinaryIO, start: int) -> None:
        self._file = file
        self._offset = start
        summary = "SCHEMA", "CHANNEL", "STATISTICS", "CHUNK_INDEX", "ATTACHMENT_INDEX", "METADATA_INDEX"
        self._summary: dict[Opcode, list[bytes]] = {Opcode[kind]: [] for kind in summary}
        """Records of the summary, in its order."""
        self._times: list[int] = []
        """First and last times of the chunks [ns]."""
        self._counts: dict[int, int] = {}

    def schema(self, schema: Schema) -> None:
        """Add a schema, before the channels that use it."""
        texts = _text(schema.name) + _text(schema.encoding) + _block(schema.data)
        self._describe(Opcode.SCHEMA, struct.pack("<H", schema.id) + texts)

    def channel(self, channel: McapChannel) -> None:
        """Add a channel, before its messages."""
        texts = _text(channel.topic) + _text(channel.encoding) + _texts(channel.metadata)
        self._describe(Opcode.CHANNEL, struct.pack("<HH", channel.id, channel.schema) + texts)

    def chunk(self, chunk: Chunk) -> None:
        """Write a chunk with its indexes, and pass all to the operating system."""
        if not chunk.data:
            return
        data = zstd.compress(chunk.data, PACKED_LEVEL if 2 * chunk.packed > len(chunk.data) else LEVEL)
        head = _CHUNK_HEAD.pack(chunk.start, chunk.end, len(chunk.data), zlib.crc32(chunk.data))
        record = _record(Opcode.CHUNK, head + _text("zstd") + struct.pack("<Q", len(data)), data)
        places: list[tuple[int, int]] = []
        indexes = b""
        for channel, entries in chunk.index.items():
            places.append((channel, self._offset + len(record) + len(indexes)))
            indexes += _record(Opcode.MESSAGE_INDEX, struct.pack("<H", channel) + _block(bytes(entries)))
        head = struct.pack("<QQQQ", chunk.start, chunk.end, self._offset, len(record))
        index = head + _block(np.array(places, CHANNEL_PLACE).tobytes()) + struct.pack("<Q", len(indexes))
        index += _text("zstd") + struct.pack("<QQ", len(data), len(chunk.data))
        self._write(record + indexes)
        self._summary[Opcode.CHUNK_INDEX].append(_record(Opcode.CHUNK_INDEX, index))
        self._times += [chunk.start, chunk.end]
        for channel, count in chunk.counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count

    def attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file."""
        content = struct.pack("<QQ", 0, 0) + _text(name) + _text(media_type) + struct.pack("<Q", len(data)) + data
        record = _record(Opcode.ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))
        index = struct.pack("<QQQQQ", self._offset, len(record), 0, 0, len(data)) + _text(name) + _text(media_type)
        self._write(record)
        self._summary[Opcode.ATTACHMENT_INDEX].append(_record(Opcode.ATTACHMENT_INDEX, index))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add named texts."""
        record = _record(Opcode.METADATA, _text(name) + _texts(values))
        index = struct.pack("<QQ", self._offset, len(record)) + _text(name)
        self._write(record)
        self._summary[Opcode.METADATA_INDEX].append(_record(Opcode.METADATA_INDEX, index))

    def finish(self) -> None:
        """Write the summary, from which readers find everything at once."""
        self._write(_record(Opcode.DATA_END, struct.pack("<I", 0)))
        start = self._offset
        self._summary[Opcode.STATISTICS].append(self._statistics())
        summary = offsets = b""
        for kind, records in self._summary.items():
            part = b"".join(records)
            if part:
                offsets += _record(Opcode.SUMMARY_OFFSET, struct.pack("<BQQ", kind, start + len(summary), len(part)))
                summary += part
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, start + len(summary))
        checksum = zlib.crc32(head, zlib.crc32(summary + offsets))
        self._write(summary + offsets + head + struct.pack("<I", checksum) + MAGIC)

    def _describe(self, kind: Opcode, content: bytes) -> None:
        """Write a record that the summary repeats."""
        self._summary[kind].append(_record(kind, content))
        self._write(self._summary[kind][-1])

    def _statistics(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", channel, count) for channel, count in sorted(self._counts.items()))
        kinds = Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX, Opcode.CHUNK_INDEX
        numbers = [sum(self._counts.values()), *(len(self._summary[kind]) for kind in kinds)]
        content = struct.pack("<QHIIIIQQ", *numbers, min(self._times, default=0), max(self._times, default=0))
        return _record(Opcode.STATISTICS, content + _block(counts))

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._file.flush()
        self._offset += len(data)

    @property
    def size(self) -> int:
        """Bytes that were written whole."""
        return self._offset


def _record(kind: int, content: bytes, more: bytes = b"") -> bytes:
    return b"".join((RECORD_HEAD.pack(kind, len(content) + len(more)), content, more))


def _text(text: str) -> bytes:
    return _block(encodable(text).encode())


def _block(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _texts(values: Mapping[str, str]) -> bytes:
    return _block(b"".join(_text(key) + _text(value) for key, value in values.items()))
