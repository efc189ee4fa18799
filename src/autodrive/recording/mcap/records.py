"""What the records of a file in the format MCAP (https://mcap.dev/spec) contain."""

from __future__ import annotations

import struct
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd  # noqa: F401

MAGIC = b"\x89MCAP0\r\n"
Opcode = IntEnum(
    "Opcode",
    "HEADER FOOTER SCHEMA CHANNEL MESSAGE CHUNK MESSAGE_INDEX CHUNK_INDEX "
    "ATTACHMENT ATTACHMENT_INDEX STATISTICS METADATA METADATA_INDEX SUMMARY_OFFSET DATA_END",
)
"""Kinds of records."""

RECORD_HEAD = struct.Struct("<BQ")
CHUNK_INDEX_HEAD = struct.Struct("<QQQQI")
CHANNEL_PLACE = np.dtype([("channel", "<u2"), ("place", "<u8")])
"""A channel of a chunk, and the place of its index in the file."""


class McapMessage(NamedTuple):
    """A message of a chunk; times in nanoseconds."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


@dataclass(frozen=True)
class Schema:
    """The schema of messages."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class McapChannel:
    """Messages of one kind."""

    id: int
    schema: int
    topic: str
    encoding: str
    metadata: Mapping[str, str]


class ChunkIndex(NamedTuple):
    """Where a chunk is in a file, and the time of its first and last message [ns]."""

    start: int
    end: int
    offset: int
    length: int
    """Length of the record of the chunk [bytes]."""
    places: NDArray[np.void]
    """Channels of the chunk and the places of their indexes: fields 'channel' and 'place', shape (n,)."""

    @property
    def channels(self) -> NDArray[np.uint16]:
        """Channels that have messages in it, shape (n,)."""
        return self.places["channel"]


@dataclass(frozen=True)
class AttachmentIndex:
    """Where an attachment is in a file."""

    name: str
    media_type: str
    offset: int
