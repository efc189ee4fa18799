"""Drawings of programs in a recording: what a replay shows at each time, and what a film shows of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder
from numpy.typing import NDArray

import autodrive
from autodrive.protocol.messages import Seek
from autodrive.protocol.native import SetCamera
from autodrive.recording import Recorder
from autodrive.recording.film import FilmOptions, film
from autodrive.recording.replay.player import Player, Stage
from autodrive.recording.replay.tape import Tape
from autodrive.scenario import ScenarioSpec

MAGENTA = "#ff00ff"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """1 s: a path at 0.2 s, points until 0.6 s, another path at 0.5 s; a reset, and a text 0.2 s after it."""
    path = tmp_path_factory.mktemp("recordings") / "drawn.mcap"
    world = autodrive.make("plane")
    ticks = round(0.1 / world.tick_duration)
    with Recorder(path, world, name="plane"):

        def run(times: int) -> None:
            for _ in range(times * ticks):
                world.step()

        run(2)
        world.draw.path([[0, 0], [1, 0]])
        world.draw.points([[0, 1]], lifetime=0.4)
        run(3)
        world.draw.path([[0, 0], [2, 0]])
        run(5)
        world.reset()
        run(2)
        world.draw.text("goal", (1, 0, 0.5))
        run(1)
    return path


@pytest.fixture
def tape(drawn: Path) -> Iterator[Tape]:
    with Tape(drawn) as opened:
        yield opened


def shown(tape: Tape, time: float) -> dict[str, int | str]:
    """Of each drawing that is seen at that time: the length of the path, or its kind."""
    now = tape.frame_at(time).time
    found = {}
    for name, one in tape.drawings_at(time).items():
        if one.drawing is not None and one.until > now:
            found[name] = int(one.drawing.points[-1][0]) if name == "path" else one.drawing.kind
    return found


BY_TIME = [
    (0.1, {}),
    (0.3, {"path": 1, "points": "points"}),
    (0.55, {"path": 2, "points": "points"}),
    (0.7, {"path": 2}),
    (0.99, {"path": 2}),
    (1.1, {}),
    (1.25, {"text": "text"}),
]


def test_each_time_has_its_drawings_forwards_and_backwards(tape: Tape) -> None:
    for time, expected in (*BY_TIME, *reversed(BY_TIME), BY_TIME[3], BY_TIME[1]):
        assert shown(tape, time) == expected, time


def test_what_stays_is_the_same_object_and_is_sent_once(tape: Tape) -> None:
    before = tape.drawings_at(0.52)["path"]
    assert tape.drawings_at(0.9)["path"] is before


def test_a_replay_shows_them(tape: Tape) -> None:
    world = autodrive.make("plane")
    player = Player(tape, lambda time: Stage(world), is_paused=True)
    assert not world.drawings
    with player:
        for time, expected in (BY_TIME[2], BY_TIME[0], BY_TIME[6]):
            player.request(Seek(time)).result(60)
            assert world.drawings.keys() >= expected.keys()
            assert ("path" in world.drawings) == ("path" in expected)


def test_what_was_drawn_before_the_recording_is_in_it(tmp_path: Path) -> None:
    world = autodrive.make("plane")
    world.draw.path([[0, 0], [3, 0]])
    world.draw.points([[0, 1]], lifetime=10 * world.tick_duration)
    for _ in range(5):
        world.step()
    with Recorder(tmp_path / "late.mcap", world, name="plane"):
        for _ in range(10):
            world.step()
    with Tape(tmp_path / "late.mcap") as tape:
        assert shown(tape, 0.0) == {"path": 3, "points": "points"}
        assert shown(tape, 9 * world.tick_duration) == {"path": 3}


def test_other_programs_read_them_as_a_foxglove_scene_update(drawn: Path) -> None:
    with drawn.open("rb") as file:
        reader = make_reader(file, decoder_factories=[ProtobufDecoder()])
        found = list(reader.iter_decoded_messages(topics=["/drawings"]))
    assert {schema.name for schema, *_ in found if schema} == {"foxglove.SceneUpdate"}
    updates = [message for *_, message in found]
    path, points, longer, reset, text = updates
    assert [entity.id for update in updates for entity in update.entities] == ["path", "points", "path", "text"]
    (line,) = path.entities[0].lines
    assert [(point.x, point.y, point.z) for point in line.points] == [(0.0, 0.0, 0.01), (1.0, 0.0, 0.01)]
    assert (line.type, line.thickness, path.entities[0].frame_id) == (0, 0.02, "map")
    (sphere,) = points.entities[0].spheres
    assert (sphere.pose.position.y, sphere.size.x) == (1.0, 0.03)
    assert points.entities[0].lifetime.nanos == 400_000_000
    assert longer.entities[0].lines[0].points[1].x == 2.0
    assert [one.type for one in reset.deletions] == [1]
    assert text.entities[0].texts[0].text == "goal"
    assert text.entities[0].texts[0].billboard


def seen(path: Path, folder: Path, view: SetCamera, times: NDArray[np.float64]) -> list[NDArray[np.uint8]]:
    """Images at equally spaced times [s]."""
    start, after = times[:2].tolist()
    rate, end = 1.0 / (after - start), float(times[-1]) + 1e-3
    options = FilmOptions("Fly", start=start, end=end, rate=rate, size=(320, 240), view=view)
    with Tape(path) as tape:
        film(tape, folder / "a.mkv", options)
    with av.open(str(folder / "a.mkv")) as container:
        return [np.asarray(one.to_ndarray(format="rgb24"), np.uint8) for one in container.decode(video=0)]


def magenta(image: NDArray[np.uint8]) -> int:
    red, green, blue = np.moveaxis(image.astype(int), -1, 0)
    return int(((red > green + 60) & (blue > green + 60)).sum())


@pytest.mark.parametrize("kind", ["points", "path", "lines", "text"])
def test_a_film_shows_them_unless_a_box_hides_them(gl: str, tmp_path: Path, kind: str) -> None:
    file = tmp_path / "drawn.mcap"
    spec = ScenarioSpec.model_validate(
        {
            "map": "plane",
            "vehicles": {"V1": {"x": -3.0}},
            "boxes": {"crate": {"x": 0.0, "y": 0.0, "size": [0.6, 0.6, 0.6], "mass": 50.0}},
        }
    )
    world = autodrive.make(spec)
    with Recorder(file, world, name="box"):
        world.step()
        draw = {
            "points": lambda x: world.draw.points([[x, 0.0, 0.3]], color=MAGENTA, size=0.2),
            "path": lambda x: world.draw.path([[x, -0.1, 0.3], [x, 0.1, 0.3]], color=MAGENTA, width=0.1),
            "lines": lambda x: world.draw.lines([[x, -0.1, 0.3], [x, 0.1, 0.3]], color=MAGENTA, width=0.1),
            "text": lambda x: world.draw.text("HH", (x, 0.0, 0.3), color=MAGENTA, size=0.3),
        }[kind]
        draw(-1.0)
        for _ in range(10):
            world.step()
        draw(1.0)
        for _ in range(10):
            world.step()
    view = SetCamera(None, position=(-2.0, 0.0, 0.3), azimuth=0.0, elevation=0.0)
    counts = [
        magenta(image) for image in seen(file, tmp_path, view, 11 * world.tick_duration * np.array([0, 0.75, 1.5]))
    ]
    assert counts[0] == 0  # not drawn yet
    assert counts[1] > 100
    assert counts[2] == 0  # behind the box
    over = msgspec.structs.replace(view, position=(1.0, -1.0, 0.3), azimuth=0.5 * np.pi)
    assert magenta(seen(file, tmp_path, over, world.tick_duration * np.array([16, 17]))[0]) > 100


def test_a_line_through_the_camera_is_cut_at_it(gl: str, tmp_path: Path) -> None:
    file = tmp_path / "line.mcap"
    world = autodrive.make("plane")
    with Recorder(file, world, name="plane"):
        world.step()
        world.draw.path([[-5.0, 0.0, 0.5], [5.0, 0.0, 0.5]], color=MAGENTA, width=0.1)
        for _ in range(5):
            world.step()
    view = SetCamera(None, position=(0.0, 0.0, 1.0), elevation=0.0)
    image = seen(file, tmp_path, view, world.tick_duration * np.array([3, 4]))[0]
    rows = np.flatnonzero([magenta(row[None]) for row in image])
    assert rows.max() == 239  # it leaves the image below
    # 5 m ahead and 0.5 m below the camera
    assert rows.min() == pytest.approx(120 + 120 / np.tan(np.pi / 6) * 0.5 / 5.0, abs=4)
