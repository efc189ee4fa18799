"""Memory that the simulator and its camera worker share, without copying; one class for each kind of platform.

The simulator calls `allocate` and passes `address` to the worker, which calls `attach`.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import sys
import tempfile
import uuid
from typing import Protocol


class SharedMemory(Protocol):
    """A block of memory, filled with zeros."""

    memory: mmap.mmap
    address: str
    """What the worker passes to `attach`."""
    descriptors: tuple[int, ...]
    """File descriptors that the worker must inherit."""

    def detach(self) -> None:
        """Free what only `attach` needs: the worker has attached, or never will. The memory stays mapped."""
        ...


class AnonymousMemory:
    """Linux: a memory file without a name. It disappears with the last process that has it open."""

    def __init__(self, size: int) -> None:
        descriptor = os.memfd_create("autodrive-cameras")
        os.ftruncate(descriptor, size)
        self.memory = mmap.mmap(descriptor, size)
        self.address = f"descriptor:{descriptor}"
        self.descriptors: tuple[int, ...] = (descriptor,)

    def detach(self) -> None:
        """Close the descriptor."""
        for descriptor in self.descriptors:
            os.close(descriptor)
        self.descriptors = ()


class FileMemory:
    """macOS and other POSIX systems: a mapped temporary file, deleted as soon as the worker has attached."""

    descriptors: tuple[int, ...] = ()

    def __init__(self, size: int) -> None:
        descriptor, self._path = tempfile.mkstemp(prefix="autodrive-cameras-")
        try:
            with os.fdopen(descriptor, "r+b") as file:
                file.write(bytes(size))  # a file with holes would end both processes when the disk becomes full
                file.flush()
                self.memory = mmap.mmap(descriptor, size)
        except OSError:
            self.detach()
            raise
        self.address = f"file:{self._path}"

    def detach(self) -> None:
        """Delete the file."""
        with contextlib.suppress(OSError):
            os.unlink(self._path)


class NamedMemory:
    """Windows: named memory backed by the page file. It disappears with the last process that has it open."""

    descriptors: tuple[int, ...] = ()

    def __init__(self, size: int) -> None:
        name = f"autodrive-cameras-{uuid.uuid4().hex}"
        self.memory = _windows_mmap(size, name)
        self.address = f"name:{name}"

    def detach(self) -> None:
        """There is nothing to free."""


def allocate(size: int, platform: str = sys.platform) -> SharedMemory:
    """A new block of `size` [bytes], of the kind that this platform has."""
    if platform == "win32":
        return NamedMemory(size)
    if platform == "linux" and hasattr(os, "memfd_create"):
        return AnonymousMemory(size)
    return FileMemory(size)


def attach(address: str, size: int) -> mmap.mmap:
    """In the worker: map the block that was allocated at that address."""
    kind, _, place = address.partition(":")
    if kind == "name":
        return _windows_mmap(size, place)
    descriptor = int(place) if kind == "descriptor" else os.open(place, os.O_RDWR)
    try:
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)


def _windows_mmap(size: int, name: str) -> mmap.mmap:
    return mmap.mmap(-1, size, tagname=name)  # pyright: ignore[reportCallIssue]  (only Windows has tagname)
