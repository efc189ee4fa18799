"""The files for containers agree with the command line, the scripts and the package."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest
import typer.main
import yaml

from autodrive.cli.app import app

ROOT = Path(__file__).parents[1]
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
COMPOSE = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))["services"]


def parsed(arguments: list[str]) -> dict[str, object]:
    """The values of the options of a command of `autodrive`, which is not executed. Raises a `click` error."""
    group = typer.main.get_command(app)
    with group.make_context("autodrive", [*arguments], resilient_parsing=True) as context:
        command = group.get_command(context, arguments[0])  # pyright: ignore
        assert command is not None, arguments
        return command.make_context(arguments[0], arguments[1:], parent=context).params


def test_the_image_runs_a_command_that_other_machines_reach() -> None:
    (command,) = re.findall(r"^CMD (.*)$", DOCKERFILE, re.MULTILINE)
    options = parsed(json.loads(command))
    assert options["host"] == "0.0.0.0"
    assert not options["browser"]


def test_the_services_connect_to_each_other() -> None:
    options = parsed(shlex.split(COMPOSE["simulator"]["command"]))
    name, _, port = str(options["devkit"]).partition(":")
    assert name in COMPOSE["simulator"]["depends_on"]
    script = DOCKERFILE.partition("FROM python AS script\n")[2].partition("\nFROM")[0]
    assert f"EXPOSE {port}" in script
    assert COMPOSE[name]["build"]["target"] == "script"
    copied, target = re.findall(r"^COPY (examples\S*) (\S+)$", script, re.MULTILINE)[0]
    program = json.loads(re.findall(r"^ENTRYPOINT (.*)$", script, re.MULTILINE)[0])[1]
    assert (ROOT / copied / Path(program).relative_to(target)).is_file()


@pytest.mark.parametrize("name", ["libegl1", "libgl1", "libgl1-mesa-dri"])
def test_the_image_has_the_graphics_packages_of_the_installation(name: str) -> None:
    packages = r"apt(?:_install|-get install -y -q --no-install-recommends) ([a-z0-9 -]+)"
    assert name in " ".join(re.findall(packages, (ROOT / "scripts/setup").read_text(encoding="utf-8"))).split()
    assert name in " ".join(re.findall(packages, DOCKERFILE)).split()


def test_no_stage_runs_as_root() -> None:
    for stage in ("script", "simulator"):
        text = DOCKERFILE.partition(f"AS {stage}\n")[2].partition("\nFROM")[0]
        assert re.search(r"^USER [1-9]\d*:[1-9]\d*$", text, re.MULTILINE)
