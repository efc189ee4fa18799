"""Files of the user over the native protocol: a picture of a map becomes the track of the simulation."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np
import pytest
import shapely

import autodrive
from autodrive import AutodriveError, Client
from autodrive.base.arrays import Floats
from autodrive.base.png import decode_png, encode_png
from autodrive.connect.server.operations import KINDS
from autodrive.connect.server.request_queue import QueuedOperation, RequestQueue
from autodrive.connect.server.server import MESSAGE_LIMIT, SimulationServer
from autodrive.protocol.messages import MAX_TEXT
from autodrive.protocol.own_files import ImportTrack
from autodrive.scenario.tracks.importer import export_track
from autodrive.scenario.tracks.track import Track
from autodrive.world.simulation import Simulation
from tests.connect.client.conftest import server as server  # noqa: PLC0414  fixtures
from tests.connect.client.conftest import sim as sim  # noqa: PLC0414
from tests.support.native_clients import native_client

PIXEL = 0.05


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    with Simulation(autodrive.make("mini_map"), load=autodrive.make) as running:
        yield running


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Track, bytes, str]:
    """A track of the simulator, and its picture and YAML file in the format of published maps."""
    folder = tmp_path_factory.mktemp("maps")
    track = Track.load("practice")
    export_track(track, folder, resolution=PIXEL)
    return track, (folder / "practice_map.png").read_bytes(), (folder / "practice_map.yaml").read_text()


def lines(walls: tuple[Floats, ...]) -> shapely.MultiLineString:
    return shapely.MultiLineString([shapely.LinearRing(wall) for wall in walls])


def test_the_picture_of_an_exported_track_is_imported_within_a_pixel(
    sim: Client, simulation: Simulation, exported: tuple[Track, bytes, str]
) -> None:
    given, picture, text = exported
    sim.import_track(picture, text)
    assert "direction and start line are guesses" in sim.connection.text
    track = simulation.world.map.track
    assert track is not None
    assert shapely.hausdorff_distance(lines(track.walls), lines(given.walls), densify=0.02) < PIXEL
    away = [given.project(x, y)[1] for x, y in track.centre_line[:, :2]]
    assert np.abs(away).max() < 2.0 * PIXEL  # the middle of walls that are drawn in pixels
    assert simulation.undo_name == "open a map"
    sim.undo()
    assert simulation.world.map.track is None


@pytest.mark.parametrize("kind", ["pgm", "compressed pgm"])
def test_a_pgm_file_gives_the_same_track_with_start_and_direction(
    sim: Client, simulation: Simulation, exported: tuple[Track, bytes, str], kind: str
) -> None:
    given, picture, text = exported
    grey = decode_png(picture)[..., 0]
    pgm = b"P5\n# CREATOR: map_saver\n%d %d\n255\n" % grey.shape[::-1] + grey.tobytes()
    origin = [float(one) for one in text.split("origin: [")[1].split("]")[0].split(",")]
    x, y = given.pose_at(5.0)[:2]
    start = (x - origin[0]) / PIXEL, grey.shape[0] - (y - origin[1]) / PIXEL
    sim.import_track(zlib.compress(pgm) if kind == "compressed pgm" else pgm, text, start=start, is_reversed=True)
    track = simulation.world.map.track
    assert track is not None
    assert np.hypot(*(track.centre_line[0, :2] - (x, y))) < 0.3
    assert shapely.LinearRing(track.centre_line[:, :2]).is_ccw is False


@pytest.mark.parametrize(
    ("picture", "text", "message"),
    [
        (b"GIF89a", "image: a.png\nresolution: 0.05\norigin: [0, 0, 0]", "neither PNG nor PGM; save it as PNG"),
        (b"x\x00123", "image: a.png\nresolution: 0.05\norigin: [0, 0, 0]", "the image cannot be read"),
        (encode_png(np.full((50, 50), 254, np.uint8)), "resolution: 1", "image: is required"),
        (
            encode_png(np.full((50, 50), 254, np.uint8)),
            "image: a.png\nresolution: 0.05\norigin: [0, 0, 0]",
            "no free area that is a ring",
        ),
        (b"\x89PNG\r\n\x1a\n", "image: [", "invalid YAML"),
    ],
)
def test_a_bad_picture_changes_nothing(
    sim: Client, simulation: Simulation, picture: bytes, text: str, message: str
) -> None:
    before = simulation.world
    with pytest.raises(AutodriveError, match=message):
        sim.import_track(picture, text)
    assert simulation.world is before
    assert simulation.undo_name == ""


def test_the_largest_message_is_read_and_one_that_is_longer_ends_the_connection(
    server: SimulationServer, simulation: Simulation
) -> None:
    with native_client(server) as it:
        answer = it.ask("ImportTrack", picture=bytes(MAX_TEXT), text="image: a\nresolution: 1\norigin: [0, 0]")
        assert "neither PNG nor PGM" in answer["text"]
        assert "length <=" in it.ask("ImportTrack", picture=bytes(MAX_TEXT + 1), text="")["text"]
        assert it.ask("SetSceneLight", enabled=True)["type"] == "Response"


def test_few_bytes_of_a_client_wait() -> None:
    queue = RequestQueue()
    entry = QueuedOperation(ImportTrack(b"", ""), KINDS[ImportTrack], [1], MESSAGE_LIMIT)
    assert queue.add(entry)
    assert not queue.add(entry)
    queue.take(0.0)
    assert queue.add(entry)
