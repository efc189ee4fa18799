"""The start screen: before the simulator is ready, on a phone, with keys, and as the list of all scenarios."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.native import Starting
from autodrive.run.included_driver import IncludedDriver
from autodrive.run.options import RunOptions
from autodrive.run.world_loader import WorldLoader
from autodrive.scenario.kinds import names
from autodrive.world.simulation import Simulation
from tests.page.test_axe import SIZES, axe, check
from tests.support.page import NewTab, PageServer, Tab, box
from tests.support.stills import FOLDER, SHOTS, SIZE

__all__ = ["axe"]

CARDS = "town", "rain", "race", "park", "build", "open"
STARTING = Starting("loading the world", scenario="traffic", has_start_screen=True)


@pytest.fixture(scope="module")
def chosen_later() -> Iterator[Served]:
    """A simulator that was started without a scenario; the small scenario of the test is behind the start screen."""
    loader = WorldLoader(RunOptions("plane", has_start_screen=True))
    simulation = Simulation(loader.load("plane"), load=loader.load)
    loader.follow(simulation)
    driver = IncludedDriver(simulation)
    simulation.add_sink(driver)
    with simulation:
        yield Served(
            simulation,
            loader.scenery,
            scenarios={name: name for name in names("scenario")},
            has_start_screen=lambda: loader.has_start_screen,
            let_drive=driver.let_drive,
        )
    simulation.world.close()


@contextmanager
def offering(served: Served, built: Path) -> Iterator[SimulationServer]:
    """Serves it to one test, as if nobody had chosen a scenario yet."""
    with SimulationServer(None, PageOptions(port=0), page=built) as server:
        server.starting = STARTING
        yield server


def focused(tab: Tab) -> str:
    return tab.page.evaluate("() => document.activeElement.dataset.testid")


@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("size", list(SIZES))
def test_the_cards_are_there_while_the_simulator_starts(
    built: Path, new_tab: NewTab, axe: str, size: str, scheme: str
) -> None:
    with SimulationServer(None, PageOptions(port=0), page=built) as server:
        server.starting = STARTING
        tab = new_tab(size=SIZES[size], touch=size == "phone", is_first_visit=True)
        tab.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")  # pyright: ignore[reportArgumentType]
        tab.page.goto(server.url, wait_until="domcontentloaded")
        tab.get("start").wait_for(state="visible")
        tab.wait_for_text("banner", "Loading the world.")
        assert tab.get("banner").is_visible()
        for name in CARDS:
            card = tab.get(f"start-{name}")
            tab.wait_until(
                lambda card=card: card.locator("img").evaluate("(image) => image.complete && image.naturalWidth") == 640
            )
            card.scroll_into_view_if_needed()
            edges = box(card)
            assert 0 <= edges["left"] < edges["right"] <= SIZES[size][0], name
        assert tab.get("start").evaluate("(start) => start.scrollWidth <= start.clientWidth")
        check(tab, axe, f"start screen, {size}, {scheme}")


def test_a_card_that_is_chosen_early_is_entered_when_the_simulator_is_ready(
    chosen_later: Served, built: Path, new_tab: NewTab
) -> None:
    with offering(chosen_later, built) as server:
        tab = new_tab(size=(1280, 720), is_first_visit=True)
        tab.page.goto(server.url + "?quality=low", wait_until="domcontentloaded")
        tab.get("start").wait_for(state="visible")
        assert tab.get("still").evaluate("(still) => still.style.backgroundImage").count("traffic-")
        assert focused(tab) == "start-town"
        for key, name in (("ArrowRight", "rain"), ("ArrowDown", "build"), ("ArrowLeft", "park"), ("ArrowUp", "town")):
            tab.page.keyboard.press(key)
            assert focused(tab) == f"start-{name}"
        tab.page.keyboard.press("ArrowDown")
        tab.page.keyboard.press("Enter")
        tab.get("start").wait_for(state="hidden")
        tab.wait_for_text("still-text", "Park follows…")
        assert tab.get("still").evaluate("(still) => still.style.backgroundImage").count("parking-")
        server.serve(chosen_later)
        tab.wait_until(lambda: tab.value("store.scene.value?.scenario") == "parking")
        tab.wait_until(lambda: tab.value("store.frame.value?.vehicles.V1?.is_autonomous") is False)
        tab.get("still").wait_for(state="hidden")
        assert tab.value("store.camera.value") == "Driver's Eye"
        assert tab.value("store.frame.value.scene_light")
        later = new_tab(is_first_visit=True).open(server.url + "?quality=low")  # somebody has chosen
        assert later.get("start").is_hidden()
        later.wait_until(lambda: later.get("hud").count() == 1)


def test_the_scene_turns_behind_the_start_screen_and_esc_leaves_it(
    chosen_later: Served, built: Path, new_tab: NewTab
) -> None:
    served = replace(chosen_later, has_start_screen=lambda: True)
    with SimulationServer(served, PageOptions(port=0), page=built) as server:
        tab = new_tab(size=(1280, 720), is_first_visit=True).open(server.url + "?quality=low")
        tab.get("start").wait_for(state="visible")
        tab.get("still").wait_for(state="hidden")  # the scene is drawn behind it
        place = "view.screenPoint(0, 0, 0)"
        before = tab.value(place)
        tab.wait_until(lambda: tab.value(place) != before)
        assert not tab.get("menu-button").is_visible()
        tab.page.keyboard.press("Escape")
        tab.get("start").wait_for(state="hidden")
        assert not tab.value("store.isTurning.value")
        tab.page.wait_for_timeout(1000)
        assert "start" not in tab.page.url  # a reload offers the cards again, until somebody has chosen
        assert "camera" not in tab.page.url
        linked = new_tab(is_first_visit=True).open(server.url + "?quality=low#camera=orbit")
        linked.wait_until(lambda: linked.get("hud").count() == 1)
        assert linked.get("start").is_hidden()


def test_the_simulator_drives_a_watched_card_until_the_user_takes_the_wheel(
    chosen_later: Served, built: Path, new_tab: NewTab
) -> None:
    served = replace(chosen_later, has_start_screen=lambda: True)
    simulation = served.simulation
    with SimulationServer(served, PageOptions(port=0), page=built) as server:
        tab = new_tab(size=(1280, 720), is_first_visit=True).open(server.url + "?quality=low")
        tab.click("start-park-watch")
        tab.get("watch").wait_for(state="visible")
        assert "Press W to take the wheel" in tab.text("watch")
        tab.wait_until(lambda: simulation.frame.vehicles["V1"].speed > 0.15)
        assert simulation.frame.vehicles["V1"].is_autonomous
        tab.page.keyboard.down("s")
        tab.get("watch").wait_for(state="hidden")
        tab.wait_until(lambda: simulation.frame.vehicles["V1"].speed < -0.05)
        tab.page.keyboard.up("s")
        assert not simulation.frame.vehicles["V1"].is_autonomous


def test_the_menu_opens_the_list_of_all_scenarios(plane: PageServer, tab: Tab) -> None:
    tab.show("menu")
    tab.click("all-scenarios")
    tab.get("start").wait_for(state="visible")
    shown = tab.get("start-scenarios").locator("button")
    assert shown.count() == len(names("scenario"))
    assert tab.get("start-scenario-plane").get_attribute("aria-current") == "true"
    tab.page.keyboard.press("w")  # does not drive
    assert plane.vehicle.throttle == 0.0
    tab.click("start-scenario-two_cars")
    tab.get("start").wait_for(state="hidden")
    tab.wait_until(lambda: plane.scenario() == "two_cars")
    tab.wait_until(lambda: tab.value("store.scene.value.scenario") == "two_cars")
    assert tab.text("note") == ""


def test_each_scenario_has_a_still_picture_and_all_are_small() -> None:
    files = {file.stem: file for file in FOLDER.glob("*.webp")}
    assert files.keys() == SHOTS.keys() == {*names("scenario"), "build"}
    assert sum(file.stat().st_size for file in files.values()) < 250_000
    for file in files.values():
        with Image.open(file) as picture:
            assert picture.size == SIZE
