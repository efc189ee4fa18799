"""Pictures of scenes that can be computed by hand."""

from __future__ import annotations

import gc
import math
import os
from pathlib import Path

import numpy as np
import pytest
import shapely

from autodrive.actuators.lights import LAMPS
from autodrive.errors import AutodriveError
from autodrive.render.asset import Asset, Label, Material
from autodrive.render.renderer import Renderer
from autodrive.render.scene import Scene, rigid
from autodrive.transforms import quaternion_from_euler
from tests.render import scenes
from tests.render.scenes import BLACK, GREY, WHITE, box, ground, moment, needs_gl, node, pinhole, scene, thing, view

pytestmark = needs_gl

SIDES = ("left", "right")
QUALITIES = ("software", "software-fxaa", "gpu")


def luminance(rgba: np.ndarray) -> np.ndarray:
    return rgba[..., :3].astype(float) @ (0.2126, 0.7152, 0.0722)


def rays(own: scenes.CameraIntrinsics) -> np.ndarray:
    """Directions with z = 1 through the middle of each pixel, optical frame, shape (h, w, 3)."""
    u, v = np.meshgrid(np.arange(own.width) + 0.5, np.arange(own.height) + 0.5)
    return np.stack([(u - own.cx) / own.fx, (v - own.cy) / own.fy, np.ones_like(u)], axis=-1)


@pytest.mark.parametrize("quality", QUALITIES)
def test_marker_corners_are_seen_where_they_project(quality: str) -> None:
    """A white square on black ground: its middle of brightness and its edges, from an oblique place."""
    corners = np.array([(1.2, -0.2), (1.6, -0.2), (1.6, 0.3), (1.2, 0.3)])
    marker = ground(*corners[0], *corners[2], WHITE)
    around = [
        ground(-50, -50, 1.2, 50, BLACK),
        ground(1.6, -50, 50, 50, BLACK),
        ground(1.2, -50, 1.6, -0.2, BLACK),
        ground(1.2, 0.3, 1.6, 50, BLACK),
    ]
    look = view(0.1, 0.05, 0.5, yaw_deg=3.0, pitch_deg=28.0, own=pinhole(640, 480, 50.0))
    with Renderer(scene(node("marker", marker, *around, casts=False)), quality) as renderer:
        seen = luminance(renderer.draw(moment(), [look])[0].rgba) > 60.0
    optical = np.linalg.inv(rigid(look.position, look.orientation))
    points = (optical[:3, :3] @ np.column_stack([corners, np.zeros(4)]).T).T + optical[:3, 3]
    k = look.intrinsics
    expected = np.column_stack([k.cx + k.fx * points[:, 0] / points[:, 2], k.cy + k.fy * points[:, 1] / points[:, 2]])
    # a pixel shows the square if its middle is in it: then every edge, and so every corner, is where it should be
    square = shapely.Polygon(expected)
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    margin = 1.0 if quality == "software-fxaa" else 0.5  # FXAA rounds the corner's pixel off
    clear = shapely.distance(square.exterior, shapely.points(u, v)) > margin
    assert np.array_equal(seen[clear], shapely.contains_xy(square, u, v)[clear])
    assert seen[clear].sum() > 5000


def test_depth_of_every_pixel_is_the_analytic_distance() -> None:
    wall = box((3.0, 0.0, 0.5), (0.2, 8.0, 1.0), GREY, Label.WALL)
    own = pinhole(320, 240, 41.669)
    look = view(0.0, 0.0, 0.15, pitch_deg=7.294, own=own)
    with Renderer(scene(node("floor", ground(-9, -9, 9, 9), casts=False), node("wall", wall))) as renderer:
        picture = renderer.draw(moment(), [look], depth=True, labels=True)[0]
    assert picture.depth is not None
    assert picture.labels is not None
    turn = rigid(look.position, look.orientation)[:3, :3]
    d = rays(own) @ turn.T
    to_floor = np.where(d[..., 2] < 0, -0.15 / np.minimum(d[..., 2], -1e-12), np.inf)
    to_wall = np.where(d[..., 0] > 0, 2.9 / np.maximum(d[..., 0], 1e-12), np.inf)
    height = 0.15 + to_wall * d[..., 2]
    to_wall[(height < 0) | (height > 1.0)] = np.inf
    expected = np.minimum(to_floor, to_wall)
    # a depth buffer of 24 bits, near 0.01 m: z^2 / (near 2^24); pixels on an edge may show either side
    inner = np.isfinite(expected) & (expected < 6.0) & (np.abs(to_floor - to_wall) > 0.15)
    resolution = expected[inner] ** 2 / (0.01 * 2**24)
    assert np.all(np.abs(picture.depth[inner] - expected[inner]) < 4.0 * resolution + 2e-5)
    assert inner.sum() > 40_000
    sky = ~np.isfinite(expected)
    assert np.all(np.isinf(picture.depth[sky]))
    assert np.all(picture.labels[sky] == Label.NOTHING)
    assert np.all(picture.labels[inner & (to_floor < to_wall)] == Label.ROAD)
    assert np.all(picture.labels[inner & (to_wall < to_floor)] == Label.WALL)


