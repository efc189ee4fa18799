"""Code that is edited, moved or has a name twice: campaigns and races run one version of it, which they name."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from pyarrow import parquet

import autodrive
from autodrive import Simulation
from autodrive.base.code_snapshot import CodeSnapshot
from autodrive.base.errors import AutodriveError
from autodrive.experiments.campaigns import Campaign, CampaignObserver, Outcome, run_campaign
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.keys import RowCache, RunKeys
from autodrive.experiments.campaigns.runs import CampaignProgress
from autodrive.protocol.messages import AddBox, LoadScenario, Reset, SetSensor
from autodrive.run.race import RaceOptions, race
from autodrive.run.runner import RunObserver
from autodrive.scenario.kinds import find
from tests.support.command_line import call
from tests.support.hardening import fill, make_read_only, small_disk
from tests.support.waiting import LIMIT

DRIVER = """
from autodrive import Command


class Driver:
    def reset(self, scene): pass
    def act(self, frame): return Command(0.2)


def score(frames): return {score}
"""
SHORT = {"scenario": "plane", "driver": "driver.py:Driver", "seeds": 24, "stop": {"time": 0.1}}


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.experiments.campaigns.keys.ROWS", tmp_path / "cache" / "rows.sqlite")


def driver(score: str, imports: str = "") -> str:
    return imports + DRIVER.format(score=score)


def loaded(folder: Path, **changes: Any) -> Campaign:
    path = folder / "short.yaml"
    path.write_text(yaml.safe_dump({**SHORT, "metrics": ["driver.py:score"], **changes}))
    return Campaign.load(path)


def column(outcome: Outcome, name: str) -> list[Any]:
    return parquet.read_table(outcome.table).column(name).to_pylist()


class After(CampaignObserver):
    """Calls a function after some rows, and counts the rows that are not new."""

    reused = 0

    def __init__(self, act: Callable[[], object] = lambda: None, *, rows: int = 4) -> None:
        self._act, self._rows = act, rows

    def progress(self, progress: CampaignProgress) -> None:
        self.reused = progress.reused
        if progress.done == self._rows:
            self._act()


@pytest.mark.parametrize("workers", [0, pytest.param(1, marks=pytest.mark.process)])
def test_a_driver_that_is_edited_during_its_campaign_drives_as_at_the_start(
    tmp_path: Path, workers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, data = tmp_path / "driver.py", tmp_path / "gain.txt"
    file.write_text(driver("float(open('gain.txt').read()) + 2"))
    data.write_text("1")

    def edit() -> None:
        file.write_text(driver("float(open('gain.txt').read()) + 7"))
        data.write_text("5")

    monkeypatch.chdir(tmp_path)
    first = run_campaign(loaded(tmp_path, files=["gain.txt"]), tmp_path / "a", workers=workers, observer=After(edit))
    assert column(first, "score") == [3.0] * 24
    edited = run_campaign(loaded(tmp_path, files=["gain.txt"]), tmp_path / "b", workers=0)
    assert column(edited, "score") == [12.0] * 24
    file.write_text(driver("float(open('gain.txt').read()) + 2"))
    data.write_text("1")
    again = After()
    restored = run_campaign(loaded(tmp_path, files=["gain.txt"]), tmp_path / "c", workers=0, observer=again)
    assert column(restored, "score") == [3.0] * 24
    assert again.reused == 24


SENSOR = """
import lib
class Value:
    rate, columns = None, ("value",)
    def sample(self, view, random): return {value} * lib.FACTOR
