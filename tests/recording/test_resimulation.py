"""A recording is simulated again with the same bits, and a difference is named."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

import autodrive
from autodrive import Command, Simulation
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
from tests.recording.conftest import Drive
from tests.support.command_line import call


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
    with Recorder(tmp_path / "later.mcap", world, has_meshes=False):
        world.step()
    for name, reason in (("restored", "from a snapshot"), ("later", "begins at tick 10")):
        with open_recording(tmp_path / f"{name}.mcap") as recording, pytest.raises(RecordingError, match=reason):
            resimulate(recording)
