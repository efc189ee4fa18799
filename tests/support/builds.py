"""Builds of other languages for the tests: repeated only if the content of a source file has changed."""

from __future__ import annotations

import fcntl
import hashlib
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

LIMIT = 1200.0
"""Time limit of one build command [s]; generous, because the machine may be busy."""


def build_once(folder: Path, sources: Iterable[Path], key: str, build: Callable[[], None]) -> None:
    """Call `build`, which fills `folder`, unless the last build had the same sources and key; one process at a time."""
    digest = hashlib.sha256(key.encode())
    for path in sorted(file for source in sources for file in ([source] if source.is_file() else source.rglob("*"))):
        if path.is_file():
            digest.update(f"{path}\0".encode() + path.read_bytes())
    folder.mkdir(parents=True, exist_ok=True)
    state = folder / "state"
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if state.is_file() and state.read_text() == digest.hexdigest():
            return
        state.unlink(missing_ok=True)
        build()
        state.write_text(digest.hexdigest())


def run(*words: object, stdin: str | None = None) -> str:
    """The output of a command, which must succeed."""
    command = [str(word) for word in words]
    done = subprocess.run(command, input=stdin, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout
