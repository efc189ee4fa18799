"""Recording and replay in the page. The rules of the timeline are tested in web/tests/replay.test.ts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest

from autodrive import recording
from autodrive.connect.server.served import PageOptions
from autodrive.protocol.messages import Teleport
from autodrive.recording.replay import Replay, ReplayOptions
from autodrive.recording.resimulation import resimulate
from tests.recording.conftest import Drive, drive
from tests.support.page import NewTab, PageServer, Tab, box

__all__ = ["drive"]


@pytest.fixture
def replay(built: Path, drive: Drive) -> Iterator[Replay]:
    with Replay(drive.path, ReplayOptions(is_paused=True, page=PageOptions(port=0))) as running:
        yield running


def test_the_film_button_downloads_a_film_of_the_view(mini_map: PageServer, new_tab: NewTab, tmp_path: Path) -> None:
    tab = new_tab(size=(640, 480), draws=True).open(f"{mini_map.url}?quality=low#camera=birds-eye")
    tab.wait_for_image()
    tab.show("menu", tab="view")
    tab.click("film")
    count = tab.value("store.imageCount.value")
    tab.wait_until(lambda: tab.value("store.imageCount.value") > count + 5)
    with tab.page.expect_download() as download:
        tab.click("film")
    assert download.value.suggested_filename.startswith("mini_map-")
    path = tmp_path / "film.webm"
    download.value.save_as(path)
    with av.open(str(path)) as film:
        images = [np.asarray(frame.to_ndarray(format="rgb24")) for frame in film.decode(film.streams.video[0])]
        assert film.streams.video[0].codec_context.codec.canonical_name in {"av1", "vp9", "vp8"}
    assert len(images) > 1
    assert images[-1].std() > 10


def test_a_replay_has_no_build_mode(replay: Replay, new_tab: NewTab) -> None:
    tab = new_tab(size=(1024, 700)).open(replay.server.url)
    tab.wait_until(lambda: tab.get("build-button").is_disabled())
    assert (tab.get("build-button").get_attribute("title") or "").startswith("This is a replay of 'drive.mcap'")
    tab.page.keyboard.press("z")
    tab.wait_for_notice("This is a replay of")
    assert not tab.value("store.isBuilding.value")
    assert not tab.get("build-bar").is_visible()


NOTE_TEXTS = """
window.ends = []
const fillText = CanvasRenderingContext2D.prototype.fillText
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  const width = this.measureText(text).width
  const [left, right] = this.textAlign === 'right' ? [x - width, x] : [x, x + width]
  if (this.canvas.className === 'timeline-marks') ends.push([text, left, right, this.canvas.clientWidth])
  fillText.call(this, text, x, y)
}
"""


def test_no_time_of_the_timeline_is_cut(replay: Replay, new_tab: NewTab) -> None:
    for width in range(600, 700, 20):
        tab = new_tab(size=(width, 500), script=NOTE_TEXTS).open(replay.server.url)
        tab.wait_until(lambda tab=tab: tab.page.evaluate("() => ends.length > 3"))
        cut = [each for each in tab.page.evaluate("() => ends") if each[1] < 0 or each[2] > each[3]]
        assert cut == []


def position(tab: Tab) -> float:
    return tab.value("store.status.value.position")


def test_the_timeline_shows_any_time_and_all_viewers_see_it(replay: Replay, drive: Drive, new_tab: NewTab) -> None:
    duration = replay.tape.duration
    tab, other = (new_tab(size=(1024, 700)).open(replay.server.url) for _ in range(2))
    assert tab.text("timeline-file") == "drive.mcap"
    assert tab.text("timeline-time").startswith("00:00:00.00 / 00:00:0")

    # a click on the track: its ends have a margin of 48 px
    track = box(tab.get("timeline"))
    width = track["right"] - track["left"] - 96
    tab.page.mouse.click(track["left"] + 48 + 0.25 * width, track["bottom"] - 10)
    for each in (tab, other):
        each.wait_until(lambda each=each: position(each) == pytest.approx(0.25 * duration, abs=0.01))
        each.wait_until(lambda each=each: each.value("store.frame.value.tick") == int(100 * position(each) + 1e-6))
    tick = tab.value("store.frame.value.tick")
    assert tab.value("store.frame.value.vehicles.V1.pose.position[0]") == pytest.approx(
        drive.frames[tick].vehicles["V1"].pose.position[0]
    )

    # steps with keys, one in each direction
    tab.page.keyboard.press(".")
    tab.wait_until(lambda: tab.value("store.frame.value.tick") == tick + 1)
    tab.page.keyboard.press(",")
    tab.wait_until(lambda: tab.value("store.frame.value.tick") == tick)

    # jumps through all events
    marks = replay.tape.marks
    first = next(mark for mark in marks if mark.time > position(tab))
    other.click("next-event")
    tab.wait_until(lambda: position(tab) == pytest.approx(first.time))
    other.wait_for_notice("V1")

    # the arrows move the slider when it has the focus, and do not drive
    tab.get("timeline").focus()
    tab.page.keyboard.press("Home")
    tab.wait_until(lambda: position(tab) == 0)
    tab.page.keyboard.press("ArrowRight")
    tab.wait_until(lambda: position(tab) == pytest.approx(1.0))
    tab.page.evaluate("() => document.activeElement.blur()")

    tab.get("timeline-speed").select_option("16")
    tab.click("play")
    other.wait_until(lambda: position(other) == pytest.approx(duration) and other.value("store.status.value.is_paused"))


def test_the_page_records_the_simulation_and_keeps_its_last_seconds(
    two_cars: PageServer, tab: Tab, tmp_path: Path
) -> None:
    tab.show("menu", tab="view")
    tab.click("record-button")
    tab.wait_until(lambda: tab.value("store.status.value.recording.state") == "recording")
    two_cars.request(Teleport("V1", 0.5, 0.25))
    tick = two_cars.frame.tick
    tab.wait_until(lambda: two_cars.frame.tick > tick + 20)
    tab.click("record-button")
    tab.wait_for_text("recorded-text", "Recorded two_cars-")
    path = Path(tab.value("store.status.value.recording.file"))
    with recording.open(path) as opened:
        assert opened.duration > 0.2
        assert opened.frame_at(opened.end).vehicles["V1"].pose.position[0] == pytest.approx(0.5, abs=0.05)
        assert [type(note.request).__name__ for _, note in opened.requests] == ["Teleport"]
        assert opened.start_tick > 0
        assert str(resimulate(opened)) == "identical"
    with tab.page.expect_download() as download:
        tab.click("recorded-download")
    assert download.value.suggested_filename == path.name
    download.value.save_as(tmp_path / path.name)
    assert (tmp_path / path.name).read_bytes() == path.read_bytes()
    tab.get("recording-keep").select_option("30")
    tab.click("record")
    tab.wait_until(lambda: tab.value("store.status.value.recording.state") == "keeping")
    tab.click("save-recording")
    tab.wait_until(lambda: tab.value("store.status.value.recording.download") not in ("", path.name))
    kept = Path(tab.value("store.status.value.recording.file"))
    assert kept != path
    with recording.open(kept) as opened:
        assert opened.duration > 1.0  # it contains a second after the request
    tab.click("record")
    tab.wait_until(lambda: tab.value("store.status.value.recording.state") == "off")
    tab.get("recording-keep").select_option("all")
    tab.click("recorded-close")
    assert not tab.get("recorded").is_visible()


def test_the_page_replays_and_films_what_it_has_recorded(plane: PageServer, tab: Tab, tmp_path: Path) -> None:
    tab.click("record-button")
    tab.wait_until(lambda: tab.value("store.status.value.recording.duration") > 0.5)
    tab.click("record-button")
    tab.wait_for_text("recorded-text", "Recorded plane-")
    with tab.page.expect_download() as download:
        tab.click("recorded-film")
        assert tab.get("recorded-film").get_attribute("aria-busy") == "true" or tab.get("recorded-film").is_disabled()
    assert download.value.suggested_filename.startswith("plane-")
    assert download.value.suggested_filename.endswith(".webm")
    download.value.save_as(tmp_path / "film.webm")
    with av.open(str(tmp_path / "film.webm")) as film:
        assert sum(1 for _ in film.decode(film.streams.video[0])) > 10
    with tab.page.expect_popup() as popup:
        tab.click("recorded-replay")
    shown = popup.value
    shown.get_by_test_id("timeline-file").get_by_text("plane-").wait_for()
    shown.close()
    tab.click("recorded-close")
