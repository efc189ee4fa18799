"""Processes of the ROS tests: programs with their output in a file, probe nodes, and a simulator."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from autodrive import Client
from tests.support.waiting import LIMIT, wait_until

ROOT = Path(__file__).parents[3]


class Program:
    """A process in a session of its own; its output goes to a file, so that no pipe fills up."""

    def __init__(
        self, environment: dict[str, str], folder: Path, *command: str | Path, stdin: int | None = None
    ) -> None:
        self._file = folder / f"{Path(command[0]).name}-{time.monotonic_ns()}.txt"
        with self._file.open("w") as output:
            self.process = subprocess.Popen(
                list(map(str, command)),
                env=environment | {"ROS_LOG_DIR": str(folder)},
                stdin=subprocess.DEVNULL if stdin is None else stdin,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def output(self) -> str:
        return self._file.read_text()

    def wait_for(self, text: str) -> None:
        """Wait until the output contains the text."""
        wait_until(lambda: text in self.output or self.process.poll() is not None)
        assert text in self.output, self.output

    def stop(self, number: signal.Signals = signal.SIGINT) -> None:
        """Stop the process with this signal, and kill its children."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            self.process.wait(LIMIT)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)


class Probe:
    """A plain ROS node in its own Python process; its methods are those of the class in the script."""

    def __init__(self, environment: dict[str, str], folder: Path, python: str | Path, script: str) -> None:
        self._errors = folder / "probe.txt"
        with self._errors.open("a") as errors:
            self._process = subprocess.Popen(
                [python, Path(__file__).parent / script],
                env=environment | {"ROS_LOG_DIR": str(folder)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
            )
        assert self._answer() == "ready"

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*arguments: object) -> Any:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps([name, arguments]) + "\n")
            self._process.stdin.flush()
            succeeded, value = self._answer()
            assert succeeded, value
            return value

        return call

    def __enter__(self) -> Probe:
        return self

    def __exit__(self, *_: object) -> None:
        """End the process: at the end of its input it leaves ROS, which removes its shared memory."""
        try:
            self._process.communicate(timeout=10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, f"the probe has ended:\n{self._errors.read_text()}"
        return json.loads(line)


def simulator(folder: Path, *arguments: str, port: int) -> Program:
    """`autodrive run` in autonomous mode, once it can be reached at the port."""
    command = [str(Path(sys.executable).with_name("autodrive")), "run", *arguments]
    command += ["--mode", "autonomous", "--no-browser", "--port", str(port)]
    program = Program(dict(os.environ), folder, *command)
    program.wait_for(f":{port}")
    return program


def client(port: int) -> Client:
    """A native client that receives the Frame of each tick: the reference for the messages of ROS."""
    return Client(f"127.0.0.1:{port}", name="test", frame_rate=None, scans=True, timeout=LIMIT)
