"""Settings of all tests: hypothesis, markers and xdist groups by directory, and the skips that CI accepts."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

from autodrive.graphics.render.gl import GlUnavailable, probe

settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("local", deadline=None)  # a first call may compile
IS_CI = bool(os.environ.get("CI") or os.environ.get("AUTODRIVE_CI"))
"""`scripts/test` passes CI on as AUTODRIVE_CI: where CI is set, pytest prints pages for a long assertion."""

settings.load_profile("ci" if IS_CI else "local")

TESTS = Path(__file__).parent
FAILED = TESTS.parent / ".venv" / "failed-tests"
"""Names of the failed tests of the last run, one per line; scripts/test prints them at its end."""

MARKERS = {
    "page": "browser",
    "connect/ros": "toolchain",
    "clients": "toolchain",
    "hardening": "slow",
    "recording/exports": "slow",
    "recording/film": "slow",
    "graphics/cameras/test_batch_camera.py": "slow",
    "graphics/cameras/test_tick_cameras.py": "slow",
    "experiments/campaigns/test_campaign_document.py": "slow",
    "experiments/campaigns/test_search.py": "slow",
    "experiments/envs/test_document.py": "slow",
    "experiments/envs/test_driving_vector_env.py": "slow",
    "experiments/envs/test_roboracer_env.py": "slow",
    "physics/test_contact_engine.py": "slow",
    "world/racing/test_race_run.py": "slow",
    "graphics/render/test_goldens.py": "slow",
}
"""Directory or file -> marker of all its tests."""

WITHOUT_TOOLCHAIN = {
    f"connect/ros/{name}.py" for name in ("test_bridge", "test_readings", "test_command_input", "test_dead_reckoning")
}
"""Files of these directories that need nothing but Python."""

SECOND_BROWSER = {"test_edit.py", "test_load.py", "test_screens.py", "test_view.py"}
"""Files of tests/page that have a browser and a simulator of their own: together they take as long as the others."""

SLOWEST_FIRST = (
    "page",
    "second browser",
    "ros1",
    "ros2",
    "experiments/policies/test_learning.py",
    "experiments/policies/test_team.py",
    "connect/bridge/test_devkit_scripts.py",
    "test_commands.py",
    "hardening/test_recordings.py",
    "hardening/test_files.py",
    "hardening/test_processes.py",
    "hardening/test_disk.py",
    "clients",
    "test_documentation.py",
    "experiments/campaigns/test_ray.py",
    "graphics/meshes/test_map.py",
    "hardening/test_bridge.py",
    "connect/devkit/test_python_examples.py",
    "world/racing/test_race_run.py",
    "graphics/cameras/test_process_cameras.py",
    "test_processors.py",
    "connect/bridge/test_devkit_bridge.py",
    "cli/test_cli.py",
    "cli/test_cli_cameras.py",
    "world/batch/test_batch_world.py",
    "graphics/cameras/test_batch_camera.py",
    "graphics/cameras/test_tick_cameras.py",
    "hardening/test_crowd.py",
    "hardening/test_machine.py",
    "test_determinism.py",
    "test_page_logic.py",
)
"""Groups that start first, so that no worker begins a long one when the others are done."""

ACCEPTED_SKIPS = ("no small file system can be mounted", "this processor has no AVX-512")
"""Beginnings of the reasons for which a test may be skipped where CI is set; any other skip fails the run."""

_refused: list[str] = []
_failed: list[str] = []


def group_of(file: str) -> str:
    """Group of a test file, whose path is relative to tests/.

    Tests of a group run in one worker and share its session fixtures: a browser, a ROS master, a build.
    """
    directory, _, name = file.rpartition("/")
    if directory == "connect/ros":
        return "ros1" if "ros1" in name else "ros2" if "ros2" in name else "ros"
    if directory == "page":
        return "second browser" if name in SECOND_BROWSER else directory
    return directory if directory == "clients" else file


class GroupScheduling(LoadScopeScheduling):
    """Sends the tests of a group to the same worker."""

    def _split_scope(self, nodeid: str) -> str:
        return group_of(nodeid.partition("::")[0].removeprefix("tests/"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> GroupScheduling:
    """Distribute by group (`--dist loadgroup` of pytest-xdist 3.8 has no effect with pytest 9.2)."""
    return GroupScheduling(config, log)


def marker_of(path: Path) -> str | None:
    """Marker of all tests of a file or folder; None if there is none."""
    file = path.relative_to(TESTS).as_posix() if path.is_relative_to(TESTS) else ""
    return None if file in WITHOUT_TOOLCHAIN else MARKERS.get(file) or MARKERS.get(file.rpartition("/")[0])


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not import files whose tests are all left out by `-m "not MARKER and ..."`: each worker would."""
    is_left_out = collection_path.is_file() and f"not {marker_of(collection_path)}" in config.option.markexpr.split(
        " and "
    )
    return is_left_out or None


def pytest_collection_finish() -> None:
    """Leave what exists now out of the garbage collection, which saves an eighth of the time of short tests."""
    gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test by its directory, and put the slow groups first."""
    order = {group: rank for rank, group in enumerate(SLOWEST_FIRST)}

    def rank(item: pytest.Item) -> int:
        return order.get(group_of(item.path.relative_to(TESTS).as_posix()), len(order))

    for item in items:
        marker = marker_of(item.path)
        if marker is not None:
            item.add_marker(marker)
    items.sort(key=rank)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """With CI=true a skip that is not in the list is an error: it would hide a test that never runs."""
    if report.failed and report.nodeid not in _failed:
        _failed.append(report.nodeid)
    if report.skipped and IS_CI and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if not reason.removeprefix("Skipped: ").startswith(ACCEPTED_SKIPS or ("\0",)):
            _refused.append(f"{report.nodeid}: {reason}")


def pytest_collectreport(report: pytest.CollectReport) -> None:
    """A file that cannot be imported is a failure as well."""
    if report.failed and report.nodeid not in _failed:
        _failed.append(report.nodeid)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Names of failures for scripts/test, which prints them last. The exit code of a run with such skips is 3."""
    if hasattr(session.config, "workerinput"):
        return
    if FAILED.parent.is_dir():
        FAILED.write_text("".join(f"{name}\n" for name in (*_failed, *(f"skipped: {one}" for one in _refused))))
    if _refused:
        session.exitstatus = pytest.ExitCode.INTERNAL_ERROR


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests that were skipped without agreement."""
    for line in _refused:
        terminalreporter.write_line(f"NOT TO BE SKIPPED where CI is set: {line}", red=True)


@pytest.fixture(scope="session")
def gl() -> str:
    """What draws here; a test that needs pictures is skipped where nothing does."""
    try:
        return probe()
    except GlUnavailable as error:
        pytest.skip(str(error))
