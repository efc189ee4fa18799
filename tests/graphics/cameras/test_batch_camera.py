"""Images of many worlds in one call, compared with the images of the cameras of a single World."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import autodrive
from autodrive.base.errors import AutodriveError, CommandError
from autodrive.graphics.cameras.rig import CameraArray
from autodrive.graphics.render import batch_renderer, draw_list
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.protocol.messages import Command, Frame, Headlights
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.batch import BatchWorld
from autodrive.world.compile import CompiledScenario
from autodrive.world.factory import compile_scenario
from autodrive.world.views.batch_camera import BatchCamera
from autodrive.world.views.cameras import camera_rig
from tests.support.pictures import SCENARIO, random_pictures

SIZE = 84, 64
PLACES = [
    # V1: x, y, yaw; V2: x, y, yaw [m, rad]
    ((0.0, 0.0, 0.0), (0.6, 0.05, 0.3)),
    ((0.3, 0.02, 0.1), (0.75, -0.1, 3.0)),
    ((-0.2, 0.0, 2.6), (1.2, 0.0, 0.0)),
    ((1.0, 0.0, 0.2), (0.2, 0.0, 0.0)),  # V2 is behind V1
    ((0.1, 0.05, -0.6), (0.5, -0.25, 1.0)),
]


@pytest.fixture(scope="module")
def scenario() -> ScenarioSpec:
    """Two cars and a box beside the road, on the mini-map."""
    vehicles = {"V1": VehiclePlacement(), "V2": VehiclePlacement(x=0.6)}
    return ScenarioSpec(map="mini_map", vehicles=vehicles, boxes={"parcel": BoxSpec(x=0.9, y=0.25)})


@pytest.fixture(scope="module")
def compiled(scenario: ScenarioSpec) -> CompiledScenario:
    return compile_scenario(scenario)


@pytest.fixture(scope="module")
def world(scenario: ScenarioSpec) -> World:
    return autodrive.make(scenario)


@pytest.fixture(scope="module")
def camera(gl: str, compiled: CompiledScenario) -> BatchCamera:
    return BatchCamera(compiled, "V1", "front", size=SIZE)


class SingleCameras:
    """The cameras of a World, with small images; each is drawn alone."""

    def __init__(self, compiled: CompiledScenario, quality: str = "small", size: tuple[int, int] = SIZE) -> None:
        rig = camera_rig(compiled, quality)
        edges = {"width": size[0], "height": size[1]}
        small = tuple(slot._replace(spec=slot.spec.model_copy(update=edges)) for slot in rig.slots)
        self._names = [(slot.vehicle, slot.camera) for slot in small]
        self._array = CameraArray(replace(rig, slots=small))
        self._renderer = Renderer(rig.scene, rig.quality)

    def images(self, states: RenderState, camera: str) -> NDArray[np.uint8]:
        number, worlds = self._names.index(("V1", camera)), [states[k] for k in range(len(states.data))]
        return np.array([self._array.capture(self._renderer, state, 0, [number])[0].rgb for state in worlds])


@pytest.fixture(scope="module")
def single(gl: str, compiled: CompiledScenario) -> SingleCameras:
    return SingleCameras(compiled)


def driven(
    world: World, headlights: Headlights = Headlights.OFF, *, is_day: bool = True, backwards: float = -0.5
) -> list[Frame]:
    """The cars at each of `PLACES`, with brakes, forwards and in reverse with the throttle `backwards`."""
    world.reset()
    world.set_scene_light(is_day)
    frames = []
    for i, (first, second) in enumerate(PLACES):
        world.teleport("V2", 3.0, 3.0, 0.0)
        world.teleport("V1", *first)
        world.teleport("V2", *second)
        command = Command((0.0, 0.6, backwards)[i % 3], 0.8 - 0.4 * i, headlights)
        frames += [world.step({"V1": command, "V2": command}) for _ in range(8)][-1:]
    return frames


@pytest.fixture(scope="module")
def day(world: World, single: SingleCameras) -> tuple[RenderState, NDArray[np.uint8]]:
    """States of a World, and what its front camera shows in each."""
    frames = driven(world)
    return RenderState.of_all(frames), single.images(RenderState.of_all(frames), "front")


def assert_alike(images: NDArray[np.uint8], expected: NDArray[np.uint8]) -> None:
    """Other programs draw the meshes, which share lamps and shadows that do not reach them: rounding may differ.

    llvmpipe of Mesa 22 draws equal images.
    """
    difference = np.abs(images.astype(int) - expected)
    assert images.shape == expected.shape
    assert (difference > 2).mean() < 0.002
    assert difference.mean() < 0.02


def test_images_equal_those_of_a_single_world_by_day(
    camera: BatchCamera, day: tuple[RenderState, NDArray[np.uint8]]
) -> None:
    states, expected = day
    images = camera.render(states)
    assert_alike(images, expected)
    # the test above would fail for images in another order
    for i in range(len(images)):
        assert (np.abs(images[i].astype(int) - expected[i - 1]) > 2).mean() > 0.05


@pytest.mark.parametrize(("headlights", "backwards"), [(Headlights.OFF, -0.5), (Headlights.LOW, 0.6)])
def test_images_equal_those_of_a_single_world_by_night(
    world: World, single: SingleCameras, camera: BatchCamera, headlights: Headlights, backwards: float
) -> None:
    """With headlights and reverse lights of both cars, more than four lamps would light one mesh."""
    frames = driven(world, headlights, is_day=False, backwards=backwards)
    states = RenderState.of_all(frames)
    images = camera.render(states)
    assert_alike(images, single.images(RenderState.of_all(frames), "front"))
    states.header["is_day"] = True
    assert images.mean() < 0.6 * camera.render(states).mean()


def test_the_rear_camera_shows_what_is_behind(world: World, single: SingleCameras, compiled: CompiledScenario) -> None:
    frames = driven(world)
    rear = BatchCamera(compiled, "V1", "rear", size=SIZE)
    assert_alike(rear.render(RenderState.of_all(frames)), single.images(RenderState.of_all(frames), "rear"))


def test_edges_are_smoothed_as_in_a_single_world(world: World, compiled: CompiledScenario) -> None:
    frames = driven(world)[:2]
    plain, smooth = (
        BatchCamera(compiled, "V1", "front", size=SIZE, quality=f"software{kind}") for kind in ("", "-fxaa")
    )
    images = smooth.render(RenderState.of_all(frames))
    assert_alike(images, SingleCameras(compiled, "software-fxaa").images(RenderState.of_all(frames), "front"))
    assert (images != plain.render(RenderState.of_all(frames))).mean() > 0.02


def test_an_image_does_not_depend_on_the_other_worlds_nor_on_its_place(
    camera: BatchCamera, day: tuple[RenderState, NDArray[np.uint8]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit; with parts of 7 states and 3 images in flight, so that both are exceeded."""
    monkeypatch.setattr(batch_renderer, "PART", 7)
    monkeypatch.setattr(batch_renderer, "RING", 3)
    many = [i % len(PLACES) for i in range(17)]
    states = day[0][many]
    states.vehicles["position"][:, 0, 0] += 0.003 * np.arange(17)  # no two worlds are equal
    states.objects["position"][::4, -1, :2] += 0.1  # the box stands elsewhere in some of them
    images = camera.render(states)
    assert len({image.tobytes() for image in images}) == 17
    backwards = list(range(16, -1, -1))
    assert np.array_equal(camera.render(states[backwards]), images[backwards])
    for i in (0, 6, 7, 16):
        assert np.array_equal(camera.render(states[[i]])[0], images[i])


