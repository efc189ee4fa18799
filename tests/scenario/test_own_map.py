"""A scenario with its own map is the same as one whose map is in a file: the same bits, the same errors with lines."""

from __future__ import annotations

import shutil
import textwrap
from pathlib import Path

import pytest
import yaml

import autodrive
from autodrive import Command, Simulation, SpecError
from autodrive.base.yaml_files import parse
from autodrive.cli.spec_files import check
from autodrive.experiments.campaigns.campaign import Campaign
from autodrive.experiments.campaigns.runner import Runner
from autodrive.protocol.messages import AddBox, Frame, Operation, Place, RemoveBox
from autodrive.scenario import ScenarioSpec, load_scenario
from autodrive.scenario.files import files_of, read_scenario, scenario_text, write_to
from autodrive.scenario.kinds import find, names
from autodrive.scenario.maps.map import load_map
from tests.support.command_line import call
from tests.support.frames import digest, digests

VEHICLES = "vehicles: {V1: {x: 0.0, y: 0.0}}\n"
STREET = """\
title: A street
placements:
  - {module: straight_road, x: 0.0, y: 0.15, open: [west]}
  - {module: own_curve.yaml, x: 0.8, y: 0.35}
  - {module: dead_end, x: 1.0, y: 1.15, yaw_deg: 90}
paved:
  - {shape: rectangle, x: -1.0, length: 1.0, width: 1.0}
"""


def with_own_map(text: str, more: str = VEHICLES) -> str:
    return f"title: A scenario\nmap:\n{textwrap.indent(text, '  ')}{more}"


@pytest.fixture
def street(tmp_path: Path) -> Path:
    """A scenario whose map, in the same file, names the file of a module."""
    shutil.copy(find("module", "curved_road"), tmp_path / "own_curve.yaml")
    (tmp_path / "street.yaml").write_text(STREET)
    (tmp_path / "scenario.yaml").write_text(with_own_map(STREET))
    return tmp_path / "scenario.yaml"


def drive(_: Frame) -> dict[str, Command]:
    return {"V1": Command(0.6, 0.2)}


