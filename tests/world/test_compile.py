"""Reading and compiling are two passes: what compiles needs no files."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from autodrive.base.specs import SpecProblems, joined
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun
from autodrive.experiments.campaigns.runner import Runner
from autodrive.protocol.messages import AddBox, Command, Place
from autodrive.recording import open as open_recording
from autodrive.recording.resimulation import resimulate
from autodrive.scenario.files import files_of, read_scenario, write_to
from autodrive.scenario.kinds import find
from autodrive.world.compile import compile_specs
from autodrive.world.factory import make
from autodrive.world.simulation import Simulation

READERS = {"autodrive.base.yaml_files", "autodrive.scenario.files", "autodrive.scenario.kinds"}


@pytest.mark.process
def test_what_compiles_imports_nothing_that_reads_files() -> None:
    script = "import sys, autodrive.world.compile; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert "autodrive.scenario.maps.map" in modules
    assert not READERS & {*modules}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scenario with files of its own: map, modules, vehicle and rules."""
    folder = tmp_path / "own"
    folder.mkdir()
    tree = yaml.safe_load(find("map", "mini_map").read_text())
    for placement in tree["placements"]:
        shutil.copy(find("module", placement["module"]), folder)
        placement["module"] += ".yaml"
    (folder / "streets.yaml").write_text(yaml.safe_dump(tree))
    shutil.copy(find("vehicle", "nigel"), folder / "car.yaml")
    shutil.copy(find("ruleset", "practice"), folder / "rules.yaml")
    start = yaml.safe_load(find("scenario", "mini_map").read_text())["vehicles"]["V1"]
    scenario = {
        "map": str(folder / "streets.yaml"),
        "vehicles": {"V1": start | {"type": str(folder / "car.yaml")}},
        "race": {"track": "practice", "rules": str(folder / "rules.yaml")},
    }
    (folder / "scenario.yaml").write_text(yaml.safe_dump(scenario))
    return folder


def test_a_scenario_is_compiled_and_edited_without_its_files(folder: Path) -> None:
    descriptions = read_scenario(folder / "scenario.yaml")
    shutil.rmtree(folder)
    with Simulation(make(descriptions), is_paused=True, load=make) as simulation:
        x, y, _ = simulation.frame.vehicles["V1"].pose.position.tolist()
        simulation.request(Place("V1", x + 0.05, y, 0.0)).result()
        simulation.request(AddBox("crate", x + 1.0, y, 0.0, (0.1, 0.1, 0.1), 0.1)).result()
        assert [*simulation.frame.objects][-1:] == ["crate"]


def test_files_that_are_written_give_the_same_bits(folder: Path, tmp_path: Path) -> None:
    descriptions = read_scenario(folder / "scenario.yaml")
    files = files_of(descriptions.specs)
    shutil.rmtree(folder)
    again = write_to(tmp_path / "there", descriptions.specs.scenario, files)
    worlds = [make(descriptions), make(again)]
    for _ in range(20):
        frames = [world.step({"V1": Command(0.5, 0.2)}) for world in worlds]
        assert len({frame.vehicles["V1"].pose.position.tobytes() for frame in frames}) == 1
    maps = {text for name, text in files.items() if name.startswith("map/")}  # the map names its modules elsewhere
    assert {*files_of(worlds[1].specs).values()} >= {*files.values()} - maps


@pytest.mark.slow
def test_a_campaign_changes_specs_without_the_files(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(
        "from autodrive import Command\nclass Driver:\n    def reset(self, scene): pass\n"
        "    def act(self, frame): return Command(1.0)\n"
    )
    parameters = {"map.ground.grip": [1.0, 0.05], "vehicles.V1.spec.body.drag": [0.1, 3.0]}
    tree = {"scenario": str(folder / "scenario.yaml"), "driver": "driver.py:Driver", "parameters": parameters}
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(tree | {"stop": {"time": 0.3}, "record": "all"}))
    campaign = Campaign.load(tmp_path / "campaign.yaml")
    shutil.rmtree(folder)
    runner = Runner(campaign)
    recording = tmp_path / "run.mcap"
    last = campaign.run(len(campaign) - 1)
    results = [
        *map(runner.run, map(campaign.run, range(3))),
        runner.run(CampaignRun(3, 3, 0, last.values, str(recording))),
    ]
    assert [result.error for result in results] == [""] * 4
    assert len({result.metrics["distance"] for result in results}) == 4
    with open_recording(recording) as recorded:  # it contains the changed files
        assert resimulate(recorded).difference is None


def test_problems_are_joined_with_the_lines_of_their_places(folder: Path) -> None:
    text = (folder / "scenario.yaml").read_text()
    (folder / "scenario.yaml").write_text(f"{text}removed_boxes: [nothing]\nboxes:\n  V1: {{x: 0, y: 0}}\n")
    descriptions = read_scenario(folder / "scenario.yaml")
    with pytest.raises(SpecProblems) as caught:
        compile_specs(descriptions.specs)
    assert [problem.partition(":")[0] for problem in joined(caught.value.problems, {})] == ["removed_boxes", "boxes.V1"]
    line = len(text.splitlines()) + 1
    places = [problem.partition(":")[0] for problem in joined(caught.value.problems, descriptions.lines)]
    assert places == [f"removed_boxes (line {line})", f"boxes.V1 (line {line + 2})"]
