"""Every place that writes a file: whole or not at all; a full disk or a read-only folder is one line."""

from __future__ import annotations

import functools
import gc
import itertools
import math
import os
import re
import resource
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import recording
from autodrive.base import jit
from autodrive.base.cache import check_writable, write_file
from autodrive.base.errors import AutodriveError, EngineError
from autodrive.cli import generate, messages, preview
from autodrive.experiments.campaigns import Campaign, ray_executor, run_campaign
from autodrive.experiments.campaigns.runner import RunResult
from autodrive.experiments.campaigns.table import Table
from autodrive.experiments.envs import race_tracks
from autodrive.experiments.identification.result import Identification
from autodrive.experiments.policies import Policy
from autodrive.graphics.meshes import store
from autodrive.recording import Recorder, Recording
from autodrive.recording.exports import FORMATS, export
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.film.video import Video
from autodrive.recording.plot import plot
from autodrive.run import RunOptions, simulate
from autodrive.run.own_files import UserFiles
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.tracks.tables import write_centre_line
from autodrive.scenario.tracks.track import Track
from autodrive.world.racing.results import RaceRecorder, RaceResult, write_results
from tests.support.cars import car_file, small_images
from tests.support.command_line import AUTODRIVE, call, refused
from tests.support.hardening import fill, make_read_only, small_disk
from tests.support.waiting import LIMIT

OLD = "old content"

RUN = ("run", "plane", "--headless", "--no-cameras", "--speed", "max", "--duration", "0.1", "--summary", "s.json")
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "cli/run.py": (RUN, ("s.json",)),
    "scenario/maps/draw.py": (("show", "mini_map", "-o", "map.png"), ("map.png",)),
    "cli/spec_files.py": (("show", "mini_map", "-o", "map.svg"), ("map.svg",)),
    "cli/preview.py": (("show", "construction_box", "--3d", "view.png"), ("view.png",)),
    "scenario/maps/raster.py": (("show", "mini_map", "--occupancy", "."), ("mini_map.png", "mini_map.yaml")),
    "scenario/maps/raster.py, labels": (("show", "mini_map", "--labels", "labels.png"), ("labels.png",)),
    "scenario/tracks/ros_map.py": (
        ("export", "track", "practice", "--output", "."),
        ("practice_map.png", "practice_map.yaml"),
    ),
    "cli/urdf.py": (("urdf", "nigel", "--output", "ros"), ("ros/package.xml",)),
    "cli/new.py": (("new", "scenario", "mine"), ("mine.yaml",)),
}
"""A command for each module that writes a file for a user, and files that it writes."""
PRACTICE = Track.load("practice")
CAMPAIGN = Campaign.load(Path(__file__).parents[2] / "examples" / "campaign" / "start_pose.yaml")
NO_ERRORS: Any = None  # what is not written here
IDENTIFIED = Identification((), NO_ERRORS, NO_ERRORS, (), 0, 0.0, (), "title: Fitted\n")
POLICY = Policy("time_trial", ("speed",), (1.0,), (0.0, 1.0), ((np.ones((2, 1), np.float32), np.zeros(2, np.float32)),))
OPTIONS = RunOptions("plane", duration=0.1, speed=None, cameras=False, has_page=False)
PROGRAMS: dict[str, tuple[Callable[[Path], object], tuple[str, ...]]] = {
    "cli/generate.py": (lambda folder: generate.main([str(folder)]), ("vehicles/nigel.glb", "lights.json")),
    "cli/messages.py": (lambda folder: messages.main(folder, folder), ("messages.ts", "channels.ts", "messages.hpp")),
    "run/runner.py": (
        lambda folder: simulate(replace(OPTIONS, summary=folder / "summary.json")),
        ("summary.json",),
    ),
    "scenario/tracks/track.py": (lambda folder: PRACTICE.save(folder / "track.yaml"), ("track.yaml",)),
    "scenario/tracks/tables.py": (
        lambda folder: write_centre_line(folder / "line.csv", PRACTICE.centre_line),
        ("line.csv",),
    ),
    "world/racing/results.py": (lambda folder: write_results(folder, *raced(), PRACTICE), ("result.json",)),
    "experiments/envs/race_tracks.py": (
        lambda folder: race_tracks.write_tracks(1, 1, ((1.4, 1.4), (40.0, 40.0)), race_tracks.AREA, folder),
        ("track_0.yaml",),
    ),
    "experiments/campaigns/runs.py": (
        lambda folder: run_campaign(CAMPAIGN, folder / "r", workers=0),
        ("r/report.html",),
    ),
    "experiments/campaigns/ray_executor.py": (
        lambda folder: ray_executor.kept_here(RunResult(0, recording=str(folder / "r" / "1.mcap")), b"1"),
        ("r/1.mcap",),
    ),
    "experiments/campaigns/table.py": (lambda folder: Table(folder, CAMPAIGN).finish(), ("table.parquet",)),
    "experiments/identification/result.py": (lambda folder: IDENTIFIED.write(folder / "fitted.yaml"), ("fitted.yaml",)),
    "experiments/policies/policy.py": (lambda folder: POLICY.save(folder / "policy.npz"), ("policy.npz",)),
    "recording/outputs.py": (
        lambda folder: Recorder(folder / "recorded.mcap", autodrive.make("plane"), has_meshes=False),
        ("recorded.mcap",),
    ),
    "recording/plot.py": (
        lambda folder: plot(recorded(), ["V1/throttle"], folder / "plot.svg"),
        ("plot.svg",),
    ),
    "run/own_files.py": (lambda folder: UserFiles(folder).save("own", "title: Own", replaces=True), ("own.yaml",)),
}
"""What else writes a file for a user, by module, and files that it writes."""


