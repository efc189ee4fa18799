"""Campaigns: a scenario, parameters and seeds that are run many times.

The unit of work is a pure function: (scenario, parameters, seed, driver) -> one row of results. `autodrive campaign
FILE.yaml` runs a campaign; `docs/campaigns.md` describes the file. From Python:

    from autodrive.experiments.campaigns import Campaign, run_campaign

    outcome = run_campaign(Campaign.load("campaign.yaml"), workers=2)
    print(outcome.summary["pass"])

Names are imported when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from autodrive.experiments.campaigns.campaign import Campaign as Campaign
    from autodrive.experiments.campaigns.executor import Executor as Executor
    from autodrive.experiments.campaigns.executor import LocalExecutor as LocalExecutor
    from autodrive.experiments.campaigns.runs import CampaignObserver as CampaignObserver
    from autodrive.experiments.campaigns.runs import Outcome as Outcome
    from autodrive.experiments.campaigns.runs import run_campaign as run_campaign
    from autodrive.experiments.campaigns.scene import Scene as Scene

_MODULE_OF = {
    "Campaign": "campaign",
    "Executor": "executor",
    "LocalExecutor": "executor",
    "CampaignObserver": "runs",
    "Outcome": "runs",
    "Scene": "scene",
    "run_campaign": "runs",
}

__all__ = ["Campaign", "CampaignObserver", "Executor", "LocalExecutor", "Outcome", "Scene", "run_campaign"]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'autodrive.experiments.campaigns' has no attribute '{name}'")
    value = getattr(importlib.import_module(f"autodrive.experiments.campaigns.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value
