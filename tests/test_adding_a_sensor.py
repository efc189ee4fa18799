"""The examples of docs/adding_a_sensor.md: a sensor of the user, and a built-in sensor in a copy of the package."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

import autodrive
from autodrive import Command
from autodrive.cli.spec_files import check
from autodrive.protocol.codec import encode

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "adding_a_sensor.md").read_text(encoding="utf-8")
RADAR, USE, FILE, ROW, MESSAGE, FIELD, CHANNEL = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
SCENARIO, LINE = re.findall(r"```yaml\n(.*?)```", TEXT, flags=re.DOTALL)

PROGRAM = """
import numpy as np, autodrive, sys
from autodrive.protocol.codec import decode_server, encode
spec = autodrive.Scenario(vehicles={"V1": {"type": sys.argv[1], "yaw_deg": 30}, "V2": {"y": 1.0}})
world, batch = autodrive.make(spec), autodrive.BatchWorld(spec, 2)
for _ in range(33):
    frame = world.step({"V1": autodrive.Command(0.5, 0.5)})
    batch.step(np.tile([[0.5, 0.5], [0.0, 0.0]], (2, 1, 1)))
reading = frame.vehicles["V1"].compass
assert abs(reading.time - 0.3) < 1e-9 and frame.vehicles["V2"].compass is None
assert 0.45 < reading.heading < 0.8, reading
assert reading.heading != frame.vehicles["V1"].imu.euler[2]
time, values = batch.readings.sensor("compass")
assert (time[0, 0], values[0, 0, 0]) == (reading.time, reading.heading) and np.isnan(time[0, 1])
assert decode_server(encode(frame)).vehicles["V1"].compass == reading
saved = world.save()
future = world.step().vehicles["V1"].compass
assert world.restore(saved) and world.step().vehicles["V1"].compass == future
settings = {"compass": {"noise": "ideal", "rate": 100}}
exact = autodrive.make(autodrive.Scenario(vehicles={"V1": {"type": sys.argv[1], "sensors": settings, "yaw_deg": 30}}))
vehicle = exact.step().vehicles["V1"]
assert abs(vehicle.compass.heading - vehicle.imu.euler[2]) < 1e-12 and vehicle.compass.time == 0.01
from autodrive.protocol.channels import SIGNAL_BY_NAME
assert SIGNAL_BY_NAME["compass.heading"].read(vehicle) == vehicle.compass.heading
"""


def test_the_sensor_of_the_document_reads() -> None:
    names: dict[str, Any] = {}
    exec(RADAR + USE, names)
    reading = names["frame"].vehicles["V1"].own["radar"]
    assert reading.columns == ("distance [m]", "speed [m/s]")
    assert 3.0 < reading.values[0] < 4.0
    assert len(RADAR.strip().splitlines()) + 1 <= 10  # with the line that adds it


def test_the_scenario_of_the_document_has_the_same_sensor(tmp_path: Path) -> None:
    (tmp_path / "my_radar.py").write_text(RADAR, encoding="utf-8")
    path = tmp_path / "radar.yaml"
    path.write_text(SCENARIO, encoding="utf-8")
    assert check(str(path))[0] == "scenario"
    names: dict[str, Any] = {}
    exec(RADAR + USE, names)
    frame = autodrive.make(path).step({"V1": Command(throttle=0.5)})
    assert encode(frame) == encode(names["frame"])


@pytest.mark.slow
@pytest.mark.process
def test_the_built_in_sensor_of_the_document_needs_three_places(tmp_path: Path) -> None:
    package = tmp_path / "autodrive"
    shutil.copytree(ROOT / "src" / "autodrive", package, ignore=shutil.ignore_patterns("page", "__pycache__"))
    sensors, protocol = package / "physics" / "sensors", package / "protocol"
    (sensors / "compass.py").write_text(FILE, encoding="utf-8")
    insert(sensors / "catalog.py", "from autodrive.physics.sensors.compass import CompassSpec\n", "from autodrive.phys")
    insert(sensors / "catalog.py", "    " + ROW, "    range: RangeSpec | None = None\n")
    insert(protocol / "messages.py", MESSAGE + "\n\n", "class RangeReading(")
    insert(protocol / "messages.py", "    " + FIELD, "    race: RaceState | None = None\n")
    insert(protocol / "channels.py", CHANNEL.rstrip() + ",\n", '    _channel(\n        Signal("range.time"')
    tree = yaml.safe_load((package / "scenario" / "data" / "vehicles" / "nigel.yaml").read_text(encoding="utf-8"))
    tree["sensors"] |= yaml.safe_load(LINE)
    car = tmp_path / "car.yaml"
    car.write_text(yaml.safe_dump(tree), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(car)],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def insert(file: Path, text: str, before: str) -> None:
    """Insert a text before the first place of another one."""
    content = file.read_text(encoding="utf-8")
    assert before in content
    file.write_text(content.replace(before, text + before, 1), encoding="utf-8")
