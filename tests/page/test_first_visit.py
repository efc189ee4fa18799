"""The hints of the first visit, and the programs that the page offers to copy."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.support.page import NewTab, PageServer, Tab, box


def test_the_first_visit_shows_hints_and_both_panels_on_a_wide_screen(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1280, 720), is_first_visit=True).open(f"{plane.url}?quality=low")
    for text in ("Drive", "Menu", "HUD", "Connect from Python"):
        assert text in tab.text("hints")
    for panel in ("menu", "hud"):
        tab.get(panel).wait_for(state="visible")
    tab.page.keyboard.down("w")  # the hints do not take the keys
    tab.wait_until(lambda: plane.vehicle.throttle > 0)
    tab.page.keyboard.up("w")
    tab.click("hints-close")
    assert tab.get("hints").is_hidden()
    tab.page.reload()
    tab.wait_until(lambda: tab.get("hints").count() == 1)
    assert tab.get("hints").is_hidden()
    tab.page.set_viewport_size({"width": 1024, "height": 768})
    tab.page.reload()
    tab.wait_until(lambda: tab.get("hud").count() == 1)
    assert not tab.get("menu").is_visible()
    assert not tab.get("hud").is_visible()


def snippet(tab: Tab, language: str) -> str:
    tab.get("language").get_by_role("button", name=language, exact=True).click()
    return tab.get("snippet").text_content() or ""


@pytest.mark.process
def test_the_python_program_that_is_copied_drives(plane: PageServer, new_tab: NewTab, tmp_path: Path) -> None:
    with plane.with_token("open-sesame-0123") as server:
        tab = new_tab(size=(390, 844), is_first_visit=True).open(f"{server.url}&quality=low")
        tab.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        tab.click("hints-connect")
        tab.click("copy")
        tab.wait_for_text("snippet-copied", "Copied")
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
