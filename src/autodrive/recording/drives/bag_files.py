"""The messages in the files of ROS bags, with bounded memory: ROS 1, and ROS 2 with MCAP or sqlite3."""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from autodrive.base.readable import readable
from autodrive.recording.drives.ros_messages import MessageTypes
from autodrive.recording.errors import RecordingError
from autodrive.recording.lz4_frames import unpacked_lz4
from autodrive.recording.mcap.reader import Reader
from autodrive.recording.mcap.records import MAGIC as MCAP_MAGIC

ROS1_MAGIC = b"#ROSBAG V2.0\n"
SQLITE_MAGIC = b"SQLite format 3\0"
MAX_HEADER, MAX_CHUNK = 2**20, 2**26
"""Largest header of a record, and largest chunk, that are read [bytes]."""
MAX_MESSAGE = 2**20
"""Largest message that is read: that of a car has less than a kilobyte [bytes]."""
MAX_CONNECTIONS = 10_000
"""Most topics of a bag."""
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7


class BagMessage(NamedTuple):
    """A message of a bag."""

    topic: str
    type: str
    time: float
    """When it was recorded, Unix time [s]."""
    data: bytes


class BagFile:
    """A file of a bag: its topics with their types, and its messages in the order of the file."""

    def __init__(self, path: Path) -> None:
        """Raises `RecordingError` if it is no bag."""
        self.path = path
        self.types = MessageTypes()
        self.topics: dict[str, str] = {}
        """Topic -> type of its messages, such as 'nav_msgs/Odometry'; of ROS 1 those read so far."""
        self.is_ros1 = False
        try:
            with readable(path).open("rb") as file:
                head = file.read(16)
        except OSError as error:
            raise RecordingError(f"cannot read the bag: {error.strerror or error}") from None
        if head.startswith(ROS1_MAGIC):
            self.is_ros1 = True
            self._read = self._ros1
        elif head.startswith(SQLITE_MAGIC):
            self._read = self._sqlite
        elif head.startswith(MCAP_MAGIC):
            self._read = self._mcap
        else:
            raise RecordingError("the file is no bag: neither ROS 1 (version 2.0) nor ROS 2 (MCAP, sqlite3)")

    def messages(self) -> Iterator[BagMessage]:
        """The messages. Raises `RecordingError`."""
        try:
            yield from self._read()
        except (OSError, EOFError, struct.error, UnicodeDecodeError) as error:
            raise RecordingError(f"the bag is damaged or cut off: {error}") from None

    def _add(self, topic: str, type_: str, definition: str) -> None:
        plain = type_.replace("/msg/", "/")
        if len(self.topics) >= MAX_CONNECTIONS:
            raise RecordingError(f"the bag has more than {MAX_CONNECTIONS} topics")
        self.topics[topic] = plain
        if definition:
            self.types.add(plain, definition)

    # -- ROS 1: http://wiki.ros.org/Bags/Format/2.0 ----------------------------------------------------------------

    def _ros1(self) -> Iterator[BagMessage]:
        connections: dict[int, tuple[str, str]] = {}
        with self.path.open("rb") as file:
            end = file.seek(0, 2)
            file.seek(len(ROS1_MAGIC))
            while file.tell() < end:
                header = _ros1_header(file)
                size = struct.unpack("<I", _exactly(file, 4))[0]
                if "op" not in header:
                    raise RecordingError(f"the bag is damaged: a record before byte {file.tell()} has no kind")
                if header.get("op") == bytes([_CHUNK]):
                    yield from self._ros1_records(_ros1_chunk(header, file, size), connections)
                elif header.get("op") in {bytes([_CONNECTION]), bytes([_MESSAGE])} and size <= MAX_CHUNK:
                    yield from self._ros1_record(header, _exactly(file, size), connections)
                elif file.tell() + size > end:
                    raise RecordingError("the bag is cut off; rosbag reindex repairs it")
                else:
                    file.seek(size, 1)

    def _ros1_records(self, chunk: bytes, connections: dict[int, tuple[str, str]]) -> Iterator[BagMessage]:
        at = 0
        while at < len(chunk):
            header, at = _ros1_fields_at(chunk, at)
            (size,) = struct.unpack_from("<I", chunk, at)
            if at + 4 + size > len(chunk):
                raise EOFError("a record is longer than its chunk")
            yield from self._ros1_record(header, chunk[at + 4 : at + 4 + size], connections)
            at += 4 + size

    def _ros1_record(
        self, header: dict[str, bytes], data: bytes, connections: dict[int, tuple[str, str]]
    ) -> Iterator[BagMessage]:
        if header.get("op") == bytes([_CONNECTION]):
            fields = _ros1_fields(data)
            topic, type_ = header.get("topic", b"").decode(), fields.get("type", b"").decode()
            (number,) = struct.unpack("<I", header.get("conn", b""))
            if number not in connections:
                self._add(topic, type_, fields.get("message_definition", b"").decode(errors="replace"))
                connections[number] = topic, type_.replace("/msg/", "/")
        elif header.get("op") == bytes([_MESSAGE]) and len(data) <= MAX_MESSAGE:
            (number,) = struct.unpack("<I", header.get("conn", b""))
            seconds, nanoseconds = struct.unpack("<II", header.get("time", b""))
            if number not in connections:
                raise RecordingError(f"the bag has a message of the connection {number}, which it does not describe")
            topic, type_ = connections[number]
            yield BagMessage(topic, type_, seconds + 1e-9 * nanoseconds, data)

    # -- ROS 2 -----------------------------------------------------------------------------------------------------

    def _mcap(self) -> Iterator[BagMessage]:
        reader = Reader(self.path)
        try:
            for channel in reader.channels.values():
                schema = reader.schemas.get(channel.schema)
                if schema is not None:
                    text = schema.data.decode(errors="replace") if schema.encoding == "ros2msg" else ""
                    self._add(channel.topic, schema.name, text)
            if not reader.chunks:
                problem = f": {reader.problems[0]}" if reader.problems else ""
                raise RecordingError(f"the MCAP file has no chunks with messages{problem}")
            for number in range(len(reader.chunks)):
                for message in reader.messages(number):
                    topic = reader.channels[message.channel].topic if message.channel in reader.channels else ""
                    if topic in self.topics and len(message.data) <= MAX_MESSAGE:
                        yield BagMessage(topic, self.topics[topic], 1e-9 * message.log_time, message.data)
            if reader.problems:
                raise RecordingError(f"the bag is not whole: {reader.problems[0]}")
        finally:
            reader.close()

    def _sqlite(self) -> Iterator[BagMessage]:
        database = sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
        try:
            tables = {str(name) for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if not {"topics", "messages"} <= tables:
                raise RecordingError("the database is no bag: it has no tables 'topics' and 'messages'")
            definitions: dict[str, str] = {}
            if "message_definitions" in tables:
                query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
                definitions = {name: text for name, encoding, text in database.execute(query) if encoding == "ros2msg"}
            numbers: dict[int, str] = {}
            for number, topic, type_ in database.execute("SELECT id, name, type FROM topics"):
                self._add(str(topic), str(type_), str(definitions.get(type_, "")))
                numbers[number] = str(topic)
            query = "SELECT topic_id, timestamp, data FROM messages WHERE length(data) <= ? ORDER BY timestamp"
            for number, time, data in database.execute(query, (MAX_MESSAGE,)):
                if number in numbers:
                    yield BagMessage(numbers[number], self.topics[numbers[number]], 1e-9 * time, bytes(data))
        except sqlite3.Error as error:
            raise RecordingError(f"the bag is damaged: {error}") from None
        finally:
            database.close()


def _exactly(file: BinaryIO, size: int) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise EOFError("the end of the file is missing")
    return data


def _ros1_header(file: BinaryIO) -> dict[str, bytes]:
    (size,) = struct.unpack("<I", _exactly(file, 4))
    if size > MAX_HEADER:
        raise RecordingError(f"the bag is damaged: the header of a record has {size} bytes")
    return _ros1_fields(_exactly(file, size))


def _ros1_fields_at(chunk: bytes, at: int) -> tuple[dict[str, bytes], int]:
    (size,) = struct.unpack_from("<I", chunk, at)
    return _ros1_fields(chunk[at + 4 : at + 4 + size]), at + 4 + size


def _ros1_fields(data: bytes) -> dict[str, bytes]:
    fields: dict[str, bytes] = {}
    at = 0
    while at + 4 <= len(data):
        (size,) = struct.unpack_from("<I", data, at)
        name, _, value = data[at + 4 : at + 4 + size].partition(b"=")
        fields[name.decode(errors="replace")] = value
        at += 4 + size
    return fields


def _ros1_chunk(header: dict[str, bytes], file: BinaryIO, size: int) -> bytes:
    """The content of a chunk, at most `MAX_CHUNK` bytes."""
    compression = header.get("compression", b"").decode(errors="replace")
    (unpacked,) = struct.unpack("<I", header.get("size", b""))
    if max(size, unpacked) > MAX_CHUNK:
        raise RecordingError(f"a chunk of the bag has {max(size, unpacked)} bytes; at most {MAX_CHUNK} are read")
    data = _exactly(file, size)
    if compression == "bz2":
        data = bz2.BZ2Decompressor().decompress(data, unpacked + 1)
    elif compression == "lz4":
        data = unpacked_lz4(data, unpacked + 1)
    elif compression != "none":
        raise RecordingError(f"the compression '{compression[:20]}' of a bag is not known; known: none, bz2, lz4")
    if len(data) != unpacked:
        raise RecordingError(f"the bag is damaged: a chunk does not unpack to {unpacked} bytes")
    return data