@functools.cache
def recorded() -> Recording:
    """A recording of some ticks."""
    path = Path(tempfile.mkdtemp()) / "run.mcap"
    simulate(replace(OPTIONS, record=path))
    return recording.open(path)


@functools.cache
def pictured() -> Recording:
    """A recording of some ticks with small images."""
    folder = Path(tempfile.mkdtemp())
    vehicles = {"V1": VehiclePlacement(type=car_file(folder, small_images(32, 24)))}
    world = autodrive.make(ScenarioSpec(vehicles=vehicles), cameras="small")
    with Recorder(folder / "run.mcap", world, has_meshes=False):
        for _ in range(5):
            world.step()
    return recording.open(folder / "run.mcap")


@functools.cache
def raced() -> tuple[RaceResult, RaceRecorder]:
    """The result of a race that nobody has finished."""
    world = autodrive.make(ScenarioSpec(map="practice", vehicles={"V1": VehiclePlacement(type="roboracer")}))
    recorder = RaceRecorder()
    recorder.publish(world.step())
    result = RaceResult(
        version=autodrive.__version__,
        track="practice",
        length=PRACTICE.length,
        rules="practice",
        title="Practice",
        is_lockstep=True,
        seed=0,
        simulated_time=world.time,
        wall_time=0.0,
        ended_by="test",
        standings=recorder.standings(),
    )
    return result, recorder


def one_line(match: str, write: Callable[[], object]) -> None:
    """Writing raises that error, in one line."""
    with pytest.raises(AutodriveError, match=match) as raised:
        write()
    assert "\n" not in str(raised.value)
    del raised
    gc.collect()  # closes the files of the libraries, so that the disk can be removed


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_an_export_that_cannot_be_written_raises_one_line(
    name: str, disk: tuple[Path, str], request: pytest.FixtureRequest
) -> None:
    folder, _ = disk
    needs_images = name in {"coco", "yolo"}
    if needs_images:
        request.getfixturevalue("gl")
    source = pictured() if needs_images else recorded()
    one_line(r"cannot (be )?writ", lambda: export(source, name, folder / "exported", ExportOptions()))
    assert not (folder / "exported").exists()


