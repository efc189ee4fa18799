"""Attacks: how many cases a test runs, and a disk that is soon full."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import pytest

T = TypeVar("T")

LONG = os.environ.get("AUTODRIVE_HARDENING") == "long"
"""Whether the long form of the attacks runs."""


def cases(short: T, long: T) -> T:
    """`short` in the default tests, `long` with AUTODRIVE_HARDENING=long in the environment."""
    return long if LONG else short


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


def fill(file: Path) -> None:
    """Write to a file until its disk is full."""
    with file.open("ab", buffering=0) as output:
        for size in (65536, 1):
            with contextlib.suppress(OSError):
                while True:
                    output.write(bytes(size))
