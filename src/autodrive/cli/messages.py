"""Writes messages and signals as TypeScript for the page: `scripts/generate-messages`."""

from __future__ import annotations

import sys
from pathlib import Path

from autodrive.base.cache import write_file
from autodrive.base.errors import AutodriveError
from autodrive.protocol.typescript import declarations, signal_tables


def main(folder: Path) -> None:
    """Write `messages.ts` and `channels.ts`. Raises `AutodriveError`."""
    write_file(folder / "messages.ts", declarations())
    write_file(folder / "channels.ts", signal_tables())


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]))
    except AutodriveError as error:
        sys.exit(f"generate-messages: {error}")
