"""A person connects a user's script, which is a real python-socketio server, to the bridge from the menu."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser

from tests.bridge.conftest import script
from tests.page.conftest import Visitor, free_port, visits_with
from tests.page.visits import ROOT, Served, Visit

FOLLOW_LOOP = ROOT / "examples" / "devkit" / "follow_loop.py"


def with_menu(visitor: Visitor, served: Served) -> Visit:
    visit = visitor().go(served.url + "?quality=low")
    visit.press("menu-button")
    visit.press("hud-button")
    return visit


@pytest.fixture(scope="module")
def tab(served: Served, browser: Browser) -> Iterator[Visit]:
    with visits_with(browser) as visitor:
        yield with_menu(visitor, served)


@pytest.fixture
def told(plane: Served, tab: Visit) -> Visit:
    """One for all, with its menu open and no script connected."""
    tab.until_text("bridge-status", "Disconnected")
    return tab


def test_script_that_is_connected_from_the_menu_drives_in_autonomous_mode(mini_map: Served, visitor: Visitor) -> None:
    visit = with_menu(visitor, mini_map)
    visit.until_text("bridge-status", "Disconnected")
    port = free_port()
    with script("newest", FOLLOW_LOOP, port=port):
        visit.get("ip").fill("127.0.0.1")
        visit.get("port").fill(str(port))
        visit.press("connect")
        visit.until_text("bridge-status", "Connected")
        visit.until(lambda: not visit.get("connect").is_enabled())
        assert not visit.get("ip").is_enabled()
        start = mini_map.vehicle.pose.position
        tick = mini_map.frame.tick
        visit.until(lambda: mini_map.frame.tick > tick + 50)
        assert np.linalg.norm(mini_map.vehicle.pose.position - start) < 0.01  # a person drives, not the script
        visit.press("mode")
        visit.until(lambda: np.linalg.norm(mini_map.vehicle.pose.position - start) > 0.3)
        visit.until_text("mode-status", "Autonomous")
        visit.until(lambda: float(visit.text("hud-commands").split()[0]) > 1)
        visit.until(lambda: float(visit.text("hud-telemetry").split()[0]) > 1)
        visit.until(lambda: visit.text("hud-bridge").startswith("Connected"))
        visit.press("disconnect")
        visit.until_text("bridge-status", "Disconnected")
        assert mini_map.bridge.status == "closed"
    visit.until(lambda: visit.get("connect").is_enabled())
    assert visit.get("port").input_value() == str(port)  # as it was typed


@pytest.mark.parametrize(
    ("address", "port", "says"),
    [
        ("", "4567", "The IP address is empty"),
        ("http://10.0.0.1", "4567", "Only the address"),
        ("10.0.0.1:80", "4567", "Only the address"),
        ("127.0.0.1", "", "The port is a number"),
        ("127.0.0.1", "4567a", "The port is a number"),
        ("127.0.0.1", "0", "Port 0 does not exist"),
        ("127.0.0.1", "65536", "Port 65536 does not exist"),
    ],
)
def test_bad_address_or_port_is_told_in_its_place(
    plane: Served, told: Visit, address: str, port: str, says: str
) -> None:
    told.get("ip").fill(address)
    told.get("port").fill(port)
    told.press("connect")
    told.until_text("bridge-fault", says)
    assert told.get("bridge-fault").is_visible()
    field = "port" if "ort" in says else "ip"
    assert told.get(field).get_attribute("aria-invalid") == "true"
    assert told.get(field).evaluate("(field) => document.activeElement === field")
    assert plane.bridge.status == "closed"
    told.get(field).press("1")
    assert not told.get("bridge-fault").is_visible()


def test_nobody_who_listens_is_told_in_its_place_and_can_be_given_up(plane: Served, told: Visit) -> None:
    port = free_port()
    told.get("ip").fill("127.0.0.1")
    told.get("port").fill(str(port))
    told.press("connect")
    told.until_text("bridge-status", "Connecting")
    told.until_text("bridge-fault", str(port))
    assert told.get("bridge-fault").is_visible()
    told.press("disconnect")
    told.until_text("bridge-status", "Disconnected")


def test_somebody_else_who_listens_is_told_in_its_place(plane: Served, told: Visit) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        told.get("ip").fill("127.0.0.1")
        told.get("port").fill(str(other.getsockname()[1]))
        told.press("connect")
        other.accept()[0].sendall(b"220 mail.example.org ESMTP\r\n")
        told.until(lambda: told.get("bridge-fault").is_visible() and told.text("bridge-fault"))
        told.press("disconnect")
        told.until_text("bridge-status", "Disconnected")
