"""Where the scene camera of a client is, compared with the viewpoints and closed forms."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from autodrive.base.errors import AutodriveError
from autodrive.base.transforms import rotate
from autodrive.graphics.cameras.scene_camera import SceneCamera, check_view, image_size
from autodrive.graphics.cameras.viewpoints import GOD_POSITION, GOD_TURN_TIME, Viewpoint, birds_eye, drivers_eye
from autodrive.protocol.native import SetCamera
from autodrive.world import World

GOD = SetCamera("God's Eye")


def pose(world: World, name: str) -> tuple[Any, Any]:
    of = world.frame.vehicles[name].pose
    return tuple(of.position.tolist()), tuple(of.orientation.tolist())


def pan(viewpoint: Viewpoint) -> float:
    """Direction of the optical axis in the map [rad]."""
    x, y, _ = rotate(viewpoint.orientation, (0.0, 0.0, 1.0))
    return math.atan2(y, x)


def bearing(world: World, name: str) -> float:
    x, y, _ = np.subtract(pose(world, name)[0], GOD_POSITION)
    return math.atan2(y, x)


def test_it_follows_the_requested_vehicle_or_the_first(world: World) -> None:
    camera = SceneCamera(world.vehicle_specs)
    frame = world.frame
    first, second = frame.vehicles
    assert camera.viewpoint(SetCamera("Driver's Eye"), frame, 0.0) == drivers_eye(*pose(world, first))
    assert camera.viewpoint(SetCamera("Driver's Eye", second), frame, 0.0) == drivers_eye(*pose(world, second))
    assert camera.viewpoint(SetCamera("Bird's Eye", height=2.0), frame, 0.0) == birds_eye(pose(world, first)[0], 2.0)
    assert camera.viewpoint(SetCamera("Bird's Eye", height=99.0), frame, 0.0).position[2] == 5.0


def test_the_orbit_looks_at_the_middle_of_the_car_from_the_requested_distance_and_direction(world: World) -> None:
    name = next(iter(world.frame.vehicles))
    world.teleport(name, 0.3, -0.2, 1.0)
    view = SetCamera("Orbit", azimuth=0.7, elevation=0.4, distance=2.0)
    viewpoint = SceneCamera(world.vehicle_specs).viewpoint(view, world.frame, 0.0)
    x, y, z = viewpoint.position - np.add(pose(world, name)[0], rotate(pose(world, name)[1], (0.07, 0.0, 0.05)))
    assert math.atan2(y, x) == pytest.approx(0.7)
    assert math.atan2(z, math.hypot(x, y)) == pytest.approx(0.4)
    assert math.hypot(x, y, z) == pytest.approx(2.0)
    axis = rotate(viewpoint.orientation, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(np.multiply(axis, -2.0), (x, y, z), atol=1e-9)


def test_the_zoom_multiplies_the_size_of_things_in_the_image(world: World) -> None:
    camera = SceneCamera(world.vehicle_specs)
    near, far = (
        camera.viewpoint(SetCamera("Driver's Eye", zoom=zoom), world.frame, 0.0).view(640, 360).intrinsics
        for zoom in (2.0, 1.0)
    )
    assert near.fx == pytest.approx(2.0 * far.fx)


def test_gods_eye_turns_by_63_percent_in_its_time_constant(world: World) -> None:
    name = next(iter(world.frame.vehicles))
    camera = SceneCamera(world.vehicle_specs)
    world.teleport(name, 1.0, 0.3, 0.0)
    before = bearing(world, name)
    assert pan(camera.viewpoint(GOD, world.frame, 10.0)) == pytest.approx(before)
    world.teleport(name, 0.6, 0.9, 0.0)
    after = bearing(world, name)
    expected = after + (before - after) / math.e
    assert pan(camera.viewpoint(GOD, world.frame, 10.0 + GOD_TURN_TIME)) == pytest.approx(expected)
    assert pan(camera.viewpoint(GOD, world.frame, 20.0)) == pytest.approx(after)


def test_gods_eye_jumps_to_another_vehicle_after_a_reset_and_after_another_camera(world: World) -> None:
    first, second = world.frame.vehicles
    camera = SceneCamera(world.vehicle_specs)
    world.step()

    def looks_at(name: str, view: SetCamera) -> bool:
        return pan(camera.viewpoint(view, world.frame, 0.0)) == pytest.approx(bearing(world, name))

    camera.viewpoint(GOD, world.frame, 0.0)
    assert looks_at(second, SetCamera("God's Eye", second))
    world.reset()
    world.teleport(second, 0.9, 0.9, 0.0)
    assert looks_at(second, SetCamera("God's Eye", second))
    camera.viewpoint(SetCamera("Bird's Eye"), world.frame, 0.0)
    world.teleport(first, -0.9, 0.9, 0.0)
    assert looks_at(first, GOD)


def test_fly_is_where_it_is_told_and_looks_along_azimuth_and_elevation(world: World) -> None:
    view = SetCamera("Fly", position=(1.0, -2.0, 3.0), azimuth=0.7, elevation=0.4)
    viewpoint = SceneCamera(world.vehicle_specs).viewpoint(view, world.frame, 0.0)
    assert viewpoint.position == (1.0, -2.0, 3.0)
    level = math.cos(0.4)
    axis = rotate(viewpoint.orientation, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(axis, (level * math.cos(0.7), level * math.sin(0.7), math.sin(0.4)), atol=1e-12)
    assert rotate(viewpoint.orientation, (1.0, 0.0, 0.0))[2] == pytest.approx(0.0, abs=1e-12)  # it does not roll
    check_view(view, [])  # it follows no vehicle


@pytest.mark.parametrize(
    ("view", "vehicles", "expected"),
    [
        (SetCamera("Gods Eye"), ["V1"], "Did you mean 'God's Eye'?"),
        (SetCamera(None), ["V1"], "not known"),
        (SetCamera("Orbit", "V9"), ["V1", "V2"], "Known: V1, V2"),
        (SetCamera("Orbit", distance=math.nan), ["V1"], "distance"),
        (SetCamera("Bird's Eye", height=math.inf), ["V1"], "height"),
        (SetCamera("Fly", position=(0.0, math.nan, 0.0)), ["V1"], "position of a scene camera must be finite"),
        (SetCamera("Orbit", zoom=0.0), ["V1"], "zoom of a scene camera must be 0.1 to 20, not 0.0"),
        (GOD, [], "has no vehicle"),
    ],
)
def test_an_invalid_view_is_refused_with_what_is_known(view: SetCamera, vehicles: list[str], expected: str) -> None:
    with pytest.raises(AutodriveError, match=re.escape(expected)):
        check_view(view, vehicles)


def test_images_have_few_sizes_all_16_to_9() -> None:
    sizes = {image_size(width) for width in range(-10, 5000)}
    assert len(sizes) == 12
    assert all(9 * width == 16 * height for width, height in sizes)
    assert min(sizes) == (160, 90)
    assert max(sizes) == (1920, 1080)
    assert image_size(960) == (960, 540)
    assert image_size(1280) == (1280, 720)
