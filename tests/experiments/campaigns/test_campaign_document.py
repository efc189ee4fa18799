"""The example and the page docs/campaigns.md run."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from autodrive.experiments.campaigns.campaign import Campaign, CampaignSpec
from autodrive.experiments.campaigns.metrics import METRICS
from autodrive.experiments.campaigns.runner import Runner
from autodrive.experiments.campaigns.runs import run_campaign
from autodrive.protocol.weather import PRESETS
from tests.support.scenes import needs_gl

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/campaigns.md").read_text(encoding="utf-8")
EXAMPLE = ROOT / "examples/campaign/grip_noise_latency.yaml"


def test_the_file_of_the_page_is_the_example() -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert text == EXAMPLE.read_text(encoding="utf-8")


def test_a_small_version_of_the_example_runs(tmp_path: Path) -> None:
    full = Campaign.load(EXAMPLE)
    assert len(full) == 1024
    small = full.spec.samples.model_copy(update={"count": 4})
    stop = full.spec.stop.model_copy(update={"time": 4.0})
    campaign = replace(full, spec=full.spec.model_copy(update={"samples": small, "stop": stop}))
    outcome = run_campaign(campaign, tmp_path / "out", workers=0, uses_cache=False)
    assert outcome.summary["counts"].get("error", 0) == 0
    assert outcome.summary["pass"]["runs"] == 8
    assert outcome.summary["metrics"]["distance"]["mean"] > 0.5


@needs_gl
def test_the_campaign_in_eight_weathers_has_the_results_of_the_document() -> None:
    full = Campaign.load(ROOT / "examples/campaign/weather.yaml")
    assert len(full) == 64
    runner = Runner(full)

    def collisions(weather: str, time: str, has_detector: bool) -> float:
        wanted = {"weather": weather, "time_of_day": time, "driver.has_detector": has_detector}
        run = next(run for run in map(full.run, range(64)) if run.values == wanted)
        return runner.run(run).metrics["collisions"]

    assert collisions("sunny", "11:00", has_detector=False) == 1.0
    page = (ROOT / "docs/weather.md").read_text()
    (counts,) = re.findall(r"\| sunny \| cloudy .*\n\|[-|]+\n\|(.*)\|\n", page)
    table = dict(zip(PRESETS, map(int, counts.split("|")), strict=True))
    assert collisions("heavy_snow", "11:00", has_detector=True) == 1.0
    assert table["heavy_snow"] == 0
    # the weather with the finest differences: the dark hides the box, the day does not
    passed = [1.0 - collisions("light_fog", time, has_detector=True) for time in ("7:00", "11:00", "15:00", "19:00")]
    assert sum(passed) == table["light_fog"]


def test_the_campaign_of_the_race_policy_runs() -> None:
    full = Campaign.load(ROOT / "examples/learning/robustness.yaml")
    assert len(full) == 144
    stop = full.spec.stop.model_copy(update={"time": 2.0})
    runner = Runner(replace(full, spec=full.spec.model_copy(update={"stop": stop, "metrics": ("distance",)})))
    for number in (0, 143):  # `fast` without noise; `technical` with latency, another grip and another mass
        result = runner.run(full.run(number))
        assert (result.error, result.end) == ("", "time")
        assert result.metrics["distance"] > 1.0


def test_the_programs_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    driver, program = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "my_driver.py").write_text(driver)
    exec(program, names)
    assert names["outcome"].is_complete
    text = (tmp_path / "grip.yaml").read_text().replace("driver.py:", "my_driver.py:")
    (tmp_path / "mine.yaml").write_text(text)
    assert run_campaign(Campaign.load("mine.yaml"), workers=0).summary["counts"] == {"pass": 2}


def test_the_page_names_all_keys_and_metrics() -> None:
    keys = {field.alias or name for name, field in CampaignSpec.model_fields.items()} - {"title", "scenario"}
    assert not {name for name in keys | set(METRICS) if f"`{name}`" not in PAGE}
