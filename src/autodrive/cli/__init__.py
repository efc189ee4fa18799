"""The command line `autodrive`."""

from __future__ import annotations

import os
import signal
import sys


def main() -> None:
    """Entry point. Ctrl-C while the commands are imported ends the program without a traceback, with exit code 130."""
    _open_missing_streams()
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


def _open_missing_streams() -> None:
    """A stream that the shell has closed discards what is written; no other file may get its number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115  for the whole process
