"""The programs of docs/client.md and the examples run against a simulator."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import autodrive
from autodrive.connect.server.server import SimulationServer
from autodrive.world.simulation import Simulation

ROOT = Path(__file__).parents[3]
CODE = re.findall(
    r"(?<!<!-- needs cameras -->\n)```python\n(.*?)```", (ROOT / "docs" / "client.md").read_text(), flags=re.DOTALL
)


@pytest.mark.parametrize("code", CODE, ids=lambda code: code.splitlines()[-1].strip())
def test_what_the_document_shows_runs(
    code: str, server: SimulationServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    usual = autodrive.Client
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(autodrive, "Client", lambda **keywords: usual(server.url, **keywords))
    exec(code, {"autodrive": autodrive})


def test_document_has_examples() -> None:
    assert len(CODE) == 7


def test_the_example_that_draws_shows_its_path_and_its_goal(server: SimulationServer, simulation: Simulation) -> None:
    command = [sys.executable, str(ROOT / "examples" / "client" / "2_draw_path.py"), server.url, "1.0"]
    subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert set(simulation.world.drawings) == {"circle", "goal", "text"}
    assert simulation.frame.vehicles["V1"].speed > 0.05


def test_the_lockstep_example_gives_the_same_twice_and_reaches_its_line(server: SimulationServer) -> None:
    command = [sys.executable, str(ROOT / "examples" / "client" / "1_lockstep.py"), server.url]
    first, second = (
        subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout for _ in range(2)
    )
    assert first == second
    assert first.startswith("3.00 s: [")
