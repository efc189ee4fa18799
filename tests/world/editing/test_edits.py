"""Edits of a running World: what changes, what continues, what reset and undo restore, and the saved file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Command, CommandError, Frame, Simulation, SpecError
from autodrive.base.errors import AutodriveError
from autodrive.base.transforms import euler_from_quaternion
from autodrive.base.yaml_files import parse
from autodrive.protocol.messages import (
    AddBox,
    LoadScenario,
    Operation,
    Place,
    Redo,
    RemoveBox,
    Reset,
    SetSensor,
    Teleport,
    Undo,
)
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.files import scenario_text
from autodrive.world import World
from tests.support.cars import car_file
from tests.support.command_line import call
from tests.support.frames import digest

CRATE = BoxSpec(x=1.0, y=0.5)


class Editing:
    """A Simulation whose requests are executed at once, in this thread."""

    def __init__(self, spec: str | ScenarioSpec) -> None:
        self.simulation = Simulation(autodrive.make(spec), load=autodrive.make)

    @property
    def world(self) -> World:
        return self.simulation.world

    def ask(self, *operations: Operation) -> Frame:
        for operation in operations:
            done = self.simulation.request(operation)
            self.simulation.execute_requests()
            done.result(0)
        return self.world.frame

    def drive(self, ticks: int, **command: Any) -> Frame:
        for _ in range(ticks):
            self.world.step({"V1": Command(**command)})
        return self.world.frame


def plane(**changes: Any) -> Editing:
    return Editing(ScenarioSpec(**changes))


def pose(frame: Frame, name: str) -> tuple[float, float, float]:
    """x, y [m] and yaw [rad]."""
    thing = frame.vehicles.get(name) or frame.objects[name]
    x, y, _ = thing.pose.position
    return float(x), float(y), float(euler_from_quaternion(thing.pose.orientation)[2])


# -- poses -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "height"), [("V1", 0.0325), ("crate", 0.05)])
def test_a_placed_vehicle_or_object_is_there_now_and_after_a_reset(name: str, height: float) -> None:
    editing = plane(boxes={"crate": CRATE})
    editing.drive(100, throttle=1.0)
    tick = editing.world.frame.tick
    frame = editing.ask(Place(name, 2.0, -1.0, 0.5))
    assert frame.tick == tick
    assert pose(frame, name) == pytest.approx((2.0, -1.0, 0.5))
    for after in (editing.drive(50), editing.ask(Reset())):
        assert pose(after, name) == pytest.approx((2.0, -1.0, 0.5), abs=3e-3)
        thing = after.vehicles.get(name) or after.objects[name]
        assert thing.pose.position[2] == pytest.approx(height, abs=2e-3)


def test_a_teleported_object_is_back_after_a_reset() -> None:
    editing = plane(boxes={"crate": CRATE})
    assert pose(editing.ask(Teleport("crate", 3.0, 0.0, 1.0)), "crate") == pytest.approx((3.0, 0.0, 1.0))
    assert editing.world.spec.boxes == {"crate": CRATE}
    assert pose(editing.ask(Reset()), "crate") == pytest.approx((1.0, 0.5, 0.0))


def test_undo_reverts_edits_and_redo_repeats_them() -> None:
    editing = plane(boxes={"crate": CRATE})
    x, *_ = pose(editing.drive(100, throttle=1.0), "V1")
    editing.ask(Place("V1", 2.0, -1.0), Place("crate", 0.0, 2.0, 1.0))
    assert (editing.simulation.undo_name, editing.simulation.redo_name) == ("place crate", "")
    assert pose(editing.ask(Undo()), "crate") == pytest.approx((1.0, 0.5, 0.0), abs=1e-4)
    assert pose(editing.ask(Undo()), "V1") == pytest.approx((x, 0.0, 0.0))  # where it was, not where it started
    assert (editing.simulation.undo_name, editing.simulation.redo_name) == ("", "place V1")
    assert pose(editing.ask(Reset()), "V1") == (0.0, 0.0, 0.0)
    frame = editing.ask(Redo(), Redo())
    assert (pose(frame, "V1"), pose(frame, "crate")) == (
        pytest.approx((2.0, -1.0, 0.0)),
        pytest.approx((0.0, 2.0, 1.0)),
    )
    assert pose(editing.ask(Reset(), Undo()), "crate") == pytest.approx((1.0, 0.5, 0.0))
    editing.ask(Place("V1", 4.0, 0.0))
    with pytest.raises(CommandError, match="no edit to redo"):
        editing.ask(Redo())


def test_what_stood_on_a_box_falls_when_the_box_is_moved() -> None:
    editing = plane(boxes={"crate": CRATE, "lid": BoxSpec(x=1.0, y=0.5, z=0.15)})
    editing.drive(100)  # long enough to sleep
    editing.ask(Place("crate", 3.0, 0.0))
    assert editing.drive(50).objects["lid"].pose.position[2] == pytest.approx(0.05, abs=1e-3)


# -- boxes -------------------------------------------------------------------------------------------------------


def test_a_world_with_a_new_box_continues_as_one_that_always_had_it() -> None:
    """The box is not touched before it is added, so both worlds are the same."""
    always = plane(boxes={"crate": CRATE})
    editing = plane()
    for it in (always, editing):
        it.drive(80, throttle=1.0, steering=0.3, headlights=1)
    before = editing.world.frame
    frame = editing.ask(AddBox("crate", 1.0, 0.5))
    assert (frame.tick, frame.time, list(frame.objects)) == (before.tick, before.time, ["crate"])
    assert digest(frame.vehicles["V1"]) == digest(before.vehicles["V1"])
    for _ in range(20):
        one, other = (it.drive(10, throttle=1.0, steering=0.3) for it in (editing, always))
        assert one.vehicles["V1"].pose.position == pytest.approx(other.vehicles["V1"].pose.position, abs=1e-9)
        assert one.vehicles["V1"].lidar is not None
        assert other.vehicles["V1"].lidar is not None
        assert one.vehicles["V1"].lidar.time == other.vehicles["V1"].lidar.time


def test_a_new_box_is_hit_and_pushed() -> None:
    editing = plane()
    editing.ask(AddBox("crate", 0.5, 0.0, size=(0.1, 0.2, 0.1), mass=0.2))
    hits = []
    for _ in range(300):
        hits += editing.drive(1, throttle=1.0).events
    assert [event.other for event in hits] == ["crate"]
    assert pose(editing.world.frame, "crate")[0] > 0.6


def test_a_box_comes_back_where_it_was_removed_and_starts_where_it_started() -> None:
    editing = plane(boxes={"crate": CRATE})
    editing.ask(Teleport("crate", 3.0, 0.0, 1.0))
    assert editing.ask(RemoveBox("crate")).objects == {}
    assert pose(editing.ask(Undo()), "crate") == pytest.approx((3.0, 0.0, 1.0))
    assert pose(editing.ask(Reset()), "crate") == pytest.approx((1.0, 0.5, 0.0))


def test_boxes_of_the_map_can_be_moved_and_removed() -> None:
    editing = Editing("mini_map")
    world, names = editing.world, list(editing.world.frame.objects)
    frame = editing.ask(Place("pile_1", 0.0, 1.0))
    assert editing.world is world  # it only moved
    assert list(frame.objects) == names
    frame = editing.ask(RemoveBox("barrier_2"), RemoveBox("pile_1"))
    assert set(names) - set(frame.objects) == {"barrier_2", "pile_1"}
    frame = editing.ask(AddBox("pile_1", 0.0, 1.0), Reset())
    assert pose(frame, "pile_1") == pytest.approx((0.0, 1.0, 0.0))


# -- sensors -----------------------------------------------------------------------------------------------------


def test_rates_of_sensors_change_at_once_and_the_others_continue() -> None:
    editing = plane()
    editing.drive(33, throttle=1.0)
    before = editing.world.frame.vehicles["V1"]
    now = editing.world.time
    editing.ask(SetSensor("V1", "lidar", rate=20.0), SetSensor("V1", "imu", rate=10.0))
    assert editing.world.frame.vehicles["V1"].encoders is before.encoders
    scans, samples = set(), set()
    for _ in range(100):
        vehicle = editing.drive(1).vehicles["V1"]
        assert vehicle.lidar is not None
        assert vehicle.lidar.scan_rate == 20.0
        scans.add(round(vehicle.lidar.time - now, 3))
        samples.add(round(vehicle.imu.time, 3))
    assert len(scans) == 1 + 20
    assert {round(b - a, 3) for a, b in zip(sorted(samples)[1:], sorted(samples)[2:], strict=False)} == {0.1}


def test_a_sensor_that_is_off_gives_no_new_reading() -> None:
    editing = plane()
    editing.drive(50)
    off = [SetSensor("V1", name, is_on=False) for name in ("lidar", "imu", "ips", "encoders")]
    now = editing.ask(*off).time
    vehicle = editing.drive(50, throttle=1.0).vehicles["V1"]
    assert vehicle.lidar is None
    assert (vehicle.imu.time, vehicle.ips.time, vehicle.encoders.time) == (now, now, now)
    vehicle = editing.ask(Undo()).vehicles["V1"]
    assert (vehicle.encoders.time, vehicle.imu.time) == (editing.world.time, now)


@pytest.mark.parametrize(
    ("sensor", "noise", "sigma"),
    [
        ("ips", "ideal", 0.0),
        ("ips", "strong", 0.05),
        # MPU-9250: 0.01 deg/s/sqrt(Hz) after a filter of 92 Hz
        ("imu", "realistic", math.radians(0.01) * math.sqrt(92.0)),
        ("imu", "strong", 5.0 * math.radians(0.01) * math.sqrt(92.0)),
        ("imu", "file", 0.0),
    ],
)
def test_presets_of_the_noise(sensor: str, noise: Any, sigma: float) -> None:
    editing = plane(vehicles={"V1": VehiclePlacement(has_realistic_sensors=True)})
    editing.drive(50)
    editing.ask(SetSensor("V1", sensor, noise=noise))
    values = []
    for _ in range(400):
        vehicle = editing.drive(1).vehicles["V1"]
        values.append(vehicle.ips.position[0] if sensor == "ips" else vehicle.imu.angular_velocity[2])
    # 400 samples: the standard deviation is within 5 % with 1 sigma; resolution and motion add 1e-4
    assert np.std(values) == pytest.approx(sigma, rel=0.25, abs=1e-4)


def test_a_rolling_lidar_that_is_switched_on_late_begins_with_the_next_period(tmp_path: Path) -> None:
    car = car_file(tmp_path, {"sensors.lidar.is_rolling": True})
    editing = plane(vehicles={"V1": VehiclePlacement(type=car)})
    editing.drive(33)
    editing.ask(SetSensor("V1", "lidar", rate=10.0))
    times = []
    for _ in range(60):
        scan = editing.drive(1).vehicles["V1"].lidar
        times += [scan.time] if scan is not None and scan.time not in times else []
    assert times == pytest.approx([0.33, 0.5, 0.6, 0.7, 0.8, 0.9])  # at once a whole scan, as after a reset


def test_a_camera_that_is_off_is_not_rendered() -> None:
    editing = plane()
    assert list(editing.world.compiled.cameras["V1"]) == ["front", "rear"]
    editing.ask(SetSensor("V1", "front", is_on=False), SetSensor("V1", "rear", rate=5.0, noise="strong"))
    cameras = editing.world.compiled.cameras["V1"]
    assert list(cameras) == ["rear"]
    assert cameras["rear"].rate == 5.0
    assert cameras["rear"].imperfections.white_electrons == pytest.approx(2150.0 / 25.0)


# -- determinism, errors, files ----------------------------------------------------------------------------------


def test_the_same_edits_at_the_same_ticks_give_the_same_bits() -> None:
    def images() -> list[bytes]:
        editing = plane(vehicles={"V1": VehiclePlacement(has_realistic_sensors=True)}, seed=3)
        frames = []
        for edit in (AddBox("b", 0.6, 0.0), SetSensor("V1", "ips", noise="strong"), Place("V1", 0.1, 0.1), Undo()):
            frames += [digest(editing.drive(1, throttle=1.0)) for _ in range(20)]
            frames.append(digest(editing.ask(edit)))
        return frames

    assert images() == images()


ERRORS: list[tuple[Operation, str]] = [
    (Place("V2", 0.0, 1.0), r"'V2' is not in this world\. Known: V1, crate\."),
    (Place("V1", 1.0, 0.5), "'V1' and 'crate' overlap at the start"),
    (AddBox("crate", 5.0, 0.0), "the name 'crate' is taken"),
    (AddBox("a box", 5.0, 0.0), "a name is letters, digits and '_'"),
    (AddBox("b", 5.0, 0.0, size=(1.0, 0.0, 1.0)), "boxes.b.size 2: must be at least 0.001"),
    (AddBox("b", 5.0, 0.0, mass=0.0), "boxes.b.mass: must be at least 0.001"),
    (AddBox("b", 3.0, 0.0), "object 'b' cannot be placed at x=3.0, y=0.0: it would overlap 'V1'"),  # it drove there
    (RemoveBox("V1"), "'V1' is a vehicle; only boxes can be removed"),
    (RemoveBox("crat"), "Did you mean 'crate'?"),
    (SetSensor("V1", "lidr"), "lidr: no such sensor.*Did you mean 'lidar'?"),
    (SetSensor("V1", "lidar", rate=-1.0), "lidar.rate: must be at least 0.001"),
    (SetSensor("V1", "ips", noise="realistic"), "ips.noise: 'realistic' is not known for this sensor"),
    (Undo(), "there is no edit to undo"),
    (Redo(), "there is no edit to redo"),
]


@pytest.mark.parametrize(("operation", "text"), ERRORS, ids=lambda value: str(value)[:25])
def test_a_wrong_edit_is_an_error_and_changes_nothing(operation: Operation, text: str) -> None:
    editing = plane(boxes={"crate": CRATE})
    editing.ask(Teleport("V1", 3.0, 0.0))
    world, spec, frame = editing.world, editing.world.spec, digest(editing.world.frame)
    with pytest.raises(AutodriveError, match=text):
        editing.ask(operation)
    assert (editing.world, editing.world.spec, digest(editing.world.frame)) == (world, spec, frame)
    assert editing.simulation.undo_name == ""


def test_a_simulation_of_one_world_only_changes_poses() -> None:
    editing = plane(boxes={"crate": CRATE})
    editing.simulation = Simulation(editing.world)
    assert pose(editing.ask(Place("crate", 2.0, 0.0)), "crate")[0] == 2.0
    with pytest.raises(CommandError, match="made for one World"):
        editing.ask(RemoveBox("crate"))


def test_another_scenario_has_a_history_of_its_own() -> None:
    editing = plane()
    editing.ask(Place("V1", 1.0, 0.0), LoadScenario("boxes"))
    assert (editing.simulation.undo_name, editing.world.spec.title[:9]) == ("", "Ten boxes")


def test_the_text_of_an_edited_scenario_passes_the_check_and_starts_with_the_edited_poses(tmp_path: Path) -> None:
    editing = Editing("mini_map")
    editing.ask(
        Place("V1", 0.3, 0.1, 0.2),
        AddBox("crate", 1.0 / 3.0, 0.9, math.pi / 3.0, size=(0.2, 0.1, 0.3), mass=0.7),
        Place("pile_3", 0.0, 1.0, -2.0),
        RemoveBox("barrier_1"),
        SetSensor("V1", "lidar", rate=20.0, noise="strong"),
    )
    file = tmp_path / "mine.yaml"
    file.write_text(scenario_text(editing.world.spec), encoding="utf-8")
    result = call("check", file)
    assert (result.returncode, result.stderr) == (0, "")
    frame = autodrive.make(file).frame
    start = editing.ask(Reset())
    assert list(frame.objects) == list(start.objects)
    for name in ("V1", *frame.objects):
        assert pose(frame, name) == pytest.approx(pose(start, name), abs=1e-9)
    assert parse(file.read_text(encoding="utf-8"), ScenarioSpec) == editing.world.spec


def test_the_text_names_the_files_of_a_scenario_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    car_file(tmp_path, {})
    monkeypatch.chdir(tmp_path)
    (name,) = (path.name for path in tmp_path.glob("*.yaml"))
    text = scenario_text(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=name)}))
    assert parse(text, ScenarioSpec).vehicles["V1"].type == str(tmp_path / name)


def test_a_box_of_the_map_is_replaced_only_if_it_is_removed() -> None:
    box = {"pile_1": BoxSpec(x=0.0, y=1.0)}
    with pytest.raises(SpecError, match="the name 'pile_1' is used twice"):
        autodrive.make(ScenarioSpec(map="mini_map", boxes=box))
    frame = autodrive.make(ScenarioSpec(map="mini_map", boxes=box, removed_boxes=("pile_1",))).frame
    assert pose(frame, "pile_1") == pytest.approx((0.0, 1.0, 0.0))
    with pytest.raises(SpecError, match=r"the map has no box 'pile_9'.*Known: .*pile_1"):
        autodrive.make(ScenarioSpec(map="mini_map", removed_boxes=("pile_9",)))
