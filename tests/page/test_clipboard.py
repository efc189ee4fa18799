"""Copying over plain http from another machine, where browsers have no `navigator.clipboard`."""

from __future__ import annotations

import pytest

from autodrive.protocol.messages import EditMap, MapModule
from tests.support.page import ELSEWHERE, NewTab, PageServer, Tab

TOKEN = "a-token-of-the-course"


def pasted(tab: Tab) -> str:
    """What the clipboard has, pasted by the keys of the user."""
    tab.page.evaluate("() => document.body.append(Object.assign(document.createElement('textarea'), { id: 'paste' }))")
    tab.page.locator("#paste").focus()
    tab.page.keyboard.press("Control+v")
    text = tab.page.locator("#paste").input_value()
    tab.page.evaluate("() => document.getElementById('paste').remove()")
    return text


@pytest.mark.parametrize("is_permitted", [True, False])
def test_the_link_of_a_map_is_copied_over_plain_http(plane: PageServer, new_tab: NewTab, is_permitted: bool) -> None:
    plane.request(EditMap({"road": MapModule("straight_road", 0.0, 1.0, open=True)}))
    with plane.with_token(TOKEN) as server:
        tab = new_tab(size=(1000, 640)).open(f"http://{ELSEWHERE}:{server.port}/?token={TOKEN}&quality=low")
        assert tab.page.evaluate("() => !isSecureContext && navigator.clipboard === undefined")
        if not is_permitted:  # as where the settings of a browser forbid it
            tab.page.evaluate("() => { document.execCommand = () => false }")
        tab.click("build-button")
        tab.click("build-save")
        tab.get("save-kind").select_option("link")
        tab.click("save-map-save")
        tab.click("link-copy")
        if is_permitted:
            tab.wait_until(lambda: tab.get("link-copy").get_attribute("data-copied") == "true")
        else:
            tab.wait_for_text("link-copy", "Press Ctrl-C to copy the selected text")
            tab.page.keyboard.press("Control+c")
        link = tab.get("map-link").text_content()
        tab.click("link-dialog-cancel")
        assert link
        assert pasted(tab) == link
