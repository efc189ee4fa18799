"""Notes about the runs of this user: a client without an address reads which simulator was started in its folder.

Each run has a file with a note in the user's cache, or in the folder for temporary files if there is no cache.
"""

from __future__ import annotations

import os
import socket
import sys
from contextlib import suppress
from pathlib import Path

import msgspec
from msgspec.structs import replace

from autodrive.base.cache import home_cache, is_own, temporary_cache
from autodrive.protocol.native import RunOrigin

MAX_NOTE = 2**16
"""A longer file is no note [bytes]."""


class RunNote(msgspec.Struct, frozen=True):
    """A run: the folder that it was started in, its process, and the address for clients, empty while it starts."""

    origin: RunOrigin
    folder: str
    machine: str
    process: int
    address: str = ""

    @property
    def is_running(self) -> bool:
        """Whether its process is there. On Windows always: signal 0 would end a process."""
        if sys.platform == "win32":
            return True
        try:
            os.kill(self.process, 0)
        except ProcessLookupError:
            return False
        except OSError:  # the process belongs to another user
            return False
        return True


class NotedRun:
    """The note of a run of this process, which is there while the context is entered; at first without an address."""

    def __init__(self, origin: RunOrigin) -> None:
        self._note = RunNote(origin, _here(), socket.gethostname(), os.getpid())
        self._file: Path | None = None

    def __enter__(self) -> NotedRun:
        self.write()
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            with suppress(OSError):
                self._file.unlink(missing_ok=True)

    def write(self, address: str = "") -> None:
        """Write the note. A run needs none: without a folder that can be written, there is no note."""
        self._note = replace(self._note, address=address)
        for folder in _folders():
            with suppress(OSError):
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
                if is_own(folder):
                    _remove_old_notes(folder)
                    file = folder / f"{self._note.origin.id}.json"
                    part = file.with_suffix(".part")
                    part.write_bytes(msgspec.json.encode(self._note))
                    part.replace(file)
                    self._file = file
                    return


def last_run() -> RunNote | None:
    """The last run of this user in the current folder and on this machine that has not ended; None: there is none."""
    notes = [note for folder in _folders() if is_own(folder) for note in _notes(folder).values() if note]
    here, machine = _here(), socket.gethostname()
    runs = [note for note in notes if note.folder == here and note.machine == machine and note.is_running]
    return max(runs, key=lambda note: note.origin.started, default=None)


def _here() -> str:
    """The current folder; empty if it was deleted."""
    try:
        return os.path.realpath(Path.cwd())
    except OSError:
        return ""


def _folders() -> list[Path]:
    """Folders of the notes, best first: C++ clients look there, too."""
    return [home_cache() / "runs", *([folder] if (folder := temporary_cache()) else [])]


def _notes(folder: Path) -> dict[Path, RunNote | None]:
    """The notes in a folder by their files; None: the file is no note."""
    notes: dict[Path, RunNote | None] = {}
    for file in sorted(folder.glob("*.json")):
        notes[file] = None
        with suppress(OSError, msgspec.MsgspecError):
            if file.is_file() and file.stat().st_size <= MAX_NOTE:
                notes[file] = msgspec.json.decode(file.read_bytes(), type=RunNote)
    return notes


def _remove_old_notes(folder: Path) -> None:
    """Remove the notes of runs that were killed."""
    for file, note in _notes(folder).items():
        if note is None or (note.machine == socket.gethostname() and not note.is_running):
            file.unlink(missing_ok=True)
