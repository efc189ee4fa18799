"""The page while the simulator starts: it opens at once, says what is compiled, and continues without a reload."""

from __future__ import annotations

from pathlib import Path

import pytest

from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.native import Starting
from autodrive.run.runner import COMPILING
from autodrive.world.views.scene_files import SceneFiles
from tests.page.test_axe import SIZES, axe, check
from tests.support.page import NewTab, PageServer, box

__all__ = ["axe"]


@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("size", list(SIZES))
def test_the_page_says_what_the_simulator_compiles_until_it_has_a_world(
    plane: PageServer, built: Path, new_tab: NewTab, axe: str, size: str, scheme: str
) -> None:
    with SimulationServer(None, PageOptions(port=0), page=built) as server:
        tab = new_tab(size=SIZES[size], touch=size == "phone")
        tab.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")  # pyright: ignore[reportArgumentType]
        server.starting = Starting("loading the world")
        tab.page.goto(server.url, wait_until="domcontentloaded")
        tab.wait_for_text("banner", "Loading the world.")
        server.starting = Starting(COMPILING, 0.4, 62.0)
        tab.wait_for_text("banner", "at the first start: about a minute left.")
        bar, banner = tab.get("starting"), tab.get("banner")
        assert bar.evaluate("(bar) => [bar.value, bar.offsetWidth > 0]") == [0.4, True]
        assert box(banner)["left"] >= 0
        assert box(banner)["right"] <= SIZES[size][0]
        check(tab, axe, f"start, {size}, {scheme}")
        server.serve(Served(plane.simulation, lambda world: SceneFiles.of(world, "plane")))
        tab.wait_until(lambda: tab.value("store.link.value === 'open' && !!store.frame.value"))
        banner.wait_for(state="hidden")
        assert not tab.errors
