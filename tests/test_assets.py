"""Assets are built once and kept: what the cache gives back, and when it builds anew."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest

import autodrive
from autodrive import assets
from autodrive.assets import kept, scene_of
from autodrive.compile import compile_scenario
from autodrive.maps.map import load_map
from autodrive.render.asset import Asset
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from tests.render.assets import assert_same, example


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
    monkeypatch.setattr(assets, "_folder", lambda: tmp_path / "assets")
    return tmp_path / "assets"


def test_what_was_built_once_is_read_from_then_on_and_is_the_same(folder: Path) -> None:
    build = Builder()
    built, read = kept("example.glb", build), kept("example.glb", build)
    assert build.count == 1
    assert_same(built, example())
    assert_same(built, read, texture_tolerance=1e-9)  # not even a texture shows which of the two it was
    assert [path.name for path in folder.iterdir()] == ["example.glb"]


@pytest.mark.parametrize("other", [(1.0, 2.5), (2.0, 1.0), [1.0, 2.0], (1.0, (2.0,)), "(1.0, 2.0)"])
def test_other_content_has_another_name(other: object) -> None:
    assert (
        assets._file_name("box", other) != assets._file_name("box", (1.0, 2.0)) == assets._file_name("box", (1.0, 2.0))
    )


def test_every_figure_of_a_map_counts() -> None:
    town = load_map("tiny_town")
    same, other = load_map("tiny_town"), dataclasses.replace(town, markings=town.markings[1:])
    names = [assets._file_name("map", map_) for map_ in (town, same, other)]
    assert names[0] == names[1] != names[2]


@pytest.mark.parametrize("damage", [b"", b"glTF", b"\0" * 5000])
def test_a_damaged_file_is_built_anew_and_replaced(folder: Path, damage: bytes) -> None:
    build = Builder()
    kept("example.glb", build)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + damage)
    assert_same(kept("example.glb", build), example())
    assert build.count == 2
    assert path.read_bytes() == whole


def test_where_nothing_can_be_kept_it_is_just_built(folder: Path) -> None:
    folder.write_text("a file where the folder should be")
    build = Builder()
    assert_same(kept("example.glb", build), example())
    assert_same(kept("example.glb", build), example())
    assert build.count == 2


def test_a_scene_holds_what_is_equal_once() -> None:
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
    assert list(compiled.objects) == [box.name for box in compiled.boxes]  # rows of a Moment, too
    assert [spec.front_indicator for spec in scene.lights] == [
        v.lights.front_indicator for v in compiled.vehicles.values()
    ]


def test_every_shipped_thing_is_written_as_a_file(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "autodrive.generate", tmp_path], capture_output=True, text=True, check=True, timeout=100
    )
    files = {str(path.relative_to(tmp_path).with_suffix("")) for path in tmp_path.rglob("*.glb")}
    data = Path(autodrive.__file__).parent / "data"
    shipped = {str(path.relative_to(data).with_suffix("")) for path in data.rglob("*.yaml")}
    assert files == {name for name in shipped if not name.startswith("scenarios")}
    rows = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines() if ".glb" in line}
    assert all(int(row[1]) > 0 for row in rows.values()), "something has no triangles"
