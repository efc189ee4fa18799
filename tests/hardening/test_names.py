"""Names of files that are not UTF-8: everything works with them, and every output can be read by others."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest
from mcap.reader import make_reader

from tests.support.command_line import AUTODRIVE, Started
from tests.support.native_clients import connected
from tests.support.waiting import LIMIT, free_port

NAME, ESCAPED = os.fsdecode(b"stra\xdfe"), "stra\\xdfe"


@pytest.mark.process
def test_a_scenario_in_such_a_file_is_run_served_and_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "utf-8:strict")  # as in a usual terminal
    (tmp_path / NAME).mkdir()
    scenario, recording, summary = (tmp_path / NAME / f"{NAME}{end}" for end in (".yaml", ".mcap", ".json"))
    scenario.write_text("title: Coffee\nmap: map.yaml\nvehicles: {V1: {}}\n")
    (tmp_path / NAME / "map.yaml").write_text("title: Own map\nground: {length: 4, width: 4}\n")
    port = free_port()
    options = ("--port", str(port), "--no-browser", "--no-cameras", "--folder", str(tmp_path / NAME))
    run = Started(tmp_path, "run", str(scenario), *options, "--record", str(recording), "--summary", str(summary))
    try:
        run.wait_for("press Ctrl-C to stop")
        with connected(port) as client, connected(port) as other:
            assert client.until("Scene")["scenario"].endswith(f"{ESCAPED}/{ESCAPED}.yaml")
            assert f"{ESCAPED}.yaml" in client.ask("ListFiles")["files"]
            assert client.ask("Reset", seed=None)["type"] == "Response"
            other.until(lambda message: message["type"] == "Frame" and message["time"] > 0.1)
    finally:
        code = run.end(signal.SIGTERM)
    assert code == 0, run.messages.read_text()
    assert "Traceback" not in run.messages.read_text()
    assert json.loads(summary.read_bytes())["scenario"].endswith(f"{ESCAPED}.yaml")
    with recording.open("rb") as file:
        messages = list(make_reader(file).iter_messages(["/autodrive/scenario", "/autodrive/frame"]))
    assert json.loads(messages[0][2].data)["name"].endswith(f"{ESCAPED}.yaml")
    assert len(messages) > 10


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
