"""Falsification: a search, by Optuna, for parameters that make the driver fail."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from autodrive.base.errors import AutodriveError
from autodrive.base.installation import missing
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun
from autodrive.experiments.campaigns.executor import Executor
from autodrive.experiments.campaigns.runner import RunResult
from autodrive.experiments.campaigns.sampling import ParameterRange, Value

NO_MARGIN = 1e9
"""Margin of a run that has none, such as one that passes an equality."""


@dataclass(frozen=True)
class Trial:
    """One run of a search."""

    run: CampaignRun
    result: RunResult
    margin: float
    """Margin of the pass criterion: below 0 the driver has failed."""

    @property
    def has_failed(self) -> bool:
        """Whether the driver has failed; a run with an error is none of its failures."""
        return not self.result.error and self.margin < 0.0


def falsify(
    campaign: Campaign, executor: Executor, *, trials: int, seed: int = 0, stops: bool = True
) -> Iterator[Trial]:
    """Run at most so many trials, each with parameters that the ones before suggest (TPE); stop after a failure.

    The campaign's samples are not used; its ranges are searched. With an executor of one process, the same seed gives
    the same trials. Raises `AutodriveError` if the campaign has no criterion, or Optuna is not installed.
    """
    try:
        import optuna  # noqa: PLC0415  an extra
    except ModuleNotFoundError:
        raise AutodriveError(missing("optuna", "search")) from None
    criterion = campaign.criterion
    if criterion is None:
        raise AutodriveError("a search for failures needs the key 'pass' in the campaign")
    logging.getLogger("optuna").setLevel(logging.WARNING)
    study = optuna.create_study(direction="minimize", sampler=optuna.samplers.TPESampler(seed=seed))
    asked: dict[int, tuple[Any, CampaignRun]] = {}

    def submit() -> None:
        number = len(study.trials)
        trial = study.ask()
        values = {path: _suggested(trial, path, range_) for path, range_ in campaign.spec.parameters.items()}
        run = CampaignRun(number, number, campaign.spec.seed_list[0], values)
        asked[number] = trial, run
        executor.submit(run)

    try:
        for _ in range(min(executor.size, trials)):
            submit()
        for result in executor.results():
            trial, run = asked.pop(result.number)
            margin = math.nan if result.error else criterion.margin(result.metrics)
            tried = Trial(run, result, margin)
            if result.error:
                study.tell(trial, state=optuna.trial.TrialState.FAIL)
            else:
                study.tell(trial, min(max(margin, -NO_MARGIN), NO_MARGIN))
            yield tried
            if tried.has_failed and stops:
                return
            if len(study.trials) < trials:
                submit()
    finally:
        executor.cancel()


def _suggested(trial: Any, path: str, range_: ParameterRange) -> Value:
    """The value of a parameter that the search wants to try."""
    if range_.uniform:
        return trial.suggest_float(path, *range_.uniform)
    if range_.log_uniform:
        return trial.suggest_float(path, *range_.log_uniform, log=True)
    if range_.normal:
        return range_.at(trial.suggest_float(path, 0.0, 1.0))
    values = [json.dumps(value) for value in range_.values]
    return json.loads(trial.suggest_categorical(path, values))
