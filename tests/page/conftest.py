"""The page as it is built now, a simulator that serves it, and the browser of the machine."""

from __future__ import annotations

import contextlib
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, sync_playwright

from autodrive.app import PAGE
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.server import Server
from autodrive.jpeg import JpegEncoder, images_of
from autodrive.run_options import RunOptions
from autodrive.simulation import Simulation
from autodrive.stage import Stage
from tests.page.visits import ROOT, Served, Visit

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = [
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]
SELDOM = """
const frame = window.requestAnimationFrame.bind(window)
window.requestAnimationFrame = (draw) => window.setTimeout(() => frame(draw), 700)
"""
"""A picture in software GL takes a processor for a while: tests that do not look at it have few drawn."""

Visitor = Callable[..., Visit]


@pytest.fixture(scope="session")
def built() -> Path:
    """The built page, no older than its sources."""
    subprocess.run([ROOT / "scripts" / "page"], check=True, cwd=ROOT, timeout=300)
    return PAGE


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.fail("the page is tested in a browser, and there is none. Install one: sudo apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def served(built: Path) -> Iterator[Served]:
    """One for all tests: put together as `autodrive run` does it."""
    options = RunOptions(scenario="plane")
    stage = Stage(options)
    simulation = Simulation(stage.load("plane"), load=stage.load)
    simulation.add_sink(stage)
    encoder = JpegEncoder()
    with ExitStack() as stack:
        stack.callback(lambda: simulation.world.close())  # noqa: PLW0108  of the world that is there at the end
        bridge = DevkitBridge(simulation, images=partial(images_of, encoder=encoder))
        stack.callback(bridge.close)
        server = Server(
            simulation,
            scenery=stage.scenery,
            page=built,
            bridge=bridge,
            scenarios=stage.scenarios,
            port=0,
            pictures=encoder,
            cameras_fault=lambda: stage.cameras_fault,
            wants_pictures=stage.look,
        )
        stack.enter_context(simulation)
        stack.enter_context(server)
        yield Served(simulation, server, bridge, lambda: stage.scenario)


@pytest.fixture
def plane(served: Served) -> Served:
    """One car on the empty plane."""
    served.renew("plane")
    return served


@pytest.fixture
def mini_map(served: Served) -> Served:
    served.renew("mini_map")
    return served


@pytest.fixture
def two_cars(served: Served) -> Served:
    served.renew("two_cars")
    return served


@pytest.fixture
def visitor(browser: Browser) -> Iterator[Visitor]:
    """Opens tabs, each of a person of its own; they are closed after the test."""
    with visits_with(browser) as visitor:
        yield visitor


@contextlib.contextmanager
def visits_with(browser: Browser) -> Iterator[Visitor]:
    """What the page told the console is a fault at the end, unless it was expected."""
    with ExitStack() as stack:
        visits: list[tuple[Visit, str]] = []

        def visit(*, size: tuple[int, int] = (1280, 720), draws: bool = False, expects: str = "", **more: Any) -> Visit:
            context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **more)
            stack.callback(context.close)
            if not draws:
                context.add_init_script(SELDOM)
            visits.append((Visit(context.new_page()), expects))
            return visits[-1][0]

        yield visit
        for one, expected in visits:
            assert [error for error in one.errors if not expected or expected not in error] == []


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


@contextlib.contextmanager
def run(*arguments: object, port: int) -> Iterator[subprocess.Popen[bytes]]:
    """`autodrive run` as a process of its own."""
    command = [Path(sys.executable).parent / "autodrive", "run", *arguments, "--port", port, "--no-browser"]
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
