"""Loading of the page: requests, size, drawing, other origins, reconnection."""

from __future__ import annotations

import time
from urllib.parse import urlsplit

import numpy as np

from autodrive.protocol.messages import Command, Headlights, Pause, SetSceneLight, Step
from tests.support.page import NewTab, PageServer, record
from tests.support.proxy import proxy

NO_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return kind.startsWith('webgl') ? null : getContext.call(this, kind, ...more)
}
"""


def test_page_loads_its_scene_from_the_simulator_only_and_draws_it(mini_map: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(draws=True)
    sizes: dict[str, int] = {}
    tools = tab.page.context.new_cdp_session(tab.page)
    tools.on("Network.loadingFinished", lambda it: sizes.update({it["requestId"]: int(it["encodedDataLength"])}))
    tools.send("Network.enable")
    start = time.monotonic()
    tab.open(mini_map.url)
    connected = time.monotonic() - start
    tab.wait_for_image()
    drawn = time.monotonic() - start
    assert tab.value("view.stats().profile") == "light"  # chosen for software rendering
    assert tab.page.title() == tab.text("title") == "AutoDRIVE Simulator"
    host = urlsplit(mini_map.url).netloc
    assert {urlsplit(url).netloc for url in tab.requests if not url.startswith(("data:", "blob:"))} == {host}
    assert 100_000 < sum(sizes.values()) <= 5_000_000
    record(f"mini_map: connected {connected:.2f} s, drawn {drawn:.2f} s, {sum(sizes.values())} bytes loaded")
    tab.wait_until(lambda: tab.pixels()[100:-50].std() > 0.03)  # not a single colour
    assert len(np.unique((tab.pixels() * 15).astype(int).reshape(-1, 3), axis=0)) > 20


def test_without_webgl_the_simulator_renders_the_scene(gl: str, plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(320, 240), script=NO_WEBGL, expects="WebGL").open(plane.url)
    tab.wait_until(lambda: tab.value("store.rendered.value !== null"))
    assert tab.value("store.quality.value") == "stream"
    tab.wait_until(lambda: tab.pixels()[100:-20].std() > 0.03)


def test_page_works_below_a_path_of_a_proxy_and_reconnects(plane: PageServer, new_tab: NewTab) -> None:
    dark = "localStorage.setItem('autodrive.theme', 'dark');"
    tab = new_tab(size=(320, 240), script=dark, expects="ERR_")
    with proxy(plane.server.port) as connection:
        tab.open(connection.url)
        tab.wait_for_image()
        assert tab.page.evaluate("() => document.documentElement.dataset.theme") == "dark"  # the saved preference
        assert all(request.startswith((connection.url, "data:", "blob:")) for request in tab.requests)
        tab.page.keyboard.down("w")
        tab.wait_until(lambda: plane.vehicle.speed > 0.02)
        connection.is_cut = True
        tab.get("banner").wait_for(state="visible")
        tab.wait_for_text("banner", "tries to connect again")
        tab.wait_until(lambda: plane.vehicle.throttle == 0)
        tab.page.keyboard.up("w")
        plane.restart("two_cars")
        connection.is_cut = False
        tab.get("banner").wait_for(state="hidden")
        tab.wait_until(lambda: tab.value("store.scene.value.scenario") == "two_cars")
        tab.page.keyboard.down("w")
        tab.wait_until(lambda: plane.vehicle.throttle > 0)
        tab.page.keyboard.up("w")


def test_token_of_the_link_is_used_for_all_requests(plane: PageServer, new_tab: NewTab) -> None:
    with plane.with_token("open-sesame-0123") as server:
        tab = new_tab(size=(320, 240), expects="403")
        bare = f"http://127.0.0.1:{server.port}/"
        for url in (bare, f"{bare}?token=wrong"):
            response = tab.page.goto(url)
            assert response is not None
            assert response.status == 403
            assert response.headers["content-type"].startswith("text/plain")
            assert "token" in (tab.page.text_content("body") or "")
        tab.open(f"{bare}?token=open-sesame-0123&quality=low")
        tab.wait_for_image()
        tab.page.keyboard.down("w")
        tab.wait_until(lambda: plane.vehicle.throttle > 0)
        tab.page.keyboard.up("w")


def test_two_vehicles_at_night_need_few_draw_calls_and_triangles(two_cars: PageServer, new_tab: NewTab) -> None:
    lit = Command(headlights=Headlights.HIGH)
    two_cars.request(SetSceneLight(False))
    two_cars.request(Pause())
    two_cars.request(Step(1, {"V1": lit, "V2": lit}))
    tab = new_tab(size=(320, 180)).open(f"{two_cars.url}?quality=high")
    for quality, profile in (("high", "high"), ("low", "light")):
        tab.page.evaluate(f"() => {{ autodrive.store.quality.value = '{quality}' }}")
        tab.wait_until(lambda profile=profile: tab.value("view && view.stats().profile") == profile)
        tab.wait_for_image()
        stats = tab.value("view.stats()")
        record(f"two_cars by night, {profile}: {stats['calls']} draw calls, {stats['triangles']} triangles")
        assert 0 < stats["calls"] <= 200
        assert 0 < stats["triangles"] <= 200_000
