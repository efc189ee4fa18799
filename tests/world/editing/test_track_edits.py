"""Edits of a race track by points: made from a map, changed by two people, undone, saved with the same bits."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command, CommandError, SpecError
from autodrive.base.errors import AutodriveError
from autodrive.cli.spec_files import check
from autodrive.protocol.messages import AddBox, EditTrack, GenerateTrack, Place, Redo, Reset, TrackLine, Undo, UseMap
from autodrive.protocol.native import TrackScene
from autodrive.recording import Recorder
from autodrive.recording import open as open_recording
from autodrive.recording.resimulation import resimulate
from autodrive.scenario.tracks.track import Track
from autodrive.world.editing.map_scene import map_scene
from autodrive.world.editing.track_edits import track_scene
from tests.support.frames import digest, digests
from tests.world.editing.test_map_edits import Building

OVAL = TrackLine(tuple((6.0 * math.cos(a), 4.0 * math.sin(a)) for a in np.arange(10) * math.pi / 5))


def moved(line: TrackLine, index: int, dx: float, dy: float) -> TrackLine:
    points = [*line.points]
    x, y = points[index]
    points[index] = (x + dx, y + dy)
    return TrackLine(tuple(points), line.width, line.barrier)


class TrackBuilding(Building):
    @property
    def track(self) -> TrackScene:
        found = track_scene(self.world)
        assert found is not None
        return found

    @property
    def x(self) -> float:
        return float(self.world.frame.vehicles["V1"].pose.position[0])


def test_a_track_is_made_changed_undone_and_saved_with_its_bits(tmp_path: Path) -> None:
    building = TrackBuilding()
    assert track_scene(building.world) is None
    building.ask(EditTrack(OVAL))
    assert map_scene(building.world, lambda name, _: name) is None
    assert building.track.is_exact
    assert building.track.problems == []
    assert building.x == pytest.approx(5.95, abs=0.01)  # behind the start line
    line = building.track.line
    building.ask(EditTrack(moved(line, 3, 0.0, 1.0), seen=line))
    assert building.simulation.undo_name == "move a point of the track"
    assert building.world.map.track is not None
    longer = building.world.map.track.length
    building.ask(Undo())
    assert building.track.line == line
    building.ask(Redo())
    assert building.world.map.track is not None
    assert building.world.map.track.length == longer
    (tmp_path / "track.yaml").write_text(building.simulation.map_text("My oval"))
    assert check(str(tmp_path / "track.yaml")) == ("track", "My oval", [])
    assert "is_draft" not in (tmp_path / "track.yaml").read_text()
    (tmp_path / "scenario.yaml").write_text(building.simulation.scenario_text())
    (tmp_path / "named.yaml").write_text(f"map: {tmp_path / 'track.yaml'}\n")
    building.ask(Reset(1))
    worlds = [building.world, *(autodrive.make(tmp_path / f"{name}.yaml", 1) for name in ("scenario", "named"))]
    one, two, three = (digests(world, 100, lambda _: {"V1": Command(0.4, 0.3)}) for world in worlds)
    assert one == two == three


def test_a_vehicle_on_the_track_stays_and_one_beside_it_goes_to_the_start() -> None:
    building = TrackBuilding()
    building.ask(EditTrack(OVAL))
    building.drive(50, 0.5)
    before = building.world.pose("V1")
    far = moved(OVAL, 5, -1.0, 0.0)
    building.ask(EditTrack(far))
    assert building.world.pose("V1") == pytest.approx(before, abs=1e-9)
    shifted = TrackLine(tuple((x + 1.5, y) for x, y in OVAL.points))
    building.ask(EditTrack(shifted))
    assert building.x == pytest.approx(before[0] + 1.5, abs=0.2)
    building.ask(Undo())
    assert building.world.pose("V1") == pytest.approx(before, abs=1e-9)


def test_a_faulty_track_is_a_draft_with_problems(tmp_path: Path) -> None:
    building = TrackBuilding()
    building.ask(EditTrack(moved(OVAL, 5, 9.0, 0.0)))
    kinds = {problem.kind for problem in building.track.problems}
    assert "bend" in kinds or "touch" in kinds
    assert all(math.isfinite(problem.x + problem.y) and problem.text for problem in building.track.problems)
    text = building.simulation.map_text()
    assert "is_draft: true" in text
    (tmp_path / "draft.yaml").write_text(text)
    assert check(str(tmp_path / "draft.yaml"))[2]
    (tmp_path / "final.yaml").write_text(text.replace("is_draft: true\n", ""))
    with pytest.raises(SpecError, match=r"must be at least|the least distance is"):
        check(str(tmp_path / "final.yaml"))
    building.drive(3)


def test_the_second_edit_of_what_another_client_changed_is_refused() -> None:
    building = TrackBuilding()
    building.ask(EditTrack(OVAL))
    seen = building.track.line
    building.ask(EditTrack(moved(seen, 1, 0.1, 0.0), seen=seen))
    now = digest(building.world.frame)
    with pytest.raises(CommandError, match="changed by another client in the meantime"):
        building.ask(EditTrack(moved(seen, 2, 0.1, 0.0), seen=seen))
    assert digest(building.world.frame) == now
    with pytest.raises(CommandError, match="changed by another client"):
        TrackBuilding().ask(EditTrack(OVAL, seen=seen))


def test_names_of_edits_say_what_changed() -> None:
    building = TrackBuilding()
    names = []
    more = TrackLine((*OVAL.points, (6.5, -1.5)))
    for line in (OVAL, more, OVAL, TrackLine(OVAL.points, 1.5), TrackLine(OVAL.points, 1.5, "duct")):
        building.ask(EditTrack(line))
        names.append(building.simulation.undo_name)
    assert names == [
        "make a track",
        "add a point of the track",
        "remove a point of the track",
        "change the width of the track",
        "change the barrier of the track",
    ]


def test_a_random_track_is_the_same_for_a_seed_and_has_no_problems() -> None:
    lines = []
    for seed in (1, 1, 2):
        building = TrackBuilding("practice")
        building.ask(GenerateTrack(seed))
        assert building.track.problems == []
        assert building.world.map.track is not None
        assert building.world.map.track.length == pytest.approx(60.0, rel=0.06)
        lines.append(building.track.line)
    assert lines[0] == lines[1] != lines[2]
    assert len(lines[0].points) <= 48
    with pytest.raises(AutodriveError, match=r"it must be from .* m \(a circle\)"):
        TrackBuilding().ask(GenerateTrack(0, 15.0, 3.0))


def test_a_track_of_the_simulator_is_offered_by_points_near_it() -> None:
    building = TrackBuilding("practice")
    track = Track.load("practice")
    assert not building.track.is_exact
    assert building.track.line.barrier == "duct"
    assert building.track.line.width == pytest.approx(1.2)
    building.ask(EditTrack(building.track.line, seen=building.track.line))
    assert building.track.is_exact
    assert building.world.map.track is not None
    assert building.world.map.track.length == pytest.approx(track.length, rel=0.01)
    assert building.world.map.track.barrier == track.barrier


def test_the_text_of_a_track_is_used_and_a_map_follows_a_track() -> None:
    building = TrackBuilding()
    building.ask(UseMap(text=Track.load("practice").text()))
    assert not building.track.is_exact
    first = building.world.map.track
    assert first is not None
    assert np.array_equal(first.centre_line, Track.load("practice").centre_line)
    building.ask(UseMap(text=building.simulation.map_text("again")))
    again = building.world.map.track
    assert again is not None
    assert all(np.array_equal(a, b) for a, b in zip(again.walls, first.walls, strict=True))
    assert "mini_map" in building.track.templates
    building.ask(UseMap("mini_map"))
    assert track_scene(building.world) is None
    building.ask(Undo())
    assert not building.track.is_exact


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (TrackLine(((0.0, 0.0), (1.0, 0.0), (math.nan, 1.0))), "expected float"),
        (TrackLine(((0.0, 0.0), (1.0, 0.0), (1.0, 0.01), (0.0, 4.0))), "at least 5 cm apart"),
        (TrackLine(((0.0, 0.0), (900.0, 0.0), (0.0, 9.0))), "at most 500 m"),
        (TrackLine(OVAL.points, -1.0), "width: must be at least 0.2"),
    ],
)
def test_an_impossible_track_is_refused_and_nothing_changes(line: TrackLine, message: str) -> None:
    building = TrackBuilding()
    before = digest(building.world.frame)
    with pytest.raises(AutodriveError, match=message):
        building.ask(EditTrack(line))
    assert digest(building.world.frame) == before
    assert building.simulation.undo_name == ""


def test_a_box_in_the_way_is_named() -> None:
    building = TrackBuilding()
    building.ask(AddBox("crate", 5.4, 0.0))
    with pytest.raises(AutodriveError, match="crate"):
        building.ask(EditTrack(OVAL))
    building.ask(Place("crate", 1.0, 1.0), EditTrack(OVAL))
    assert building.track.is_exact


@pytest.mark.slow
def test_a_recording_of_edits_is_simulated_again(tmp_path: Path) -> None:
    building = TrackBuilding()
    path = tmp_path / "run.mcap"
    with Recorder(path, building.simulation):
        building.ask(EditTrack(OVAL))
        building.simulation.run(0.3)
        building.ask(EditTrack(moved(OVAL, 4, -0.5, 0.5)), GenerateTrack(2))
        building.simulation.run(0.3)
    with open_recording(path) as recording:
        assert str(resimulate(recording)) == "identical"
