"""The driver that is included in the simulator: in town, before a red light, in a race, and what it refuses."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.protocol.codec import encode
from autodrive.protocol.messages import Collision, Command, LapCompleted, OffRoad, RedLight, Reset, StopSign
from autodrive.protocol.native import Error, Frame, LetDrive, Request, Response
from autodrive.run import RunOptions
from autodrive.run.included_driver import IncludedDriver, driver_of
from autodrive.run.recordings import ClientRecordings
from autodrive.world import World
from autodrive.world.simulation import Simulation
from tests.cli.test_cli_page import await_message, started, viewer

FAULTS = Collision, OffRoad, RedLight, StopSign


def drive(world: World, duration: float) -> tuple[float, list[object]]:
    """Let V1 be driven for that simulated time [s]: its way [m] and its events."""
    frame, command, way, events = world.frame, Command(), 0.0, list[object]()
    driver = driver_of(world, "V1", frame)
    while world.time < duration:
        command = driver.command(frame) or command
        frame = world.step({"V1": command})
        way += frame.vehicles["V1"].speed * world.tick_duration
        events += [event for event in frame.events if "V1" in (event.vehicle, getattr(event, "other", ""))]
    return way, events


def test_it_drives_through_the_town_with_traffic_and_breaks_no_rule() -> None:
    way, events = drive(autodrive.make("traffic"), 60.0)
    assert way > 8.0
    assert not [event for event in events if isinstance(event, FAULTS)]


def test_it_races() -> None:
    _, events = drive(autodrive.make("practice"), 40.0)
    assert any(isinstance(event, LapCompleted) for event in events)
    assert not [event for event in events if isinstance(event, Collision)]


def test_it_drives_a_vehicle_of_a_simulation_until_the_person_drives_or_a_reset() -> None:
    simulation = Simulation(autodrive.make("mini_map"), speed=None)
    included = IncludedDriver(simulation)
    simulation.add_sink(included)
    with simulation:
        with pytest.raises(AutodriveError, match="vehicle 'V9' is not known"):
            included.let_drive("V9", True)
        for end in (lambda: included.let_drive("V1", False), lambda: simulation.request(Reset()).result()):
            simulation.request(Reset()).result()
            included.let_drive("V1", True)
            while simulation.frame.vehicles["V1"].speed < 0.1:
                pass
            assert simulation.frame.vehicles["V1"].is_autonomous
            end()
            began = simulation.frame.time
            while simulation.frame.time < began + 3.0:
                pass
            assert abs(simulation.frame.vehicles["V1"].speed) < 0.01


def test_a_client_lets_it_drive_and_gives_the_vehicle_back() -> None:
    with started(RunOptions("mini_map")) as run, viewer(run.link) as one:
        one.send(encode(Request(1, LetDrive("V1"))))
        await_message(one, Response)
        while await_message(one, Frame).vehicles["V1"].speed < 0.1:
            pass
        one.send(encode(Request(2, LetDrive("V1", is_on=False))))
        await_message(one, Response)
        while await_message(one, Frame).vehicles["V1"].is_autonomous:
            pass
        one.send(encode(Request(3, LetDrive("V7"))))
        assert "vehicle 'V7' is not known" in await_message(one, Error).text
        run.end()


def test_it_refuses_a_map_without_lanes() -> None:
    world = autodrive.make("plane")
    with pytest.raises(AutodriveError, match="this map has none"):
        driver_of(world, "V1", world.frame)


def test_a_recording_that_is_not_in_the_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "secret.mcap").touch()
    folder = tmp_path / "recordings"
    recordings = ClientRecordings(Simulation(autodrive.make("plane")), folder, scenario=lambda: "plane")
    for name in ("drive.mcap", "../secret.mcap", "notes.txt"):
        with pytest.raises(AutodriveError, match=rf"is not in the folder .*{re.escape(str(folder))}: copy it there"):
            recordings.replay(name)
