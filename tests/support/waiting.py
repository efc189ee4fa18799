"""Waits for conditions in tests: the limit is generous, because the machine may be busy."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

LIMIT = 180.0
"""Wall time [s]; a test that passes needs a small part of it, also where code is compiled on first use."""

T = TypeVar("T")


def wait_until(condition: Callable[[], T], limit: float = LIMIT) -> T:
    """The first true value of `condition`."""
    deadline = time.monotonic() + limit
    while not (value := condition()):
        assert time.monotonic() < deadline, f"the condition did not become true within {limit:g} s"
        time.sleep(0.003)
    return value


def free_port() -> int:
    """A TCP port that is not in use."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


def is_listening(port: int) -> bool:
    """Whether a server listens at the port of this machine."""
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


def is_alive(pid: int) -> bool:
    """Whether that process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
