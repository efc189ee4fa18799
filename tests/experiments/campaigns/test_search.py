"""A search finds parameters that make the driver fail."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pyarrow import parquet

from autodrive.experiments.campaigns.campaign import Campaign
from autodrive.experiments.campaigns.executor import InProcessExecutor
from autodrive.experiments.campaigns.runner import Runner
from autodrive.experiments.campaigns.runs import run_search
from autodrive.experiments.campaigns.search import falsify
from autodrive.experiments.campaigns.table import Table

EXAMPLE = Path(__file__).parents[3] / "examples/campaign/start_pose.yaml"


def test_a_start_pose_is_found_from_which_the_driver_fails(tmp_path: Path) -> None:
    campaign = Campaign.load(EXAMPLE)
    outcome = run_search(campaign, 60, tmp_path / "out", InProcessExecutor(campaign))
    rows = parquet.read_table(outcome.table).to_pylist()
    assert rows[-1]["status"] == "fail"  # the search ends with it
    assert [row["status"] for row in rows].count("fail") == 1
    run = Table(outcome.folder, campaign).run(rows[-1]["run"])
    assert run is not None
    again = Runner(campaign).run(run)
    assert again.metrics["collisions"] == (rows[-1]["collisions"] or 0.0)
    assert again.metrics["min_clearance"] == rows[-1]["min_clearance"]


def test_a_search_gives_the_same_trials_again(tmp_path: Path) -> None:
    campaign = Campaign.load(EXAMPLE)
    short = replace(
        campaign, spec=campaign.spec.model_copy(update={"stop": campaign.spec.stop.model_copy(update={"time": 0.5})})
    )
    one, other = (
        [(trial.run, trial.margin) for trial in falsify(short, InProcessExecutor(short), trials=6, stops=False)]
        for _ in range(2)
    )
    assert len(one) == 6
    assert repr(one) == repr(other)
