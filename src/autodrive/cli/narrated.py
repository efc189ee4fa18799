"""Says what goes on while a command is silent. It is light, because it runs while everything else is imported."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

SILENCE = 3.0
"""Without a terminal, a start that takes long prints a line in this time [s]."""


@contextmanager
def narrated(text: str) -> Iterator[None]:
    """Inside the `with` block, print the text with the seconds to stderr every `SILENCE`."""
    is_done = threading.Event()
    began = time.monotonic()

    def narrate() -> None:
        while not is_done.wait(SILENCE):
            print(f"{text}, {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)

    threading.Thread(target=narrate, name="autodrive-narrator", daemon=True).start()
    try:
        yield
    finally:
        is_done.set()
