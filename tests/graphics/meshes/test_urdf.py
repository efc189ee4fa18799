"""The robot description against the Spec, the Asset, a table of the original, and readers of URDF that others wrote."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of MuJoCo have no types)

from __future__ import annotations

import io
import math
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
import trimesh
import yaml
from numpy.typing import NDArray
from typer.testing import CliRunner

from autodrive.cli.app import app
from autodrive.graphics.assets.asset import Asset
from autodrive.graphics.assets.glb import write_glb
from autodrive.graphics.meshes.store import description
from autodrive.graphics.meshes.urdf import srgb, vehicle_urdf
from autodrive.graphics.meshes.vehicle import vehicle_asset
from autodrive.scenario.kinds import names
from autodrive.scenario.vehicles.spec import VehicleSpec, load_vehicle

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
COMMITTED = ROOT / "ros" / "autodrive_description"
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])
"""Of a binary STL file."""
Matrix = NDArray[np.float64]

ORIGINAL = {
    "lidar": (0.1445, 0.0, 0.17525),
    "front_camera": (0.1860, 0.0, 0.11215),
    "rear_camera": (-0.0260, 0.0, 0.11215),
    "imu": (0.0398, 0.0014, 0.0825),
    "front_left_wheel": (0.1415, 0.0765, 0.0),
    "front_right_wheel": (0.1415, -0.0765, 0.0),
    "rear_left_wheel": (0.0, 0.0765, 0.0),
    "rear_right_wheel": (0.0, -0.0765, 0.0),
}
"""Places in the scene of the original simulator, from the centre of the rear axle [m], rounded to 0.1 mm."""


@pytest.fixture(scope="module")
def spec() -> VehicleSpec:
    return load_vehicle("nigel")


@pytest.fixture(scope="module")
def asset(spec: VehicleSpec) -> Asset:
    return vehicle_asset(spec)


@pytest.fixture(scope="module")
def described(spec: VehicleSpec, asset: Asset) -> tuple[str, dict[str, bytes]]:
    return vehicle_urdf(spec, "nigel", asset)


@pytest.fixture(scope="module")
def text(described: tuple[str, dict[str, bytes]]) -> str:
    return described[0]


@pytest.fixture(scope="module")
def robot(text: str) -> ElementTree.Element:
    return ElementTree.fromstring(text)


def numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def placed(element: ElementTree.Element | None) -> Matrix:
    """Of an <origin>, by trimesh's Euler angles."""
    if element is None:
        return np.eye(4)
    roll, pitch, yaw = numbers(element.attrib["rpy"])
    pose = trimesh.transformations.euler_matrix(roll, pitch, yaw, "sxyz")
    pose[:3, 3] = numbers(element.attrib["xyz"])
    return pose


