"""The command line `autodrive`."""

from __future__ import annotations

import os
import signal


def main() -> None:
    """Entry point. Ctrl-C while the commands are imported ends the program without a traceback, with exit code 130."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        try:
            signal.signal(signal.SIGINT, lambda *_: os._exit(130))
        except ValueError:  # only the main thread may set it
            before = None
    else:
        before = None
    from autodrive.cli.app import main as run

    run(before)
