"""Images of many worlds in one call, compared with the images of the cameras of a single World."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.rig import CameraArray
from autodrive.graphics.render import batch_renderer
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

SIZE = 84, 64
PLACES = [
    # V1: x, y, yaw; V2: x, y, yaw [m, rad]
    ((0.0, 0.0, 0.0), (0.6, 0.05, 0.3)),
    ((0.3, 0.02, 0.1), (0.75, -0.1, 3.0)),
    ((-0.2, 0.0, 2.6), (1.2, 0.0, 0.0)),
    ((1.0, 0.0, 0.2), (0.2, 0.0, 0.0)),  # V2 is behind V1
    ((0.1, 0.05, -0.6), (0.5, -0.25, 1.0)),
]


def states_of(frames: Sequence[Frame]) -> Any:
    """What `BatchCamera.render` reads of some worlds, one row for each."""
    vehicles = [list(frame.vehicles.values()) for frame in frames]
    wheels = {
        f"wheel_{name}": np.array([[getattr(one.wheels, name) for one in row] for row in vehicles])
        for name in ("steering_angle", "rotation_angle", "angular_velocity", "compression")
    }
    poses = [[np.concatenate([o.pose.position, o.pose.orientation]) for o in f.objects.values()] for f in frames]
    return SimpleNamespace(
        position=np.array([[one.pose.position for one in row] for row in vehicles]),
        orientation=np.array([[one.pose.orientation for one in row] for row in vehicles]),
        throttle=np.array([[one.throttle for one in row] for row in vehicles]),
        object_pose=np.array(poses).reshape(len(frames), -1, 7),
        **wheels,
    )


def rows(states: Any, numbers: Sequence[int]) -> Any:
    """A copy of some worlds."""
    return SimpleNamespace(**{name: column[list(numbers)] for name, column in vars(states).items()})


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

    def __init__(self, compiled: CompiledScenario, quality: str = "small") -> None:
        rig = camera_rig(compiled, quality)
        edges = {"width": SIZE[0], "height": SIZE[1]}
        small = tuple(slot._replace(spec=slot.spec.model_copy(update=edges)) for slot in rig.slots)
        self._names = [(slot.vehicle, slot.camera) for slot in small]
        self._array = CameraArray(replace(rig, slots=small))
        self._renderer = Renderer(rig.scene, rig.quality)

    def images(self, frames: Sequence[Frame], camera: str) -> NDArray[np.uint8]:
        number = self._names.index(("V1", camera))
        states = [RenderState.of(frame) for frame in frames]
        return np.array([self._array.capture(self._renderer, state, 0, [number])[0].rgb for state in states])


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
def day(world: World, single: SingleCameras) -> tuple[Any, NDArray[np.uint8]]:
    """States of a World, and what its front camera shows in each."""
    frames = driven(world)
    return states_of(frames), single.images(frames, "front")


def assert_alike(images: NDArray[np.uint8], expected: NDArray[np.uint8]) -> None:
    """Other programs draw the meshes, which share lamps and shadows that do not reach them: rounding may differ.

    llvmpipe of Mesa 22 draws equal images.
    """
    difference = np.abs(images.astype(int) - expected)
    assert images.shape == expected.shape
    assert (difference > 2).mean() < 0.002
    assert difference.mean() < 0.02


def test_images_equal_those_of_a_single_world_by_day(camera: BatchCamera, day: tuple[Any, NDArray[np.uint8]]) -> None:
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
    images = camera.render(states_of(frames), is_day=False, headlights=headlights)
    assert_alike(images, single.images(frames, "front"))
    assert images.mean() < 0.6 * camera.render(states_of(frames)).mean()


def test_the_rear_camera_shows_what_is_behind(world: World, single: SingleCameras, compiled: CompiledScenario) -> None:
    frames = driven(world)
    rear = BatchCamera(compiled, "V1", "rear", size=SIZE)
    assert_alike(rear.render(states_of(frames)), single.images(frames, "rear"))


def test_edges_are_smoothed_as_in_a_single_world(world: World, compiled: CompiledScenario) -> None:
    frames = driven(world)[:2]
    plain, smooth = (
        BatchCamera(compiled, "V1", "front", size=SIZE, quality=f"software{kind}") for kind in ("", "-fxaa")
    )
    images = smooth.render(states_of(frames))
    assert_alike(images, SingleCameras(compiled, "software-fxaa").images(frames, "front"))
    assert (images != plain.render(states_of(frames))).mean() > 0.02


def test_an_image_does_not_depend_on_the_other_worlds_nor_on_its_place(
    camera: BatchCamera, day: tuple[Any, NDArray[np.uint8]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit; with parts of 7 states and 3 images in flight, so that both are exceeded."""
    monkeypatch.setattr(batch_renderer, "PART", 7)
    monkeypatch.setattr(batch_renderer, "RING", 3)
    many = [i % len(PLACES) for i in range(17)]
    states = rows(day[0], many)
    states.position[:, 0, 0] += 0.003 * np.arange(17)  # no two worlds are equal
    states.object_pose[::4, -1, :2] += 0.1  # the box stands elsewhere in some of them
    images = camera.render(states)
    assert len({image.tobytes() for image in images}) == 17
    backwards = list(range(16, -1, -1))
    assert np.array_equal(camera.render(rows(states, backwards)), images[backwards])
    for i in (0, 6, 7, 16):
        assert np.array_equal(camera.render(rows(states, [i]))[0], images[i])


