"""Makes the film of builder.md: a town and a track are built, driven on and sent.

`python -m docs.images.builder_film town,link film.webm` writes some parts only, to another file.
"""

from __future__ import annotations

import sys
from pathlib import Path

from autodrive.protocol.messages import SetTrafficLight, TrafficLightState
from autodrive.recording.film.video import Video
from docs.images.filmed_page import FilmedPage, filmed_page

FILE = Path(__file__).parent / "builder.webm"
SIZE = 1024, 640
RATE = 5
"""Images per second of the film."""


def town(film: FilmedPage) -> None:
    """A figure eight of roads with a traffic light, and a car that drives on it."""
    page, simulation = film.page, film.simulation
    film.caption("A town: start from an empty lawn")
    film.begin_to_build()
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
    film.drive(5.0, speed=1.5)
    simulation.request(SetTrafficLight(light, TrafficLightState.GREEN)).result()
    film.caption("Drive: the light is green", 0.2)
    film.drive(10.0, speed=2.2)


def track(film: FilmedPage) -> None:
    """A race track by points, and a car that laps it with its LIDAR."""
    page = film.page
    film.load("practice")
    film.caption("A race track: drag its points")
    film.begin_to_build()
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
    film.caption("Drive: a policy races with the LIDAR", 0.5)
    film.click("build-done")
    page.evaluate('() => { autodrive.store.camera.value = "Driver\'s Eye" }')
    film.wait_for_image()
    film.drive(16.0)


def link(film: FilmedPage) -> None:
    """The track is sent as a link, and opened by somebody else."""
    page = film.page
    film.caption("Save: a file, or a link that contains the map")
    film.begin_to_build()
    film.click("build-save")
    film.take(2.0)
    page.get_by_test_id("save-kind").select_option("link")
    film.click("save-map-save")
    film.wait(lambda: page.get_by_test_id("map-link").is_visible())
    film.caption("Send the link", 3.0)
    address = page.get_by_test_id("map-link").inner_text()
    film.load("practice")
    film.open(address)
    film.caption("Somebody else opens it in the page of a running simulator")
    film.click("link-changes-apply")
    film.wait_for_track()
    film.click("build-done")
    page.evaluate('() => { autodrive.store.camera.value = "Driver\'s Eye" }')
    film.wait_for_image()
    film.caption("... and drives on your track", 0.2)
    film.drive(9.0)
    film.caption("Build, in the toolbar of the page")


def main() -> None:
    """Write the film."""
    chosen = (sys.argv[1] if len(sys.argv) > 1 else "town,track,link").split(",")
    parts = [part for part in (town, track, link) if part.__name__ in chosen]
    file = Path(sys.argv[2]) if len(sys.argv) > 2 else FILE
    with Video(file, SIZE, RATE) as video, filmed_page("plane", SIZE, RATE, video.write) as film:
        film.caption("Your own town and track, in the browser", 3.0)
        for part in parts:
            part(film)
    print(f"{file}: {file.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
