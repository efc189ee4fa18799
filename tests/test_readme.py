"""README.md and docs/command_line.md against the code: example, commands, options, links."""

from __future__ import annotations

import contextlib
import io
import json
import re
from pathlib import Path
from typing import Any

import typer

from autodrive.cli.app import app
from tests.support.command_line import call

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMAND_LINE = (ROOT / "docs/command_line.md").read_text(encoding="utf-8")


def test_the_python_example_runs_and_the_car_has_moved() -> None:
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(example, "README.md", "exec"), {})
    speed = re.search(r"^(-?\d+\.\d+) m/s at \[.*\], nearest wall \d+\.\d+ m$", output.getvalue(), re.MULTILINE)
    assert speed, output.getvalue()
    assert float(speed[1]) > 0.01


def test_the_commands_for_a_scenario_of_your_own_run(tmp_path: Path) -> None:
    """In the order of README.md, with the scenario that stands there."""
    (scenario,) = re.findall(r"```yaml\n(.*?)```", README, re.DOTALL)
    (tmp_path / "my_scenario.yaml").write_text(scenario)
    block = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)[-1]
    commands = [line.partition("#")[0].split() for line in block.splitlines()]
    assert len(commands) == 5
    for program, *arguments in commands:
        assert program == "autodrive"
        if arguments != ["doctor"]:  # its result depends on the machine
            done = call(*arguments, cwd=tmp_path)
            assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"my_scenario.yaml", "my_scenario.png", "summary.json"}
    assert json.loads((tmp_path / "summary.json").read_text())["simulated_time"] == 10.0


def test_the_page_on_the_command_line_lists_all_commands_and_options() -> None:
    commands: dict[str, Any] = vars(typer.main.get_command(app))["commands"]
    assert set(re.findall(r"^\| `autodrive (\w+)", COMMAND_LINE, re.MULTILINE)) == set(commands)
    documented = set(re.findall(r"(?<![\w-])--[\w-]+", "\n".join(re.findall(r"^\| `.*", COMMAND_LINE, re.MULTILINE))))
    for name, command in commands.items():
        options = {
            option
            for parameter in command.params
            for option in (*parameter.opts, *parameter.secondary_opts)
            if option.startswith("--")
        }
        assert options - {"--help"} <= documented, name
    section = COMMAND_LINE.partition("## autodrive run")[2].partition("\n## ")[0]
    in_table = set(re.findall(r"--[\w-]+", " ".join(re.findall(r"^\| (`[^|]*) \|", section, re.MULTILINE))))
    run = commands["run"]
    assert in_table == {o for p in run.params for o in (*p.opts, *p.secondary_opts) if o.startswith("--")} - {"--help"}
