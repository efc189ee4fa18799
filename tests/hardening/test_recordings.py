"""Hostile recordings: opening one takes little memory and work, or it is refused with a sentence."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
)

import autodrive
from autodrive import Command
from autodrive.recording import Recorder, mcap, outputs
from autodrive.recording import open as open_recording
from tests.support.command_line import python
from tests.support.frames import digest
from tests.support.waiting import LIMIT

MAGIC, SECOND = b"\x89MCAP0\r\n", 10**9
MEMORY_LIMIT = 300.0
"""Memory to open a file, besides what is shown [MB]."""
CPU_LIMIT = 10.0
"""Processor time to open a file [s]; 5 s on an idle machine, but other programs use the same caches."""


def written(record: McapRecord) -> bytes:
    """The bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


class Forger:
    """A file that begins as a recording does; what follows is up to the caller, and need not be true."""

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            assert summary is not None
            metadata = next(iter(reader.iter_metadata()))
            messages = [(channel.topic, record) for _, channel, record in reader.iter_messages()]
        self.first = {topic: record.data for topic, record in reversed(messages)}
        """The first message of each topic."""
        self.channels = {channel.topic: channel.id for channel in summary.channels.values()}
        self.data = bytearray(MAGIC + written(Header(library="autodrive", profile="")))
        self.summary = bytearray()
        self.metadata(metadata)
        events = Channel(
            id=1 + max(summary.channels), topic="/autodrive/events", message_encoding="json", metadata={}, schema_id=0
        )
        self.channels.setdefault(events.topic, events.id)
        for record in (*summary.schemas.values(), *summary.channels.values(), events):
            self.data += written(record)
            self.summary += written(record)
        self.chunk(b"".join(written(record) for _, record in messages))

    def metadata(self, metadata: Metadata, copies: int = 1) -> None:
        """Metadata that the summary names so often."""
        data = written(metadata)
        self.summary += copies * written(MetadataIndex(name=metadata.name, offset=len(self.data), length=len(data)))
        self.data += data

    def message(self, topic: str | int, data: bytes = b"", time: int = SECOND) -> bytes:
        """A message of a topic, or of a channel of that number."""
        channel = topic if isinstance(topic, int) else self.channels[topic]
        return written(Message(channel_id=channel, data=data, log_time=time, publish_time=time, sequence=1))

    def chunk(
        self,
        content: bytes,
        *,
        packed: bytes | None = None,
        size: int | None = None,
        places: Mapping[int, int] | None = None,
        copies: int = 1,
        entries: int = 1,
    ) -> None:
        """Chunks that the summary names each `entries` times.

        `packed` and `size`: the compressed content and its size, if they are not true. `places`: where the messages of
        a channel are said to be (default: of all channels, nowhere).
        """
        packed, size = packed or zstandard.compress(content), len(content) if size is None else size
        places = dict.fromkeys(self.channels.values(), 0) if places is None else places
        times = {"message_start_time": 0, "message_end_time": SECOND, "compression": "zstd", "uncompressed_size": size}
        chunk = written(Chunk(data=packed, uncompressed_crc=0, **times))
        for _ in range(copies):
            index = ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=len(self.data),
                compressed_size=len(packed),
                message_index_length=0,
                message_index_offsets=dict(places),
                **times,
            )
            self.summary += entries * written(index)
            self.data += chunk

    def write(self, path: Path) -> None:
        """Write the file with its summary."""
        self.data += written(DataEnd(data_section_crc=0))
        footer = written(Footer(summary_start=len(self.data), summary_offset_start=0, summary_crc=0))
        path.write_bytes(self.data + self.summary + footer + MAGIC)


