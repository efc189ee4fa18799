"""The first visit: the bar and closed panels, and the programs that the page offers to copy."""

from __future__ import annotations

import itertools
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from autodrive.protocol.messages import Pause, Resume
from tests.support.page import NewTab, PageServer, Tab, box


def test_the_first_visit_shows_the_scene_below_one_bar(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1280, 720), is_first_visit=True).open(f"{plane.url}?quality=low")
    tab.wait_until(lambda: tab.get("hud").count() == 1)
    for panel in ("menu", "hud", "log", "minimap"):
        assert not tab.get(panel).is_visible(), panel
    bar = tab.page.locator(".toolbar")
    assert box(bar) == {"left": 0, "top": 0, "right": 1280, "bottom": 44}
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: plane.vehicle.speed > 0.05)
    tab.wait_until(lambda: tab.text("bar-speed") not in {"0.00 m/s", ""})
    assert tab.text("bar-gear") == "D"
    tab.page.keyboard.up("w")
    tab.click("bar-mode")
    tab.wait_until(lambda: plane.vehicle.is_autonomous)
    tab.wait_for_text("bar-mode", "Autonomous")
    tab.click("bar-camera")
    tab.wait_for_text("bar-camera", "Bird's Eye")
    tab.get("bar-weather").select_option("heavy_rain")
    tab.wait_until(lambda: plane.frame.weather is not None and plane.frame.weather.rain > 0.5)
    tab.click("bar-reset")
    tab.wait_until(lambda: not plane.vehicle.is_autonomous and plane.vehicle.pose.position[0] < 0.01)
    tab.wait_until(lambda: tab.get("bar-weather").input_value() == "sunny")
    tab.page.keyboard.press("p")
    tab.get("paused").wait_for(state="visible")
    plane.request(Resume())


def test_the_bar_has_one_row_on_each_screen(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1280, 720)).open(f"{plane.url}?quality=low")
    plane.request(Pause())  # its longest state
    tab.get("paused").wait_for(state="visible")
    for width in (1920, 1280, 1024, 820, 640, 390):
        tab.page.set_viewport_size({"width": width, "height": 720})
        controls = tab.page.locator(".toolbar :is(button, select):visible")
        places = [box(control) for control in controls.all()]
        assert len(places) >= 9, width
        assert all(place["left"] >= 0 and place["right"] <= width for place in places), width
        assert all(a["right"] <= b["left"] for a, b in itertools.pairwise(places)), width
    plane.request(Resume())


def snippet(tab: Tab, language: str) -> str:
    tab.get("language").get_by_role("button", name=language, exact=True).click()
    return tab.get("snippet").text_content() or ""


@pytest.mark.process
def test_the_python_program_that_is_copied_drives(plane: PageServer, new_tab: NewTab, tmp_path: Path) -> None:
    with plane.with_token("open-sesame-0123") as server:
        tab = new_tab(size=(390, 844)).open(f"{server.url}&quality=low")
        tab.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        tab.show("menu", tab="programs")
        tab.click("programs")
        tab.click("copy")
        tab.wait_until(lambda: tab.get("copy").get_attribute("data-copied") == "true")
        program = tab.page.evaluate("() => navigator.clipboard.readText()")
        assert program == snippet(tab, "Python")
        file = tmp_path / "drive.py"
        file.write_text(program)
        with subprocess.Popen([sys.executable, file], stdout=subprocess.DEVNULL) as process:
            tab.wait_until(lambda: plane.vehicle.speed > 0.1 and plane.vehicle.is_autonomous)
            tab.wait_until(lambda: tab.value("store.status.value.drivers") == {"V1": "drive.py"})
            process.kill()
        port = urlsplit(server.url).port
        assert f'autodrive::Client simulator("127.0.0.1", {port}, "open-sesame-0123");' in snippet(tab, "C++")
        assert f"host:=127.0.0.1 port:={port} token:=open-sesame-0123" in snippet(tab, "ROS 1")
        assert f"-p host:=127.0.0.1 -p port:={port} -p token:=open-sesame-0123" in snippet(tab, "ROS 2")
        compile(snippet(tab, "Devkit"), "devkit.py", "exec")
        dialog = box(tab.get("connect-dialog"))
        assert dialog["left"] >= 0
        assert dialog["right"] <= 390
        tab.click("connect-close")
