"""Makes the film of builder.md: a town and a track are built, driven on and sent. `uv run docs/builder_film.py`.

`uv run docs/builder_film.py town,link film.webm` writes some parts only, to another file.

The simulator is paused and steps from image to image, and the page draws only for an image: the film does not depend on
the speed of the machine.
"""

from __future__ import annotations

import math
import runpy
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from playwright.sync_api import Locator, Page, sync_playwright

from autodrive import Command
from autodrive.protocol.messages import LoadScenario, Pause, SetTrafficLight, Step, TrafficLightState
from autodrive.recording.film.video import Video
from autodrive.run.options import PageOptions, RunOptions
from autodrive.run.runner import RunObserver, opened
from autodrive.world.simulation import Simulation

HERE = Path(__file__).parent
FILE = HERE / "builder.webm"
STOP = 0.95, 1.15
"""y of the car when it brakes at a red light, north of the crossing [m]."""
SIZE = 1024, 640
RATE = 5
"""Images per second of the film."""
TICKS = 4
"""Ticks between two commands of the car."""
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
FLAGS = ("--disable-gpu", "--enable-unsafe-swiftshader", "--no-sandbox")
OVERLAY = """
const frame = requestAnimationFrame.bind(window)
let waiting = []
window.requestAnimationFrame = (draw) => waiting.push(draw)
window.drawFilm = () => new Promise((drawn) => frame((now) => {
  const all = waiting
  waiting = []
  for (const draw of all) draw(now)
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
  add('film-pointer', 'width:22px;height:22px;margin:-11px 0 0 -11px;border-radius:50%;' +
    'border:3px solid #d81b60;background:rgb(216 27 96/35%)')
  addEventListener('pointermove', ({ clientX, clientY }) => {
    const { style } = document.querySelector('#film-pointer')
    style.left = `${clientX}px`
    style.top = `${clientY}px`
  }, true)
})
"""


class Film:
    """The page, and the video of its images."""

    def __init__(self, page: Page, video: Video, simulation: Simulation) -> None:
        self.page = page
        self.simulation = simulation
        self._video = video
        self._at = (SIZE[0] / 2, SIZE[1] / 2)

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

    def draw(self) -> None:
        """Let the page draw, which it does only then: software rendering needs most of the time of the film."""
        self.page.evaluate("() => drawFilm()")

    def wait_for_image(self) -> None:
        """Wait until the 3D view shows the present scene."""
        self.draw()
        self.wait(lambda: self.draw() or self.value("store.shownScene.value === store.scene.value"))

    def wait_for_track(self) -> None:
        """Wait until the whole track is shown."""
        points = "store.scene.value?.track_scene?.line.points"
        inside = f"([x, y]) => ((at) => at && at[0] > 100 && at[0] < {SIZE[0]})(view?.screenPoint(x, y, 0))"
        self.wait(lambda: self.draw() or self.value(f"{points}?.every({inside})"))
        self.wait_for_image()

    def take(self, seconds: float = 1.0 / RATE) -> None:
        """Add the image of the page for that time."""
        self.draw()
        jpeg = self.page.screenshot(type="jpeg", quality=92, timeout=120_000)
        image = simplejpeg.decode_jpeg(jpeg, "RGB")
        for _ in range(max(1, round(seconds * RATE))):
            self._video.write(image)

    def caption(self, text: str, seconds: float = 2.5) -> None:
        """Show a text at the top from now on."""
        print(f"{self._video.images / RATE:5.1f} s  {text}", flush=True)
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

    def edit(self, act: Callable[[], object], seconds: float = 0.8) -> None:
        """Do something that edits the map, and show the new map."""
        scene = "store.scene.value"
        edits = f"[store.status.value.undo, {scene}.model, Object.keys({scene}.map_scene?.parts ?? [])]"
        before = self.value(edits)
        act()
        self.wait(lambda: self.value(edits) != before)
        self.wait(lambda: not self.page.evaluate("() => autodrive.connection.pending.size"))  # all is answered
        self.step(10, {})  # the LIDAR sees the new map
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

    def step(self, ticks: int, commands: dict[str, Command]) -> None:
        """Let the simulation go on, until the page has its latest Frame."""
        self.simulation.request(Step(ticks, commands)).result()
        tick = self.simulation.frame.tick
        self.wait(lambda: self.value("store.frame.value.tick") >= tick)

    def drive(self, seconds: float, command: Callable[[], Command], speed: float = 1.0) -> None:
        """Let the car drive that long in the film, with commands at 25 Hz."""
        count = round(speed * 100 / RATE / TICKS)
        for _ in range(round(seconds * RATE)):
            for _ in range(count):
                self.step(TICKS, {"V1": command()})
            self.take()


