"""Sensors of the user: what they read and report, their errors, and that their bits can be reproduced."""

from __future__ import annotations

import logging
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import BatchWorld, Command, CommandError, SensorError, SnapshotError, SpecError, World
from autodrive.physics.sensors.own import TIMED
from autodrive.protocol.messages import OwnReading, SetSensor
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement, load_scenario
from autodrive.scenario.files import scenario_text
from autodrive.world import SensorView
from autodrive.world.simulation import Simulation
from tests.support.frames import digests

DRIVE = {"V1": Command(throttle=0.5, steering=0.2)}
FILE = """
import numpy as np

class Radar:
    rate = 20.0
    columns = ("distance [m]", "speed [m/s]")

    def sample(self, view, random):
        (distance,) = view.cast((0.3, 0.0, 0.1), (1.0, 0.0, 0.0))
        return distance + random.normal(0.0, 0.01), view.velocity[0]
"""


class Counting:
    """It has noise, and a state of its own."""

    rate = 40.0
    columns = ("count", "noise")

    def __init__(self) -> None:
        self.counts = np.zeros(1)

    def sample(self, view: SensorView, random: np.random.Generator) -> Any:
        self.counts += 1.0
        return self.counts[0], random.normal()


class Calling:
    """It samples with a function, in each tick."""

    def __init__(
        self, function: Callable[[SensorView], Any], columns: Any = ("value",), rate: float | None = None
    ) -> None:
        self.function, self.columns, self.rate = function, columns, rate

    def sample(self, view: SensorView, random: np.random.Generator) -> Any:
        return self.function(view)


def nothing(view: SensorView) -> float:
    return 0.0


def world_with(**sensors: Any) -> World:
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(y=2.0)}))
    for name, sensor in sensors.items():
        world.add_sensor("V1", name, sensor)
    return world


def reading(world: World, name: str = "own", vehicle: str = "V1") -> OwnReading:
    return world.frame.vehicles[vehicle].own[name]


def run(world: World, ticks: int) -> list[str]:
    return digests(world, ticks, lambda _: DRIVE)


# -- readings ----------------------------------------------------------------------------------------------------


def test_a_sensor_has_a_reading_in_the_frame_at_once_and_then_at_its_rate() -> None:
    world = world_with(own=Counting())
    first = world.frame
    assert first.vehicles["V2"].own == {}
    assert (reading(world).time, reading(world).columns) == (0.0, ("count", "noise"))
    times = [reading(world).time]
    for _ in range(10):
        times.append(world.step().vehicles["V1"].own["own"].time)
    assert times == pytest.approx([0.0, 0.0, 0.0, 0.03, 0.03, 0.05, 0.05, 0.05, 0.08, 0.08, 0.1])
    assert reading(world).values[0] == 5.0
    assert reading(world).values.dtype == np.float64
    assert not reading(world).values.flags.writeable
    assert first.vehicles["V1"].own["own"].values[0] == 1.0


def test_a_sensor_that_is_added_later_samples_at_once() -> None:
    world = world_with()
    for _ in range(7):
        world.step()
    world.add_sensor("V1", "own", Counting())
    assert reading(world).time == pytest.approx(0.07)
    world.step()
    assert reading(world).time == pytest.approx(0.08)  # sample 3 of 40 Hz is due at 0.075 s


def test_the_view_has_the_state_of_the_vehicle_and_the_poses_of_all_others() -> None:
    seen: list[Any] = []

    def look(view: SensorView) -> float:
        wheel = view.wheel("rear_left")
        seen[:] = [view.time, view.position, view.orientation, view.velocity, wheel.angular_velocity, view.poses]
        view.position[:] = np.inf  # a copy
        return 0.0

    spec = ScenarioSpec(
        vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(y=2.0)}, boxes={"box": BoxSpec(x=3, y=0)}
    )
    world = autodrive.make(spec)
    world.add_sensor("V1", "own", Calling(look))
    for _ in range(30):
        world.step(DRIVE)
    time, position, orientation, velocity, spin, poses = seen
    vehicle = world.frame.vehicles["V1"]
    assert time == world.time
    np.testing.assert_array_equal(position, vehicle.pose.position)
    np.testing.assert_array_equal(orientation, vehicle.pose.orientation)
    np.testing.assert_array_equal(velocity, vehicle.velocity)
    assert spin == vehicle.wheels.angular_velocity[2]
    bodies = world.frame.vehicles | world.frame.objects
    assert poses.keys() == bodies.keys()
    for name, body in bodies.items():
        np.testing.assert_array_equal(poses[name].position, body.pose.position)
        np.testing.assert_array_equal(poses[name].orientation, body.pose.orientation)


