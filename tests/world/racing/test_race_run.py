"""Races of devkit scripts: each sees itself as V1; a script that dies, stalls or cheats gets what the rules say."""

from __future__ import annotations

import csv
import hashlib
import itertools
import json
import math
import re
import runpy
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from autodrive import Client, Command, recording
from autodrive.base.errors import AutodriveError, CommandError, SpecError
from autodrive.connect.devkit import RoboRacer, Server
from autodrive.connect.server.served import PageOptions
from autodrive.protocol.messages import Frame
from autodrive.run.race import RaceOptions, race
from autodrive.run.runner import Run, RunObserver, StopRequest
from autodrive.scenario.kinds import find

GAP: Callable[..., tuple[float, float]] = runpy.run_path(
    str(Path(__file__).parents[3] / "examples" / "racing" / "follow_the_gap.py")
)["command"]
ANGLES = np.radians(np.linspace(-135.0, 135.0, 1080))


@dataclass
class Script:
    """A devkit script in this process that follows the gap, and does something else from its message `at` on."""

    at: int = -1
    misbehave: Callable[[RoboRacer], None] = lambda car: None
    car: RoboRacer = field(default_factory=lambda: RoboRacer("V1"))
    keys: set[str] = field(default_factory=set[str])
    numbers: list[float] = field(default_factory=list[float])
    messages: int = 0
    scans: list[str] = field(default_factory=list[str])

    def respond(self, data: Any) -> dict[str, str] | None:
        self.messages += 1
        self.keys |= {key.split()[0] for key in data if key.startswith("V")}
        self.car.parse_data(data)
        self.scans.append(hashlib.sha256(self.car.lidar_range_array.tobytes()).hexdigest())
        withheld = (*self.car.position, *self.car.linear_velocity, self.car.speed, self.car.lap_time)
        self.numbers += map(float, withheld)
        self.car.throttle_command, self.car.steering_command = GAP(self.car.lidar_range_array, ANGLES)
        if 0 <= self.at <= self.messages:
            if self.misbehave is silent:
                return None
            self.misbehave(self.car)
        return self.car.generate_commands()


def silent(car: RoboRacer) -> None:
    """Answer nothing."""


def hesitate(car: RoboRacer) -> None:
    """Answer late, for longer than the delay after which telemetry is resent in real time."""
    time.sleep(1.2)


def die(car: RoboRacer) -> None:
    raise RuntimeError("this script dies")


def reset(car: RoboRacer) -> None:
    car.reset_command = True


def ruleset(folder: Path, **changes: Any) -> str:
    rules = yaml.safe_load(find("ruleset", "league_2026").read_text()) | {"warm_up_laps": 0, **changes}
    (folder / "rules.yaml").write_text(yaml.safe_dump(rules))
    return str(folder / "rules.yaml")


def run(options: dict[str, Any], *scripts: Script, stop: StopRequest | None = None) -> Any:
    with ExitStack() as stack:
        servers = [stack.enter_context(Server(script.respond, port=0)) for script in scripts]
        devkits = tuple(("127.0.0.1", server.port) for server in servers)
        return race(RaceOptions("practice", devkits, has_page=False, **options), stop=stop)


@pytest.mark.wall_clock
@pytest.mark.slow
def test_scripts_that_die_stall_or_cheat_leave_the_race_and_the_others_finish(tmp_path: Path) -> None:
    """Wall clock: a script is silent if it does not answer for some time, here 15 s."""
    good, dying = Script(), Script(40, die)
    stalling, cheating = Script(40, silent), Script(20, reset)
    rules = ruleset(tmp_path, race_laps=1, silence_limit=15.0)
    folder = tmp_path / "results"
    result = run(
        {"rules": rules, "is_lockstep": True, "output": folder, "teams": ("Good", "Dying", "Stalling", "Cheating")},
        *(good, dying, stalling, cheating),
    )
    by_team = {one.team: one for one in result.standings}
    assert [one.team for one in result.standings] == [by_team["Good"].team, "Dying", "Stalling", "Cheating"]
    assert by_team["Good"].status == "finished"
    assert by_team["Good"].laps[0].time == by_team["Good"].race_time
    assert {by_team[name].reason for name in ("Dying", "Stalling")} == {"no command for 15 s"}
    assert (by_team["Cheating"].status, by_team["Cheating"].reason) == (
        "disqualified",
        "its script requested a reset",
    )
    for script in (good, dying, stalling, cheating):
        assert script.keys == {"V1"}
        assert not any(script.numbers)  # position, velocities and lap times are withheld
        assert script.car.last_lap_time == script.car.best_lap_time == math.inf  # as before the first lap
    assert json.loads((folder / "result.json").read_text())["standings"][0]["team"] == "Good"
    rows = (folder / "result.md").read_text().splitlines()
    total = f"{by_team['Good'].race_time:.2f}"
    collisions = by_team["Good"].collisions
    assert (
        rows[6] == f"| 1 | Good | {total} | {collisions} | {float(total) + 10 * collisions:.2f} | {total} | finished |"
    )
    (lap,) = csv.DictReader((folder / "laps.csv").open())
    assert float(lap["time"]) == pytest.approx(sum(float(lap[f"sector_{i}"]) for i in range(1, 19)), abs=1e-3)
    assert (folder / "lines.png").read_bytes().startswith(b"\x89PNG")


