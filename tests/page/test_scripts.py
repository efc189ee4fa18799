"""A devkit script is connected from the menu; errors of the connection are shown in the menu."""

from __future__ import annotations

import numpy as np
import pytest

from tests.connect.devkit.test_python_examples import example
from tests.support.page import PageServer, Tab
from tests.support.waiting import free_port


def connect(tab: Tab, port: int) -> None:
    tab.get("ip").fill("127.0.0.1")
    tab.get("port").fill(str(port))
    tab.click("connect")


@pytest.mark.process
def test_a_script_that_is_connected_from_the_menu_drives_in_autonomous_mode(mini_map: PageServer, tab: Tab) -> None:
    tab.show("menu", "hud", tab="programs")
    tab.wait_for_text("bridge-status", "Disconnected")
    port = free_port()
    with example("2_follow_waypoints.py", port):
        connect(tab, port)
        tab.wait_for_text("bridge-status", "Connected")
        tab.wait_until(lambda: not tab.get("connect").is_enabled())
        assert not tab.get("ip").is_enabled()
        start = mini_map.vehicle.pose.position
        tick = mini_map.frame.tick
        tab.wait_until(lambda: mini_map.frame.tick > tick + 50)
        assert np.linalg.norm(mini_map.vehicle.pose.position - start) < 0.01  # manual mode: the script does not drive
        assert "V1 does not obey it" in tab.text("mode-hint")
        tab.click("mode-hint-switch")
        tab.wait_until(lambda: np.linalg.norm(mini_map.vehicle.pose.position - start) > 0.1)
        tab.wait_for_text("mode-status", "Autonomous")
        tab.get("mode-hint").wait_for(state="hidden")
        tab.wait_for_text("hud-driver", "Script")
        for row in ("hud-commands", "hud-telemetry"):
            tab.wait_until(lambda row=row: float(tab.text(row).split()[0]) > 0)
        tab.wait_for_text("hud-bridge", "Connected")
        tab.click("disconnect")
        tab.wait_for_text("bridge-status", "Disconnected")
        assert mini_map.bridge.status == "closed"
    tab.wait_until(lambda: tab.get("connect").is_enabled())
    assert tab.get("port").input_value() == str(port)  # as typed
