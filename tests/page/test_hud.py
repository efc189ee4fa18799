"""Each row of the HUD (report, table 13, and more) says what the Frame says; pictures and plots are drawn."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser

from autodrive.protocol.messages import Command, Frame, Pause, SetSceneLight, Step, VehicleFrame
from tests.page.conftest import visits_with
from tests.page.visits import Served, Visit

COLOURS = """(of) => {
    const { data } = of.getContext('2d').getImageData(0, 0, of.width, of.height)
    return new Set(new Uint32Array(data.buffer)).size
}"""
"""How many a canvas shows."""


@pytest.fixture(scope="module")
def tab(served: Served, browser: Browser) -> Iterator[Visit]:
    served.renew("mini_map")
    with visits_with(browser) as visitor:
        visit = visitor(size=(1280, 1600)).go(served.url + "?quality=low")
        visit.press("hud-button")
        yield visit


@pytest.fixture
def visit(mini_map: Served, tab: Visit) -> Visit:
    return tab.until_begun(mini_map)


@pytest.fixture
def moment(mini_map: Served, visit: Visit) -> Frame:
    """The world stands still in reverse to the left, with lamps on, and the page shows it."""
    mini_map.ask(Pause())
    command = Command(throttle=-0.8, steering=0.6, headlights=2, indicators=3)  # type: ignore[arg-type]
    for _ in range(15):
        mini_map.ask(Step(4, {"V1": command}))
    frame = mini_map.ask(Step(1, {"V1": command}))
    visit.until(lambda: visit.knows("store.frame.value.tick") == frame.tick)
    last = visit.get("hud-nearest")  # of all that the HUD writes, the last and the rarest
    last.evaluate("of => { of.textContent = 'not yet' }")
    visit.until(lambda: last.text_content() != "not yet")
    return frame


def only(frame: Frame) -> VehicleFrame:
    return next(iter(frame.vehicles.values()))


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", text)]


def test_rows_of_the_vehicle_say_what_the_frame_says(visit: Visit, moment: Frame) -> None:
    vehicle = only(moment)
    assert vehicle.speed < -0.01, "the drive is meant to be in reverse"
    assert visit.text("hud-time") == time.strftime("%H:%M:%S", time.gmtime(moment.time + 1e-6))
    assert visit.text("hud-mode") == "Manual"
    assert visit.text("hud-gear") == "R"
    assert visit.text("hud-speed") == f"{-vehicle.speed:.2f} m/s"
    assert visit.text("hud-throttle") == "80.00%"
    assert visit.text("hud-steering") == f"{-vehicle.steering:.2f} rad"  # right turns are positive, as in the report
    assert visit.text("hud-collisions") == str(vehicle.collision_count)
    assert visit.text("hud-encoders") == f"[{', '.join(map(str, vehicle.encoders.ticks))}]"
    assert re.fullmatch(r"\d+ Hz", visit.text("hud-frame-rate"))


@pytest.mark.parametrize(
    ("row", "unit"),
    [("position", "m"), ("orientation", "rad"), ("angular-velocity", "rad/s"), ("linear-acceleration", "m/s²")],
)
def test_rows_of_ips_and_imu_say_what_the_frame_says(visit: Visit, moment: Frame, row: str, unit: str) -> None:
    vehicle = only(moment)
    truth = {
        "position": vehicle.ips.position,
        "orientation": vehicle.imu.euler,
        "angular-velocity": vehicle.imu.angular_velocity,
        "linear-acceleration": vehicle.imu.linear_acceleration,
    }[row]
    text = visit.text(f"hud-{row}")
    assert text.endswith(f"] {unit}")
    assert numbers(text)[:3] == pytest.approx(truth, abs=0.0051)


def test_measurement_of_the_lidar_is_one_of_the_scan(visit: Visit, moment: Frame) -> None:
    scan = only(moment).lidar
    assert scan is not None
    text = visit.text("hud-lidar")
    assert text == "inf m" or np.isclose(scan.ranges, numbers(text)[0], atol=0.0051).any()
    nearest = scan.ranges[np.isfinite(scan.ranges)].min()
    assert numbers(visit.text("hud-nearest"))[0] == pytest.approx(nearest, abs=0.0051)


def test_lamps_are_shown(visit: Visit, moment: Frame) -> None:
    lights = only(moment).lights
    lit = {"low": "off", "high": "on", "reverse": "on" if lights.reverse_lights else "off"}
    lit["left"] = lit["right"] = "on" if lights.left_indicator else "off"
    for lamp, state in lit.items():
        visit.until(lambda lamp=lamp, state=state: visit.get(f"hud-lamp-{lamp}").get_attribute("data-lit") == state)


def test_polar_plot_and_time_plots_are_drawn(visit: Visit, mini_map: Served) -> None:
    visit.page.keyboard.down("w")
    visit.until(lambda: mini_map.vehicle.speed > 0.2)
    visit.page.keyboard.up("w")
    plots = [visit.get("hud-polar"), *visit.get("hud-plot").all()]
    assert len(plots) == 3
    for plot in plots:
        canvas = plot.locator("canvas").first
        canvas.evaluate("of => of.scrollIntoView()")
        visit.until(lambda canvas=canvas: canvas.evaluate(COLOURS) > 10)


def test_rows_of_the_simulation_say_who_is_there(visit: Visit, mini_map: Served) -> None:
    visit.until(lambda: visit.text("hud-viewers") == "1")
    visit.until(lambda: visit.text("hud-driver") == "Nobody")
    visit.page.keyboard.down("w")
    visit.until(lambda: visit.text("hud-driver") == "You")
    visit.page.keyboard.up("w")
    assert visit.text("hud-bridge") == "Disconnected"
    visit.until(lambda: numbers(visit.text("hud-rtf"))[0] > 0.1)


def test_front_and_rear_previews_show_what_the_sensors_see(gl: str, visit: Visit, mini_map: Served) -> None:
    grid = """(of) => { const small = Object.assign(document.createElement('canvas'), { width: 8, height: 6 })
        const context = small.getContext('2d')
        context.drawImage(of, 0, 0, 8, 6)
        return [...context.getImageData(0, 0, 8, 6).data] }"""

    def seen(side: str) -> np.ndarray:
        values = visit.get(f"hud-{side}-camera").locator("canvas").evaluate(grid)
        return np.array(values, float).reshape(6, 8, 4)[..., :3]

    for side in ("front", "rear"):
        visit.until(lambda side=side: visit.get(f"hud-{side}-camera").get_attribute("data-state") == "live")
        visit.until(lambda side=side: seen(side).std() > 10)  # not of one colour
        truth = mini_map.vehicle.cameras[side].rgb
        rows, columns = truth.shape[0] // 6, truth.shape[1] // 8
        cells = truth[: 6 * rows, : 8 * columns].reshape(6, rows, 8, columns, 3).mean((1, 3))
        assert np.abs(seen(side) - cells).mean() < 25  # the page's browser shrinks otherwise than we do
    day = seen("front").mean()
    mini_map.ask(SetSceneLight(False))
    visit.until(lambda: seen("front").mean() < 0.7 * day)


def test_notice_of_leaving_the_road_stands_in_the_hud(visit: Visit, mini_map: Served) -> None:
    assert visit.text("hud-offroad") == "On road"
    visit.page.keyboard.down("w")
    visit.page.keyboard.down("a")
    visit.until(lambda: visit.text("hud-offroad") == "Off road")
    visit.until_text("notices", "V1 left the road")
    visit.page.keyboard.up("w")
    visit.page.keyboard.up("a")