"""
READING = "frames[-1].vehicles['V1'].own['own'].values[0]"


def sensor_scenario(folder: Path) -> Path:
    (folder / "own.yaml").write_text("map: plane\nvehicles: {V1: {own_sensors: {own: sensor.py:Value}}}\n")
    (folder / "sensor.py").write_text(SENSOR.format(value=1.0))
    (folder / "lib.py").write_text("FACTOR = 1.0\n")
    return folder / "own.yaml"


@pytest.mark.parametrize("workers", [0, pytest.param(1, marks=pytest.mark.process)])
def test_a_sensor_that_is_edited_during_its_campaign_measures_as_at_the_start(tmp_path: Path, workers: int) -> None:
    """Each run compiles the sensor again, because of its parameter; a replay says that the sensor is another one."""
    sensor_scenario(tmp_path)
    (tmp_path / "driver.py").write_text(driver(READING))
    changes: dict[str, Any] = {"scenario": "own.yaml", "seeds": 1, "parameters": {"gravity": [9.0, 9.5, 10.0]}}
    campaign = loaded(tmp_path, **changes)

    def edit() -> None:
        (tmp_path / "sensor.py").write_text(SENSOR.format(value=5.0))
        (tmp_path / "lib.py").write_text("FACTOR = 7.0\n")

    first = run_campaign(campaign, tmp_path / "out", workers=workers, observer=After(edit, rows=1))
    assert column(first, "score") == [1.0] * 3
    if workers == 0:
        command = ["campaign", str(campaign.path), "--replay", "1", "--output", tmp_path / "out", "--force"]
        replayed = call(*command)
        assert "score: 35\n" in replayed.stdout
        assert "the code, a file, the scenario or the simulator has changed" in replayed.stderr
    assert column(run_campaign(campaign, tmp_path / "again", workers=0), "score") == [35.0] * 3


def test_a_sensor_that_is_edited_during_a_run_stays_until_its_scenario_is_loaded_again(tmp_path: Path) -> None:
    """After edits of the world, also while the file is wrong."""
    scenario = sensor_scenario(tmp_path)
    simulation = Simulation(autodrive.make(scenario), speed=None, load=autodrive.make)
    (tmp_path / "lib.py").write_text("FACTOR = 7.0\n")
    (tmp_path / "sensor.py").write_text("class Value:")
    with simulation:
        simulation.request(AddBox("box", x=3.0, y=0.0)).result()
        simulation.request(SetSensor("V1", "lidar", rate=5.0)).result()
        simulation.request(Reset()).result()
        assert simulation.world.frame.vehicles["V1"].own["own"].values[0] == 1.0
        with pytest.raises(AutodriveError, match=r"sensor\.py:Value' cannot be loaded: IndentationError"):
            simulation.request(LoadScenario(str(scenario))).result()
        (tmp_path / "sensor.py").write_text(SENSOR.format(value=5.0))
        simulation.request(LoadScenario(str(scenario))).result()
        assert simulation.world.frame.vehicles["V1"].own["own"].values[0] == 35.0


SCRIPT = """
import sys
import far
import gain
from autodrive.devkit import Nigel, drive
car = Nigel("V1")
car.throttle_command, car.steering_command = far.FACTOR * gain.THROTTLE, 0.0
drive(lambda: None, car, port=int(sys.argv[1]))
"""


@pytest.mark.process
@pytest.mark.parametrize("command", [f"{sys.executable} script.py", "python -m script", "sh start.sh"])
def test_a_script_whose_modules_are_edited_during_its_campaign_drives_as_at_the_start(
    tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One beside it, and one in a folder of PYTHONPATH, which is in `sys.path`."""
    (tmp_path / "lib").mkdir()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "lib"))
    monkeypatch.syspath_prepend(tmp_path / "lib")
    (tmp_path / "script.py").write_text(SCRIPT)
    (tmp_path / "start.sh").write_text(f"exec {sys.executable} script.py $1")
    modules = {tmp_path / "gain.py": "THROTTLE = {}\n", tmp_path / "lib" / "far.py": "FACTOR = {}\n"}

    def write(value: float) -> None:
        for file, text in modules.items():
            file.write_text(text.format(value))

    write(0.5)
    campaign = loaded(tmp_path, driver=f"{command} {{port}}", metrics=["distance"], seeds=2)
    edit = After(lambda: write(1.0), rows=1)
    outcome = run_campaign(campaign, tmp_path / "out", workers=0, observer=edit)
    assert set(column(outcome, "error")) == {""}
    assert len(set(column(outcome, "distance"))) == 1


WAITING = """
import pathlib, sys, time
while not pathlib.Path(sys.argv[2]).exists():
    time.sleep(0.01)
import {module} as gain
pathlib.Path("driven.txt").write_text("1")
print(gain.THROTTLE, __file__)
"""
"""A script that waits until its files have been edited, before it imports one of them."""


