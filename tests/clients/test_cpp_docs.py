"""docs/cpp.md: its tables agree with the headers, its programs run, and the reference is complete."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import autodrive
from autodrive import Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from tests.clients.conftest import BUILD, PACKAGE, PAGE, ROOT
from tests.support.builds import run
from tests.support.native_clients import scene_files
from tests.support.waiting import LIMIT, free_port, is_listening, wait_until

HEADERS = PACKAGE / "include" / "autodrive"


def table(struct: str, header: str) -> str:
    """The members of a struct with their comments in the header."""
    body = re.search(rf"^struct {struct} \{{\n(.*?)^\}};", (HEADERS / header).read_text(), re.MULTILINE | re.DOTALL)
    assert body, f"{header} has no struct {struct}"
    rows = []
    for line in re.sub(r"\n +///<", "", body[1]).splitlines():
        member = re.fullmatch(r" +([\w:<>, ]+?) (\w+)(?: = [^;]+)?; +///< (.*)", line)
        assert member, f"cannot parse: {line}"
        kind, name, what = member.groups()
        rows.append(f"| `{name}` | `{kind.replace('std::', '').replace('Eigen::', '')}` | {what} |")
    return "\n".join(["| field | type | description |", "|---|---|---|", *rows])


def test_the_tables_of_the_page_are_those_of_the_headers() -> None:
    page = PAGE.read_text()
    marks = re.findall(r"<!-- (\w+) of (\w+\.hpp) -->\n", page)
    assert marks == [("State", "telemetry.hpp"), ("Command", "telemetry.hpp"), ("Subscription", "client.hpp")]
    for struct, header in marks:
        wanted = f"<!-- {struct} of {header} -->\n{table(struct, header)}\n\n"
        assert wanted in page, f"docs/cpp.md should have\n{wanted}"


def test_everything_public_is_documented() -> None:
    if shutil.which("doxygen") is None:
        pytest.skip("no doxygen: run scripts/cpp")
    run("doxygen", "clients/cpp/Doxyfile")  # warnings are errors
    assert (ROOT / "build" / "doxygen" / "html" / "classautodrive_1_1Client.html").exists()


def test_the_devkit_program_of_the_page_drives(programs: Path) -> None:
    port, simulation = free_port(), Simulation(autodrive.make("mini_map"))
    with subprocess.Popen([programs / "drive", str(port)]) as script:
        wait_until(lambda: is_listening(port) or script.poll() is not None)
        with DevkitBridge(simulation, port=port) as bridge:
            simulation.run(3.0)
            assert bridge.counters.profile == "2025"
            assert bridge.counters.refused_values == 0
        script.terminate()
    assert script.returncode == 0
    assert simulation.frame.vehicles["V1"].pose.position[0] > 0.3


def test_the_lock_step_program_of_the_page_runs(programs: Path) -> None:
    simulation = Simulation(autodrive.make("mini_map"))
    with simulation, SimulationServer(Served(simulation, scene_files), PageOptions(port=0)) as server:
        x, y, _ = map(float, run(programs / "step", server.port).split())
    assert x > 0.05
    assert abs(y) < 0.01


def eigen_package(folder: Path, version: str) -> Path:
    """The folder of the configuration files of an Eigen; like the real ones, they accept only their major version."""
    package = folder / version
    package.mkdir()
    (package / "Eigen3Config.cmake").write_text(
        "add_library(Eigen3::Eigen INTERFACE IMPORTED)\n"
        "target_include_directories(Eigen3::Eigen INTERFACE /usr/include/eigen3)\n"
    )
    (package / "version.cmake").write_text(
        "include(CMakePackageConfigHelpers)\n"
        f"write_basic_package_version_file({package}/Eigen3ConfigVersion.cmake VERSION {version} "
        "COMPATIBILITY SameMajorVersion ARCH_INDEPENDENT)\n"
    )
    run("cmake", "-P", package / "version.cmake")
    return package


@pytest.mark.parametrize(
    ("version", "is_accepted"), [("3.2.9", False), ("3.3.0", True), ("3.4.0", True), ("5.0.1", True), ("6.0.0", False)]
)
def test_eigen_3_3_to_5_is_accepted_by_the_package_and_by_its_users(
    programs: Path, tmp_path: Path, version: str, is_accepted: bool
) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(user CXX)\nfind_package(autodrive 1.0 REQUIRED)\n"
    )
    package = eigen_package(tmp_path, version)
    for number, source in enumerate((PACKAGE, tmp_path)):
        words = ("cmake", "-S", source, "-B", tmp_path / f"build{number}", f"-DEigen3_DIR={package}")
        command = [*map(str, words), f"-DCMAKE_PREFIX_PATH={BUILD / 'installed'}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LIMIT)
        assert (done.returncode == 0) is is_accepted, done.stderr
        if is_accepted:  # and no other Eigen of this machine was taken instead
            cache = (tmp_path / f"build{number}" / "CMakeCache.txt").read_text()
            assert re.search(rf"^Eigen3_DIR:\w+={re.escape(str(package))}$", cache, re.MULTILINE)
        else:
            assert f"Eigen 3.3 to 5 is needed, and {version} was found in {package}" in " ".join(done.stderr.split())