def test_shadows_of_moved_boxes_are_those_of_a_new_renderer(
    camera: BatchCamera, compiled: CompiledScenario, day: tuple[RenderState, NDArray[np.uint8]]
) -> None:
    """Only a part of the shadow map is drawn again."""
    states = day[0][[0, 0, 0]]
    states.objects["position"][1:, -1, :2] = (0.45, 0.2), (0.5, -0.2)
    images = camera.render(states)
    assert len({image.tobytes() for image in images}) == 3
    for i in (1, 2):
        fresh = BatchCamera(compiled, "V1", "front", size=SIZE)
        assert np.array_equal(fresh.render(states[[i]])[0], images[i])
        fresh.close()


def test_a_world_that_has_diverged_does_not_disturb_the_others(
    camera: BatchCamera, day: tuple[RenderState, NDArray[np.uint8]]
) -> None:
    states = day[0][[0, 1, 2]]
    expected = camera.render(states)
    states.vehicles.view(np.float64)[1] = states.objects.view(np.float64)[1] = np.nan
    images = camera.render(states)
    assert np.array_equal(images[[0, 2]], expected[[0, 2]])


def test_images_have_any_size_and_no_worlds_give_none(
    gl: str, compiled: CompiledScenario, day: tuple[RenderState, NDArray[np.uint8]]
) -> None:
    wide = BatchCamera(compiled, "V2", "front", size=(33, 7))
    assert wide.render(day[0][[0, 1]]).shape == (2, 7, 33, 3)
    assert wide.render(day[0][[]]).shape == (0, 7, 33, 3)
    assert (wide.intrinsics.width, wide.intrinsics.height) == (33, 7)


