"""Writes hostile recordings: valid MCAP records, of which none needs to be true."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from mcap.reader import make_reader

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
METADATA, METADATA_INDEX, DATA_END = 12, 13, 15
SECOND = 10**9


def record(kind: int, content: bytes) -> bytes:
    """Any record of a file."""
    return struct.pack("<BQ", kind, len(content)) + content


def block(data: bytes | str) -> bytes:
    """Bytes or a text with their length."""
    data = data.encode() if isinstance(data, str) else data
    return struct.pack("<I", len(data)) + data


def texts(values: Mapping[str, str]) -> bytes:
    """A map of texts."""
    return block(b"".join(block(key) + block(value) for key, value in values.items()))


def message(channel: int, data: bytes = b"", time: int = SECOND) -> bytes:
    """A message of a chunk; its time [ns]."""
    return record(MESSAGE, struct.pack("<HIQQ", channel, 1, time, time) + data)


class Content(NamedTuple):
    """Of a recording."""

    metadata: dict[str, str]
    schemas: list[tuple[int, str, str, bytes]]
    channels: dict[str, tuple[int, int, str]]
    """Number, schema and encoding by topic."""
    messages: list[tuple[str, int, bytes]]
    """Topic, time [ns] and data."""


def content_of(path: Path) -> Content:
    """What a good recording contains."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        return Content(
            dict(next(iter(reader.iter_metadata())).metadata),
            [(one.id, one.name, one.encoding, one.data) for one in summary.schemas.values()],
            {one.topic: (one.id, one.schema_id, one.message_encoding) for one in summary.channels.values()},
            [(channel.topic, one.log_time, one.data) for _, channel, one in reader.iter_messages()],
        )


class Forger:
    """A file that begins with the descriptions of a recording; what follows is up to the caller."""

    def __init__(self, content: Content) -> None:
        self.data = bytearray(MAGIC + record(HEADER, block("") + block("autodrive")))
        self.summary = bytearray()
        self.channels = {topic: one[0] for topic, one in content.channels.items()}
        metadata = record(METADATA, block("autodrive") + texts(content.metadata))
        self.summary += record(METADATA_INDEX, struct.pack("<QQ", len(self.data), len(metadata)) + block("autodrive"))
        self.data += metadata
        for number, name, encoding, schema in content.schemas:
            self.describe(record(SCHEMA, struct.pack("<H", number) + block(name) + block(encoding) + block(schema)))
        for topic, (number, schema_id, encoding) in content.channels.items():
            self.describe(_channel(number, schema_id, topic, encoding))
        self.topic("/autodrive/events")

    def describe(self, data: bytes) -> None:
        """A record of the data section that the summary repeats."""
        self.data += data
        self.summary += data

    def topic(self, name: str) -> int:
        """Number of the channel of a topic, which is added if there is none, in JSON."""
        if name not in self.channels:
            self.channels[name] = 1 + max(self.channels.values())
            self.describe(_channel(self.channels[name], 0, name, "json"))
        return self.channels[name]

    def chunk(self, content: bytes, **index: Any) -> None:
        """Chunks of this content; see `raw_chunk`."""
        self.raw_chunk(len(content), zstandard.compress(content), **index)

    def raw_chunk(
        self,
        size: int,
        packed: bytes,
        *,
        channels: Iterable[int] | None = None,
        place: int | None = None,
        copies: int = 1,
        entries: int = 1,
    ) -> None:
        """Chunks of compressed content of that size [bytes], which the summary names each `entries` times.

        `channels`: those that the index names (default: all), and `place`: where their messages are said to be
        (default: nowhere).
        """
        head = struct.pack("<QQQI", 0, SECOND, size, 0) + block("zstd") + struct.pack("<Q", len(packed))
        chunk = record(CHUNK, head + packed)
        names = self.channels.values() if channels is None else channels
        places = b"".join(struct.pack("<HQ", one, place or 0) for one in names)
        tail = block(places) + struct.pack("<Q", 0) + block("zstd") + struct.pack("<QQ", len(packed), size)
        for _ in range(copies):
            offset = struct.pack("<QQQQ", 0, SECOND, len(self.data), len(chunk))
            self.summary += record(CHUNK_INDEX, offset + tail) * entries
            self.data += chunk

    def write(self, path: Path) -> None:
        """Write the file with its summary."""
        self.data += record(DATA_END, struct.pack("<I", 0))
        footer = struct.pack("<QQI", len(self.data), 0, 0)
        path.write_bytes(self.data + self.summary + record(FOOTER, footer) + MAGIC)


def _channel(number: int, schema: int, topic: str, encoding: str) -> bytes:
    return record(CHANNEL, struct.pack("<HH", number, schema) + block(topic) + block(encoding) + texts({}))
