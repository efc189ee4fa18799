"""Scenarios: contents, and errors of invalid ones."""

import math
import re
from pathlib import Path

import pytest

import autodrive
from autodrive.base.errors import SpecError
from autodrive.protocol.messages import Command
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement, load_scenario
from autodrive.scenario.files import read_scenario
from autodrive.scenario.kinds import find, names
from autodrive.scenario.maps.map import MapSpec, load_map


@pytest.mark.parametrize("name", names("scenario"))
def test_every_included_scenario_runs(name: str) -> None:
    world = autodrive.make(name)
    assert world.warnings == []
    frame = world.frame
    for _ in range(20):
        frame = world.step()
    own = {name: one for name, one in frame.vehicles.items() if not one.is_traffic}
    assert list(own) == list(load_scenario(name).vehicles)
    assert all(one.collision_count == 0 for one in frame.vehicles.values())
    assert all(abs(one.speed) < 1e-6 for one in own.values())  # they stand still


def test_four_cars_stand_on_lanes_and_drive() -> None:
    world = autodrive.make("four_cars")
    lanes = load_map("mini_map").lane_graph
    for name, vehicle in world.frame.vehicles.items():
        x, y, _ = vehicle.pose.position.tolist()
        place = lanes.nearest(x, y, float(vehicle.imu.euler[2]))
        assert place is not None
        assert abs(place.offset) < 0.002, name
    assert list(world.frame.vehicles) == ["V1", "V2", "V3", "V4"]
    for _ in range(100):
        world.step({name: Command(throttle=0.5) for name in world.vehicle_names})
    for vehicle in world.frame.vehicles.values():
        assert vehicle.speed > 0.1
        assert vehicle.collision_count == 0


def test_vehicles_begin_where_the_scenario_puts_them() -> None:
    spec = ScenarioSpec(vehicles={"A": VehiclePlacement(x=1.0, y=-2.0, yaw_deg=90.0), "B": VehiclePlacement()})
    vehicles = autodrive.make(spec).frame.vehicles
    assert vehicles["A"].pose.position == pytest.approx([1.0, -2.0, 0.0325])
    assert vehicles["A"].pose.orientation == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    assert vehicles["B"].pose.position == pytest.approx([0.0, 0.0, 0.0325])


def test_boxes_of_the_scenario_stand_on_the_ground_or_where_they_are_put() -> None:
    boxes = {"low": BoxSpec(x=1.0, y=0.0, size=(0.2, 0.2, 0.4)), "high": BoxSpec(x=1.0, y=0.0, z=0.45)}
    objects = autodrive.make(ScenarioSpec(boxes=boxes)).frame.objects
    assert objects["low"].pose.position == pytest.approx([1.0, 0.0, 0.2])
    assert objects["high"].pose.position == pytest.approx([1.0, 0.0, 0.45])


def test_a_scenario_made_in_python_takes_plain_values() -> None:
    scenario = autodrive.Scenario(vehicles={"V1": {"x": 0.5}, "V2": {"x": 2.0}}, boxes={"crate": {"x": 1.0, "y": 1.0}})  # pyright: ignore
    frame = autodrive.make(scenario).frame
    assert frame.vehicles["V2"].pose.position[0] == pytest.approx(2.0)
    assert list(frame.objects) == ["crate"]


def test_a_scenario_made_in_python_reports_all_its_errors() -> None:
    with pytest.raises(autodrive.SpecError) as caught:
        autodrive.Scenario(vehicles={"V1": {"yaw": 90}}, seed=-1)  # pyright: ignore
    assert [error.partition(":")[0] for error in caught.value.errors] == ["vehicles.V1.yaw", "seed"]


def test_tick_must_be_a_whole_number_of_substeps() -> None:
    with pytest.raises(ValueError, match=r"tick 0\.01 s must be a whole number of substeps of 0\.003 s"):
        ScenarioSpec(substep=0.003)
    with pytest.raises(ValueError, match=r"0\.00123456789012 s has more than 9 decimals.*; set 'substep' to 0\.001"):
        ScenarioSpec(tick=0.0123456789012, substep=0.00123456789012)


@pytest.mark.parametrize(
    ("tick", "substep", "count"),
    [(1 / 30, 1 / 3000, 100), (1 / 60, 1 / 1200, 20), (0.01, 1 / 3000, 30), (0.03, 0.001, 30), (1 / 70, 1 / 1050, 15)],
)
def test_a_float_of_a_simple_fraction_is_that_fraction(tick: float, substep: float, count: int) -> None:
    spec = ScenarioSpec(tick=tick, substep=substep)
    assert spec.substeps == count
    world = autodrive.make(spec)
    for _ in range(7):
        world.step()
    assert world.frame.time == pytest.approx(7 * tick, rel=1e-15)


