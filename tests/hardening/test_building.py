"""Attacks on building: long random edits with undo and redo, and maps with too many modules."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from autodrive import Command
from autodrive.base.errors import AutodriveError
from autodrive.protocol.messages import (
    CloseLoop,
    EditMap,
    MapBlock,
    MapModule,
    MapPart,
    MapProp,
    MapWall,
    Operation,
    Redo,
    Reset,
    Undo,
)
from autodrive.scenario.maps.spec import MAX_PLACEMENTS
from autodrive.world import World
from autodrive.world.factory import new_world
from tests.support.frames import digests
from tests.support.hardening import cases
from tests.world.editing.test_map_edits import Building

MODULES = ["straight_road", "curved_road", "road_patch", "dead_end", "four_way_intersection", "construction_box"]


def random_part(random: np.random.Generator) -> MapPart:
    """A part on a lattice, so that some of them meet; the vehicle at the origin is not below walls and blocks."""
    x, y = (float(value) for value in 0.2 * random.integers(-20, 20, 2))
    yaw = 0.5 * math.pi * int(random.integers(4))
    kind = int(random.integers(10))
    if kind == 0:
        return MapWall(((x, y + 8.0), (x + 1.0, y + 9.0)), 0.2)
    if kind == 1:
        return MapBlock(x, y - 8.0, 0.4, 0.6, 0.2, yaw)
    if kind == 2:
        return MapProp("stop", x, y + 16.0, yaw)
    return MapModule(str(random.choice(MODULES)), x, y, yaw)


def random_edit(random: np.random.Generator, building: Building) -> Operation:
    names = [f"part_{i}" for i in range(12)]
    kind = int(random.integers(10))
    if kind == 0:
        return CloseLoop(str(random.choice(names)))
    if kind < 3 and building.simulation.undo_name:
        return Undo()
    if kind == 3 and building.simulation.redo_name:
        return Redo()
    chosen = random.choice(names, size=int(random.integers(1, 4)), replace=False)
    known = building.scene.parts
    return EditMap(
        {str(one): None if one in known and random.random() < 0.2 else random_part(random) for one in chosen}
    )


def drive(world: World) -> list[str]:
    return [*digests(world, 30, lambda _: {"V1": Command(0.5, 0.3)})]


@pytest.mark.parametrize("seed", range(cases(1, 10)))
def test_a_town_of_random_edits_has_the_bits_of_its_file(tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    building = Building()
    made = refused = 0
    for _ in range(cases(60, 300)):
        before = building.simulation.map_text()
        try:
            building.ask(random_edit(random, building))
            made += 1
        except AutodriveError:
            refused += 1
            assert building.simulation.map_text() == before
    assert made > refused
    text = building.simulation.scenario_text()
    file = tmp_path / "scenario.yaml"
    file.write_text(text)
    again = new_world(file)
    assert again.map.drivable.equals(building.world.map.drivable)
    building.ask(Reset(seed))
    again.reset(seed)
    assert drive(again) == drive(building.world)
    # undo reverts all edits that are left in the history, redo makes them again
    count = 0
    while building.simulation.undo_name:
        building.ask(Undo())
        count += 1
    for _ in range(count):
        building.ask(Redo())
    assert building.simulation.scenario_text() == text


def test_a_module_too_many_is_refused_and_nothing_is_lost() -> None:
    building = Building()
    lawns: dict[str, MapPart | None] = {
        f"lawn_{i}": MapModule("lawn", 2.0 * (i % 30), 2.0 * (i // 30), length=1.0, width=1.0)
        for i in range(MAX_PLACEMENTS)
    }
    building.ask(EditMap(lawns))
    with pytest.raises(AutodriveError, match="1000"):
        building.ask(EditMap({"one_more": MapModule("lawn", -4.0, -4.0)}))
    assert {*building.scene.parts} == {*lawns}
    assert building.simulation.undo_name == "add 1000 parts of the map"
