"""Runs a campaign: feeds an executor, reuses what is known, keeps what is done, and writes table, summary, report."""

from __future__ import annotations

import itertools
import json
import logging
import os
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from autodrive.base.cache import make_folder, write_file
from autodrive.base.child_process import cpu_count
from autodrive.base.errors import AutodriveError
from autodrive.base.texts import encodable, with_encodable_texts
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.executor import Executor, InProcessExecutor, LocalExecutor
from autodrive.experiments.campaigns.keys import RowCache, RunKeys
from autodrive.experiments.campaigns.runner import RunResult
from autodrive.experiments.campaigns.table import Table, locked

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

log = logging.getLogger(__name__)

AHEAD = 2
"""Runs that wait for each process, so that none is idle."""


@dataclass
class CampaignProgress:
    """How far a campaign is."""

    total: int
    done: int = 0
    """Rows in the table."""
    reused: int = 0
    """Number of rows that were known before."""
    failures: int = 0
    errors: int = 0

    def count(self, status: str) -> None:
        """Count one more row."""
        self.done += 1
        self.failures += status == "fail"
        self.errors += status == "error"


class CampaignObserver:
    """Called while a campaign runs; a subclass overrides what it needs."""

    def progress(self, progress: CampaignProgress) -> None:
        """A row was added."""


@dataclass(frozen=True)
class Outcome:
    """What a campaign gave."""

    folder: Path
    summary: dict[str, Any]
    """Numbers of the campaign, as in `summary.json`."""
    is_complete: bool
    """False if it was stopped before all runs had ended."""

    @property
    def table(self) -> Path:
        """The table."""
        return self.folder / "table.parquet"

    @property
    def report(self) -> Path:
        """The report."""
        return self.folder / "report.html"


RESULT_FILES = ("table.parquet", "summary.json", "report.html")
"""Files with the results of a campaign, in its folder, once it has ended."""
OWNER = ".campaign"
"""File in the folder of the results: path of the campaign's file from there."""


def run_campaign(
    campaign: Campaign,
    output: str | Path | None = None,
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    cache: RowCache | None = None,
    uses_cache: bool = True,
    overwrites: bool = False,
    observer: CampaignObserver | None = None,
) -> Outcome:
    """Run a campaign into a folder (NAME_results if left out); runs that this folder or the cache has are not repeated.

    `executor`: where the runs run; None: `workers` processes of this machine (as many as it has processors; 0: in this
    process). All runs use driver, metrics and files as they are now. `overwrites`: results of another campaign in the
    folder are replaced. Ctrl-C ends it: what is done is kept, and the outcome is not complete. Raises `AutodriveError`.
    """
    folder = Path(output or f"{campaign.name}_results")
    make_folder(folder)
    with locked(folder):
        if (others := results_of_others(campaign, folder)) and not overwrites:
            raise AutodriveError(
                "the folder has the results of another campaign: choose another folder, or overwrite the results  "
                f"({others[0]})"
            )
        files = executor.files if executor else CampaignFiles.of(campaign)
        cache = (cache or RowCache()) if uses_cache else None
        progress, observer = CampaignProgress(len(campaign)), observer or CampaignObserver()
        running = _RunningCampaign(campaign, folder, RunKeys(files), progress, observer, cache)
        write_file(folder / OWNER, _owner(campaign, folder))
        if (places := files.opaque) and uses_cache:
            log.warning(
                "results of runs are reused even if this code has changed: name the files of the code in 'files'  (%s)",
                places,
            )
        return running.outcome(running.results(executor, lambda: local_executor(campaign, workers, files)))


def run_search(
    campaign: Campaign,
    trials: int,
    output: str | Path | None,
    executor: Executor,
    observer: CampaignObserver | None = None,
) -> Outcome:
    """Search for a failure of the driver, see `falsify`; the table has all runs. Raises `AutodriveError`."""
    from autodrive.experiments.campaigns.search import falsify  # noqa: PLC0415  an extra

    folder = Path(output or f"{campaign.name}_search")
    make_folder(folder)
    with locked(folder):
        write_file(folder / OWNER, "search")
        progress, observer = CampaignProgress(trials), observer or CampaignObserver()
        running = _RunningCampaign(campaign, folder, RunKeys(executor.files), progress, observer)
        trials_run = falsify(campaign, executor, trials=trials)
        return running.outcome((trial.run, running.keys.of(trial.run), trial.result) for trial in trials_run)


Done: TypeAlias = tuple[CampaignRun, str, RunResult]
"""A run that has ended, its key and its result."""


