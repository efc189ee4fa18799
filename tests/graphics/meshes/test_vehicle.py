"""The car's mesh against the numbers that it is made from, and against geometry."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from autodrive.base.transforms import compose, rotate
from autodrive.graphics.assets.asset import Asset, AssetNode, Detail
from autodrive.graphics.meshes.vehicle import vehicle_asset
from autodrive.physics.actuators.lights import LAMPS
from autodrive.physics.sensors.camera.camera import OPTICAL
from autodrive.protocol.messages import WHEEL_NAMES
from autodrive.scenario.vehicles.spec import VehicleSpec, load_vehicle

pytestmark = pytest.mark.slow

Floats = NDArray[np.float64]
NIGEL = load_vehicle("nigel")
RACERS = ("roboracer", "roboracer_f1tenth", "neoracer")


@cache
def car(name: str = "nigel") -> Asset:
    return vehicle_asset(load_vehicle(name))


def turn(angle: float, axis: tuple[float, float, float]) -> Floats:
    """Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k


def places(asset: Asset, signals: dict[str, float]) -> dict[str, tuple[Floats, Floats]]:
    """Rotation and position of each node, as the docstrings of AssetNode and Joint say."""
    out: dict[str, tuple[Floats, Floats]] = {"": (np.eye(3), np.zeros(3))}
    for node in asset.nodes:
        rotation, position = out[node.parent]
        own, shift = np.eye(3), np.array(node.position)
        if joint := node.joint:
            value = joint.gain * signals.get(joint.signal, 0.0)
            if joint.kind == "hinge":
                own = turn(value, joint.axis)
            elif joint.kind == "slide":
                shift = shift + value * np.array(joint.axis)
            else:
                shift = shift + turn(value, (0.0, 0.0, 1.0)) @ joint.arm - joint.arm
        out[node.name] = rotation @ own, position + rotation @ shift
    return out


def corners(asset: Asset, detail: Detail, **signals: float) -> dict[str, Floats]:
    """Triangles of each node in the vehicle frame, shape (n, 3, 3)."""
    at = places(asset, signals)
    return {
        node.name: np.concatenate([s.positions[s.triangles] for s in node.surfaces[detail]]) @ at[node.name][0].T
        + at[node.name][1]
        for node in asset.nodes
        if detail in node.surfaces
    }


def node_of(asset: Asset, name: str) -> AssetNode:
    return next(node for node in asset.nodes if node.name == name)


@pytest.mark.parametrize(
    ("names", "full", "reduced"),
    [(("nigel", "nigel_2023"), (35_000, 45_000), (7_000, 9_000)), (RACERS, (25_000, 35_000), (5_000, 8_000))],
)
def test_each_level_of_detail_keeps_its_budget(
    names: tuple[str, ...], full: tuple[int, int], reduced: tuple[int, int]
) -> None:
    limits: dict[Detail, tuple[int, int]] = {"full": full, "reduced": reduced, "shadow": (100, 1_000)}
    for name in names:
        for detail, (least, most) in limits.items():
            assert least <= car(name).triangle_count(detail) <= most, (name, detail)