@pytest.mark.parametrize("name", names("map"))
def test_the_bits_are_those_of_the_map_in_a_file(name: str, tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(with_own_map(find("map", name).read_text()))
    worlds = [autodrive.make(ScenarioSpec(map=name), 3), autodrive.make(file, 3)]
    assert worlds[0].map.bounds == worlds[1].map.bounds
    first, other = (digests(world, 100, drive) for world in worlds)
    assert first == other


def test_edits_keep_the_map_and_the_bits(tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(with_own_map(find("map", "mini_map").read_text()))
    edits: list[Operation] = [
        Place("V1", 0.1, 0.0), RemoveBox("pile_3"), AddBox("crate", 1.0, 0.6), Place("corner_1", -0.1, 0.6),
    ]  # fmt: skip
    seen = []
    for scenario in (ScenarioSpec(map="mini_map"), file):
        simulation = Simulation(autodrive.make(scenario), load=autodrive.make)
        for edit in edits:
            simulation.request(edit)
        simulation.run(1.0)
        seen.append((digest(simulation.frame), simulation.scenario_text()))
    assert seen[0][0] == seen[1][0]
    saved = parse(seen[1][1], ScenarioSpec)
    assert saved.map == load_scenario(file).map
    assert digest(autodrive.make(saved).frame) == digest(autodrive.make(parse(seen[0][1], ScenarioSpec)).frame)


@pytest.mark.parametrize(
    ("right", "wrong", "line"),
    [
        ("x: 0.8, y: 0.35", "x: 0.9, y: 0.35", 6),
        ("open: [west]", "open: [north]", 5),
        ("module: dead_end", "module: deadend", 7),
        ("x: 0.8", "x: far", 6),
        ("length: 1.0", "extent: 1.0", 9),
    ],
)
def test_the_errors_are_those_of_the_file_with_the_line_of_the_scenario(
    street: Path, right: str, wrong: str, line: int
) -> None:
    text = STREET.replace(right, wrong)
    assert text != STREET
    (street.parent / "street.yaml").write_text(text)
    street.write_text(with_own_map(text))
    errors = []
    for file in (street.parent / "street.yaml", street):
        with pytest.raises(SpecError) as caught:
            check(str(file))
        errors.append(caught.value.errors)
    of_file, of_scenario = errors
    assert f"(line {line})" in str(of_scenario)
    assert f"(line {line - 2})" in str(of_file)  # the map begins in the third line of the scenario
    assert [text.rpartition(": ")[2] for text in of_scenario] == [text.rpartition(": ")[2] for text in of_file]


def test_a_wrong_value_of_another_type_has_the_same_message_as_ever(tmp_path: Path) -> None:
    (tmp_path / "wrong.yaml").write_text(f"map: 3\n{VEHICLES}")
    with pytest.raises(SpecError, match=r"map \(line 1\): must be a text, not 3"):
        load_scenario(tmp_path / "wrong.yaml")


def test_the_text_of_a_scenario_contains_its_map_and_runs_in_any_folder(
    street: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    spec = load_scenario(street)
    other = tmp_path_factory.mktemp("other") / "scenario.yaml"
    other.write_text(scenario_text(spec))
    assert load_scenario(other) == spec
    assert scenario_text(load_scenario(other)) == other.read_text()
    tree, written = yaml.safe_load(other.read_text())["map"], yaml.safe_load(STREET)
    written["placements"][1]["module"] = str(street.parent / "own_curve.yaml")
    assert tree == written
    assert digests(autodrive.make(other), 20, drive) == digests(autodrive.make(street), 20, drive)


def test_the_files_that_it_names_travel_and_give_the_same_bits(street: Path, tmp_path: Path) -> None:
    descriptions = read_scenario(street)
    files = files_of(descriptions.specs)
    assert not any(name.startswith("map/") for name in files)
    want = digests(autodrive.make(descriptions), 20, drive)
    shutil.rmtree(street.parent)
    again = write_to(tmp_path / "there", descriptions.specs.scenario, files)
    assert digests(autodrive.make(again), 20, drive) == want


@pytest.mark.parametrize("text", ["[" * 100_000, "title: x\nplacements: !!python/tuple [1]", "a: ["])
def test_the_map_of_a_stranger_s_recording_is_read_within_the_limits_of_a_file(text: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="invalid YAML"):
        write_to(tmp_path, ScenarioSpec(map="theirs.yaml"), {"map/theirs.yaml": text})


def test_a_campaign_changes_its_fields(street: Path) -> None:
    (street.parent / "driver.py").write_text(
        "from autodrive import Command\nclass Driver:\n    def reset(self, scene): pass\n"
        "    def act(self, frame): return Command(1.0)\n"
    )
    tree = {"scenario": "scenario.yaml", "driver": "driver.py:Driver", "stop": {"time": 0.5}}
    tree["parameters"] = {"map.ground.grip": [1.0, 0.05]}
    (street.parent / "campaign.yaml").write_text(yaml.safe_dump(tree))
    campaign = Campaign.load(street.parent / "campaign.yaml")
    results = [*map(Runner(campaign).run, map(campaign.run, range(2)))]
    assert [result.error for result in results] == ["", ""]
    assert results[0].metrics["distance"] > 1.5 * results[1].metrics["distance"]


def test_commands_take_it(street: Path) -> None:
    assert call("check", street).returncode == 0
    assert call("show", street, "--output", street.parent / "picture.svg").returncode == 0
    assert "<svg" in (street.parent / "picture.svg").read_text()
    summary = street.parent / "summary.json"
    ran = call("run", street, "--headless", "--speed", "max", "--duration", "0.1", "--summary", summary)
    assert ran.returncode == 0, ran.stderr
    assert '"map": "A street"' in summary.read_text()
    batch = autodrive.BatchWorld(street, 2)
    assert "A street" in repr(batch)
    assert load_map(load_scenario(street).map).title == "A street"