@pytest.mark.process
def test_a_race_drives_with_the_code_of_its_start_which_its_result_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a script, a module and a script that a shell script starts, which need not be in the same folder."""
    monkeypatch.chdir(tmp_path)
    for folder in ("team", "shell"):
        (tmp_path / folder).mkdir()
    (tmp_path / "script.py").write_text(WAITING.format(module="gain"))
    (tmp_path / "team" / "driver.py").write_text(WAITING.format(module="team.gain"))
    (tmp_path / "shell" / "other.py").write_text(WAITING.format(module="gain"))
    (tmp_path / "start.sh").write_text('cd "$(dirname "$0")/shell"\npython3 other.py "$@"\n')
    (tmp_path / "wrong.py").write_text("exec('1')\nopen(__file__ + '.none')\n")
    gains = [tmp_path / name for name in ("gain.py", "team/gain.py", "shell/gain.py")]
    edited, track = tmp_path / "edited", tmp_path / "own.yaml"
    track.write_bytes(find("track", "practice").read_bytes())

    def write(throttle: float) -> None:
        for gain in gains:
            gain.write_text(f"THROTTLE = {throttle}\n")

    class Editing(RunObserver):
        def started(self, run: Any) -> None:
            write(0.7)
            track.write_text("edited")
            edited.touch()

    write(0.2)
    ways = ("python script.py", "python -m team.driver", f"sh {tmp_path}/start.sh", "python wrong.py")
    files = {
        "track": [track],
        "V1": [tmp_path / "script.py", gains[0]],
        "V2": [tmp_path / "team/driver.py", gains[1]],
        "V3": [tmp_path / "start.sh", gains[2], tmp_path / "shell/other.py"],
        "V4": [tmp_path / "wrong.py"],
    }
    digests = {
        name: hashlib.sha256(b"".join(path.read_bytes() for path in of)).hexdigest() for name, of in files.items()
    }
    scripts = tuple(f"{way} {{port}} {edited}" for way in ways)
    options = RaceOptions(str(track), scripts=scripts, is_lockstep=True, has_page=False, output=tmp_path / "out")
    result = race(options, observer=Editing())
    reasons = {standing.vehicle: standing.reason for standing in result.standings}
    scripts_run = {"V1": "script.py", "V2": "team/driver.py", "V3": "other.py"}
    for name, file in scripts_run.items():
        assert reasons[name].startswith("the script ended with exit code 0: 0.2 ")
        assert reasons[name].endswith(file)
    assert f"{tmp_path}/wrong.py.none'" in reasons["V4"]
    assert f'File "{tmp_path}/wrong.py", line 2' in (tmp_path / "out" / "V4.log").read_text()
    assert result.notes == {"V4": "The script may run code that its digest does not contain (wrong.py, line 1: exec)"}
    assert {name: result.digests[name] for name in digests} == digests
    assert (tmp_path / "driven.txt").is_file()
    assert (tmp_path / "shell" / "driven.txt").is_file()


def test_a_helper_that_is_edited_in_one_process_is_read_again(tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(driver("helper.gain()", "import helper\n"))
    scores, again = list[set[float]](), After()
    for number, gain in enumerate((1.0, 9.0, 5.0, 1.0)):  # of one length, within one second
        (tmp_path / "helper.py").write_text(f"def gain(): return {gain}\n")
        again = After()
        outcome = run_campaign(loaded(tmp_path), tmp_path / str(number), workers=0, observer=again)
        scores.append(set(column(outcome, "score")))
    assert scores == [{1.0}, {9.0}, {5.0}, {1.0}]
    assert again.reused == 24


def test_two_helpers_of_one_name_are_two_modules(tmp_path: Path) -> None:
    for folder, value in (("a", 0.3), ("b", 1000.0)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "utils.py").write_text(f"value = {value}\n")
        (tmp_path / folder / "late.py").write_text(f"value = {2 * value}\n")
    (tmp_path / "a" / "drive.py").write_text(driver("1", "import utils\nassert utils.value == 0.3\n"))
    ways = {
        "plain": "import utils\ndef plain(frames): return utils.value\n",
        "member": "from utils import value\ndef member(frames): return value\n",
        "by_name": "import importlib\ndef by_name(frames): return importlib.import_module('utils').value\n",
        "late": "def late(frames):\n    import late\n    return late.value\n",
    }
    for name, text in ways.items():
        (tmp_path / "b" / f"{name}_metric.py").write_text(text)
    (tmp_path / "a" / "late_metric.py").write_text(ways["late"].replace("def late", "def early"))
    metrics = [*(f"b/{name}_metric.py:{name}" for name in ways), "a/late_metric.py:early"]
    outcome = run_campaign(loaded(tmp_path, driver="a/drive.py:Driver", metrics=metrics), tmp_path / "out", workers=0)
    found = {name: set(column(outcome, name)) for name in (*ways, "early")}
    assert found == {"plain": {1000.0}, "member": {1000.0}, "by_name": {1000.0}, "late": {2000.0}, "early": {0.6}}


@pytest.mark.slow
@pytest.mark.process
def test_files_in_the_working_folder_that_have_the_name_of_a_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They replace no package of run and campaign; those that end a script of the user are named."""
    for name in ("numpy", "random", "json", "autodrive"):
        (tmp_path / f"{name}.py").write_text("raise ImportError('of the user')\n")
    (tmp_path / "driver.py").write_text(driver("numpy.pi", "import json, numpy, random\n"))
    loaded(tmp_path, seeds=2)
    monkeypatch.chdir(tmp_path)
    for command in ("run plane --headless --no-cameras --duration 0.1", "campaign short.yaml --workers 1 --no-cache"):
        subprocess.run([Path(sys.executable).with_name("autodrive"), *command.split()], check=True, timeout=LIMIT)
    assert parquet.read_table("short_results/table.parquet").column("score").to_pylist() == [math.pi] * 2
    (tmp_path / "script.py").write_text("import random\n")
    scripts = ("python script.py {port}",)
    (standing,) = race(RaceOptions("practice", scripts=scripts, is_lockstep=True, has_page=False)).standings
    reason = "ImportError: of the user; files in the folder of the script replace Python modules of the same name: "
    assert standing.reason.endswith(reason + "autodrive.py, json.py, numpy.py, random.py")


