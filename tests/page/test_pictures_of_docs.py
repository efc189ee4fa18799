"""The pictures of the documents show the bars of the present page: `scripts/pictures` notes the buttons of each."""

from __future__ import annotations

import json
import re
from pathlib import Path

import autodrive
from autodrive.connect.server.served import PageOptions
from autodrive.recording import Recorder
from autodrive.recording.replay import Replay, ReplayOptions
from docs.images.filmed_page import BUTTONS, HERE, SIDECAR
from tests.support.page import ROOT, NewTab, PageServer, Tab

SHOWN = json.loads(SIDECAR.read_text(encoding="utf-8"))


def check(tab: Tab, *pictures: str) -> None:
    present = tab.page.evaluate(BUTTONS)
    for picture in pictures:
        assert SHOWN.pop(picture) == present, f"scripts/pictures makes {picture} again"


def test_pictures_show_the_buttons_of_the_present_page(plane: PageServer, new_tab: NewTab, tmp_path: Path) -> None:
    tab = new_tab(size=(1280, 720)).open(plane.url + "?quality=low")
    check(tab, "page_day", "page_night", "overlays", "film")
    tab.click("build-button")
    tab.wait_until(lambda: tab.page.get_by_test_id("build-bar").is_visible())
    check(tab, "build")
    tab.page.get_by_test_id("build-start").evaluate("section => (section.open = true)")
    tab.click("track-new")
    tab.wait_until(lambda: tab.page.get_by_test_id("track-barrier").is_visible())
    check(tab, "build_track", "build_picture")
    file = tmp_path / "run.mcap"
    world = autodrive.make("plane")
    with Recorder(file, world, name="plane", has_meshes=False):
        world.step({})
    with Replay(file, ReplayOptions(is_paused=True, page=PageOptions(port=0))) as shown:
        tab.open(shown.server.url + "?quality=low")
        tab.wait_until(lambda: tab.page.get_by_test_id("timeline-bar").is_visible())
        check(tab, "replay")
    assert not SHOWN, "a picture that no state of the page is compared with"


def test_every_picture_of_the_documents_is_there_and_shown() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    named = set(re.findall(r"images/([\w]+\.(?:webp|png|webm|svg))", text))
    there = {file.name for file in HERE.iterdir() if file.suffix in (".webp", ".png", ".webm", ".svg")}
    assert named == there
