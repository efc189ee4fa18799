"""Images of small scenes, compared with geometry computed by hand."""

from __future__ import annotations

import gc
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from autodrive.base.errors import AutodriveError
from autodrive.base.transforms import quaternion_from_euler
from autodrive.graphics.assets.asset import Asset, Material
from autodrive.graphics.render.look import DAY, sun_at
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import RenderScene, rigid
from autodrive.graphics.render.shadows import Shadows
from autodrive.physics.actuators.lights import LAMPS
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import CameraIntrinsics
from tests.support.scenes import (
    BLACK,
    CAR,
    GREY,
    WHITE,
    box,
    ground,
    lights,
    needs_gl,
    node,
    pinhole,
    render_state,
    scene,
    thing,
    view,
)

pytestmark = needs_gl

QUALITIES = ("software", "gpu")


BEAMS = ("head", "high_beam")
LUMINANCE = (0.2126, 0.7152, 0.0722)
FLOOR = node("floor", ground(-6, -6, 6, 6), casts=False)
DOWN = view(0.0, 0.0, 3.0, pitch_deg=90.0, own=pinhole(400, 400, 60.0))
"""Looks down from 3 m; x of the map is up in the image, y to the left."""


def shown(renderer: Renderer, state: RenderState, look: View) -> np.ndarray:
    """Luminance of each pixel of a view, 0 to 255."""
    return renderer.draw(state, [look])[0].rgba[..., :3].astype(float) @ LUMINANCE


DEPTH_ERROR = 1e-5
"""Relative: corners in clip space are float32, with a rounding of 6e-8, times ten for the pixels between them."""


def on_floor(seen: np.ndarray, x: float, y: float) -> float:
    """Of an image of `DOWN`, at a place of the map."""
    k = DOWN.intrinsics
    return float(seen[int(k.cy - k.fy * x / 3.0), int(k.cx - k.fx * y / 3.0)])


def lit_by(*lamps: str, n: int = 1) -> RenderState:
    """Cars at night with these lamps of both sides."""
    state = render_state(n, is_day=False)
    state.vehicles["lamps"][:, [LAMPS.index(f"{lamp}_{side}") for lamp in lamps for side in ("left", "right")]] = 1.0
    return state


def rays(own: CameraIntrinsics) -> np.ndarray:
    """Directions with z = 1 through the middle of each pixel, optical frame, shape (h, w, 3)."""
    u, v = np.meshgrid(np.arange(own.width) + 0.5, np.arange(own.height) + 0.5)
    return np.stack([(u - own.cx) / own.fx, (v - own.cy) / own.fy, np.ones_like(u)], axis=-1)


@pytest.mark.parametrize("quality", [*QUALITIES, "software-fxaa"])
def test_the_corners_of_a_marker_are_where_they_project(quality: str) -> None:
    """A white square on black ground, seen obliquely."""
    corners = np.array([(1.2, -0.2), (1.6, -0.2), (1.6, 0.3), (1.2, 0.3)])
    marker = ground(1.2, -0.2, 1.6, 0.3, WHITE)
    around = [
        ground(-50, -50, 1.2, 50, BLACK),
        ground(1.6, -50, 50, 50, BLACK),
        ground(1.2, -50, 1.6, -0.2, BLACK),
        ground(1.2, 0.3, 1.6, 50, BLACK),
    ]
    look = view(0.1, 0.05, 0.5, yaw_deg=3.0, pitch_deg=28.0, own=pinhole(640, 480, 50.0))
    with Renderer(scene(node("marker", marker, *around, casts=False)), quality) as renderer:
        seen = shown(renderer, render_state(), look) > 60.0
    optical = np.linalg.inv(rigid(look.position, look.orientation))
    points = (optical[:3, :3] @ np.column_stack([corners, np.zeros(4)]).T).T + optical[:3, 3]
    k = look.intrinsics
    expected = np.column_stack([k.cx + k.fx * points[:, 0] / points[:, 2], k.cy + k.fy * points[:, 1] / points[:, 2]])
    # a pixel shows the square if its centre is inside: then every edge and corner is at its place
    square = shapely.Polygon(expected)
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    margin = 1.0 if quality == "software-fxaa" else 0.5  # FXAA rounds the pixel at a corner
    clear = shapely.distance(square.exterior, shapely.points(u, v)) > margin
    assert np.array_equal(seen[clear], shapely.contains_xy(square, u, v)[clear])
    assert seen[clear].sum() > 5000


