"""The C++ interfaces' page and reference say what the headers say, and the page's programs run as they stand."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import autodrive
from autodrive import Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.server import Server
from tests.bridge.conftest import ROOT, eventually, free_port, is_listening
from tests.bridge.viewers import scenery
from tests.clients.conftest import BUILD, PACKAGE, run

HEADERS = PACKAGE / "include" / "autodrive"
PAGE = ROOT / "docs" / "cpp.md"


def table(struct: str, header: str) -> str:
    """The members of a struct with what the header says of them."""
    body = re.search(rf"^struct {struct} \{{\n(.*?)^\}};", (HEADERS / header).read_text(), re.MULTILINE | re.DOTALL)
    assert body, f"{header} has no struct {struct}"
    rows = []
    for line in re.sub(r"\n +///<", "", body[1]).splitlines():
        member = re.fullmatch(r" +([\w:<>, ]+?) (\w+)(?: = [^;]+)?; +///< (.*)", line)
        assert member, f"not understood: {line}"
        kind, name, what = member.groups()
        rows.append(f"| `{name}` | `{kind.replace('std::', '').replace('Eigen::', '')}` | {what} |")
    return "\n".join(["| field | type | what it is |", "|---|---|---|", *rows])


def test_the_tables_of_the_page_are_those_of_the_headers() -> None:
    page = PAGE.read_text()
    marks = re.findall(r"<!-- (\w+) of (\w+\.hpp) -->\n", page)
    assert len(marks) > 9
    for struct, header in marks:
        wanted = f"<!-- {struct} of {header} -->\n{table(struct, header)}\n\n"
        assert wanted in page, f"docs/cpp.md should have\n{wanted}"


def test_everything_public_is_documented() -> None:
    if shutil.which("doxygen") is None:
        pytest.skip("no doxygen: run scripts/cpp")
    run("doxygen", "clients/cpp/Doxyfile")  # where that warns it fails
    assert (ROOT / "build" / "doxygen" / "html" / "classautodrive_1_1Client.html").exists()


@pytest.fixture(scope="session")
def programs(build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The two programs of the page, by a project of a user's own that finds the installed package."""
    run("cmake", "--install", build)
    page, folder = PAGE.read_text(), tmp_path_factory.mktemp("mine")
    sources = re.findall(r"```cpp\n(#include.*?)```", page, re.DOTALL)
    (cmake,) = re.findall(r"```cmake\n(cmake_minimum_required.*?)```", page, re.DOTALL)
    for name, source in zip(("drive", "step"), sources, strict=True):
        (folder / f"{name}.cpp").write_text(source)
    # and the headers alone, which takes long: whether they are C++ is all that is asked
    (folder / "both.cpp").write_text(
        "#include <autodrive/client.hpp>\n#include <autodrive/devkit.hpp>\n"
        "int main() { autodrive::devkit::Server().run(); autodrive::Client().next(); }\n"
    )
    (folder / "CMakeLists.txt").write_text(
        cmake
        + "add_executable(step step.cpp)\ntarget_link_libraries(step PRIVATE autodrive::compiled)\n"
        + "add_library(both OBJECT both.cpp)\ntarget_link_libraries(both PRIVATE autodrive::autodrive)\n"
        + "target_compile_options(both PRIVATE -fsyntax-only -Wall -Wextra)\n"
    )
    run("cmake", "-S", folder, "-B", folder / "build", f"-DCMAKE_PREFIX_PATH={BUILD / 'installed'}")
    run("cmake", "--build", folder / "build", "--parallel", "2")
    return folder / "build"


def test_the_first_program_of_the_page_drives(programs: Path) -> None:
    port, simulation = free_port(), Simulation(autodrive.make("mini_map"))
    with subprocess.Popen([programs / "drive", str(port)]) as script:
        eventually(lambda: is_listening(port) or script.poll() is not None)
        with DevkitBridge(simulation, port=port) as bridge:
            simulation.run(3.0)
            assert bridge.counters.profile == "2025"
            assert bridge.counters.refused_values == 0
        script.terminate()
    assert script.returncode == 0
    assert simulation.frame.vehicles["V1"].pose.position[0] > 0.3


def test_the_lock_step_program_of_the_page_runs(programs: Path) -> None:
    simulation = Simulation(autodrive.make("mini_map"))
    with simulation, Server(simulation, scenery=scenery, port=0) as server:
        x, y, _ = map(float, run(programs / "step", server.port).split())
    assert x > 0.05
    assert abs(y) < 0.01
