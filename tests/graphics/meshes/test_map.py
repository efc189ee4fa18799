"""Meshes of maps, against the polygons of which they are made."""

import pickle
from collections import Counter
from functools import cache

import numpy as np
import pytest
import shapely

from autodrive.base.transforms import rotation_from_quaternion
from autodrive.graphics.assets.glb import write_glb
from autodrive.graphics.meshes import ground_tiles
from autodrive.graphics.meshes.map import box_asset, map_asset, map_parts
from autodrive.protocol.labels import Label
from autodrive.scenario import kinds
from autodrive.scenario.files import read_map
from autodrive.scenario.maps.draw import module_alone
from autodrive.scenario.maps.ground import MARKING_LABELS, MOST_TILES, SIMPLIFY_TOLERANCE, TILE, floor_extent, tile_size
from autodrive.scenario.maps.map import compile_map, load_map
from autodrive.scenario.maps.props import SIGNS, PropSpec
from autodrive.scenario.maps.spec import MapSpec, Placement

pytestmark = pytest.mark.slow

MAPS = [("map", name) for name in kinds.names("map")] + [("turned", seed) for seed in range(3)]
ALL = MAPS + [("module", name) for name in kinds.names("module")]


KINDS = ("four_way_intersection", "straight_road", "road_patch", "parking_lot", "curved_road", "lawn")


def placement(random, number):
    """A module at any place and angle."""
    x, y = (float(random.integers(-40, 41)) / 10.0 for _ in range(2))
    turn = float(random.choice([0.0, 90.0, 180.0, 33.3, -71.0]))
    return Placement(module=str(random.choice(KINDS)), name=f"m{number}", x=x, y=y, yaw_deg=turn)


def draft(placements):
    """A map that is being built: its modules may overlap, and need not be connected."""
    map_, _ = compile_map(read_map(MapSpec(title="draft", is_draft=True, placements=tuple(placements)))[0])
    assert map_ is not None
    return map_


@cache
def of(kind, name):
    if kind == "turned":
        random = np.random.default_rng(name)
        return draft(placement(random, number) for number in range(12))
    return load_map(name) if kind == "map" else module_alone(name)


@cache
def asset_of(kind, name):
    return map_asset(of(kind, name))


def ground(asset):
    """Label, and corners of the triangles (n, 3, 3), of all surfaces of the ground."""
    nodes = [node for node in asset.nodes if node.name == "floor" or node.name.startswith("tile_")]
    return [(s.label, s.positions[s.triangles].astype(float)) for node in nodes for s in node.surfaces["full"]]


def level_ground(asset):
    """The same without upright faces; triangles without area, which fill a straight side, are among them."""
    nodes = [node for node in asset.nodes if node.name == "floor" or node.name.startswith("tile_")]
    surfaces = [s for node in nodes for s in node.surfaces["full"] if s.normals[:, 2].any()]
    return [s.positions[s.triangles].astype(float) for s in surfaces]


def plan_area(corners):
    """Of each triangle seen from above, left turning positive; of upright ones it is nothing."""
    a, b = (corners[:, 1] - corners[:, 0])[:, :2].T, (corners[:, 2] - corners[:, 0])[:, :2].T
    return 0.5 * (a[0] * b[1] - a[1] * b[0])


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_every_point_of_the_floor_has_one_surface(kind, name):
    map_ = of(kind, name)
    areas = [plan_area(corners) for _, corners in ground(asset_of(kind, name))]
    x0, y0, x1, y1 = floor_extent(map_)
    # None is upside down. The turned modules overlap in slivers of up to 1 m, whose coordinates are single precision.
    assert min(area.min() for area in areas) > (-3e-7 if kind == "turned" else -1e-9)
    # coordinates are single precision: 3e-5 m at the far edge of 2 km of floor
    assert sum(area.sum() for area in areas) == pytest.approx((x1 - x0) * (y1 - y0), abs=0.05)