def test_what_a_driver_writes_and_reads_beside_itself_is_in_the_folder_of_the_user(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """It need not be named in `files`; errors name the file of the user."""
    home = tmp_path / "home"
    (home / "code").mkdir(parents=True)
    (home / "gain.txt").write_text("4")
    (home / "old.log").write_text("")
    text = "from pathlib import Path\nHERE = Path(__file__).parent\nexec('NAME = 3')\n"
    text += "GAIN = float((HERE.parent / 'gain.txt').read_text())\n"
    score = "(HERE / 'new.log').write_text('new'), (HERE.parent / 'old.log').write_text('old'), GAIN)[2]"
    (home / "code" / "driver.py").write_text(driver(f"({score}", text))
    (home / "code" / "wrong.py").write_text("def wrong(frames): open(__file__ + '.none')\n")
    campaign = loaded(home, driver=f"{home}/code/driver.py:Driver", metrics=["code/driver.py:score"])
    assert set(column(run_campaign(campaign, tmp_path / "out", workers=0), "score")) == {4.0}
    assert "name the files of the code in 'files'  (driver.py, line 3: exec)" in caplog.text
    assert (home / "code" / "new.log").read_text() == "new"
    assert (home / "old.log").read_text() == "old"
    assert not list(home.rglob("__pycache__"))
    campaign = loaded(home, driver="code/driver.py:Driver", metrics=["code/wrong.py:wrong"], seeds=1)
    (error,) = column(run_campaign(campaign, tmp_path / "wrong", workers=0), "error")
    assert f"'{home}/code/wrong.py.none'" in error
    assert error.endswith("(wrong.py, line 1)")


def test_a_copy_has_the_rights_and_the_neighbours_of_its_original(tmp_path: Path) -> None:
    """Also of a program, and in the folder of a campaign that has no code itself."""
    for folder in ("campaign", "code"):
        (tmp_path / folder).mkdir()
    (tmp_path / "campaign" / "route.csv").write_text("1,2")
    (tmp_path / "code" / "drive.sh").write_text("#!/bin/sh\n")
    (tmp_path / "code" / "drive.sh").chmod(0o755)
    campaign = loaded(tmp_path / "campaign", driver="../code/drive.sh {port}", metrics=["distance"])
    snapshot = CodeSnapshot(CampaignFiles.of(campaign))
    folder = snapshot.folder
    assert (folder / "route.csv").read_text() == "1,2"
    assert os.access(folder / "../code/drive.sh", os.X_OK)
    assert (folder / "../code/drive.sh").resolve() != (tmp_path / "code" / "drive.sh").resolve()
    snapshot.close()
    assert not folder.exists()
    assert (tmp_path / "campaign" / "route.csv").is_file()


def test_a_replay_says_that_the_code_is_another_one(tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(driver("helper.gain", "import helper\n"))
    (tmp_path / "helper.py").write_text("gain = 1.0\n")
    campaign = loaded(tmp_path, seeds=2)
    run_campaign(campaign, tmp_path / "out", workers=0)
    command = ["campaign", str(campaign.path), "--replay", "1", "--output", tmp_path / "out", "--force"]
    same = call(*command)
    assert "score: 1\n" in same.stdout
    assert "has changed" not in same.stderr
    (tmp_path / "helper.py").write_text("gain = 2.0\n")
    other = call(*command)
    assert "score: 2\n" in other.stdout
    assert "code, a file, the scenario or the simulator has changed since the table was written" in other.stderr


def test_results_of_another_campaign_are_replaced_only_if_that_is_said(tmp_path: Path) -> None:
    """Also of one whose file has the same name, and of one that was killed before it had a table."""
    campaigns = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "driver.py").write_text(driver("1"))
        campaigns.append(loaded(tmp_path / folder, seeds=2))
    first, second = campaigns
    table = run_campaign(first, tmp_path / "out", workers=0).table
    before = table.read_bytes()
    assert run_campaign(first, tmp_path / "out", workers=0).table.read_bytes() == before
    with pytest.raises(AutodriveError, match="the results of another campaign"):
        run_campaign(second, tmp_path / "out", workers=0)
    assert table.read_bytes() == before
    (tmp_path / "out" / "parts").mkdir()
    table.replace(tmp_path / "out" / "parts" / "000001.parquet")
    (tmp_path / "out" / "summary.json").unlink()
    (tmp_path / "out" / "report.html").unlink()
    command = ["campaign", str(second.path), "--workers", "0", "--output", tmp_path / "out"]
    refused = call(*command)
    assert refused.returncode == 2
    assert "replace it with --force" in refused.stderr
    assert call(*command, "--overwrite").returncode == 0
    assert len(column(run_campaign(second, tmp_path / "out", workers=0), "run")) == 2


@pytest.mark.parametrize("harm", ["garbage", "locked", "other table", "wrong row", "folder", "read-only", "full"])
def test_a_cache_that_cannot_be_used_is_one_warning(
    tmp_path: Path, harm: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("autodrive.experiments.campaigns.keys.WAIT", 0.01, raising=False)
    (tmp_path / "driver.py").write_text(driver("1"))
    campaign = loaded(tmp_path, seeds=4)
    with contextlib.ExitStack() as stack:
        is_disk = harm in ("read-only", "full")
        folder = stack.enter_context(small_disk(tmp_path)) if is_disk else tmp_path
        file = folder / "rows.sqlite"
        if harm in ("wrong row", "full"):
            RowCache(file).close()
        if harm == "folder":
            file.mkdir()
        elif harm == "garbage":
            file.write_bytes(b"no database " * 1000)
        elif harm == "read-only":
            make_read_only(folder)
        elif harm == "full":
            fill(folder / "rest")
        else:
            other = stack.enter_context(contextlib.closing(sqlite3.connect(file, isolation_level=None)))
            if harm == "wrong row":
                key = RunKeys(CampaignFiles.of(campaign)).of(campaign.run(0))
                other.execute("INSERT INTO rows VALUES (?, ?)", (key, '{"wrong": 1}'))
            else:
                other.execute("CREATE TABLE rows (other)" if harm == "other table" else "BEGIN EXCLUSIVE")
        cache = RowCache(file)
        assert len(column(run_campaign(campaign, tmp_path / "out", workers=0, cache=cache), "run")) == 4
    assert caplog.text.count("results are not kept for other campaigns") == 1