def test_rays_measure_closed_form_distances_in_the_frame_of_the_vehicle() -> None:
    rays = {  # the front of the box is at x = 1.9 m; the vehicle is at x = 1 m and turned to the left
        "box": ((0.0, 0.0, 0.0), (0.0, -2.0, 0.0), 0.9),
        "beyond the range": ((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), math.inf),
        "from an origin": ((0.3, -0.2, 0.0), (0.0, -1.0, 0.0), math.inf),
        "sky": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), math.inf),
        "inside": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), 0.0),
        "under the ground": ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), 0.0),
    }

    def cast(view: SensorView) -> Any:
        found = {name: view.cast(start, along)[0] for name, (start, along, _) in rays.items()}
        found["beyond the range"] = view.cast(*rays["beyond the range"][:2], range_max=0.5)[0]
        heights = view.cast([(0.0, 0.0, 0.1), (0.0, 0.0, 0.2)], (0.0, 0.0, -1.0))
        return [*found.values(), heights[1] - heights[0]]

    spec = ScenarioSpec(
        map="plane",
        vehicles={"V1": VehiclePlacement(x=1.0, yaw_deg=90.0)},
        boxes={"box": BoxSpec(x=2.0, y=0.0, size=(0.2, 0.2, 0.4))},
    )
    world = autodrive.make(spec)
    world.add_sensor("V1", "own", Calling(cast, [*rays, "height"]))
    expected = [distance for *_, distance in rays.values()]
    np.testing.assert_allclose(reading(world).values, [*expected, 0.1], atol=1e-6)  # the engine settles the box


def test_a_value_may_be_infinite_or_not_a_number() -> None:
    world = world_with(own=Calling(lambda _: (math.inf, math.nan), ("a", "b")))
    assert reading(world).values.tobytes() == np.array([math.inf, math.nan]).tobytes()


# -- reproducible bits -------------------------------------------------------------------------------------------


def test_a_reset_world_and_a_new_world_repeat_the_readings() -> None:
    world = world_with(own=Counting())
    first = run(world, 50)
    world.reset()
    assert run(world, 50) == first
    assert run(world_with(own=Counting()), 50) == first
    world.reset(seed=5)
    assert run(world, 50) != first


def test_a_restored_world_has_the_same_future_also_in_another_process() -> None:
    world, other = world_with(own=Counting()), world_with(own=Counting())
    run(world, 13)
    saved = pickle.loads(pickle.dumps(world.save()))
    future = run(world, 40)
    for one in (world, other):
        one.restore(saved)
        assert run(one, 40) == future


def test_each_sensor_has_a_random_stream_of_its_own() -> None:
    alone = reading(world_with(own=Counting())).values[1]
    world = world_with(other=Counting(), own=Counting())
    world.add_sensor("V2", "own", Counting())
    noises = [reading(world).values[1], reading(world, "other").values[1], reading(world, "own", "V2").values[1]]
    assert noises[0] == alone
    assert len(set(noises)) == 3


def test_sensors_do_not_change_the_rest_of_the_world() -> None:
    def without_own(world: World) -> list[float]:
        return [world.step(DRIVE).vehicles["V1"].imu.linear_acceleration[0] for _ in range(50)]

    assert without_own(world_with(own=Counting())) == without_own(world_with())


def test_a_snapshot_of_other_sensors_is_refused_and_changes_nothing() -> None:
    world, other = world_with(own=Counting()), world_with()
    run(world, 5)
    before = world.frame
    with pytest.raises(SnapshotError, match="sensor 'own' of vehicle 'V1' is not the same"):
        world.restore(other.save())
    assert world.frame is before
    with pytest.raises(SnapshotError, match="sensor 'own'"):
        other.restore(world.save())


