"""The mesh of the RoboRacer cars against their Specs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.base.errors import SpecError
from autodrive.base.yaml_files import parse
from autodrive.graphics.assets.asset import Asset, Detail
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.meshes.vehicle_paint import linear
from autodrive.physics.actuators.lights import LAMPS
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.vehicles.spec import VehicleSpec, load_vehicle
from autodrive.world.factory import compile_scenario
from tests.graphics.meshes.test_vehicle import RACERS, car, corners

pytestmark = pytest.mark.slow

each_car = pytest.mark.parametrize("name", RACERS)


@each_car
@pytest.mark.parametrize("detail", ["full", "reduced"])
def test_the_car_is_as_large_as_its_spec_says_and_stands_on_its_wheels(name: str, detail: Detail) -> None:
    spec = load_vehicle(name)
    parts = corners(car(name), detail)
    points = np.concatenate([part.reshape(-1, 3) for part in parts.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    assert high[0] - low[0] == pytest.approx(spec.size[0], abs=0.012)  # the lenses of the lamps
    assert high[1] - low[1] == pytest.approx(spec.track + spec.wheels.width, abs=0.002)
    assert low[2] == pytest.approx(-spec.wheels.radius, abs=0.001)
    assert high[2] - low[2] == pytest.approx(spec.size[2], abs=0.015)
    assert spec.sensors.lidar is not None
    window = parts["lidar_head"][..., 2]
    assert window.min() < spec.sensors.lidar.mount.position[2] < window.max()
    assert sum(part.startswith("lamp_") for part in parts) == len(LAMPS)


@each_car
@pytest.mark.parametrize("detail", ["full", "reduced"])
def test_the_page_can_paint_a_large_part_of_it(name: str, detail: Detail) -> None:
    """Seen from above, so that cars are told apart in the bird's eye view, too."""
    painted = 0.0
    for node in car(name).nodes:
        for surface in node.surfaces.get(detail, ()):
            if surface.material.is_paint:
                a, b, c = np.moveaxis(surface.positions[surface.triangles].astype(float), 1, 0)
                painted += float(np.maximum(0.0, np.cross(b - a, c - a)[:, 2]).sum()) / 2.0
    assert painted > 0.25 * 0.33 * 0.15  # a quarter of the deck, the computer covers another part


def paint_of(asset: Asset) -> set[tuple[float, float, float]]:
    surfaces = [one for node in asset.nodes for parts in node.surfaces.values() for one in parts]
    return {one.material.color for one in surfaces if one.material.is_paint}


def test_several_race_cars_have_the_colours_of_the_page_in_camera_images() -> None:
    names = ("roboracer", "roboracer", "roboracer_f1tenth", "nigel")
    cars: Any = {f"V{i}": {"type": name, "y": 1.0 * i} for i, name in enumerate(names, start=1)}
    scene = scene_of(compile_scenario(ScenarioSpec(vehicles=cars)))
    source = (Path(__file__).parents[3] / "web" / "src" / "vehicle_colours.ts").read_text()
    (listed,) = re.findall(r"const COLOURS = \[(.*?)\]", source)
    colours = [linear(one) for one in re.findall(r"'(#\w+)'", listed)]
    assert [paint_of(asset) for asset in scene.vehicles[:3]] == [{colour} for colour in colours[:3]]
    assert paint_of(scene.vehicles[3]) == paint_of(car("nigel"))
    shown = scene_of(compile_scenario(ScenarioSpec(vehicles=cars)), paints_all=True)  # for people, with Stream
    assert [paint_of(asset) for asset in shown.vehicles] == [{colour} for colour in colours[:4]]
    alone = scene_of(compile_scenario(ScenarioSpec(vehicles={"V1": cars["V1"]})))
    assert paint_of(alone.vehicles[0]) == paint_of(car("roboracer"))


def test_linear_colours_are_those_of_the_standard() -> None:
    assert linear("#000000") == (0.0, 0.0, 0.0)
    assert linear("#ffffff") == pytest.approx((1.0, 1.0, 1.0))
    assert linear("#bc0a80") == pytest.approx((0.5029, 0.003035, 0.2159), rel=1e-3)


def test_a_racer_has_a_chassis_and_a_deck() -> None:
    tree = load_vehicle("nigel").model_dump_json().replace('"look":"platforms"', '"look":"racer"')
    with pytest.raises(SpecError, match="must be two, chassis and deck"):
        parse(tree, VehicleSpec)
