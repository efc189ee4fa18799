"""The cache of assets: what it returns, and when it rebuilds."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

import autodrive
from autodrive.cli import generate
from autodrive.graphics.assets.asset import Asset
from autodrive.graphics.meshes import store
from autodrive.graphics.meshes.store import cached, scene_of
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.map import load_map
from autodrive.world.factory import compile_scenario
from tests.support.example_asset import assert_same, example


class Builder:
    """Counts how often it is asked to build."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> Asset:
        self.count += 1
        return example()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    monkeypatch.setattr(store, "folder", lambda: tmp_path / "assets")
    return tmp_path / "assets"


def test_an_asset_is_built_once_and_then_read_unchanged(folder: Path) -> None:
    build = Builder()
    built, read = cached("example.glb", build), cached("example.glb", build)
    assert build.count == 1
    assert_same(built, example())
    assert_same(built, read, texture_tolerance=1e-9)  # textures are equal, too
    assert [path.name for path in folder.iterdir()] == ["example.glb.msgpack"]


@pytest.mark.parametrize("other", [(1.0, 2.5), (2.0, 1.0), [1.0, 2.0], (1.0, (2.0,)), "(1.0, 2.0)"])
def test_other_content_has_another_name(other: object) -> None:
    assert store.file_name("box", other) != store.file_name("box", (1.0, 2.0)) == store.file_name("box", (1.0, 2.0))


def test_the_file_name_depends_on_the_whole_map() -> None:
    town = load_map("tiny_town")
    same, other = load_map("tiny_town"), dataclasses.replace(town, markings=town.markings[1:])
    names = [store.file_name("map", map_) for map_ in (town, same, other)]
    assert names[0] == names[1] != names[2]


@pytest.mark.parametrize("damage", [b"", b"glTF", b"\0" * 5000])
def test_a_damaged_file_is_replaced(folder: Path, damage: bytes) -> None:
    build = Builder()
    cached("example.glb", build)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + damage)
    assert_same(cached("example.glb", build), example())
    assert build.count == 2
    assert path.read_bytes() == whole


def test_without_a_writable_cache_assets_are_built_each_time(folder: Path) -> None:
    folder.write_text("a file where the folder should be")
    build = Builder()
    assert_same(cached("example.glb", build), example())
    assert_same(cached("example.glb", build), example())
    assert build.count == 2


def test_equal_vehicles_and_boxes_share_an_asset() -> None:
    vehicles = {
        "V1": VehiclePlacement(),
        "V2": VehiclePlacement(x=1.0),
        "V3": VehiclePlacement(x=2.0, type="nigel_2023"),
    }
    boxes = {"a": BoxSpec(x=0, y=1), "b": BoxSpec(x=0, y=2), "c": BoxSpec(x=0, y=3, size=(0.2, 0.2, 0.2))}
    compiled = compile_scenario(ScenarioSpec(vehicles=vehicles, boxes=boxes))
    scene = scene_of(compiled)
    assert scene.vehicles[0] is scene.vehicles[1] is not scene.vehicles[2]
    assert scene.objects[0] is scene.objects[1] is not scene.objects[2]
    assert list(compiled.objects) == [box.name for box in compiled.boxes]  # also the rows of a RenderState
    assert [spec.front_indicator for spec in scene.lights] == [
        v.lights.front_indicator for v in compiled.vehicles.values()
    ]


@pytest.mark.slow
def test_every_shipped_vehicle_module_and_map_is_written_as_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    generate.main([str(tmp_path)])
    files = {str(path.relative_to(tmp_path).with_suffix("")) for path in tmp_path.rglob("*.glb")}
    data = Path(autodrive.__file__).parent / "scenario" / "data"
    shipped = {str(path.relative_to(data).with_suffix("")) for path in data.rglob("*.yaml")}
    assert files == {name for name in shipped if name.split("/")[0] in ("vehicles", "modules", "maps")}
    rows = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines() if ".glb" in line}
    assert all(int(row[1]) > 0 for row in rows.values()), "something has no triangles"
