"""Files of the user in a real browser: pictures of maps become tracks that can be driven."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
import shapely

from autodrive import Command
from autodrive.base.png import encode_png
from autodrive.protocol.messages import Pause, Step
from autodrive.scenario.tracks.importer import export_track
from autodrive.scenario.tracks.track import Track
from tests.page.test_track_builder import opened
from tests.support.page import NewTab, PageServer, Tab

DROP = """files => {
    const data = new DataTransfer()
    for (const [name, text] of files)
        data.items.add(new File([Uint8Array.from(atob(text), one => one.charCodeAt(0))], name))
    window.dispatchEvent(new DragEvent('drop', { dataTransfer: data, cancelable: true }))
}"""


def drop(tab: Tab, *files: tuple[str, bytes]) -> None:
    tab.page.evaluate(DROP, [[name, base64.b64encode(content).decode()] for name, content in files])


def track_of(server: PageServer) -> Track | None:
    return server.simulation.world.map.track


def drive(server: PageServer) -> None:
    """Half a second straight ahead from the start: the car moves, and touches nothing."""
    track = track_of(server)
    assert track is not None
    x, y = server.simulation.frame.vehicles["V1"].pose.position[:2]
    before = track.project(x, y)[0]
    server.request(Step(100, {"V1": Command(throttle=1.0)}))
    car = server.simulation.frame.vehicles["V1"]
    x, y = car.pose.position[:2]
    assert 0.05 < (track.project(x, y)[0] - before) % track.length < 1.0
    assert car.collision_count == 0


def test_a_dropped_map_of_map_server_becomes_a_track(plane: PageServer, new_tab: NewTab, tmp_path: Path) -> None:
    given = Track.load("practice")
    export_track(given, tmp_path)
    picture, sheet = ((tmp_path / f"practice_map.{kind}").read_bytes() for kind in ("png", "yaml"))
    tab = opened(plane, new_tab)
    plane.request(Pause())
    drop(tab, ("practice_map.yaml", sheet))
    tab.wait_for_notice("practice_map.yaml describes the picture practice_map.png. Drop that picture, too.")
    drop(tab, ("practice_map.png", picture))
    tab.get("picture").wait_for()
    assert "practice_map.yaml has the scale" in tab.text("picture-scale")
    assert not tab.get("picture-length").is_visible()
    tab.click("picture-use")
    tab.wait_until(lambda: track_of(plane) is not None)
    track = track_of(plane)
    assert track is not None
    assert track.length == pytest.approx(given.length, rel=0.02)
    lines = [shapely.MultiLineString([shapely.LinearRing(wall) for wall in each.walls]) for each in (track, given)]
    assert shapely.hausdorff_distance(*lines, densify=0.02) < 0.05  # a pixel
    tab.get("picture").wait_for(state="detached")
    tab.wait_until(lambda: tab.value("store.scene.value.track_scene?.is_exact") is False)
    tab.wait_for_notice("direction and start line are guesses")
    drive(plane)


def drawing() -> bytes:
    """Black walls on white paper, 400 x 300 pixels: a ring whose outer wall is 360 pixels long along x."""
    image = np.full((300, 400), 255, np.uint8)
    for margin in (20, 70):
        image[margin : 300 - margin, margin : 400 - margin] = 0
        image[margin + 4 : 296 - margin, margin + 4 : 396 - margin] = 255
    return encode_png(image)


def test_a_drawing_becomes_a_track_with_a_scale_that_the_user_draws(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab)
    plane.request(Pause())
    drop(tab, ("my drawing.png", drawing()))
    canvas = tab.get("picture-canvas")
    canvas.wait_for()
    box = canvas.bounding_box()
    assert box is not None
    assert box["width"] / box["height"] == pytest.approx(4 / 3, rel=0.02)

    def click(x: float, y: float) -> None:
        canvas.click(position={"x": x * box["width"] / 400, "y": y * box["height"] / 300})

    assert tab.get("picture-use").is_disabled()
    click(20, 150)
    click(380, 150)
    tab.get("picture-length").fill("18")  # 360 pixels: 0.05 m a pixel
    assert float(tab.get("picture-resolution").input_value()) == pytest.approx(0.05, rel=0.02)
    tab.page.locator("[data-testid=picture-mode] button[value=start]").click()
    click(200, 150)
    tab.click("picture-use")  # the area within the inner wall is no ring
    tab.get("picture-error").wait_for()
    assert track_of(plane) is None
    canvas.focus()  # by keys: from there 105 pixels upwards, in steps of a fiftieth of the width and of a pixel
    for key in (*["ArrowUp"] * 13, "Shift+ArrowUp", "Enter"):
        tab.page.keyboard.press(key)
    tab.click("picture-use")
    tab.wait_until(lambda: track_of(plane) is not None)
    track = track_of(plane)
    assert track is not None
    # the middle of the ring is 46 pixels from the edges of the paper on each side, so that it is 2 (308 + 208) long
    assert track.length == pytest.approx(2 * (308 + 208) * 0.05, rel=0.06)  # its corners are round
    tab.get("picture").wait_for(state="detached")
    drive(plane)


@pytest.fixture
def folder(plane: PageServer) -> Path:
    """The empty folder of the user."""
    for path in plane.folder.iterdir():
        path.unlink()
    return plane.folder
