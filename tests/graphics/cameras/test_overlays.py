"""Overlays of scene cameras: their pixels against the depth of the image, a pinhole, and the numbers of the World."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import autodrive
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.graphics.cameras.overlays import LOOK, MAX_STROKES, NONE, Marks, Overlays, strokes_of_drawings
from autodrive.graphics.cameras.scene_camera import SceneCamera, check_view
from autodrive.graphics.cameras.viewpoints import drivers_eye
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import rigid
from autodrive.graphics.render.strokes import CHARACTER, LEAST, LINE, Strokes, dots, letters, lines, spread
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.native import SetCamera
from autodrive.world import World
from autodrive.world.contacts import shapes_of
from autodrive.world.views.cameras import scene_rig
from tests.support.scenes import needs_gl

MAGENTA = (1.0, 0.0, 1.0, 1.0)
WIDTH, HEIGHT = 640, 360


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    made = autodrive.make("mini_map", cameras=False)
    made.watch_contacts()
    for _ in range(30):
        made.step()
    yield made
    made.close()


@pytest.fixture(scope="module")
def renderer(world: World) -> Iterator[Renderer]:
    with Renderer(scene_rig(world, "software").scene, "software") as made:
        yield made


def driver(world: World) -> View:
    pose = world.frame.vehicles["V1"].pose
    return drivers_eye(tuple(pose.position.tolist()), tuple(pose.orientation.tolist())).view(WIDTH, HEIGHT)


def marks(world: World) -> Marks:
    return Marks(world.drawings, lambda: shapes_of(world.compiled), world.contact_forces)


def magenta(renderer: Renderer, world: World, strokes: Strokes) -> NDArray[np.bool_]:
    """The pixels that have the colour of nothing else."""
    [image] = renderer.draw(RenderState.of(world.frame), [driver(world)], strokes=strokes)
    return np.abs(image.rgba[..., :3].astype(int) - (255, 0, 255)).max(axis=2) < 60


def on_rays(view: View, columns: Any, rows: Any, depth: float) -> Any:
    """Points of the map that a pinhole shows there, at that depth [m]; shape (n, 3)."""

    k = view.intrinsics
    seen = np.column_stack(((columns - k.cx) / k.fx, (rows - k.cy) / k.fy, np.ones(len(columns)))) * depth
    return seen @ np.reshape(rotation_from_quaternion(view.orientation), (3, 3)).T + view.position


@needs_gl
@pytest.mark.parametrize("depth", [0.6, 1.2, 2.5])
def test_a_point_is_seen_where_a_pinhole_shows_it_unless_something_is_in_front(
    world: World, renderer: Renderer, depth: float
) -> None:
    view = driver(world)
    columns, rows = (axis.ravel() + 0.5 for axis in np.meshgrid(np.arange(12, WIDTH, 24), np.arange(12, HEIGHT, 24)))
    points = dots(on_rays(view, columns, rows, depth), MAGENTA, 0.012 * depth)
    seen = magenta(renderer, world, Strokes(points, NONE))[rows.astype(int), columns.astype(int)]
    [image] = renderer.draw(RenderState.of(world.frame), [view], depth=True)
    assert image.depth is not None
    places = zip(rows.astype(int).tolist(), columns.astype(int).tolist(), strict=True)
    behind = np.array([image.depth[r - 3 : r + 4, c - 3 : c + 4] for r, c in places])
    # a point near a surface, or at an edge, may be either: it is drawn a little nearer than it is
    assert seen[behind.min(axis=(1, 2)) > depth + 0.01].all()
    clearly = behind.max(axis=(1, 2)) < 0.93 * depth - 0.05
    assert clearly.sum() > 20
    assert not seen[clearly].any()
    everything = magenta(renderer, world, Strokes(NONE, points))[rows.astype(int), columns.astype(int)]
    assert everything.all()


@needs_gl
def test_a_line_that_begins_behind_the_camera_ends_where_a_pinhole_shows_its_end(
    world: World, renderer: Renderer
) -> None:
    view = driver(world)
    [end] = on_rays(view, np.array([400.0]), np.array([100.0]), 0.5)
    begin = np.array(view.position) - (end - view.position) + (0.0, 0.0, 0.02)
    rows, columns = np.nonzero(magenta(renderer, world, Strokes(NONE, lines(begin[None], end[None], MAGENTA, 0.01))))
    assert len(rows) > 200
    # its other end leaves the image at an edge
    at_end = np.hypot(columns - 400, rows - 100)
    assert at_end.min() < 2
    assert min(rows.min(), columns.min(), HEIGHT - 1 - rows.max(), WIDTH - 1 - columns.max()) == 0


@needs_gl
def test_a_text_has_its_middle_and_height_where_it_was_asked_for(world: World, renderer: Renderer) -> None:
    view = driver(world)
    [at] = on_rays(view, np.array([320.0]), np.array([120.0]), 1.0)
    size = 40.0 / view.intrinsics.fy
    boxes = []
    for text in ("HH", "HHHHHH", "\u2200\u2200"):
        rows, columns = np.nonzero(magenta(renderer, world, Strokes(NONE, letters(text, at, MAGENTA, size))))
        assert len(rows) > 50, text
        boxes.append((columns.max() - columns.min(), rows.max() - rows.min()))
        # a glyph is not exactly in the middle of its cell
        assert abs(0.5 * (columns.max() + columns.min()) - 320) < 4
        assert abs(0.5 * (rows.max() + rows.min()) - 120) < 6
    assert 1.0 < boxes[1][0] / boxes[0][0] < 4.0
    assert boxes[1][0] - boxes[0][0] == pytest.approx(4 * 20, abs=3)  # a cell is half as wide as it is high
    assert boxes[0][1] < 40


def test_drawings_have_as_many_strokes_as_primitives_until_they_disappear(world: World) -> None:
    world.draw.path([[0, 0], [1, 0], [2, 0]], name="a")
    world.draw.lines([[0, 0], [1, 0], [2, 0], [3, 0]], name="b", lifetime=1.0)
    world.draw.points([[0, 0, 1], [1, 0, 1]], name="c")
    world.draw.text("goal", (0, 0, 1), name="d")
    now = world.frame.time
    all_of = strokes_of_drawings(world.drawings.values(), now)
    assert len(all_of) == 2 + 2 + 2 + 4
    assert all_of["begin"][all_of["shape"][:, 0] == LINE, 0].tolist() == [0, 1, 0, 2]
    assert len(strokes_of_drawings(world.drawings.values(), now + 1.1)) == 2 + 2 + 4
    assert len(strokes_of_drawings(list(world.drawings.values()) * 2000, now)) == MAX_STROKES
    world.draw.clear()


def test_arrows_carry_the_weight_and_boxes_have_twelve_edges(world: World) -> None:
    frame = world.frame
    forces = Overlays().strokes(SetCamera("Orbit", force_scale=5.0), frame, marks(world), 0.0)
    assert forces is not None
    assert len(forces.shown) == 4 * 5
    shafts = forces.shown[::5]
    up = (shafts["begin"] - shafts["end"])[:, 2].sum() / LOOK["arrow"] * 5.0
    mass = float(world.compiled.model.vehicles["mass"][0])
    assert up == pytest.approx(mass * 9.81, rel=0.01)
    shapes = shapes_of(world.compiled)
    kinds = np.concatenate([of.kind for of in shapes.bodies.values()])
    drawn = Overlays().strokes(SetCamera("Orbit", shapes=True), frame, marks(world), 0.0)
    assert drawn is not None
    edges = {6: 12, 2: 3 * LOOK["around"], 5: 2 * LOOK["around"] + LOOK["sides"]}
    assert len(drawn.shown) == sum(edges[int(kind)] for kind in kinds)
    # the lowest points of the level vehicle are those of its wheels
    of = shapes.bodies["V1"]
    lowest = (of.position[:, 2] - of.size[:, 0])[of.kind == 5].min() + frame.vehicles["V1"].pose.position[2]
    own = drawn.shown[: sum(edges[int(kind)] for kind in shapes.bodies["V1"].kind)]
    assert own["begin"][:, 2].min() == pytest.approx(lowest, abs=1e-4)
    assert len(drawn.hidden) % 12 == 0


def test_axes_are_along_the_vehicle_and_each_sensor_has_its_name(world: World) -> None:
    drawn = Overlays().strokes(SetCamera("Orbit", axes=True), world.frame, marks(world), 0.0)
    assert drawn is not None
    pose = world.frame.vehicles["V1"].pose
    yaw = 2.0 * np.arctan2(*pose.orientation[[3, 0]])
    x_axis = (drawn.shown["end"] - drawn.shown["begin"])[0]
    assert x_axis == pytest.approx(np.array([np.cos(yaw), np.sin(yaw), 0.0]) * LOOK["axis"], abs=1e-3)
    sensors = shapes_of(world.compiled).sensors["V1"]
    characters = (drawn.shown["shape"][:, 0] != LINE).sum()
    assert characters == len("V1") + sum(map(len, sensors))


def test_names_of_axes_do_not_cover_each_other_in_any_view(world: World) -> None:
    drawn = Overlays().strokes(SetCamera("Orbit", axes=True), world.frame, marks(world), 0.0)
    assert drawn is not None
    letter = drawn.shown["shape"][:, 0] == CHARACTER
    camera, moved = SceneCamera(world.vehicle_specs), 0
    for elevation, azimuth in itertools.product((0.05, 0.4, 0.8, 1.4), (0.0, 0.3, 1.6, 3.14)):
        look = SetCamera("Orbit", axes=True, distance=0.8, elevation=elevation, azimuth=azimuth)
        eye = camera.viewpoint(look, world.frame, 0.0).view(1280, 720)
        seen_from_map = np.linalg.inv(rigid(eye.position, eye.orientation) @ np.diag([1.0, -1.0, -1.0, 1.0]))
        put = spread(drawn.shown, seen_from_map, 1.0 / eye.intrinsics.fy)
        assert np.array_equal(put[~letter], drawn.shown[~letter])
        x, y, z = (put["begin"][letter] @ seen_from_map[:3, :3].T + seen_from_map[:3, 3]).T
        place, up = put["shape"][letter, 2], put["end"][letter, 1]
        size = np.maximum(put["shape"][letter, 1], LEAST * -z / eye.intrinsics.fy)
        at = np.column_stack(((x + 0.5 * size * place) / -z, (y + size * up) / -z))
        half = np.column_stack((0.25 * size / -z, 0.5 * size / -z))
        gap = np.abs(at[:, None] - at[None]) - (half[:, None] + half[None])
        is_over = np.all(gap < -1e-5, axis=2) & ~np.eye(len(at), dtype=bool)
        assert not is_over.any(), (elevation, azimuth)
        moved += int((up > 0.0).any())
    assert moved > 0


def test_nothing_is_drawn_that_was_not_asked_for(world: World) -> None:
    assert Overlays().strokes(SetCamera("Orbit"), world.frame, marks(world), 0.0) is None
    for scale in (-1.0, np.inf, np.nan):
        with pytest.raises(autodrive.AutodriveError, match="force_scale"):
            check_view(SetCamera("Orbit", force_scale=scale), ["V1"])
