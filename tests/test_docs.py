"""What the documents show is run."""

import re
from pathlib import Path

import pytest
import yaml

import autodrive
from autodrive.descriptions import find
from autodrive.maps import load_map
from autodrive.scenario import load_scenario
from autodrive.vehicles.spec import load_vehicle

DOCS = Path(__file__).parent.parent / "docs"


def examples(document: str) -> list[str]:
    return re.findall(r"```yaml\n(.*?)```", (DOCS / document).read_text(), flags=re.DOTALL)


def test_scenario_of_the_document_runs(tmp_path: Path) -> None:
    file = tmp_path / "delivery.yaml"
    file.write_text(examples("scenarios.md")[0])
    assert load_scenario(file).seed == 7
    world = autodrive.make(file)
    for _ in range(100):
        frame = world.step()
    assert set(frame.vehicles) == {"V1", "V2"}
    assert frame.objects["lid"].pose.position[2] == pytest.approx(0.15, abs=1e-3)  # soft contacts sink a little


def test_map_of_the_document_is_in_order(tmp_path: Path) -> None:
    file = tmp_path / "street.yaml"
    file.write_text(examples("scenarios.md")[1])
    map_ = load_map(file)
    assert len(map_.joins) == 4  # two joints, told from both sides
    assert [box.mass for box in map_.boxes] == [0.5]


def test_lidar_of_the_document_fits_the_car(tmp_path: Path) -> None:
    tree = yaml.safe_load(find("vehicle", "nigel").read_text())
    tree["sensors"] |= yaml.safe_load(examples("scenarios.md")[2])
    file = tmp_path / "fast.yaml"
    file.write_text(yaml.safe_dump(tree))
    lidar = load_vehicle(str(file)).sensors.lidar
    assert lidar is not None
    assert (lidar.rays, lidar.rate) == (1080, 40.0)
