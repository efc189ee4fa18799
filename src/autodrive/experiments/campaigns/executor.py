"""Executors: where runs run. All have one interface; the results do not depend on which one it is."""

from __future__ import annotations

import queue
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from typing import Protocol

from autodrive.experiments.campaigns.campaign import Campaign, Run
from autodrive.experiments.campaigns.runner import Result, Runner
from autodrive.experiments.campaigns.worker import Worker


class Executor(Protocol):
    """Runs runs in any order, in other processes."""

    @property
    def size(self) -> int:
        """Runs at a time."""
        ...

    def submit(self, run: Run) -> None:
        """Run it as soon as a process is free."""
        ...

    def results(self) -> Iterator[Result]:
        """Results as runs end, until all that were submitted have ended; more may be submitted meanwhile."""
        ...

    def cancel(self) -> None:
        """End all processes; runs that have not ended have no result."""
        ...


class InProcessExecutor:
    """Runs in this process, one at a time: for a debugger, and for campaigns of few runs."""

    size = 1

    def __init__(self, campaign: Campaign) -> None:
        self._runner = Runner(campaign)
        self._runs: deque[Run] = deque()

    def submit(self, run: Run) -> None:
        """Run it when `results` comes to it."""
        self._runs.append(run)

    def results(self) -> Iterator[Result]:
        """Results in the order of the runs."""
        while self._runs:
            yield self._runner.run(self._runs.popleft())

    def cancel(self) -> None:
        """Release the worlds."""
        self._runner.close()


class LocalExecutor:
    """Worker processes on this machine, which keep their compiled worlds."""

    def __init__(self, campaign: Campaign, workers: int) -> None:
        campaign = replace(campaign)  # without what it has computed, which the workers would receive
        self.workers = [Worker(campaign) for _ in range(workers)]
        self.size = workers
        """Number of worker processes."""
        self._idle = queue.SimpleQueue[Worker]()
        for worker in self.workers:
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(workers, "autodrive-campaign")
        self._pending: set[Future[Result]] = set()

    def submit(self, run: Run) -> None:
        """Run it as soon as a worker is free."""
        self._pending.add(self._threads.submit(self._run, run))

    def results(self) -> Iterator[Result]:
        """Results as runs end."""
        while self._pending:
            ended, self._pending = wait(self._pending, return_when=FIRST_COMPLETED)
            yield from (one.result() for one in ended)

    def cancel(self) -> None:
        """End the workers."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self.workers:
            worker.close()

    def _run(self, run: Run) -> Result:
        worker = self._idle.get()
        try:
            return worker.run(run)
        finally:
            self._idle.put(worker)
