"""Scene cameras from a separate process, which can fail or die without leaving a client waiting."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from concurrent.futures import Future

import numpy as np
import pytest
import simplejpeg

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.base.transforms import rotate
from autodrive.connect.server.served import scene_renderer_factory
from autodrive.graphics.cameras import render_process
from autodrive.graphics.cameras.render_worker import RenderResult
from autodrive.graphics.cameras.scene_views import SceneViews
from autodrive.graphics.cameras.viewpoints import GodsEye, Viewpoint, birds_eye, drivers_eye, orbit
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.protocol.messages import Frame
from autodrive.protocol.native import SetCamera
from autodrive.world import World
from autodrive.world.factory import compile_scenario
from autodrive.world.views.cameras import camera_rig, scene_rig
from tests.graphics.cameras.conftest import Clock, messages, stopped
from tests.support.waiting import LIMIT, is_alive, wait_until

pytestmark = pytest.mark.process

SMALL = 320
"""Width of the images [pixels]."""
DRIVER, BIRD = SetCamera("Driver's Eye", width=SMALL), SetCamera("Bird's Eye", width=SMALL)


@pytest.fixture(scope="module")
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="module")
def scene(gl: str, shared_world: World, clock: Clock) -> Iterator[SceneViews]:
    views = SceneViews(scene_rig(shared_world, "software-fxaa"), clock=clock)
    yield views
    views.close()


def decoded(image: Future[RenderResult]) -> np.ndarray:
    return simplejpeg.decode_jpeg(image.result(LIMIT).answer).astype(float)


def mean_difference(a: np.ndarray, b: np.ndarray) -> float:
    """Of two images, of 255."""
    return float(np.mean(np.abs(a - b)))


def viewpoints(world: World) -> dict[str, Viewpoint]:
    vehicle, spec = next(iter(world.frame.vehicles.values())), next(iter(world.vehicle_specs.values()))
    position, orientation = tuple(vehicle.pose.position.tolist()), tuple(vehicle.pose.orientation.tolist())
    middle = tuple(np.add(position, rotate(orientation, (0.07, 0.0, 0.05))).tolist())
    return {
        "Driver's Eye": drivers_eye(position, orientation),
        "Bird's Eye": birds_eye(position, 2.0),
        "God's Eye": GodsEye(0.5 * max(spec.size)).step(position, 0.0),
        "Orbit": orbit(middle, 1.5, np.degrees(2.0), np.degrees(0.3)),
    }


@pytest.fixture(autouse=True)
def _log_level(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, render_process.__name__)


def test_its_images_are_those_of_the_renderer_by_day_and_night(scene: SceneViews, world: World) -> None:
    """JPEG of that quality, with half the colour resolution, changes a pixel by 2 of 255 on average."""
    exact = Renderer(camera_rig(compile_scenario(world.spec)).scene, "software-fxaa")
    for is_day in (True, False):
        world.set_scene_light(is_day)
        frame = world.step()
        drawn = {
            name: decoded(scene.draw(1, SetCamera(name, None, 2.0, 2.0, 0.3, 1.5, width=SMALL), frame))
            for name in viewpoints(world)
        }
        views = [viewpoint.view(SMALL, 180) for viewpoint in viewpoints(world).values()]
        expected = [image.rgba[..., :3].astype(float) for image in exact.draw(RenderState.of(frame), views)]
        for i, image in enumerate(drawn.values()):
            differences = [mean_difference(image, other) for other in expected]
            assert differences[i] < 3.0
            assert min(differences[:i] + differences[i + 1 :]) > 2.0 * differences[i]
    exact.release()


def test_gods_eye_turns_with_time(scene: SceneViews, world: World, clock: Clock) -> None:
    """It turns to where another client, which looks for the first time, sees the vehicle at once."""
    name = next(iter(world.frame.vehicles))
    view = SetCamera("God's Eye", width=SMALL)
    scene.forget(1)
    before = decoded(scene.draw(1, view, world.frame))
    world.teleport(name, -0.6, 0.6, 0.3)
    there = decoded(scene.draw(2, view, world.frame))
    assert mean_difference(before, there) > 3.0
    assert mean_difference(decoded(scene.draw(1, view, world.frame)), there) > 3.0  # no time has passed
    clock.time += 20.0
    assert mean_difference(decoded(scene.draw(1, view, world.frame)), there) < 1.0


def test_each_client_gets_its_latest_view_in_turn_and_one_that_leaves_none(scene: SceneViews, world: World) -> None:
    scene.draw(1, DRIVER, world.frame).result(LIMIT)
    order: list[Future[RenderResult]] = []
    with stopped(scene.process):
        running = scene.draw(1, DRIVER, world.frame)
        wait_until(running.running)
        waiting, other = (scene.draw(client, BIRD, world.frame) for client in (2, 3))
        assert scene.draw(2, SetCamera("Bird's Eye", width=480), world.frame) is waiting
        again = scene.draw(1, BIRD, world.frame)
        assert again is not running
        left, cancelled = scene.draw(4, BIRD, world.frame), scene.draw(5, BIRD, world.frame)
        scene.forget(4)
        assert cancelled.cancel()
        for image in (waiting, other, again, running):
            image.add_done_callback(order.append)
    assert decoded(waiting).shape == (270, 480, 3)
    assert decoded(again).shape == (180, 320, 3)
    assert order == [running, waiting, other, again]
    with pytest.raises(AutodriveError, match="client has left"):
        left.result(LIMIT)
    assert scene.draw(5, BIRD, world.frame).result(LIMIT)


def test_without_opengl_every_image_fails_with_the_packages_to_install(
    world: World, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", os.devnull)
    scene = scene_renderer_factory()(world)
    scene.check(DRIVER)
    for image in [scene.draw(client, DRIVER, world.frame) for client in (1, 2)]:
        with pytest.raises(AutodriveError, match="apt-get install"):
            image.result(LIMIT)
    with pytest.raises(AutodriveError, match="apt-get install"):
        scene.check(DRIVER)
    assert scene.process.pid == 0
    scene.close()
    assert len(messages(caplog)) == 1


def test_an_impossible_camera_fails_without_a_worker(world: World) -> None:
    scene = scene_renderer_factory()(world)
    with pytest.raises(AutodriveError, match="not known"):
        scene.draw(1, SetCamera("Devil's Eye"), world.frame).result(0.0)
    foreign: Frame = autodrive.make("mini_map").frame
    with pytest.raises(AutodriveError, match="another world"):
        scene.draw(1, DRIVER, foreign).result(0.0)
    assert scene.process.pid == 0
    scene.close()


def test_closing_ends_all_processes_and_removes_all_files(gl: str, world: World) -> None:
    before = len(os.listdir("/proc/self/fd"))
    scene_renderer_factory()(world).close()
    scene = scene_renderer_factory()(world)
    image = scene.draw(1, DRIVER, world.frame)
    waiting = scene.draw(2, DRIVER, world.frame)
    wait_until(lambda: scene.process.pid != 0)
    pid = scene.process.pid
    scene.close()  # before the worker can draw
    for failed in (image, waiting, scene.draw(1, DRIVER, world.frame)):
        with pytest.raises(AutodriveError):
            failed.result(0.0)
    assert not is_alive(pid)
    assert len(os.listdir("/proc/self/fd")) <= before
