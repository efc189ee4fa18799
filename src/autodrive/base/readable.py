"""Which files may be read: regular files, and, while a client's request is executed, only some of them."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

Refusal = Callable[[Path], str]
"""Why a file may not be read; empty if it may."""

_refusal: ContextVar[Refusal] = ContextVar("_refusal", default=lambda _: "")


@contextmanager
def reading_only(refusal: Refusal) -> Iterator[None]:
    """Have this thread read no file that `refusal` refuses, inside the block."""
    token = _refusal.set(refusal)
    try:
        yield
    finally:
        _refusal.reset(token)


def refused(path: Path) -> str:
    """Why this file may not be read now; empty if it may."""
    return _refusal.get()(path)


def readable(path: Path) -> Path:
    """The path of a file that is read next.

    Raises `OSError` if it may not be read now, or if it is there but is no regular file: a pipe or a device could block
    its reader, or never end.
    """
    if problem := refused(path):
        raise PermissionError(errno.EACCES, problem, str(path))
    if os.path.exists(path) and not os.path.isfile(path):
        raise OSError(errno.EINVAL, "it is not a regular file", str(path))
    return path
