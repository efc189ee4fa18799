"""Films, read back with FFmpeg."""

from __future__ import annotations

import contextlib
import gc
import os
import sys
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from autodrive.base.errors import AutodriveError
from autodrive.protocol.native import SetCamera
from autodrive.recording.film import FilmOptions, film
from autodrive.recording.film.film import image_times
from autodrive.recording.film.overlay import with_overlay
from autodrive.recording.film.video import CODECS, Video
from autodrive.recording.replay.tape import Tape

SMALL = (320, 180)


def read(path: Path) -> tuple[str, float, list[NDArray[np.uint8]]]:
    """Codec, images per second, and images."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        images = [np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in container.decode(stream)]
        codec = stream.codec_context.codec.canonical_name
        return codec, float(stream.average_rate or 0), images


@pytest.mark.parametrize(("name", "codec"), [("lap.mp4", "av1"), ("lap.webm", "vp9")])
def test_a_film_has_the_images_of_its_time_in_a_free_codec(
    gl: str, tape: Tape, tmp_path: Path, name: str, codec: str
) -> None:
    options = FilmOptions("Bird's Eye", start=0.5, end=1.5, speed=2.0, rate=20.0, size=SMALL)
    seen: list[tuple[int, int]] = []
    count = film(tape, tmp_path / name, options, lambda done, total: seen.append((done, total)))
    found = read(tmp_path / name)
    assert found[:2] == (codec, 20.0)
    assert count == len(found[2]) == 11
    assert seen == [(i, 11) for i in range(1, 12)]
    assert {image.shape for image in found[2]} == {(180, 320, 3)}
    assert found[2][0].std() > 20
    assert [path.name for path in tmp_path.iterdir()] == [name]  # no temporary file stays


def scheduling() -> set[tuple[int, int, int]]:
    """Policy, real-time priority and nice value of all threads of this process."""
    found: set[tuple[int, int, int]] = set()
    for name in os.listdir("/proc/self/task"):
        with contextlib.suppress(ProcessLookupError):  # the thread has just ended
            thread = int(name)
            policy, priority = os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority
            found.add((policy, priority, os.getpriority(os.PRIO_PROCESS, thread)))
    return found


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("codec", [*CODECS])
def test_an_encoder_changes_the_scheduling_of_no_thread(tmp_path: Path, codec: str) -> None:
    """The encoder of AV1 does so for root, as whom tests run in containers; other users cannot get such a policy."""
    before = scheduling()
    capabilities = Path("/proc/thread-self/status").read_text(encoding="ascii")
    with Video(tmp_path / "noise.mkv", SMALL, 25.0, codec) as video:
        assert scheduling() == before
        for image in np.random.default_rng(1).integers(0, 255, (60, SMALL[1], SMALL[0], 3), np.uint8):
            video.write(image)
            assert scheduling() == before
    assert scheduling() == before
    after = Path("/proc/thread-self/status").read_text(encoding="ascii")
    assert [line for line in after.splitlines() if line.startswith("Cap")] == [
        line for line in capabilities.splitlines() if line.startswith("Cap")
    ]


def test_a_film_can_have_another_light_and_an_overlay(gl: str, tape: Tape, tmp_path: Path) -> None:
    images = {}
    for light in ("day", "night", "22"):
        for overlay in (False, True):
            path = tmp_path / f"{light}-{overlay}.mkv"
            film(tape, path, FilmOptions(end=0.02, size=SMALL, light=light, overlay=overlay))
            images[light, overlay] = read(path)[2][0].astype(float)
    assert images["night", False].mean() < 0.6 * images["day", False].mean()
    assert np.array_equal(images["22", False], images["night", False])  # the sun is deep below the horizon
    difference = np.abs(images["day", True] - images["day", False])
    assert difference[150:175, 6:80].mean() > 20
    assert difference[:120, 160:].mean() < 2  # lossy, but the same picture


def test_sensor_cameras_and_other_vehicles_can_be_filmed(gl: str, tape: Tape, tmp_path: Path) -> None:
    pictures = []
    for camera in ("front", "V2/rear"):
        film(tape, tmp_path / "sensor.webm", FilmOptions(camera, end=0.02))
        pictures.append(read(tmp_path / "sensor.webm")[2][0].astype(float))
    assert {picture.shape for picture in pictures} == {(480, 640, 3)}
    assert np.abs(pictures[0] - pictures[1]).mean() > 5


def test_a_camera_at_a_position_sees_what_another_camera_sees_there(gl: str, tape: Tape, tmp_path: Path) -> None:
    x, y, _ = tape.frame_at(0.0).vehicles["V1"].pose.position.tolist()
    straight_down = SetCamera(None, position=(x, y, 3.0), elevation=-0.5 * np.pi)
    for name, options in (("bird", FilmOptions("Bird's Eye")), ("fly", FilmOptions("Fly", view=straight_down))):
        film(tape, tmp_path / f"{name}.webm", replace(options, vehicle="V1", end=0.02, size=SMALL))
    bird, fly = (read(tmp_path / f"{name}.webm")[2][0].astype(float) for name in ("bird", "fly"))
    assert np.abs(bird - fly).mean() < 0.5  # lossy, but the same picture


@pytest.mark.parametrize(
    ("options", "name", "expected"),
    [
        (FilmOptions("Gods Eye"), "a.mp4", "Did you mean 'God's Eye'"),
        (FilmOptions("V9/front"), "a.mp4", "vehicle 'V9' is not known"),
        (FilmOptions(light="noon"), "a.mp4", "such as 18.5, not 'noon'"),
        (FilmOptions(), "a.avi", "must end with one of .mp4, .webm, .mkv"),
        (FilmOptions(codec="h264"), "a.mp4", "codec 'h264' is not known"),
        (FilmOptions(size=(3, 180)), "a.mp4", "from 4 to 8192 pixels, not (3, 180)"),
        (FilmOptions("front", size=SMALL), "a.mp4", "leave out the size"),
        (FilmOptions(start=99.0), "a.mp4", "must begin before it ends"),
        (FilmOptions(rate=0.0), "a.mp4", "rate"),
    ],
)
def test_what_cannot_be_filmed_is_refused(
    gl: str, tape: Tape, tmp_path: Path, options: FilmOptions, name: str, expected: str
) -> None:
    with pytest.raises(AutodriveError) as refused:
        film(tape, tmp_path / name, options)
    assert expected in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_images_are_at_equal_times() -> None:
    times = image_times(10.0, FilmOptions(start=1.0, end=2.0, speed=0.5, rate=10.0))
    np.testing.assert_allclose(times, np.linspace(1.0, 2.0, 21))


def test_the_overlay_shows_speed_and_side() -> None:
    plain = np.full((720, 1280, 3), 90, np.uint8)
    figures = {"speed": 0.13, "speed_limit": 0.26, "steering_limit": 0.5}
    left, right, ahead = (with_overlay(plain, steering=angle, **figures) for angle in (0.5, -0.5, 0.0))
    knob = [np.nonzero((image[690:704, 60:320] == (125, 180, 255)).all(-1).any(0))[0].mean() for image in (left, right)]
    assert knob[0] < knob[1]  # a left turn is on the left
    bar = (ahead[660, 40:300] == (125, 180, 255)).all(-1)
    assert bar.sum() == pytest.approx(130, abs=2)  # half of the speed limit
    np.testing.assert_array_equal(ahead[:600], plain[:600])
    still, back = (with_overlay(plain, **(figures | {"speed": v}), steering=v) for v in (0.0, -1e-4))
    np.testing.assert_array_equal(still[610:650], back[610:650])  # the figures: no "-0.00"
    tiny = with_overlay(plain[:16, :16], steering=0.1, **figures)
    assert tiny.shape == (16, 16, 3)


@pytest.mark.parametrize("codec", [*CODECS])
def test_an_error_leaves_no_file_and_no_lines_of_the_encoder(
    tmp_path: Path, codec: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C is such an error; encoders write to the streams of the process."""

    def write() -> None:
        with Video(tmp_path / "broken.mp4", SMALL, 30.0, codec) as video:
            video.write(np.zeros((180, 320, 3), np.uint8))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    gc.collect()  # the encoder writes when its memory is freed
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