def gap_follower(simulation: Simulation) -> Callable[[], Command]:
    """The race program of the examples."""
    follow = runpy.run_path(str(HERE.parent / "examples" / "racing" / "follow_the_gap.py"))["command"]

    def command() -> Command:
        scan = simulation.frame.vehicles["V1"].lidar
        if scan is None:
            return Command()
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        return Command(*follow(scan.ranges, angles))

    return command


def lane_follower(simulation: Simulation) -> Callable[[], Command]:
    """Pure pursuit along the lanes, straight ahead at a crossing; it stops before a red light."""
    graph = simulation.world.map.lane_graph
    throttle, at = 0.0, None

    def command() -> Command:
        nonlocal throttle, at
        vehicle = simulation.frame.vehicles["V1"]
        x, y, _ = vehicle.pose.position
        w, _, _, z = vehicle.pose.orientation
        yaw = 2.0 * math.atan2(z, w)
        near = graph.nearest(x, y, yaw) if at is None else None
        at = graph.lanes[near.lane] if near else at
        assert at is not None
        path = [at]
        while len(path) < 4:
            heading = _heading(path[-1].points[-2:])
            following = [graph.lanes[i] for i in path[-1].successors]
            path.append(min(following, key=lambda one: _turn(_heading(one.points[[0, -1]]) - heading)))
        if np.hypot(*(path[1].points - (x, y)).T).min() < 0.02:
            at = path[1]
        points = np.vstack([one.points for one in path])
        distance = np.hypot(*(points - (x, y)).T)
        start = int(distance[: len(points) // 2].argmin())
        goal = points[start + int(np.argmax(distance[start:] > 0.3))]
        bearing = math.atan2(goal[1] - y, goal[0] - x) - yaw
        curvature = 2.0 * math.sin(bearing) / math.hypot(goal[0] - x, goal[1] - y)
        is_red = any(one.state == TrafficLightState.RED for one in simulation.frame.traffic_lights.values())
        throttle += max(-0.08, min(0.08, (0.0 if is_red and STOP[0] < y < STOP[1] and x < 0.1 else 0.8) - throttle))
        return Command(throttle, max(-1.0, min(1.0, math.atan(0.14154 * curvature) / math.radians(30.0))))

    return command


def _heading(points: NDArray[np.float64]) -> float:
    return math.atan2(*(points[-1] - points[0])[::-1])


def _turn(angle: float) -> float:
    return abs(math.remainder(angle, 2.0 * math.pi))


def town(film: Film) -> None:
    """A figure eight of roads with a traffic light, and a car that drives on it."""
    page, simulation = film.page, film.simulation
    film.caption("A town: start from an empty lawn")
    film.click("build-button")
    film.wait(lambda: page.get_by_test_id("build-bar").is_visible())
    film.edit(lambda: page.get_by_test_id("build-template").select_option("empty"), 0.2)
    page.get_by_test_id("build-search").scroll_into_view_if_needed()
    page.evaluate("() => autodrive.view.showArea(-0.6, 0, 4.4)")
    film.wait_for_image()
    film.take(1.0)
    film.caption("Take a piece, and click", 1.0)
    film.click("piece-four_way_intersection")
    film.edit(lambda: film.click_map(0.0, 0.0))
    page.keyboard.press("Escape")
    x, y = (film.value(f"store.scene.value.map_scene.parts.four_way_intersection_1.{key}") for key in "xy")
    film.caption("Click an open end (green): the pieces that fit are offered", 1.0)
    film.click_map(x + 0.7, y)
    film.take(1.5)
    film.caption("Enter sets the piece; R and M turn and mirror it", 0.8)
    for _ in range(2):
        film.edit(lambda: film.press("Enter"))
    film.caption("C closes the loop", 1.0)
    film.edit(lambda: film.press("c"))
    film.caption("Close all closes the other open ends, too", 1.0)
    close = page.get_by_test_id("build-close-all")
    close.scroll_into_view_if_needed()
    film.take(1.0)
    film.edit(lambda: film.click_at(close), 1.5)
    film.caption("Signs and traffic lights", 0.5)
    page.get_by_test_id("build-search").fill("light")
    film.click("piece-sign-traffic_light")
    for _ in range(6):
        film.press("r")
        film.take()
    film.edit(lambda: film.click_map(x - 0.58, y - 0.58))
    page.keyboard.press("Escape")
    page.get_by_test_id("build-search").fill("")
    film.caption("Place the car on a road", 0.5)
    film.click_map(x + 0.2, y + 1.2)
    film.edit(lambda: film.click("build-car"), 1.0)
    film.click("build-done")
    (light,) = simulation.frame.traffic_lights
    simulation.request(SetTrafficLight(light, TrafficLightState.RED)).result()
    page.evaluate('() => { autodrive.store.camera.value = "Driver\'s Eye" }')
    film.wait_for_image()
    film.caption("Drive: the car stops at the red light", 0.5)
    follow = lane_follower(simulation)
    film.drive(5.0, follow, speed=1.5)
    simulation.request(SetTrafficLight(light, TrafficLightState.GREEN)).result()
    film.caption("Drive: the light is green", 0.2)
    film.drive(10.0, follow, speed=2.2)


def track(film: Film) -> None:
    """A race track by points, and a car that laps it with its LIDAR."""
    page, simulation = film.page, film.simulation
    simulation.request(LoadScenario("practice")).result()
    film.wait(lambda: film.value("store.scene.value.track_scene") is not None)
    film.wait_for_image()
    film.caption("A race track: drag its points")
    film.click("build-button")
    film.wait(lambda: page.get_by_test_id("build-bar").is_visible())
    film.click("track-new")
    film.wait_for_track()
    film.take(1.0)
    for index, end in ((6, (0.0, 3.0)), (0, (0.0, -4.0)), (3, (12.5, 1.5))):
        x, y = film.value(f"store.scene.value.track_scene.line.points[{index}]")
        film.drag((x, y), end)
    film.caption("A bend that is too tight is red while you drag; Undo takes it back", 1.0)
    x, y = film.value("store.scene.value.track_scene.line.points[8]")
    film.drag((x, y), (x + 2.5, y - 4.5))
    film.take(2.0)
    film.edit(lambda: film.click("build-undo"), 1.0)
    film.caption("Walls or air ducts", 0.5)
    barrier = page.get_by_test_id("track-barrier")
    film.click_at(barrier)
    film.edit(lambda: barrier.select_option("duct"), 2.0)
    film.caption("Drive: a script follows the gap with the LIDAR", 0.5)
    film.click("build-done")
    page.evaluate('() => { autodrive.store.camera.value = "Driver\'s Eye" }')
    film.wait_for_image()
    film.drive(16.0, gap_follower(simulation))


def link(film: Film) -> None:
    """The track is sent as a link, and opened by somebody else."""
    page, simulation = film.page, film.simulation
    film.caption("Save: a file, or a link that contains the map")
    film.click("build-button")
    film.wait(lambda: page.get_by_test_id("build-bar").is_visible())
    film.click("build-save")
    film.take(2.0)
    page.get_by_test_id("save-kind").select_option("link")
    film.click("save-map-save")
    film.wait(lambda: page.get_by_test_id("map-link").is_visible())
    film.caption("Send the link", 3.0)
    address = page.get_by_test_id("map-link").inner_text()
    simulation.request(LoadScenario("practice")).result()
    page.goto("about:blank")
    page.goto(address)
    page.wait_for_function("() => window.autodrive && window.drawFilm", polling=100)
    film.wait_for_track()
    film.caption("Somebody else opens it in the page of a running simulator")
    film.click("build-done")
    page.evaluate('() => { autodrive.store.camera.value = "Driver\'s Eye" }')
    film.wait_for_image()
    film.caption("... and drives on your track", 0.2)
    film.drive(9.0, gap_follower(simulation))
    film.caption("Build, in the toolbar of the page")


def main() -> None:
    """Write the film."""
    chosen = (sys.argv[1] if len(sys.argv) > 1 else "town,track,link").split(",")
    parts = [part for part in (town, track, link) if part.__name__ in chosen]
    file = Path(sys.argv[2]) if len(sys.argv) > 2 else FILE
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        sys.exit("the film needs a browser: sudo apt-get install chromium")
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        options = RunOptions("plane", page=PageOptions(port=0), cameras=False, recordings=Path(folder))
        run = opened(stack, options, RunObserver())
        run.simulation.start()
        run.simulation.request(Pause()).result()
        playwright = stack.enter_context(sync_playwright())
        window = playwright.chromium.launch(executable_path=browser, args=list(FLAGS))
        stack.callback(window.close)
        page = window.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.add_init_script(OVERLAY)
        page.goto(f"{run.link}?quality=low#menu=0&hud=0")
        film = Film(page, stack.enter_context(Video(file, SIZE, RATE)), run.simulation)
        film.wait(lambda: film.value("view && store.scene.value") is not None)
        film.wait_for_image()
        film.caption("Your own town and track, in the browser", 3.0)
        for part in parts:
            part(film)
    print(f"{file}: {file.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
