"""Drawings of maps: valid SVG, of the right size, with the polygons of the simulation."""

import struct
from typing import get_args
from xml.etree import ElementTree

import pytest
import resvg_py
import shapely

from autodrive.scenario import kinds
from autodrive.scenario.maps.draw import OVERLAYS, module_alone, to_png, to_svg
from autodrive.scenario.maps.icons import icon
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.props import PropKind, Sign

SVG = "{http://www.w3.org/2000/svg}"


def paths(svg, kind):
    return [path.get("d", "") for path in ElementTree.fromstring(svg).iter(f"{SVG}path") if path.get("class") == kind]


def area(d):
    """Of an even-odd path, holes taken away by the turning sense that shapely gives them."""
    rings = [[tuple(map(float, point.split())) for point in ring.split("L")] for ring in d.rstrip("Z")[1:].split("ZM")]
    pieces = [shapely.Polygon(ring) for ring in rings]
    outer = max(pieces, key=lambda piece: piece.area)
    return outer.area - sum(piece.area for piece in pieces if piece is not outer)


def png_size(data):
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", data[16:24])


@pytest.mark.parametrize("name", ["mini_map", "tiny_town"])
def test_drawn_road_is_the_drivable_area(name):
    map_ = load_map(name)
    (road,) = paths(to_svg(map_), "road")
    # coordinates are written to a tenth of a millimetre, along 50 m of kerb
    assert area(road) == pytest.approx(map_.drivable.area, abs=5e-3)


def test_drawing_has_the_size_of_the_map_and_a_margin(tmp_path):
    map_ = load_map("mini_map")
    x0, y0, x1, y1 = map_.bounds
    path = tmp_path / "map.png"
    to_png(map_, path, 100.0, overlays=OVERLAYS)
    assert png_size(path.read_bytes()) == (round((x1 - x0 + 0.2) * 100), round((y1 - y0 + 0.2) * 100))


def test_overlays_show_each_lane_port_bay_and_start():
    map_ = load_map("tiny_town")
    svg = to_svg(map_, overlays=OVERLAYS, starts=[(-1.1, -0.15, 0.0)])
    assert len(paths(svg, "lane")) == len(map_.lane_graph.lanes)
    for kind, count in (
        ("port", sum(len(one.ports) for one in map_.modules)),
        ("bay", len(map_.bays)),
        ("start", 1),
    ):
        assert svg.count(f'<g class="{kind}"') == count
    assert 'class="lane"' not in to_svg(map_)


@pytest.mark.parametrize("name", kinds.names("module"))
def test_every_module_can_be_drawn_alone(name, tmp_path):
    path = tmp_path / "module.png"
    to_png(module_alone(name), path)
    spec = module_alone(name).modules[0].module.spec
    assert png_size(path.read_bytes()) == (round((spec.length + 0.2) * 200), round((spec.width + 0.2) * 200))


@pytest.mark.parametrize("kind", [*get_args(Sign), "traffic_light"])
def test_every_sign_has_a_face(kind):
    assert kind in {name for group in get_args(PropKind) for name in (get_args(group) or (group,))}
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-.5 -.5 1 1" width="64" height="64">{icon(kind)}</svg>'
    assert png_size(resvg_py.svg_to_bytes(svg_string=svg)) == (64, 64)


def test_title_of_a_map_cannot_break_its_drawing(tmp_path):
    path = tmp_path / "odd.yaml"
    path.write_text("title: A <b> & c\n")
    assert ElementTree.fromstring(to_svg(load_map(path))).findtext(f"{SVG}title") == "A <b> & c"
