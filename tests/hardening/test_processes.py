"""Processes that render and are killed or hang: started again some times, then said; the simulation goes on.

AUTODRIVE_HARDENING=long kills each kind of process 100 times.
"""

from __future__ import annotations

import os
import random
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.connect.server.served import scene_renderer_factory
from autodrive.graphics.cameras import render_process
from autodrive.graphics.cameras.process_cameras import ProcessCameras
from autodrive.protocol.native import SetCamera
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.compile import CompiledScenario
from autodrive.world.simulation import Simulation
from autodrive.world.views.cameras import process_cameras
from tests.support.cars import car_file, small_images
from tests.support.hardening import cases, memory, open_files
from tests.support.waiting import LIMIT, is_alive, wait_until

pytestmark = pytest.mark.process

INSTANCES = cases(3, 26)
"""Each is killed `RESTARTS` + 1 times. The first two fill the caches of the process."""
RESTARTS = cases(1, render_process.RESTARTS)
"""How often a process is started again here; tests/graphics/cameras tests that users have three times."""
VIEW = SetCamera("Driver's Eye", width=160)


@pytest.fixture(autouse=True)
def _restarts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(render_process, "RESTARTS", RESTARTS)


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> ScenarioSpec:
    """A car whose cameras have small images."""
    car = car_file(tmp_path_factory.mktemp("car"), small_images(48, 36))
    return ScenarioSpec(vehicles={"V1": VehiclePlacement(type=car)})


def resources() -> dict[str, int]:
    """What this process holds, besides memory."""
    children = [
        path.name
        for path in Path("/proc").iterdir()
        if path.name.isdecimal() and is_alive(int(path.name)) and _parent(path) == os.getpid()
    ]
    return {
        "threads": len(os.listdir("/proc/self/task")),
        "descriptors": open_files(),
        "children": len(children),
    }


def _parent(process: Path) -> int:
    try:
        return int((process / "stat").read_text().rsplit(")", 1)[1].split()[1])
    except OSError:
        return 0


def attack(instance: Callable[[], int]) -> None:
    """Use and kill instances; what remains is what remained after the first two."""
    kills = instance() + instance()
    before, used = resources(), memory()
    for _ in range(INSTANCES - 2):
        kills += instance()
        print(f"{kills} kills, {memory():.0f} MB", flush=True)
    # fewer: what another test left behind may end meanwhile
    wait_until(lambda: all(now <= before[name] for name, now in resources().items()))
    print(f"{kills} kills; {before}; {used:.0f} MB, then {memory():.0f} MB")
    assert kills == INSTANCES * (RESTARTS + 1)
    assert memory() < 1.05 * used


def lines(caplog: pytest.LogCaptureFixture, module: str) -> list[str]:
    """What was logged by a module since the last call."""
    found = [record.message for record in caplog.records if record.name == module]
    caplog.clear()
    return found


# -- cameras of vehicles --------------------------------------------------------------------------------------------


def made(spec: ScenarioSpec) -> tuple[World, ProcessCameras]:
    backends: list[ProcessCameras] = []

    def cameras(compiled: CompiledScenario) -> ProcessCameras:
        backends.append(process_cameras(compiled))
        return backends[0]

    return autodrive.make(spec, cameras=cameras), backends[0]


def has_ended(cameras: ProcessCameras, pid: int, *, is_last: bool) -> bool:
    """Whether that process has ended, and another one was started unless it was the last."""
    return bool(cameras.statistics.error) if is_last else cameras.process.pid not in (0, pid)


def has_images_since(simulation: Simulation, time: float) -> bool:
    images = simulation.frame.vehicles["V1"].cameras
    return bool(images) and all(image.time > time for image in images.values())


def test_kills_of_the_camera_process(spec: ScenarioSpec, gl: str, caplog: pytest.LogCaptureFixture) -> None:
    """While it starts, draws or waits."""
    rng = random.Random(0)

    def instance() -> int:
        world, cameras = made(spec)
        caplog.clear()
        with Simulation(world) as simulation:
            for death in range(RESTARTS + 1):
                if rng.random() < 0.7:
                    wait_until(lambda: simulation.frame.vehicles["V1"].cameras)
                wait_until(lambda: cameras.process.pid)
                pid, ticks = cameras.process.pid, simulation.ticks
                os.kill(pid, signal.SIGKILL)
                wait_until(lambda n=death, pid=pid: has_ended(cameras, pid, is_last=n == RESTARTS))
                wait_until(lambda ticks=ticks: simulation.ticks > ticks)
            wait_until(lambda: not simulation.frame.vehicles["V1"].cameras)
        world.close()
        logged = lines(caplog, render_process.__name__)
        assert [f"({n} of {RESTARTS})" in line for n, line in enumerate(logged, 1)] == [*[True] * RESTARTS, False]
        assert logged[-1] == cameras.statistics.error
        assert f"{RESTARTS + 1} times in an hour, now with SIGKILL" in logged[-1]
        return RESTARTS + 1

    attack(instance)


