"""Runs a campaign: feeds an executor, reuses what is known, keeps what is done, and writes table, summary, report."""

from __future__ import annotations

import json
import logging
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    from collections.abc import Iterator

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
                f"the folder has the results of another campaign: choose another one, or overwrite them  ({others[0]})"
            )
        table = Table(folder, campaign)
        cache = (cache or RowCache()) if uses_cache else None
        observer, progress = observer or CampaignObserver(), CampaignProgress(len(campaign))
        batch: list[tuple[str, RunResult]] = []
        earlier = table.start()
        files = executor.files if executor else CampaignFiles.of(campaign)
        write_file(folder / OWNER, _owner(campaign, folder))
        if (places := files.opaque) and uses_cache:
            log.warning("rows are reused even if other code is run there: name its files in 'files'  (%s)", places)
        keys, key_of = RunKeys(files), dict[int, tuple[CampaignRun, str]]()
        numbers = iter(range(len(campaign)))

        def add(run: CampaignRun, key: str, result: RunResult, *, is_new: bool) -> None:
            row = table.add(run, key, result)
            progress.count(row["status"])
            progress.reused += not is_new
            if is_new:
                batch.append((key, result))
            if table.is_due:
                flush()
            observer.progress(progress)

        def flush() -> None:
            table.write_part()
            if cache is not None:
                cache.add(batch)
            batch.clear()

        def reused(run: CampaignRun, key: str) -> RunResult | None:
            row = earlier.get(run.number)
            if row is not None and row["key"] == key and not row["error"]:
                result = _result(row, campaign)
            else:
                result = None if cache is None else cache.get(key, run.number)
            file = folder / "recordings" / recording_name(run.number)
            if result is None or not campaign.keeps_recording(result.metrics):
                return result
            return replace(result, recording=file.name) if file.is_file() else None

        def new_runs() -> Iterator[CampaignRun]:
            """The runs that must run; those that are known are added."""
            for number in numbers:
                if is_stopped and earlier.get(number) is None:
                    continue
                run = campaign.run(number)
                if campaign.spec.record != "none":
                    file = folder / "recordings" / recording_name(number)
                    run = CampaignRun(run.number, run.sample, run.seed, run.values, str(file.absolute()))
                key = keys.of(run)
                if (result := reused(run, key)) is not None:
                    add(run, key, result, is_new=False)
                else:
                    key_of[number] = run, key
                    yield run

        is_complete, is_stopped, runs = False, False, new_runs()
        try:
            first = next(runs, None)
            if first is not None:
                executor = executor or local_executor(campaign, workers, files)
                executor.submit(first)
                _feed(executor, runs, AHEAD * executor.size - 1)
                for result in executor.results():
                    _feed(executor, runs, 1)
                    add(*key_of.pop(result.number), result, is_new=True)
            is_complete = True
        except KeyboardInterrupt:
            pass
        finally:
            if executor is not None:
                executor.cancel()
            is_stopped = True
            for _ in new_runs():  # rows of an earlier campaign that it had not come to stay in the table
                pass
            flush()
            if cache is not None:
                cache.close()
        return _finish(campaign, folder, table, is_complete)


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
        table, keys = Table(folder, campaign), RunKeys(executor.files)
        table.start()
        observer, progress, is_complete = observer or CampaignObserver(), CampaignProgress(trials), False
        try:
            for trial in falsify(campaign, executor, trials=trials):
                progress.count(table.add(trial.run, keys.of(trial.run), trial.result)["status"])
                observer.progress(progress)
            is_complete = True
        except KeyboardInterrupt:
            pass
        return _finish(campaign, folder, table, is_complete)


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


def _feed(executor: Executor, runs: Iterator[CampaignRun], count: int) -> None:
    for _ in range(count):
        if (run := next(runs, None)) is not None:
            executor.submit(run)


def _finish(campaign: Campaign, folder: Path, table: Table, is_complete: bool) -> Outcome:
    from autodrive.experiments.campaigns.report import report  # noqa: PLC0415  after the runs
    from autodrive.experiments.campaigns.statistics import summary  # noqa: PLC0415  it needs scipy

    rows = table.finish()
    numbers = summary(campaign, rows)
    write_file(folder / "summary.json", json.dumps(with_encodable_texts(numbers), indent=2) + "\n")
    write_file(folder / "report.html", report(campaign, rows, numbers))
    return Outcome(folder, numbers, is_complete)


def _result(row: dict[str, Any], campaign: Campaign) -> RunResult:
    """The result that a row of a table was made of."""
    nan = float("nan")
    metrics = {name: nan if row.get(name) is None else row[name] for name in campaign.metric_names}
    return RunResult(row["run"], metrics, row["end"], row["time"], row["digest"])