def test_depth_of_every_pixel_is_the_analytic_distance() -> None:
    wall = box((3.0, 0.0, 0.5), (0.2, 8.0, 1.0), GREY, Label.WALL)
    own = pinhole(320, 240, 41.669)
    look = view(0.0, 0.0, 0.15, pitch_deg=7.294, own=own)
    with Renderer(scene(node("floor", ground(-9, -9, 9, 9), casts=False), node("wall", wall))) as renderer:
        picture = renderer.draw(render_state(), [look], depth=True, labels=True)[0]
    assert picture.depth is not None
    assert picture.labels is not None
    turn = rigid(look.position, look.orientation)[:3, :3]
    d = rays(own) @ turn.T
    to_floor = np.where(d[..., 2] < 0, -0.15 / np.minimum(d[..., 2], -1e-12), np.inf)
    to_wall = np.where(d[..., 0] > 0, 2.9 / np.maximum(d[..., 0], 1e-12), np.inf)
    height = 0.15 + to_wall * d[..., 2]
    to_wall[(height < 0) | (height > 1.0)] = np.inf
    expected = np.minimum(to_floor, to_wall)
    # pixels on an edge may show either side
    inner = np.isfinite(expected) & (expected < 6.0) & (np.abs(to_floor - to_wall) > 0.15)
    np.testing.assert_allclose(picture.depth[inner], expected[inner], rtol=DEPTH_ERROR)
    assert inner.sum() > 40_000
    sky = ~np.isfinite(expected)
    assert np.all(np.isinf(picture.depth[sky]))
    assert np.all(picture.labels[sky] == Label.NOTHING)
    assert np.all(picture.labels[inner & (to_floor < to_wall)] == Label.ROAD)
    assert np.all(picture.labels[inner & (to_wall < to_floor)] == Label.WALL)


@pytest.mark.parametrize("distance", [20.0, 95.0, 900.0])
def test_depth_is_as_exact_far_away(distance: float) -> None:
    """A wall across the x axis, whose near clipping distance is 1 cm: a buffer of 24 bits knows 95 m to 5 cm."""
    wall = box((distance + 0.1, 0.0, 0.0), (0.2, 4000.0, 2000.0), GREY, Label.WALL)
    look = view(0.0, 0.0, 0.15, yaw_deg=15.0, pitch_deg=-20.0, own=pinhole(96, 72, 41.669))
    with Renderer(scene(node("wall", wall))) as renderer:
        picture = renderer.draw(render_state(), [look], depth=True)[0]
    ahead = rays(look.intrinsics) @ rigid(look.position, look.orientation)[:3, :3].T
    assert picture.depth is not None
    is_near = distance / ahead[..., 0] < 0.99 * look.far
    assert is_near.sum() > 1500
    np.testing.assert_allclose(picture.depth[is_near], distance / ahead[is_near][:, 0], rtol=DEPTH_ERROR)


@pytest.mark.parametrize("quality", QUALITIES)
def test_the_shadow_of_a_box_points_away_from_the_sun(quality: str) -> None:
    """The shadow ends at height / tan(elevation) from the box; sunlit ground is bright."""
    height = 0.5
    tower = box((0.0, 0.0, height / 2), (0.1, 0.1, height), GREY, Label.BLOCK)
    sun = np.array(DAY.sun_direction)
    with Renderer(scene(FLOOR, node("tower", tower)), quality) as renderer:
        seen = shown(renderer, render_state(), DOWN)
    away = -sun[:2] / np.linalg.norm(sun[:2])
    reach = height * np.linalg.norm(sun[:2]) / sun[2]
    lit = on_floor(seen, *-away)
    for share in (0.4, 0.6, 0.8):
        assert on_floor(seen, *(share * reach * away)) < 0.7 * lit
    assert on_floor(seen, *((reach + 0.15) * away)) == pytest.approx(lit, rel=0.02)


