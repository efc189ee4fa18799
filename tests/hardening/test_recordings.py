"""Hostile recordings: opening one takes little memory and work, or it is refused with a sentence."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard

import autodrive
from autodrive import Command
from autodrive.recording import Recorder, mcap, outputs
from autodrive.recording import open as open_recording
from tests.support.command_line import python
from tests.support.forger import (
    MESSAGE_INDEX,
    METADATA,
    METADATA_INDEX,
    SECOND,
    Content,
    Forger,
    block,
    content_of,
    message,
    record,
    texts,
)
from tests.support.frames import digest
from tests.support.waiting import LIMIT

MEMORY_LIMIT = 300.0
"""Memory to open a file, besides what is shown [MB]."""
CPU_LIMIT = 10.0
"""Processor time to open a file [s]; 5 s on an idle machine, but other programs use the same caches."""


def zeros(size: int) -> bytes:
    """So many zeros, compressed without their size, piece by piece."""
    compressor = zstandard.ZstdCompressor().compressobj()
    packed = b"".join(compressor.compress(bytes(2**20)) for _ in range(size // 2**20))
    return packed + compressor.flush()


def more_than_named(forger: Forger, content: Content) -> None:
    forger.raw_chunk(1000, zeros(2**30))


def huge(forger: Forger, content: Content) -> None:
    forger.raw_chunk(2**30, zeros(2**30))


def large(forger: Forger, content: Content) -> None:
    forger.raw_chunk(mcap.MAX_CHUNK, zeros(mcap.MAX_CHUNK), copies=100)


def shared_index(forger: Forger, content: Content) -> None:
    messages = message(forger.channels["/autodrive/events"]) * 50_000
    place = len(forger.data)
    entries = b"".join(struct.pack("<QQ", SECOND, 31 * i) for i in range(50_000))
    forger.data += record(MESSAGE_INDEX, struct.pack("<H", 1) + block(entries))
    forger.chunk(messages, channels=range(2**16), place=place)


def empty_messages(forger: Forger, content: Content) -> None:
    forger.chunk(message(forger.channels["/autodrive/events"]) * 2_000_000)


def more_empty_messages(forger: Forger, content: Content) -> None:
    forger.chunk(message(forger.channels["/autodrive/events"]) * 8_600_000)


def chunks_of_empty_messages(forger: Forger, content: Content) -> None:
    for topic in ("/autodrive/events", "/autodrive/scenario"):
        forger.chunk(message(forger.channels[topic]) * mcap.MAX_MESSAGES, copies=300)


def one_chunk_300_000_times(forger: Forger, content: Content) -> None:
    events = forger.channels["/autodrive/events"]
    forger.chunk(message(events, EVENT), channels=[events], entries=300_000)


def chunks_300_000(forger: Forger, content: Content) -> None:
    events = forger.channels["/autodrive/events"]
    forger.chunk(message(events, EVENT), channels=[events], copies=300_000)


def as_many_chunks_as_allowed(forger: Forger, content: Content) -> None:
    events = forger.channels["/autodrive/events"]
    forger.chunk(message(events, EVENT), channels=[events], copies=mcap.LEAST_CHUNKS - 1)


def chunks_without_what_they_name(forger: Forger, content: Content) -> None:
    forger.chunk(message(60_000), copies=mcap.LEAST_CHUNKS - 1)


def scenarios(forger: Forger, content: Content) -> None:
    (scenario,) = (data for topic, _, data in content.messages if topic == "/autodrive/scenario")
    forger.chunk(message(forger.channels["/autodrive/scenario"], scenario) * 3000, copies=100)


def many_files(forger: Forger, content: Content) -> None:
    (scenario,) = (json.loads(data) for topic, _, data in content.messages if topic == "/autodrive/scenario")
    scenario["files"] |= {f"module/{i}": "title: a" for i in range(20_000)}
    forger.chunk(message(forger.channels["/autodrive/scenario"], json.dumps(scenario).encode(), 0))


def metadata_many_times(forger: Forger, content: Content) -> None:
    place = len(forger.data)
    forger.data += record(METADATA, block("a") + texts({str(i): "" for i in range(100_000)}))
    forger.summary += record(METADATA_INDEX, struct.pack("<QQ", place, 9) + block("a")) * 10_000


def frames_without_states(forger: Forger, content: Content) -> None:
    (frame,) = (data for topic, time, data in content.messages if topic == "/autodrive/frame" and time == 0)
    forger.chunk(message(forger.channels["/autodrive/frame"], frame, 0) * 200_000, copies=20)


def a_million_vehicles(forger: Forger, content: Content) -> None:
    """Field 3 of a Frame is a list of names."""
    forger.chunk(message(forger.channels["/autodrive/frame"], b"\x1a\x00" * 10_000_000, 0))


def deep_records(forger: Forger, content: Content) -> None:
    forger.chunk(message(forger.channels["/autodrive/events"], EVENT[:-1] + b',"a":' + b"[" * 100_000))


def empty_lists(forger: Forger, content: Content) -> None:
    spec = b'{"tick":0,"name":"","spec":{"a":[' + b"[]," * 1_300_000 + b'[]]},"files":{},"is_start":true}'
    forger.chunk(message(forger.channels["/autodrive/scenario"], spec, 0))


EVENT = b'{"tick":1,"event":{"type":"OffRoad","vehicle":"V1","time":1.0,"position":[0.0,0.0,0.0]}}'
FILES: dict[str, tuple[Callable[[Forger, Content], None], str]] = {
    "a chunk of more bytes than it names": (more_than_named, ""),
    "a chunk of 1 GB": (huge, ""),
    "100 chunks of the largest size": (large, ""),
    "65,536 channels that share an index": (shared_index, ""),
    "2,000,000 empty messages": (empty_messages, ""),
    "8,600,000 empty messages": (more_empty_messages, ""),
    "600 chunks of empty messages": (chunks_of_empty_messages, ""),
    "a chunk that is named 300,000 times": (one_chunk_300_000_times, "overlap|has more chunks"),
    "300,000 chunks": (chunks_300_000, "has more chunks than a recording"),
    "32,768 chunks": (as_many_chunks_as_allowed, ""),
    "32,768 chunks without what they name": (chunks_without_what_they_name, ""),
    "300,000 scenarios": (scenarios, ""),
    "20,000 files in the scenario": (many_files, "a scenario has 2000[0-9] files; at most 1103 are read"),
    "metadata that is named 10,000 times": (metadata_many_times, "has more"),
    "4,000,000 Frames without states": (frames_without_states, ""),
    "10,000,000 vehicles": (a_million_vehicles, ""),
    "deep records": (deep_records, ""),
    "a scenario of empty lists": (empty_lists, "the scenario of the recording is not valid here"),
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
    content = content_of(small)
    paths = []
    for number, (attack, _) in enumerate(FILES.values()):
        forger = Forger(content)
        forger.chunk(b"".join(message(forger.channels[topic], data, at) for topic, at, data in content.messages))
        attack(forger, content)
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
