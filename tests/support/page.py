"""Support for tests of the page in a browser: a simulator in this process, and tabs of a browser that show its page."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol import messages
from autodrive.protocol.messages import Frame, VehicleFrame
from autodrive.world.simulation import Simulation

if TYPE_CHECKING:  # imported in each process of the tests otherwise
    from playwright.sync_api import Browser, CDPSession, ConsoleMessage, Locator, Page, Request

ROOT = Path(__file__).parents[2]
TIMEOUT = 180.0
"""Wall time until a condition must hold [s]: generous, for a loaded machine."""

SMALL = (640, 480)
"""Default size of a tab: software rendering costs processor time for each pixel."""

ELSEWHERE = "lab.test"
"""A host name that leads the browser to this machine, but as over a network: the page is not a secure context."""

NO_DRAWING = """
for (const name of ['drawArrays', 'drawArraysInstanced', 'drawElements', 'drawElementsInstanced'])
  WebGL2RenderingContext.prototype[name] = () => {}
const frame = window.requestAnimationFrame.bind(window)
window.requestAnimationFrame = (draw) => window.setTimeout(() => frame(draw), 200)
"""
"""Draws no scene, which takes a second in software, for tests that do not look at it; five frames a second."""

SEEN = """
for (const [name, value] of [['tour', 'seen'], ['hud.more', 'open'], ['bridge', 'open']])
  localStorage.getItem(`autodrive.${name}`) ?? localStorage.setItem(`autodrive.${name}`, value)
"""
"""A later visit of a user who has opened everything; the first visit offers the tour."""

IGNORED = ("GL Driver Message", "WebGL-")
"""Beginnings of console messages about software rendering."""


@dataclass
class PageServer:
    """A Simulation and the Server with the page, both in this process."""

    simulation: Simulation
    server: SimulationServer
    bridge: DevkitBridge
    scenario: Callable[[], str]
    with_token: Callable[[str], contextlib.AbstractContextManager[SimulationServer]]
    """Another server of the same simulation that requires a token."""
    folder: Path
    """With files of the user."""

    @property
    def url(self) -> str:
        return self.server.url

    @property
    def frame(self) -> Frame:
        return self.simulation.frame

    @property
    def vehicle(self) -> VehicleFrame:
        """The first vehicle."""
        return next(iter(self.frame.vehicles.values()))

    def request(self, operation: messages.Operation) -> Frame:
        return self.simulation.request(operation).result(TIMEOUT)

    def restart(self, scenario: str) -> None:
        """The state after a start: that scenario, time 0, day, manual mode, real time."""
        self.bridge.close()
        self.request(messages.Resume())
        is_edited = self.simulation.undo_name or self.simulation.redo_name
        if self.scenario() != scenario or is_edited:
            self.request(messages.LoadScenario(scenario))
        self.request(messages.SetSpeed(1.0))
        self.request(messages.Reset())


@dataclass
class Tab:
    """The page in a tab of a browser, with its console errors and network requests."""

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    notices: int = 0
    """Number of entries of the log that `wait_for_notice` has read."""

    def __post_init__(self) -> None:
        self.page.on("console", self._on_console)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", self._on_request)
        self.page.set_default_timeout(1000 * TIMEOUT)

    def open(self, url: str) -> Tab:
        """Open the page and wait until it has the scene and Frames."""
        self.page.goto(url, wait_until="domcontentloaded")
        self.wait_until(lambda: self.value("store.link.value === 'open' && store.frame.value && !!store.scene.value"))
        return self

    def value(self, expression: str) -> Any:
        """A value of the page's console API, for example 'store.camera.value'; None before the page has started."""
        return self.page.evaluate(f"() => window.autodrive && (({{ store, view }}) => {expression})(window.autodrive)")

    def get(self, testid: str) -> Locator:
        return self.page.get_by_test_id(testid)

    def click(self, testid: str) -> None:
        self.get(testid).click()

    def text(self, testid: str) -> str:
        """The text of an element, with single spaces."""
        return " ".join((self.get(testid).text_content() or "").split())

    def wait_until(self, condition: Callable[[], object], timeout: float = TIMEOUT) -> None:
        """Wait for a condition while the browser continues."""
        deadline = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < deadline, f"timeout; errors in the console: {self.errors}"
            self.page.wait_for_timeout(30)

    def wait_for_text(self, testid: str, text: str) -> None:
        self.wait_until(lambda: text in self.text(testid))

    def wait_for_notice(self, text: str) -> None:
        """Wait for a new notice that contains the text, in the log: on a busy machine its time on the page is short."""

        def is_new() -> bool:
            texts = self.page.evaluate("() => autodrive.log.value.map((entry) => entry.text)")[self.notices :]
            found = [number for number, each in enumerate(texts, 1) if text in each]
            self.notices += found[0] if found else 0
            return bool(found)

        self.wait_until(is_new)

    def wait_for_state(self, server: PageServer) -> Tab:
        """Wait until the page shows the present state of the world; simulated time stands still meanwhile."""
        frame = server.request(messages.Pause())
        self.wait_until(lambda: self.value("store.frame.value.time") == frame.time and self._is_paused)
        server.request(messages.Resume())
        self.wait_until(lambda: not self._is_paused)
        return self

    @property
    def _is_paused(self) -> bool:
        """Whether the page shows a paused simulation: its button then resumes."""
        return bool(self.value("store.status.value?.is_paused"))

    def wait_for_image(self) -> None:
        """Wait until the 3D view has drawn an image."""
        self.wait_until(lambda: self.value("view && view.stats().calls > 0"))

    def show(self, *panels: str, tab: str = "scenario") -> None:
        """Open these panels ("menu", "hud") and close the others; the menu shows that tab."""
        for name in ("menu", "hud"):
            self.wait_until(lambda name=name: self.get(name).count() == 1)
            if self.get(name).is_visible() != (name in panels):
                self.click(f"{name}-button")
            self.get(name).wait_for(state="visible" if name in panels else "hidden")
        if "menu" in panels and self.get("menu-tab").is_visible():
            self.click(f"menu-tab-{tab}")

    def pixels(self, path: Path | None = None) -> NDArray[np.float64]:
        """A screenshot: RGB from 0 to 1, shape (height, width, 3). It is also written to the path, if one is given."""
        image = self.page.screenshot(path=path, type="jpeg", quality=95, animations="disabled")
        return simplejpeg.decode_jpeg(image, "RGB") / 255.0

    def _on_console(self, message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"} and not any(text in message.text for text in IGNORED):
            self.errors.append(f"{message.text} {message.location.get('url', '')}")

    def _on_request(self, request: Request) -> None:
        self.requests.append(request.url)


def box(locator: Locator) -> dict[str, float]:
    """Left, top, right and bottom of what is shown [px]."""
    found = locator.bounding_box()
    assert found is not None
    x, y = found["x"], found["y"]
    return {"left": x, "top": y, "right": x + found["width"], "bottom": y + found["height"]}


def overlap(one: Locator, other: Locator) -> bool:
    a, b = box(one), box(other)
    return a["left"] < b["right"] and b["left"] < a["right"] and a["top"] < b["bottom"] and b["top"] < a["bottom"]


def touch(tools: CDPSession, kind: str, *points: Sequence[float]) -> None:
    """A touch event of real fingers."""
    touch_points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
    tools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touch_points})


