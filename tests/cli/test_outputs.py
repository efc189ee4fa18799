"""No command writes over an existing file without `--force` or a question: each command with its outputs."""

from __future__ import annotations

import json
import os
import pty
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

import autodrive
from autodrive import Command
from autodrive.cli.options import MOST_NAMES
from autodrive.recording import Recorder
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.importer import export_track
from autodrive.scenario.tracks.track import Track
from tests.experiments.campaigns.conftest import DRIVER, SHORT
from tests.support.command_line import AUTODRIVE, call, refused
from tests.support.scenes import needs_gl
from tests.support.waiting import LIMIT

MINE = b"a file of the user"

WRITERS = (
    "run plane --headless --duration 0.02 --summary summary.json --record run.mcap",
    "show mini_map",
    "show curved_road",
    "show mini_map -o map.svg --labels labels.png --occupancy grid",
    "new scenario mine",
    "new driver mine",
    "import track line.csv --width 1",
    "import track hall_map.png --resolution 0.05 -o track.yaml",
    "export track technical",
    "export track practice -o exported",
    "generate track --length 30 --width 1 --area 14x8",
    "generate track --length 30 --width 1 --area 14x8 --race-line -o track.yaml",
    "export recording drive.mcap --to rosbag1",
    "plot drive.mcap --signals V1/velocity",
    "plot drive.mcap --signals V1/velocity -o plot.svg",
    "compare drive.mcap -o drive.png",
)
"""Command lines that write files."""
FIT = "identify drive.mcap --vehicle nigel --free wheels.damping_rate --trials 1 --window 0.5"
SLOW_WRITERS = (
    'race practice --script "sleep {port}" --start-limit 0.1 --lockstep --headless -o results --record race.mcap',
    "play race practice --laps 1 --lockstep --headless -o results",
    "campaign short.yaml --replay 0",
    "urdf nigel --output description",
    "export recording drive.mcap --to rerun -o drive.rrd",
    FIT,
    f"{FIT} -o fit.yaml --plot fit.svg",
)
"""Likewise."""
GL_WRITERS = (
    "show curved_road --3d road.png",
    "film drive.mcap -o film.webm --to 0.1 --size 64x36 --quality software",
)
"""Likewise, with images."""
FOLDERS = [f"export recording drive.mcap --to {form}" for form in ("csv", "autodrive", "rosbag2", "lerobot", "minari")]
"""Command lines that write a folder, which is never replaced."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the commands read."""
    folder = tmp_path_factory.mktemp("inputs")
    off = {"lidar": SensorSettings(is_on=False)}
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(sensors=off)}))
    with Recorder(folder / "drive.mcap", world, name="plane"):
        for tick in range(200):
            world.step({"V1": Command(0.6, 0.5 if tick % 100 < 50 else -0.5)})
    export_track(generate_track(7, length=30.0, width=1.0, area=(14.0, 8.0), name="hall"), folder)
    (folder / "line.csv").write_text("\n".join(f"{x},{y}" for x, y, *_ in Track.load("practice").centre_line.tolist()))
    (folder / "driver.py").write_text(DRIVER)
    (folder / "short.yaml").write_text(yaml.safe_dump(SHORT | {"samples": {"method": "sobol", "count": 2}, "seeds": 1}))
    return folder


def filled(folder: Path, inputs: Path) -> list[Path]:
    """The files of a folder that are not inputs, now with another content than a command writes."""
    names = {file.name for file in inputs.iterdir()}
    outputs = [file for file in sorted(folder.rglob("*")) if file.is_file() and file.name not in names]
    for file in outputs:
        file.write_bytes(MINE)
    return outputs


