"""`autodrive run` with cameras: rendering, images for a script, behaviour without OpenGL."""

from __future__ import annotations

import base64
import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
import simplejpeg

from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.command_line import AUTODRIVE, call, interrupted_when, refused
from tests.support.waiting import LIMIT

from .test_cli import devkit

__all__ = ["devkit"]  # the fixture

RATE = load_vehicle("nigel").cameras["front"].rate


def summary_of(folder: Path, *arguments: str) -> tuple[dict[str, Any], str, str]:
    """Summary, stdout and stderr of a run."""
    done = call("run", "--headless", *arguments, "--summary", folder / "s.json")
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "s.json").read_text()), done.stdout, done.stderr


@pytest.mark.wall_clock  # images are rendered in real time
def test_a_script_receives_images_of_the_requested_size_that_are_rendered_asynchronously_and_counted(
    gl: str, devkit: tuple[int, list[dict[str, str]]], tmp_path: Path
) -> None:
    port, came = devkit
    keys = ("V1 Front Camera Image", "V1 Rear Camera Image")

    def have_come() -> bool:
        """The images of a car that drives differ."""
        return all(len({one.get(key) for one in came.copy()}) > 3 for key in keys)

    with interrupted_when(have_come):
        summary, text, _ = summary_of(tmp_path, "mini_map", "--devkit", f"127.0.0.1:{port}", "--image-size", "320x240")
    cameras = summary["cameras"]  # the default with --devkit
    assert (cameras["error"], cameras["drawn_in"], cameras["renderer"]) == (None, "process", gl)
    assert cameras["draw_time"] > 0.0
    for name in ("front", "rear"):
        taken = cameras["images"]["V1"][name]
        assert taken["count"] > 2
        assert taken["rate"] == pytest.approx(taken["count"] / summary["simulated_time"])
    assert f"cameras: V1 front {cameras['images']['V1']['front']['count']} images" in text
    for key in keys:
        picture = simplejpeg.decode_jpeg(base64.b64decode(came[-1][key]))
        assert picture.shape == (240, 320, 3)
        assert picture.std() > 5.0


@pytest.mark.slow
def test_in_lockstep_no_image_is_missing(gl: str, tmp_path: Path) -> None:
    summary, _, _ = summary_of(tmp_path, "mini_map", "--cameras", "--lockstep", "--speed", "max", "--duration", "0.3")
    assert RATE is not None
    assert summary["cameras"]["drawn_in"] == "tick"
    assert summary["cameras"]["images"]["V1"]["front"]["count"] == 0.3 * RATE + 1  # with those at 0 and 0.3 s


@pytest.mark.process
@pytest.mark.parametrize("how", ["--lockstep", "--no-lockstep"])
def test_without_opengl_a_run_continues_and_one_line_names_the_packages(how: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [*AUTODRIVE, "run", "mini_map", "--headless", "--cameras", how, "--duration", "0.2", "--summary", "s.json"],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        cwd=tmp_path,
        env={**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": os.devnull},
        check=True,
    )
    summary = json.loads((tmp_path / "s.json").read_text())
    assert summary["ticks"] == 20
    lines = [line for line in done.stderr.splitlines() if "apt-get install" in line]
    assert len(lines) == 1
    assert summary["cameras"]["error"] == lines[0]
    assert "cameras: unavailable" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--camera-quality", "best"), "camera quality 'best' is not known. Known: auto, software"),
        (("--image-size", "640"), "--image-size must be WxH in pixels, for example 640x480, not '640'"),
        (("--image-size", "0x480"), "--image-size must be WxH in pixels"),
        (("--image-quality", "0"), "Invalid value for '--image-quality'"),
    ],
)
def test_an_error_prints_one_line(arguments: tuple[str, ...], text: str) -> None:
    assert text in refused("run", "plane", "--cameras", *arguments)
