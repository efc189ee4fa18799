"""A simulator that serves its page from this process, and visits to it in a browser."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from playwright.sync_api import ConsoleMessage, Locator, Page, Request

from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.server import Server
from autodrive.protocol import messages
from autodrive.protocol.messages import Frame, VehicleFrame
from autodrive.simulation import Simulation

ROOT = Path(__file__).parents[2]
PATIENCE = 60.0
"""Wall time that a loaded machine is given [s]; a passing test needs far less."""

HARMLESS = ("GL Driver Message", "WebGL-")
"""Begins what a browser says of software GL."""


@dataclass
class Served:
    """The Simulation, and the Server with the page, both in this process."""

    simulation: Simulation
    server: Server
    bridge: DevkitBridge
    scenario: Callable[[], str]

    @property
    def url(self) -> str:
        return self.server.url

    @property
    def frame(self) -> Frame:
        return self.simulation.frame

    @property
    def vehicle(self) -> VehicleFrame:
        """The first one."""
        return next(iter(self.frame.vehicles.values()))

    def ask(self, request: messages.Request) -> Frame:
        return self.simulation.request(request).result(PATIENCE)

    def renew(self, scenario: str) -> None:
        """As it is after a start: that scenario, at time 0, by day, driven by persons, in real time."""
        self.bridge.close()
        self.ask(messages.Resume())
        if self.scenario() != scenario:
            self.ask(messages.LoadScenario(scenario))
        self.ask(messages.SetSpeed(1.0))
        self.ask(messages.Reset())


@dataclass
class Visit:
    """The page in a tab of a browser, and all that it said and asked for."""

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", self._note)
        self.page.set_default_timeout(1000 * PATIENCE)

    def go(self, url: str) -> Visit:
        """Open the page there, and wait until it shows Frames."""
        self.page.goto(url, wait_until="domcontentloaded")
        self.until(lambda: self.knows("store.link.value === 'open' && store.frame.value !== null"))
        return self

    def knows(self, expression: str) -> Any:
        """What the page's own door for scripts gives, for example 'store.camera.value'; None before it is there."""
        return self.page.evaluate(f"() => window.autodrive && (({{ store, view }}) => {expression})(window.autodrive)")

    def get(self, testid: str) -> Locator:
        return self.page.get_by_test_id(testid)

    def press(self, testid: str) -> None:
        self.get(testid).click()

    def text(self, testid: str) -> str:
        """As a person reads it: one space between words."""
        return " ".join((self.get(testid).text_content() or "").split())

    def until(self, is_so: Callable[[], object], patience: float = PATIENCE) -> None:
        """Wait for that, while the browser goes on."""
        deadline = time.monotonic() + patience
        while not is_so():
            assert time.monotonic() < deadline, f"it never came to be; the page said {self.errors}"
            self.page.wait_for_timeout(20)

    def until_text(self, testid: str, text: str) -> None:
        self.until(lambda: text in self.text(testid))

    def until_begun(self, served: Served) -> Visit:
        """Wait until the page shows the world that was renewed; meanwhile it stands still, for the page may be slow."""
        frame = served.ask(messages.Pause())
        self.until(lambda: self.knows("store.frame.value.time") == frame.time)
        served.ask(messages.Resume())
        return self

    def until_drawn(self) -> None:
        """Wait for a picture of the scene that is there now."""
        self.until(lambda: self.knows("view && view.stats().calls > 0"))

    def pixels(self, of: Locator | None = None) -> NDArray[np.float64]:
        """What a person sees there, RGB from 0 to 1, shape (height, width, 3)."""
        shot = (of or self.page).screenshot(type="jpeg", quality=95)
        return simplejpeg.decode_jpeg(shot, "RGB") / 255.0

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"} and not any(words in message.text for words in HARMLESS):
            self.errors.append(message.text)

    def _note(self, request: Request) -> None:
        self.requests.append(request.url)


def note(line: str) -> None:
    """A figure that was measured, for people: into test-artefacts/page/figures.txt."""
    folder = ROOT / "test-artefacts" / "page"
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "figures.txt").open("a") as figures:
        figures.write(f"{time.strftime('%F %T')}  load {os.getloadavg()[0]:.1f}  {line}\n")
