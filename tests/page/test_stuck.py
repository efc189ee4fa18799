"""After a crash the page offers a Reset; names of vehicles are there where they help."""

from __future__ import annotations

from autodrive.protocol.messages import Pause, Resume, Teleport
from tests.support.page import NewTab, PageServer


def test_a_crash_offers_a_reset(two_cars: PageServer, new_tab: NewTab) -> None:
    """V1 drives against the wall around the map, and stands there."""
    tab = new_tab(size=(1280, 720)).open(f"{two_cars.url}?quality=low#hud=1")
    start = two_cars.vehicle.pose.position.copy()
    two_cars.request(Teleport("V1", two_cars.simulation.world.map.bounds[2] - 0.4, 0.0))
    tab.page.keyboard.down("w")
    tab.get("crash-hint").wait_for(state="visible")
    assert "V1 does not move after the crash" in tab.text("crash-hint")
    assert tab.text("hud-last-collision").endswith(" N s")
    tab.page.keyboard.up("w")
    tab.click("crash-reset")
    tab.wait_until(lambda: abs(two_cars.vehicle.pose.position - start).max() < 0.02)
    tab.get("crash-hint").wait_for(state="hidden")


def test_names_of_vehicles_are_shown_where_they_help(two_cars: PageServer, new_tab: NewTab) -> None:
    tab = new_tab().open(f"{two_cars.url}?quality=low")
    names = tab.page.locator(".vehicle-labels > *:visible")
    two_cars.request(Pause())
    tab.wait_until(lambda: names.all_inner_texts() == ["V2"])  # Driver's Eye: not the own car
    tab.value("store.camera.value = 'Orbit'")
    tab.wait_until(lambda: sorted(names.all_inner_texts()) == ["V1", "V2"])
    tab.value("store.areLabelsShown.value = false")
    tab.wait_until(lambda: names.count() == 0)
    two_cars.request(Resume())