def test_sensors_go_on_in_the_world_of_an_edit(tmp_path: Path) -> None:
    spec = with_radar(tmp_path)
    simulation = Simulation(autodrive.make(spec), speed=None, load=autodrive.make)
    simulation.world.add_sensor("V1", "own", Counting())
    simulation.run(0.1)
    with simulation:
        simulation.request(SetSensor("V1", "lidar", rate=5.0)).result()
    own = simulation.world.frame.vehicles["V1"].own
    assert own["own"].values[0] > 1.0
    assert own.keys() == {"own", "radar"}


# -- errors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "sensor", "text"),
    [
        ("a b", Counting(), "letters, digits and '_', such as radar, not 'a b'"),
        (3, Counting(), "not 3"),
        ("lidar", Counting(), "the vehicle has a sensor 'lidar' already"),
        ("front", Counting(), "the vehicle has a sensor 'front' already"),
        ("first", Counting(), "the vehicle has a sensor 'first' already"),
        ("own", Counting, "not the class Counting"),
        ("own", object(), "not object"),
        ("own", Calling(nothing, rate=0.0), "`rate` must be a number from 0.001 to 10000 Hz, or None, not 0.0"),
        ("own", Calling(nothing, rate="20"), "`rate` must be a number"),  # type: ignore[arg-type]
        ("own", Calling(nothing, columns="speed"), "`columns` must be 1 to 10000 names"),
        ("own", Calling(nothing, columns=("a", 3)), "a name in `columns` is a text of 1 to 100 characters, not 3"),
        ("own", Calling(nothing, columns=("a", "b", "a")), "`columns` has the name 'a' twice"),
    ],
)
def test_what_is_no_sensor_is_refused(name: Any, sensor: Any, text: str) -> None:
    world = world_with(first=Counting())
    before = world.frame
    with pytest.raises(CommandError, match=r"sensor .* of vehicle 'V1': ") as raised:
        world.add_sensor("V1", name, sensor)
    assert text in str(raised.value)
    assert world.frame is before


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ([1.0], "returned an array of shape (1,): `sample` must return 2 numbers, for a, b"),
        (1.0, "returned an array of shape (1,)"),
        ([[1.0, 2.0]], "returned an array of shape (1, 2)"),
        ([[1.0], [1.0, 2.0]], "returned no array"),
        (None, "returned None, which is not an array of numbers"),
        (("1", "2"), "returned ('1', '2'), which is not an array of numbers"),
        ((1j, 2.0), "which is not an array of numbers"),
    ],
)
def test_a_wrong_sample_is_an_error_that_says_what_is_right(value: Any, text: str) -> None:
    world = world_with()
    with pytest.raises(SensorError, match="sensor 'own' of vehicle 'V1' ") as raised:
        world.add_sensor("V1", "own", Calling(lambda _: value, ("a", "b")))
    assert text in str(raised.value)
    assert world.step().vehicles["V1"].own == {}


def test_an_exception_of_a_sensor_names_it_and_its_line_and_a_reset_ends_it() -> None:
    def fail(view: SensorView) -> float:
        if 0.05 < view.time < 0.07:
            raise KeyError("wrong")
        return view.time

    world = world_with(own=Calling(fail))
    with pytest.raises(SensorError, match=r"sensor 'own' of vehicle 'V1' raised KeyError: 'wrong'  \(.*\.py, line \d+"):
        run(world, 20)
    world.reset()
    run(world, 4)
    assert reading(world).values[0] == world.time


def test_a_wrong_ray_is_an_error() -> None:
    for ray in (((0, 0, 0), (0, 0, 0)), ((0, 0), (1, 0)), ((math.nan, 0, 0), (1, 0, 0))):
        with pytest.raises(SensorError, match="a ray needs an origin"):
            world_with(own=Calling(lambda view, ray=ray: view.cast(*ray)))


def test_attributes_that_cannot_be_copied_are_an_error() -> None:
    sensor = Counting()
    sensor.lock = (one for one in ())  # type: ignore[attr-defined]  # pyright: ignore
    with pytest.raises(
        SensorError, match=r"its attributes cannot be copied .*: keep values that never change in the class"
    ):
        world_with(own=sensor)


