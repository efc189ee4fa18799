"""Chains of roads between two ports: the checks of a map's file accept them; what cannot be closed says so."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.scenario import kinds
from autodrive.scenario.files import read_map, read_module
from autodrive.scenario.maps.closing import Chain, closing_chain
from autodrive.scenario.maps.map import Map, compile_map
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.maps.placing import PlacingProblem
from autodrive.scenario.maps.solids import BlockSpec
from autodrive.scenario.maps.spec import MapSpec, Placement
from tests.support.hardening import cases

MODULES: dict[str, ModuleSpec] = {name: read_module(name).spec for name in kinds.names("module")}
STRAIGHT = Placement(module="straight_road", x=0.0, y=0.0)


def compiled(*placements: Placement, blocks: tuple[BlockSpec, ...] = ()) -> tuple[Map, tuple[PlacingProblem, ...]]:
    spec = MapSpec(title="closing", placements=placements, blocks=blocks, is_draft=True)
    map_, problems = compile_map(read_map(spec)[0])
    assert map_ is not None
    return map_, problems


def chain(map_: Map, start: tuple[int, str], end: tuple[int, str]) -> Chain:
    ports = [next(one for one in map_.modules[i].ports if one.name == name) for i, name in (start, end)]
    solids = [one.footprint for one in map_.modules] + [one.plan for one in map_.statics]
    return closing_chain(ports[0], ports[1], MODULES, solids)


def test_random_pairs_of_ends_are_closed_by_chains_that_the_checks_of_a_map_accept() -> None:
    closed = 0
    count = cases(40, 1000)
    for seed in range(count):
        random = np.random.default_rng(seed)
        yaw, quarter = random.uniform(-math.pi, math.pi), int(random.integers(4))
        at = 0.2 * random.integers(-20, 20, 2)  # the lattice of the poses to which roads lead
        c, s = math.cos(yaw), math.sin(yaw)
        x, y = (round(float(value), 6) for value in (c * at[0] - s * at[1], s * at[0] + c * at[1]))
        first = STRAIGHT.model_copy(update={"yaw_deg": round(math.degrees(yaw), 6)})
        turned = round(math.degrees(yaw) + 90.0 * quarter, 6)
        second = Placement(module="straight_road", x=x, y=y, yaw_deg=turned)
        map_, problems = compiled(first, second)
        if any(one.kind != "unconnected" for one in problems):
            continue  # they touch already
        ends = (0, str(random.choice(["east", "west"]))), (1, str(random.choice(["east", "west"])))
        found = chain(map_, *ends)
        if not found.placements:
            continue
        closed += 1
        after, left = compiled(first, second, *found.placements)
        assert {one.kind for one in left} == {"unconnected"}, (seed, left)
        assert len(left) == 2, (seed, left)  # the other ends of the two roads
        assert {*ends} <= after.joins.keys(), seed
        assert len(after.joins) == 2 * (len(found.placements) + 1)
        assert chain(map_, *ends) == found
    assert closed > 0.9 * count


@pytest.mark.parametrize(
    ("x", "y", "yaw_deg", "miss"),
    [
        (3.0, 1.4, 30.0, None),  # no curve leads to that heading
        (3.05, 0.0, 0.0, (-0.05, 0.0)),  # between two points of the lattice
        (3.0, 0.03, 0.0, (0.0, -0.03)),
    ],
)
def test_ends_that_no_road_reaches_have_no_chain(
    x: float, y: float, yaw_deg: float, miss: tuple[float, float] | None
) -> None:
    map_, _ = compiled(STRAIGHT, Placement(module="straight_road", x=x, y=y, yaw_deg=yaw_deg))
    found = chain(map_, (0, "east"), (1, "west"))
    assert found.placements == ()
    if miss is None:
        assert found.miss is None
    else:
        assert found.miss == pytest.approx(miss, abs=1e-6)


def test_a_chain_leads_around_what_stands_between_the_ends() -> None:
    block = BlockSpec(x=2.0, y=0.0, length=0.4, width=0.4, height=0.3)
    second = Placement(module="straight_road", x=4.8, y=0.0)
    free, _ = compiled(STRAIGHT, second)
    straight = chain(free, (0, "east"), (1, "west"))
    assert {one.module for one in straight.placements} == {"straight_road"}
    blocked, _ = compiled(STRAIGHT, second, blocks=(block,))
    around = chain(blocked, (0, "east"), (1, "west"))
    assert sum(one.module == "curved_road" for one in around.placements) == 4
    _, problems = compiled(STRAIGHT, second, *around.placements, blocks=(block,))
    assert {one.kind for one in problems} == {"unconnected"}
    wide = BlockSpec(x=2.0, y=0.0, length=0.4, width=100.0, height=0.3)
    enclosed, _ = compiled(STRAIGHT, second, blocks=(wide,))
    assert chain(enclosed, (0, "east"), (1, "west")).placements == ()
