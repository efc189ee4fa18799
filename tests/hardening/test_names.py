"""Names of files that are not UTF-8: everything works with them, and every output can be read by others."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from tests.support.command_line import AUTODRIVE
from tests.support.waiting import LIMIT

NAME, ESCAPED = os.fsdecode(b"stra\xdfe"), "stra\\xdfe"


@pytest.mark.process
def test_it_is_printed_where_the_terminal_is_strict(tmp_path: Path) -> None:
    (tmp_path / NAME).write_text("")
    (tmp_path / f"{NAME}.yaml").write_text("map: plane\nvehicles: {V1: {}}\n")
    done = subprocess.run(
        [*AUTODRIVE, "check", f"{NAME}.yaml"],
        check=False,
        capture_output=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONIOENCODING": "utf-8:strict"},
        timeout=LIMIT,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(b"stra\\xdfe.yaml: ")
