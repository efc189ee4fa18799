"""A link that changes the simulator: any page can open it without a click, so the page asks first."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from tests.support.page import NewTab, PageServer

PACKED_TRACK = """async text => {
    const bytes = new TextEncoder().encode(text)
    const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream('deflate'))
    const packed = new Uint8Array(await new Response(stream).arrayBuffer())
    return `${bytes.length}.${btoa(String.fromCharCode(...packed)).replaceAll('+', '-').replaceAll('/', '_')}`
}"""
TRACK = "points: [0 0, 9 0, 9 6, 0 6]\nwidth: 1.0\n"


@contextlib.contextmanager
def foreign_page(link: str) -> Iterator[str]:
    """A page of another origin that opens a link without a click; its address."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(f"<script>setTimeout(() => location.replace({link!r}))</script>".encode())

        def log_message(self, format: str, *args: object) -> None:
            """Print nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://localhost:{server.server_port}/"
        server.shutdown()


def state(plane: PageServer) -> tuple[object, ...]:
    frame = plane.frame
    return plane.simulation.world.map.track is None, frame.weather, frame.time_of_day


@pytest.mark.parametrize("answer", ["cancel", "apply"])
def test_the_page_asks_once_before_a_link_changes_the_simulator(
    plane: PageServer, new_tab: NewTab, answer: str
) -> None:
    before = state(plane)
    tab = new_tab()
    tab.page.goto(plane.url)
    track = tab.page.evaluate(PACKED_TRACK, TRACK)
    with foreign_page(f"{plane.url}#weather=heavy_fog&time=18:30&own_map={track}") as address:
        tab.page.goto(address)
        tab.get("link-changes").wait_for()
    changes = tab.get("link-changes").locator("li").all_text_contents()
    assert sorted(changes) == ["Another map, which is in the link", "Time of day: 18:30", "Weather: heavy_fog"]
    assert state(plane) == before
    tab.click(f"link-changes-{answer}")
    if answer == "apply":
        tab.wait_until(lambda: plane.simulation.world.map.track is not None and plane.frame.weather is not None)
        tab.wait_until(lambda: abs((plane.frame.time_of_day or 0.0) - 66600.0) < 1.0)
    else:
        tab.wait_until(lambda: "own_map" not in tab.page.url and "weather" not in tab.page.url)
        assert state(plane) == before
    tab.wait_until(lambda: tab.get("link-changes").count() == 0)  # one question for all
    tab.page.reload()  # the link shows the state of the simulator: nothing to ask
    tab.wait_until(lambda: tab.value("store.link.value === 'open' && !!store.frame.value"))
    tab.page.wait_for_timeout(300)
    assert tab.get("link-changes").count() == 0