def read(text: str, **angles: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """As MuJoCo's own reader of URDF has it, at those joint angles [rad]; base_link is its world."""
    options = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco></robot>'
    model = mujoco.MjModel.from_xml_string(text.replace("</robot>", options))
    data = mujoco.MjData(model)
    for joint, angle in angles.items():
        data.joint(joint).qpos = angle
    mujoco.mj_forward(model, data)
    return model, data


def poses(text: str, **angles: float) -> dict[str, Matrix]:
    """Of every link in base_link, at those joint angles [rad]."""
    model, data = read(text, **angles)
    found = {}
    for number in range(1, model.nbody):
        found[model.body(number).name] = pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[number].reshape(3, 3), data.xpos[number]
    return found


@pytest.mark.toolchain
def test_the_parser_of_ros_accepts_it(text: str, tmp_path: Path) -> None:
    check = shutil.which("check_urdf")
    if check is None:
        pytest.skip("check_urdf is missing. Install it: sudo apt-get install liburdfdom-tools")
    file = tmp_path / "nigel.urdf"
    file.write_text(text)
    done = subprocess.run([check, file], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "root Link: base_link has 11 child(ren)" in done.stdout
    assert not done.stderr


def test_frames_are_at_the_places_of_the_spec_and_the_original(text: str, spec: VehicleSpec) -> None:
    found = poses(text)
    for name, place in ORIGINAL.items():
        assert found[name][:3, 3] == pytest.approx(place, abs=0.5e-4), name
    lidar = spec.sensors.lidar
    assert lidar is not None
    mounts = {"lidar": lidar.mount, "imu": spec.sensors.imu.mount, "ips": spec.sensors.ips.mount}
    mounts |= {f"{name}_camera": camera.mount for name, camera in spec.cameras.items()}
    for name, mount in mounts.items():
        wanted = trimesh.transformations.quaternion_matrix(mount.orientation)
        wanted[:3, 3] = mount.position
        assert np.allclose(found[name], wanted, atol=1e-9), name
    for side, hub in zip(("left", "right"), spec.hubs[2:], strict=True):
        assert found[f"{side}_encoder"][:3, 3] == pytest.approx(hub)


@pytest.mark.parametrize(("camera", "ahead"), [("front", 1.0), ("rear", -1.0)])
def test_optical_frames_look_along_z_with_x_to_the_right_and_y_down(text: str, camera: str, ahead: float) -> None:
    x, y, z = poses(text)[f"{camera}_camera_optical_frame"][:3, :3].T
    down = math.radians(7.294)  # both cameras look down by that angle
    assert z == pytest.approx((ahead * math.cos(down), 0.0, -math.sin(down)), abs=1e-9)
    assert x == pytest.approx((0.0, -ahead, 0.0), abs=1e-9)
    assert y == pytest.approx(np.cross(z, x), abs=1e-9)


def test_wheels_steer_to_the_left_and_roll_forward(robot: ElementTree.Element, text: str, spec: VehicleSpec) -> None:
    found = poses(text, front_left_steering_joint=0.3, front_left_wheel_joint=0.1, rear_right_wheel_joint=0.1)
    axle = found["front_left_wheel"][:3, 1]
    assert axle == pytest.approx((-math.sin(0.3), math.cos(0.3), 0.0))
    top = found["rear_right_wheel"] @ (0.0, 0.0, spec.wheels.radius, 1.0)
    assert top[0] == pytest.approx(spec.wheels.radius * math.sin(0.1))
    limit = robot.find("joint[@name='front_left_steering_joint']/limit")
    assert limit is not None
    turning_radius = spec.wheelbase / math.tan(spec.steering.limit)
    inner = math.atan(spec.wheelbase / (turning_radius - spec.track / 2))  # both wheels about one centre
    assert (float(limit.attrib["lower"]), float(limit.attrib["upper"])) == pytest.approx((-inner, inner))


def test_links_together_weigh_and_turn_as_the_body_of_the_spec(text: str, spec: VehicleSpec) -> None:
    model, data = read(text)
    center = model.body_mass @ data.xipos / spec.body.mass
    about_center = np.zeros((3, 3))
    for mass, moments, place, axes in zip(model.body_mass, model.body_inertia, data.xipos, data.ximat, strict=True):
        turn, offset = axes.reshape(3, 3), place - center
        about_center += turn @ np.diag(moments) @ turn.T + mass * (
            offset @ offset * np.eye(3) - np.outer(offset, offset)
        )
    assert model.body_mass.sum() == pytest.approx(spec.body.mass)
    assert center == pytest.approx(spec.body.center_of_mass, abs=1e-9)
    assert about_center == pytest.approx(np.diag(spec.body.inertia), abs=1e-9)


def test_meshes_are_those_of_the_simulator(
    robot: ElementTree.Element, text: str, described: tuple[str, dict[str, bytes]], asset: Asset
) -> None:
    glb = trimesh.load_scene(io.BytesIO(write_glb(asset, ("full",))), file_type="glb")
    glb.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 2, (1.0, 0.0, 0.0)))  # of glTF y is up
    scene = trimesh.Scene()
    found = poses(text)
    for link in robot.iterfind("link"):
        for visual in link.iterfind("visual"):
            path = visual.find("geometry/mesh").attrib["filename"]  # type: ignore[union-attr]
            content = described[1][path.removeprefix("package://autodrive_description/")]
            mesh = trimesh.load_mesh(io.BytesIO(content), file_type="stl")
            scene.add_geometry(mesh, transform=found[link.attrib["name"]] @ placed(visual.find("origin")))
    assert scene.bounds == pytest.approx(glb.bounds, abs=1e-6)
    assert scene.area == pytest.approx(glb.area, rel=1e-3)
    assert scene.centroid == pytest.approx(glb.centroid, abs=1e-4)


