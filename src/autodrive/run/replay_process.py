"""Serves a recording in a process of its own, beside the simulation that made it."""

from __future__ import annotations

import pickle
import sys
import threading
from dataclasses import replace
from pathlib import Path

from autodrive.base.child_process import start_module, take_stdout
from autodrive.base.errors import AutodriveError
from autodrive.connect.server.served import PageOptions


class ReplayProcess:
    """Serves a recording with its page at a free port, until `close`."""

    def __init__(self, recording: Path, page: PageOptions) -> None:
        """`page`: its host, token and origins are used. Raises `AutodriveError`."""
        self.recording = recording
        self._process = start_module(__name__, has_children=True)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            pickle.dump((recording, replace(page, port=0)), self._process.stdin)
            self._process.stdin.flush()
            answer = pickle.load(self._process.stdout)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError):
            answer = "the process of the replay has ended"
        if isinstance(answer, str):
            self.close()
            raise AutodriveError(answer)
        self.port: int = answer
        """Port of its page."""

    @property
    def is_running(self) -> bool:
        """Whether it still serves."""
        return self._process.poll() is None

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.wait()


def main() -> None:
    """Read recording and options of the page; write the port, or the error, and serve until stdin closes."""
    from autodrive.recording.replay import Replay, ReplayOptions

    answers = take_stdout()
    recording, page = pickle.load(sys.stdin.buffer)
    try:
        running = Replay(recording, ReplayOptions(page=page))
        running.__enter__()
        answer: int | str = running.server.port
    except AutodriveError as error:
        answer = str(error)
    pickle.dump(answer, answers)
    answers.flush()
    threading.Event().wait()  # `end_with_parent` ends the process
