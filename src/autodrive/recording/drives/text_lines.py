"""The lines of a text file, also compressed by gzip, with bounded memory and work."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from autodrive.base.readable import readable
from autodrive.recording.errors import RecordingError

MAX_TEXT = 2**30
"""Largest size of a text that is read, after decompression [bytes]."""
MAX_LINE = 2**20
"""Longest line that is read [bytes]: a row of AutoDRIVE's data recorder with 1080 ranges has 20 kB."""
GZIP = b"\x1f\x8b"
OTHER_ENCODINGS = {b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16", b"\x00\x00\xfe\xff": "UTF-32"}


@contextmanager
def naming(source: str | Path) -> Iterator[None]:
    """Add the file to the `RecordingError` of the block."""
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"{error}  ({source})") from None


def text_lines(path: Path) -> Iterator[str]:
    """The lines of a text file in UTF-8, one after another. Raises `RecordingError` without the name of the file.

    The file may be compressed by gzip. A byte order mark is left out.
    """
    try:
        with readable(path).open("rb") as file:
            head = file.read(4)
            size = path.stat().st_size
            file.seek(0)
            if head[:2] != GZIP and size > MAX_TEXT:
                raise RecordingError(
                    f"the file has {size / 1e9:.1f} GB; a log that is read has at most {MAX_TEXT / 1e9:.1f} GB: cut it "
                    f"into parts"
                )
            stream = io.BufferedReader(gzip.GzipFile(fileobj=file), 2**16) if head[:2] == GZIP else file  # pyright: ignore[reportArgumentType]
            yield from _decoded(cast(BinaryIO, stream))
    except OSError as error:
        raise RecordingError(f"cannot read the log: {error}") from None
    except (EOFError, zlib.error) as error:
        raise RecordingError(f"the file is truncated or damaged: {str(error).rstrip('.')}") from None


def _decoded(stream: BinaryIO) -> Iterator[str]:
    size, number = 0, 0
    while raw := stream.readline(MAX_LINE):
        number += 1
        size += len(raw)
        if number == 1:
            raw = raw.removeprefix(b"\xef\xbb\xbf")
            for mark, encoding in OTHER_ENCODINGS.items():
                if raw.startswith(mark):
                    raise RecordingError(f"the file is {encoding} text; save it as UTF-8")
        if b"\0" in raw:
            raise RecordingError(f"line {number} has bytes of value 0: the file is no text")
        if len(raw) == MAX_LINE and not raw.endswith(b"\n"):
            raise RecordingError(f"line {number} is longer than {MAX_LINE // 2**20} MB: this is no log")
        if size > MAX_TEXT:
            raise RecordingError(f"the text has more than {MAX_TEXT / 1e9:.1f} GB: cut the log into parts")
        try:
            yield raw.decode()
        except UnicodeDecodeError:
            raise RecordingError(f"line {number} is not UTF-8 text; save the file in that encoding") from None