@pytest.fixture
def kill_at_once(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bool], None]]:
    """Sets whether a worker that has not answered yet is killed; otherwise only after the time that users wait."""
    usual = render_process.ANSWER_TIME
    monkeypatch.setattr(render_process, "WATCH_PERIOD", 0.01)

    def kill(at_once: bool) -> None:
        monkeypatch.setattr(render_process, "ANSWER_TIME", 0.0 if at_once else usual)

    yield kill
    kill(False)


def test_a_camera_process_that_hangs_is_started_again_and_at_last_it_is_said(
    spec: ScenarioSpec, gl: str, caplog: pytest.LogCaptureFixture, kill_at_once: Callable[[bool], None]
) -> None:
    world, cameras = made(spec)
    with Simulation(world) as simulation:
        for hang in range(RESTARTS + 1):
            now = simulation.frame.time
            wait_until(lambda now=now: has_images_since(simulation, now))
            pid = cameras.process.pid
            os.kill(pid, signal.SIGSTOP)
            ticks = simulation.ticks
            wait_until(lambda ticks=ticks: simulation.ticks > ticks + 5)
            kill_at_once(True)
            wait_until(lambda n=hang, pid=pid: has_ended(cameras, pid, is_last=n == RESTARTS))
            kill_at_once(False)
            assert not is_alive(pid)
    world.close()
    logged = lines(caplog, render_process.__name__)
    assert len(logged) == RESTARTS + 1
    assert all("the process stopped answering and was killed" in line for line in logged)


# -- scene cameras of clients ---------------------------------------------------------------------------------------


def test_kills_of_the_scene_process(spec: ScenarioSpec, gl: str, caplog: pytest.LogCaptureFixture) -> None:
    """While it draws or waits; the image comes all the same."""
    world, rng = autodrive.make(spec), random.Random(0)

    def instance() -> int:
        scene = scene_renderer_factory()(world)
        first = scene.draw(1, VIEW, world.frame).result(LIMIT).answer
        caplog.clear()
        for death in range(RESTARTS + 1):
            image = None
            if rng.random() < 0.5:
                os.kill(scene.process.pid, signal.SIGSTOP)
                image = scene.draw(1, VIEW, world.frame)
                wait_until(image.running)
            os.kill(scene.process.pid, signal.SIGKILL)
            image = image or scene.draw(1, VIEW, world.frame)
            if death < RESTARTS:
                assert image.result(LIMIT).answer == first
            else:
                with pytest.raises(AutodriveError, match=f"{RESTARTS + 1} times in an hour, now with SIGKILL"):
                    image.result(LIMIT)
        scene.close()
        logged = lines(caplog, render_process.__name__)
        assert [f"({n} of {RESTARTS})" in line for n, line in enumerate(logged, 1)] == [*[True] * RESTARTS, False]
        assert logged[-1] == scene.process.error
        return RESTARTS + 1

    attack(instance)


def test_a_scene_process_that_hangs_is_killed_and_the_image_comes_from_a_new_one(
    spec: ScenarioSpec, gl: str, caplog: pytest.LogCaptureFixture, kill_at_once: Callable[[bool], None]
) -> None:
    world = autodrive.make(spec)
    scene = scene_renderer_factory()(world)
    first = scene.draw(1, VIEW, world.frame).result(LIMIT).answer
    pid = scene.process.pid
    os.kill(pid, signal.SIGSTOP)
    image = scene.draw(1, VIEW, world.frame)
    wait_until(image.running)
    kill_at_once(True)
    wait_until(lambda: scene.process.pid not in (0, pid))
    kill_at_once(False)
    assert image.result(LIMIT).answer == first
    scene.close()
    (line,) = lines(caplog, render_process.__name__)
    assert f"(the process stopped answering and was killed); a new process is started (1 of {RESTARTS})" in line


def test_a_process_that_never_gets_ready_is_killed(
    spec: ScenarioSpec, gl: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """At each of its starts."""
    monkeypatch.setattr(render_process, "WATCH_PERIOD", 0.01)
    monkeypatch.setattr(render_process, "START_TIME", 0.0)
    world, cameras = made(spec)
    assert not cameras.process.wait(LIMIT)
    wait_until(lambda: cameras.statistics.error)
    assert "the process stopped answering and was killed" in cameras.statistics.error
    world.step()
    world.close()
