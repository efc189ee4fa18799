"""Attacks: how many cases a test runs, memory and files of a process, hostile clients, and a disk that is soon full."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TypeVar

import pytest

T = TypeVar("T")

LONG = os.environ.get("AUTODRIVE_HARDENING") == "long"
"""Whether the long form of the attacks runs."""


def cases(short: T, long: T) -> T:
    """`short` in the default tests, `long` with AUTODRIVE_HARDENING=long in the environment."""
    return long if LONG else short


def memory(pid: int | str = "self") -> float:
    """Memory of a process [MB]; of this one, what is in use: free memory goes back to the system first."""
    if pid == "self":
        gc.collect()
        # glibc keeps free memory: the resident memory goes up and down by 10 % although nothing is held
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1e3


def open_files(pid: int | str = "self") -> int:
    """Number of open files of a process, with its sockets."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


@contextlib.contextmanager
def attackers(port: int, counts: Mapping[str, int]) -> Iterator[subprocess.Popen[bytes]]:
    """So many hostile clients of each role in `attackers.py`, in a process of their own, after all have connected."""
    words = [sys.executable, str(Path(__file__).with_name("attackers.py")), str(port)]
    words += [f"{role}={count}" for role, count in counts.items()]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        try:
            yield process
            assert process.poll() is None
        finally:
            process.kill()


def mount_or_skip(command: list[str]) -> None:
    """Run a command that mounts a file system; skip the test where that is not possible."""
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True)
    except OSError as error:
        pytest.skip(f"no small file system can be mounted: {error}")
    if done.returncode:
        pytest.skip(f"no small file system can be mounted: {done.stderr.strip()}")


@contextlib.contextmanager
def small_disk(folder: Path, kilobytes: int = 64) -> Iterator[Path]:
    """A file system of that size in a new folder; the test is skipped where none can be mounted."""
    disk = folder / "disk"
    disk.mkdir()
    mount_or_skip(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(disk)])
    try:
        yield disk
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def make_read_only(disk: Path) -> None:
    """For a `small_disk`. The mode of a folder would not do: it does not stop a superuser."""
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)


def fill(file: Path) -> None:
    """Write to a file until its disk is full."""
    with file.open("ab", buffering=0) as output:
        for size in (65536, 1):
            with contextlib.suppress(OSError):
                while True:
                    output.write(bytes(size))
