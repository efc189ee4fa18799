"""The process that draws: its protocol, how it ends, and the choice of quality."""

from __future__ import annotations

import subprocess
import sys

import pytest

from autodrive.base.child_process import popen_options
from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.adaptive_renderer import TRIAL, is_too_slow
from autodrive.graphics.cameras.render_process import RenderProcess
from autodrive.graphics.cameras.render_worker import CameraImages, Jpeg
from autodrive.graphics.cameras.viewpoints import birds_eye
from autodrive.graphics.render.quality import PROFILES
from autodrive.world import World
from autodrive.world.views.cameras import scene_rig
from tests.support.waiting import LIMIT, is_alive, wait_until

VIEW = Jpeg(birds_eye((0.0, 0.0, 0.0), 2.0).view(160, 90))


@pytest.mark.process
def test_an_exception_while_drawing_fails_this_and_all_later_requests_with_one_line(gl: str, world: World) -> None:
    process = RenderProcess(scene_rig(world), "cameras")
    assert process.draw(1, world.frame, VIEW).result(LIMIT).seconds > 0.0
    no_such_camera = CameraImages(0, [5], (0, 0))
    with pytest.raises(AutodriveError, match=r"^cameras are unavailable: IndexError: [^\n]*$"):
        process.draw(1, world.frame, no_such_camera).result(LIMIT)
    assert process.pid == 0
    with pytest.raises(AutodriveError, match="IndexError"):
        process.draw(1, world.frame, VIEW).result(LIMIT)
    process.close()


@pytest.mark.process
def test_without_a_python_to_start_requests_fail_with_the_reason(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/no/such/python")
    process = RenderProcess(scene_rig(world), "cameras")
    process.start()
    assert not process.wait(LIMIT)
    assert process.error == "cameras are unavailable: their process cannot be started: No such file or directory"
    process.close()


@pytest.mark.process
def test_if_the_simulator_is_killed_the_process_ends_too() -> None:
    program = (
        "import time, autodrive\n"
        "from autodrive.graphics.cameras.render_process import RenderProcess\n"
        "from autodrive.world.views.cameras import scene_rig\n"
        "process = RenderProcess(scene_rig(autodrive.make('plane')), 'cameras')\n"
        "process.start()\nprocess.wait()\n"
        "print(process.pid, flush=True)\ntime.sleep(1000)"
    )
    simulator = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert simulator.stdout is not None
    with simulator.stdout as stdout:
        pid = int(stdout.readline())
    assert is_alive(pid)
    simulator.kill()
    simulator.wait()
    wait_until(lambda: not is_alive(pid))


def test_popen_options_by_platform() -> None:
    assert popen_options("linux") == popen_options("darwin") == {"start_new_session": True}
    if sys.platform == "win32":
        flags = subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.BELOW_NORMAL_PRIORITY_CLASS
    else:  # the documented values of these flags
        flags = 0x00000200 | 0x00004000
    assert popen_options("win32") == {"creationflags": flags}


@pytest.mark.parametrize(
    ("drawn", "draw_time", "period", "count", "expected"),
    [
        ("software-fxaa", 0.050, 1 / 30, TRIAL, True),
        ("software-fxaa", 0.050, 1 / 30, TRIAL - 1, False),  # too few to decide
        ("software-fxaa", 0.020, 1 / 30, TRIAL, False),
        ("software-fxaa", 0.020, 0.0, TRIAL, True),  # as fast as possible
        ("software", 0.050, 1 / 30, TRIAL, False),  # edges are not smoothed any more
        ("gpu", 0.050, 1 / 30, TRIAL, False),
    ],
)
def test_edges_are_not_smoothed_where_that_takes_longer_than_the_period(
    drawn: str, draw_time: float, period: float, count: int, expected: bool
) -> None:
    assert is_too_slow(PROFILES[drawn], [draw_time] * count, period) == expected
