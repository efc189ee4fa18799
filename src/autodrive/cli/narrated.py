"""Says what goes on while a command is silent. It is light, because it runs while everything else is imported."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

SILENCE = 3.0
"""Time after which a start prints a line, without a terminal [s]."""


@contextmanager
def narrated(text: str) -> Iterator[None]:
    """Inside the `with` block, print the text with the seconds to stderr every `SILENCE`."""
    began = time.monotonic()

    def narrate() -> None:
        print(f"{text}, {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)

    with repeated(narrate, SILENCE):
        yield


@contextmanager
def repeated(say: Callable[[], object], interval: float) -> Iterator[None]:
    """Inside the `with` block, call `say` in another thread every `interval` [s]."""
    is_done = threading.Event()

    def narrate() -> None:
        while not is_done.wait(interval):
            say()

    threading.Thread(target=narrate, name="autodrive-narrator", daemon=True).start()
    try:
        yield
    finally:
        is_done.set()
