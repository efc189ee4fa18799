"""Scene cameras from a process of their own, which can fail or die without anyone waiting for it in vain."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

import autodrive
from autodrive.cameras import sight_of
from autodrive.compile import compile_scenario
from autodrive.errors import AutodriveError
from autodrive.protocol.messages import Frame
from autodrive.protocol.native import SetCamera
from autodrive.render.moment import Moment
from autodrive.render.renderer import Renderer
from autodrive.render.viewpoints import GodsEye, Viewpoint, birds_eye, drivers_eye, orbit
from autodrive.scene_process import SceneProcess
from autodrive.transforms import rotate
from autodrive.world import World

from .test_camera_process import PATIENCE, is_alive, until

SMALL = 320
"""Width of the pictures [pixels]."""
DRIVER, BIRD = SetCamera("Driver's Eye", width=SMALL), SetCamera("Bird's Eye", width=SMALL)


@pytest.fixture(scope="module")
def shared_world() -> World:
    return autodrive.make("two_cars")


@pytest.fixture
def world(shared_world: World) -> World:
    shared_world.reset()
    shared_world.set_scene_light(True)
    return shared_world


@pytest.fixture
def scene(gl: str, world: World) -> Iterator[SceneProcess]:
    process = SceneProcess.of(world, "software-fxaa")
    yield process
    process.close()


def seen(picture: Future[bytes]) -> np.ndarray:
    return simplejpeg.decode_jpeg(picture.result(PATIENCE)).astype(float)


def far_apart(a: np.ndarray, b: np.ndarray) -> float:
    """Mean difference of two pictures, of 255."""
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


def test_its_pictures_are_those_of_the_renderer_by_day_and_night(scene: SceneProcess, world: World) -> None:
    """JPEG of that quality, with its halved colours, changes a pixel by 2 of 255 in the mean."""
    exact = Renderer(sight_of(compile_scenario(world.spec)).scene, "software-fxaa")
    for is_day in (True, False):
        world.set_scene_light(is_day)
        frame = world.step()
        drawn = {
            name: seen(scene.draw(1, SetCamera(name, None, 2.0, 2.0, 0.3, 1.5, width=SMALL), frame))
            for name in viewpoints(world)
        }
        views = [viewpoint.view(SMALL, 180) for viewpoint in viewpoints(world).values()]
        expected = [picture.rgba[..., :3].astype(float) for picture in exact.draw(Moment.of(frame), views)]
        for i, picture in enumerate(drawn.values()):
            distances = [far_apart(picture, other) for other in expected]
            assert distances[i] < 3.0
            assert min(distances[:i] + distances[i + 1 :]) > 2.0 * distances[i]
    exact.release()


def test_gods_eye_follows(scene: SceneProcess, world: World) -> None:
    """It turns to where another viewer, who looks for the first time, sees the vehicle at once."""
    name = next(iter(world.frame.vehicles))
    wish = SetCamera("God's Eye", width=SMALL)
    before = seen(scene.draw(1, wish, world.frame))
    world.teleport(name, -0.6, 0.6, 0.3)
    there = seen(scene.draw(2, wish, world.frame))
    apart = far_apart(before, there)
    assert apart > 3.0
    until(lambda: far_apart(seen(scene.draw(1, wish, world.frame)), there) < 0.5 * apart)


def test_each_viewer_gets_the_latest_it_wished_and_has_its_turn(scene: SceneProcess, world: World) -> None:
    scene.draw(1, DRIVER, world.frame).result(PATIENCE)
    os.kill(scene.pid, signal.SIGSTOP)
    at_work = scene.draw(1, DRIVER, world.frame)
    until(at_work.running)
    waiting = scene.draw(2, BIRD, world.frame)
    other = scene.draw(3, BIRD, world.frame)
    replaced = scene.draw(2, SetCamera("Bird's Eye", width=480), world.frame)
    again = scene.draw(1, BIRD, world.frame)
    assert replaced is waiting
    assert again is not at_work
    order: list[Future[bytes]] = []
    for picture in (waiting, other, again, at_work):
        picture.add_done_callback(order.append)
    os.kill(scene.pid, signal.SIGCONT)
    assert seen(waiting).shape == (270, 480, 3)
    assert seen(again).shape == (180, 320, 3)
    assert order == [at_work, waiting, other, again]


def test_a_viewer_that_leaves_costs_no_picture(scene: SceneProcess, world: World) -> None:
    scene.draw(1, DRIVER, world.frame).result(PATIENCE)
    os.kill(scene.pid, signal.SIGSTOP)
    at_work = scene.draw(1, DRIVER, world.frame)
    until(at_work.running)
    gone, unwanted = scene.draw(2, BIRD, world.frame), scene.draw(3, BIRD, world.frame)
    scene.forget(2)
    assert unwanted.cancel()
    os.kill(scene.pid, signal.SIGCONT)
    with pytest.raises(AutodriveError, match="viewer is gone"):
        gone.result(PATIENCE)
    assert at_work.result(PATIENCE)
    assert scene.draw(3, BIRD, world.frame).result(PATIENCE)


def test_if_it_dies_another_one_draws_the_picture_and_the_log_says_so_in_one_line(
    scene: SceneProcess, world: World, caplog: pytest.LogCaptureFixture
) -> None:
    first = scene.draw(1, DRIVER, world.frame).result(PATIENCE)
    pid = scene.pid
    os.kill(pid, signal.SIGSTOP)
    at_work = scene.draw(1, DRIVER, world.frame)
    until(at_work.running)
    os.kill(pid, signal.SIGKILL)
    assert at_work.result(PATIENCE) == first
    assert scene.fault == ""
    assert scene.pid != pid
    os.kill(scene.pid, signal.SIGKILL)  # between two pictures
    assert scene.draw(1, DRIVER, world.frame).result(PATIENCE) == first
    assert len(caplog.records) == 2
    assert all("SIGKILL" in record.message for record in caplog.records)


def test_if_the_other_one_dies_before_it_can_draw_the_picture_fails(scene: SceneProcess, world: World) -> None:
    scene.draw(1, DRIVER, world.frame).result(PATIENCE)
    pid = scene.pid
    os.kill(pid, signal.SIGSTOP)
    at_work = scene.draw(1, DRIVER, world.frame)
    until(at_work.running)
    os.kill(pid, signal.SIGKILL)
    until(lambda: scene.pid not in {0, pid})
    os.kill(scene.pid, signal.SIGKILL)
    with pytest.raises(AutodriveError, match="SIGKILL"):
        at_work.result(PATIENCE)
    assert "SIGKILL" in scene.fault
    with pytest.raises(AutodriveError, match="SIGKILL"):
        scene.check(DRIVER)


def test_without_opengl_it_says_so(
    world: World, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", os.devnull)
    scene = SceneProcess.of(world)
    scene.check(DRIVER)
    pictures = [scene.draw(viewer, DRIVER, world.frame) for viewer in (1, 2)]
    for picture in (*pictures, scene.draw(3, DRIVER, world.frame)):
        with pytest.raises(AutodriveError, match="apt-get install"):
            picture.result(PATIENCE)
    with pytest.raises(AutodriveError, match="apt-get install"):
        scene.check(DRIVER)
    assert "apt-get install" in scene.fault
    assert scene.pid == 0
    scene.close()
    assert len(caplog.records) == 1


def test_what_cannot_be_drawn_fails_without_a_process(world: World) -> None:
    scene = SceneProcess.of(world)
    with pytest.raises(AutodriveError, match="not known"):
        scene.draw(1, SetCamera("Devil's Eye"), world.frame).result(0.0)
    stranger: Frame = autodrive.make("mini_map").frame
    with pytest.raises(AutodriveError, match="another world"):
        scene.draw(1, DRIVER, stranger).result(0.0)
    assert scene.pid == 0
    scene.close()


def test_closing_leaves_nothing_behind(gl: str, world: World) -> None:
    def descriptors() -> int:
        return len(os.listdir("/proc/self/fd"))

    before = descriptors()
    SceneProcess.of(world).close()
    scene = SceneProcess.of(world)
    picture = scene.draw(1, DRIVER, world.frame)
    waiting = scene.draw(2, DRIVER, world.frame)
    until(lambda: scene.pid != 0)
    pid = scene.pid
    scene.close()  # it has hardly begun
    for failed in (picture, waiting, scene.draw(1, DRIVER, world.frame)):
        with pytest.raises(AutodriveError):
            failed.result(0.0)
    assert not is_alive(pid)
    scene = SceneProcess.of(world)
    scene.draw(1, DRIVER, world.frame).result(PATIENCE)
    pid = scene.pid
    scene.close()
    scene.close()
    assert not is_alive(pid)
    assert descriptors() <= before


def test_if_the_simulator_is_killed_the_process_ends_too(gl: str) -> None:
    program = (
        "import time, autodrive\nfrom autodrive.protocol.native import SetCamera\n"
        "from autodrive.scene_process import SceneProcess\nworld = autodrive.make('two_cars')\n"
        "scene = SceneProcess.of(world)\nscene.draw(1, SetCamera('Orbit'), world.frame).result()\n"
        "print(scene.pid, flush=True)\ntime.sleep(1000)"
    )
    simulator = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, cwd=Path("/"))
    assert simulator.stdout is not None
    with simulator.stdout as stdout:
        pid = int(stdout.readline())
    assert is_alive(pid)
    simulator.kill()
    simulator.wait()
    until(lambda: not is_alive(pid))


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "autodrive.scene_process")
