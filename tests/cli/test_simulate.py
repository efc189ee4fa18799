"""`autodrive.run.simulate`: from Python, without terminal, main thread or signal handlers."""

from __future__ import annotations

import json
import signal
import socket
import threading
from pathlib import Path

import pytest

from autodrive import AutodriveError
from autodrive.run import PageOptions, Run, RunObserver, RunOptions, StopRequest, Summary, simulate


def in_thread(options: RunOptions, stop: StopRequest | None = None, observer: RunObserver | None = None) -> Summary:
    """`simulate` in a thread that is not the main thread; raises what it raises."""
    outcome: list[Summary | Exception] = []

    def run() -> None:
        try:
            outcome.append(simulate(options, stop=stop, observer=observer))
        except Exception as error:
            outcome.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    if isinstance(outcome[0], Exception):
        raise outcome[0]
    return outcome[0]


def test_a_run_in_a_thread_twice_with_errors_between(tmp_path: Path) -> None:
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    file = tmp_path / "summary.json"
    first = in_thread(RunOptions("plane", speed=None, has_page=False, duration=0.2, seed=3, summary=file))
    with pytest.raises(AutodriveError, match="Did you mean 'plane'"):
        in_thread(RunOptions("plan", has_page=False))
    with pytest.raises(AutodriveError, match="cannot write"):
        in_thread(RunOptions("plane", has_page=False, summary=tmp_path / "missing" / "summary.json"))
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(AutodriveError, match=f"port {port}"):
            in_thread(RunOptions("plane", page=PageOptions(port=port)))
    second = in_thread(RunOptions("plane", speed=None, has_page=False, duration=0.2, seed=3))
    assert (first.ticks, first.seed, first.ended_by, first.page) == (20, 3, "duration", None)
    assert second.vehicles == first.vehicles  # same seed: the same bits
    assert json.loads(file.read_text()) == first.as_dict()
    assert file.read_text() == first.to_json()
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers


def test_a_stop_request_ends_a_run_without_duration() -> None:
    stop = StopRequest()

    class StopWhenRunning(RunObserver):
        def running(self, run: Run) -> None:
            if run.simulation.ticks:
                stop.set("enough")
                stop.set("too late")

    summary = in_thread(RunOptions("plane", has_page=False), stop, StopWhenRunning())
    assert summary.ended_by == "enough"
    assert summary.ticks > 0
