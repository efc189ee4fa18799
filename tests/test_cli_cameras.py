"""`autodrive run` with cameras, as people run it: what is drawn, sent to a script, and said where nothing can draw."""

from __future__ import annotations

import base64
import json
import os
from pathlib import Path
from typing import Any

import pytest
import simplejpeg

from autodrive.vehicles.spec import load_vehicle

from .test_cli import call, devkit, refused

__all__ = ["devkit"]  # the fixture

RATE = load_vehicle("nigel").cameras["front"].rate


def summary_of(folder: Path, *arguments: str, **environment: str) -> tuple[dict[str, Any], str, str]:
    """The summary of a run, what it says at its end, and its messages."""
    done = call("run", "--headless", *arguments, "--summary", folder / "s.json", **environment)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "s.json").read_text()), done.stdout, done.stderr


def test_pictures_are_drawn_beside_the_physics_and_told(gl: str, tmp_path: Path) -> None:
    summary, says, _ = summary_of(tmp_path, "mini_map", "--cameras", "--duration", "3")
    cameras = summary["cameras"]
    assert (cameras["fault"], cameras["drawn_in"], cameras["renderer"]) == (None, "process", gl)
    assert cameras["draw_time"] > 0.0
    for name in ("front", "rear"):
        taken = cameras["pictures"]["V1"][name]
        assert taken["count"] > 3
        assert taken["rate"] == pytest.approx(taken["count"] / 3.0)
    assert f"cameras: V1 front {cameras['pictures']['V1']['front']['count']} pictures" in says


def test_in_lockstep_there_is_every_picture(gl: str, tmp_path: Path) -> None:
    summary, _, _ = summary_of(tmp_path, "mini_map", "--cameras", "--lockstep", "--speed", "max", "--duration", "1")
    assert RATE is not None
    assert summary["cameras"]["drawn_in"] == "tick"
    assert summary["cameras"]["pictures"]["V1"]["front"]["count"] == int(RATE) + 1  # at 0 and at 1 s, too


def test_without_cameras_there_is_no_word_of_them(tmp_path: Path) -> None:
    summary, says, messages = summary_of(tmp_path, "mini_map", "--duration", "0.1", "--speed", "max")
    assert summary["cameras"] is None
    assert "camera" not in says + messages


@pytest.mark.parametrize("how", ["--lockstep", "--no-lockstep"])
def test_without_opengl_a_run_goes_on_and_one_line_says_what_to_install(how: str, tmp_path: Path) -> None:
    summary, says, messages = summary_of(
        tmp_path, "mini_map", "--cameras", how, "--duration", "0.5", __EGL_VENDOR_LIBRARY_FILENAMES=os.devnull
    )
    assert summary["ticks"] == 50
    lines = [line for line in messages.splitlines() if "apt-get install" in line]
    assert len(lines) == 1
    assert summary["cameras"]["fault"] == lines[0]
    assert "cameras: unavailable" in says


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--camera-quality", "best"), "camera quality 'best' is not known. Known: auto, software"),
        (("--image-size", "640"), "--image-size is WxH in pixels, for example 640x480, not '640'"),
        (("--image-size", "0x480"), "--image-size is WxH in pixels"),
        (("--image-quality", "0"), "Invalid value for '--image-quality'"),
    ],
)
def test_a_fault_is_one_clear_line(arguments: tuple[str, ...], says: str) -> None:
    assert says in refused("run", "plane", "--cameras", *arguments)


def test_a_script_gets_the_pictures_in_the_size_asked_for(
    gl: str, devkit: tuple[int, list[dict[str, str]]], tmp_path: Path
) -> None:
    port, came = devkit
    summary, _, _ = summary_of(
        tmp_path, "mini_map", "--devkit", f"127.0.0.1:{port}", "--duration", "4", "--image-size", "320x240"
    )
    assert summary["cameras"]["pictures"]["V1"]["front"]["count"] > 3  # who names a devkit wants pictures
    for key in ("V1 Front Camera Image", "V1 Rear Camera Image"):
        picture = simplejpeg.decode_jpeg(base64.b64decode(came[-1][key]))
        assert picture.shape == (240, 320, 3)
        assert picture.std() > 5.0
