"""The page behind proxies: a real nginx with the settings of docs/proxy.md, and what the page says about other ones."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.page import ROOT, NewTab, PageServer
from tests.support.waiting import free_port, wait_until

SETTINGS = re.search(r"```nginx\n(.*?)```", (ROOT / "docs" / "proxy.md").read_text(), re.DOTALL)
CONFIGURATION = """
daemon off;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
events {{}}
http {{
    access_log off;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
    server {{
        listen 127.0.0.1:{port};
        {location}
    }}
}}
"""

Nginx = Callable[[str], str]


@pytest.fixture
def nginx(plane: PageServer, tmp_path: Path) -> Iterator[Nginx]:
    """Starts nginx with these settings, in which 8730 is the port of the simulator; returns its address."""
    program = shutil.which("nginx", path="/usr/local/sbin:/usr/sbin:/usr/bin:/bin")
    assert program is not None, "nginx is not installed: scripts/test-tools"
    with contextlib.ExitStack() as stack:

        def start(location: str) -> str:
            port = free_port()
            configuration = tmp_path / "nginx.conf"
            location = location.replace("8730", str(plane.server.port))
            configuration.write_text(CONFIGURATION.format(folder=tmp_path, port=port, location=location))
            process = subprocess.Popen([program, "-e", str(tmp_path / "error.log"), "-c", str(configuration)])
            stack.callback(process.wait)
            stack.callback(process.terminate)
            wait_until((tmp_path / "nginx.pid").exists)
            return f"http://127.0.0.1:{port}/sim/"

        yield start


def settings(*without: str) -> str:
    """The settings of the documentation, without the lines that contain one of these words."""
    assert SETTINGS is not None
    return "\n".join(line for line in SETTINGS[1].splitlines() if not any(word in line for word in without))


def test_a_vehicle_is_driven_through_nginx_with_the_settings_of_the_documentation(
    plane: PageServer, nginx: Nginx, new_tab: NewTab
) -> None:
    tab = new_tab(size=(320, 240)).open(nginx(settings()) + "?quality=low")
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: plane.vehicle.throttle > 0.5)
    tab.page.keyboard.up("w")


def test_a_proxy_that_passes_no_websockets_is_named(nginx: Nginx, new_tab: NewTab) -> None:
    tab = new_tab(size=(320, 240), expects="426")
    tab.page.goto(nginx(settings("Upgrade", "Connection")) + "?quality=low")
    tab.wait_for_text("banner", "the proxy in between does not pass WebSockets")


def test_a_proxy_without_a_simulator_is_named(nginx: Nginx, new_tab: NewTab) -> None:
    location = settings()
    broken = f"location /sim/ws {{ return 502; }}\n{location}"
    tab = new_tab(size=(320, 240), expects="502")
    tab.page.goto(nginx(broken) + "?quality=low")
    tab.wait_for_text("banner", "answers with the status 502")


def test_an_address_without_a_slash_shows_what_is_wrong(nginx: Nginx, new_tab: NewTab) -> None:
    tab = new_tab(size=(320, 240), expects="404")
    address = nginx("location = /sim { proxy_pass http://127.0.0.1:8730/; }").removesuffix("/")
    tab.page.goto(address)
    assert "check that the address ends with /" in " ".join(tab.page.inner_text("body").split())


def test_parts_of_the_page_that_cannot_be_loaded_ask_for_a_reload(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(320, 240), expects="Failed")
    tab.page.route("**/assets/view-*.js", lambda route: route.abort())
    tab.page.goto(plane.url + "?quality=low")
    tab.wait_for_text("banner", "Parts of the page could not be loaded")
    tab.page.unroute("**/assets/view-*.js")
    tab.click("banner-reload")
    tab.wait_until(lambda: tab.value("view && store.link.value === 'open'"))
    assert tab.page.locator("#loading").count() == 0


LOSE = (
    "() => { window.lost = document.querySelector('#scene').getContext('webgl2').getExtension('WEBGL_lose_context') }"
)


def test_a_lost_graphics_context_is_named_and_the_simulator_renders_after_three_seconds(
    plane: PageServer, new_tab: NewTab
) -> None:
    tab = new_tab(size=(320, 240), expects="Context").open(plane.url + "?quality=low")
    tab.wait_until(lambda: tab.value("view"))
    tab.page.evaluate(LOSE)
    tab.page.evaluate("() => window.lost.loseContext()")
    tab.wait_for_notice("The graphics context of this page was lost")
    assert tab.value("store.quality.value") == "low"
    tab.page.evaluate("() => window.lost.restoreContext()")
    tab.page.wait_for_timeout(3500)
    assert tab.value("store.quality.value") == "low"
    tab.page.evaluate("() => window.lost.loseContext()")
    tab.wait_until(lambda: tab.value("store.quality.value") == "stream")
    tab.wait_until(lambda: tab.value("store.rendered.value !== null"))
