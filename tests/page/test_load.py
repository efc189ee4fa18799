"""The page loads: what it asks for, how much, how long it takes, and from where it works."""

from __future__ import annotations

import time
from urllib.parse import urlsplit

import numpy as np
import pytest

from autodrive.protocol.messages import Command, Headlights, Pause, SetSceneLight, Step
from tests.page.conftest import Visitor
from tests.page.proxy import proxy
from tests.page.visits import Served, note


def test_page_loads_its_scene_from_the_simulator_alone_and_draws_it(mini_map: Served, visitor: Visitor) -> None:
    visit = visitor(draws=True)
    sizes: dict[str, int] = {}
    tools = visit.page.context.new_cdp_session(visit.page)
    tools.on("Network.loadingFinished", lambda it: sizes.update({it["requestId"]: int(it["encodedDataLength"])}))
    tools.send("Network.enable")
    start = time.monotonic()
    visit.go(mini_map.url + "?quality=low")
    connected = time.monotonic() - start
    visit.until_drawn()
    drawn = time.monotonic() - start
    assert visit.page.title() == "AutoDRIVE Simulator"
    assert visit.text("title") == "AutoDRIVE Simulator"
    assert visit.get("menu-button").is_visible()
    assert visit.get("hud-button").is_visible()
    host = urlsplit(mini_map.url).netloc
    assert {urlsplit(url).netloc for url in visit.requests if not url.startswith(("data:", "blob:"))} == {host}
    assert 100_000 < sum(sizes.values()) <= 5_000_000
    note(f"mini_map: connected {connected:.2f} s, drawn {drawn:.2f} s, {sum(sizes.values())} bytes loaded")
    visit.until(lambda: visit.pixels(visit.page.locator("#scene"))[100:-100].std() > 0.03)  # not of one colour
    picture = visit.pixels(visit.page.locator("#scene"))
    assert len(np.unique((picture * 15).astype(int).reshape(-1, 3), axis=0)) > 20


def test_software_gl_is_drawn_with_the_light_profile(plane: Served, visitor: Visitor) -> None:
    visit = visitor().go(plane.url)
    visit.until(lambda: visit.knows("view"))
    assert visit.knows("view.stats().profile") == "light"


def test_where_there_is_no_webgl_the_simulator_draws_for_the_page(gl: str, plane: Served, visitor: Visitor) -> None:
    visit = visitor()
    visit.page.add_init_script("HTMLCanvasElement.prototype.getContext = ((of) => function (kind, ...more) { "
                               "return kind.startsWith('webgl') ? null : of.call(this, kind, ...more) })"
                               "(HTMLCanvasElement.prototype.getContext)")  # fmt: skip
    visit.errors.clear()
    visit.go(plane.url)
    visit.until(lambda: visit.knows("store.rendered.value !== null"))
    assert visit.knows("store.quality.value") == "stream"
    visit.until(lambda: visit.pixels(visit.page.locator("#scene"))[100:-100].std() > 0.03)
    visit.errors[:] = [error for error in visit.errors if "WebGL" not in error]


def test_page_works_behind_a_proxy_that_gives_it_a_folder(plane: Served, visitor: Visitor) -> None:
    with proxy(plane.server.port, "/lab/room-7/") as url:
        visit = visitor().go(url)
        visit.until_drawn()
        visit.page.keyboard.down("w")
        visit.until(lambda: plane.vehicle.speed > 0.05)
        visit.page.keyboard.up("w")
        assert all(request.startswith((url, "data:", "blob:")) for request in visit.requests)


@pytest.mark.parametrize("quality", ["low", "high"])
def test_picture_of_two_cars_costs_few_draw_calls_and_triangles(
    two_cars: Served, visitor: Visitor, quality: str
) -> None:
    lit = Command(headlights=Headlights.HIGH)
    two_cars.ask(SetSceneLight(False))
    two_cars.ask(Pause())
    two_cars.ask(Step(1, {"V1": lit, "V2": lit}))
    visit = visitor(size=(320, 180)).go(f"{two_cars.url}?quality={quality}")  # pixels cost time, and do not count here
    visit.until_drawn()
    stats = visit.knows("view.stats()")
    note(f"two_cars by night, {stats['profile']}: {stats['calls']} draw calls, {stats['triangles']} triangles")
    assert 0 < stats["calls"] <= 200
    assert 0 < stats["triangles"] <= 200_000