def zeros(size: int) -> bytes:
    """So many zeros, compressed without their size, piece by piece."""
    compressor = zstandard.ZstdCompressor().compressobj()
    packed = b"".join(compressor.compress(bytes(2**20)) for _ in range(size // 2**20))
    return packed + compressor.flush()


def shared_index(forger: Forger) -> None:
    place = len(forger.data)
    forger.data += written(MessageIndex(channel_id=1, records=[(SECOND, 31 * i) for i in range(50_000)]))
    forger.chunk(50_000 * forger.message(EVENTS), places=dict.fromkeys(range(2**16), place))


def many_files(forger: Forger) -> None:
    scenario = json.loads(forger.first[SCENARIO])
    scenario["files"] |= {f"module/{i}": "title: a" for i in range(20_000)}
    forger.chunk(forger.message(SCENARIO, json.dumps(scenario).encode(), 0))


SCENARIO, EVENTS, FRAME = "/autodrive/scenario", "/autodrive/events", "/autodrive/frame"
EVENT = b'{"tick":1,"event":{"type":"OffRoad","vehicle":"V1","time":1.0,"position":[0.0,0.0,0.0]}}'
LISTS = b'{"tick":0,"name":"","spec":{"a":[' + b"[]," * 1_300_000 + b'[]]},"files":{},"is_start":true}'
FILES: dict[str, tuple[Callable[[Forger], None], str]] = {
    "a chunk of more bytes than it names": (lambda file: file.chunk(b"", packed=zeros(2**30), size=1000), ""),
    "a chunk of 1 GB": (lambda file: file.chunk(b"", packed=zeros(2**30), size=2**30), ""),
    "65,536 channels that share an index": (shared_index, ""),
    "8,600,000 empty messages": (lambda file: file.chunk(8_600_000 * file.message(EVENTS)), ""),
    "a chunk that is named 300,000 times": (
        lambda file: file.chunk(file.message(EVENTS, EVENT), places={file.channels[EVENTS]: 0}, entries=300_000),
        "overlap|has more chunks",
    ),
    "32,768 chunks without what they name": (
        lambda file: file.chunk(file.message(60_000), copies=mcap.LEAST_CHUNKS - 1),
        "",
    ),
    "300,000 scenarios": (
        lambda file: file.chunk(3000 * file.message(SCENARIO, file.first[SCENARIO]), copies=100),
        "",
    ),
    "20,000 files in the scenario": (many_files, "a scenario has 2000[0-9] files; at most 1103 are read"),
    "metadata that is named 10,000 times": (
        lambda file: file.metadata(Metadata(name="a", metadata={str(i): "" for i in range(100_000)}), 10_000),
        "has more",
    ),
    "4,000,000 Frames without states": (
        lambda file: file.chunk(200_000 * file.message(FRAME, file.first[FRAME], 0), copies=20),
        "",
    ),
    "10,000,000 vehicles": (lambda file: file.chunk(file.message(FRAME, b"\x1a\x00" * 10_000_000, 0)), ""),
    "deep records": (lambda file: file.chunk(file.message(EVENTS, EVENT[:-1] + b',"a":' + b"[" * 100_000)), ""),
    "a scenario of empty lists": (
        lambda file: file.chunk(file.message(SCENARIO, LISTS, 0)),
        "the scenario of the recording is not valid here",
    ),
}
"""How to write each file, after a good chunk, and why it must be refused; empty: it may be shown."""

OPEN = """
import resource, sys, time
from pathlib import Path
from autodrive.base.errors import AutodriveError
from autodrive.recording import open as open_recording
from autodrive.recording.replay.tape import Tape

def number(name):
    return int(next(line.split()[1] for line in open("/proc/self/status") if line.startswith(name)))

def show(path):
    with open_recording(path) as recording:
        recording.end_tick, recording.start_tick, recording.vehicles, recording.scenario
    with Tape(Path(path)) as tape:
        tape.timeline, tape.contains_images, tape.scenario_at(0.0), tape.frame_at(0.0), tape.frame_at(1.0)
        return tape.problems

good, *paths = sys.argv[1:]
show(good)
limit = (number("VmData") << 10) + 2**30  # for the machine's sake: without the limits, a file takes 5 GB
resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
for path in paths:
    Path("/proc/self/clear_refs").write_text("5")  # begins another peak of the memory
    before, start = number("VmRSS"), time.process_time()
    try:
        text = "; ".join(show(path))
    except AutodriveError as error:
        text = f"refused: {error}"
    used = (number("VmHWM") - before) / 1e3
    print(f"{used:.0f} {time.process_time() - start:.2f} {text[:500]}", flush=True)
"""
"""Prints peak memory [MB] and processor time [s] of each file, and what is said about it."""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "small.mcap"
    world = autodrive.make("plane")
    with Recorder(path, world, has_meshes=False):
        for _ in range(5):
            world.step({"V1": Command(0.5)})
    return path


@pytest.mark.process
def test_a_hostile_recording_takes_little_memory_and_time_or_is_refused(small: Path, tmp_path: Path) -> None:
    paths = []
    for number, (attack, _) in enumerate(FILES.values()):
        forger = Forger(small)
        attack(forger)
        paths.append(tmp_path / f"{number}.mcap")
        forger.write(paths[-1])
    output = python("-c", OPEN, small, *paths, limit=3 * LIMIT)
    print(output)
    for (name, (_, refusal)), line in zip(FILES.items(), output.splitlines(), strict=True):
        memory, seconds, text = line.split(" ", 2)
        assert float(memory) < MEMORY_LIMIT, f"{name}: {line}"
        assert float(seconds) < CPU_LIMIT, f"{name}: {line}"
        assert re.search(f"^refused: .*({refusal})" if refusal else "", text), f"{name}: {line}"


CUT = """
import os, sys
from autodrive.base.errors import AutodriveError
from autodrive.recording.replay.tape import Tape
from pathlib import Path

path = sys.argv[1]
with Tape(Path(path)) as tape:
    for size in (os.path.getsize(path) // 2, 100, 0):
        os.truncate(path, size)
        for time in range(20):
            try:
                tape.frame_at(0.1 * time)
            except AutodriveError as error:
                print(error)
    print(tape.problems)
"""


@pytest.mark.process
def test_a_file_that_is_cut_off_while_it_is_replayed_is_a_sentence(long: Path) -> None:
    """A reader that maps the file into its memory is killed by the system."""
    printed = python("-c", CUT, long)
    assert re.search(r"the chunk at byte \d+ is damaged: the file has become shorter since it was opened", printed)


def test_a_recording_that_is_made_again_leaves_its_readers_the_old_one(long: Path) -> None:
    with open_recording(long) as whole:
        ticks = [frame.tick for frame in whole.frames()]
    with open_recording(long) as before:
        first = before.frame_at(0.0)
        with Recorder(long, autodrive.make("plane"), has_meshes=False):
            assert [frame.tick for frame in before.frames()] == ticks
        assert digest(before.frame_at(0.0)) == digest(first)
    with open_recording(long) as after:
        assert [frame.tick for frame in after.frames()] == [0]
    assert [path.name for path in long.parent.iterdir()] == [long.name]


@pytest.fixture
def long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording of more chunks than a reader keeps."""
    monkeypatch.setattr(outputs, "CHUNK_SIZE", 20_000)
    path = tmp_path / "long.mcap"
    world = autodrive.make("plane")
    with Recorder(path, world, has_meshes=False):
        for _ in range(500):
            world.step({"V1": Command(0.5)})
    return path
