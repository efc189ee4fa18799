"""Executors: where runs run. All have one interface; the results do not depend on which one it is."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Iterator
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
        self._runs: queue.SimpleQueue[Run | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[Result | BaseException] = queue.SimpleQueue()
        self._pending = 0
        self._is_cancelled = False
        for worker in self.workers:
            threading.Thread(target=self._work, args=(worker,), name="autodrive-campaign", daemon=True).start()

    @property
    def size(self) -> int:
        """Number of worker processes."""
        return len(self.workers)

    def submit(self, run: Run) -> None:
        """Run it as soon as a worker is free."""
        self._pending += 1
        self._runs.put(run)

    def results(self) -> Iterator[Result]:
        """Results as runs end."""
        while self._pending:
            result = self._results.get()
            self._pending -= 1
            if isinstance(result, BaseException):
                raise result
            yield result

    def cancel(self) -> None:
        """End the workers."""
        self._is_cancelled = True
        for worker in self.workers:
            self._runs.put(None)
            worker.close()

    def _work(self, worker: Worker) -> None:
        """Of one worker, in its thread."""
        while (run := self._runs.get()) is not None and not self._is_cancelled:
            try:
                self._results.put(worker.run(run))
            except BaseException as error:  # `results` raises it
                self._results.put(error)
