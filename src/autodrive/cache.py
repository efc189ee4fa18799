"""Where what can be made again is kept: folders of the user's, one for each state of the source that makes it."""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

PACKAGE = Path(__file__).parent


def cache_folder(kind: str, *rooms: str, also: str = "") -> Path:
    """The folder for things of that kind, made by the Python files of these rooms (none: of all).

    `also` is what they depend on besides. A change of a file leads to another folder; nothing is made here.
    """
    stamp = hashlib.sha256((sys.version + also).encode())
    for folder in [PACKAGE / room for room in rooms] or [PACKAGE]:
        for path in sorted(folder.rglob("*.py")):
            status = path.stat()
            stamp.update(f"{path.relative_to(PACKAGE)} {status.st_size} {status.st_mtime_ns}".encode())
    return _root() / "autodrive" / f"{kind}-{stamp.hexdigest()[:16]}"


def _root() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
