"""Instance numbers: each pixel of an object has the number of that object, and of no other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import ScenarioSpec
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.graphics.meshes.instances import CLASSES
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.sensors.camera import project
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import CameraImage
from autodrive.world import World
from autodrive.world.factory import compile_scenario
from tests.support.cars import car_file, small_images

KINDS = {
    Label.VEHICLE: "vehicle",
    Label.BOX: "box",
    Label.BLOCK: "building",
    Label.SIGN: "sign",
    Label.TRAFFIC_LIGHT: "traffic_light",
}
"""The ends of the classes of the objects with that label; other labels are no objects."""


@pytest.fixture(scope="module")
def town(gl: str, tmp_path_factory: pytest.TempPathFactory) -> ScenarioSpec:
    """A car behind another one and two equal boxes, before a crossing with signs, lights and buildings."""
    extras = {f"cameras.front.{layer}": True for layer in ("labels", "instances")}
    car = car_file(tmp_path_factory.mktemp("car"), small_images(320, 240) | extras)
    places = {"V1": {"type": car, "x": -1.5, "y": -0.15}, "V2": {"type": car, "x": -0.6, "y": -0.25}}
    boxes = {"near": {"x": -0.7, "y": 0.0}, "far": {"x": -0.5, "y": 0.2}}
    return ScenarioSpec.model_validate({"map": "tiny_town", "vehicles": places, "boxes": boxes})


@pytest.fixture(scope="module")
def shared_world(town: ScenarioSpec) -> World:
    return autodrive.make(town, cameras="small")


def front(world: World) -> CameraImage:
    return world.frame.vehicles["V1"].cameras["front"]


def number(world: World, name: str) -> int:
    return [instance.name for instance in world.instances].index(name) + 1


def test_each_label_of_an_object_has_instances_of_its_class_and_other_labels_have_none(shared_world: World) -> None:
    image, instances = front(shared_world), shared_world.instances
    assert image.instances is not None
    assert image.labels is not None
    assert (image.instances.dtype, image.instances.shape) == (np.uint16, (240, 320))
    pairs = {(label, number) for label, number in zip(image.labels.ravel(), image.instances.ravel(), strict=True)}
    for label, instance in pairs:
        kind = KINDS.get(Label(label))
        assert (instance > 0) == (kind is not None)
        assert kind is None or instances[instance - 1].kind.endswith(kind)
    assert {label for label, _ in pairs} >= {*KINDS} - {Label.SIGN}
    assert {instance.kind for instance in instances} <= {*CLASSES}


def test_the_middle_of_each_object_has_its_number(shared_world: World) -> None:
    """Projected independently of the renderer; equal objects have different numbers."""
    frame, image = shared_world.frame, front(shared_world)
    assert image.instances is not None
    middles = {name: frame.objects[name].pose.position for name in ("near", "far")}
    middles["V2"] = np.add(frame.vehicles["V2"].pose.position, (0.0, 0.0, 0.03))
    for name, middle in middles.items():
        turn = np.reshape(rotation_from_quaternion(image.pose.orientation), (3, 3))
        ((column, row),) = project(image.intrinsics, ((middle - image.pose.position) @ turn)[None])
        assert image.instances[int(row), int(column)] == number(shared_world, name)


def test_the_whole_of_a_hidden_object_is_what_is_seen_without_the_others(
    shared_world: World, town: ScenarioSpec
) -> None:
    """V2 hides a part of a building, of a light or of the road; the same picture without V2 and boxes shows it."""
    compiled, image, frame = compile_scenario(town), front(shared_world), shared_world.frame
    view = View(tuple(image.pose.position.tolist()), tuple(image.pose.orientation.tolist()), image.intrinsics)
    full, empty = RenderState.of(frame), RenderState.of(frame)
    empty.vehicles["position"][1] = empty.objects["position"][:] = (0.0, 0.0, -50.0)
    with Renderer(scene_of(compiled), "small") as renderer:
        seen, whole = renderer.instances(full, view)
        alone = renderer.instances(empty, view)[0]
    np.testing.assert_array_equal(seen, image.instances)
    assert sorted(whole) == sorted(set(np.unique(seen).tolist()) - {0})
    hidden = 0
    for instance, pixels in whole.items():
        assert pixels[seen == instance].all()
        hidden += int(pixels.sum() - (seen == instance).sum())
        if shared_world.instances[instance - 1].kind in ("building", "traffic_light"):
            assert pixels[alone == instance].all()
    assert hidden > 100


@pytest.mark.parametrize("map_", ["tiny_town", "crossing", "mini_map", "oval"])
def test_each_object_of_a_map_has_one_number(map_: str) -> None:
    world = autodrive.make(ScenarioSpec(map=map_))
    names = [instance.name for instance in world.instances]
    assert len(set(names)) == len(names)
    assert names == [*scene_of(compile_scenario(world.spec)).map_objects, "V1", *world.boxes]


def test_an_image_has_no_instances_unless_the_vehicle_asks_for_them(gl: str, tmp_path: Path) -> None:
    car = car_file(tmp_path, small_images(32, 24))
    world = autodrive.make(ScenarioSpec.model_validate({"vehicles": {"V1": {"type": car}}}), cameras="small")
    assert front(world).instances is None
