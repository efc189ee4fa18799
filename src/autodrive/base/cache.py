"""Files that are written whole or not at all; cache folders, and the source files that their contents depend on."""

from __future__ import annotations

import contextlib
import functools
import getpass
import hashlib
import os
import re
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from autodrive.base.errors import AutodriveError
from autodrive.base.texts import encodable

PACKAGE = Path(__file__).parents[1]


def write_file(path: Path, data: bytes | str) -> None:
    """Write a file of a user, text as UTF-8: whole, or not at all. Raises `AutodriveError`."""
    with _errors(path):
        _replace(path, encodable(data).encode() if isinstance(data, str) else data)


@contextlib.contextmanager
def new_file(path: Path) -> Iterator[BinaryIO]:
    """A file of a user that is written piece by piece: whole, or not at all if the block raises.

    Raises `AutodriveError` instead of an `OSError`.
    """
    with _errors(path), _new(path) as file:
        yield file


def growing_file(path: Path, start: bytes) -> BinaryIO:
    """A new file of that name that begins so and is written further; readers of the old file keep its content.

    Raises `AutodriveError`; the old file is complete then.
    """
    with _errors(path):
        _replace(path, start)
        return _target(path).open("ab")


def make_folder(path: Path) -> None:
    """Make a folder, and those that it is in. Raises `AutodriveError`."""
    with _errors(path):
        path.mkdir(parents=True, exist_ok=True)


def check_writable(path: Path) -> None:
    """Raises `AutodriveError` if `write_file` cannot write that file; changes nothing."""
    with _errors(path):
        target = _target(path)
        if _is_replaceable(target):
            tempfile.TemporaryFile(dir=target.parent).close()
        else:
            target.open("ab").close()


@contextlib.contextmanager
def _errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise AutodriveError(f"cannot write: {error.strerror}  ({path})") from None


def _replace(path: Path, data: bytes) -> None:
    """Write a file; what was there is complete until the new content is. Raises `OSError`."""
    with _new(path) as file:
        file.write(data)


@contextlib.contextmanager
def _new(path: Path) -> Iterator[BinaryIO]:
    """The new content of a file; what was there stays until the block ends. Raises `OSError`."""
    path = _target(path)
    if not _is_replaceable(path):
        with path.open("wb") as file:
            yield file
        return
    handle, part = tempfile.mkstemp(dir=path.parent, prefix=".autodrive-")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
        Path(part).chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_UMASK)
        Path(part).replace(path)
    except BaseException:
        Path(part).unlink(missing_ok=True)
        raise


def _target(path: Path) -> Path:
    """The file that a link points to, so that the link stays."""
    return Path(os.path.realpath(path))


def _is_replaceable(path: Path) -> bool:
    """False for a device, a pipe or a folder, and for a file that must not be written."""
    return not path.exists() or (path.is_file() and os.access(path, os.W_OK))


def _umask() -> int:
    """File mode mask of this process; the only way to read it is to set it."""
    umask = os.umask(0o077)
    os.umask(umask)
    return umask


_UMASK = _umask()  # when this module is imported, because threads may write files later


def cache_folder(kind: str, *packages: str, also: str = "") -> Path:
    """Folder for contents of that kind, which the Python files of these packages generate.

    `also` is anything else that the contents depend on. Another version of a file gives another folder. The folder is
    not created.
    """
    stamp = hashlib.sha256((sys.version + also).encode())
    for package in packages:
        for path in sorted((PACKAGE / package).rglob("*.py")):
            status = path.stat()
            stamp.update(f"{path.relative_to(PACKAGE)} {status.st_size} {status.st_mtime_ns}".encode())
    return user_cache() / f"{kind}-{stamp.hexdigest()[:16]}"


def sources(file: Path) -> list[Path]:
    """A Python file and all files of this package that it imports, directly or not. Raises `OSError`.

    `python_files.sources` has the files of a user.
    """
    files, pending = {file}, [file]
    while pending:
        source = pending.pop()
        new = _imported(source, source.stat().st_mtime_ns, PACKAGE.parent) - files
        files |= new
        pending += new
    return sorted(files)


_IMPORT = re.compile(r"(?:^|[;:])[ \t]*(?:import ([\w., ]+)|from ([\w.]+) import (\([^)]*\)|.*))", re.MULTILINE)


@functools.cache
def _imported(file: Path, _modified: int, folder: Path) -> frozenset[Path]:
    """The files of this package, which is in that folder, that a file imports itself."""
    names: set[str] = set()
    for modules, module, members in _IMPORT.findall(file.read_text(encoding="utf-8", errors="replace")):
        names |= set(re.findall(r"[\w.]+", modules)) | {module}
        names |= {f"{module}.{member}" for member in re.findall(r"\w+", members)}
    paths = [folder.joinpath(*name.split(".")) for name in names if name.startswith("autodrive.")]
    return frozenset(
        source for path in paths for source in (path.with_suffix(".py"), path / "__init__.py") if source.is_file()
    )


def read_cached(path: Path) -> bytes:
    """What `write_cached` has written. Raises `OSError`, and `ValueError` if it is damaged."""
    content = path.read_bytes()
    checksum, data = content[:_CHECKSUM_SIZE], content[_CHECKSUM_SIZE:]
    if hashlib.sha256(data).digest() != checksum:
        raise ValueError(f"{path} is damaged")
    return data


def write_cached(path: Path, data: bytes) -> None:
    """Write a file with a checksum, whole or not at all, and its folder. Raises `OSError`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    _replace(path, hashlib.sha256(data).digest() + data)


_CHECKSUM_SIZE = hashlib.sha256().digest_size
"""[bytes]."""


def user_cache() -> Path:
    """Folder of this program for what the user can delete at any time.

    It is in the user's cache folder, or, where that cannot be written, among the temporary files. It may be missing,
    and not writable where neither can be written.
    """
    folder = home_cache()
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    return folder if existing.is_dir() and os.access(existing, os.W_OK) else temporary_cache() or folder


def home_cache() -> Path:
    """Folder of this program in the user's cache folder, as the operating system names it."""
    try:
        home = Path.home()
    except RuntimeError:  # the user has neither HOME nor an entry in the user database
        home = Path(os.devnull)  # no folder can be made there
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = home / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return caches / "autodrive"


def temporary_cache() -> Path | None:
    """Folder of this user among the temporary files, which is made; None if only this user cannot write into it."""
    try:
        folder = Path(tempfile.gettempdir()) / f"autodrive-{user_name()}"
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError:
        return None
    return folder if is_own(folder) else None


def user_name() -> str:
    """Login name of the user of this process, or the number if it has no name, as in some containers."""
    if sys.platform == "win32":
        return getpass.getuser()
    import pwd  # noqa: PLC0415  not on Windows

    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())


def is_own(folder: Path) -> bool:
    """Whether only this user can write into a folder: anybody can make one among the temporary files."""
    try:
        status = folder.lstat()
    except OSError:
        return False
    if sys.platform == "win32":
        return stat.S_ISDIR(status.st_mode)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022
