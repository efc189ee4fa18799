"""What the page does while somebody builds, in a real browser: a dragged point of a track; an edit until its picture.

    python benchmarks/building_page.py track [--points 60] [--moves 180] [--profile 20]
    python benchmarks/building_page.py ghost [--modules 100] [--moves 180] [--profile 20]
    python benchmarks/building_page.py map [--modules 100] [--edits 10] [--running] [--every 1]

`track`: a point is dragged with 60 moves a second, while the edges and the faults are drawn. Printed are the time of
the script of the page for a move (its handlers and the drawing of the next frame, from a trace of the browser) and the
time between two frames. WebGL draws nothing meanwhile (its calls return at once): without a GPU, software would draw
the scene, which takes longer than a frame. `--profile`: prints that many functions that take the most time.

`ghost`: the same for a piece that follows the pointer over a map of many modules and snaps to their ends.

`map`: one module of many is turned by a key, as somebody does who builds. Printed is the time from the key until the
page draws the piece over the scene, until it has the new Scene, and until the image of the new scene is complete, which
software draws. `--running`: time runs meanwhile. `--every`: time between two edits [s].
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import statistics
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

from building import town
from playwright.sync_api import Browser, Page, sync_playwright

import autodrive
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import EditMap, EditTrack, MapModule, Operation, TrackLine
from autodrive.world.factory import new_world
from autodrive.world.simulation import Simulation
from autodrive.world.views.scene_files import SceneFiles

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
FLAGS = ("--disable-gpu", "--enable-unsafe-swiftshader", "--no-sandbox")
PAGE = Path(autodrive.__file__).parent / "page"
SIZE = (1280, 720)
START = """
localStorage.setItem('autodrive.tour', 'seen')
window.times = {}
addEventListener('keydown', ({ code }) => code === 'KeyR' && (times.key = performance.now()), { capture: true })
"""
NO_DRAWING = """
for (const name of ['drawArrays', 'drawArraysInstanced', 'drawElements', 'drawElementsInstanced'])
  WebGL2RenderingContext.prototype[name] = () => {}