def test_readings_of_a_batch_world_are_drawn(single: SingleCameras, scenario: ScenarioSpec, world: World) -> None:
    batch = BatchWorld(scenario, 3)
    commands = np.array([[[0.8, 0.3 * k], [0.4, -0.3 * k]] for k in range(3)])
    for _ in range(4):
        batch.step(commands, ticks=10)
    images = BatchCamera(batch.spec, "V1", "front", size=SIZE).render(batch.pictures())
    for k in range(3):
        world.reset()
        world.set_scene_light(True)
        for _ in range(40):
            world.step({v: Command(*commands[k, i].tolist()) for i, v in enumerate(("V1", "V2"))})
        assert_alike(images[k : k + 1], single.images(RenderState.of_all([world.frame]), "front"))


def test_images_of_many_worlds_equal_those_of_single_worlds_in_all_weathers_at_all_hours(
    gl: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over 200 random states with traffic, traffic lights, lamps, a box, sun, night, rain, snow and fog.

    Colours are rounded to whole numbers in the end, and the sums before are rounded in another order: by at most 1.
    """
    for module in (draw_list, batch_renderer):  # empty slots fill the lists: with fewer lengths there are fewer shaders
        for counts, length in (("CASTER_COUNTS", 4), ("BEAM_COUNTS", 2), ("LAMP_COUNTS", 4)):
            monkeypatch.setattr(module, counts, (length,))
    compiled, size = compile_scenario(SCENARIO), (64, 48)
    of_batch, of_worlds = random_pictures()
    camera = BatchCamera(compiled, "V1", "front", size=size)
    images = camera.render(of_batch)
    expected = SingleCameras(compiled, size=size).images(of_worlds, "front")
    assert len(images) == 200
    assert np.abs(images.astype(int) - expected).max() <= 1
    # the states differ in what is seen of them
    assert len({image.tobytes() for image in expected}) == 200
    # to the bit, whichever suns and weathers are drawn with it
    some = [*range(190, 0, -9)]
    assert np.array_equal(camera.render(of_batch[some]), images[some])


def test_errors_name_what_is_known(scenario: ScenarioSpec) -> None:
    with pytest.raises(AutodriveError, match=r"vehicle 'V3' is not in this scenario\. Known: V1, V2"):
        BatchCamera(scenario, "V3", "front")
    with pytest.raises(AutodriveError, match=r"vehicle 'V1' has no camera 'top'\. Known: front, rear"):
        BatchCamera(scenario, "V1", "top")
    with pytest.raises(AutodriveError, match="images of 0 x 84 pixels are not possible"):
        BatchCamera(scenario, "V1", "front", size=(0, 84))
    camera = BatchCamera(scenario, "V1", "front", size=SIZE)
    batch = BatchWorld(scenario, 2)
    unchecked: Any = batch.readings
    with pytest.raises(CommandError, match=r"takes the pictures of worlds, batch\.pictures\(\), not Readings"):
        camera.render(unchecked)
    for pictures in (batch.pictures()[0], RenderState.empty(1, 1, 2)):
        with pytest.raises(CommandError, match="n worlds of this scenario, with 2 vehicles and 9 objects"):
            camera.render(pictures)
