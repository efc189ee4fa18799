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
from tests.clients.conftest import PACKAGE, PAGE, ROOT
from tests.support.builds import run
from tests.support.native_clients import scene_files
from tests.support.waiting import free_port, is_listening, wait_until

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