def test_shadows_follow_the_time_of_day() -> None:
    """In the morning, at noon and in the afternoon; the shadow map of the towers is rendered again."""
    tower = box((0.0, 0.0, 0.25), (0.1, 0.1, 0.5), GREY, Label.BLOCK)
    places = {hour: np.array(sun_at(3600.0 * hour)) for hour in (9, 12, 15)}
    with Renderer(scene(FLOOR, node("tower", tower)), "software") as renderer:
        for hour in places:
            now = render_state()
            now.header["time_of_day"] = 3600.0 * hour
            seen = shown(renderer, now, DOWN)
            shade = {other: on_floor(seen, *(-0.25 * sun[:2] / sun[2])) for other, sun in places.items()}
            assert min(shade, key=shade.__getitem__) == hour
            assert sorted(shade.values())[1] > 1.3 * shade[hour]


@pytest.mark.parametrize("quality", QUALITIES)
def test_the_shadow_of_a_vehicle_moves_with_it(quality: str) -> None:
    away = -np.array(DAY.sun_direction[:2]) / DAY.sun_direction[2]
    with Renderer(scene(FLOOR, vehicles=1), quality) as renderer:
        for x in (0.0, 0.7):
            now = render_state(1)
            now.vehicles["position"][0] = x, 0.0, 0.0
            seen = shown(renderer, now, DOWN)
            edge = np.array([x + 0.08, 0.0]) + 0.085 * away  # shadow of the far edge of the roof
            edge += 0.05 * away / np.linalg.norm(away)
            assert on_floor(seen, *edge) < 0.75 * on_floor(seen, 0.1, -1.0), x


