"""A client can draw a world from its Scene and the files that the Scene names."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

import autodrive
from autodrive.physics.actuators.lights import LAMPS
from autodrive.protocol.codec import decode_server, encode
from autodrive.protocol.messages import EditMap, MapModule, MapPart
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world.factory import new_world
from autodrive.world.simulation import Simulation
from autodrive.world.views.scene_files import FOLDER, SceneFiles


def test_every_file_that_a_scene_names_is_there_once_and_is_an_asset() -> None:
    world = autodrive.make("boxes")
    scenery = SceneFiles.of(world, "boxes")
    scene = scenery.scene
    assert scene.plan is not None
    plan = scenery.files.pop(scene.plan.image.removeprefix(f"{FOLDER}/"))
    urls = {scene.model, *(one.model for one in scene.vehicles.values()), *scene.objects.values()}
    assert scene.map_scene is not None
    for module in scene.map_scene.modules.values():
        assert scenery.files.pop(module.image.removeprefix(f"{FOLDER}/")).startswith(b"<svg")
    for face in scene.map_scene.faces.values():
        assert scenery.files.pop(face.removeprefix(f"{FOLDER}/")).startswith(b"<svg")
    assert {url.removeprefix(f"{FOLDER}/") for url in urls} == set(scenery.files)
    assert all(content.startswith(b"glTF") for content in scenery.files.values())
    assert list(scene.objects) == list(world.frame.objects)
    assert plan.startswith(b"<svg")


def test_the_drawing_of_the_map_has_walls_and_lanes_but_no_box_that_can_be_moved() -> None:
    scenery = SceneFiles.of(autodrive.make("mini_map"), "mini_map")
    plan = scenery.scene.plan
    assert plan is not None
    root = ElementTree.fromstring(scenery.files[plan.image.removeprefix(f"{FOLDER}/")])
    classes = [element.get("class") for element in root.iter()]
    assert {"wall", "lane", "road"} <= set(classes)
    assert "box" not in classes
    x0, y0, x1, y1 = plan.bounds
    left, top, width, height = map(float, root.attrib["viewBox"].split())
    assert (left, -top, left + width, -top - height) == pytest.approx((x0, y1, x1, y0), abs=1e-3)


def test_the_lamps_stand_where_the_spec_says_and_the_right_ones_mirror_the_left() -> None:
    lamps = SceneFiles.of(autodrive.make("plane"), "plane").scene.vehicles["V1"].lamps
    lights = load_vehicle("nigel").lights
    assert tuple(lamps) == LAMPS
    x, y, z = lights.tail.position
    assert (lamps["tail_left"].position, lamps["tail_right"].position) == ((x, y, z), (x, -y, z))


def test_a_decoded_scene_equals_the_encoded_one() -> None:
    scene = SceneFiles.of(autodrive.make("two_cars"), "two_cars").scene
    assert encode(decode_server(encode(scene))) == encode(scene)


def test_an_edit_of_a_map_changes_few_files_of_its_ground() -> None:
    simulation = Simulation(autodrive.make("plane"), is_paused=True, load=new_world)

    def scenery(**parts: MapPart | None) -> SceneFiles:
        done = simulation.request(EditMap(parts))
        simulation.execute_requests()
        done.result(0)
        return SceneFiles.of(simulation.world, "plane")

    row = {f"m{i}": MapModule("straight_road", 3.0 * i, 0.0) for i in range(20)}
    before = scenery(**row)
    after = scenery(m10=MapModule("straight_road", 30.0, 0.5))
    assert {*after.scene.ground} <= {f"{FOLDER}/{name}" for name in after.files}
    assert after.scene.model == before.scene.model
    # the two parts that have pieces of the module, and the one of the kerbs' shade
    assert len({*after.scene.ground} - {*before.scene.ground}) <= 3
    assert len(after.scene.ground) >= 10
    again = scenery(m10=row["m10"])
    assert again.files == before.files