def test_in_lock_step_two_races_have_the_same_scans_however_slow_a_script_is(tmp_path: Path) -> None:
    rules = ruleset(tmp_path, time_limit=2.0, silence_limit=120.0)
    races: list[list[list[str]]] = []
    for slow in (Script(), Script(78, hesitate)):
        scripts = Script(), slow
        run({"rules": rules, "is_lockstep": True}, *scripts)
        races.append([script.scans[:80] for script in scripts])
    assert races[0] == races[1]
    assert [len(scans) for scans in races[0]] == [80, 80]


def test_a_script_that_repeats_its_commands_is_named_and_slowed_down_to_real_time(tmp_path: Path) -> None:
    """As a ROS bridge that answers at once while its driver is still busy."""
    messages = itertools.count()

    def respond(_: Any) -> dict[str, str]:
        return {"V1 Throttle": "0.05", "V1 Steering": f"{0.001 * (next(messages) // 4):.3f}", "V1 Reset": "False"}

    lines: list[str] = []

    class Reading(RunObserver):
        def running(self, run: Run) -> None:
            lines.append(run.status())

    rules = ruleset(tmp_path, time_limit=3.0)
    with Server(respond, port=0) as server:
        here = (("127.0.0.1", server.port),)
        options = RaceOptions("practice", here, rules=rules, is_lockstep=True, has_page=False)
        result = race(options, observer=Reading())
    assert not any("x0.00" in line for line in lines)
    assert any(re.match(r" +\d+\.\d s  x\d+\.\d\d  V1 ", line) for line in lines)  # how fast it goes
    assert result.notes["V1"].startswith("Most commands of the script drove 4 ticks: ")
    assert "the result depends on the machine" in result.to_markdown()
    assert result.wall_time > 1.5  # the first second, of 40 commands, may be faster
    attentive = Script()
    assert not run({"rules": ruleset(tmp_path, time_limit=2.0), "is_lockstep": True, "pace": 50.0}, attentive).notes
    with pytest.raises(AutodriveError, match="the pace of a race in lock-step"):
        race(RaceOptions("practice", here, pace=1.0))


@pytest.mark.wall_clock
def test_in_real_time_a_car_that_is_too_slow_retires(tmp_path: Path) -> None:
    """Wall clock: simulated time follows it."""
    script = Script()
    result = run({"rules": ruleset(tmp_path, time_limit=1.0)}, script)
    assert [(one.status, one.reason) for one in result.standings] == [("retired", "not finished after 1 s")]
    assert result.simulated_time >= 1.0
    assert script.messages > 0


SCRIPT = """
import sys
import speed
from autodrive.devkit import RoboRacer, drive
car = RoboRacer("V1")
car.throttle_command, car.steering_command = speed.THROTTLE, 0.0
print("this script listens", flush=True)
drive(lambda: None, car, port=int(sys.argv[1]))
"""


