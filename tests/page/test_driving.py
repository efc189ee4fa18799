"""A person drives with the keyboard (report, table 12), and the simulator's Frame is asked what came of it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser

from autodrive.protocol.messages import Command, Headlights, Indicators
from autodrive.protocol.native import Source
from tests.page.conftest import Visitor, visits_with
from tests.page.visits import Served, Visit, note


@pytest.fixture(scope="module")
def page(served: Served, browser: Browser) -> Iterator[Visit]:
    served.renew("plane")
    with visits_with(browser) as visitor:
        yield visitor().go(served.url + "?quality=low")


@pytest.fixture
def visit(plane: Served, page: Visit) -> Visit:
    """One for all, of a car at the start."""
    return page.until_begun(plane)


def heading(served: Served) -> float:
    """Yaw [rad]."""
    w, x, y, z = served.vehicle.pose.orientation
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


@pytest.mark.parametrize(("key", "sign"), [("w", 1), ("ArrowUp", 1), ("s", -1), ("ArrowDown", -1)])
def test_car_goes_forward_and_back_while_a_key_is_held(plane: Served, visit: Visit, key: str, sign: int) -> None:
    before = plane.vehicle.pose.position[0]
    visit.page.keyboard.down(key)
    visit.until(lambda: sign * (plane.vehicle.pose.position[0] - before) > 0.1)
    assert sign * plane.vehicle.throttle > 0
    visit.page.keyboard.up(key)
    visit.until(lambda: plane.vehicle.throttle == 0)
    visit.until(lambda: abs(plane.vehicle.speed) < 0.01)  # no throttle brakes


@pytest.mark.parametrize(("keys", "sign"), [(("w", "a"), 1), (("ArrowUp", "ArrowRight"), -1), (("w", "d", "a"), 0)])
def test_several_keys_at_once_steer_while_it_goes(
    plane: Served, visit: Visit, keys: tuple[str, ...], sign: int
) -> None:
    for key in keys:
        visit.page.keyboard.down(key)
    visit.until(lambda: plane.vehicle.pose.position[0] > 0.25)
    assert plane.vehicle.throttle > 0
    if sign:
        visit.until(lambda: sign * heading(plane) > 0.3)  # left turns are positive
        assert sign * plane.vehicle.steering > 0
    else:
        assert abs(heading(plane)) < 0.3
        visit.until(lambda: plane.vehicle.steering == pytest.approx(0, abs=0.01))  # both at once: straight on
    for key in keys:
        visit.page.keyboard.up(key)
    visit.until(lambda: plane.vehicle.throttle == 0 and abs(plane.vehicle.steering) < 0.01)


def test_throttle_comes_gradually(plane: Served, visit: Visit, monkeypatch: pytest.MonkeyPatch) -> None:
    said = watched(plane, monkeypatch)
    visit.page.keyboard.down("w")
    visit.until(lambda: said and said[-1][1].throttle == 1)
    visit.page.keyboard.up("w")
    visit.until(lambda: said[-1][1].throttle == 0)
    rise = [command.throttle for _, command in said]
    top = rise.index(1)
    assert 0 < rise[0] < 0.2
    assert rise[:top] == sorted(rise[:top])
    assert rise[top:] == sorted(rise[top:], reverse=True)
    assert len(set(rise)) > 6


@pytest.mark.parametrize("what", ["blur", "hidden"])
def test_command_stops_when_the_page_is_left_and_no_key_is_stuck_after(plane: Served, visit: Visit, what: str) -> None:
    visit.page.keyboard.down("w")
    visit.until(lambda: plane.vehicle.throttle > 0.5)
    if what == "blur":
        visit.page.evaluate("() => window.dispatchEvent(new Event('blur'))")
    else:
        set_hidden(visit, True)
    visit.until(lambda: plane.vehicle.throttle == 0)
    visit.until(lambda: abs(plane.vehicle.speed) < 0.01)
    set_hidden(visit, False)
    visit.page.evaluate("() => window.dispatchEvent(new Event('focus'))")
    tick = plane.frame.tick
    visit.until(lambda: plane.frame.tick > tick + 50)  # the key is still down, and means nothing
    assert plane.vehicle.throttle == 0
    visit.page.keyboard.up("w")
    visit.page.keyboard.down("w")
    visit.until(lambda: plane.vehicle.throttle > 0.5)
    visit.page.keyboard.up("w")


def test_a_page_that_is_closed_leaves_the_car_at_rest_and_its_wheel_free(plane: Served, visitor: Visitor) -> None:
    visit = visitor().go(plane.url + "?quality=low")
    visit.page.keyboard.down("w")
    visit.until(lambda: plane.vehicle.throttle > 0.9)
    visit.page.close()
    other = visitor().go(plane.url + "?quality=low")
    other.until(lambda: plane.vehicle.throttle == 0)
    other.until(lambda: other.knows("store.status.value.drivers") == {})


def test_keys_typed_in_a_field_do_not_drive(plane: Served, visit: Visit) -> None:
    visit.press("menu-button")
    visit.get("ip").fill("")
    visit.page.keyboard.type("wasdwrlgh", delay=20)
    assert visit.get("ip").input_value() == "wasdwrlgh"
    tick = plane.frame.tick
    visit.until(lambda: plane.frame.tick > tick + 20)
    assert plane.vehicle.throttle == 0
    assert np.linalg.norm(plane.vehicle.pose.position[:2]) < 0.01
    assert plane.vehicle.lights.headlights == Headlights.OFF
    assert plane.vehicle.lights.indicators == Indicators.OFF
    visit.page.keyboard.press("Escape")  # ends typing
    visit.page.keyboard.down("w")
    visit.until(lambda: plane.vehicle.throttle > 0)
    visit.page.keyboard.up("w")


def test_lamps_have_the_keys_of_the_report(plane: Served, visit: Visit) -> None:
    for key, lamp in (("g", Headlights.LOW), ("h", Headlights.HIGH), ("h", Headlights.OFF)):
        visit.page.keyboard.press(key)
        visit.until(lambda lamp=lamp: plane.vehicle.lights.headlights == lamp)
    sides = [("l", Indicators.LEFT), ("r", Indicators.RIGHT), ("e", Indicators.HAZARD), ("e", Indicators.OFF)]
    for key, side in sides:
        visit.page.keyboard.press(key)
        visit.until(lambda side=side: plane.vehicle.lights.indicators == side)


def test_lamps_stay_as_they_are_while_the_car_is_driven(plane: Served, visit: Visit) -> None:
    visit.page.keyboard.down("w")
    visit.until(lambda: plane.vehicle.throttle > 0.5)
    visit.page.keyboard.press("g")
    visit.page.keyboard.press("l")
    visit.until(lambda: plane.vehicle.lights.indicators == Indicators.LEFT)
    tick = plane.frame.tick
    visit.until(lambda: plane.frame.tick > tick + 60)
    assert plane.vehicle.lights.headlights == Headlights.LOW
    assert plane.vehicle.lights.indicators == Indicators.LEFT
    visit.page.keyboard.up("w")


def test_key_press_reaches_the_simulation_at_once(plane: Served, visit: Visit, monkeypatch: pytest.MonkeyPatch) -> None:
    said = watched(plane, monkeypatch)
    visit.page.evaluate(
        "() => { window.pressed = []; window.addEventListener('keydown',"
        " (event) => window.pressed.push(performance.timeOrigin + event.timeStamp), true) }"
    )
    delays = []
    for _ in range(20):
        visit.until(lambda: plane.vehicle.throttle == 0 and plane.frame.tick % 2 == 0)
        said.clear()
        visit.page.keyboard.press("w")
        visit.until(lambda: said and said[-1][1].throttle == 0)
        delays.append(1000 * said[0][0] - visit.page.evaluate("() => window.pressed.at(-1)"))
    delays.sort()
    note(f"key press to command: median {delays[10]:.1f} ms, of 20 the slowest {delays[-1]:.1f} ms")
    assert delays[10] < 100  # some milliseconds where the machine does nothing else


def watched(served: Served, monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, Command]]:
    """Filled with each command that the Simulation is given, and when [s since 1970]."""
    said: list[tuple[float, Command]] = []
    submit = served.simulation.submit

    def note_and_submit(vehicle: str, order: Command, source: Source) -> None:
        said.append((time.time(), order))
        submit(vehicle, order, source)

    monkeypatch.setattr(served.simulation, "submit", note_and_submit)
    return said


def set_hidden(visit: Visit, is_hidden: bool) -> None:
    """As when another tab comes to the front, which a headless browser never does by itself."""
    visit.page.evaluate(
        """(isHidden) => {
            Object.defineProperty(document, 'hidden', { value: isHidden, configurable: true })
            document.dispatchEvent(new Event('visibilitychange'))
        }""",
        is_hidden,
    )
