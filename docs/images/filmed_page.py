"""The page of the simulator in a browser, for films and pictures of it that do not depend on the speed of the machine.

The simulator is paused and steps from image to image. The page draws only for an image, and its clock goes on only
between images: motions are as smooth as on the fastest machine.
"""

from __future__ import annotations

import io
import json
import math
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Locator, Page, sync_playwright

from autodrive import Command
from autodrive.protocol.messages import LoadScenario, Pause, Step
from autodrive.run.included_driver import driver_of
from autodrive.run.options import PageOptions, RunOptions
from autodrive.run.runner import RunObserver, opened
from autodrive.world.simulation import Simulation

HERE = Path(__file__).parent
SIDECAR = HERE / "buttons.json"
"""For each picture and film of the page: the names of the buttons of the bars that it shows."""
Write: TypeAlias = Callable[[NDArray[np.uint8]], None]

TICKS = 2
"""Ticks between two commands of the car."""
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
FLAGS = ("--disable-gpu", "--enable-unsafe-swiftshader", "--no-sandbox")
PAGE = """
const frame = requestAnimationFrame.bind(window)
let waiting = []
let time = 0
performance.now = () => time
window.requestAnimationFrame = (draw) => waiting.push(draw)
window.drawFilm = (milliseconds) => new Promise((drawn) => frame(() => {
  time += milliseconds
  const all = waiting
  waiting = []
  for (const draw of all) draw(time)
  drawn()
}))
localStorage.setItem('autodrive.tour', 'seen')
addEventListener('DOMContentLoaded', () => {
  const add = (id, style) => {
    const one = document.body.appendChild(document.createElement('div'))
    one.id = id
    one.style.cssText = `position:fixed;z-index:99;pointer-events:none;${style}`
  }
  add('film-caption', 'top:60px;left:66%;transform:translateX(-50%);padding:10px 22px;border-radius:8px;' +
    'font:600 19px sans-serif;color:#fff;background:rgb(0 0 0/75%);white-space:nowrap')
  const style = document.head.appendChild(document.createElement('style'))
  style.textContent = '#film-caption:empty, [data-testid=paused] { display: none }'
  add('film-pointer', 'left:-50px;width:22px;height:22px;margin:-11px 0 0 -11px;border-radius:50%;' +
    'border:3px solid #d81b60;background:rgb(216 27 96/35%)')
  addEventListener('pointermove', ({ clientX, clientY }) => {
    const { style } = document.querySelector('#film-pointer')
    style.left = `${clientX}px`
    style.top = `${clientY}px`
  }, true)
})
"""
BUTTONS = """
() => [...document.querySelectorAll('.toolbar button, .edit-bar button')]
  .filter((button) => !button.closest('[hidden]') && getComputedStyle(button).display !== 'none')
  .map((button) => button.dataset.testid)
"""
"""Names of the buttons that the bars of the page show."""