class NewTab(Protocol):
    """Opens a tab with its own browser context."""

    def __call__(
        self,
        *,
        size: tuple[int, int] = SMALL,
        draws: bool = False,
        script: str = "",
        expects: str = "",
        touch: bool = False,
        is_first_visit: bool = False,
    ) -> Tab: ...


@contextlib.contextmanager
def tabs(browser: Browser) -> Iterator[NewTab]:
    """Closes its tabs at the end; an error in a console fails, unless the tab expects one with that text."""
    with ExitStack() as stack:
        opened: list[tuple[Tab, str]] = []

        def new_tab(
            *,
            size: tuple[int, int] = SMALL,
            draws: bool = False,
            script: str = "",
            expects: str = "",
            touch: bool = False,
            is_first_visit: bool = False,
        ) -> Tab:
            context = browser.new_context(
                viewport={"width": size[0], "height": size[1]}, has_touch=touch, is_mobile=touch
            )
            stack.callback(context.close)
            script += "" if is_first_visit else f";{SEEN}"
            context.add_init_script(script + ("" if draws else NO_DRAWING))
            opened.append((Tab(context.new_page()), expects))
            return opened[-1][0]

        yield new_tab
        for tab, expected in opened:
            unexpected = [error for error in tab.errors if not expected or expected not in error]
            assert not unexpected, unexpected


def record(line: str) -> None:
    """Write a measured figure into test-artefacts/page/figures.txt."""
    folder = ROOT / "test-artefacts" / "page"
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "figures.txt").open("a") as figures:
        figures.write(f"{time.strftime('%F %T')}  load {os.getloadavg()[0]:.1f}  {line}\n")
