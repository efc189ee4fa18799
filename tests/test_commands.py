"""The commands of the pages run as they are written, in the environment of `scripts/run`, in the root of a clone.

A folder with links to the files of the repository stands for the clone, so that what the commands write goes away.
"""

from __future__ import annotations

import functools
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import typer

from autodrive.cli.app import app
from tests.support.command_line import call
from tests.support.waiting import LIMIT
from tests.test_documentation import DOCUMENTS, ROOT

NOT_RUN_HERE = {
    r"(sudo apt-get|pip|python3 -m venv|simulator/bin/pip) ": "changes the machine or the environment",
    r"\.venv/bin/pre-commit ": "changes the checkout",
    r"(\.|export) ": "changes the shell",
    r"(ip|ssh) ": "needs root or another machine",
    r"docker ": "needs a container engine; tests/test_containers.py compares its files with the command line",
    r"ray ": "starts a cluster; tests/experiments/campaigns/test_ray.py starts one",
    r"(mkdir|rosdep|colcon|ros2) ": "needs ROS 2 as its distributions install it; scripts/ros2 does the same here",
    r"cmake ": "builds for minutes what scripts/cpp also builds; tests/clients uses it",
    r"scripts/run": "installs what scripts/test has installed, and starts `autodrive`, as tests/cli does",
    r"scripts/(test|setup)": "is scripts/test, or a step of it",
    r"scripts/(ros1|generate-messages)": "tests/connect/ros and tests/protocol run it",
    r"\.venv-devkit": "tests/connect/bridge runs the program",
    r"python (first_lap|my_script|examples/python)": "runs for ever; tests/connect/devkit runs the program",
    r"python examples/learning": "learns for minutes; tests/experiments/policies runs the program with few steps",
    r"python -m tests.support": "writes a file of the repository; a test compares the file",
    r"autodrive campaign ": "takes minutes; tests/experiments/campaigns runs it with fewer runs",
    r"autodrive twin ": "needs a log of the user; tests/recording/exports runs it",
    r"autodrive identify ": "takes minutes; tests/experiments/identification runs it",
    r"autodrive parity ": "needs a log of a car; tests/experiments/deployment makes one",
    r"autodrive race .*--devkit|autodrive play .*--port": "waits for the other one; tests/world/racing runs both",
    r"autodrive play runs/": "needs a trained policy; tests/experiments/policies trains and plays one",
    r"autodrive play (crossing|duel)": "needs a network, or a minute; tests/experiments/policies plays all of them",
    r"autodrive run --host 0\.0\.0\.0": "opens this machine to others; tests/connect/server does so for one test",
    r"autodrive (import track|compare (\"V1 Log|\w+\.csv|bags|lab))": "needs a file of the user; other tests run it",
    r"autodrive (film|replay) (lap|recordings/)": "needs a recording with cameras; tests/recording runs it",
    r"autodrive (run|export recording) .*town\.mcap": "draws for a minute; tests/recording/exports runs it",
}
"""Pattern of the beginning of a command -> why it does not run here."""

SHORTER = {"--laps 10": "--laps 1", "--length 70": "--length 20"}
"""What makes a command long -> what stands there when it runs here."""

LASTING = re.compile(r"autodrive (run (?!.*--duration)|race|play (?!.*--headless))")
"""A command that runs until Ctrl-C."""


def commands(path: Path) -> list[str]:
    """The commands of a page, without comments."""
    text = "\n".join(re.findall(r"^```sh\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL))
    text = text.replace("\\\n", " ")
    lines = (line.partition(" #")[0].strip() for line in text.splitlines())
    return [line for line in lines if line and not line.startswith("#")]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_a_command_that_does_not_run_here_exists_with_its_options(path: Path) -> None:
    known: dict[str, Any] = vars(typer.main.get_command(app))["commands"]
    for line in (command for command in commands(path) if not runs_here(command)):
        program, *words = re.split(r"&&|\|\||;|\|", line)[0].split()
        if program == "scripts/run" and words:
            program = "autodrive"
        if program.removeprefix(".venv/bin/") == "autodrive" and words:
            inner = getattr(known[words[0]], "commands", {}).get(words[1] if words[1:] else "", known[words[0]])
            options = {
                option for parameter in inner.params for option in (*parameter.opts, *parameter.secondary_opts)
            } | {"--help"}
            assert {word for word in words if word.startswith("--")} <= options, line
        for word in (program, *words):
            is_file = re.match("(scripts|examples|benchmarks)/[^*]+$", word)
            assert not is_file or (ROOT / word).exists(), line


def runs_here(command: str) -> bool:
    """Whether this file runs the command."""
    return not any(re.match(pattern, command) for pattern in NOT_RUN_HERE)


def runnable() -> dict[Path, list[str]]:
    """Page -> commands that run here and that no earlier page has. tests/test_readme.py runs those of README.md."""
    seen: set[str] = set()
    found: dict[Path, list[str]] = {}
    for page in (path for path in DOCUMENTS if path.name != "README.md"):
        new = [command for command in commands(page) if runs_here(command) and command not in seen]
        seen.update(new)
        if new:
            found[page] = new
    return found


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize(("page", "lines"), runnable().items(), ids=lambda value: getattr(value, "name", ""))
def test_the_commands_of_a_page_run(page: Path, lines: list[str], tmp_path: Path) -> None:
    for file in ROOT.iterdir():
        if not file.name.startswith("."):
            (tmp_path / file.name).symlink_to(file)
    variables = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "BROWSER": "true"}
    output = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    for command in lines:
        program, *arguments = shlex.split(
            functools.reduce(lambda text, it: text.replace(*it), SHORTER.items(), command)
        )
        if program == "autodrive" and not LASTING.match(command):  # in this process, which has imported everything
            done = call(*arguments, cwd=tmp_path)
            assert done.returncode == 0, f"{command}: {done}"
            continue
        with subprocess.Popen([program, *arguments], cwd=tmp_path, env=variables, **output) as process:
            assert process.stdout is not None
            if LASTING.match(command):
                begin = _until(process.stdout, "press Ctrl-C to stop")
                assert any("http://" in line for line in begin), f"{command}: no address of a page: {begin}"
                process.send_signal(signal.SIGINT)
            printed, _ = process.communicate(timeout=4 * LIMIT)  # some compute minutes of driving
        assert process.returncode == 0, f"{command}: {printed}"


def _until(lines: Iterable[str], end: str) -> list[str]:
    """The lines up to the first one that contains `end`, or all."""
    found = []
    for line in lines:
        found.append(line)
        if end in line:
            break
    return found


def test_each_reason_is_that_of_a_command() -> None:
    everything = [command for path in DOCUMENTS for command in commands(path)]
    for pattern in NOT_RUN_HERE:
        assert any(re.match(pattern, command) for command in everything), f"no page has a command like {pattern}"