class FilmedPage:
    """The page, whose images are written one by one."""

    def __init__(self, page: Page, simulation: Simulation, rate: float, write: Write) -> None:
        """`rate`: images per second; `write` takes an image, shape (height, width, 3), sRGB."""
        self.page = page
        self.simulation = simulation
        self.rate = rate
        self.images = 0
        """Number of images written."""
        self._write = write
        size = page.viewport_size
        assert size is not None
        self._at = size["width"] / 2, size["height"] / 2

    def open(self, address: str) -> None:
        """Show another page of a simulator or of a recording."""
        self.page.goto("about:blank")
        self.page.goto(address)
        self.page.wait_for_function("() => window.autodrive && window.drawFilm", polling=100)
        self.wait(lambda: self.draw() or self.value("view && store.scene.value") is not None)
        self.wait_for_image()

    def load(self, scenario: str) -> None:
        """Show another scenario."""
        self.simulation.request(LoadScenario(scenario)).result()
        self.wait(lambda: self.draw() or self.value("store.scene.value.scenario") == scenario)
        self.wait_for_image()

    def value(self, expression: str) -> Any:
        """The value of an expression about the page."""
        return self.page.evaluate(f"() => (({{ store, view }}) => {expression})(autodrive)")

    def wait(self, condition: Callable[[], object]) -> None:
        """Wait until the page is so far; fails after three minutes."""
        end = time.monotonic() + 180.0
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the page did not get that far")
            self.page.wait_for_timeout(30)

    def draw(self, seconds: float = 0.05) -> None:
        """Let the page draw, which it does only then, after that time of its clock [s]."""
        self.page.evaluate("milliseconds => drawFilm(milliseconds)", 1000.0 * seconds)

    def wait_for_image(self) -> None:
        """Wait until the 3D view shows the present scene."""
        self.draw()
        self.wait(lambda: self.draw() or self.value("store.shownScene.value === store.scene.value"))

    def wait_for_track(self) -> None:
        """Wait until the whole track is shown."""
        points = "store.scene.value?.track_scene?.line.points"
        inside = "([x, y]) => ((at) => at && at[0] > 100 && at[0] < innerWidth)(view?.screenPoint(x, y, 0))"
        self.wait(lambda: self.draw() or self.value(f"{points}?.every({inside})"))
        self.wait_for_image()

    def picture(self) -> NDArray[np.uint8]:
        """What the page shows, shape (height, width, 3), sRGB."""
        return np.asarray(Image.open(io.BytesIO(self.page.screenshot(timeout=120_000))).convert("RGB"))

    def take(self, seconds: float | None = None) -> None:
        """Add the image of the page for that time [s]; None: for one image."""
        self.draw(1.0 / self.rate)
        image = self.picture()
        for _ in range(max(1, round((seconds or 0.0) * self.rate))):
            self._write(image)
            self.images += 1

    def caption(self, text: str, seconds: float = 2.5) -> None:
        """Show a text at the top from now on."""
        print(f"{self.images / self.rate:5.1f} s  {text}", flush=True)
        self.page.evaluate("text => (document.querySelector('#film-caption').textContent = text)", text)
        self.take(seconds)

    def point(self, x: float, y: float, images: int = 2) -> None:
        """Move the pointer."""
        x0, y0 = self._at
        for i in range(1, images + 1):
            share = 0.5 - 0.5 * math.cos(math.pi * i / images)
            self.page.mouse.move(x0 + share * (x - x0), y0 + share * (y - y0))
            self.take()
        self._at = (x, y)

    def click(self, id: str) -> None:
        """Click a button of the page."""
        self.click_at(self.page.get_by_test_id(id))

    def click_at(self, element: Locator) -> None:
        """Click an element."""
        element.scroll_into_view_if_needed()
        box = element.bounding_box()
        assert box is not None
        self.point(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        element.click()
        self.wait_for_image()
        self.take()

    def screen(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the map is on the screen."""
        found = self.page.evaluate("([x, y]) => autodrive.view.screenPoint(x, y, 0)", [x, y])
        return found[0], found[1]

    def click_map(self, x: float, y: float) -> None:
        """Click on a point of the map."""
        self.point(*self.screen(x, y))
        self.page.mouse.click(*self._at)
        self.wait_for_image()
        self.take()

    def begin_to_build(self) -> None:
        """Enter Build mode."""
        self.click("build-button")
        self.wait(lambda: self.draw() or self.page.get_by_test_id("build-bar").is_visible())

    def begin_with_a_crossing(self, seconds: float) -> None:
        """Build on an empty lawn: set a crossing, show it for that time [s], and click its open end."""
        page = self.page
        self.begin_to_build()
        self.edit(lambda: page.get_by_test_id("build-template").select_option("empty"), 0.0)
        page.evaluate("() => autodrive.view.showArea(-0.6, 0, 4.4)")
        self.wait_for_image()
        page.get_by_test_id("piece-four_way_intersection").click()
        self.edit(lambda: self.click_map(0.0, 0.0), seconds)
        page.keyboard.press("Escape")
        x, y = (self.value(f"store.scene.value.map_scene.parts.four_way_intersection_1.{key}") for key in "xy")
        self.click_map(x + 0.7, y)

    def edit(self, act: Callable[[], object], seconds: float = 0.8) -> None:
        """Do something that edits the map, and show the new map."""
        scene = "store.scene.value"
        edits = f"[store.status.value.undo, {scene}.model, Object.keys({scene}.map_scene?.parts ?? [])]"
        before = self.value(edits)
        act()
        self.wait(lambda: self.draw() or self.value(edits) != before)
        self.wait(lambda: not self.page.evaluate("() => autodrive.connection.pending.size"))  # all is answered
        self.step(10)  # the LIDAR sees the new map
        self.wait_for_image()
        self.take(seconds)

    def press(self, key: str) -> None:
        """Press a key for the piece in hand."""
        self.wait(lambda: self.page.get_by_test_id("build-set").is_enabled())
        self.page.keyboard.press(key)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag from one point of the map to another."""
        self.point(*self.screen(*start))
        self.page.mouse.down()
        self.point(*self.screen(*end), images=5)
        self.edit(self.page.mouse.up, 0.5)

    def step(self, ticks: int, commands: dict[str, Command] | None = None) -> None:
        """Let the simulation go on, until the page has its latest Frame."""
        self.simulation.request(Step(ticks, commands or {})).result()
        self._wait_for_frame()

    def drive(self, seconds: float, speed: float = 1.0, is_shown: bool = True) -> None:
        """Let the included driver drive V1 that long in the film [s], with a new command each 20 ms."""
        simulation = self.simulation
        driver = driver_of(simulation.world, "V1", simulation.frame)
        command = Command()
        start = simulation.frame.time
        for image in range(round(seconds * self.rate)):
            while simulation.frame.time - start < (image + 1) * speed / self.rate:
                command = driver.command(simulation.frame) or command
                simulation.request(Step(TICKS, {"V1": command})).result()
            if is_shown:
                self._wait_for_frame()
                self.take()

    def _wait_for_frame(self) -> None:
        tick = self.simulation.frame.tick
        self.wait(lambda: self.value("store.frame.value.tick") >= tick)


@contextmanager
def filmed_page(
    scenario: str, size: tuple[int, int], rate: float, write: Write, quality: str = "low"
) -> Iterator[FilmedPage]:
    """The page of a paused simulator. `size`: width and height [pixels]; `rate` and `write`: of `FilmedPage`."""
    executable = next(filter(None, map(shutil.which, BROWSERS)), None)
    if executable is None:
        sys.exit("pictures of the page need a browser: sudo apt-get install chromium")
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        options = RunOptions(scenario, page=PageOptions(port=0), recordings=Path(folder))
        run = opened(stack, options, RunObserver())
        run.simulation.start()
        run.simulation.request(Pause()).result()
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(executable_path=executable, args=list(FLAGS))
        stack.callback(browser.close)
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.add_init_script(PAGE)
        film = FilmedPage(page, run.simulation, rate, write)
        film.open(f"{run.link}?quality={quality}#menu=0&hud=0")
        yield film


def note_buttons(film: FilmedPage, name: str) -> None:
    """Write into `SIDECAR` which buttons the page shows in the picture or film of that name."""
    known = json.loads(SIDECAR.read_text(encoding="utf-8")) if SIDECAR.exists() else {}
    known[name] = film.page.evaluate(BUTTONS)
    SIDECAR.write_text(json.dumps(dict(sorted(known.items())), indent=2) + "\n", encoding="utf-8")