@pytest.mark.parametrize("hour", [7.5, 12.0, 17.0])
def test_shadows_on_the_ground_are_drawn_wherever_they_fall(hour: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing 5 m more of the ground around each changes nothing: towers, boxes and cars, turned and in the air."""
    towers = [box((x, y, 0.2), (0.1, 0.3, 0.4), GREY, Label.BLOCK) for x, y in ((-0.7, 0.4), (0.9, -0.6), (0.9, -0.3))]
    crate = thing("crate", box((0, 0, 0), (0.2, 0.1, 0.2), WHITE, Label.BOX))
    world = scene(FLOOR, node("towers", *towers), vehicles=3, objects=(crate, crate))
    now = render_state(3, 2)
    now.header["time_of_day"] = 3600.0 * hour
    now.vehicles["position"] = (0.0, 0.0, 0.0), (0.8, 0.5, 0.4), (-0.6, -0.7, 0.1)
    now.vehicles["orientation"][1:] = quaternion_from_euler(0.5, 0.7, 2.0), quaternion_from_euler(1.6, 0.0, 0.4)
    now.objects["position"] = (0.4, 0.9, 0.1), (-0.2, -0.9, 0.5)
    now.objects["orientation"][1] = quaternion_from_euler(0.4, 0.8, 0.1)
    looks = [DOWN, view(-1.5, 0.0, 0.3, pitch_deg=10.0)]
    with Renderer(world, "software") as renderer:
        images = renderer.draw(now, looks)
    monkeypatch.setattr(Shadows, "margin", 5.0)
    with Renderer(world, "software") as renderer:
        wider = renderer.draw(now, looks)
    for image, other in zip(images, wider, strict=True):
        assert np.max(np.abs(image.rgba.astype(int) - other.rgba)) <= 1  # larger triangles are interpolated otherwise


@pytest.mark.parametrize("is_day", [True, False])
@pytest.mark.parametrize("quality", QUALITIES)
def test_a_vehicle_darkens_the_road_beside_it_and_not_the_wall_above_it(quality: str, is_day: bool) -> None:
    wall = box((0.0, 0.09, 0.2), (4.0, 0.02, 0.4), GREY, Label.WALL)  # 1 cm beside the car, which is 0.09 m high
    world = scene(FLOOR, node("wall", wall), vehicles=1)
    look = view(0.08, -1.5, 0.25, yaw_deg=90.0)
    with Renderer(world, quality) as renderer:
        beside = shown(renderer, render_state(1, is_day=is_day), look)
        away = render_state(1, is_day=is_day)
        away.vehicles["position"][0] = 3.0, 0.0, 0.0
        alone = shown(renderer, away, look)

    def row(height: float) -> int:
        return int(120 + look.intrinsics.fy * (0.25 - height) / 1.58)

    for height in (0.16, 0.25, 0.35):  # above the car and its shadow
        assert beside[row(height), 160] == pytest.approx(alone[row(height), 160], rel=0.03)
    road = int(120 + look.intrinsics.fy * 0.25 / 1.42)  # 1 cm before the car
    assert beside[road, 160] < 0.8 * alone[road, 160]


@pytest.mark.parametrize("n_long", [0, 1])
@pytest.mark.parametrize("quality", QUALITIES)
def test_each_vehicle_dims_the_ground_around_its_own_outline(quality: str, n_long: int) -> None:
    """Cars of different sizes: the ground 2 cm beside the middle of each is as dark, whichever comes first."""
    long = thing("long", box((0.08, 0.0, 0.05), (0.52, 0.28, 0.08), GREY, Label.VEHICLE))
    models = [long, CAR] if n_long == 0 else [CAR, long]
    world = RenderScene(Asset("static", (FLOOR,)), models, (), [lights()] * 2)
    state = render_state(2, is_day=False)
    state.vehicles["position"][:, 0] = -0.08
    state.vehicles["position"][:, 1] = 0.6, -0.6
    with Renderer(world, quality) as renderer:
        seen = shown(renderer, state, DOWN)
    bare = on_floor(seen, 1.0, 0.0)
    half = (0.14, 0.07) if n_long == 0 else (0.07, 0.14)
    shade = [
        on_floor(seen, 0.0, y + side * (own + 0.02)) / bare
        for y, own in zip((0.6, -0.6), half, strict=True)
        for side in (-1, 1)
    ]
    assert max(shade) < 0.9
    # the camera has pixels of 9 mm on the floor, over which the shade changes by a fifth
    assert max(shade) - min(shade) < 0.2


@pytest.mark.parametrize("quality", QUALITIES)
def test_people_see_a_dark_vehicle_at_night_and_sensors_see_no_more_than_there_is(quality: str) -> None:
    """A car as dark as the road is brighter than the road for people only, and only at night."""
    blue, road = Material("blue", (0.01, 0.02, 0.08)), Material("road", (0.03, 0.03, 0.03), roughness=0.9)
    dark = thing("car", box((0.08, 0.0, 0.05), (0.26, 0.14, 0.08), blue, Label.VEHICLE))
    floor = node("floor", ground(-6, -6, 6, 6, road), casts=False)
    world = RenderScene(Asset("static", (floor,)), [dark], (), [lights()])
    sensor = view(-1.0, 0.0, 0.3, pitch_deg=15.0)
    people = replace(sensor, is_outlined=True)
    with Renderer(world, quality) as renderer:
        for is_day in (True, False):
            state = render_state(1, is_day=is_day)
            own, bright = (shown(renderer, state, one) for one in (sensor, people))
            labels = renderer.draw(state, [sensor], labels=True)[0].labels
            assert labels is not None
            car = labels == Label.VEHICLE
            assert np.array_equal(own[:, :60], bright[:, :60])  # beside the car
            if is_day:
                assert np.array_equal(own, bright)
    assert own[car].mean() < 1.3 * own[200, 20:60].mean()  # of the road beside it
    assert bright[car].mean() > 1.5 * own[200, 20:60].mean()


@pytest.mark.parametrize("quality", QUALITIES)
def test_night_is_dark_but_not_black_and_headlights_light_the_road(quality: str) -> None:
    look = view(0.2, 0.0, 0.15, pitch_deg=12.0)
    with Renderer(scene(FLOOR, vehicles=1), quality) as renderer:
        day, night, lamps = (
            shown(renderer, state, look) for state in (render_state(1), render_state(1, is_day=False), lit_by("head"))
        )
    road = slice(150, 240)
    assert 2.0 < night[road].mean() < 0.35 * day[road].mean()
    assert lamps[road, 140:180].mean() > 3.0 * night[road, 140:180].mean()


@pytest.mark.parametrize("quality", QUALITIES)
def test_headlights_cast_shadows(quality: str) -> None:
    """The high beam is lit together with the low beam: the difference is its own light."""
    post = box((1.0, 0.0, 0.1), (0.1, 0.3, 0.2), GREY, Label.BLOCK)
    places = {"l": 1.0, "m": 0.0, "r": -1.0}
    walls = [
        node(name, box((2.0, y, 0.1), (0.1, 0.4 if y else 0.3, 0.2), GREY, Label.WALL)) for name, y in places.items()
    ]
    look = view(0.0, 0.0, 1.2, pitch_deg=30.0)
    images = []
    for static in (walls, [*walls, node("post", post)]):
        with Renderer(scene(FLOOR, *static, vehicles=1), quality) as renderer:
            low, both = (renderer.draw(lit_by(*lamps), [look], labels=True)[0] for lamps in (("head",), BEAMS))
        head = low.rgba[..., :3].astype(float) @ LUMINANCE
        assert both.labels is not None
        images.append(({"head": head, "high_beam": both.rgba[..., :3].astype(float) @ LUMINANCE - head}, both.labels))
    (free_by_beam, _), (hidden_by_beam, labels) = images
    for beam, least in (("head", 40.0), ("high_beam", 15.0)):  # the night without lamps is darker
        free, hidden = free_by_beam[beam], hidden_by_beam[beam]
        is_lit = (labels == Label.WALL) & (free > least)
        behind = is_lit & (np.abs(np.arange(320) - 160)[None] < 15)
        assert behind.sum() > 50, beam
        assert hidden[behind].mean() < 0.6 * free[behind].mean(), beam
        if beam == "head":  # the high beam is too narrow for the walls beside
            beside = is_lit & (np.abs(np.arange(320) - 160)[None] > 60)
            assert hidden[beside].mean() == pytest.approx(free[beside].mean(), rel=0.02)


def test_each_lamp_glows_alone() -> None:
    """Twelve lamps side by side: the lit one is bright, the others do not change."""
    glass = Material("glass", (0.1, 0.1, 0.1), emission=(5.0, 5.0, 5.0))
    # between the front and rear lamps, which point away from it
    places = [(0.1, 0.06 * (i - 5.5), 0.0) for i in range(len(LAMPS))]
    nodes = tuple(
        node(f"lamp_{lamp}", box(place, (0.02, 0.03, 0.03), glass, Label.VEHICLE), lamp=lamp)
        for lamp, place in zip(LAMPS, places, strict=True)
    )
    look = view(-0.9, 0.0, 0.0)
    k = look.intrinsics
    world = RenderScene(Asset("nothing", ()), [Asset("car", nodes)], [], [lights()])
    with Renderer(world) as renderer:
        dark = shown(renderer, render_state(1, is_day=False), look)
        for i in range(len(LAMPS)):
            lit = render_state(1, is_day=False)
            lit.vehicles["lamps"][0, i] = 1.0
            seen = shown(renderer, lit, look)
            columns = [round(k.cx - k.fx * y / (x + 0.9 - 0.01)) for x, y, _ in places]
            brighter = [seen[120, u] - dark[120, u] > 100.0 for u in columns]
            assert brighter == [j == i for j in range(len(LAMPS))], LAMPS[i]


def test_the_same_state_gives_the_same_bytes_in_another_renderer_too() -> None:
    world = scene(FLOOR, vehicles=2)
    now = render_state(2, is_day=False)
    now.vehicles["position"][1] = 0.8, 0.1, 0.0
    now.vehicles["lamps"][:] = 1.0
    looks = [view(0.2, 0.0, 0.15, pitch_deg=12.0), view(-1.0, 0.5, 0.6, yaw_deg=-20, pitch_deg=20.0)]
    with Renderer(world) as renderer:
        first = [p.rgba.tobytes() for p in renderer.draw(now, looks)]
        renderer.draw(render_state(2), looks)
        assert [p.rgba.tobytes() for p in renderer.draw(now, looks)] == first
    with Renderer(world) as another:
        assert [p.rgba.tobytes() for p in another.draw(now, looks)] == first


def test_images_are_in_the_order_of_the_views_and_are_not_reused() -> None:
    looks = [view(0, 0, 1, own=pinhole(*size)) for size in ((64, 48), (32, 40), (64, 48), (10, 10))]
    with Renderer(scene(FLOOR)) as renderer:
        images = renderer.draw(render_state(), looks)
        kept = [p.rgba.copy() for p in images]
        renderer.draw(render_state(is_day=False), looks)
    assert [p.rgba.shape for p in images] == [(48, 64, 4), (40, 32, 4), (48, 64, 4), (10, 10, 4)]
    assert all(np.array_equal(p.rgba, k) for p, k in zip(images, kept, strict=True))
    assert all((p.rgba[..., 3] == 255).all() for p in images)


def test_a_moved_object_is_at_its_new_place_and_its_old_shadow_is_gone() -> None:
    crate = thing("crate", box((0, 0, 0), (0.2, 0.2, 0.2), WHITE, Label.BOX))
    look = view(0.0, 0.0, 3.0, pitch_deg=90.0)
    world = scene(FLOOR, objects=(crate,))
    with Renderer(world) as renderer:
        images = []
        for x in (-0.5, 0.5):
            now = render_state(objects=1)
            now.objects["position"][0] = x, 0.0, 0.1
            images.append(renderer.draw(now, [look], labels=True)[0])
        now.objects["position"][0] = -0.5, 0.0, 0.1
        again = renderer.draw(now, [look])[0]
    rows = [np.nonzero(p.labels == Label.BOX)[0].mean() for p in images if p.labels is not None]
    expected = [120 - pinhole().fy * x / (3.0 - 0.2) for x in (-0.5, 0.5)]
    assert rows == pytest.approx(expected, abs=1.5)
    assert np.array_equal(again.rgba, images[0].rgba)


def test_an_empty_scene_shows_the_sky() -> None:
    with Renderer(RenderScene(Asset("nothing", ()), [], [], [])) as renderer:
        image = renderer.draw(render_state(), [view(0, 0, 1, pitch_deg=-30)], depth=True, labels=True)[0]
    assert image.depth is not None
    assert np.isinf(image.depth).all()
    assert (image.rgba[..., :3] @ LUMINANCE).min() > 50


def test_an_unknown_quality_is_an_error() -> None:
    with pytest.raises(AutodriveError, match=r"'ultra'.*auto, software, .*gpu"):
        Renderer(scene(), "ultra")


def test_a_rolled_vehicle_is_drawn_rolled() -> None:
    """Its silhouette from behind rolls with it."""
    world = scene(vehicles=1)
    look = view(-1.5, 0.0, 0.05)
    with Renderer(world) as renderer:
        spans = []
        for roll in (0.0, math.pi / 2):
            now = render_state(1)
            now.vehicles["orientation"][0] = quaternion_from_euler(roll, 0.0, 0.0)
            labels = renderer.draw(now, [look], labels=True)[0].labels
            assert labels is not None
            v, u = np.nonzero(labels == Label.VEHICLE)
            spans.append((np.ptp(u), np.ptp(v)))
    assert spans[0] == pytest.approx(spans[1][::-1], abs=2)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the memory of the process from /proc")
def test_many_frames_leak_no_memory() -> None:
    """Nor do many renderers. (benchmarks/camera.py draws ten thousand.)"""

    def resident() -> int:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    world = scene(FLOOR, vehicles=1)
    look = view(0.2, 0.0, 0.15, pitch_deg=12.0, own=pinhole(64, 48))
    with Renderer(world) as renderer:
        for _ in range(50):
            renderer.draw(render_state(1), [look])
        before = resident()
        for _ in range(400):
            renderer.draw(render_state(1), [look])
        assert resident() - before < 2e6  # one image of each frame would be 5 MB
    before = resident()
    for _ in range(5):
        with Renderer(world) as renderer:
            renderer.draw(render_state(1), [look])
    assert resident() - before < 60e6  # the shadow maps of one renderer are 20 MB
