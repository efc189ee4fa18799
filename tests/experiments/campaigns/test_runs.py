"""Campaigns run: the same bytes wherever they run, and no driver ends one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from autodrive import CommandError, SnapshotError, make
from autodrive.base.errors import AutodriveError, SpecError
from autodrive.experiments.campaigns import Campaign, LocalExecutor, run_campaign
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.keys import RowCache, RunKeys
from autodrive.experiments.campaigns.runner import Runner, RunResult
from autodrive.experiments.campaigns.runs import CampaignObserver, CampaignProgress
from autodrive.experiments.campaigns.table import Table
from autodrive.experiments.policies import Policy
from autodrive.experiments.policies.racer import PERIOD, PolicyRacer
from autodrive.protocol.messages import Command
from autodrive.recording import open as open_recording
from autodrive.recording.resimulation import resimulate
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.files import scenario_text
from autodrive.scenario.maps.map import load_map
from autodrive.world.compile import on_grid
from tests.support.command_line import call, interrupted_when
from tests.support.frames import digest
from tests.support.radar import radar_scenario

Make = Callable[..., Campaign]
ROOT = Path(__file__).parents[3]


class Counting(CampaignObserver):
    """Counts the rows that are not new."""

    reused = 0

    def progress(self, progress: CampaignProgress) -> None:
        self.reused = progress.reused


def rows(folder: Path) -> list[dict[str, Any]]:
    return parquet.read_table(folder / "table.parquet").to_pylist()


def test_a_world_with_factors_has_the_bits_of_a_new_world() -> None:
    place = VehiclePlacement(has_realistic_sensors=True, x=0.2)
    spec = ScenarioSpec(map="mini_map", vehicles={"V1": place}, seed=4)
    world = make(spec)
    saved = world.save()
    for values in ((2.0, 0.4, 3.0, 0.7, 0.05), (1.0, 1.0, 1.0, 1.0, 0.0), (0.5, 1.3, 0.0, 1.2, -0.02)):
        factors: dict[str, float] = dict(zip(("mass", "grip", "noise", "drive", "trim"), values, strict=True))
        fields = "mass_factor", "grip_factor", "noise_factor", "drive_factor", "steering_trim"
        placed = place.model_copy(update=dict(zip(fields, values, strict=True)))
        new = make(spec.model_copy(update={"vehicles": {"V1": placed}}))
        world.set_factors({"V1": factors})
        one, other = world.reset(), new.reset()
        for tick in range(150):
            command = {"V1": Command(1.0, (-1.0) ** (tick // 40))}
            one, other = world.step(command), new.step(command)
        assert digest(one) == digest(other)
        assert world.spec == new.spec
        saved = world.save()
        world.step()
        world.restore(saved)
    world.set_factors({"V1": {"noise": 2.0}})
    with pytest.raises(SnapshotError):
        world.restore(saved)
    with pytest.raises(CommandError, match="factor grip"):
        world.set_factors({"V1": {"grip": 0.0}})


def test_a_warm_world_gives_the_bits_of_a_new_one(campaign: Make) -> None:
    one = campaign()
    warm = Runner(one)
    first = [warm.run(one.run(number)) for number in range(4)]
    assert [warm.run(one.run(number)) for number in reversed(range(4))] == first[::-1]
    assert [Runner(one).run(one.run(number)) for number in range(4)] == first
    assert first[0] != first[2]


@pytest.mark.slow
@pytest.mark.process
def test_the_table_does_not_depend_on_workers_kills_resumes_or_the_cache(campaign: Make, tmp_path: Path) -> None:
    one = campaign()
    outcome = run_campaign(one, tmp_path / "one", workers=0, uses_cache=False)
    expected = outcome.table.read_bytes()
    assert outcome.is_complete
    assert outcome.summary["rows"] == 16
    assert [row["run"] for row in rows(outcome.folder)] == [*range(16)]

    executor = LocalExecutor(one, 2)

    class Killing(CampaignObserver):
        """Kills a worker after some results, and stops the campaign later, as Ctrl-C does."""

        def progress(self, progress: CampaignProgress) -> None:
            if progress.done == 3:
                (pid, *_) = [worker.pid for worker in executor.workers if worker.pid]
                os.kill(pid, signal.SIGKILL)
            if progress.done == 9:
                raise KeyboardInterrupt

    broken = run_campaign(one, tmp_path / "two", executor=executor, observer=Killing())
    assert not broken.is_complete
    assert 9 <= len(rows(broken.folder)) < 16
    counting = Counting()
    resumed = run_campaign(one, tmp_path / "two", workers=2, uses_cache=False, observer=counting)
    assert resumed.table.read_bytes() == expected
    assert counting.reused == len(rows(broken.folder)) or counting.reused >= 9

    # The broken campaign has filled the cache with its rows; all of them after this.
    run_campaign(one, tmp_path / "three", workers=0)
    cached = run_campaign(one, tmp_path / "four", workers=0, observer=counting)
    assert counting.reused == 16
    assert cached.table.read_bytes() == expected


def test_latency_and_arguments_of_the_driver_need_no_other_world(campaign: Make) -> None:
    one = campaign(parameters={"latency": [0.0, 0.1], "driver.throttle": [0.3, 0.6], "vehicles.V1.x": [0.0, 0.1]})
    runner = Runner(one)
    worlds = {id(runner.world(one.run(number).values)) for number in range(16)}
    assert len(worlds) == 1


@pytest.mark.slow
def test_what_decides_a_result_is_in_its_key(campaign: Make, tmp_path: Path) -> None:
    small: dict[str, Any] = {"samples": {"method": "sobol", "count": 1}, "seeds": 1}
    run_campaign(campaign(**small), tmp_path / "one", workers=0)

    def reused(**changes: Any) -> int:
        counting = Counting()
        run_campaign(campaign(**(small | changes)), tmp_path / f"{sorted(changes)}", workers=0, observer=counting)
        return counting.reused

    assert reused() == reused(pass_="distance > 1") == reused(title="the same runs") == 1
    assert reused(stop={"time": 0.4}) == reused(seeds=[1]) == reused(metrics=["collisions", "distance"]) == 0
    with (tmp_path / "driver.py").open("a") as file:
        file.write("# another driver\n")
    assert reused() == 0


@pytest.mark.slow
@pytest.mark.process
def test_no_driver_ends_a_campaign(campaign: Make, tmp_path: Path) -> None:
    faults = ["", "raises", "leaves", "kills", "hangs", "talks"]
    one = campaign(parameters={"driver.fault": faults}, samples={}, seeds=1, time_limit=8.0)
    outcome = run_campaign(one, tmp_path / "out", workers=1)
    assert outcome.is_complete
    found = rows(outcome.folder)
    assert [row["status"] for row in found] == ["pass", *["error"] * 5]
    none, raises, leaves, kills, hangs, talks = (row["error"] for row in found)
    assert none == ""
    assert raises == "ValueError: the road is lost  (driver.py, line 17)"
    assert leaves == "SystemExit: 3  (driver.py, line 19)"
    assert kills == "the process of the run ended before the run"
    assert hangs == "the run did not end within 8 s of wall time"
    assert talks.startswith("CommandError: vehicle 'V9'")
    report = (outcome.report).read_text()
    assert "autodrive campaign" in report
    assert "--replay 1" in report
    assert "http" not in report.replace("http://www.w3.org", "")  # it needs nothing else


def test_failures_are_recorded_and_can_be_simulated_again(campaign: Make, tmp_path: Path) -> None:
    one = campaign(
        parameters={"driver.throttle": [0.3, 0.6], "vehicles.V1.yaw_deg": [30.0], "vehicles.V1.grip_factor": [0.7]},
        samples={},
        seeds=1,
        record="failures",
        pass_="distance > 0.09",
    )
    outcome = run_campaign(one, tmp_path / "out", workers=0)
    found = rows(outcome.folder)
    assert sorted(row["status"] for row in found) == ["fail", "pass"]
    (failed,) = [row for row in found if row["status"] == "fail"]
    assert [path.name for path in (tmp_path / "out" / "recordings").iterdir()] == [failed["recording"]]
    with open_recording(tmp_path / "out" / "recordings" / failed["recording"]) as recording:
        assert resimulate(recording).difference is None
    replayed = call("campaign", one.path or "", "--replay", str(failed["run"]), "--output", tmp_path / "again")
    assert f"distance: {failed['distance']:.6g}" in replayed.stdout
    assert (tmp_path / "again" / "recordings" / failed["recording"]).is_file()


def test_latency_delays_the_commands(campaign: Make) -> None:
    one = campaign(parameters={"latency": [0.0, 0.2]}, samples={}, metrics=["distance", "max_speed"], pass_="")
    runner = Runner(one)
    at_once, late = (runner.run(one.run(number)) for number in (0, 2))
    shorter = Runner(campaign(parameters={}, stop={"time": 0.3}, metrics=["max_speed"], pass_="", samples={}))
    expected = shorter.run(shorter.campaign.run(0))
    assert at_once.metrics["distance"] > 1.5 * late.metrics["distance"]
    assert late.metrics["max_speed"] == pytest.approx(expected.metrics["max_speed"], rel=1e-3)


def test_parameters_of_files_and_of_the_map(campaign: Make) -> None:
    ranges = {"map.ground.grip": [1.0, 0.1], "vehicles.V1.spec.body.drag": [3.0, 0.1]}
    one = campaign(parameters=ranges, samples={}, seeds=1, stop={"time": 2.0}, metrics=["distance"], pass_="")
    runner = Runner(one)
    distances = [runner.run(one.run(number)).metrics["distance"] for number in range(4)]
    assert len(set(distances)) == 4
    assert distances[0] < distances[1]


def test_a_start_pose_that_overlaps_something_is_an_error(campaign: Make) -> None:
    one = campaign(
        scenario="mini_map",
        parameters={"vehicles.V1.x": [0.0, 3.8], "vehicles.V1.y": [0.0, 1.75]},
        samples={},
        seeds=1,
        pass_="",
    )
    runner = Runner(one)
    assert runner.run(one.run(0)).error == ""
    assert "overlap" in runner.run(one.run(3)).error


@pytest.mark.slow
@pytest.mark.process
def test_a_devkit_script_drives_in_lock_step(campaign: Make, tmp_path: Path) -> None:
    script = ROOT / "examples/python/2_follow_waypoints.py"
    one = campaign(
        scenario="mini_map",
        driver=f"python {script} {{port}}",
        parameters={"vehicles.V1.grip_factor": [1.0]},
        samples={},
        metrics=["distance"],
        pass_="",
        stop={"time": 1.0},
    )
    first, again = (Runner(one).run(one.run(0)) for _ in range(2))
    assert first.error == ""
    assert first == again
    assert first.metrics["distance"] > 0.2
    broken = campaign(driver="python -c 'print(1/0)' {port}", parameters={}, samples={})
    assert Runner(broken).run(broken.run(0)).error.endswith("exit code 1: ZeroDivisionError: division by zero")


WAITING = """
import time
class Driver:
    runs = 0
    def __init__(self, throttle): pass
    def reset(self, scene):
        Driver.runs += 1
        while Driver.runs > 20: time.sleep(0.01)  # until Ctrl-C
    def act(self, frame): return None