def test_every_mesh_is_used(robot: ElementTree.Element, described: tuple[str, dict[str, bytes]]) -> None:
    used = {mesh.attrib["filename"] for mesh in robot.iterfind("link/visual/geometry/mesh")}
    assert used == {f"package://autodrive_description/{path}" for path in described[1]}


def test_materials_are_those_of_the_simulator_in_srgb(robot: ElementTree.Element, asset: Asset) -> None:
    assert [srgb(value) for value in (0.0, 0.0021, 0.2140, 1.0)] == pytest.approx([0.0, 0.0271, 0.5, 1.0], abs=1e-3)
    surfaces = [one for node in asset.nodes for one in node.surfaces.get("full", ())]
    colors = {one.material.name: [*map(srgb, one.material.color), 1.0] for one in surfaces}
    printed = {one.attrib["name"]: one.find("color").attrib["rgba"] for one in robot.iterfind("material")}  # type: ignore[union-attr]
    assert printed.keys() == colors.keys()
    for name, text in printed.items():
        assert numbers(text) == pytest.approx(colors[name], abs=1e-4), name
    assert {one.attrib["name"] for one in robot.iterfind("link/visual/material")} == colors.keys()


def test_colliders_are_those_of_the_spec(robot: ElementTree.Element, spec: VehicleSpec) -> None:
    boxes = [
        [numbers(one.find(path).attrib[name]) for path, name in (("origin", "xyz"), ("geometry/box", "size"))]  # type: ignore[union-attr]
        for one in robot.findall("link[@name='base_link']/collision")
    ]
    colliders = (*spec.platforms, spec.lidar_collider)
    assert boxes == [[list(one.position), list(one.size)] for one in colliders]
    for link in robot.iterfind("link"):
        if link.attrib["name"].endswith("_wheel"):
            cylinder = link.find("collision/geometry/cylinder")
            assert cylinder is not None
            assert float(cylinder.attrib["radius"]) == spec.wheels.radius
            assert float(cylinder.attrib["length"]) == spec.wheels.width
            assert placed(link.find("collision/origin"))[:3, 2] == pytest.approx((0.0, -1.0, 0.0), abs=1e-9)


def test_the_package_contains_the_generated_files_and_is_small() -> None:
    described = [description(load_vehicle(name), name) for name in names("vehicle")]
    files = {path: content for one in described for path, content in one.items()}
    remedy = "it is out of date: run scripts/generate-description"
    folders = (COMMITTED / "urdf", COMMITTED / "meshes")
    kept = {str(one.relative_to(COMMITTED)): one for folder in folders for one in folder.rglob("*") if one.is_file()}
    kept = {path: one.read_bytes() for path, one in kept.items()}
    assert kept.keys() == files.keys(), remedy
    assert sum(map(len, kept.values())) < 1.5e6 * len(list((COMMITTED / "urdf").iterdir()))
    for path, content in files.items():
        if path.endswith(".urdf"):
            assert kept[path] == content, f"{path}: {remedy}"
            continue
        (ours, theirs) = (np.frombuffer(data[84:], FACET) for data in (content, kept[path]))
        assert len(ours) == len(theirs), remedy
        assert np.allclose(ours["corners"], theirs["corners"], atol=1e-6), f"{path}: {remedy}"


def test_the_command_line_writes_the_package_of_a_custom_car(spec: VehicleSpec, tmp_path: Path) -> None:
    file = tmp_path / "wide.yaml"
    file.write_text(yaml.safe_dump(spec.model_dump(mode="json", exclude_none=True) | {"track": 0.2}))
    done = CliRunner().invoke(app, ["urdf", str(file), "--output", str(tmp_path / "package")])
    assert done.exit_code == 0, done.output
    text = (tmp_path / "package" / "urdf" / "wide.urdf").read_text()
    robot = ElementTree.fromstring(text)
    assert robot.attrib["name"] == "wide"
    assert poses(text)["rear_left_wheel"][1, 3] == 0.1
    for mesh in robot.iterfind("link/visual/geometry/mesh"):
        name = mesh.attrib["filename"].removeprefix("package://autodrive_description/")
        assert (tmp_path / "package" / name).is_file()
