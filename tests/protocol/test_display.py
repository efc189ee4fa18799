"""Messages and worlds at a prompt and in a notebook: short texts with the most important values."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest

import autodrive
from autodrive.base.png import decode_png
from autodrive.protocol.messages import CameraIntrinsics, Images

LINE = 300
"""Largest length of a text [characters]."""


@pytest.fixture(scope="module")
def world() -> autodrive.World:
    world = autodrive.make("mini_map")
    for _ in range(100):
        world.step({"V1": autodrive.Command(throttle=0.5, steering=0.2)})
    return world


def image() -> autodrive.CameraImage:
    pixels = np.full((48, 64, 4), 200, np.uint8)
    return autodrive.CameraImage(
        0.5,
        autodrive.Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])),
        CameraIntrinsics(64, 48, 60, 60, 32, 24),
        pixels,
    )


def test_a_world_is_one_line_with_map_time_and_vehicles(world: autodrive.World) -> None:
    assert repr(world) == "<World of map 'mini_map' at 1 s: vehicles V1; 8 objects; no cameras>"


def test_a_frame_is_one_line_with_the_motion_of_each_vehicle(world: autodrive.World) -> None:
    vehicle = world.frame.vehicles["V1"]
    x, y, _ = vehicle.pose.position
    text = repr(world.frame)
    assert f"V1 at ({x:.2f}, {y:.2f}) m, yaw {vehicle.imu.euler[2]:.2f} rad, speed {vehicle.speed:.2f} m/s" in text
    assert "\n" not in text
    assert len(text) < LINE
    assert "steering 0.10" in repr(vehicle)
    assert len(repr(vehicle)) < LINE


@pytest.mark.parametrize("reading", ["pose", "encoders", "ips", "imu", "lidar", "lights"])
def test_a_reading_is_one_line_with_the_names_of_its_fields(world: autodrive.World, reading: str) -> None:
    value = getattr(world.frame.vehicles["V1"], reading)
    text = repr(value)
    assert all(f"{field}=" in text for field in value.__struct_fields__)
    assert "\n" not in text
    assert len(text) < LINE


def test_a_scan_shows_how_many_rays_it_has_and_their_range(world: autodrive.World) -> None:
    scan = world.frame.vehicles["V1"].lidar
    assert scan is not None
    finite = scan.ranges[np.isfinite(scan.ranges)]
    assert f"ranges=<360 values from {finite.min():.4g} to {finite.max():.4g}>" in repr(scan)


def test_an_image_shows_its_size_and_not_its_pixels() -> None:
    assert "rgba=<uint8, shape (48, 64, 4)>" in repr(image())
    assert np.array_equal(decode_png(image()._repr_png_()), image().rgb)
    assert image()._repr_html_() is None  # else a notebook would show a table instead of the image


def test_the_drawing_of_a_world_has_its_vehicles_and_objects_where_they_are(world: autodrive.World) -> None:
    svg, _, rest = world._repr_html_().partition("</svg>")
    x, y, _ = world.frame.vehicles["V1"].pose.position
    drawing = ElementTree.fromstring(f"{svg}</svg>")
    (car,) = (one for one in drawing.iter() if one.get("class") == "start")
    assert f"{x:.4f} {y:.4f}" in (car.get("transform") or "").replace(",", " ")
    assert len([one for one in drawing.iter() if one.get("class") == "box"]) == len(world.frame.objects)
    assert f"<td>{x:.2f}</td><td>{y:.2f}</td>" in rest


def test_the_drawing_of_a_scan_has_a_point_for_each_ray_that_hit(world: autodrive.World) -> None:
    scan = world.frame.vehicles["V1"].lidar
    assert scan is not None
    drawing = ElementTree.fromstring(scan._repr_html_())
    _, *points = (one for one in drawing.iter() if one.tag.endswith("circle"))
    assert len(points) == np.isfinite(scan.ranges).sum()
    ranges = [math.hypot(float(one.attrib["cx"]), float(one.attrib["cy"])) for one in points]
    assert ranges == pytest.approx(scan.ranges[np.isfinite(scan.ranges)], abs=1.5e-3)  # written in millimetres


# -- cameras without images -------------------------------------------------------------------------------------


def test_an_image_without_cameras_says_how_to_switch_them_on(world: autodrive.World) -> None:
    cameras = world.frame.vehicles["V1"].cameras
    with pytest.raises(KeyError, match=r"the cameras are off.*make\(\.\.\., cameras=True\)") as caught:
        _ = cameras["front"]
    assert str(caught.value).startswith("there is no image of camera 'front'")
    assert cameras.get("front") is None
    assert "front" not in cameras


def test_an_unknown_camera_is_an_error_that_names_the_others() -> None:
    with pytest.raises(autodrive.NoImageError, match="no image of camera 'left'; there are images of front, rear"):
        _ = Images(front=image(), rear=image())["left"]
