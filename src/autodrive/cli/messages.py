"""Writes the messages as TypeScript for the page and as C++ for the client: `scripts/generate-messages`."""

from __future__ import annotations

import sys
from pathlib import Path

from autodrive.base.cache import write_file
from autodrive.base.errors import AutodriveError
from autodrive.protocol.cpp import header
from autodrive.protocol.typescript import declarations, signal_tables


def main(page: Path, headers: Path) -> None:
    """Write `messages.ts` and `channels.ts` of the page, and `messages.hpp`. Raises `AutodriveError`."""
    write_file(page / "messages.ts", declarations())
    write_file(page / "channels.ts", signal_tables())
    write_file(headers / "messages.hpp", header())


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]), Path(sys.argv[2]))
    except AutodriveError as error:
        sys.exit(f"generate-messages: {error}")
