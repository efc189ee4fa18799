"""The track `cdc_tf_2025` against the published checkpoints of the league."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

import autodrive
from autodrive.base.errors import SpecError
from autodrive.cli.spec_files import check
from autodrive.protocol.messages import CheckpointPassed, Event, LapCompleted
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import find
from autodrive.scenario.tracks.track import Track
from autodrive.world.racing import Race, load_rules

PUBLISHED = {
    0: (14.675, -2.02, -90.0, 1.5),
    1: (14.80, -4.90, -90.0, 1.8),
    3: (14.75, -10.22, -90.0, 1.7),
    5: (14.348, -16.379, -97.0, 1.6),
    6: (13.40, -19.00, -145.0, 2.3),
    7: (11.30, -19.60, 157.8, 2.4),
    8: (10.25, -17.50, 94.8, 1.9),
    9: (10.40, -14.85, 90.0, 1.8),
    10: (10.90, -13.00, 9.7, 3.8),
    11: (11.84, -14.05, -35.0, 2.0),
    12: (12.548, -15.646, 4.5, 4.9),
    13: (13.10, -13.265, 90.0, 1.5),
    15: (12.765, -7.44, 90.0, 2.3),
    16: (12.85, -4.90, 90.0, 2.0),
    17: (13.00, -2.02, 90.0, 1.9),
    18: (13.21, -0.80, 30.0, 3.0),
    20: (14.54, -0.97, -30.0, 2.6),
}
"""x [m], y [m], heading [degrees], width across [m] of the checkpoints by number."""
TICK = 0.01


@pytest.fixture(scope="module")
def track() -> Track:
    return Track.load("cdc_tf_2025")


def gates_of(track: Track) -> np.ndarray:
    assert track.checkpoints is not None
    return track.checkpoints


def test_the_checkpoints_are_those_that_are_published(track: Track) -> None:
    gates = gates_of(track)
    assert len(gates) == 21
    for number, (x, y, heading, width) in PUBLISHED.items():
        assert gates[number] == pytest.approx((x, y, math.radians(heading), width), abs=5e-5), number
    middles = np.array(list(PUBLISHED.values()))[:, :2]
    # the published length of the line through them
    assert np.hypot(*(np.roll(middles, -1, axis=0) - middles).T).sum() == pytest.approx(46.8, abs=0.05)
    assert track.barrier.width == 0.305


def test_the_checkpoints_end_in_the_ducts_and_their_middles_are_free(track: Track) -> None:
    """An end is in the middle of a duct, 0.1525 m behind its face, within 0.06 m: ends that meet scatter so much."""
    outer, island = (shapely.Polygon(wall) for wall in track.walls)
    free = outer.difference(island)
    faces = shapely.MultiLineString([shapely.LinearRing(wall) for wall in track.walls])
    for number, (x, y, psi, width) in enumerate(gates_of(track).tolist()):
        assert free.contains(shapely.Point(x, y).buffer(0.2)), number
        if number not in PUBLISHED:
            continue
        for side in (0.5 * width, -0.5 * width):
            end = shapely.Point(x - side * math.sin(psi), y + side * math.cos(psi))
            assert not free.contains(end), number
            assert faces.distance(end) == pytest.approx(0.1525, abs=0.06), number


def test_a_single_car_starts_where_the_league_starts_it_and_several_on_the_grid(track: Track) -> None:
    def starts(cars: int) -> list[list[float]]:
        vehicles = {f"V{i}": VehiclePlacement(type="roboracer") for i in range(1, cars + 1)}
        frame = autodrive.make(ScenarioSpec(map="cdc_tf_2025", vehicles=vehicles)).frame
        return [vehicle.pose.position[:2].tolist() for vehicle in frame.vehicles.values()]

    (single,) = starts(1)
    assert single == pytest.approx((14.75, -2.50 + 0.16), abs=1e-4)  # the root, 0.16 m ahead, is at y = -2.50
    places = [track.project(x, y)[0] - track.length for x, y in starts(4)]
    # in the hairpin, a place beside the line is not exactly beside the point that it was made from
    assert places == pytest.approx([-0.5, -1.3, -2.1, -2.9], abs=0.05)


def test_a_lap_on_the_race_line_passes_all_checkpoints_in_order(track: Track) -> None:
    """At 4 m/s; a checkpoint of one straight reaches into the other straight, where it is not crossed."""
    race = Race(["V1"], track, load_rules("league_2026"), TICK)
    assert track.race_line is not None
    closed = np.vstack([track.race_line, track.race_line[:1]])[:, 1:3]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    events: list[Event] = []
    at = 0.4
    for tick in range(round(1.1 * along[-1] / 4.0 / TICK)):
        x, y = (float(np.interp(at % along[-1], along, closed[:, axis])) for axis in range(2))
        positions = np.array([[x, y, 0.0]])
        if tick == 0:
            race.reset(positions)
        events += race.judge(TICK * (tick + 1), positions, ())[0]
        at += 4.0 * TICK
    assert [event.checkpoint for event in events if isinstance(event, CheckpointPassed)][:22] == [*range(1, 22), 1]
    (lap,) = (event for event in events if isinstance(event, LapCompleted))
    assert lap.lap_time == pytest.approx((along[-1] - 0.4) / 4.0, abs=0.03)  # the race line crosses obliquely


FIRST, SECOND = "  - 14.675 -2.02 -1.5708 1.5\n", "  - 14.8 -4.9 -1.5708 1.8\n"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (FIRST + SECOND, SECOND + FIRST, r"the first checkpoint must be at the start line, not 2\.8"),
        (SECOND, f"  - 14.75 -12 -1.5708 1.8\n{SECOND}", "checkpoint 3 must be after checkpoint 2"),
        (FIRST, FIRST.replace("1.5\n", "0\n"), "checkpoint 1 .*the width must be above 0"),
        (FIRST, FIRST.replace(" 1.5\n", "\n"), "checkpoint 1 4 .*is required"),
    ],
)
def test_wrong_checkpoints_are_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = find("track", "cdc_tf_2025").read_text()
    assert old in text
    file = tmp_path / "other.yaml"
    file.write_text(text.replace(old, new))
    with pytest.raises(SpecError, match=message):
        check(str(file), "track")
    with pytest.raises(SpecError, match=message):
        autodrive.make(ScenarioSpec(map=str(file), vehicles={"V1": VehiclePlacement(type="roboracer")}))
