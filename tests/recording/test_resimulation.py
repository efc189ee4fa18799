"""A recording is simulated again with the same bits, and a difference is named."""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest
from msgspec.structs import replace

import autodrive
from autodrive import Command, Indicators, Simulation
from autodrive.base.errors import SnapshotError
from autodrive.protocol.messages import (
    AddBox,
    Hold,
    LoadScenario,
    Reset,
    SetDrivingMode,
    SetTimeOfDay,
    SetTrafficLight,
    SetWeather,
    Teleport,
    TrafficLightState,
    Undo,
    Weather,
)
from autodrive.recording import Recorder, RecordingError, resimulation
from autodrive.recording import open as open_recording
from autodrive.recording.about import about_here
from autodrive.recording.resimulation import first_difference, resimulate
from autodrive.world import saved_world
from tests.recording.conftest import Drive
from tests.support.command_line import call
from tests.support.waiting import wait_until


def test_the_drive_is_identical(drive: Drive) -> None:
    with open_recording(drive.path) as recording:
        result = resimulate(recording)
    assert str(result) == "identical"
    assert result.frames == len(drive.frames)
    assert result.made_by == ""


def test_a_recording_of_other_code_says_so(drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    """The version alone is the same for all code between two releases."""
    monkeypatch.setattr(resimulation, "about_here", lambda: {**about_here(), "code": "0123456789ab"})
    with open_recording(drive.path) as recording:
        assert resimulate(recording).made_by == f"code {about_here()['code']} (here 0123456789ab)"


def test_everything_that_a_simulation_does_is_repeated(tmp_path: Path) -> None:
    """Requests between ticks, edits that make a new World, another scenario, and a rate below that of the ticks."""
    path = tmp_path / "run.mcap"
    simulation = Simulation(autodrive.make("plane"), speed=None, load=autodrive.make)
    with Recorder(path, simulation, frame_rate=30.0, has_meshes=False) as recorder:
        requests = [
            Teleport("V1", 1.0, 2.0, 0.5),
            SetTimeOfDay(3600.0 * 7, 60.0),
            SetWeather(Weather(fog=0.5, rain=0.8)),
            AddBox("crate", 2.0, 2.5),
            Undo(),
            SetDrivingMode("V1", is_autonomous=False),
            Hold("V1", (0.0, 0.0, 0.5)),
            Hold("V1", None),
            Reset(5),
            LoadScenario("tiny_town"),
            SetTrafficLight("traffic_light_1", TrafficLightState.GREEN),
            LoadScenario("mini_map"),
        ]
        for i, request in enumerate(requests):
            simulation.submit("V1", Command(0.5, 0.1 * i), "person" if i in {5, 6, 7} else "script")
            simulation.run(0.11)
            done = simulation.request(request)
            simulation.run(0.01)
            done.result()
        simulation.run(0.2)
    assert recorder.error == ""
    with open_recording(path) as recording:
        assert len(recording.scenarios) == 5  # the first, with a box, without it, Tiny Town, and the mini-map
        result = resimulate(recording)
    assert str(result) == "identical"
    assert result.frames > 30


@pytest.mark.parametrize("scenario", ["plane", "tiny_town", "traffic"])
def test_a_recording_that_begins_in_the_middle_of_a_run_is_repeated(tmp_path: Path, scenario: str) -> None:
    """The first Frame has the state of all that is in no Frame: wheels, noise, lamps, drivers of the traffic."""
    path = tmp_path / "later.mcap"
    simulation = Simulation(autodrive.make(scenario, seed=3), speed=None, load=autodrive.make)
    for request in (SetWeather(Weather(rain=0.7)), SetTimeOfDay(3600.0 * 20, 60.0), AddBox("crate", 0.5, 0.5)):
        done = simulation.request(request)
        simulation.run(0.02)
        done.result()
    for _ in range(500):
        simulation.submit("V1", Command(0.4, 0.2, indicators=Indicators.LEFT))
        simulation.run(simulation.world.tick_duration)
    assert simulation.frame.tick > 500
    with Recorder(path, simulation, has_meshes=False):
        for _ in range(150):
            simulation.submit("V1", Command(0.7, -0.3))
            simulation.run(simulation.world.tick_duration)
        done = simulation.request(Reset(4))
        simulation.run(0.1)
        done.result()
    with open_recording(path) as recording:
        result = resimulate(recording)
        assert str(result) == "identical"
        assert result.frames > 150


def test_a_recording_that_begins_while_time_runs_has_each_tick(tmp_path: Path) -> None:
    path = tmp_path / "running.mcap"
    with Simulation(autodrive.make("plane"), speed=1.0) as simulation:
        for throttle in (0.5, 0.9):
            simulation.submit("V1", Command(throttle, 0.1))
            wait_until(lambda tick=simulation.frame.tick: simulation.frame.tick > tick + 20)
        with Recorder(path, simulation, has_meshes=False):
            first = simulation.frame.tick
            simulation.submit("V1", Command(0.2, -0.1))
            wait_until(lambda: simulation.frame.tick > first + 30)
    with open_recording(path) as recording:
        ticks = [frame.tick for frame in recording.frames()]
        assert ticks == list(range(ticks[0], ticks[0] + len(ticks)))
        assert str(resimulate(recording)) == "identical"


def test_a_damaged_state_at_the_start_is_an_error(tmp_path: Path) -> None:
    world = autodrive.make("plane")
    for _ in range(3):
        world.step()
    state, frame = saved_world.saved(world), world.frame
    assert state is not None
    other = autodrive.make("mini_map")
    for damaged in (state[:-5], b"", zlib.compress(b"\x00"), zlib.compress(zlib.decompress(state)[:-100])):
        with pytest.raises(SnapshotError, match="the saved state is damaged"):
            saved_world.restore(world, damaged, frame)
    with pytest.raises(SnapshotError, match="another world"):
        saved_world.restore(other, state, other.frame)
    saved_world.restore(autodrive.make("plane"), state, frame)


def test_a_race_is_repeated(tmp_path: Path) -> None:
    world = autodrive.make("practice", seed=2)
    with Recorder(tmp_path / "race.mcap", world, has_meshes=False):
        for tick in range(200):
            world.step(dict.fromkeys(world.vehicle_names, Command(0.3)))
            if tick == 150:
                world.retire(world.vehicle_names[0], "out of battery")
    with open_recording(tmp_path / "race.mcap") as recording:
        assert {name.partition("/")[0] for name in recording.scenario.files} >= {"map", "vehicle", "ruleset"}
        assert recording.frame_at(2.0).vehicles[world.vehicle_names[0]].race is not None
        assert recording.events
        assert str(resimulate(recording)) == "identical"


def test_a_reset_to_a_weather_is_repeated(tmp_path: Path) -> None:
    world = autodrive.make("mini_map")
    with Recorder(tmp_path / "reset.mcap", world, has_meshes=False):
        for weather in (Weather(fog=1.0, rain=0.5), None):
            world.reset(3, weather=weather)
            for _ in range(30):
                world.step({"V1": Command(0.5)})
    with open_recording(tmp_path / "reset.mcap") as recording:
        assert str(resimulate(recording)) == "identical"
        shown = [frame.weather is not None for frame in recording.frames()]
    assert shown.count(True) == 31
    assert not shown[-1]


def test_a_start_in_motion_is_repeated(tmp_path: Path) -> None:
    world = autodrive.make("plane")
    with Recorder(tmp_path / "motion.mcap", world, has_meshes=False):
        for _ in range(2):
            world.reset(motions={"V1": [0.3, 0.0, 0.2, 0.5, 0.1]}, past_commands={"V1": [(0.9, -0.4)] * 5})
            for _ in range(20):
                world.step({"V1": Command(0.5, 0.2)})
    with open_recording(tmp_path / "motion.mcap") as recording:
        assert str(resimulate(recording)) == "identical"
        starts = [frame for frame in recording.frames() if frame.tick == 0]
    speeds = [frame.vehicles["V1"].velocity[0] for frame in starts[1:]]  # the first one is at rest
    assert speeds == pytest.approx([0.3, 0.3])


def test_a_difference_is_named(drive: Drive) -> None:
    frame = drive.frames[5]
    vehicle = frame.vehicles["V2"]
    euler = vehicle.imu.euler.copy()
    euler[2] += 1e-12
    other = replace(frame, vehicles={**frame.vehicles, "V2": replace(vehicle, imu=replace(vehicle.imu, euler=euler))})
    difference = first_difference(frame, other, 0.05)
    assert difference is not None
    assert difference.signal == "vehicles.V2.imu.euler[2]"
    assert (difference.tick, difference.recorded, difference.simulated) == (5, vehicle.imu.euler[2], euler[2])
    assert "different at tick 5 (0.05 s): vehicles.V2.imu.euler[2] was" in str(difference)


def test_the_command_prints_identical_or_the_first_difference(tmp_path: Path) -> None:
    for gravity, code, text in ((9.81, 0, "identical"), (9.0, 1, "different at tick 1 (0.01 s): vehicles.V1.")):
        world = autodrive.make("plane")
        world.conditions.spec = world.spec.model_copy(
            update={"gravity": gravity}
        )  # what was simulated is not what is recorded
        path = tmp_path / f"{gravity}.mcap"
        with Recorder(path, world, has_meshes=False):
            for _ in range(5):
                world.step()
        done = call("replay", path, "--resimulate")
        assert done.returncode == code
        assert done.stdout.splitlines()[-1].startswith(text)


def test_what_cannot_be_simulated_again_says_why(tmp_path: Path) -> None:
    world = autodrive.make("plane")
    saved = world.save()
    with Recorder(tmp_path / "restored.mcap", world, has_meshes=False):
        world.step()
        world.restore(saved)
        world.step()
    world.reset()
    for _ in range(10):
        world.step()
    with Recorder(tmp_path / "later.mcap", world, has_meshes=False, last=5.0) as recorder:
        world.step()
        recorder.save()
        for _ in range(110):
            world.step()
    recorder.files[0].rename(tmp_path / "later.mcap")
    for name, reason in (("restored", "from a snapshot"), ("later", "begins at tick 10")):
        with open_recording(tmp_path / f"{name}.mcap") as recording, pytest.raises(RecordingError, match=reason):
            resimulate(recording)
