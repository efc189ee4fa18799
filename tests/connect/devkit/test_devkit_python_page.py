"""docs/devkit_python.md: its tables match the devkit, and its program drives."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.devkit import F1TENTH, Nigel
from autodrive.protocol.devkit import telemetry
from autodrive.protocol.devkit_profile import PROFILES
from tests.protocol.devkit_frames import frame
from tests.support.waiting import free_port, is_listening, wait_until

PAGE = (Path(__file__).parents[3] / "docs" / "devkit_python.md").read_text()


def rows(*, of_commands: bool) -> dict[str, str]:
    """Attribute -> type, of one of the two tables."""
    lines = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| ([\w, ().]+) \|", PAGE, re.MULTILINE)
    found = {name: kind for names, kind in lines for name in re.findall(r"\w+", names)}
    return {name: kind for name, kind in found.items() if name.endswith(("_command", "_mode")) == of_commands}


def test_the_tables_have_all_attributes_of_a_vehicle() -> None:
    cars = Nigel("V1"), F1TENTH("V1")
    names = {name for car in cars for name in dir(car) if not name.startswith("_") and not callable(getattr(car, name))}
    assert {*rows(of_commands=False), *rows(of_commands=True)} == names - {"id"}


def test_each_attribute_is_of_the_type_that_the_table_says() -> None:
    car = F1TENTH("V1")
    car.parse_data(telemetry(frame(), PROFILES["2025"]) | telemetry(frame(), PROFILES["roboracer"]))
    for name, kind in rows(of_commands=False).items():
        value = getattr(car, name)
        if kind in ("float", "int"):
            assert type(value).__name__ == kind, name
        else:
            dtype, shape = kind.split(", ", 1)
            assert value.dtype == np.dtype(dtype), name
            sizes = [size for size in shape.strip("()").split(", ") if size]
            assert value.ndim == len([size for size in sizes if size.rstrip(",")]), name
            if sizes[0].rstrip(",").isdigit():
                assert value.shape == (int(sizes[0].rstrip(",")),), name


def test_each_command_takes_the_values_that_the_table_says() -> None:
    nigel = Nigel("V1")
    for name, kind in rows(of_commands=True).items():
        setattr(nigel, name, {"float": 0.5, "int": 1, "bool": True}[kind])
    assert nigel.generate_commands() == {
        "V1 Throttle": "0.5", "V1 Steering": "0.5", "V1 Headlights": "1", "V1 Indicators": "1", "V1 Reset": "True",
        "V1 Steering Sign": "right", "V1 CoSim": "1", "V1 PosX": "0.5", "V1 PosY": "0.5", "V1 PosZ": "0.5",
        "V1 RotX": "0.5", "V1 RotY": "0.5", "V1 RotZ": "0.5", "V1 RotW": "0.5",
    }  # fmt: skip


@pytest.mark.process
def test_the_first_program_drives(tmp_path: Path) -> None:
    (source,) = re.findall(r"`my_script.py`:\n\n```python\n(.*?)```", PAGE, re.DOTALL)
    port = free_port()
    (tmp_path / "my_script.py").write_text(source.replace("drive(step, nigel)", f"drive(step, nigel, port={port})"))
    simulation = Simulation(autodrive.make("mini_map"))
    with subprocess.Popen([sys.executable, tmp_path / "my_script.py"]) as script:
        wait_until(lambda: is_listening(port) or script.poll() is not None)
        with DevkitBridge(simulation, port=port) as bridge:
            simulation.run(2.0)
            assert bridge.counters.profile == "2025"
        script.kill()
    assert simulation.frame.vehicles["V1"].pose.position[0] > 0.2