def test_a_dataset_of_minari_whose_library_aborts_is_one_line_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As pyarrow does now and then when a disk is full; here at once."""
    from autodrive.recording.exports import minari_dataset

    aborting = [sys.executable, "-c", "import os; os.abort()"]
    monkeypatch.setattr(
        minari_dataset,
        "start_module",
        lambda _: subprocess.Popen(aborting, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL),
    )
    one_line(
        "cannot write: the process of Minari ended with SIGABRT", lambda: export(recorded(), "minari", tmp_path / "m")
    )
    assert not (tmp_path / "m").exists()


def test_a_rerun_file_that_does_not_fit_is_one_line_and_nothing_is_left(tmp_path: Path) -> None:
    """The disk becomes full in the middle of the file, which Rerun itself writes in the background."""
    with small_disk(tmp_path, kilobytes=64) as folder:
        full = "^cannot write: No space left on device  "
        one_line(full, lambda: export(recorded(), "rerun", folder / "exported.rrd"))
        assert list(folder.iterdir()) == []


def test_a_film_that_cannot_be_written_raises_one_line(disk: tuple[Path, str]) -> None:
    folder, _ = disk

    def film() -> None:
        image = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
        with Video(folder / "a.webm", (64, 64), 30) as video:
            for _ in range(200):
                video.write(image)

    one_line("cannot be written", film)
    assert not list(folder.glob("*.webm"))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


REASONS = ("No space left on device", "Read-only file system")


def each_with_one_reason(modules: Iterable[str]) -> list[tuple[str, str]]:
    """Every module with one reason, in turn: all write with the same function of `cache.py`."""
    return list(zip(modules, itertools.cycle(REASONS), strict=False))


def test_a_run_whose_recording_does_not_fit_ends_with_a_code_of_its_own(tmp_path: Path) -> None:
    with small_disk(tmp_path, kilobytes=256) as folder:
        done = call(*RUN, "--record", "run.mcap", cwd=folder)
        assert done.returncode == 3
        assert re.search(r"the recording ended at [\d.]+ s: cannot write: No space left on device", done.stderr)
        assert "ended by duration" in done.stdout


@pytest.fixture(params=REASONS)
def disk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A disk with an old file of each name that is written here, on which nothing can be written; and the reason."""
    with small_disk(tmp_path, kilobytes=256) as disk:
        for _, names in (*COMMANDS.values(), *PROGRAMS.values()):
            for name in names:
                (disk / name).parent.mkdir(exist_ok=True)
                (disk / name).write_text(OLD)
        fill(disk / "full")
        if request.param.startswith("Read-only"):
            make_read_only(disk)
        yield disk, request.param


@pytest.mark.parametrize(
    ("module", "disk"), [("cli/run.py", REASONS[1]), *each_with_one_reason(COMMANDS)], indirect=["disk"]
)
def test_a_command_that_cannot_write_is_one_line_and_leaves_the_old_files(
    module: str, disk: tuple[Path, str], gl: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preview, "SIZE", (320, 200))
    folder, reason = disk
    before = contents(folder)
    arguments, _ = COMMANDS[module]
    if arguments == RUN and "space" in reason:  # only the end of the run finds out
        done = call(*arguments, "--force", cwd=folder)
        assert done.returncode == 2
        assert "ended by duration" in done.stdout  # the summary, which is nowhere else
        assert done.stderr.splitlines()[-1] == f"autodrive: cannot write: {reason}  (s.json)"
    else:
        assert f"cannot write: {reason}  (" in refused(*arguments, "--force", cwd=folder)
    assert contents(folder) == before


@pytest.mark.parametrize(("module", "disk"), each_with_one_reason(PROGRAMS), indirect=["disk"])
def test_a_program_that_cannot_write_raises_one_line_and_leaves_the_old_files(
    module: str, disk: tuple[Path, str]
) -> None:
    folder, reason = disk
    before = contents(folder)
    program, _ = PROGRAMS[module]
    with pytest.raises(AutodriveError, match=f"^cannot write: {reason}  "):
        program(folder)
    assert contents(folder) == before


FOLDERS = {"autodrive.cli.messages": 2, "autodrive.cli.generate": 1}
"""Program of developers -> the number of folders that it is given."""


