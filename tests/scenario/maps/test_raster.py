"""Occupancy grids and label images, read back and compared with the polygons."""

import numpy as np
import pytest
import shapely
import yaml

from autodrive.base.png import decode_png
from autodrive.protocol.labels import Label
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.raster import FREE, OCCUPIED, write_labels, write_occupancy


@pytest.mark.parametrize("name", ["mini_map", "tiny_town"])
@pytest.mark.parametrize("free", ["ground", "drivable"])
def test_cell_of_the_grid_shows_the_object_at_its_centre(name, free, tmp_path):
    map_ = load_map(name)
    about = yaml.safe_load(write_occupancy(map_, tmp_path, 0.02, free=free).read_text())
    grid = decode_png((tmp_path / about["image"]).read_bytes())[..., 0]
    plans = [shape.plan for shape in map_.statics if shape.material != "post"] + [box.plan for box in map_.boxes]
    rng = np.random.default_rng(1)
    for row, column in zip(rng.integers(0, grid.shape[0], 400), rng.integers(0, grid.shape[1], 400), strict=True):
        # map_server: the first row is the uppermost, the origin is the lower left corner of the grid
        x = about["origin"][0] + (column + 0.5) * about["resolution"]
        y = about["origin"][1] + (grid.shape[0] - row - 0.5) * about["resolution"]
        point = shapely.Point(x, y)
        if any(shape.plan.distance(point) < 1e-6 for shape in map_.statics if shape.material == "post"):
            continue
        if any(plan.exterior.distance(point) < 1e-9 for plan in plans):  # on the very edge rounding decides
            continue
        is_free = not any(plan.intersects(point) for plan in plans)
        is_free = is_free and (free == "ground" or map_.drivable.intersects(point))
        assert grid[row, column] == (FREE if is_free else OCCUPIED)


def test_grey_values_are_beyond_the_thresholds_of_the_grid(tmp_path):
    about = yaml.safe_load(write_occupancy(load_map("mini_map"), tmp_path, 0.05).read_text())
    occupied = [(255 - grey) / 255 for grey in (OCCUPIED, FREE)]  # as map_server computes it
    assert occupied[0] > about["occupied_thresh"] > about["free_thresh"] > occupied[1]
    assert (about["mode"], about["negate"]) == ("trinary", 0)


@pytest.mark.parametrize("name", ["mini_map", pytest.param("tiny_town", marks=pytest.mark.slow)])
def test_labels_cover_the_areas_of_their_polygons(name, tmp_path):
    map_ = load_map(name)
    resolution = 0.01
    write_labels(map_, tmp_path / "labels.png", resolution)
    seen = decode_png((tmp_path / "labels.png").read_bytes())[..., 0]
    solid = shapely.union_all([shape.plan for shape in map_.statics] + [box.plan for box in map_.boxes])
    crossings = shapely.union_all([m.geometry for m in map_.markings if m.kind == "crossing"])
    expected = crossings.difference(solid).area
    # a cell is wrong by half of itself where an edge runs through it
    assert (seen == Label.CROSSING).sum() * resolution**2 == pytest.approx(expected, abs=0.1 * expected)
    assert (seen == Label.ROAD).sum() * resolution**2 < map_.drivable.area
