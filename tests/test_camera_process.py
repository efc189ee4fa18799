"""Pictures in real time: from a process of their own, which can be slow, fail or die without anyone waiting for it."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import autodrive
from autodrive.camera_process import TRIAL, CameraProcess, _is_too_slow
from autodrive.protocol.messages import CameraImage, Command, SetSceneLight, Teleport
from autodrive.render.quality import PROFILES
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.simulation import Simulation
from autodrive.world import World

from .cars import car_file
from .test_cameras import SMALL

PATIENCE = 60.0
"""Wall time [s]; the machine may be busy."""


def made(car: str, *, is_wanted: bool = True) -> tuple[World, CameraProcess]:
    processes: list[CameraProcess] = []

    def eyes(compiled: object) -> CameraProcess:
        processes.append(CameraProcess.of(compiled, is_wanted=is_wanted))  # type: ignore[arg-type]
        return processes[0]

    world = autodrive.make(ScenarioSpec(map="mini_map", vehicles={"V1": VehiclePlacement(type=car)}), cameras=eyes)
    return world, processes[0]


@pytest.fixture
def car(tmp_path: Path) -> str:
    return car_file(tmp_path, {**SMALL, "cameras.front.depth": True, "cameras.rear.labels": True})


@pytest.fixture
def seeing(gl: str, car: str) -> Iterator[tuple[World, CameraProcess]]:
    world, process = made(car)
    assert process.wait(PATIENCE), process.statistics.fault
    yield world, process
    world.close()


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def looked(world: World) -> dict[str, CameraImage]:
    """Pictures of the state as it stands now."""

    def has_all() -> bool:
        world.look()
        return not world.is_looking

    until(has_all)
    assert all(image.time == world.time for image in world.frame.vehicles["V1"].cameras.values())
    return world.frame.vehicles["V1"].cameras


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_its_pictures_are_those_that_are_drawn_in_the_tick(seeing: tuple[World, CameraProcess], car: str) -> None:
    world, _ = seeing
    exact = autodrive.make(world.spec, cameras=True)
    for name, image in looked(world).items():
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


def test_physics_does_not_wait(seeing: tuple[World, CameraProcess]) -> None:
    """Every picture has its own time, and an old one is not touched while somebody still has it."""
    world, process = seeing
    old = looked(world)["front"]
    before = old.rgba.copy()
    ages = []

    class Ages:
        def publish(self, frame: autodrive.Frame) -> None:
            ages.extend(frame.time - image.time for image in frame.vehicles["V1"].cameras.values())

    simulation = Simulation(world)
    simulation.add_sink(Ages())
    simulation.submit("V1", Command(throttle=1.0))
    simulation.run(2.0)
    assert simulation.ticks == 200
    assert min(ages) >= 0.0
    assert len(set(np.round(ages, 6))) > 1
    assert process.statistics.rate > 1.0
    assert process.statistics.draw_time > 0.0
    np.testing.assert_array_equal(old.rgba, before)
    assert not np.array_equal(world.frame.vehicles["V1"].cameras["front"].rgba, before)


def test_a_reset_forgets_the_pictures_under_way(seeing: tuple[World, CameraProcess]) -> None:
    world, _ = seeing
    looked(world)
    for _ in range(30):
        world.step()
        time.sleep(0.002)
    world.reset()
    assert world.frame.vehicles["V1"].cameras == {}
    for _ in range(20):
        world.step()
        time.sleep(0.01)
        assert all(image.time <= world.time for image in world.frame.vehicles["V1"].cameras.values())


def test_what_is_done_by_hand_shows_though_time_stands_still(seeing: tuple[World, CameraProcess]) -> None:
    """The Simulation publishes the pictures as they come, without the events of the Frame that they belong to."""
    world, _ = seeing
    day = looked(world)["front"].rgb.mean()
    simulation = Simulation(world, is_paused=True)
    frames: list[autodrive.Frame] = []

    class Frames:
        def publish(self, frame: autodrive.Frame) -> None:
            frames.append(frame)

    simulation.add_sink(Frames())
    with simulation:
        for request in (SetSceneLight(False), Teleport("V1", -0.4, 0.5, 1.0)):
            simulation.request(request).result(PATIENCE)
        until(lambda: bool(frames) and frames[-1].vehicles["V1"].cameras["front"].pose.position[0] < 0.0)
        until(lambda: not world.is_looking)
        count = len(frames)
        time.sleep(0.1)
        assert len(frames) == count <= 5  # nothing is published that is not new
    assert frames[-1].vehicles["V1"].cameras["front"].rgb.mean() < 0.5 * day
    assert frames[-1].time == 0.0


def test_if_it_dies_the_log_says_so_in_one_line_and_the_simulation_goes_on(
    seeing: tuple[World, CameraProcess], caplog: pytest.LogCaptureFixture
) -> None:
    world, process = seeing
    looked(world)
    with caplog.at_level(logging.INFO):
        os.kill(process.pid, signal.SIGKILL)
        until(lambda: bool(process.statistics.fault))
        for _ in range(10):
            world.step()
    assert [record.message for record in caplog.records] == [process.statistics.fault]
    assert "SIGKILL" in process.statistics.fault
    assert world.frame.vehicles["V1"].cameras == {}
    assert world.time == pytest.approx(0.1)


def test_without_opengl_it_says_so_and_the_simulation_goes_on(
    car: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", os.devnull)
    world, process = made(car)
    assert not process.wait(PATIENCE)
    until(lambda: bool(caplog.records))
    assert len(caplog.records) == 1
    assert "apt-get install" in caplog.records[0].message
    assert world.step().vehicles["V1"].cameras == {}
    world.close()


def test_closing_leaves_nothing_behind(gl: str, car: str) -> None:
    def descriptors() -> int:
        return len(os.listdir("/proc/self/fd"))

    before = descriptors()
    for _ in range(2):
        world, process = made(car)
        world.close()  # at once: it may not even have begun
        assert not is_alive(process.pid)
    world, process = made(car)
    assert process.wait(PATIENCE)
    world.close()
    assert not is_alive(process.pid)
    del world, process
    assert descriptors() <= before + 1  # the engine's own log file may be open


def test_if_the_simulator_is_killed_the_process_ends_too(gl: str, car: str) -> None:
    program = (
        "import sys, time\nfrom tests.test_camera_process import made\nworld, process = made(sys.argv[1])\n"
        "process.wait()\nprint(process.pid, flush=True)\nwhile True: world.step(); time.sleep(0.01)"
    )
    simulator = subprocess.Popen(
        [sys.executable, "-c", program, car], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parent.parent
    )
    assert simulator.stdout is not None
    with simulator.stdout as stdout:
        pid = int(stdout.readline())
    assert is_alive(pid)
    simulator.kill()
    simulator.wait()
    until(lambda: not is_alive(pid))


@pytest.mark.parametrize(
    ("asked", "drawn", "draw_time", "count", "is_too_slow"),
    [
        ("auto", "software-fxaa", 0.050, TRIAL, True),
        ("auto", "software-fxaa", 0.050, TRIAL - 1, False),  # not yet judged
        ("auto", "software-fxaa", 0.020, TRIAL, False),
        ("software-fxaa", "software-fxaa", 0.050, TRIAL, False),  # it was asked for
        ("auto", "software", 0.050, TRIAL, False),  # nothing left to drop
        ("auto", "gpu", 0.050, TRIAL, False),
    ],
)
def test_smooth_edges_are_dropped_only_where_they_take_longer_than_the_cameras_period(
    asked: str, drawn: str, draw_time: float, count: int, is_too_slow: bool
) -> None:
    seat = SimpleNamespace(spec=SimpleNamespace(rate=30.0))
    sight, renderer = SimpleNamespace(quality=asked, seats=[seat]), SimpleNamespace(quality=PROFILES[drawn])
    assert _is_too_slow(sight, renderer, [draw_time] * count) == is_too_slow  # type: ignore[arg-type]


def test_while_nobody_looks_nothing_is_drawn_and_no_process_is_there(gl: str, car: str) -> None:
    world, process = made(car, is_wanted=False)
    world.step()
    assert process.pid == 0
    assert not world.is_looking
    process.is_wanted = True
    assert process.wait(PATIENCE)
    assert looked(world)
    process.is_wanted = False
    assert world.step().vehicles["V1"].cameras == {}  # rather none than old ones
    assert not world.is_looking
    assert is_alive(process.pid)  # to be quick the next time
    process.is_wanted = True
    assert looked(world)
    world.close()
    assert not is_alive(process.pid)
