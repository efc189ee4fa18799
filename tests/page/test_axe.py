"""The accessibility rules of axe-core in each state of the page, and the page without eyes or without a mouse."""

from __future__ import annotations

import re
import subprocess

import pytest

from autodrive.protocol.messages import EditMap, MapModule
from autodrive.recording.replay import Replay
from tests.page.test_replay import drive, replay
from tests.page.test_screens import SHOW_CARDS
from tests.support.page import ROOT, NewTab, PageServer, Tab, overlap

__all__ = ["drive", "replay"]

SIZES = {"screen": (1280, 720), "phone": (390, 844)}

FINDINGS = """async () => (await axe.run(document)).violations.flatMap(({ id, nodes }) =>
    nodes.map(({ target, failureSummary }) => [id, target.join(' '), failureSummary].join(': ')))"""


@pytest.fixture(scope="module")
def axe() -> str:
    """The program, from the npm packages of the tests."""
    subprocess.run([ROOT / "scripts" / "page", "--install"], check=True, cwd=ROOT, timeout=300)
    return (ROOT / "web" / "node_modules" / "axe-core" / "axe.min.js").read_text()


def check(tab: Tab, axe: str, state: str) -> None:
    tab.page.evaluate(axe)
    assert tab.page.evaluate(FINDINGS) == [], state


@pytest.mark.parametrize("name", list(SIZES))
def test_axe_finds_nothing_in_any_state(two_cars: PageServer, new_tab: NewTab, axe: str, name: str) -> None:
    tab = new_tab(size=SIZES[name], touch=name == "phone", is_first_visit=True).open(f"{two_cars.url}?quality=low")
    tab.page.emulate_media(reduced_motion="reduce")
    tab.wait_until(lambda: tab.get("hud").count() == 1)
    check(tab, axe, "start")
    tab.click("help")
    check(tab, axe, "help")
    tab.click("help-close")
    tab.show("menu", tab="programs")
    tab.click("programs")
    check(tab, axe, "programs")
    tab.click("connect-close")
    tab.get("bridge").locator("summary").click()
    check(tab, axe, "bridge")
    for panel, part in (("menu", "view"), ("menu", "scenario"), ("hud", "scenario")):
        tab.show(panel, tab=part)
        tab.page.evaluate(SHOW_CARDS)
        if panel == "hud":
            tab.get("hud-more").locator("summary").first.click()
        tab.page.evaluate("() => { autodrive.store.isMeasuring.value = autodrive.store.isDescribed.value = true }")
        check(tab, axe, panel)
    tab.page.evaluate("() => { autodrive.store.warning.value = 'a warning' }")
    tab.show()
    tab.click("edit-button")
    if not tab.get("edit").is_visible():
        tab.click("edit-details")
    check(tab, axe, "Edit mode")
    tab.click("build-button")
    two_cars.request(EditMap({"a": MapModule("straight_road", 3.0, 3.0)}))
    tab.wait_until(lambda: tab.value("store.scene.value.map_scene.problems.length") == 2)
    if not tab.get("build").is_visible():
        tab.click("build-details")
    check(tab, axe, "Build mode")
    tab.click("edit-button")
    tab.click("edit-save")
    check(tab, axe, "save")


def test_axe_finds_nothing_in_a_race_and_in_a_replay(
    race: PageServer, replay: Replay, new_tab: NewTab, axe: str
) -> None:
    for url in (race.url, replay.server.url):
        tab = new_tab(size=(1280, 720)).open(f"{url}?quality=low#hud=1&log=1&map=1")
        tab.wait_until(lambda tab=tab: tab.get("hud").count() == 1)
        tab.show("menu", "hud")
        if url is not race.url and tab.get("timeline-plot").is_visible():
            tab.click("timeline-plot")
        check(tab, axe, url)


def test_a_lost_server_is_named_in_a_whole_sentence_and_what_is_shown_is_marked_as_old(
    plane: PageServer, new_tab: NewTab, axe: str
) -> None:
    with plane.with_token("open-sesame-0123") as server:
        tab = new_tab(size=(1280, 720), expects="/ws?").open(f"{server.url}&quality=low#hud=1")
        tab.wait_until(lambda: tab.get("hud").count() == 1)
        tab.wait_for_image()  # the scene is loaded
    tab.wait_until(lambda: tab.get("banner").is_visible())
    assert re.search(r"The page tries to connect again\. The image and the HUD are those of 00:0", tab.text("banner"))
    line = tab.get("banner").locator("span")
    assert line.evaluate("(line) => line.scrollWidth <= line.clientWidth")
    assert tab.text("hud-old").startswith("Old values, of 00:0")
    for width in (1280, 1100, 720):
        tab.page.set_viewport_size({"width": width, "height": 720})
        assert not overlap(tab.get("banner"), tab.get("hud-old")), width
    tab.page.set_viewport_size({"width": 1280, "height": 720})
    assert "grayscale" in tab.page.locator("#scene").evaluate("(scene) => getComputedStyle(scene).filter")
    assert tab.page.locator("#scene").bounding_box() == {"x": 0, "y": 0, "width": 1280, "height": 720}
    check(tab, axe, "lost")