CUES, CLUSTER = bytes.fromhex("1c53bb6b"), bytes.fromhex("1f43b675")
"""Elements of Matroska (RFC 9559): the index, and the first images."""
STRIPE = 21
"""Width of the stripe of each colour [pixels]."""
COLOURS = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255), (0, 0, 0), (128, 128, 128), (200, 40, 120)]
COLOUR_ERROR = 3.0
"""Y, Cb and Cr are whole numbers: half of one changes a colour by 0.6 + 1.1 levels; the rest is the lossy codec."""


def rgb_of_bt_709(y: float, cb: float, cr: float) -> NDArray[np.float64]:
    """ITU-R BT.709-6, 3.2 to 3.5, with 8 bits: R'G'B' from 0 to 255."""
    luma, blue, red = (y - 16) / 219, (cb - 128) / 224 * 1.8556, (cr - 128) / 224 * 1.5748
    green = (-0.0722 * blue - 0.2126 * red) / 0.7152
    return 255.0 * (luma + np.array([red, green, blue]))


@pytest.mark.parametrize(
    ("name", "index", "first_image"),
    [("a.mp4", b"moov", b"mdat"), ("a.webm", CUES, CLUSTER), ("a.mkv", CUES, CLUSTER)],
    ids=["mp4", "webm", "mkv"],
)
def test_a_video_has_the_colours_of_its_images_and_is_tagged_so(
    tmp_path: Path, name: str, index: bytes, first_image: bytes
) -> None:
    """A player may begin before it has the whole file, and at any second; images of an odd size are padded."""
    stripes = np.repeat(np.array(COLOURS, np.uint8), STRIPE, axis=0)
    with Video(tmp_path / name, (len(stripes), 45), 12.5) as video:
        for _ in range(30):
            video.write(np.tile(stripes, (45, 1, 1)))
    with av.open(str(tmp_path / name)) as container:
        stream = container.streams.video[0]
        context = stream.codec_context
        tags = [context.colorspace, context.color_primaries, context.color_trc, context.color_range]
        assert tags == [1, 1, 1, 1]  # BT.709 three times (ITU-T H.273), and FFmpeg's number of the limited range
        assert (context.width, context.height, stream.average_rate) == (148, 46, 12.5)
        assert container.duration == 2.4 * av.time_base
        frames = list(container.decode(stream))
    assert [i for i, frame in enumerate(frames) if frame.key_frame] == [0, 12, 24]
    assert len(frames) == 30
    rgb, ycbcr = (frames[-1].reformat(format=form).to_ndarray() for form in ("rgb24", "yuv444p"))
    for i, colour in enumerate(COLOURS):
        middle = STRIPE * i + STRIPE // 2
        np.testing.assert_allclose(rgb[22, middle], colour, atol=COLOUR_ERROR)
        np.testing.assert_allclose(rgb_of_bt_709(*ycbcr[:, 22, middle].tolist()), colour, atol=COLOUR_ERROR)
    np.testing.assert_allclose(rgb[45, 147], COLOURS[-1], atol=COLOUR_ERROR)  # the pixel in the corner is padding
    content = (tmp_path / name).read_bytes()
    assert 0 < content.rfind(index) < content.find(first_image)
