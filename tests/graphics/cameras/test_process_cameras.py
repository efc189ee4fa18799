"""Images in real time, from a separate process that can be slow, fail or die; the simulation never waits for it."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import numpy as np
import pytest

import autodrive
from autodrive import AutodriveError
from autodrive.graphics.cameras import render_process
from autodrive.graphics.cameras.process_cameras import RATE_WINDOW, ProcessCameras
from autodrive.graphics.cameras.render_process import RESTARTS, RenderProcess
from autodrive.graphics.cameras.render_worker import CameraImages, RenderResult
from autodrive.protocol.messages import CameraImage, Command, SetSceneLight, Teleport
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.compile import CompiledScenario
from autodrive.world.simulation import Simulation
from autodrive.world.views.cameras import camera_rig
from tests.graphics.cameras.conftest import Clock, messages, stopped
from tests.support.frames import bytes_of
from tests.support.waiting import LIMIT, is_alive, wait_until

pytestmark = pytest.mark.process


def made(car: str, *, is_wanted: bool = True, clock: Clock | None = None) -> tuple[World, ProcessCameras]:
    backends: list[ProcessCameras] = []

    def start(compiled: CompiledScenario) -> ProcessCameras:
        backends.append(ProcessCameras(camera_rig(compiled), is_wanted=is_wanted, clock=clock or Clock()))
        return backends[0]

    spec = ScenarioSpec(map="mini_map", vehicles={"V1": VehiclePlacement(type=car)})
    return autodrive.make(spec, cameras=start), backends[0]


@pytest.fixture(scope="module")
def running(gl: str, car: str) -> Iterator[tuple[World, ProcessCameras, Clock]]:
    clock = Clock()
    world, cameras = made(car, clock=clock)
    assert cameras.process.wait(LIMIT), cameras.statistics.error
    yield world, cameras, clock
    world.close()


@pytest.fixture
def world(running: tuple[World, ProcessCameras, Clock]) -> World:
    world, _, _ = running
    world.reset()
    world.set_scene_light(True)
    return world


@pytest.fixture
def cameras(running: tuple[World, ProcessCameras, Clock]) -> ProcessCameras:
    return running[1]


def captured(world: World) -> dict[str, CameraImage]:
    """Images of the present state."""

    def has_all() -> bool:
        world.look()
        return not world.is_looking

    wait_until(has_all)
    assert all(image.time == world.time for image in world.frame.vehicles["V1"].cameras.values())
    return world.frame.vehicles["V1"].cameras


def test_its_images_equal_those_drawn_in_the_tick(world: World) -> None:
    exact = autodrive.make(world.spec, cameras=True)
    for name, image in captured(world).items():
        expected = exact.frame.vehicles["V1"].cameras[name]
        assert list(bytes_of(image)) == list(bytes_of(expected))
        assert not image.rgba.flags.writeable


def test_ticks_do_not_wait_for_images(world: World, cameras: ProcessCameras) -> None:
    """While the worker is stopped, ticks continue with the old images, which are never overwritten."""
    old = captured(world)["front"]
    before = old.rgba.copy()
    with stopped(cameras.process):
        for _ in range(50):
            world.step({"V1": Command(throttle=1.0)})
        assert world.frame.vehicles["V1"].cameras["front"] is old

    def has_new() -> bool:
        world.step({"V1": Command(throttle=1.0)})
        return world.frame.vehicles["V1"].cameras["front"] is not old

    wait_until(has_new)
    image = world.frame.vehicles["V1"].cameras["front"]
    assert 0.0 < image.time <= world.time
    np.testing.assert_array_equal(old.rgba, before)
    assert not np.array_equal(captured(world)["front"].rgba, before)


def test_statistics_count_over_their_window(running: tuple[World, ProcessCameras, Clock], world: World) -> None:
    _, cameras, clock = running
    captured(world)
    clock.time += 10.0 * RATE_WINDOW
    assert cameras.statistics.rate == 0.0
    for _ in range(3):
        world.teleport("V1", 0.1, 0.0, 0.0)
        captured(world)
    assert cameras.statistics.rate == pytest.approx(3 / RATE_WINDOW)
    clock.time += RATE_WINDOW
    assert cameras.statistics.rate == 0.0
    assert cameras.statistics.draw_time > 0.0
    assert cameras.statistics.renderer
    assert cameras.statistics.error == ""


def test_a_reset_discards_the_images_being_drawn(world: World, cameras: ProcessCameras) -> None:
    captured(world)
    with stopped(cameras.process):
        for _ in range(30):
            world.step()
        world.reset()
        assert world.frame.vehicles["V1"].cameras == {}
    assert all(image.time == 0.0 for image in captured(world).values())


def test_changes_between_ticks_show_while_the_simulation_is_paused(world: World) -> None:
    """The Simulation publishes images as they arrive, and nothing when there is nothing new."""
    day = captured(world)["front"].rgb.mean()
    simulation = Simulation(world, is_paused=True)
    frames: list[autodrive.Frame] = []

    class Frames:
        def publish(self, frame: autodrive.Frame) -> None:
            frames.append(frame)

    simulation.add_sink(Frames())
    with simulation:
        for request in (SetSceneLight(False), Teleport("V1", -0.4, 0.5, 1.0)):
            simulation.request(request).result(LIMIT)
        wait_until(lambda: bool(frames) and frames[-1].vehicles["V1"].cameras["front"].pose.position[0] < 0.0)
        wait_until(lambda: not world.is_looking)
    assert len(frames) <= 6  # two requests, at most two images each, one more from the end
    assert frames[-1].vehicles["V1"].cameras["front"].rgb.mean() < 0.5 * day
    assert frames[-1].time == 0.0


def test_nothing_is_drawn_while_images_are_not_wanted(world: World, cameras: ProcessCameras) -> None:
    captured(world)
    cameras.is_wanted = False
    assert world.step().vehicles["V1"].cameras == {}  # no images rather than outdated ones
    assert not world.is_looking
    assert is_alive(cameras.process.pid)  # kept, so that the next image comes soon
    cameras.is_wanted = True
    assert captured(world)


def test_ends_of_the_worker_count_for_an_hour(
    gl: str, car: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(render_process, "RESTARTS", 1)
    (world, _), now = made(car, is_wanted=False), [0.0]
    process = RenderProcess(camera_rig(world.compiled), "cameras", clock=lambda: now[0])

    def drawn_after_end(at: float) -> RenderResult:
        now[0] = at
        assert process.wait(LIMIT)
        os.kill(process.pid, signal.SIGKILL)
        return process.draw(0, world.frame, CameraImages(world.frame.tick, [0], (0, 0))).result(LIMIT)

    process.start()
    drawn_after_end(0.0)
    drawn_after_end(3600.0)
    assert ["(1 of 1)" in line for line in messages(caplog)] == [True, True]
    with pytest.raises(AutodriveError, match=r"cameras are unavailable: .* 2 times in an hour"):
        drawn_after_end(3600.0 + 3599.0)
    process.close()
    world.close()


def test_the_worker_starts_when_images_are_first_wanted_and_again_three_times_when_it_dies(
    gl: str, car: str, caplog: pytest.LogCaptureFixture
) -> None:
    before = len(os.listdir("/proc/self/fd"))
    world, cameras = made(car, is_wanted=False)
    world.step()
    assert cameras.process.pid == 0
    assert not world.is_looking
    cameras.is_wanted = True
    assert cameras.process.wait(LIMIT)
    captured(world)
    pid = 0
    for deaths in range(1, RESTARTS + 2):
        pid = cameras.process.pid
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda n=deaths, world=world: bool(world.step()) and len(messages(caplog)) == n)
        if deaths <= RESTARTS:
            assert cameras.process.wait(LIMIT)
            assert cameras.process.pid != pid
            assert not cameras.statistics.error
            assert captured(world).keys() == {"front", "rear"}
            assert "a new process is started" in messages(caplog)[-1]
    for _ in range(10):
        world.step()
    assert messages(caplog)[-1] == cameras.statistics.error
    assert "SIGKILL" in cameras.statistics.error
    assert world.frame.vehicles["V1"].cameras == {}
    assert not is_alive(pid)
    world.close()
    del world, cameras
    assert len(os.listdir("/proc/self/fd")) <= before + 1  # the engine's own log file may be open


def test_without_opengl_one_line_is_logged_and_the_simulation_continues(
    car: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", os.devnull)
    world, cameras = made(car)
    assert not cameras.process.wait(LIMIT)
    wait_until(lambda: bool(messages(caplog)))
    assert len(messages(caplog)) == 1
    assert "apt-get install" in messages(caplog)[0]
    assert world.step().vehicles["V1"].cameras == {}
    world.close()


def test_closing_at_once_leaves_no_process(gl: str, car: str) -> None:
    world, cameras = made(car)
    world.close()
    assert cameras.process.pid == 0
    world, cameras = made(car)
    wait_until(lambda: cameras.process.pid)
    pid = cameras.process.pid
    world.close()
    assert cameras.process.pid == 0
    assert not is_alive(pid)
