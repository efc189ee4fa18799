"""Runs the command line: in this process where possible, in another one for signals, terminals and imports."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

from autodrive.cli import main
from autodrive.cli.stopping import StopSignals
from tests.support.waiting import LIMIT, wait_until

AUTODRIVE = [sys.executable, "-c", "from autodrive.cli import main; main()"]


class Result(NamedTuple):
    """Exit code and output of a command."""

    returncode: int
    stdout: str
    stderr: str


def python(*words: object, limit: float = LIMIT, **options: Any) -> str:
    """What Python in another process prints, which must end without an error. `options`: of `subprocess.run`."""
    command = [sys.executable, *map(str, words)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=limit, **options)
    assert done.returncode == 0, (done.returncode, done.stderr[-3000:])
    return done.stdout


class OutputOfThisThread(io.StringIO):
    """What the thread that made it writes; what other threads write is discarded."""

    def __init__(self) -> None:
        super().__init__()
        self._thread = threading.get_ident()

    def write(self, text: str, /) -> int:
        return super().write(text) if threading.get_ident() == self._thread else len(text)


def call(*arguments: str | Path, cwd: Path | None = None, stderr: io.StringIO | None = None) -> Result:
    """Run a command in this process, which must be its main thread; log lines go to stderr as in a real process."""
    stdout, stderr = io.StringIO(), stderr or io.StringIO()
    root = logging.getLogger()
    handlers, level = root.handlers, root.level
    root.handlers = []
    try:
        with (
            mock.patch.object(sys, "argv", ["autodrive", *map(str, arguments)]),
            contextlib.redirect_stdout(stdout),
            contextlib.redirect_stderr(stderr),
            contextlib.chdir(cwd or Path.cwd()),
        ):
            try:
                main()
            except SystemExit as end:
                code = end.code
            else:
                code = None
    finally:
        root.handlers, root.level = handlers, level
    assert isinstance(code, int)
    return Result(code, stdout.getvalue(), stderr.getvalue())


@contextlib.contextmanager
def interrupted_when(condition: Callable[[], object]) -> Iterator[None]:
    """Sends Ctrl-C to this process, in which `call` runs the command `run`, once the condition is true.

    The process does not end after the signal: other tests need it.
    """
    errors: list[AssertionError] = []

    def watch() -> None:
        try:
            wait_until(condition)
        except AssertionError as error:
            errors.append(error)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=watch)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have started the tests without it
    try:
        with mock.patch.multiple(StopSignals, end=mock.DEFAULT, end_late=mock.DEFAULT):
            thread.start()
            yield
            thread.join()
    finally:
        signal.signal(signal.SIGINT, before)
    if errors:
        raise errors[0]


def refused(*arguments: str | Path, cwd: Path | None = None) -> str:
    """The line that a command with an error prints."""
    # A server that other tests of this process use may log meanwhile.
    done = call(*arguments, cwd=cwd, stderr=OutputOfThisThread())
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("autodrive: ")
    return line


class Started:
    """`autodrive`, or another program, in another process; its output goes to a file so that no pipe fills up."""

    def __init__(self, folder: Path, *arguments: str, program: Sequence[str] = AUTODRIVE) -> None:
        self.messages = folder / "messages"
        with self.messages.open("w") as output:
            self.process = subprocess.Popen(
                [*program, *arguments], stdout=output, stderr=output, start_new_session=True
            )

    def wait_for(self, text: str) -> None:
        wait_until(lambda: text in self.messages.read_text() or self.process.poll() is not None)
        assert text in self.messages.read_text(), self.messages.read_text()

    def end(self, number: signal.Signals) -> int:
        self.process.send_signal(number)
        return self.process.wait(LIMIT)