def test_paint_that_goes_on_beside_the_road_ends_with_it(tmp_path):
    text = kinds.find("module", "road_patch").read_text()
    changed = text.replace("[-0.1, -0.284]", "[99.9, -0.284]")
    assert changed != text
    (tmp_path / "patch.yaml").write_text(changed)
    map_ = module_alone(str(tmp_path / "patch.yaml"))
    paint = np.concatenate([c for label, c in ground(map_asset(map_)) if label in MARKING_LABELS.values()])
    assert map_.drivable.buffer(1e-6).contains(shapely.points(paint.mean(1)[:, :2])).all()


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_road_and_paint_cover_the_drivable_area(kind, name):
    map_ = of(kind, name)
    driven = {Label.ROAD, Label.EDGE_LINE, Label.SEPARATION_LINE, Label.STOP_LINE, Label.CROSSING, Label.BAY_LINE}
    area = sum(plan_area(corners).sum() for label, corners in ground(asset_of(kind, name)) if label in driven)
    assert area == pytest.approx(map_.drivable.area, abs=SIMPLIFY_TOLERANCE * map_.drivable.length + 1e-4)


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_ground_is_labelled_as_its_polygons_say(kind, name):
    """The middles of all triangles, against the markings, the road and the lawn that they lie in."""
    map_ = of(kind, name)
    painted = shapely.union_all([m.geometry for m in map_.markings])
    found = [(label, c[np.abs(plan_area(c)) > 1e-6].mean(1)[:, :2]) for label, c in ground(asset_of(kind, name))]
    x, y = np.concatenate([middles for _, middles in found]).T
    label = np.repeat([label for label, _ in found], [len(middles) for _, middles in found])

    def within(area):  # sure of it: arcs of the mesh are simpler than those of the polygon
        return shapely.contains_xy(area.buffer(-2.0 * SIMPLIFY_TOLERANCE), x, y)

    def beyond(area):
        return ~shapely.intersects_xy(area.buffer(2.0 * SIMPLIFY_TOLERANCE), x, y)

    on_road = within(map_.drivable)
    assert not np.isin(label[on_road], (Label.GROUND, Label.LAWN, Label.KERB)).any()
    assert (label[on_road & beyond(painted)] == Label.ROAD).all()
    assert (label[on_road & within(painted)] != Label.ROAD).all()
    off_road = beyond(map_.drivable)
    assert np.isin(label[off_road & within(map_.lawn)], (Label.LAWN, Label.KERB)).all()
    assert np.isin(label[off_road & beyond(map_.lawn)], (Label.GROUND, Label.KERB)).all()


