"""A viewer can draw a world from its Scene and the files that it names."""

from __future__ import annotations

import autodrive
from autodrive.actuators.lights import LAMPS
from autodrive.protocol.codec import decode_server, encode
from autodrive.render.glb import read_glb
from autodrive.scenery import FOLDER, Scenery
from autodrive.vehicles.spec import load_vehicle


def test_every_file_that_a_scene_names_is_there_once_and_is_an_asset() -> None:
    world = autodrive.make("boxes")
    scenery = Scenery.of(world, "boxes")
    scene = scenery.scene
    urls = {scene.model, *(one.model for one in scene.vehicles.values()), *scene.objects.values()}
    assert {url.removeprefix(f"{FOLDER}/") for url in urls} == set(scenery.files)
    assert all(read_glb(content).nodes for content in scenery.files.values())
    assert list(scene.objects) == list(world.frame.objects)


def test_the_lamps_stand_where_the_spec_says_and_the_right_ones_mirror_the_left() -> None:
    lamps = Scenery.of(autodrive.make("plane"), "plane").scene.vehicles["V1"].lamps
    lights = load_vehicle("nigel").lights
    assert tuple(lamps) == LAMPS
    x, y, z = lights.tail.position
    assert (lamps["tail_left"].position, lamps["tail_right"].position) == ((x, y, z), (x, -y, z))


def test_a_scene_survives_the_wire() -> None:
    scene = Scenery.of(autodrive.make("two_cars"), "two_cars").scene
    assert encode(decode_server(encode(scene))) == encode(scene)
