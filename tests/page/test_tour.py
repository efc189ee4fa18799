"""The tour of the first visit, by real input: each step ends when the user has done it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.page.test_edit import on_screen
from tests.support.page import NewTab, PageServer, Tab, box, overlap


def wait_for_step(tab: Tab, title: str) -> None:
    tab.wait_for_text("tour-title", title)


def is_vehicle_covered(tab: Tab) -> bool:
    """Whether the card is over the middle of the vehicle."""
    x, y, z = tab.value("Object.values(store.frame.value.vehicles)[0].pose.position")
    across, down = on_screen(tab, x, y, z + 0.05)
    card = box(tab.get("tour"))
    return card["left"] - 20 < across < card["right"] + 20 and card["top"] - 20 < down < card["bottom"] + 20


def test_all_steps_end_by_what_the_user_does(mini_map: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1280, 720), is_first_visit=True).open(f"{mini_map.url}?quality=low")
    keyboard = tab.page.keyboard
    wait_for_step(tab, "A tour of 60 seconds?")
    tab.wait_for_image()
    assert not is_vehicle_covered(tab)
    tab.click("tour-start")
    wait_for_step(tab, "Drive a metre")
    assert tab.get("tour").locator("kbd").all_text_contents()[:3] == ["W", "A", "D"]
    tab.page.wait_for_timeout(1500)
    assert tab.text("tour-title") == "Drive a metre", "it waits"
    start = mini_map.vehicle.pose.position

    def way() -> float:
        return float(np.linalg.norm(mini_map.vehicle.pose.position - start))

    keyboard.down("w")
    tab.wait_until(lambda: way() > 0.3)
    assert not is_vehicle_covered(tab)
    wait_for_step(tab, "Look from another camera")
    keyboard.up("w")
    assert way() > 0.9
    keyboard.press("c")
    wait_for_step(tab, "Let it rain")
    assert tab.value("store.camera.value") == "Bird's Eye"
    tab.get("bar-weather").select_option("heavy_rain")
    wait_for_step(tab, "Put a box on the road")
    boxes = len(mini_map.frame.objects)
    keyboard.press("j")
    tab.wait_until(lambda: tab.get("edit-add").is_visible())
    assert tab.text("tour-title") == "Put a box on the road"
    tab.click("edit-add")
    wait_for_step(tab, "Drive on")
    tab.wait_until(lambda: len(mini_map.frame.objects) == boxes + 1)
    keyboard.press("Escape")
    wait_for_step(tab, "Record")
    tab.click("record-button")
    wait_for_step(tab, "Stop the recording")
    assert tab.value("store.status.value.recording.state") == "recording"
    keyboard.down("w")
    tab.page.wait_for_timeout(500)
    keyboard.up("w")
    tab.click("record-button")
    wait_for_step(tab, "Replay it")
    tab.get("recorded-replay").wait_for()
    assert not overlap(tab.get("recorded"), tab.get("tour"))
    with tab.page.expect_popup() as replay:
        tab.click("recorded-replay")
    wait_for_step(tab, "That was the tour")
    replay.value.close()
    tab.click("tour-end")
    assert not tab.get("tour").is_visible()
    tab.page.reload()
    tab.wait_until(lambda: tab.value("store.frame.value !== null && store.status.value !== null"))
    assert not tab.get("tour").is_visible()


@pytest.mark.parametrize("size", [(1280, 720), (1024, 768), (390, 844)], ids=lambda size: "x".join(map(str, size)))
def test_the_tour_is_skipped_step_by_step_and_starts_again_from_the_help(
    plane: PageServer, new_tab: NewTab, size: tuple[int, int]
) -> None:
    is_touch = size != (1280, 720)
    tab = new_tab(size=size, touch=is_touch, is_first_visit=True).open(f"{plane.url}?quality=low")
    wait_for_step(tab, "A tour of 60 seconds?")
    tab.click("tour-no")
    assert not tab.get("tour").is_visible()
    tab.click("help")
    tab.click("help-tour")
    assert not tab.get("help-dialog").is_visible()
    titles = []
    while not tab.text("tour-title").startswith("That was"):
        titles.append(tab.text("tour-title"))
        card = box(tab.get("tour"))
        assert card["left"] >= 0
        assert card["right"] <= size[0]
        assert (card["right"] - card["left"]) * (card["bottom"] - card["top"]) < 0.25 * size[0] * size[1]
        assert ("pad" in tab.get("tour-text").inner_text()) == (is_touch and len(titles) in {1, 2, 5, 6})
        tab.click("tour-skip")
    assert titles == [
        *("Drive a metre", "Look from another camera", "Let it rain", "Put a box on the road", "Drive on"),
        *("Record", "Stop the recording", "Replay it"),
    ]
    tab.click("tour-programs")
    tab.get("connect-dialog").wait_for()
    assert not tab.get("tour").is_visible()
