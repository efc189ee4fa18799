"""Paint and shade on the ground, and rings of ducts: their area in an image, however small they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import shapely

from autodrive.graphics.assets.asset import Asset
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.meshes.strips import painted_lines, shade_along, strips
from autodrive.graphics.render.look import air_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import RenderScene
from autodrive.physics.sensors.camera.camera import world_from_camera
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import CameraIntrinsics, Weather
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world.factory import compile_scenario
from tests.support.scenes import ground, needs_gl, node, pinhole, render_state, view

pytestmark = needs_gl

SAMPLES = 8
"""In each direction: 64 a pixel."""


def linear(shown: np.ndarray) -> np.ndarray:
    """Linear light of sRGB values, which add up in a pixel."""
    s = shown / 255.0
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def at_start(scenario: str, vehicle: str) -> Iterator[tuple[Renderer, RenderState, View]]:
    """The map in dull light, in which no colour is too bright for an image, its start, and the front camera."""
    compiled = compile_scenario(scenario)
    state = RenderState.empty(len(compiled.vehicles), len(compiled.boxes))
    state.header["is_day"] = True
    state.header["air"] = air_of(Weather(clouds=1.0))
    (name,) = compiled.vehicles
    place = compiled.spec.vehicles[name]
    half = 0.5 * place.yaw
    state.vehicles["position"][0] = place.x, place.y, compiled.vehicles[name].ride_height
    state.vehicles["orientation"][0] = np.cos(half), 0.0, 0.0, np.sin(half)
    spec = load_vehicle(vehicle).cameras["front"]
    row = state.vehicles[0]
    where = world_from_camera(tuple(row["position"].tolist()), tuple(row["orientation"].tolist()), spec.mount)
    with Renderer(scene_of(compiled), "software") as renderer:
        yield renderer, state, View(*where, spec.intrinsics, spec.near, spec.far)


@pytest.fixture(scope="module")
def mini_map() -> Iterator[tuple[Renderer, RenderState, View]]:
    yield from at_start("mini_map", "nigel")


@pytest.fixture(scope="module")
def practice() -> Iterator[tuple[Renderer, RenderState, View]]:
    yield from at_start("practice", "roboracer_physical")


@pytest.fixture(scope="module")
def bare() -> Iterator[Renderer]:
    """The map without strips."""
    scene = scene_of(compile_scenario("mini_map"))
    with Renderer(replace(scene, static=replace(scene.static, strips=None)), "software") as renderer:
        yield renderer


def part(look: View, rows: slice, scale: int = 1) -> View:
    """These rows of a view, with `scale` times the resolution."""
    k = look.intrinsics
    height = rows.stop - rows.start
    own = CameraIntrinsics(
        k.width * scale, height * scale, k.fx * scale, k.fy * scale, k.cx * scale, (k.cy - rows.start) * scale
    )
    return replace(look, intrinsics=own)


def test_far_dashes_keep_their_area(mini_map: tuple[Renderer, RenderState, View], bare: Renderer) -> None:
    """Where the dashes are less than a pixel wide, against a render of 64 samples a pixel and its labels."""
    renderer, state, look = mini_map
    depth = renderer.draw(state, [look], depth=True)[0].depth
    assert depth is not None
    # rows of level ground farther than 1.5 m
    far = np.flatnonzero([np.median(row) > 1.5 and np.isfinite(row).mean() > 0.9 for row in depth])
    rows = slice(int(far.min()), int(far.max()) + 1)
    assert rows.stop - rows.start > 8
    labels = renderer.draw(state, [part(look, rows, SAMPLES)], labels=True)[0].labels
    assert labels is not None
    shape = rows.stop - rows.start, SAMPLES, look.intrinsics.width, SAMPLES
    is_dash = (labels == Label.SEPARATION_LINE).reshape(shape)
    is_other = ~(is_dash | (labels == Label.ROAD).reshape(shape)).all((1, 3))
    near = np.lib.stride_tricks.sliding_window_view(np.pad(is_other, 2), (5, 5)).any((2, 3))
    is_seen = ~near  # nothing but dashes and road, and no other line beside it

    def paint(scale: int) -> np.ndarray:
        """Light that the strips add."""
        views = [part(look, rows, scale)]
        light, road = (linear(one.draw(state, views)[0].rgba[..., 1].astype(float)) for one in (renderer, bare))
        return light - road

    fine = paint(SAMPLES).reshape(shape)
    area = is_dash.mean((1, 3))[is_seen].sum()
    assert area > 20.0
    found = paint(1)[is_seen].sum()
    assert found == pytest.approx(fine.mean((1, 3))[is_seen].sum(), rel=0.10)
    assert found / np.median(fine[is_dash]) == pytest.approx(area, rel=0.10)


def test_far_rings_of_ducts_have_no_dots(practice: tuple[Renderer, RenderState, View]) -> None:
    """Where rings are one or two pixels wide: no more contrast of pixels than in a render of 64 samples a pixel."""
    renderer, state, look = practice
    image = renderer.draw(state, [look], depth=True)[0]
    assert image.depth is not None
    fine = renderer.draw(state, [part(look, slice(0, look.intrinsics.height), SAMPLES)], labels=True)[0]
    assert fine.labels is not None
    shape = look.intrinsics.height, SAMPLES, look.intrinsics.width, SAMPLES
    is_duct = (fine.labels == Label.WALL).reshape(shape).all((1, 3)) & (image.depth > 3.0) & (image.depth < 9.0)
    # three pixels beside each other
    inside = np.lib.stride_tricks.sliding_window_view(is_duct, (1, 3)).all((2, 3))
    assert inside.sum() > 1000
    mean = linear(fine.rgba[..., 1].astype(float)).reshape(shape).mean((1, 3))
    shown = linear(image.rgba[..., 1].astype(float))
    contrasts = [np.abs(np.diff(light, 2, axis=1))[inside].mean() for light in (shown, mean)]
    assert contrasts[0] < contrasts[1]
    assert shown[is_duct].mean() == pytest.approx(mean[is_duct].mean(), rel=0.03)


def asset(*polygons: shapely.Polygon) -> Asset:
    """Level ground with paint."""
    lines = [line for line in painted_lines(polygons, shapely.box(-50, -50, 50, 50)) if line is not None]
    assert len(lines) == len(polygons)
    return Asset("static", (node("floor", ground(-50, -50, 50, 50), casts=False),), strips=strips(lines))


def amount(world: Asset, look: View) -> np.ndarray:
    """Share of paint of each pixel."""
    shades = []
    now = render_state()
    now.header["air"] = air_of(Weather(clouds=1.0))
    for static in (replace(world, strips=None), world):
        with Renderer(RenderScene(static, [], [], []), "software") as renderer:
            shades.append(linear(renderer.draw(now, [look])[0].rgba[..., 1].astype(float)))
    return (shades[1] - shades[0]) / (shades[1].max() - shades[0].mean())


def test_a_line_of_any_width_has_its_area() -> None:
    """Seen from above, at a slant to the rows of pixels, against the closed form."""
    look = view(0.0, 0.0, 3.0, pitch_deg=90.0, own=pinhole(200, 200, 60.0))
    per_metre = look.intrinsics.fy / 3.0
    mark = shapely.Polygon([(0.9, -0.9), (1.1, -0.9), (1.1, -0.7), (0.9, -0.7)])  # entirely white
    for width in (0.002, 0.01, 0.05):
        c, s = np.cos(0.3), np.sin(0.3)
        corners = np.array([(-0.6, -width / 2), (0.6, -width / 2), (0.6, width / 2), (-0.6, width / 2)])
        line = shapely.Polygon(corners @ np.array([[c, s], [-s, c]]))
        found = amount(asset(line, mark), look).sum() / per_metre**2
        assert found == pytest.approx(1.2 * width + 0.04, rel=0.05), width


def test_depth_and_labels_do_not_see_strips(mini_map: tuple[Renderer, RenderState, View], bare: Renderer) -> None:
    renderer, state, look = mini_map
    images = [one.draw(state, [look], depth=True, labels=True)[0] for one in (renderer, bare)]
    assert images[0].rgba.tobytes() != images[1].rgba.tobytes()
    for name in ("depth", "labels"):
        assert getattr(images[0], name).tobytes() == getattr(images[1], name).tobytes()


def test_paint_that_is_no_line_stays_in_the_mesh() -> None:
    star = shapely.Polygon([(0, 0), (1, 0.2), (2, 0), (1, 2), (0.5, 0.5)])
    assert painted_lines([star], shapely.box(-9, -9, 9, 9)) == [None]


def test_shade_ends_at_its_width() -> None:
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)], float)
    line = shade_along(square, 0.1, 0.5)  # to the left turning: outside is on the right
    assert np.abs(line.right - 0.5).max() == pytest.approx(0.6)
    assert np.abs(line.left - 0.5).max() == pytest.approx(0.5)
    assert line.left_amounts == (0.0, 0.5)
    assert line.right_amounts == (0.0, 0.0)
