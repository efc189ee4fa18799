"""The programs of docs/recordings.md run."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

DOCUMENT = Path(__file__).parents[2] / "docs" / "recordings.md"


def test_the_programs_of_the_document_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    programs = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), flags=re.DOTALL)
    names: dict[str, Any] = {}
    for program in programs:
        exec(program, names)
    assert names["position"].shape == (201, 3)
    printed = capsys.readouterr().out
    assert printed.startswith("2.0 ('V1',) []\n50 ")
    for line in (
        "0.0 /autodrive/scenario autodrive.Scenario",
        "0.0 /autodrive/commands autodrive.Commands",
        "0.0 /autodrive/frame autodrive.Frame",
        "0.0 /V1/lidar foxglove.LaserScan",
    ):
        assert f"\n{line}\n" in printed