@dataclass
class _RunningCampaign:
    """A campaign or search that runs: its table in a folder, and how far it is."""

    campaign: Campaign
    folder: Path
    keys: RunKeys
    progress: CampaignProgress
    observer: CampaignObserver
    cache: RowCache | None = None
    """Results of other campaigns; None: they are not used."""

    def __post_init__(self) -> None:
        self._table = Table(self.folder, self.campaign)
        self._earlier = self._table.start()
        self._uncached: list[tuple[str, RunResult]] = []
        self._numbers = iter(range(len(self.campaign)))
        self._is_stopped = False

    def results(self, executor: Executor | None, start: Callable[[], Executor]) -> Generator[Done]:
        """Run what is not known, and add the rows of what is known; `start` makes the executor if there is none."""
        new_runs, submitted = self._new_runs(), dict[int, tuple[CampaignRun, str]]()

        def submit(executor: Executor, count: int) -> None:
            for run, key in itertools.islice(new_runs, count):
                submitted[run.number] = run, key
                executor.submit(run)

        try:
            if (first := next(new_runs, None)) is not None:
                executor, new_runs = executor or start(), itertools.chain([first], new_runs)
                submit(executor, AHEAD * executor.size)
                for result in executor.results():
                    submit(executor, 1)
                    yield *submitted.pop(result.number), result
        finally:
            if executor is not None:
                executor.cancel()
            self._is_stopped = True
            for _ in self._new_runs():  # rows of an earlier campaign that it had not come to stay in the table
                pass

    def outcome(self, results: Generator[Done]) -> Outcome:
        """Add all rows, or those until Ctrl-C, and write table, summary and report."""
        is_complete = False
        try:
            with closing(results):
                for run, key, result in results:
                    self._uncached.append((key, result))
                    self._add(run, key, result)
            is_complete = True
        except KeyboardInterrupt:
            pass
        finally:
            self._flush()
            if self.cache is not None:
                self.cache.close()
        from autodrive.experiments.campaigns.report import report  # noqa: PLC0415  after the runs
        from autodrive.experiments.campaigns.statistics import summary  # noqa: PLC0415  it needs scipy

        rows = self._table.finish()
        numbers = summary(self.campaign, rows)
        write_file(self.folder / "summary.json", json.dumps(with_encodable_texts(numbers), indent=2) + "\n")
        write_file(self.folder / "report.html", report(self.campaign, rows, numbers))
        return Outcome(self.folder, numbers, is_complete)

    def _add(self, run: CampaignRun, key: str, result: RunResult) -> None:
        self.progress.count(self._table.add(run, key, result)["status"])
        if self._table.is_due:
            self._flush()
        self.observer.progress(self.progress)

    def _flush(self) -> None:
        self._table.write_part()
        if self.cache is not None:
            self.cache.add(self._uncached)
        self._uncached.clear()

    def _new_runs(self) -> Iterator[tuple[CampaignRun, str]]:
        """The runs that must run, and their keys; the rows of those that are known are added."""
        for number in self._numbers:
            if self._is_stopped and self._earlier.get(number) is None:
                continue
            run = self.campaign.run(number)
            if self.campaign.spec.record != "none":
                run = replace(run, recording=str((self.folder / "recordings" / recording_name(number)).absolute()))
            key = self.keys.of(run)
            if (result := self._known(run, key)) is None:
                yield run, key
            else:
                self.progress.reused += 1
                self._add(run, key, result)

    def _known(self, run: CampaignRun, key: str) -> RunResult | None:
        """The result of a run in the folder or the cache; None if there is none, or if its recording is missing."""
        row = self._earlier.get(run.number)
        if row is not None and row["key"] == key and not row["error"]:
            result = _result(row, self.campaign)
        else:
            result = None if self.cache is None else self.cache.get(key, run.number)
        if result is None or not self.campaign.keeps_recording(result.metrics):
            return result
        file = self.folder / "recordings" / recording_name(run.number)
        return replace(result, recording=file.name) if file.is_file() else None


def local_executor(campaign: Campaign, workers: int | None, files: CampaignFiles | None = None) -> Executor:
    """Worker processes: as many as there are processors by default; with 0 in this process.

    `files`: those of the campaign; None: as they are now. Raises `AutodriveError`.
    """
    workers = cpu_count() if workers is None else workers
    return LocalExecutor(campaign, workers, files) if workers else InProcessExecutor(campaign, files)


def recording_name(number: int) -> str:
    """File of the recording of a run."""
    return f"run_{number:06d}.mcap"


def results_of_others(campaign: Campaign, folder: Path) -> list[Path]:
    """The files in a folder that are results of a search or of another campaign; empty if this one continues them."""
    files = [
        *(folder / name for name in RESULT_FILES),
        *folder.glob("parts/*.parquet"),
        *folder.glob("earlier/*.parquet"),
    ]
    try:
        is_own = (folder / OWNER).read_text(encoding="utf-8") == _owner(campaign, folder)
    except (OSError, ValueError):
        try:  # an earlier version has written them
            is_own = json.loads((folder / "summary.json").read_bytes())["campaign"] == campaign.name
        except FileNotFoundError:
            is_own = True
        except (OSError, ValueError, TypeError, KeyError):
            is_own = False
    return [] if is_own else [file for file in files if file.is_file()]


def _owner(campaign: Campaign, folder: Path) -> str:
    """The path of a campaign's file from the folder of its results."""
    try:
        return encodable(os.path.relpath(campaign.path or campaign.name, folder))
    except ValueError:  # on another drive
        return encodable(os.path.abspath(campaign.path or campaign.name))


def _result(row: dict[str, Any], campaign: Campaign) -> RunResult:
    """The result that a row of a table was made of."""
    nan = float("nan")
    metrics = {name: nan if row.get(name) is None else row[name] for name in campaign.metric_names}
    return RunResult(row["run"], metrics, row["end"], row["time"], row["digest"])