@pytest.mark.parametrize("detail", ["full", "reduced"])
def test_the_car_is_as_large_as_its_spec_says(detail: Detail) -> None:
    parts = corners(car(), detail)
    lidar = parts.pop("lidar_head")  # its scan plane is above the height of table 1
    points = np.concatenate([part.reshape(-1, 3) for part in parts.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    assert high[0] - low[0] == pytest.approx(NIGEL.size[0], abs=0.001)
    assert high[1] - low[1] == pytest.approx(NIGEL.size[1], abs=0.001)
    assert low[2] == pytest.approx(-NIGEL.wheels.radius, abs=0.0006)
    assert high[2] - low[2] < NIGEL.size[2] + 0.015
    mount = NIGEL.sensors.lidar.mount.position  # type: ignore[union-attr]
    assert lidar[..., 2].min() < mount[2] < lidar[..., 2].max()
    assert lidar[..., 0].min() == pytest.approx(mount[0] - 0.035, abs=0.001)  # RPLIDAR A1: 70 mm across
    assert np.ptp(lidar[..., 1]) == pytest.approx(0.070, abs=0.001)


@pytest.mark.parametrize("detail", ["full", "reduced", "shadow"])
@pytest.mark.parametrize("name", ["nigel", *RACERS])
def test_wheels_have_the_radius_width_and_place_of_the_spec(name: str, detail: Detail) -> None:
    spec = load_vehicle(name)
    for wheel, hub in zip(WHEEL_NAMES, spec.hubs, strict=True):
        points = corners(car(name), detail)[f"wheel_{wheel}"].reshape(-1, 3) - hub
        assert np.hypot(points[:, 0], points[:, 2]).max() == pytest.approx(spec.wheels.radius, abs=0.001)
        assert np.ptp(points[:, 1]) == pytest.approx(spec.wheels.width, abs=0.001)
        assert points[:, 1].max() + points[:, 1].min() == pytest.approx(0.0, abs=0.001)


@pytest.mark.parametrize("name", ["nigel", *RACERS])
def test_wheels_go_up_when_compressed_and_forward_when_they_roll(name: str) -> None:
    at = places(car(name), {"compression_rear_left": 0.004, "spin_rear_left": 0.1, "steering_front_left": 0.3})
    rotation, position = at["wheel_rear_left"]
    assert position == pytest.approx(np.add(load_vehicle(name).hubs[2], (0.0, 0.0, 0.004)))
    assert (rotation @ (0.0, 0.0, 1.0))[0] == pytest.approx(math.sin(0.1))  # the top goes ahead
    assert (at["wheel_front_left"][0] @ (1.0, 0.0, 0.0))[1] == pytest.approx(math.sin(0.3))  # to the left


@pytest.mark.parametrize("lamp", LAMPS)
def test_every_lamp_glows_at_its_place(lamp: str) -> None:
    node = node_of(car(), f"lamp_{lamp}")
    name, side = lamp.rsplit("_", 1)
    own = getattr(NIGEL.lights, name)
    x, y, z = own.position
    assert node.lamp == lamp
    assert node.position == (x, y if side == "left" else -y, z)
    material = node.surfaces["full"][0].material
    assert np.argmax(material.emission) == np.argmax(own.color)
    assert 4.0 <= max(material.emission) <= 6.0
    assert max(material.color) > 0.1  # seen when it is not lit


@pytest.mark.parametrize("detail", ["full", "reduced"])
@pytest.mark.parametrize("camera", ["front", "rear"])
@pytest.mark.parametrize("steering", [-30.0, 30.0])
def test_a_camera_sees_nothing_of_its_own_car(camera: str, detail: Detail, steering: float) -> None:
    spec = NIGEL.cameras[camera]
    angle = math.radians(steering)
    lock = {"steering": angle, "steering_front_left": angle, "steering_front_right": angle}
    triangles = np.concatenate(list(corners(car(), detail, **lock).values()))
    a, b, c = np.moveaxis(triangles - np.array(spec.mount.position), 1, 0)
    normal = np.cross(b - a, c - a)
    k, pose = spec.intrinsics, compose(spec.mount.orientation, OPTICAL)
    for u in np.linspace(0.0, k.width, 9):
        for v in np.linspace(0.0, k.height, 7):
            ray = np.array(rotate(pose, ((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0)))
            # the ray goes through a triangle where it passes all of its edges on the same side
            sides = np.stack([np.cross(p, q) @ ray for p, q in ((a, b), (b, c), (c, a))])
            passes = (sides > 0.0).all(axis=0) | (sides < 0.0).all(axis=0)
            depth = np.einsum("ij,ij->i", normal, a)[passes] / (normal[passes] @ ray)
            assert not (depth > spec.near).any(), (u, v, depth)


@pytest.mark.parametrize("wheelbase", [0.12, 0.14154, 0.2])
@pytest.mark.parametrize("degrees", [-30.0, -21.0, -9.0, 0.0, 15.0, 27.0, 30.0])
def test_the_ends_of_the_steering_rods_stay_together(degrees: float, wheelbase: float) -> None:
    spec = NIGEL.model_copy(update={"wheelbase": wheelbase})
    still = steering_of(wheelbase)
    mean = math.radians(degrees)
    turns = {  # both wheels turn about one point of the rear axle's line
        way: math.atan2(math.tan(mean) * wheelbase, wheelbase - way * 0.5 * spec.track * math.tan(mean))
        for way in (1.0, -1.0)
    }
    signals = {"steering": mean, "steering_front_left": turns[1.0], "steering_front_right": turns[-1.0]}
    rest, at = places(still, {}), places(still, signals)

    def moved(name: str, point: Floats) -> Floats:
        """Where a point of that node, given where it is at rest, has got to."""
        rotation, position = at[name]
        return rotation @ (point - rest[name][1]) + position

    middle = rest["drag_link"][1]
    for side in ("left", "right"):
        outer = rest[f"tie_rod_{side}_end"][1]
        assert moved(f"tie_rod_{side}", outer) == pytest.approx(moved(f"steer_front_{side}", outer), abs=1e-9)
        assert np.hypot(*(moved(f"tie_rod_{side}", middle) - moved("drag_link", middle))[:2]) < 0.001
    arm = node_of(still, "drag_link").joint.arm  # type: ignore[union-attr]
    end = rest["servo_horn"][1] + arm
    assert moved("servo_horn", end)[:2] == pytest.approx(moved("drag_link", end)[:2], abs=1e-9)


@cache
def steering_of(wheelbase: float) -> Asset:
    """What moves of a car with that wheelbase, without what it looks like."""
    spec: VehicleSpec = NIGEL.model_copy(update={"wheelbase": wheelbase})
    asset = car() if spec == NIGEL else vehicle_asset(spec)
    return Asset("steering", tuple(AssetNode(n.name, n.parent, n.position, joint=n.joint) for n in asset.nodes))


@pytest.mark.parametrize("name", ["nigel", *RACERS])
@pytest.mark.parametrize("steering", [-1.0, 0.0, 1.0])
def test_no_part_of_the_body_is_in_a_wheel(name: str, steering: float) -> None:
    spec = load_vehicle(name)
    tangent = math.tan(steering * spec.steering.limit)
    angles = {
        f"steering_front_{side}": math.atan2(tangent, 1.0 - way * 0.5 * spec.track * tangent / spec.wheelbase)
        for side, way in (("left", 1.0), ("right", -1.0))
    }
    body = corners(car(name), "full")["body"]
    # more points of each edge, so that long triangles do not slip through
    t = np.linspace(0.0, 1.0, 9)[:, None, None, None]
    points = ((1.0 - t) * body + t * np.roll(body, 1, axis=1)).reshape(-1, 3)
    inner = 0.7 if name in RACERS else 0.0  # arms and shafts of a racer end inside the rim
    for wheel in WHEEL_NAMES if name in RACERS else WHEEL_NAMES[:2]:
        rotation, position = places(car(name), angles)[f"wheel_{wheel}"]
        own = (points - position) @ rotation
        distance = np.hypot(own[:, 0], own[:, 2]) / spec.wheels.radius
        is_in = (distance >= inner) & (distance < 1.0) & (np.abs(own[:, 1]) < 0.5 * spec.wheels.width)
        assert not is_in.any(), points[is_in][:5]


def test_another_spec_makes_another_car() -> None:
    sensors = NIGEL.sensors.model_copy(update={"lidar": None})
    lights = NIGEL.lights.model_copy(
        update={"tail": NIGEL.lights.tail.model_copy(update={"position": (-0.055, 0.03, 0.012)})}
    )
    changes = {"wheelbase": 0.16, "cameras": {}, "sensors": sensors, "lights": lights}
    other = vehicle_asset(NIGEL.model_copy(update=changes))
    assert {node.name for node in car().nodes} - {node.name for node in other.nodes} == {"lidar_head"}
    assert node_of(other, "hub_front_left").position == (0.16, 0.0765, 0.0)
    assert node_of(other, "lamp_tail_right").position == (-0.055, -0.03, 0.012)
    assert corners(other, "full")["body"][..., 2].max() < NIGEL.cameras["front"].mount.position[2] + 0.006


def test_every_closed_part_has_its_faces_outward() -> None:
    for detail in ("full", "reduced", "shadow"):
        for name, triangles in corners(car(), detail).items():
            points, index = np.unique(np.round(triangles.reshape(-1, 3), 7), axis=0, return_inverse=True)
            faces = index.reshape(-1, 3)
            part = np.arange(len(points))
            while True:  # the least number among its neighbours, until nothing changes: connected parts
                least = part[faces].min(axis=1)
                new = part.copy()
                for k in range(3):
                    np.minimum.at(new, faces[:, k], least)
                new = new[new]
                if (new == part).all():
                    break
                part = new
            a, b, c = np.moveaxis(triangles - triangles.mean(axis=(0, 1)), 1, 0)
            volumes = np.bincount(part[faces[:, 0]], np.einsum("ij,ij->i", a, np.cross(b, c)))
            assert (volumes[np.unique(part[faces])] > 0.0).all(), (name, detail)
            for node in car().nodes:
                if node.name == name:
                    lengths = np.concatenate([np.linalg.norm(s.normals, axis=1) for s in node.surfaces[detail]])
                    assert lengths == pytest.approx(1.0, abs=1e-4)