def test_shadows_of_moved_boxes_are_those_of_a_new_renderer(
    camera: BatchCamera, compiled: CompiledScenario, day: tuple[Any, NDArray[np.uint8]]
) -> None:
    """Only a part of the shadow map is drawn again."""
    states = rows(day[0], [0, 0, 0])
    states.object_pose[1, -1, :2], states.object_pose[2, -1, :2] = (0.45, 0.2), (0.5, -0.2)
    images = camera.render(states)
    assert len({image.tobytes() for image in images}) == 3
    for i in (1, 2):
        fresh = BatchCamera(compiled, "V1", "front", size=SIZE)
        assert np.array_equal(fresh.render(rows(states, [i]))[0], images[i])
        fresh.close()


def test_a_world_that_has_diverged_does_not_disturb_the_others(
    camera: BatchCamera, day: tuple[Any, NDArray[np.uint8]]
) -> None:
    states = rows(day[0], [0, 1, 2])
    expected = camera.render(states)
    for column in vars(states).values():
        column[1] = np.nan
    images = camera.render(states)
    assert np.array_equal(images[[0, 2]], expected[[0, 2]])


def test_images_have_any_size_and_no_worlds_give_none(
    gl: str, compiled: CompiledScenario, day: tuple[Any, NDArray[np.uint8]]
) -> None:
    wide = BatchCamera(compiled, "V2", "front", size=(33, 7))
    assert wide.render(rows(day[0], [0, 1])).shape == (2, 7, 33, 3)
    assert wide.render(rows(day[0], [])).shape == (0, 7, 33, 3)
    assert (wide.intrinsics.width, wide.intrinsics.height) == (33, 7)


def test_readings_of_a_batch_world_are_drawn(single: SingleCameras, scenario: ScenarioSpec, world: World) -> None:
    batch = BatchWorld(scenario, 3)
    commands = np.array([[[0.8, 0.3 * k], [0.4, -0.3 * k]] for k in range(3)])
    for _ in range(4):
        batch.step(commands, ticks=10)
    images = BatchCamera(batch.spec, "V1", "front", size=SIZE).render(batch.readings)
    for k in range(3):
        world.reset()
        world.set_scene_light(True)
        for _ in range(40):
            world.step({v: Command(*commands[k, i].tolist()) for i, v in enumerate(("V1", "V2"))})
        assert_alike(images[k : k + 1], single.images([world.frame], "front"))


def test_errors_name_what_is_known(scenario: ScenarioSpec) -> None:
    with pytest.raises(AutodriveError, match=r"vehicle 'V3' is not in this scenario\. Known: V1, V2"):
        BatchCamera(scenario, "V3", "front")
    with pytest.raises(AutodriveError, match=r"vehicle 'V1' has no camera 'top'\. Known: front, rear"):
        BatchCamera(scenario, "V1", "top")
    with pytest.raises(AutodriveError, match="images of 0 x 84 pixels are not possible"):
        BatchCamera(scenario, "V1", "front", size=(0, 84))
