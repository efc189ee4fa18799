"""Settings of all tests: hypothesis, markers and xdist groups by directory, and the skips that CI accepts."""

from __future__ import annotations

import gc
import json
import os
import time
from collections import defaultdict
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
    "cli/test_outputs.py": "slow",
    "connect/server/test_user_files.py": "slow",
    "experiments/campaigns/test_campaign_document.py": "slow",
    "experiments/campaigns/test_runs.py": "slow",
    "experiments/campaigns/test_search.py": "slow",
    "experiments/envs/test_camera_observations.py": "slow",
    "experiments/envs/test_document.py": "slow",
    "experiments/envs/test_driving_vector_env.py": "slow",
    "experiments/envs/test_roboracer_env.py": "slow",
    "experiments/envs/test_several_cars.py": "slow",
    "experiments/policies/test_team.py": "slow",
    "physics/test_contact_engine.py": "slow",
    "world/racing/test_race_run.py": "slow",
    "graphics/render/test_goldens.py": "slow",
    "graphics/render/test_strips.py": "slow",
    "recording/replay/test_drawings.py": "slow",
}
"""Directory or file -> marker of all its tests."""

WITHOUT_TOOLCHAIN = {
    f"connect/ros/{name}.py" for name in ("test_bridge", "test_readings", "test_command_input", "test_dead_reckoning")
}
"""Files of these directories that need nothing but Python."""

SECOND_BROWSER = {"test_edit.py", "test_load.py", "test_screens.py", "test_view.py"}
"""Files of tests/page that have a browser and a simulator of their own: together they take as long as the others."""

GROUP_SECONDS = TESTS / "group_seconds.json"
"""Seconds of the slow groups, a copy of the file below. The slowest group starts first, so that no worker begins a long
one when the others are done."""
LAST_GROUP_SECONDS = TESTS.parent / ".venv" / "group_seconds.json"
"""Seconds of the groups in the last run of all tests; this file can replace the one above."""
LEAST_SECONDS = 5.0
"""Shorter groups are not noted."""

TOOLCHAINS = os.environ.get("AUTODRIVE_TOOLCHAINS")
"""A file that scripts/test makes when the browser and the toolchains are installed."""
LIMIT = 1800.0
"""Time after which a test no longer waits for that file [s]."""
FIRST = 4
"""Number of groups without a toolchain that start before the others: on a new machine these have to wait for it."""

ACCEPTED_SKIPS = (
    "no small file system can be mounted",
    "this processor has no AVX-512",
    "the logs of real cars are not beside the repository",
)
"""Beginnings of the reasons for which a test may be skipped where CI is set; any other skip fails the run."""

_refused: list[str] = []
_failed: list[str] = []
_group_seconds: defaultdict[str, float] = defaultdict(float)


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


def group_of_id(nodeid: str) -> str:
    return group_of(nodeid.partition("::")[0].removeprefix("tests/"))


class GroupScheduling(LoadScopeScheduling):
    """Sends the tests of a group to the same worker."""

    def _split_scope(self, nodeid: str) -> str:
        return group_of_id(nodeid)


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
    waiting = set()
    for item in items:
        marker = marker_of(item.path)
        if marker is not None:
            item.add_marker(marker)
        if needs_toolchain(item):
            waiting.add(group_of_id(item.nodeid))
    seconds: dict[str, float] = json.loads(GROUP_SECONDS.read_text())
    slowest = sorted(seconds, key=lambda group: -seconds[group])
    first = [group for group in slowest if group not in waiting][:FIRST]
    order = {group: rank for rank, group in enumerate(dict.fromkeys([*first, *slowest]))}
    items.sort(key=lambda item: order.get(group_of_id(item.nodeid), len(order)))


def needs_toolchain(item: pytest.Item) -> bool:
    return any(item.iter_markers("browser")) or any(item.iter_markers("toolchain"))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Wait until scripts/test has installed what the test needs."""
    deadline = time.monotonic() + LIMIT
    while TOOLCHAINS and needs_toolchain(item) and not Path(TOOLCHAINS).exists() and time.monotonic() < deadline:
        time.sleep(0.2)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """With CI=true a skip that is not in the list is an error: it would hide a test that never runs."""
    _group_seconds[group_of_id(report.nodeid)] += report.duration
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
    config = session.config
    is_whole = config.args_source == config.ArgsSource.TESTPATHS and not (
        config.option.markexpr or getattr(config.option, "lf", False)
    )
    if FAILED.parent.is_dir():
        FAILED.write_text("".join(f"{name}\n" for name in (*_failed, *(f"skipped: {name}" for name in _refused))))
    if FAILED.parent.is_dir() and is_whole and _group_seconds:  # empty: nothing ran, but the tests were collected
        slowest = sorted(_group_seconds.items(), key=lambda entry: -entry[1])
        noted = {group: round(spent) for group, spent in slowest if spent >= LEAST_SECONDS}
        LAST_GROUP_SECONDS.write_text(json.dumps(noted, indent=1) + "\n")
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
