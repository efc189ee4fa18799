"""OpenGL contexts without a screen: EGL on Linux, and the default of moderngl, which other platforms use."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from autodrive.graphics.render.gl import GlUnavailable, is_software, open_context

ROOT = Path(__file__).parents[3]


def test_only_linux_uses_egl(monkeypatch: pytest.MonkeyPatch) -> None:
    options: list[dict[str, object]] = []

    def create_context(**passed: object) -> None:
        options.append(passed)
        raise OSError("no\n  display")

    monkeypatch.setattr("moderngl.create_context", create_context)
    for platform in ("linux", "darwin", "win32"):
        with pytest.raises(GlUnavailable, match=r"apt-get install.*\(no display\)"):
            open_context(platform)
    assert [one.get("backend") for one in options] == ["egl", None, None]
    assert all(one["standalone"] and one["require"] == 330 for one in options)


@pytest.mark.process
@pytest.mark.toolchain
def test_the_context_of_other_platforms_draws_on_linux_with_a_display(gl: str) -> None:
    """In another process, because OpenGL libraries stay loaded. On Linux the default of moderngl is GLX."""
    if not Path("/usr/bin/Xvfb").exists():
        pytest.skip("needs a display: Xvfb is not installed")
    read, write = os.pipe()
    command = ["/usr/bin/Xvfb", "-displayfd", str(write), "-screen", "0", "64x64x24"]
    display = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as number:
            environment = {**os.environ, "DISPLAY": f":{number.readline().strip()}"}
        program = (
            "from autodrive.graphics.render import gl\n"
            "gl.open_context.__defaults__ = ('darwin',)\n"
            "from autodrive.graphics.render.renderer import Renderer\n"
            "from tests.support.scenes import GREY, ground, node, render_state, scene, view\n"
            "world = scene(node('floor', ground(-6, -6, 6, 6), casts=False))\n"
            "with Renderer(world) as renderer:\n"
            "    image = renderer.draw(render_state(), [view(0, 0, 1, pitch_deg=90)])[0]\n"
            "    print(renderer.name, image.rgba[..., :3].mean() > 30, sep='\\n')\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True, check=True
        )
    finally:
        display.kill()
        display.wait()
    name, is_bright = done.stdout.splitlines()
    assert is_software(name) == is_software(gl)
    assert is_bright == "True"
