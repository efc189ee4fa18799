"""The notebook in examples runs, and shows worlds, Frames, readings and images."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import pytest

from tests.support.scenes import needs_gl
from tests.support.waiting import LIMIT

NOTEBOOK = Path(__file__).parents[1] / "examples/notebook/first_steps.ipynb"


def test_it_is_committed_without_output() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    assert [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []


@needs_gl
@pytest.mark.process
def test_every_cell_runs_and_what_it_returns_is_drawn() -> None:
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=LIMIT, kernel_name="python3").execute()
    shown = {}
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if output.output_type == "execute_result":
                shown[cell.source.splitlines()[-1]] = output.data
    assert "<svg" in shown["world"]["text/html"]
    assert shown["world"]["text/plain"].startswith("<World of map 'mini_map' at 0 s")
    assert "<table>" in shown["vehicle.imu"]["text/html"]
    assert "<svg" in shown["vehicle.lidar"]["text/html"]
    x = _cells(shown["frame"])["x [m]"]
    # The LIDAR is 0.145 m ahead of x and the crate at 1.4 m; a scan takes 0.14 s, in which the car drives up to 5 cm.
    assert 0.85 < float(x) < 0.92
    image: Any = shown["image"]
    assert "text/html" not in image
    width, height = struct.unpack(">II", base64.b64decode(image["image/png"])[16:24])  # PNG, 11.2.2 IHDR
    assert (width, height) == (640, 480)


def _cells(data: Any) -> dict[str, str]:
    """The cells of the first vehicle in the table of a Frame, by their head."""
    head, row = (part.replace("<th>", "<td>").split("<td>")[1:] for part in data["text/html"].split("<tr>")[1:3])
    return {name.partition("<")[0]: text.partition("<")[0] for name, text in zip(head, row, strict=True)}
