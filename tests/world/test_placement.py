"""Where a scenario places its vehicles and boxes: `check`, `run`, `make` and edits say the same about it."""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.base.specs import joined
from autodrive.cli import spec_files
from autodrive.protocol.messages import SetSensor
from autodrive.run import RunOptions, simulate
from autodrive.scenario import ScenarioSpec, VehiclePlacement, kinds
from autodrive.scenario.files import read_scenario
from autodrive.world.editing.editor import Editor
from autodrive.world.factory import new_world

STREET = """title: Street
placements:
  - {{module: straight_road, x: 0.0, y: 0.0, open: true}}
  {placement}
walls:
  - {{points: [[-1, -1], [2, -1], [2, 2], [-1, 2]], is_closed: true, height: 0.25}}
"""
OUTSIDE = "is outside the walls of map 'street', which enclose x from -1 to 2 m and y from -1 to 2 m"
FAULTS = {
    "V1: {x: 50}": f"warning: V1 at (50, 0) {OUTSIDE}",
    "V1: {x: 0, y: -9}": f"warning: V1 at (0, -9) {OUTSIDE}",
    "V1: {type: small.yaml}": (
        "warning: V1: the wheels and colliders of 'Nigel' fill 0.3 x 0.175 x 0.24 m, but 'size' is "
        "3 x 1.75 x 0.182 m: other objects can pass into the body of the vehicle; change 'platforms' or 'size'"
    ),
    "V1: {x: 0.3}, V2: {x: 0.4}": "'V1' and 'V2' overlap at the start; move one of them",
    "V1: {x: 1.9, y: 1}": "'V1' and 'wall_2' overlap at the start; move one of them",
    "boxes: a: {x: 5, y: 1}": f"warning: box 'a' at (5, 1) {OUTSIDE}",
    "boxes: a: {x: 1, y: 1}, b: {x: 1.02, y: 1}": "box 'a' overlaps box 'b' by 80 cm^2. Move one of them.",
    "boxes: a: {x: 2, y: 1}": "box 'a' overlaps 'wall_2' by 100 cm^2. Move one of them.",
    "placement: - {module: straight_road, x: 0.1, y: 0, open: true}": (
        "placement 1 'straight_road' overlaps placement 2 'straight_road'"
    ),
}
"""What is in the scenario -> what is said about it."""


@pytest.fixture(params=FAULTS)
def fault(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, str]:
    """A file, and the text."""
    key, _, value = request.param.partition(": ")
    (tmp_path / "street.yaml").write_text(STREET.format(placement=value if key == "placement" else ""))
    nigel = kinds.find("vehicle", "nigel").read_text()
    (tmp_path / "small.yaml").write_text(nigel.replace("size: [0.300, 0.175, 0.182]", "size: [3.00, 1.75, 0.182]"))
    vehicles = request.param if key.startswith("V") else "V1: {x: 0.2}"
    text = f"map: {tmp_path / 'street.yaml'}\nvehicles: {{{vehicles}}}\n"
    text = text.replace("small.yaml", str(tmp_path / "small.yaml"))
    file = tmp_path / "placed.yaml"
    file.write_text(text + (f"boxes: {{{value}}}\n" if key == "boxes" else ""))
    return file, FAULTS[request.param]


def by_check(file: Path, _: pytest.LogCaptureFixture) -> list[str]:
    return spec_files.check(str(file))[2]


def by_make(file: Path, _: pytest.LogCaptureFixture) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        autodrive.make(file).close()
    assert all(one.filename == __file__ for one in caught)
    return [str(one.message) for one in caught]


def by_run(file: Path, caplog: pytest.LogCaptureFixture) -> list[str]:
    with caplog.at_level(logging.WARNING):
        simulate(RunOptions(str(file), duration=0.01, has_page=False, speed=None))
    return [text.removeprefix("warning: ") for text in caplog.messages]


def by_edit(file: Path, _: pytest.LogCaptureFixture) -> list[str]:
    """An edit that leaves the placement as it is, in a world whose placement nobody has checked before."""
    there = read_scenario(file).specs.scenario
    sound = ScenarioSpec(
        map="plane", vehicles={name: VehiclePlacement(x=3.0 * i) for i, name in enumerate(there.vehicles)}
    )
    with closing(new_world(sound)) as world:
        world.conditions.spec = there
        world.specs = read_scenario(file).specs
        after = Editor(new_world).edit(world, SetSensor("V1", "lidar", is_on=False))
        assert after is not world
        found = joined(after.warnings, {})
        after.close()
    return found


@pytest.mark.parametrize("entrance", [by_check, by_make, by_run, by_edit])
def test_each_entrance_says_the_same_about_a_placement(
    fault: tuple[Path, str],
    entrance: Callable[[Path, pytest.LogCaptureFixture], list[str]],
    caplog: pytest.LogCaptureFixture,
) -> None:
    file, text = fault
    if text.startswith("warning: "):
        found = entrance(file, caplog)
    else:
        with pytest.raises(AutodriveError) as raised:
            entrance(file, caplog)
        found = [str(raised.value)]
    said = [re.sub(r" \(line \d+\)", "", problem) for problem in found]  # an edit has no lines
    others = ["inertia"] if "small.yaml" in file.read_text() else []  # of a body with another size
    assert [text.removeprefix("warning: ") in problem for problem in said] == [True] + [False] * len(others), said
    assert all(word in problem for word, problem in zip(others, said[1:], strict=True))
