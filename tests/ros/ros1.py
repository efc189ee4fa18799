"""ROS 1 for tests: the packages built, a master, launched files, and a node that tells what it hears."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from xmlrpc.client import ServerProxy

import pytest

from autodrive import Client
from tests.test_cli import Started

ROOT = Path(__file__).parents[2]
WORKSPACE = ROOT / "build" / "ros1"
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


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """Of a terminal in which the packages are built and sourced."""
    if shutil.which("roscore", path="/usr/bin") is None or shutil.which("catkin_make", path="/usr/bin") is None:
        pytest.skip("ROS 1 is not installed: scripts/ros1")
    subprocess.run([ROOT / "scripts" / "ros1", "--headless", "true"], check=True, timeout=600)
    return sourced()


def sourced() -> dict[str, str]:
    """What a terminal has after `. build/ros1/devel/setup.sh`, with a master of its own."""
    own = {"HOME", "LANG", "TMPDIR"}
    plain = {name: value for name, value in os.environ.items() if name in own} | {"PATH": "/usr/bin:/bin:/usr/sbin"}
    source = f". {WORKSPACE}/devel/setup.sh && env -0"
    told = subprocess.run(["sh", "-c", source], env=plain, capture_output=True, text=True, check=True).stdout
    variables = dict(line.split("=", 1) for line in told.split("\0") if line)
    return variables | {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}", "ROS_IP": "127.0.0.1"}


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


def master(environment: dict[str, str], folder: Path) -> Running:
    """roscore, when it answers."""
    port = environment["ROS_MASTER_URI"].rsplit(":", 1)[1]
    running = Running(environment, folder, "roscore", "-p", port)

    def answers() -> bool:
        with contextlib.suppress(OSError):
            return ServerProxy(environment["ROS_MASTER_URI"]).hasParam("/test", "/run_id")[2]  # type: ignore[index]
        return False

    await_that(answers)
    return running


class Witness:
    """The node of ros1_witness.py: its methods are this one's."""

    def __init__(self, environment: dict[str, str], folder: Path) -> None:
        script = Path(__file__).parent / "ros1_witness.py"
        with (folder / "witness.txt").open("a") as words:
            self._process = subprocess.Popen(
                ["/usr/bin/python3", script],
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

    def close(self) -> None:
        self._process.kill()
        self._process.wait()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        return json.loads(self._process.stdout.readline())


@contextlib.contextmanager
def witness(environment: dict[str, str], folder: Path) -> Iterator[Witness]:
    one = Witness(environment, folder)
    try:
        yield one
    finally:
        one.close()


def simulator(folder: Path, *arguments: str, port: int) -> Started:
    """One that a script may drive, when it can be reached."""
    run = Started(folder, *arguments, "--mode", "autonomous", "--no-browser", "--port", str(port))
    run.wait_for("in a browser:")
    return run


def client(port: int) -> Client:
    """To know better: the simulator's own protocol, each tick."""
    return Client(f"127.0.0.1:{port}", name="test", frame_rate=None, scans=True)


class Stage(NamedTuple):
    """A master and a simulator for all tests."""

    environment: dict[str, str]
    folder: Path
    master: list[Running]
    simulator: list[Started]
    port: int


@pytest.fixture(scope="session")
def stage(environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("ros1")
    port = free_port()
    run = simulator(folder, "mini_map", port=port)
    one = Stage(environment, folder, [master(environment, folder)], [run], port)
    try:
        yield one
    finally:
        one.simulator[0].end(signal.SIGTERM)
        one.master[0].end(signal.SIGINT)


def launched(stage: Stage, *arguments: str, **options: Any) -> Running:
    return Running(stage.environment, stage.folder, "roslaunch", "autodrive_ros", *arguments, **options)
