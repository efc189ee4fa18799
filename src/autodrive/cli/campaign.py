"""The command `campaign`: many runs of a scenario, with a table, a summary and a report."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
import typer.core

from autodrive.cli.narrated import repeated
from autodrive.cli.options import argument, check_outputs, option

if TYPE_CHECKING:
    from autodrive.experiments.campaigns.campaign import Campaign
    from autodrive.experiments.campaigns.runs import Outcome

LOG_INTERVAL = 60.0
"""Time after which a line says again how far a campaign is, without a terminal [s]."""


class CampaignCommand(typer.core.TyperCommand):
    """`--ray` may stand alone, which Typer does not know: it is 'auto' then."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Give it its address."""
        from autodrive.base.specs import is_yaml

        following = [*args[1:], ""]
        stands_alone = [
            argument == "--ray" and (not after or after.startswith("-") or is_yaml(after))
            for argument, after in zip(args, following, strict=True)
        ]
        return super().parse_args(
            ctx, ["--ray=auto" if alone else argument for argument, alone in zip(args, stands_alone, strict=True)]
        )


def campaign(
    file: Path = argument("A campaign, as YAML.", ..., metavar="FILE"),
    workers: int | None = option(
        "Number of processes; 0: this process only.  [default: all processors]", min=0, max=1000
    ),
    ray: str | None = option(
        "Run on a Ray cluster: HOST:PORT of its head, 'local' for a cluster that ends with the campaign, or 'auto' "
        "(the same without an address) for the cluster of this machine.",
        metavar="[ADDRESS]",
    ),
    output: Path | None = option(
        "Folder of the results; a campaign in this folder is continued.  [default: FILE_results]",
        None,
        "--output",
        "-o",
        metavar="FOLDER",
    ),
    cache: bool = option("Reuse the results of runs of other campaigns.", True, "--cache/--no-cache"),
    falsify: int | None = option("Search for a failure instead, with at most N runs.", metavar="N", min=1),
    replay: int | None = option("Repeat the run RUN, record it, and print its result.", metavar="RUN", min=0),
    force: bool = option("Replace results of another campaign, without a question.", False, "--force", "--overwrite"),
) -> None:
    """Run a scenario many times, with other parameters and seeds.

    Writes table.parquet, summary.json and report.html. Ctrl-C keeps the finished runs; the same command continues.
    """
    from autodrive.experiments.campaigns.campaign import Campaign
    from autodrive.experiments.campaigns.runs import RESULT_FILES, results_of_others

    loaded = Campaign.load(file)
    if replay is not None:
        _replay(loaded, replay, output, is_forced=force)
        return
    folder = output or Path(f"{loaded.name}_{'search' if falsify else 'results'}")
    existing = [folder / name for name in RESULT_FILES] if falsify else results_of_others(loaded, folder)
    check_outputs(*existing, is_forced=force)
    outcome = _run(loaded, workers, ray, folder, uses_cache=cache, trials=falsify)
    _print(loaded, outcome)
    if not outcome.is_complete:
        raise typer.Exit(130)
    if outcome.summary["counts"].get("error", 0) == outcome.summary["rows"] > 0:
        raise typer.Exit(1)