@pytest.mark.parametrize("quality", QUALITIES)
def test_a_box_throws_its_shadow_away_from_the_sun(quality: str) -> None:
    """A tower's shadow ends at height / tan(elevation) on the far side; what the sun reaches is bright."""
    from autodrive.render.look import DAY

    height = 0.5
    tower = box((0.0, 0.0, height / 2), (0.1, 0.1, height), GREY, Label.BLOCK)
    sun = np.array(DAY.sun_direction)
    own = pinhole(400, 400, 60.0)
    look = view(0.0, 0.0, 3.0, pitch_deg=90.0, own=own)
    with Renderer(scene(node("floor", ground(-4, -4, 4, 4), casts=False), node("tower", tower)), quality) as renderer:
        seen = luminance(renderer.draw(moment(), [look])[0].rgba)

    def brightness(x: float, y: float) -> float:
        """Of the ground there: the camera looks down with the map's x up in the picture and y to the left."""
        u, v = own.cx - own.fx * y / 3.0, own.cy - own.fy * x / 3.0
        return float(seen[int(v), int(u)])

    away = -sun[:2] / np.linalg.norm(sun[:2])
    reach = height * np.linalg.norm(sun[:2]) / sun[2]
    lit = brightness(*(-1.0 * away))
    for share in (0.4, 0.6, 0.8):
        assert brightness(*(share * reach * away)) < 0.7 * lit
    assert brightness(*((reach + 0.15) * away)) == pytest.approx(lit, rel=0.02)


@pytest.mark.parametrize("quality", QUALITIES)
def test_a_vehicle_throws_a_shadow_too_and_takes_it_along(quality: str) -> None:
    from autodrive.render.look import DAY

    away = -np.array(DAY.sun_direction[:2]) / DAY.sun_direction[2]
    own = pinhole(400, 400, 60.0)
    look = view(0.5, 0.0, 3.0, pitch_deg=90.0, own=own)
    with Renderer(scene(node("floor", ground(-4, -4, 4, 4), casts=False), vehicles=1), quality) as renderer:
        for x in (0.0, 0.7):
            now = moment(1)
            now.vehicles["position"][0] = x, 0.0, 0.0
            seen = luminance(renderer.draw(now, [look])[0].rgba)
            place = np.array([x + 0.08, 0.0]) + 0.085 * away  # where the shadow of the roof's far edge lies
            edge = place + 0.05 * away / np.linalg.norm(away)
            u, v = own.cx - own.fx * edge[1] / 3.0, own.cy - own.fy * (edge[0] - 0.5) / 3.0
            lit = seen[int(own.cy - own.fy * (-0.4) / 3.0), int(own.cx - own.fx * 1.0 / 3.0)]
            assert seen[int(v), int(u)] < 0.75 * lit, x


@pytest.mark.parametrize("quality", QUALITIES)
def test_night_is_dark_but_not_black_and_headlights_light_the_road(quality: str) -> None:
    world = scene(node("floor", ground(-6, -6, 6, 6), casts=False), vehicles=1)
    look = view(0.2, 0.0, 0.15, pitch_deg=12.0)
    with Renderer(world, quality) as renderer:
        day = luminance(renderer.draw(moment(1), [look])[0].rgba)
        night = luminance(renderer.draw(moment(1, is_day=False), [look])[0].rgba)
        lit = moment(1, is_day=False)
        lit.vehicles["lamps"][0, [LAMPS.index("head_left"), LAMPS.index("head_right")]] = 1.0
        lamps = luminance(renderer.draw(lit, [look])[0].rgba)
    road = slice(150, 240)
    assert 2.0 < night[road].mean() < 0.35 * day[road].mean()
    assert lamps[road, 140:180].mean() > 3.0 * night[road, 140:180].mean()


