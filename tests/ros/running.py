"""Programs for the tests of ROS: what runs, what it says, and a simulator beside it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from autodrive import Client
from tests.test_cli import Started

ROOT = Path(__file__).parents[2]
PATIENCE = 60.0
"""Wall time for what should take seconds [s]: the machine may be busy."""

T = TypeVar("T")


def await_that(look: Callable[[], T], patience: float = PATIENCE) -> T:
    """What `look` tells, once it is true."""
    deadline = time.monotonic() + patience
    while not (seen := look()):
        assert time.monotonic() < deadline, "it did not come about"
        time.sleep(0.02)
    return seen


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as one:
        return one.getsockname()[1]


class Running:
    """A program of ROS with all that it starts, its words in a file."""

    def __init__(self, environment: dict[str, str], folder: Path, *command: str | Path, **options: Any) -> None:
        self.words = folder / f"{Path(command[0]).name}-{time.monotonic_ns()}.txt"
        with self.words.open("w") as output:
            given = {"stdin": subprocess.DEVNULL, "stdout": output, "stderr": output, "start_new_session": True}
            self.process = subprocess.Popen(
                list(map(str, command)), env=environment | {"ROS_LOG_DIR": str(folder)}, **(given | options)
            )

    def __enter__(self) -> Running:
        return self

    def __exit__(self, *_: object) -> None:
        self.end(signal.SIGINT)

    def end(self, number: signal.Signals) -> None:
        """With that signal; its children with it."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            self.process.wait(20.0)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)


class Witness:
    """A node that tells what it hears, in a Python of its own: the methods of the script's are this one's."""

    def __init__(self, environment: dict[str, str], folder: Path, python: str | Path, script: str) -> None:
        with (folder / "witness.txt").open("a") as words:
            self._process = subprocess.Popen(
                [python, Path(__file__).parent / script],
                env=environment | {"ROS_LOG_DIR": str(folder)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=words,
                text=True,
            )
        assert self._answer() == "ready"

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def ask(*arguments: object) -> Any:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps([name, arguments]) + "\n")
            self._process.stdin.flush()
            is_well, value = self._answer()
            assert is_well, value
            return value

        return ask

    def __enter__(self) -> Witness:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        return json.loads(self._process.stdout.readline())


def simulator(folder: Path, *arguments: str, port: int) -> Started:
    """One that a script may drive, when it can be reached."""
    run = Started(folder, *arguments, "--mode", "autonomous", "--no-browser", "--port", str(port))
    run.wait_for("in a browser:")
    return run


def client(port: int) -> Client:
    """To know better: the simulator's own protocol, each tick."""
    return Client(f"127.0.0.1:{port}", name="test", frame_rate=None, scans=True)
