"""Driving with real keys; the Frames of the simulator show the effect. Rules of keys: web/tests/driving.test.ts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tests.support.page import NewTab, PageServer, Tab

if TYPE_CHECKING:
    from playwright.sync_api import Route


def yaw(server: PageServer) -> float:
    """Heading of the first vehicle [rad]."""
    w, x, y, z = server.vehicle.pose.orientation
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def test_held_keys_drive_and_steer_the_vehicle(plane: PageServer, tab: Tab) -> None:
    keyboard = tab.page.keyboard
    keyboard.down("w")
    keyboard.down("ArrowLeft")
    tab.wait_until(lambda: plane.vehicle.pose.position[0] > 0.1 and yaw(plane) > 0.1)
    assert plane.vehicle.throttle > 0
    assert plane.vehicle.steering > 0  # left is positive
    keyboard.up("w")
    keyboard.up("ArrowLeft")
    tab.wait_until(lambda: plane.vehicle.throttle == 0 and abs(plane.vehicle.steering) < 0.01)
    tab.wait_until(lambda: abs(plane.vehicle.speed) < 0.01)  # zero throttle brakes
    keyboard.down("s")
    tab.wait_until(lambda: plane.vehicle.speed < -0.05)
    keyboard.up("s")
    tab.wait_until(lambda: plane.vehicle.throttle == 0)


def test_the_vehicle_stops_when_the_page_loses_the_focus(plane: PageServer, tab: Tab) -> None:
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: plane.vehicle.throttle > 0.5)
    tab.page.evaluate("() => window.dispatchEvent(new Event('blur'))")
    tab.wait_until(lambda: plane.vehicle.throttle == 0)
    tab.page.keyboard.up("w")


def test_one_of_two_pages_drives_until_it_is_closed(plane: PageServer, new_tab: NewTab) -> None:
    first, second = (new_tab(size=(320, 240)).open(plane.url + "?quality=low") for _ in range(2))
    name = first.value("store.welcome.value.name")
    first.page.keyboard.down("w")
    second.wait_until(lambda: second.value("store.frame.value.vehicles.V1.pose.position[0]") > 0.1)
    second.wait_until(lambda: second.value("store.status.value.drivers") == {"V1": name})
    second.page.keyboard.down("s")
    second.wait_for_notice("Another browser drives V1; V1 is free 2 s after the last key of that browser.")
    assert plane.vehicle.throttle > 0
    second.page.keyboard.up("s")
    first.page.close()
    second.wait_until(lambda: plane.vehicle.throttle == 0)
    second.wait_until(lambda: second.value("store.status.value.drivers") == {})
    second.page.keyboard.down("w")
    second.wait_until(lambda: second.value("store.status.value.drivers") != {} and plane.vehicle.throttle > 0)
    second.page.keyboard.up("w")


BUSY = """
const frame = window.requestAnimationFrame.bind(window)
window.requestAnimationFrame = (draw) => frame((time) => {
    if (window.isBusy) {
        window.isBusy = false
        const wait = new XMLHttpRequest()
        wait.open('GET', 'busy', false)  // blocks the page until the test answers
        wait.send()
    }
    draw(time)
})
"""


def test_a_page_that_hangs_does_not_drive_on(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(320, 240), draws=True, script=BUSY).open(plane.url + "?quality=low")
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: plane.vehicle.throttle == 1)
    hanging: list[Route] = []

    def hold(route: Route) -> None:
        hanging.append(route)

    tab.page.route("**/busy", hold)
    tab.page.evaluate("() => { window.isBusy = true }")
    tab.wait_until(lambda: hanging)
    tab.wait_until(lambda: plane.vehicle.throttle == 0)
    hanging[0].fulfill(body="")
    tab.wait_until(lambda: plane.vehicle.throttle > 0)  # the key is still held
    tab.page.keyboard.up("w")
    tab.wait_until(lambda: plane.vehicle.throttle == 0)