@pytest.mark.parametrize("beam", ["head", "high_beam"])
@pytest.mark.parametrize("quality", QUALITIES)
def test_headlights_throw_shadows(quality: str, beam: str) -> None:
    """The high beam comes on with the low one: its own light alone is what is looked at."""
    post = box((1.0, 0.0, 0.1), (0.1, 0.3, 0.2), GREY, Label.BLOCK)
    walls = {
        side: node(side, box((2.0, 1.0 * k, 0.1), (0.1, 0.4, 0.2), GREY, Label.WALL))
        for side, k in (("l", 1), ("r", -1))
    }
    middle = node("m", box((2.0, 0.0, 0.1), (0.1, 0.3, 0.2), GREY, Label.WALL))
    look = view(0.0, 0.0, 1.2, pitch_deg=30.0)
    pictures = []
    for static in ([*walls.values(), middle], [*walls.values(), middle, node("post", post)]):
        floor = node("floor", ground(-6, -6, 6, 6), casts=False)
        with Renderer(scene(floor, *static, vehicles=1), quality) as renderer:
            shown = []
            for lamps in (("head",), ("head", "high_beam")):
                lit = moment(1, is_day=False)
                lit.vehicles["lamps"][0, [LAMPS.index(f"{lamp}_{side}") for lamp in lamps for side in SIDES]] = 1.0
                picture = renderer.draw(lit, [look], labels=True)[0]
                shown.append(luminance(picture.rgba))
            own = shown[0] if beam == "head" else shown[1] - shown[0]
            pictures.append((own, picture.labels))
    (free, _), (hidden, labels) = pictures
    assert labels is not None
    is_lit = (labels == Label.WALL) & (free > (40.0 if beam == "head" else 15.0))  # the night alone is darker
    behind = is_lit & (np.abs(np.arange(320) - 160)[None] < 15)
    beside = is_lit & (np.abs(np.arange(320) - 160)[None] > 60)
    assert behind.sum() > 50
    assert hidden[behind].mean() < 0.6 * free[behind].mean()
    if beam == "head":  # the high beam is too narrow for the walls beside
        assert hidden[beside].mean() == pytest.approx(free[beside].mean(), rel=0.02)


def test_each_lamp_glows_by_its_own_name() -> None:
    """Twelve glasses side by side: the one that is lit is bright, all others stay as they were."""
    glass = Material("glass", (0.1, 0.1, 0.1), emission=(5.0, 5.0, 5.0))
    # between the front lamps and the rear ones, which look away from it
    places = [(0.1, 0.06 * (i - 5.5), 0.0) for i in range(len(LAMPS))]
    nodes = tuple(
        node(f"lamp_{lamp}", box(place, (0.02, 0.03, 0.03), glass, Label.VEHICLE), lamp=lamp)
        for lamp, place in zip(LAMPS, places, strict=True)
    )
    look = view(-0.9, 0.0, 0.0)
    k = look.intrinsics
    world = Scene(Asset("nothing", ()), [Asset("car", nodes)], [], [scenes.lights()])
    with Renderer(world) as renderer:
        dark = luminance(renderer.draw(moment(1, is_day=False), [look])[0].rgba)
        for i in range(len(LAMPS)):
            lit = moment(1, is_day=False)
            lit.vehicles["lamps"][0, i] = 1.0
            seen = luminance(renderer.draw(lit, [look])[0].rgba)
            columns = [round(k.cx - k.fx * y / (x + 0.9 - 0.01)) for x, y, _ in places]
            brighter = [seen[120, u] - dark[120, u] > 100.0 for u in columns]
            assert brighter == [j == i for j in range(len(LAMPS))], LAMPS[i]


def test_the_same_moment_gives_the_same_bytes_also_from_another_renderer() -> None:
    world = scene(node("floor", ground(-6, -6, 6, 6), casts=False), vehicles=2)
    now = moment(2, is_day=False)
    now.vehicles["position"][1] = 0.8, 0.1, 0.0
    now.vehicles["lamps"][:] = 1.0
    looks = [view(0.2, 0.0, 0.15, pitch_deg=12.0), view(-1.0, 0.5, 0.6, yaw_deg=-20, pitch_deg=20.0)]
    with Renderer(world) as renderer:
        first = [p.rgba.tobytes() for p in renderer.draw(now, looks)]
        renderer.draw(moment(2), looks)
        assert [p.rgba.tobytes() for p in renderer.draw(now, looks)] == first
    with Renderer(world) as another:
        assert [p.rgba.tobytes() for p in another.draw(now, looks)] == first


