"""Import paths that the documentation names, now and before the package was regrouped."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "examples").rglob("*.[mp][dy]"))]
_FORMER_NAMES = """
assets.asset.Label batch.BatchWorld batch.Readings bridge.devkit.DevkitBridge cameras.batch_camera.BatchCamera
campaigns.Campaign campaigns.run_campaign client.Client client.NoSimulatorError devkit.Nigel devkit.RoboRacer
devkit.drive devkit.server devkit.vehicles elementary envs.conditions.Conditions envs.episodes.observed
envs.parallel_env.DrivingParallelEnv envs.race_env.RaceParallelEnv envs.task.Observation errors.AutodriveError
exports.comparison.compare_recording exports.recorder_layout factory.make identification.Drive identification.Fitted
identification.Identification identification.IdentificationError identification.VehicleFile identification.identify
identification.read_drive maps.map.Map maps.map.MapSpec maps.map.load_map maps.raster.write_occupancy
model.model_digest policies.Policy policies.racer.PolicyRacer policies.racer.drive_laps policies.racer.INPUTS
protocol.channels.CHANNELS protocol.messages.IpsReading racing.results.RaceRecorder recording.Recorder recording.open
render.gl.GlUnavailable replay.replay ros.Bridge ros.Config run.RunOptions run.simulate scenario.BoxSpec
scenario.Scenario scenario.ScenarioSpec scenario.VehiclePlacement scenario.load_scenario sensors.camera.project
sensors.camera.rays sensors.random_stream simulation.Simulation simulation.Sink specs.names testing.Bridge
testing.ConformanceError testing.check_bridge tracks.Track tracks.race_line vehicles.spec.VehicleSpec
vehicles.spec.load_vehicle world.World
"""
"""What pages and examples named before, without 'autodrive.'."""


def documented(pages: Iterable[Path] = PAGES) -> list[str]:
    """Modules and names below `autodrive` that pages and examples name or import today."""
    found: set[str] = set()
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for module, names in re.findall(r"from (autodrive[\w.]*) import (\([^)]*\)|[^\n(#\\]+)", text):
            found |= {
                f"{module}.{name.split(' as ')[0].strip()}" for name in names.strip("()").split(",") if name.strip()
            }
        found |= set(re.findall(r"`(autodrive(?:\.[a-z_0-9]+)+(?:\.[A-Z]\w*)?)`", text))
    others = (".launch", ".rviz", ".v2", ".CompassReading")  # the last one is made in docs/adding_a_sensor.md
    adapters = "autodrive.experiments.envs.adapters."  # each needs its library
    return sorted(
        name.removeprefix("autodrive.") for name in found if not name.endswith(others) and not name.startswith(adapters)
    )


@pytest.mark.parametrize("path", [*_FORMER_NAMES.split(), *documented()])
def test_a_documented_path_can_be_imported(path: str) -> None:
    assert imported(f"autodrive.{path}") is not None


def imported(path: str) -> object:
    """The module of that name, or else the name in its module."""
    try:
        return importlib.import_module(path)
    except ModuleNotFoundError as error:
        if not f"{path}.".startswith(f"{error.name}.") and "is not a package" not in str(error):
            raise
    module, _, name = path.rpartition(".")
    return getattr(imported(module), name)


def test_the_api_reference_has_all_that_pages_use() -> None:
    text = "".join((ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("api.md", "testing.md"))
    entries = [imported(path) for path in re.findall(r"auto(?:class|data|exception|function):: (\S+)", text)]
    modules = re.findall(r"automodule:: (\S+)", text)
    for_developers = {"adding_a_sensor.md", "how_a_tick_works.md"}
    pages = [page for page in PAGES if "examples" not in page.parts and page.name not in for_developers]
    for path in documented(pages):
        used: Any = imported(f"autodrive.{path}")
        is_there = isinstance(used, ModuleType) or used in entries or getattr(used, "__module__", "") in modules
        assert is_there or path == "__all__", f"autodrive.{path} is not in docs/api.md"


@pytest.mark.process
def test_a_former_path_is_the_same_module_and_changes_nothing() -> None:
    code = """
import autodrive.tracks.track, autodrive.envs
from autodrive.scenario.tracks import Track, track
assert autodrive.tracks.track is track and autodrive.tracks.Track is Track
assert track.__name__ == track.__spec__.name == "autodrive.scenario.tracks.track"
import sys
assert autodrive.envs is sys.modules["autodrive.experiments.envs"]
try:
    import autodrive.tracks.wings
except ModuleNotFoundError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "No module named 'autodrive.tracks.wings'", done.stderr