@pytest.mark.process
@pytest.mark.parametrize(("module", "disk"), each_with_one_reason(FOLDERS), indirect=["disk"])
def test_a_program_of_developers_prints_that_line(module: str, disk: tuple[Path, str]) -> None:
    folder, reason = disk
    done = subprocess.run(
        [sys.executable, "-m", module, *[str(folder)] * FOLDERS[module]],
        check=False,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert f": cannot write: {reason}  (" in line


def test_without_a_writable_cache_meshes_are_built_in_memory(
    disk: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, _ = disk
    before = contents(folder)
    expected = store.file("box", (0.1, 0.2, 0.3))
    monkeypatch.setattr(store, "folder", lambda: folder / "assets")
    for _ in range(2):
        assert store.file("box", (0.1, 0.2, 0.3)) == expected
    assert contents(folder) == before


def test_without_a_writable_cache_functions_are_compiled_in_memory_with_one_line(
    disk: tuple[Path, str], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder, reason = disk
    before = contents(folder)
    monkeypatch.setattr(jit, "CACHE", folder)
    monkeypatch.setattr(jit, "reported", [])
    for _ in range(2):
        assert jit.jit(_doubled)(1.5) == 3.0
    (line,) = caplog.messages
    assert reason in line
    assert contents(folder) == before


def _doubled(x: float) -> float:
    return 2.0 * x


def test_the_doctor_names_a_cache_that_cannot_be_written(
    disk: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, reason = disk
    monkeypatch.setattr(jit, "CACHE", folder / "numba")
    done = call("doctor")
    assert "Traceback" not in done.stderr
    if "Read-only" in reason:
        assert f"numba: {reason}; every start would compile the code again" in done.stdout


def test_the_log_of_the_engine_is_not_needed(disk: tuple[Path, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes its warnings to a file in the current folder."""
    folder, _ = disk
    monkeypatch.chdir(folder)
    world = autodrive.make("plane")
    world.compiled.state.qvel[0] = math.nan
    with pytest.raises(EngineError, match="unstable"):
        world.step()
    assert world.reset().tick == 0
    assert world.step().tick == 1


@pytest.mark.process
def test_output_to_a_full_disk_is_one_line() -> None:
    with Path("/dev/full").open("w") as output:
        done = subprocess.run(
            [*AUTODRIVE, "list", "scenarios"],
            check=False,
            stdout=output,
            stderr=subprocess.PIPE,
            text=True,
            timeout=LIMIT,
        )
    assert done.stderr.splitlines() == ["autodrive: cannot write: No space left on device"]
    assert done.returncode == 2


def test_a_file_that_grows_too_large_leaves_the_old_one(tmp_path: Path) -> None:
    file = tmp_path / "file"
    write_file(file, OLD)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(AutodriveError, match=r"cannot write: File too large  \(.*file\)"):
            write_file(file, bytes(1001))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert file.read_text() == OLD
    assert os.listdir(tmp_path) == ["file"]


def test_a_reader_sees_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    """The one that is open stays complete."""
    file = tmp_path / "file"
    write_file(file, OLD)
    with file.open() as reader:
        write_file(file, "new")
        assert reader.read() == OLD
    assert file.read_text() == "new"


def test_links_modes_and_devices_stay_what_they_are(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    write_file(file, OLD)
    plain = tmp_path / "plain"
    plain.write_text(OLD)
    assert file.stat().st_mode == plain.stat().st_mode
    file.chmod(0o640)
    link.symlink_to(file)
    write_file(link, "new")
    assert link.is_symlink()
    assert file.read_text() == "new"
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    write_file(Path("/dev/null"), "nothing")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_a_check_before_the_run_changes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "file"
    check_writable(file)
    assert not file.exists()
    write_file(file, OLD)
    check_writable(file)
    assert file.read_text() == OLD
    for bad in (tmp_path, tmp_path / "no" / "file", file / "file"):
        with pytest.raises(AutodriveError, match="cannot write"):
            check_writable(bad)
        with pytest.raises(AutodriveError, match="cannot write"):
            write_file(bad, OLD)