"""


def test_ctrl_c_keeps_what_is_done_and_the_command_goes_on(
    campaign: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("autodrive.experiments.campaigns.table.PART_TIME", 0.0)
    (tmp_path / "waiting.py").write_text(WAITING)
    samples = {"method": "sobol", "count": 2000}
    one = campaign(samples=samples, stop={"time": 0.1}, seeds=1, driver="waiting.py:Driver")
    folder = tmp_path / "out"
    with interrupted_when(lambda: len(list(folder.glob("parts/*.parquet"))) >= 10):
        ended = call("campaign", str(one.path), "--workers", "0", "--output", folder)
    assert ended.returncode == 130, ended.stderr
    done = len(rows(folder))
    assert 0 < done <= 20
    assert json.loads((folder / "summary.json").read_text())["rows"] == done
    assert f"{done} of 2000 runs" in ended.stdout
    assert "the same command continues" in ended.stdout


def test_ctrl_c_keeps_rows_of_an_earlier_campaign_that_it_had_not_come_to(campaign: Make, tmp_path: Path) -> None:
    one = campaign()
    expected = run_campaign(one, tmp_path, workers=0, uses_cache=False).table.read_bytes()

    class Stopping(CampaignObserver):
        """Stops the campaign at once, as Ctrl-C does."""

        def progress(self, progress: CampaignProgress) -> None:
            if progress.done == 1:
                raise KeyboardInterrupt

    stopped = run_campaign(one, tmp_path, workers=0, uses_cache=False, observer=Stopping())
    assert not stopped.is_complete
    assert stopped.table.read_bytes() == expected


def test_rows_of_a_killed_campaign_are_there_again(campaign: Make, tmp_path: Path) -> None:
    one = campaign()
    (tmp_path / "whole").mkdir()
    whole = run_campaign(one, tmp_path / "whole", workers=0, uses_cache=False)
    broken = tmp_path / "broken"
    for folder, runs in (("earlier", slice(8, 12)), ("parts", slice(0, 4))):
        (broken / folder).mkdir(parents=True)
        table = parquet.read_table(whole.table)
        parquet.write_table(table.take(np.arange(16)[runs][::-1]), broken / folder / "000000.parquet")
    counting = Counting()
    again = run_campaign(one, broken, workers=0, uses_cache=False, observer=counting)
    assert counting.reused == 8
    assert again.table.read_bytes() == whole.table.read_bytes()
    assert not (broken / "earlier").exists()


def test_a_table_with_gaps_and_rows_in_any_order_is_sorted(
    campaign: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("autodrive.experiments.campaigns.table.ROW_GROUP", 2)
    one = campaign()
    table = Table(tmp_path, one)
    table.start()
    for number in (15, 3, 2, 9):
        table.add(one.run(number), "key", RunResult(number, dict.fromkeys(one.metric_names, 1.0)))
        table.write_part()
    columns = table.finish()
    assert columns["run"].to_pylist() == [2, 3, 9, 15]
    assert [row["run"] for row in columns.rows([9, 2])] == [9, 2]
    assert columns.numbers("distance").tolist() == [1.0] * 4


@pytest.mark.parametrize("group", [1, 3, 2**20])
def test_summary_and_report_do_not_depend_on_how_much_of_the_table_is_in_memory(
    campaign: Make, tmp_path: Path, group: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = campaign()
    whole = run_campaign(one, tmp_path / "whole", workers=0)
    monkeypatch.setattr("autodrive.experiments.campaigns.table.ROW_GROUP", group)
    monkeypatch.setattr("autodrive.experiments.campaigns.table.BLOCK", group)
    parts = run_campaign(one, tmp_path / "parts", workers=0)
    assert parquet.read_metadata(parts.table).num_row_groups == -(-16 // group)
    assert rows(parts.folder) == rows(whole.folder)
    assert parts.summary == whole.summary
    assert parts.report.read_text() == whole.report.read_text()


def test_another_file_in_the_place_of_the_table_is_one_line(campaign: Make, tmp_path: Path) -> None:
    other = tmp_path / "other.parquet"
    parquet.write_table(pyarrow.table({"run": ["first"], "key": [1]}), other)
    for content in (b"", b"no table", other.read_bytes()):
        (tmp_path / "table.parquet").write_bytes(content)
        with pytest.raises(AutodriveError, match=r"table\.parquet is not a table of a campaign; delete it"):
            run_campaign(campaign(), tmp_path, workers=0)
        assert (tmp_path / "table.parquet").read_bytes() == content


def test_a_policy_drives_as_in_a_time_trial(campaign: Make, tmp_path: Path) -> None:
    car = VehiclePlacement(type="roboracer")
    spec = on_grid(ScenarioSpec(map="practice", vehicles={"V1": car}, tick=PERIOD), load_map("practice"))
    (tmp_path / "track.yaml").write_text(scenario_text(spec))
    given: dict[str, Any] = {"parameters": {}, "samples": {}, "seeds": 1, "pass_": ""}
    given |= {"scenario": "track.yaml", "metrics": ["distance", "collisions"], "stop": {"time": 3.0}}
    one = campaign(driver="race.npz", **given)
    driven = Runner(one).run(one.run(0))
    assert driven.error == ""
    racer, distance = PolicyRacer(Policy.find("race")), 0.0
    world = make(spec)
    frame = world.reset(0)
    for _ in range(round(3.0 / PERIOD)):
        frame = world.step({"V1": racer.act(frame.vehicles["V1"])})
        distance += float(np.hypot(*frame.vehicles["V1"].velocity[:2])) * PERIOD
    assert driven.metrics["distance"] == pytest.approx(distance, rel=1e-12)  # the sum in another order
    assert distance > 3.0
    # The file of a user, with five ticks for each scan; between scans the last command holds.
    Policy.find("race").save(tmp_path / "mine.npz")
    (tmp_path / "track.yaml").write_text(scenario_text(spec.model_copy(update={"tick": PERIOD / 5})))
    mine = campaign(driver="mine.npz", **given)
    assert Runner(mine).run(mine.run(0)).metrics["distance"] == pytest.approx(distance, rel=0.05)  # finer ticks
    assert list(CampaignFiles.pack(mine).files.values()) == [(tmp_path / "mine.npz").read_bytes()]
    assert list(CampaignFiles.pack(one).files) == []
    (tmp_path / "mine.npz").write_bytes(b"no policy")
    with pytest.raises(SpecError, match="is not a policy"):
        campaign(driver="mine.npz", **given)
    (tmp_path / "track.yaml").write_text(scenario_text(spec.model_copy(update={"tick": 0.01})))
    wrong = campaign(driver="race.npz", **given)
    assert "must be a multiple of the scenario's tick" in Runner(wrong).run(wrong.run(0)).error


def test_a_sensor_of_the_user_decides_results_and_travels_with_the_campaign(campaign: Make, tmp_path: Path) -> None:
    radar_scenario(tmp_path, "plane")
    one = campaign(scenario="radar.yaml")
    key = RunKeys(CampaignFiles.of(one)).of(one.run(0))
    unpacked = CampaignFiles.pack(one).unpack(tmp_path / "there")
    assert Runner(unpacked).run(unpacked.run(0)) == Runner(one).run(one.run(0))
    moved = Path(unpacked.scenario.vehicles["V1"].own_sensors["radar"].rpartition(":")[0])
    assert moved.is_relative_to(tmp_path / "there")
    file = tmp_path / "my_radar.py"
    file.write_text(file.read_text(encoding="utf-8") + "# another version\n", encoding="utf-8")
    assert RunKeys(CampaignFiles.of(one)).of(one.run(0)) != key


def test_a_second_campaign_in_a_folder_is_refused(campaign: Make, tmp_path: Path) -> None:
    """Also after the first one was killed the folder is free."""
    one, folder = campaign(), tmp_path / "out"
    folder.mkdir()
    code = "import sys; from pathlib import Path; from autodrive.experiments.campaigns.table import locked\n"
    code += "with locked(Path(sys.argv[1])): print('locked', flush=True); sys.stdin.read()"
    arguments = [sys.executable, "-c", code, str(folder)]
    with subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"locked\n"
        with pytest.raises(AutodriveError, match="another campaign is writing into"):
            run_campaign(one, folder, workers=0)
        other.kill()
    assert run_campaign(one, folder, workers=0).summary["rows"] == 16


def test_runs_that_differ_in_a_seed_without_effect_count_once(campaign: Make, tmp_path: Path) -> None:
    """The interval is that of the samples: Student's t of eight values, not of sixteen."""
    one = campaign()  # the driver reads nothing that has noise
    outcome = run_campaign(one, tmp_path / "out", workers=0)
    distance = [row["distance"] for row in rows(outcome.folder) if row["seed"] == 0]
    from scipy import stats  # here: each worker collects this file, and the import takes a second

    interval = stats.t.interval(0.95, 7, np.mean(distance), stats.sem(distance))
    summary = outcome.summary
    assert summary["seed_changes_results"] is False
    assert summary["rows"] == 16
    assert summary["pass"]["runs"] == summary["metrics"]["distance"]["runs"] == 8
    assert [summary["metrics"]["distance"][end] for end in ("low", "high")] == pytest.approx(interval)
    assert "no result depends on the seed" in outcome.report.read_text()
    driver = (tmp_path / "driver.py").read_text()
    slower = driver.replace("=self.throttle,", "=self.throttle * (1 - self.scene.scenario.seed / 9),")
    (tmp_path / "driver.py").write_text(slower)
    slow = campaign()
    counting = campaign(metrics=["collisions"], pass_="collisions == 0")  # the same in all runs, but the poses are not
    for number, other in enumerate((slow, counting)):
        summary = run_campaign(other, tmp_path / f"{number}", workers=0).summary
        assert summary["seed_changes_results"] is True
        assert summary["pass"]["runs"] == 16


def test_the_end_prints_the_first_error_and_only_errors_are_exit_code_1(campaign: Make, tmp_path: Path) -> None:
    for faults, code in ((["", "raises"], 0), (["raises"], 1)):
        one = campaign(parameters={"driver.fault": faults}, samples={}, seeds=1)
        ended = call("campaign", one.path or "", "--workers", "0", "--no-cache", "-o", tmp_path / str(code))
        assert ended.returncode == code, ended.stderr
        assert "first error: ValueError: the road is lost  (driver.py, line 17)" in ended.stdout


def test_results_are_kept_in_this_process_where_no_file_can_be_written(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    cache = RowCache(tmp_path / "file" / "rows.sqlite")
    assert cache.get("key", 0) is None
    assert "results are not kept for other campaigns" in caplog.text