"""
NOTE_TIMES = """() => {
  const { store } = autodrive
  const gl = document.querySelector('#scene').getContext('webgl2')
  const note = (what) => (times[what] ??= performance.now() - times.key)
  const overlay = document.querySelector('[data-testid="build-overlay"]')
  new MutationObserver(() => overlay.querySelector('.placed') && note('over the scene'))
    .observe(overlay, { childList: true, subtree: true })
  store.scene.watch(() => times.key && note('Scene'))
  store.shownScene.watch(() => {
    if (!times.key) return
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)) // waits until the image is complete
    note('image')
  })
}"""


@contextmanager
def opened(operation: Operation, *, draws: bool, is_running: bool) -> Iterator[tuple[Browser, Page]]:
    """A page in Build mode, of a simulator with that map."""
    simulation = Simulation(new_world("plane"), is_paused=not is_running, load=new_world)
    served = Served(simulation, lambda world: SceneFiles.of(world, "plane"))
    found = next(filter(None, map(shutil.which, BROWSERS)))
    with (
        simulation,
        SimulationServer(served, PageOptions(port=0), page=PAGE) as server,
        sync_playwright() as playwright,
        playwright.chromium.launch(executable_path=found, args=list(FLAGS)) as browser,
    ):
        simulation.request(operation).result(60.0)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.add_init_script(START + ("" if draws else NO_DRAWING))
        page.goto(server.url + "?quality=low")
        page.wait_for_function("() => window.autodrive?.view && autodrive.store.shownScene.value")
        page.get_by_test_id("build-button").click()
        page.wait_for_timeout(2000)
        yield browser, page


def track_of(points: int) -> TrackLine:
    """A closed track of 1.6 m per point with bends to both sides."""
    radius = 1.6 * points / (2 * math.pi)

    def place(i: int) -> tuple[float, float]:
        angle = 2 * math.pi * i / points
        r = radius + 0.8 * math.cos(5 * angle)
        return round(r * math.cos(angle), 3), round(r * math.sin(angle), 3)

    return TrackLine(tuple(place(i) for i in range(points)))


def dragged(page: Page, moves: int) -> None:
    """Drag the tenth point of the track along a line and back, again and again."""
    page.get_by_test_id("track-all").click()
    page.wait_for_timeout(1000)
    (x, y), middle = page.evaluate(
        "() => { const [x, y] = autodrive.store.scene.value.track_scene.line.points[9];"
        " return [autodrive.view.screenPoint(x, y, 0), autodrive.view.screenPoint(0, 0, 0)] }"
    )
    page.mouse.move(x, y)
    page.mouse.down()
    move(page, (x, y), (0.7 * (middle[0] - x), 0.7 * (middle[1] - y)), moves)
    page.mouse.up()


def placed(page: Page, moves: int) -> None:
    """Take a piece and move it over the map from side to side, again and again."""
    page.wait_for_function("() => autodrive.store.shownScene.value.map_scene?.problems.length > 0")
    page.evaluate("() => autodrive.view.showArea(6, 16, 20)")
    page.get_by_test_id("piece-straight_road").click()
    page.wait_for_timeout(1000)
    move(page, (450.0, 200.0), (400.0, 350.0), moves)


def move(page: Page, start: tuple[float, float], by: tuple[float, float], moves: int) -> None:
    """Move the pointer along a line and back, again and again, with 60 moves a second."""
    begin = time.perf_counter()
    for i in range(moves):
        share = 0.5 * (1 - math.cos(2 * math.pi * i / 60))
        page.mouse.move(start[0] + share * by[0], start[1] + share * by[1])
        time.sleep(max(begin + (i + 1) / 60 - time.perf_counter(), 0.0))


def time_moves(operation: Operation, gesture: Callable[[Page, int], None], moves: int, functions: int) -> None:
    with opened(operation, draws=False, is_running=False) as (browser, page):
        if functions:
            tools = page.context.new_cdp_session(page)
            for method in ("Profiler.enable", "Profiler.start"):
                tools.send(method)
            gesture(page, moves)
            print_profile(tools.send("Profiler.stop")["profile"], functions)
            return
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "trace.json"
            browser.start_tracing(page=page, path=file, categories=["devtools.timeline"])
            gesture(page, moves)
            browser.stop_tracing()
            events = json.loads(file.read_text())["traceEvents"]
    frames = frames_of(events)
    moves_of = [frame for frame in frames if frame["move"] > 0]
    print_times("script of a move", [frame["move"] + frame["draw"] for frame in moves_of])
    print_times("  its handlers", [frame["move"] for frame in moves_of])
    print_times("  drawing a frame", [frame["draw"] for frame in moves_of])
    print_times("between frames", [after["at"] - frame["at"] for frame, after in pairwise(frames)])


def frames_of(events: list[dict[str, Any]]) -> list[dict[str, float]]:
    """Of each frame from the first move to the last: when it began, the times of its handlers and its drawing [ms]."""
    script = sorted((e for e in events if kind_of(e) and "dur" in e), key=lambda e: e["ts"])
    frames: list[dict[str, float]] = []
    end = 0.0
    for event in script:
        at, spent = event["ts"] / 1e3, event["dur"] / 1e3
        if at > end + 2.0:  # a frame first handles the moves, then draws; then the browser paints and waits
            frames.append({"at": at, "move": 0.0, "draw": 0.0})
        frames[-1][kind_of(event)] += spent
        end = at + spent
    of_moves = [i for i, frame in enumerate(frames) if frame["move"] > 0]
    return frames[of_moves[1] : of_moves[-1] + 1]


def kind_of(event: dict[str, Any]) -> str:
    """What the script of the page does meanwhile; empty: something else."""
    if event["name"] == "FireAnimationFrame":
        return "draw"
    is_move = event["name"] == "EventDispatch" and event["args"]["data"]["type"] == "pointermove"
    return "move" if is_move else ""


def edit_map(modules: int, edits: int, *, every: float, is_running: bool) -> None:
    parts = town(modules)
    name, last = [*parts.items()][-1]
    assert isinstance(last, MapModule)
    times: dict[str, list[float]] = {}
    with opened(EditMap({**parts}), draws=True, is_running=is_running) as (_, page):
        page.evaluate("([x, y]) => autodrive.view.lookAt(x, y)", [last.x, last.y])
        page.wait_for_timeout(1000)
        page.mouse.click(*page.evaluate("([x, y]) => autodrive.view.screenPoint(x, y, 0)", [last.x, last.y]))
        page.wait_for_function(f"() => document.querySelector('#build').innerText.includes('{name}')")
        page.evaluate(NOTE_TIMES)
        for i in range(edits + 1):
            page.evaluate("() => { for (const name of Object.keys(times)) delete times[name] }")
            page.keyboard.press("r")
            page.wait_for_function("() => times.image")
            for what, value in page.evaluate("() => times").items():
                if i > 0 and what != "key":  # the first edit takes longest
                    times.setdefault(what, []).append(value)
            page.wait_for_timeout(1000 * every)
    for what, of in times.items():
        print_times(what, of)


def print_times(what: str, times: Sequence[float]) -> None:
    many = sorted(times)
    share = many[min(math.ceil(0.95 * len(many)), len(many) - 1)]
    median = statistics.median(many)
    print(f"{what:18} median {median:6.1f} ms, 95 % {share:6.1f} ms, greatest {many[-1]:6.1f} ms, {len(many)}")


def print_profile(profile: dict[str, Any], count: int) -> None:
    """The functions with the most time of their own."""
    own: Counter[str] = Counter()
    names = {node["id"]: node["callFrame"] for node in profile["nodes"]}
    for node, spent in zip(profile["samples"], profile["timeDeltas"], strict=True):
        frame = names[node]
        own[f"{frame['functionName'] or 'anonymous'}:{frame['lineNumber']}:{frame['columnNumber']}"] += spent
    for name, spent in own.most_common(count):
        print(f"{spent / 1e3:8.1f} ms  {name}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["track", "ghost", "map"])
    parser.add_argument("--points", type=int, default=60)
    parser.add_argument("--moves", type=int, default=180)
    parser.add_argument("--profile", type=int, default=0)
    parser.add_argument("--modules", type=int, default=100)
    parser.add_argument("--edits", type=int, default=10)
    parser.add_argument("--running", action="store_true")
    parser.add_argument("--every", type=float, default=1.0)
    given = parser.parse_args()
    if given.what == "track":
        time_moves(EditTrack(track_of(given.points)), dragged, given.moves, given.profile)
    elif given.what == "ghost":
        time_moves(EditMap({**town(given.modules)}), placed, given.moves, given.profile)
    else:
        edit_map(given.modules, given.edits, every=given.every, is_running=given.running)


if __name__ == "__main__":
    main()