def test_an_error_of_a_sensor_pauses_a_simulation() -> None:
    def fail(view: SensorView) -> float:
        return 1.0 / (view.time < 0.05)

    world = world_with(own=Calling(fail))
    simulation = Simulation(world, speed=None, pause_on_error=True)
    with simulation:
        while not simulation.error:
            simulation.wait(0.01)
        assert simulation.is_paused
    assert "sensor 'own' of vehicle 'V1' raised ZeroDivisionError" in simulation.error


class SteppedClock:
    """A clock that a sensor moves on."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def wait(self, condition: Any, timeout: float | None) -> None:
        condition.wait(0.0)


@pytest.mark.parametrize(("duration", "is_slow"), [(0.004, False), (0.006, True)])
def test_a_slow_sensor_is_logged_once(duration: float, is_slow: bool, caplog: pytest.LogCaptureFixture) -> None:
    clock = SteppedClock()

    def work(view: SensorView) -> float:
        clock.time += duration if view.time > 0.02 else 0.1  # the first samples may compile
        return 0.0

    simulation = Simulation(world_with(own=Calling(work)), speed=None, clock=clock)
    with caplog.at_level(logging.WARNING, "autodrive.physics.sensors.own"):
        simulation.run(0.01 * (3 * TIMED + 3))
    found = [record.getMessage() for record in caplog.records if record.name == "autodrive.physics.sensors.own"]
    assert len(found) == is_slow
    assert all("sensor 'own' of vehicle 'V1' takes 6 ms per sample; a tick of 10 ms" in text for text in found)


# -- scenarios ---------------------------------------------------------------------------------------------------


def with_radar(folder: Path, reference: str = "my_radar.py:Radar", content: str = FILE) -> Path:
    """A scenario file with a sensor in a file beside it."""
    (folder / "my_radar.py").write_text(content, encoding="utf-8")
    path = folder / "radar.yaml"
    path.write_text(f"map: plane\nvehicles:\n  V1:\n    own_sensors: {{radar: {reference}}}\n", encoding="utf-8")
    return path


def test_a_scenario_has_sensors_of_a_file_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = with_radar(tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    world = autodrive.make(path)
    assert reading(world, "radar").columns == ("distance [m]", "speed [m/s]")
    first = run(world, 30)
    world.reset()
    assert run(world, 30) == first
    saved = elsewhere / "saved.yaml"
    saved.write_text(scenario_text(load_scenario(path)), encoding="utf-8")
    assert run(autodrive.make(saved), 30) == first


def test_the_same_sensor_added_by_hand_has_the_same_bits(tmp_path: Path) -> None:
    path = with_radar(tmp_path)
    names: dict[str, Any] = {}
    exec(FILE, names)
    world = autodrive.make(ScenarioSpec(map="plane"))
    world.add_sensor("V1", "radar", names["Radar"]())
    assert run(world, 30) == run(autodrive.make(path), 30)


@pytest.mark.parametrize(
    ("reference", "content", "text"),
    [
        ("my_radar", FILE, "must be FILE.py:CLASS, such as my_radar.py:Radar, not 'my_radar'"),
        ("other.py:Radar", FILE, "other.py' cannot be read: No such file or directory"),
        ("my_radar.py:Lidar", FILE, "cannot be loaded: ImportError: my_radar.py has no 'Lidar'"),
        ("my_radar.py:Radar", "import nothing_of_that_name", "cannot be loaded: ModuleNotFoundError"),
        ("my_radar.py:Radar", "class Radar:\n  rate = 1.0", "a sensor is an object with `rate`"),
        ("my_radar.py:Radar", FILE + "\n    def __init__(self, x): pass", "cannot be loaded: TypeError"),
        ("my_radar.py:Radar", FILE + "\n    def __init__(self): self.x = (i for i in ())", "cannot be copied"),
    ],
)
def test_a_wrong_sensor_of_a_scenario_is_an_error_with_its_line(
    reference: str, content: str, text: str, tmp_path: Path
) -> None:
    path = with_radar(tmp_path, reference, content)
    with pytest.raises(SpecError) as raised:
        autodrive.make(path)
    assert "vehicles.V1.own_sensors.radar (line 4): " in str(raised.value)
    assert text in str(raised.value)


def test_a_batch_refuses_sensors_of_the_user(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="a BatchWorld has no sensors of the user: remove 'own_sensors'"):
        BatchWorld(with_radar(tmp_path), 2)
