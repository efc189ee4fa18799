"""The examples and tables of docs/racing.md."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

import autodrive
from autodrive.scenario import load_scenario
from autodrive.world.racing import RaceRules

TEXT = (Path(__file__).parents[3] / "docs" / "racing.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)
    return text


def test_the_program_of_the_document_runs(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(block("python"), "racing.md", "exec"), {})
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("1 ")
    assert first.endswith("RACING")
    assert "'racing'" in second


def test_the_scenario_of_the_document_is_valid(tmp_path: Path) -> None:
    file = tmp_path / "race.yaml"
    file.write_text(block("yaml"))
    world = autodrive.make(load_scenario(file))
    assert {vehicle.race.lap_total for vehicle in world.frame.vehicles.values() if vehicle.race} == {3}


def test_the_table_of_rules_has_every_rule_with_the_values_of_the_files() -> None:
    rows = {
        row[0]: row[1:] for row in re.findall(r"^\| (`.*?`) \| (.*?) \| (.*?) \| (.*?) \|", TEXT, flags=re.MULTILINE)
    }
    documented = {name for names in rows for name in re.findall(r"`(\w+)`", names)}
    assert set(RaceRules.model_fields) - {"title"} <= documented
    data = Path(autodrive.__file__).parent / "scenario" / "data" / "rulesets"
    for column, name in enumerate(("league_2026", "head_to_head", "practice")):
        rules = yaml.safe_load((data / f"{name}.yaml").read_text())
        for key in ("collision_penalty", "restart_delay", "start_delay", "time_limit", "checkpoint_distance"):
            number = re.match(r"[\d.]+", rows[f"`{key}`"][column])
            assert (float(number[0]) if number else 0.0) == rules.get(key, 0.0), (name, key)