@pytest.mark.parametrize(("kind", "name"), MAPS)
def test_no_crack_opens_between_pieces_of_ground(kind, name):
    """Each edge of a triangle of the floor is another's, the other way round, but for the outer border."""
    borders = np.reshape(floor_extent(of(kind, name)), (2, 2))  # x0, y0 and x1, y1
    level = np.concatenate(level_ground(asset_of(kind, name)))[:, :, :2].astype(np.float32)
    pairs = np.stack([level, np.roll(level, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    edges = {pair.tobytes() for pair in pairs}
    alone = np.array([pair for pair in pairs if pair[::-1].tobytes() not in edges])
    at_border = (np.abs(alone[:, None] - borders[:, None]) < 1e-3).all(axis=2).reshape(-1, 4).any(axis=1)
    assert at_border.all(), alone[~at_border]


@pytest.mark.parametrize("name", ["mini_map", "tiny_town"])
def test_the_drivable_area_is_flat(name):
    inner = load_map(name).drivable.buffer(-2.0 * SIMPLIFY_TOLERANCE)
    shapely.prepare(inner)
    for _, corners in ground(asset_of("map", name)):
        raised = corners.reshape(-1, 3)[corners.reshape(-1, 3)[:, 2] > 0.0]
        assert not shapely.intersects_xy(inner, raised[:, 0], raised[:, 1]).any()
        assert corners[..., 2].max() < 0.01


@pytest.mark.parametrize("name", ["mini_map", "tiny_town"])
def test_solids_look_as_large_as_they_are_hit_or_smaller(name):
    nodes = {node.name: node for node in asset_of("map", name).nodes}
    for shape in load_map(name).statics:
        if shape.material == "plate":
            continue
        node = nodes[shape.name]
        points = np.concatenate([s.positions for s in node.surfaces["full"]])
        half = shape.size if shape.material != "post" else (shape.size[0], shape.size[0], shape.size[1])
        assert (np.abs(points).max(0) <= np.array(half) + 1e-6).all()
        assert np.allclose(node.position, shape.position)
        assert "shadow" in node.surfaces


@pytest.mark.parametrize("kind", SIGNS)
def test_the_plate_of_a_sign_is_hit_where_it_is_drawn(kind):
    sign = PropSpec(kind=kind, x=0.3, y=-0.2, yaw_deg=35.0)
    map_ = load_map(MapSpec(title="Sign", props=(sign,)))
    (node,) = (node for node in map_asset(map_).nodes if node.name == f"{kind}_1.plate")
    x, y, z = node.position
    drawn = []
    for surface in node.surfaces["full"]:
        corners = surface.positions[surface.triangles][..., 1:].astype(float)
        drawn += [shapely.Polygon(triangle) for triangle in corners]
    solid = []
    for part in map_.statics:
        if part.material == "plate":
            rotation = np.array(rotation_from_quaternion(part.orientation)).reshape(3, 3)
            c, s = np.cos(sign.pose[2]), np.sin(sign.pose[2])
            own = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation  # plate from part
            corners = part.size * np.array([(1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)])
            solid.append(shapely.Polygon((corners @ own.T)[:, 1:] + (0.0, part.position[2] - z)))
            assert np.allclose(part.position[:2], (x, y))
    drawn, solid = (shapely.union_all([one.buffer(1e-6) for one in parts]) for parts in (drawn, solid))
    assert shapely.hausdorff_distance(drawn.boundary, solid.boundary, 0.05) < 0.0045


def test_town_is_cheap_to_draw():
    assert asset_of("map", "tiny_town").triangle_count("full") < 15_000


def test_a_map_has_the_same_mesh_in_another_process():
    map_ = load_map("mini_map")
    assert write_glb(map_asset(map_)) == write_glb(map_asset(pickle.loads(pickle.dumps(map_))))


@pytest.fixture
def made(monkeypatch):
    """The tiles that were made; each has a point within each of its cells."""
    found = []
    point_on_surface = shapely.point_on_surface
    monkeypatch.setattr(shapely, "point_on_surface", lambda cells: found.append(cells) or point_on_surface(cells))
    return found


@pytest.mark.parametrize("seed", range(2))
def test_a_map_that_was_edited_has_the_mesh_of_one_that_is_built_afresh(seed, made, monkeypatch):
    random = np.random.default_rng(seed)
    placements = [placement(random, number) for number in range(10)]
    map_asset(draft(placements))
    states = []
    for number in range(100, 106):
        place = int(random.integers(len(placements)))
        if random.random() < 0.3:
            del placements[place]
        else:
            placements[place : place + int(random.integers(2))] = [placement(random, number)]
        made.clear()
        states.append(([*placements], write_glb(map_asset(draft(placements))), len(made)))
    monkeypatch.setattr(ground_tiles, "MAX_TILES", 0)
    for number, (placements, edited, after_edit) in enumerate(states):
        # one new tile, and what was remembered is forgotten
        map_asset(draft([Placement(module="straight_road", x=0.01234 + number, y=0.01234 + seed, yaw_deg=12.3)]))
        made.clear()
        assert write_glb(map_asset(draft(placements))) == edited
        assert after_edit < len(made)


def test_an_edit_makes_only_the_tiles_around_it(made):
    row = [Placement(module="straight_road", name=f"m{i}", x=2.5 * i, y=0.0) for i in range(20)]
    map_asset(draft(row))
    made.clear()
    map_asset(draft([*row[:10], row[10].model_copy(update={"y": 0.05}), *row[11:]]))
    # the module is 0.6 m long and wide; with its kerb, it touches 2 x 2 tiles of 1 m at most
    assert 0 < len(made) <= 4


@pytest.mark.parametrize(("kind", "name"), [("map", "tiny_town"), ("map", "empty"), ("turned", 1)])
def test_the_parts_of_a_map_are_the_whole_map(kind, name):
    whole = asset_of(kind, name)
    solids, parts = map_parts(of(kind, name))
    assets = [part.asset for part in parts]
    surfaces = [s for one in (solids, *assets) for node in one.nodes for s in node.surfaces["full"]]
    expected = [s for node in whole.nodes for s in node.surfaces["full"]]

    def content(surface):
        arrays = (surface.positions, surface.normals, surface.triangles, surface.uvs)
        return surface.material, surface.label, *(None if one is None else one.tobytes() for one in arrays)

    assert Counter(map(content, surfaces)) == Counter(map(content, expected))
    assert solids.textures.keys() == whole.textures.keys() >= {t for one in assets for t in one.foreign_textures}
    strips = [one.strips for one in assets if one.strips is not None]
    corners = [s.vertices[s.triangles].tobytes() for s in strips]
    whole_corners = b"" if whole.strips is None else whole.strips.vertices[whole.strips.triangles].tobytes()
    size = 3 * 48  # bytes of a triangle of strips
    assert Counter(c[i : i + size] for c in corners for i in range(0, len(c), size)) == Counter(
        whole_corners[i : i + size] for i in range(0, len(whole_corners), size)
    )


def test_a_map_of_a_kilometre_has_few_tiles():
    far = [Placement(module="straight_road", name=f"m{i}", x=900.0 * i, y=900.0 * i) for i in range(2)]
    map_ = draft(far)
    assert len(map_asset(map_).nodes) <= MOST_TILES + 1
    assert tile_size(map_) > TILE


def test_construction_box_has_its_size():
    (node,) = box_asset((0.1, 0.2, 0.25)).nodes
    points = np.concatenate([s.positions for s in node.surfaces["full"]])
    assert np.allclose(np.ptp(points, axis=0), (0.1, 0.2, 0.25))