@pytest.mark.parametrize(
    ("tick", "substep"),
    [
        (1 / 60, 0.001),
        (0.0333333333, 3.3333333e-4),
        (0.0123456789, 0.001),
        (1e-5, 0.001),
        (0.09973, 1.23e-5),
        (6e-5, 4e-5),
    ],
)
def test_the_advice_for_a_tick_that_is_no_whole_number_of_substeps_is_right(tick: float, substep: float) -> None:
    with pytest.raises(ValueError, match="must be a whole number of substeps") as error:
        ScenarioSpec(tick=tick, substep=substep)
    advice = dict(re.findall(r"'(tick|substep)' to ([\d.e-]+)", str(error.value)))
    assert float(advice["substep"]) <= substep
    assert float(advice.get("tick", tick)) == pytest.approx(tick, rel=0.001)
    ScenarioSpec(tick=float(advice.get("tick", tick)), substep=float(advice["substep"]))


def test_seed_given_to_make_replaces_that_of_the_file() -> None:
    assert autodrive.make("plane", seed=7).spec.seed == 7


def test_unknown_map_and_vehicles_are_reported_together() -> None:
    spec = ScenarioSpec(map="tiny_twon", vehicles={"V1": VehiclePlacement(type="nigle")})
    with pytest.raises(SpecError) as caught:
        autodrive.make(spec)
    assert len(caught.value.errors) == 2
    assert "Did you mean 'tiny_town'?" in caught.value.errors[0]
    assert caught.value.errors[1].startswith("vehicles.V1.type: ")


def test_a_duplicate_name_is_reported() -> None:
    spec = ScenarioSpec(map="mini_map", boxes={"pile_1": BoxSpec(x=0.0, y=0.15)})
    with pytest.raises(SpecError, match="the name 'pile_1' is used twice"):
        autodrive.make(spec)


@pytest.mark.parametrize("vehicle", names("vehicle"))
def test_realistic_sensors_have_errors_and_ideal_ones_have_none(vehicle: str) -> None:
    real_one = VehiclePlacement(type=vehicle, x=2.0, has_realistic_sensors=True)
    spec = ScenarioSpec(vehicles={"V1": VehiclePlacement(), "V2": real_one})
    world = autodrive.make(spec)
    readings = []
    for _ in range(50):
        vehicles = world.step().vehicles
        readings.append([float(vehicles[name].imu.angular_velocity[2]) for name in ("V1", "V2")])
    ideal, real = zip(*readings, strict=True)
    assert max(map(abs, ideal)) < 1e-9
    assert len(set(real)) > 10  # each reading has its own noise, rounded to the resolution


@pytest.mark.parametrize("name", ["", 'q"<&', "a/b", "two words"])
def test_box_whose_name_is_not_plain_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="a name is letters, digits and '_'"):
        ScenarioSpec(boxes={name: BoxSpec(x=0.0, y=0.0)})


def test_box_under_the_ground_is_refused() -> None:
    with pytest.raises(ValueError, match="z is the height of the centre of the box"):
        BoxSpec(x=0.0, y=0.0, z=-3.0)


def test_teleport_into_a_box_is_refused_and_nothing_moves() -> None:
    world = autodrive.make(ScenarioSpec(boxes={"crate": BoxSpec(x=1.0, y=0.0)}))
    with pytest.raises(autodrive.CommandError, match="it would overlap 'crate'"):
        world.teleport("V1", 1.0, 0.0)
    assert world.step().vehicles["V1"].pose.position == pytest.approx([0.0, 0.0, 0.0325])
    world.teleport("V1", 2.0, 0.0)
    assert world.frame.vehicles["V1"].pose.position == pytest.approx([2.0, 0.0, 0.0325])


def test_paths_of_a_scenario_start_at_its_folder_whatever_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if the working directory has a file of that name; one that is not in the folder is looked for there."""
    project, elsewhere = tmp_path / "project", tmp_path / "elsewhere"
    for folder, title in ((project, "mine"), (elsewhere, "another")):
        folder.mkdir()
        (folder / "map.yaml").write_text(
            f"{{title: {title}, placements: [{{module: straight_road, x: 0.0, y: 0.15, open: [west, east]}}]}}"
        )
    (project / "car.yaml").write_bytes(find("vehicle", "nigel").read_bytes())
    (elsewhere / "other.yaml").write_bytes(find("vehicle", "roboracer").read_bytes())
    file = project / "scenario.yaml"
    file.write_text("{map: map.yaml, vehicles: {V1: {type: car.yaml}, V2: {type: other.yaml, x: 0.5}}}")
    monkeypatch.chdir(elsewhere)
    for read in (read_scenario(file), read_scenario(load_scenario(file))):
        assert isinstance(read.specs.map.spec_or_none, MapSpec)
        assert read.specs.map.spec_or_none.title == "mine"
        assert [Path(one.path).resolve().parent for one in read.specs.vehicles.values()] == [project, elsewhere]