def test_a_race_is_recorded_and_starts_scripts_whose_output_stands_beside_the_result(tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(SCRIPT)
    (tmp_path / "speed.py").write_text("THROTTLE = 0.05")
    code = (tmp_path / "driver.py").read_bytes() + (tmp_path / "speed.py").read_bytes()
    command, folder, file = f"python {tmp_path / 'driver.py'} {{port}}", tmp_path / "results", tmp_path / "race.mcap"
    rules = ruleset(tmp_path, time_limit=0.5)
    options = RaceOptions("practice", scripts=(command, "python -c 'print(7)' {port}"), rules=rules, is_lockstep=True)
    race(replace(options, has_page=False, output=folder, record=file))
    assert (folder / "V1.log").read_text() == "this script listens\n"
    result = json.loads((folder / "result.json").read_text())
    reasons = {one["vehicle"]: one["reason"] for one in result["standings"]}
    assert reasons == {"V1": "not finished after 0.5 s", "V2": "the script ended with exit code 0: 7"}
    assert result["recording"] == str(file)
    digests = {name: hashlib.sha256(Path(path).read_bytes()).hexdigest() for name, path in (
        ("track", find("track", "practice")), ("rules", rules)
    )}  # fmt: skip
    digests |= {name: hashlib.sha256(content).hexdigest() for name, content in (("V1", code), ("V2", b""))}
    assert result["digests"] == digests
    assert result["notes"] == {}
    with recording.open(file) as recorded:
        assert recorded.duration > 0.4
    with pytest.raises(AutodriveError, match=r"needs \{port\}"):
        race(RaceOptions("practice", scripts=("python driver.py",)))


def test_a_script_that_never_connects_and_a_race_that_is_stopped(tmp_path: Path) -> None:
    options = RaceOptions("practice", (("127.0.0.1", 9),), has_page=False, start_limit=0.2, is_lockstep=True)
    (standing,) = race(options).standings
    assert standing.reason == "no script at 127.0.0.1:9 (connection refused)"
    assert (standing.status, standing.race_time) == ("retired", 0.0)
    stop = StopRequest()

    class Stopping(RunObserver):
        def running(self, run: Run) -> None:
            frame: Frame = run.simulation.frame
            if frame.time > 0.5:
                stop.set("SIGINT")

    with Server(Script().respond, port=0) as server:
        options = RaceOptions("practice", (("127.0.0.1", server.port),), has_page=False, is_lockstep=True)
        result = race(options, stop=stop, observer=Stopping())
    assert (result.ended_by, result.standings[0].status) == ("SIGINT", "racing")


def set_light_until_refused(client: Client) -> None:
    """The refusal of a drive comes with one of the next calls."""
    for _ in range(100):
        client.set_scene_light(True)


class Viewer(RunObserver):
    """A client of the native protocol that tries to change the race, once; `texts` are the answers."""

    def __init__(self, is_lockstep: bool) -> None:
        self.texts: list[str] = []
        self._is_lockstep = is_lockstep

    def running(self, run: Run) -> None:
        if self.texts or run.simulation.frame.time < 0.2:
            return
        assert run.server is not None
        with Client(run.server.address) as client:
            forbidden: list[Callable[[], object]] = [
                lambda: client.load_scenario("mini_map"),
                client.reset,
                lambda: client.set_speed(2.0),
                lambda: client.teleport("V1", 1.0, 0.0),
                lambda: client.set_driving_mode("V1", False),
                lambda: client.add_box("box", 1.0, 0.0),
            ]
            for change in forbidden if not self._is_lockstep else [*forbidden, client.pause, client.resume]:
                with pytest.raises(CommandError) as refused:
                    change()
                self.texts.append(str(refused.value))
            client.drive("V1", Command(throttle=-1.0))
            with pytest.raises(CommandError, match="the scripts of the race drive"):
                set_light_until_refused(client)
            if not self._is_lockstep:
                client.pause()
                time.sleep(4.5)  # a busy machine may be silent for a second without a pause
                client.resume()


@pytest.mark.wall_clock
@pytest.mark.parametrize("is_lockstep", [False, True])
def test_a_viewer_cannot_change_a_race_and_the_race_goes_on(tmp_path: Path, is_lockstep: bool) -> None:
    """Wall clock: the pause of a marshal is longer than the silence for which a script retires."""
    viewer = Viewer(is_lockstep)
    rules = ruleset(tmp_path, time_limit=6.0, silence_limit=10.0 if is_lockstep else 4.0)
    with Server(Script().respond, port=0) as server:
        options = RaceOptions(
            "practice",
            (("127.0.0.1", server.port),),
            rules=rules,
            is_lockstep=is_lockstep,
            has_page=True,
            page=PageOptions(port=0),
        )
        result = race(options, observer=viewer)
    assert [one.reason for one in result.standings] == ["not finished after 6 s"]
    assert viewer.texts[0].startswith("a race is in progress: LoadScenario would change the race")
    assert len(viewer.texts) == (8 if is_lockstep else 6)


def test_options_that_are_no_race_are_refused() -> None:
    here = ("127.0.0.1", 4567)
    with pytest.raises(AutodriveError, match="1 to 8 scripts"):
        race(RaceOptions("practice", ()))
    with pytest.raises(AutodriveError, match="its own address"):
        race(RaceOptions("practice", (here, here)))
    with pytest.raises(AutodriveError, match="give --laps N"):
        race(RaceOptions("practice", (here,), rules="practice"))
    with pytest.raises(SpecError, match="'practise' is not known"):
        race(RaceOptions("practise", (here,)))
