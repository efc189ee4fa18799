"""What the README says is so: its example runs, its commands, options, files and scripts exist."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import pytest

from autodrive.cli import app, typer

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_python_example_runs_and_the_car_has_moved() -> None:
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(example, "README.md", "exec"), {})
    speed = re.search(r"^(-?\d+\.\d+) m/s at \[.*\], nearest wall \d+\.\d+ m$", said.getvalue(), re.MULTILINE)
    assert speed, said.getvalue()
    assert float(speed[1]) > 0.01


def test_the_table_of_the_command_line_is_complete() -> None:
    commands = typer.main.get_command(app).commands  # pyright: ignore[reportAttributeAccessIssue]
    assert set(re.findall(r"^\| `autodrive (\w+)", README, re.MULTILINE)) == set(commands)
    options = {option for parameter in commands["run"].params for option in parameter.opts if option.startswith("--")}
    assert set(re.findall(r"^\| &emsp;`(--[\w-]+)", README, re.MULTILINE)) == options - {"--help"}


@pytest.mark.parametrize(
    "path", sorted(set(re.findall(r"\]\(((?!http)[^)#]+)\)|`((?:scripts|benchmarks)/[\w./-]+)", README)))
)
def test_what_it_points_to_is_there(path: tuple[str, str]) -> None:
    assert (ROOT / (path[0] or path[1]).split(" ")[0]).exists()
