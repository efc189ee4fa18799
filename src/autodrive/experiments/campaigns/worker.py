"""Worker processes: a run that hangs or ends its process costs one worker, which is started again."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import pickle
import subprocess
import sys
import time
from typing import Any

from autodrive.base.child_process import start_module, take_stdout
from autodrive.base.code_snapshot import Workplace
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun
from autodrive.experiments.campaigns.runner import Runner, RunResult

TRIES = 2
"""A run that ends its process is run so often: something else may have ended it."""

LATE = 1
"""Exit code of a process whose run did not end within the limit: that of `faulthandler`."""
END_TIME = 5.0
"""A process that has closed its pipes and has not ended after that time is killed [s]."""


class CampaignWorker:
    """A process that runs runs of one campaign, one at a time; it starts with the first run."""

    def __init__(self, campaign: Campaign, workplace: Workplace) -> None:
        """`campaign`: with the paths of the copies in `workplace`."""
        self._campaign, self._workplace = campaign, workplace
        self._process: subprocess.Popen[Any] | None = None
        self._is_closed = False

    def run(self, run: CampaignRun) -> RunResult:
        """The result of a run; an error if it does not end within the limit or ends its process."""
        limit = self._campaign.spec.time_limit
        for _ in range(TRIES):
            if self._is_closed:
                break
            start = time.monotonic()
            try:
                return self._answer(run)
            except (EOFError, OSError, pickle.UnpicklingError):
                code = self._end()
                if code == LATE and time.monotonic() - start >= limit:
                    return RunResult(run.number, error=f"the run did not end within {limit:g} s of wall time")
        return RunResult(run.number, error="the process of the run ended before the run")

    def close(self) -> None:
        """Kill the process; may be called from another thread, whose run then has an error."""
        self._is_closed = True
        if (process := self._process) is not None:
            process.terminate()
        self._end()

    @property
    def pid(self) -> int | None:
        """Id of the process, or of its keeper; None if there is none."""
        return None if self._process is None else self._process.pid

    def _answer(self, run: CampaignRun) -> RunResult:
        if self._process is None:
            self._process = start_module("autodrive.experiments.campaigns.worker", has_children=True)
            if self._is_closed:  # meanwhile
                self._process.terminate()
            self._send((self._campaign, self._workplace))
        self._send(run)
        assert self._process.stdout is not None
        return pickle.load(self._process.stdout)

    def _send(self, message: Any) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        pickle.dump(message, self._process.stdin, pickle.HIGHEST_PROTOCOL)
        self._process.stdin.flush()

    def _end(self) -> int | None:
        """Free a process that has ended or is ending; its exit code."""
        process, self._process = self._process, None
        if process is None:
            return None
        try:
            process.wait(END_TIME)
        except subprocess.TimeoutExpired:
            process.terminate()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        return process.wait()


def main() -> None:
    """Answer runs until stdin closes."""
    answers = take_stdout()
    campaign: Campaign
    workplace: Workplace
    campaign, workplace = pickle.load(sys.stdin.buffer)
    runner, limit = Runner(campaign), campaign.spec.time_limit
    os.chdir(workplace.directory)
    with workplace.entered(), contextlib.suppress(EOFError):
        while True:
            run = pickle.load(sys.stdin.buffer)
            # It works also if the driver never lets another thread run, and if the campaign has been killed.
            result = runner.run(run, started=lambda: faulthandler.dump_traceback_later(limit, exit=True))
            faulthandler.cancel_dump_traceback_later()
            pickle.dump(result, answers, pickle.HIGHEST_PROTOCOL)
            answers.flush()
    os._exit(0)  # threads of a driver do not matter
