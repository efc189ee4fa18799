"""Executors: where runs run. All have one interface; the results do not depend on which one it is."""

from __future__ import annotations

import contextlib
import queue
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from typing import Protocol

from autodrive.base.code_snapshot import CodeSnapshot
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.runner import Runner, RunResult
from autodrive.experiments.campaigns.worker import CampaignWorker


class Executor(Protocol):
    """Runs runs in any order, in other processes."""

    @property
    def size(self) -> int:
        """Runs at a time."""
        ...

    @property
    def files(self) -> CampaignFiles:
        """The files that all runs read, whatever has become of them."""
        ...

    def submit(self, run: CampaignRun) -> None:
        """Run it as soon as a process is free."""
        ...

    def results(self) -> Iterator[RunResult]:
        """Results as runs end, until all that were submitted have ended; more may be submitted meanwhile."""
        ...

    def cancel(self) -> None:
        """End all processes; runs that have not ended have no result."""
        ...


class InProcessExecutor:
    """Runs in this process, one at a time: for a debugger, and for campaigns of few runs."""

    size = 1

    def __init__(self, campaign: Campaign, files: CampaignFiles | None = None) -> None:
        """`files`: those of the campaign; None: as they are now. Raises `AutodriveError`."""
        self.files = files or CampaignFiles.of(campaign)
        """What the runs read."""
        self._snapshot = CodeSnapshot(self.files, self.files.data)
        self._stack = contextlib.ExitStack()
        self._stack.callback(self._snapshot.close)
        self._stack.enter_context(self._snapshot.workplace.entered())
        self._runner = Runner(self.files.campaign_in(self._snapshot.root))
        self._stack.callback(self._runner.close)
        self._runs: deque[CampaignRun] = deque()

    def submit(self, run: CampaignRun) -> None:
        """Run it when `results` comes to it."""
        self._runs.append(run)

    def results(self) -> Iterator[RunResult]:
        """Results in the order of the runs."""
        while self._runs:
            with contextlib.chdir(self._snapshot.workplace.directory):
                result = self._runner.run(self._runs.popleft())
            yield _named(result, self._snapshot)

    def cancel(self) -> None:
        """Release the worlds and the copies of the files."""
        self._stack.close()


class LocalExecutor:
    """Worker processes on this machine, which keep their compiled worlds."""

    def __init__(self, campaign: Campaign, workers: int, files: CampaignFiles | None = None) -> None:
        """`files`: those of the campaign; None: as they are now. Raises `AutodriveError`."""
        self.files = files or CampaignFiles.of(campaign)
        """What the runs read."""
        self._snapshot = CodeSnapshot(self.files, self.files.data)
        copy = self.files.campaign_in(self._snapshot.root)
        self.workers = [CampaignWorker(copy, self._snapshot.workplace) for _ in range(workers)]
        self.size = workers
        """Number of worker processes."""
        self._idle = queue.SimpleQueue[CampaignWorker]()
        for worker in self.workers:
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(workers, "autodrive-campaign")
        self._pending: set[Future[RunResult]] = set()

    def submit(self, run: CampaignRun) -> None:
        """Run it as soon as a worker is free."""
        self._pending.add(self._threads.submit(self._run, run))

    def results(self) -> Iterator[RunResult]:
        """Results as runs end."""
        while self._pending:
            ended, self._pending = wait(self._pending, return_when=FIRST_COMPLETED)
            yield from (future.result() for future in ended)

    def cancel(self) -> None:
        """End the workers."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self.workers:
            worker.close()
        self._snapshot.close()

    def _run(self, run: CampaignRun) -> RunResult:
        worker = self._idle.get()
        try:
            return _named(worker.run(run), self._snapshot)
        finally:
            self._idle.put(worker)


def _named(result: RunResult, snapshot: CodeSnapshot) -> RunResult:
    """The result; its error names the originals."""
    return replace(result, error=snapshot.named(result.error))
