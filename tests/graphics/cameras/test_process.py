"""Images in real time, from a separate process that can be slow, fail or die; the simulation never waits for it."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator

import numpy as np
import pytest

import autodrive
from autodrive.graphics.cameras import process as process_module
from autodrive.graphics.cameras.process import RATE_WINDOW, CameraProcess
from autodrive.graphics.cameras.shared_memory import FileMemory, SharedMemory, allocate
from autodrive.graphics.cameras.worker import RESTARTS
from autodrive.protocol.messages import CameraImage, Command, SetSceneLight, Teleport
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.cameras import camera_rig
from autodrive.world.compile import CompiledScenario
from autodrive.world.simulation import Simulation
from tests.support.waiting import LIMIT, is_alive, wait_until

pytestmark = pytest.mark.process


class Clock:
    """Wall time that a test sets."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


def made(
    car: str,
    *,
    is_wanted: bool = True,
    clock: Clock | None = None,
    allocate_memory: Callable[[int], SharedMemory] = allocate,
) -> tuple[World, CameraProcess]:
    backends: list[CameraProcess] = []

    def start(compiled: CompiledScenario) -> CameraProcess:
        rig = camera_rig(compiled)
        backend = CameraProcess(rig, is_wanted=is_wanted, clock=clock or Clock(), allocate_memory=allocate_memory)
        backends.append(backend)
        return backend

    spec = ScenarioSpec(map="mini_map", vehicles={"V1": VehiclePlacement(type=car)})
    return autodrive.make(spec, cameras=start), backends[0]


@pytest.fixture(scope="module")
def running(gl: str, car: str) -> Iterator[tuple[World, CameraProcess, Clock]]:
    """A world whose worker draws into a mapped file, as on platforms other than Linux."""
    clock = Clock()
    world, process = made(car, clock=clock, allocate_memory=FileMemory)
    assert process.wait(LIMIT), process.statistics.error
    yield world, process, clock
    world.close()


@pytest.fixture
def world(running: tuple[World, CameraProcess, Clock]) -> World:
    world, _, _ = running
    world.reset()
    world.set_scene_light(True)
    return world


@pytest.fixture
def process(running: tuple[World, CameraProcess, Clock]) -> CameraProcess:
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
        np.testing.assert_array_equal(image.rgba, expected.rgba)
        np.testing.assert_array_equal(image.pose.position, expected.pose.position)
        np.testing.assert_array_equal(image.pose.orientation, expected.pose.orientation)
        assert image.intrinsics == expected.intrinsics
        for array, other in ((image.depth, expected.depth), (image.labels, expected.labels)):
            assert (array is None) == (other is None)
            if array is not None and other is not None:
                np.testing.assert_array_equal(array, other)
        assert not image.rgba.flags.writeable


def test_ticks_do_not_wait_for_images(world: World, process: CameraProcess) -> None:
    """While the worker is stopped, ticks continue with the old images, which are never overwritten."""
    old = captured(world)["front"]
    before = old.rgba.copy()
    os.kill(process.pid, signal.SIGSTOP)
    try:
        for _ in range(50):
            world.step({"V1": Command(throttle=1.0)})
        assert world.frame.vehicles["V1"].cameras["front"] is old
    finally:
        os.kill(process.pid, signal.SIGCONT)

    def has_new() -> bool:
        world.step({"V1": Command(throttle=1.0)})
        return world.frame.vehicles["V1"].cameras["front"] is not old

    wait_until(has_new)
    image = world.frame.vehicles["V1"].cameras["front"]
    assert 0.0 < image.time <= world.time
    np.testing.assert_array_equal(old.rgba, before)
    assert not np.array_equal(captured(world)["front"].rgba, before)


def test_statistics_count_over_their_window(running: tuple[World, CameraProcess, Clock], world: World) -> None:
    _, process, clock = running
    captured(world)
    clock.time += 10.0 * RATE_WINDOW
    assert process.statistics.rate == 0.0
    for _ in range(3):
        world.teleport("V1", 0.1, 0.0, 0.0)
        captured(world)
    assert process.statistics.rate == pytest.approx(3 / RATE_WINDOW)
    clock.time += RATE_WINDOW
    assert process.statistics.rate == 0.0
    assert process.statistics.draw_time > 0.0
    assert process.statistics.renderer
    assert process.statistics.error == ""


def test_a_reset_discards_the_images_being_drawn(world: World, process: CameraProcess) -> None:
    captured(world)
    os.kill(process.pid, signal.SIGSTOP)
    try:
        for _ in range(30):
            world.step()
        world.reset()
        assert world.frame.vehicles["V1"].cameras == {}
    finally:
        os.kill(process.pid, signal.SIGCONT)
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


def test_nothing_is_drawn_while_images_are_not_wanted(world: World, process: CameraProcess) -> None:
    captured(world)
    process.is_wanted = False
    assert world.step().vehicles["V1"].cameras == {}  # no images rather than outdated ones
    assert not world.is_looking
    assert is_alive(process.pid)  # kept, so that the next image comes soon
    process.is_wanted = True
    assert captured(world)


def test_the_worker_starts_when_images_are_first_wanted_and_again_three_times_when_it_dies(
    gl: str, car: str, caplog: pytest.LogCaptureFixture
) -> None:
    before = len(os.listdir("/proc/self/fd"))
    world, process = made(car, is_wanted=False)
    world.step()
    assert process.pid == 0
    assert not world.is_looking
    process.is_wanted = True
    assert process.wait(LIMIT)
    captured(world)
    for deaths in range(1, RESTARTS + 2):
        pid = process.pid
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda n=deaths: len(messages(caplog)) == n)
        if deaths <= RESTARTS:
            assert process.wait(LIMIT)
            assert process.pid != pid
            assert not process.statistics.error
            assert captured(world).keys() == {"front", "rear"}
            assert "is started again" in messages(caplog)[-1]
    for _ in range(10):
        world.step()
    assert messages(caplog)[-1] == process.statistics.error
    assert "SIGKILL" in process.statistics.error
    assert world.frame.vehicles["V1"].cameras == {}
    assert world.time == pytest.approx(0.11)
    world.close()
    assert not is_alive(process.pid)
    del world, process
    assert len(os.listdir("/proc/self/fd")) <= before + 1  # the engine's own log file may be open


def test_without_opengl_one_line_is_logged_and_the_simulation_continues(
    car: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", os.devnull)
    world, process = made(car)
    assert not process.wait(LIMIT)
    wait_until(lambda: bool(messages(caplog)))
    assert len(messages(caplog)) == 1
    assert "apt-get install" in messages(caplog)[0]
    assert world.step().vehicles["V1"].cameras == {}
    world.close()


def test_closing_at_once_leaves_no_process(gl: str, car: str) -> None:
    world, process = made(car)
    world.close()
    assert not is_alive(process.pid)


def messages(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What the camera process logged; other loggers may warn about a busy machine."""
    return [record.message for record in caplog.records if record.name == process_module.__name__]
