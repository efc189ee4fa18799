"""Fixtures of the browser tests: one browser, one running simulator and one shared tab for the session."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from autodrive.base.cache import PACKAGE
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.graphics.cameras.jpeg import JpegEncoder, images_of
from autodrive.run.options import RunOptions
from autodrive.run.own_files import UserFiles
from autodrive.run.recordings import ClientRecordings
from autodrive.run.world_loader import WorldLoader
from autodrive.world.simulation import Simulation
from tests.support.page import ELSEWHERE, ROOT, NewTab, PageServer, Tab, tabs

if TYPE_CHECKING:  # imported in each process of the tests otherwise
    from playwright.sync_api import Browser

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = [
    *("--disable-gpu", "--enable-unsafe-swiftshader"),  # as without a GPU: only WebGL is drawn by SwiftShader
    *("--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
    f"--host-resolver-rules=MAP {ELSEWHERE} 127.0.0.1",
]


@pytest.fixture(scope="package")
def built() -> Path:
    """The built page, no older than its sources."""
    subprocess.run([ROOT / "scripts" / "page"], check=True, cwd=ROOT, timeout=300)
    return PACKAGE / "page"


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.fail("the tests of the page need a browser. Install one: sudo apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="package")
def running(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    """A simulator with all parts of `autodrive run`."""
    own = tmp_path_factory.mktemp("own")
    loader = WorldLoader(RunOptions(scenario="plane", folder=own))
    simulation = Simulation(loader.load("plane"), load=loader.load)
    loader.follow(simulation)
    encoder = JpegEncoder()
    with ExitStack() as stack:
        stack.callback(lambda: simulation.world.close())  # noqa: PLW0108  the world at the end, not the present one
        bridge = DevkitBridge(simulation, images=partial(images_of, encoder=encoder))
        stack.callback(bridge.close)
        folder = tmp_path_factory.mktemp("recordings")
        recordings = ClientRecordings(simulation, folder, scenario=lambda: loader.scenario, encoder=encoder)
        stack.callback(recordings.close)
        served = Served(
            simulation,
            loader.scenery,
            bridge=bridge,
            scenarios=loader.scenarios,
            jpeg_encoder=encoder,
            cameras_error=lambda: loader.cameras_error,
            cameras_note=lambda: loader.cameras_note,
            want_pictures=loader.set_viewed,
            recording=recordings,
            own_files=UserFiles(own),
        )

        def serve(token: str | None = None) -> SimulationServer:
            return SimulationServer(served, PageOptions(port=0, token=token), page=built)

        server = serve()
        stack.enter_context(simulation)
        stack.enter_context(server)
        yield PageServer(simulation, server, bridge, lambda: loader.scenario, serve, own)


@pytest.fixture
def plane(running: PageServer) -> PageServer:
    """One vehicle on an empty plane."""
    running.restart("plane")
    return running


@pytest.fixture
def mini_map(running: PageServer) -> PageServer:
    running.restart("mini_map")
    return running


@pytest.fixture
def two_cars(running: PageServer) -> PageServer:
    running.restart("two_cars")
    return running


@pytest.fixture
def race(running: PageServer, tmp_path: Path) -> PageServer:
    """One vehicle in a race of three laps after a warm-up lap."""
    file = tmp_path / "race.yaml"
    file.write_text("map: practice\nvehicles:\n  V1: {type: roboracer}\nrace: {rules: league_2026, laps: 3}\n")
    running.restart(str(file))
    return running


@pytest.fixture
def new_tab(browser: Browser) -> Iterator[NewTab]:
    """Opens tabs that are closed after the test."""
    with tabs(browser) as new:
        yield new


@pytest.fixture(scope="package")
def session_tab(running: PageServer, browser: Browser) -> Iterator[Tab]:
    with tabs(browser) as new:
        yield new(size=(1024, 768)).open(running.url + "?quality=low")


@pytest.fixture
def tab(running: PageServer, session_tab: Tab) -> Iterator[Tab]:
    """The shared tab with closed panels and dialogs, and no held key. Request it after the scenario."""
    session_tab.page.set_viewport_size({"width": 1024, "height": 768})
    session_tab.wait_until(lambda: session_tab.value("store.scene.value.scenario") == running.scenario())
    session_tab.wait_for_state(running)
    session_tab.page.evaluate(
        "() => { document.querySelectorAll('dialog[open]').forEach((dialog) => dialog.close())"
        " ; document.activeElement?.blur(); window.dispatchEvent(new Event('blur'))"
        ' ; autodrive.store.camera.value = "Driver\'s Eye" }'
    )
    session_tab.show()
    session_tab.notices = session_tab.page.evaluate("() => autodrive.log.value.length")
    yield session_tab
    session_tab.show()  # nobody looks at the images of the cameras until the next test