def _run(
    loaded: Campaign,
    workers: int | None,
    ray: str | None,
    folder: Path,
    *,
    uses_cache: bool,
    trials: int | None,
) -> Outcome:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from autodrive.experiments.campaigns import runs

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    executor = None
    if ray is not None:
        from autodrive.experiments.campaigns.ray_executor import RayExecutor

        executor = RayExecutor(loaded, ray, workers)
    console = Console(stderr=True, highlight=False)
    with Progress(*columns, console=console, speed_estimate_period=60.0) as bar, ExitStack() as stack:
        task = bar.add_task("runs", total=trials or len(loaded), rate="")
        if not console.is_terminal:

            def log() -> None:
                runs_now = bar.tasks[0]
                console.print(f"{runs_now.completed:.0f} of {runs_now.total:.0f} runs  {runs_now.fields['rate']}")

            stack.enter_context(repeated(log, LOG_INTERVAL))

        class Display(runs.CampaignObserver):
            def progress(self, progress: runs.CampaignProgress) -> None:
                speed = bar.tasks[0].speed
                rate = f"{speed:.3g}/s" if speed else ""
                if progress.failures or progress.errors:
                    rate += f"  {progress.failures} failed, {progress.errors} errors"
                bar.update(task, completed=progress.done, rate=rate)

        if trials is not None:
            return runs.run_search(loaded, trials, folder, executor or runs.local_executor(loaded, workers), Display())
        return runs.run_campaign(
            loaded,
            folder,
            workers=workers,
            executor=executor,
            uses_cache=uses_cache,
            overwrites=True,  # the command has asked
            observer=Display(),
        )


def _print(loaded: Campaign, outcome: Outcome) -> None:
    numbers = outcome.summary
    counts = ", ".join(f"{count} {name}" for name, count in numbers["counts"].items())
    typer.echo(f"{numbers['rows']} of {numbers['runs']} runs: {counts or 'none'}")
    judged = numbers.get("pass")
    if judged and judged["rate"] is not None:
        low, high = 100 * judged["low"], 100 * judged["high"]
        typer.echo(f"pass rate {100 * judged['rate']:.1f} %, 95 % confidence {low:.1f} to {high:.1f} %")
    for name, metric in numbers["metrics"].items():
        if metric["runs"]:
            interval = "" if metric["low"] is None else f", 95 % confidence {metric['low']:.4g} to {metric['high']:.4g}"
            typer.echo(f"{name}: mean {metric['mean']:.4g}{interval}, from {metric['min']:.4g} to {metric['max']:.4g}")
    if not numbers["seed_changes_results"]:
        from autodrive.experiments.campaigns.statistics import SEED_CHANGES_NOTHING

        typer.echo(SEED_CHANGES_NOTHING)
    if "first_error" in numbers:
        typer.echo(f"first error: {numbers['first_error']}")
    typer.echo(f"results: {outcome.folder}")
    if not outcome.is_complete:
        typer.echo(f"stopped; the same command continues with the {numbers['runs'] - numbers['rows']} other runs")


def _replay(loaded: Campaign, number: int, output: Path | None, *, is_forced: bool) -> None:
    from dataclasses import replace

    from autodrive.base.errors import AutodriveError
    from autodrive.experiments.campaigns.executor import InProcessExecutor
    from autodrive.experiments.campaigns.keys import RunKeys
    from autodrive.experiments.campaigns.runs import recording_name
    from autodrive.experiments.campaigns.table import Table

    folder = output or Path(f"{loaded.name}_results")
    table = Table(folder, loaded)
    known = table.run(number)
    if known is None and number >= len(loaded):
        raise AutodriveError(f"the campaign has the runs 0 to {len(loaded) - 1}, not {number}")
    path = folder / "recordings" / recording_name(number)
    check_outputs(path, is_forced=is_forced)
    always = replace(loaded, spec=loaded.spec.model_copy(update={"record": "all"}))
    run = replace(known or loaded.run(number), recording=str(path.absolute()))
    for name, value in {"seed": run.seed, **run.values}.items():
        typer.echo(f"{name}: {value}")
    executor = InProcessExecutor(always)
    if (key := table.key(number)) and key != RunKeys(executor.files).of(run):
        typer.echo(
            "autodrive: the code, a file, the scenario or the simulator has changed since the table was written: the "
            "result may differ",
            err=True,
        )
    executor.submit(run)
    (result,) = executor.results()
    executor.cancel()
    typer.echo(f"end: {result.error or result.end} at {result.time:g} s")
    for name, metric in result.metrics.items():
        typer.echo(f"{name}: {metric:.6g}")
    typer.echo(f"recorded; to watch it:  autodrive replay {path}")
