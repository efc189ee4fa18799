"""Worker processes and the memory that they share, without drawing anything."""

from __future__ import annotations

import mmap
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from autodrive.graphics.cameras.adaptive_renderer import TRIAL, is_too_slow
from autodrive.graphics.cameras.shared_memory import AnonymousMemory, FileMemory, SharedMemory, allocate, attach
from autodrive.graphics.cameras.worker import Failed, Ready, Worker, popen_options
from autodrive.graphics.render.quality import PROFILES
from tests.support.waiting import is_alive, wait_until

ROOT = Path(__file__).parents[3]


def echo_worker() -> Worker[Ready | Failed]:
    worker: Worker[Ready | Failed] = Worker("tests.support.echo_worker", messages=Ready | Failed)
    worker.send_setup({"answer": 42})
    return worker


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch) -> Iterator[Worker[Ready | Failed]]:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    started = echo_worker()
    yield started
    started.close()


@pytest.mark.process
def test_a_worker_gets_its_set_up_and_answers_each_request_and_ends_when_asked(worker: Worker[Ready | Failed]) -> None:
    assert worker.receive() == Ready("{'answer': 42}")
    for text in ("first", "second\nline"):
        worker.send(Ready(text))
        assert worker.receive() == Ready(text)
    worker.request_end()
    assert worker.receive() is None
    assert worker.exit_status() == "exit code 0"
    worker.send(Ready("too late"))
    worker.close()
    assert worker.receive() is None


@pytest.mark.process
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("expected error", "an error of ours"),
        ("unexpected error", "echoes are unavailable: ZeroDivisionError: by zero"),
    ],
)
def test_an_exception_in_the_worker_is_reported_in_one_line(
    text: str, reason: str, worker: Worker[Ready | Failed]
) -> None:
    worker.receive()
    worker.send(Ready(text))
    assert worker.receive() == Failed(reason)
    assert worker.receive() is None


@pytest.mark.process
def test_a_killed_worker_is_reported_and_leaves_nothing_behind(worker: Worker[Ready | Failed]) -> None:
    worker.receive()
    descriptors = len(os.listdir("/proc/self/fd"))
    worker.kill()
    assert worker.receive() is None
    assert worker.exit_status() == "SIGKILL"
    worker.close()
    worker.close()
    assert not is_alive(worker.pid)
    assert len(os.listdir("/proc/self/fd")) == descriptors - 2


@pytest.mark.process
def test_if_the_simulator_is_killed_the_worker_ends_too() -> None:
    program = (
        "import time\nfrom tests.graphics.cameras.test_worker import echo_worker\n"
        "worker = echo_worker()\nworker.receive()\n"
        "print(worker.pid, flush=True)\ntime.sleep(1000)"
    )
    simulator = subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert simulator.stdout is not None
    with simulator.stdout as stdout:
        pid = int(stdout.readline())
    assert is_alive(pid)
    simulator.kill()
    simulator.wait()
    wait_until(lambda: not is_alive(pid))


def test_popen_options_by_platform() -> None:
    assert popen_options([7], "linux") == popen_options([7], "darwin") == {"start_new_session": True, "pass_fds": [7]}
    if sys.platform == "win32":
        flags = subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.BELOW_NORMAL_PRIORITY_CLASS
    else:  # the documented values of these flags
        flags = 0x00000200 | 0x00004000
    assert popen_options([], "win32") == {"creationflags": flags}


# -- shared memory ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [AnonymousMemory, FileMemory])
def test_what_one_side_writes_the_other_side_reads(kind: Callable[[int], SharedMemory]) -> None:
    shared = kind(10_000)
    other = attach(_inherited(shared), 10_000)
    shared.detach()
    shared.detach()
    assert other[:] == bytes(10_000)
    shared.memory[9_990:] = b"0123456789"
    other[:3] = b"abc"
    assert other[9_990:] == b"0123456789"
    assert shared.memory[:3] == b"abc"
    if kind is FileMemory:
        assert not Path(shared.address.removeprefix("file:")).exists()


def _inherited(shared: SharedMemory) -> str:
    """The address with a duplicate of the descriptor, as a child process has one."""
    kind, _, place = shared.address.partition(":")
    return f"{kind}:{os.dup(int(place))}" if kind == "descriptor" else shared.address


def test_memory_without_a_file_is_used_on_linux_and_a_file_on_other_posix_systems() -> None:
    for platform, kind in (("linux", AnonymousMemory), ("darwin", FileMemory)):
        shared = allocate(mmap.PAGESIZE, platform)
        shared.detach()
        assert isinstance(shared, kind)


# -- the choice of quality ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("drawn", "draw_time", "period", "count", "expected"),
    [
        ("software-fxaa", 0.050, 1 / 30, TRIAL, True),
        ("software-fxaa", 0.050, 1 / 30, TRIAL - 1, False),  # too few to decide
        ("software-fxaa", 0.020, 1 / 30, TRIAL, False),
        ("software-fxaa", 0.020, 0.0, TRIAL, True),  # as fast as possible
        ("software", 0.050, 1 / 30, TRIAL, False),  # edges are not smoothed any more
        ("gpu", 0.050, 1 / 30, TRIAL, False),
    ],
)
def test_edges_are_not_smoothed_where_that_takes_longer_than_the_period(
    drawn: str, draw_time: float, period: float, count: int, expected: bool
) -> None:
    assert is_too_slow(PROFILES[drawn], [draw_time] * count, period) == expected