def test_views_of_any_sizes_come_back_in_their_order_and_are_the_callers_own() -> None:
    looks = [view(0, 0, 1, own=pinhole(*size)) for size in ((64, 48), (32, 40), (64, 48), (10, 10))]
    with Renderer(scene(node("floor", ground(-6, -6, 6, 6), casts=False))) as renderer:
        pictures = renderer.draw(moment(), looks)
        kept = [p.rgba.copy() for p in pictures]
        renderer.draw(moment(is_day=False), looks)
    assert [p.rgba.shape for p in pictures] == [(48, 64, 4), (40, 32, 4), (48, 64, 4), (10, 10, 4)]
    assert all(np.array_equal(p.rgba, k) for p, k in zip(pictures, kept, strict=True))
    assert all((p.rgba[..., 3] == 255).all() for p in pictures)


def test_a_thing_that_moves_is_seen_where_it_is_and_its_old_shadow_is_gone() -> None:
    crate = thing("crate", box((0, 0, 0), (0.2, 0.2, 0.2), WHITE, Label.BOX))
    look = view(0.0, 0.0, 3.0, pitch_deg=90.0)
    world = scene(node("floor", ground(-4, -4, 4, 4), casts=False), objects=(crate,))
    with Renderer(world) as renderer:
        pictures = []
        for x in (-0.5, 0.5):
            now = moment(objects=1)
            now.objects["position"][0] = x, 0.0, 0.1
            pictures.append(renderer.draw(now, [look], labels=True)[0])
        now.objects["position"][0] = -0.5, 0.0, 0.1
        again = renderer.draw(now, [look])[0]
    rows = [np.nonzero(p.labels == Label.BOX)[0].mean() for p in pictures if p.labels is not None]
    expected = [120 - pinhole().fy * x / (3.0 - 0.2) for x in (-0.5, 0.5)]
    assert rows == pytest.approx(expected, abs=1.5)
    assert np.array_equal(again.rgba, pictures[0].rgba)


def test_nothing_but_sky_is_a_picture_too() -> None:
    with Renderer(Scene(Asset("nothing", ()), [], [], [])) as renderer:
        picture = renderer.draw(moment(), [view(0, 0, 1, pitch_deg=-30)], depth=True, labels=True)[0]
    assert picture.depth is not None
    assert np.isinf(picture.depth).all()
    assert luminance(picture.rgba).min() > 50


def test_an_unknown_quality_is_refused_by_name() -> None:
    with pytest.raises(AutodriveError, match=r"'ultra'.*auto, software, .*gpu"):
        Renderer(scene(), "ultra")


def test_a_tilted_vehicle_is_drawn_tilted() -> None:
    """Its silhouette from behind turns with its roll."""
    world = scene(vehicles=1)
    look = view(-1.5, 0.0, 0.05)
    with Renderer(world) as renderer:
        spans = []
        for roll in (0.0, math.pi / 2):
            now = moment(1)
            now.vehicles["orientation"][0] = quaternion_from_euler(roll, 0.0, 0.0)
            labels = renderer.draw(now, [look], labels=True)[0].labels
            assert labels is not None
            v, u = np.nonzero(labels == Label.VEHICLE)
            spans.append((np.ptp(u), np.ptp(v)))
    assert spans[0] == pytest.approx(spans[1][::-1], abs=2)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the memory of a process is read from /proc")
def test_many_frames_leak_nothing() -> None:
    """Nor do many renderers. (Ten thousand frames: benchmarks/camera.py.)"""

    def resident() -> int:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    world = scene(node("floor", ground(-6, -6, 6, 6), casts=False), vehicles=1)
    look = view(0.2, 0.0, 0.15, pitch_deg=12.0, own=pinhole(64, 48))
    with Renderer(world) as renderer:
        for _ in range(50):
            renderer.draw(moment(1), [look])
        before = resident()
        for _ in range(1000):
            renderer.draw(moment(1), [look])
        assert resident() - before < 4e6  # a picture of each frame would be 12 MB
    before = resident()
    for _ in range(5):
        with Renderer(world) as renderer:
            renderer.draw(moment(1), [look])
    assert resident() - before < 60e6  # a renderer's maps alone are 20 MB each