@pytest.mark.parametrize(
    "line",
    [
        *WRITERS,
        *(pytest.param(line, marks=pytest.mark.slow) for line in SLOW_WRITERS),
        *(pytest.param(line, marks=(pytest.mark.slow, needs_gl)) for line in GL_WRITERS),
    ],
)
def test_a_file_that_exists_is_replaced_only_with_force(line: str, inputs: Path, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(inputs, folder)
    words = shlex.split(line)
    assert call(*words, cwd=folder).returncode == 0
    outputs = filled(folder, inputs)
    assert outputs
    error = refused(*words, cwd=folder)
    assert re.search("the files? exists?: replace (it|them) with --force, or choose another name", error)
    named = error.rpartition("(")[2].removesuffix(")").split(", ")
    assert {*named[:MOST_NAMES]} <= {str(file.relative_to(folder)) for file in outputs}
    assert len(named) == min(len(outputs), MOST_NAMES + 1)
    assert [file.read_bytes() for file in outputs] == [MINE] * len(outputs)
    done = call(*words, "--force", cwd=folder)
    assert done.returncode == 0, done
    assert [file for file in outputs if file.read_bytes() == MINE] == []
    assert filled(folder, inputs) == outputs


@pytest.mark.slow
@pytest.mark.parametrize("line", FOLDERS)
def test_a_folder_is_never_replaced(line: str, inputs: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    kept = tmp_path / "mine" / "V1 Log.csv"
    kept.write_bytes(MINE)
    words = shlex.split(line.replace("drive.mcap", str(inputs / "drive.mcap")))
    for force in ([], ["--force"]):
        assert "remove that file or folder, or choose another path  (mine)" in refused(
            *words, "-o", "mine", *force, cwd=tmp_path
        )
    assert [*tmp_path.rglob("*")] == [kept.parent, kept]
    assert kept.read_bytes() == MINE


def campaign(*words: str, folder: Path) -> list[str]:
    """A campaign of short runs in this folder, as words of a command line."""
    return ["campaign", *words, "--workers", "0", "--no-cache", "-o", str(folder)]


@pytest.mark.slow
def test_a_campaign_continues_its_own_results_and_replaces_no_others(inputs: Path, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    shutil.copy(tmp_path / "short.yaml", tmp_path / "other.yaml")
    assert call(*campaign("short.yaml", folder=folder), cwd=tmp_path).returncode == 0
    files = {file: file.read_bytes() for file in folder.iterdir()}
    assert call(*campaign("short.yaml", folder=folder), cwd=tmp_path).returncode == 0
    for words in (["other.yaml"], ["short.yaml", "--falsify", "1"]):
        assert "replace them with --force" in refused(*campaign(*words, folder=folder), cwd=tmp_path)
    assert {file: file.read_bytes() for file in folder.iterdir()} == files
    assert call(*campaign("other.yaml", folder=folder), "--force", cwd=tmp_path).returncode == 0
    assert json.loads((folder / "summary.json").read_text())["campaign"] == "other"


def test_a_track_never_replaces_the_map_that_it_is_made_from(inputs: Path, tmp_path: Path) -> None:
    for name in ("hall_map.yaml", "hall_map.png"):
        shutil.copy(inputs / name, tmp_path / name.replace("hall_map.yaml", "hall.yaml"))
    before = (tmp_path / "hall.yaml").read_bytes()
    for force in ([], ["--force"]):
        error = refused("import", "track", "hall.yaml", *force, cwd=tmp_path)
        assert "made from: choose another --output  (hall.yaml)" in error
    assert (tmp_path / "hall.yaml").read_bytes() == before
    assert call("import", "track", "hall.yaml", "-o", "track.yaml", cwd=tmp_path).returncode == 0


@pytest.mark.process
@pytest.mark.parametrize(("answer", "code", "content"), [("n", 2, MINE), ("", 2, MINE), ("y", 0, b"# A scenario")])
def test_on_a_terminal_the_user_is_asked(answer: str, code: int, content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_bytes(MINE)
    ours, theirs = pty.openpty()
    os.write(ours, f"{answer}\n".encode())
    done = subprocess.run(
        [*AUTODRIVE, "new", "scenario", "mine"],
        cwd=tmp_path,
        stdin=theirs,
        stdout=subprocess.PIPE,
        stderr=theirs,
        timeout=LIMIT,
        check=False,
    )
    assert b"the file exists: replace it?  (mine.yaml) [y/N]:" in os.read(ours, 65536)
    assert done.returncode == code
    assert file.read_bytes().startswith(content)
