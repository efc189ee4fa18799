"""Campaigns: time per run beside the simulation, throughput of several workers, and memory of many runs and rows.

    uv run benchmarks/campaign.py [--runs N] [--workers N] [--rows N] [--ray]

The overhead is the time of a run of one tick in a warm world, with a new grip, a new pose and a new seed. `--rows`: of
a table of results that were not simulated, which is written, sorted, summarized and drawn.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from autodrive.experiments.campaigns import Campaign, CampaignObserver, LocalExecutor, run_campaign
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.keys import RunKeys
from autodrive.experiments.campaigns.ray_executor import RayExecutor
from autodrive.experiments.campaigns.report import report
from autodrive.experiments.campaigns.runner import Runner, RunResult
from autodrive.experiments.campaigns.runs import CampaignProgress
from autodrive.experiments.campaigns.statistics import summary
from autodrive.experiments.campaigns.table import Table
from autodrive.experiments.campaigns.worker import CampaignWorker

FILE = """
scenario: mini_map
driver: driver.py:Driver
parameters:
  vehicles.V1.grip_factor: {{uniform: [0.5, 1.0]}}
  vehicles.V1.y: {{uniform: [-0.02, 0.02]}}
samples: {{method: random, count: {count}}}
stop: {{time: {time}}}
metrics: [distance, collisions, max_speed]
pass: collisions == 0
"""
DRIVER = """
from autodrive import Command


class Driver:
    def reset(self, scene):
        pass

    def act(self, frame):
        return Command(throttle=0.5)
"""


def campaign(folder: Path, count: int, duration: float) -> Campaign:
    """A campaign of that many runs of that length [s]."""
    (folder / "driver.py").write_text(DRIVER)
    path = folder / f"runs_{count}_{duration:g}.yaml"
    path.write_text(FILE.format(count=count, time=duration))
    return Campaign.load(path)


def overhead(folder: Path) -> None:
    """Prints the CPU time of a run of one tick, and of its tick."""
    one = campaign(folder, 300, 0.01)
    runner = Runner(one)
    runner.run(one.run(0))
    start = time.process_time()
    for number in range(300):
        runner.run(one.run(number))
    print(
        f"a run of one tick in a warm world, in this process: {(time.process_time() - start) / 0.3:.2f} ms of CPU time"
    )
    long = replace(one, spec=one.spec.model_copy(update={"stop": one.spec.stop.model_copy(update={"time": 10.0})}))
    runner = Runner(long)
    runner.run(one.run(0))
    start = time.process_time()
    runner.run(one.run(1))
    print(f"a tick with this driver and these metrics: {1e3 * (time.process_time() - start):.0f} us of CPU time")


class Watch(CampaignObserver):
    """Times after the first rows, when all workers are warm, and the memory of the workers."""

    def __init__(self, workers: Sequence[CampaignWorker] = ()) -> None:
        self.workers = workers
        self.start, self.first, self.end = 0.0, 0, 0.0
        self.memory: list[tuple[int, int, int]] = []
        self.before = self.after = (0.0, 0.0)
        """Processor time of this process and of the workers, at the first and at the last row that count [s]."""

    @property
    def pids(self) -> list[int]:
        """Of the workers."""
        return [worker.pid for worker in self.workers if worker.pid]

    def progress(self, progress: CampaignProgress) -> None:
        """Look at the clock; at the memory each tenth of the runs."""
        if not self.start and progress.done >= progress.total // 10:
            self.start, self.first = time.monotonic(), progress.done
            self.before = time.process_time(), sum(map(processor_time, self.pids))
        self.end = time.monotonic()
        if progress.done == progress.total:
            self.after = time.process_time(), sum(map(processor_time, self.pids))
        if progress.done % max(1, progress.total // 10) == 0:
            self.memory.append((progress.done, sum(map(resident, self.pids)), resident(os.getpid())))

    def costs(self, total: int) -> tuple[float, float]:
        """Processor time of a run in this process and in its worker [ms]."""
        count = total - self.first
        here, there = (1e3 * (b - a) / count for a, b in zip(self.before, self.after, strict=True))
        return here, there

    def rate(self, total: int) -> float:
        """Runs per second of the warm workers."""
        return (total - self.first) / (self.end - self.start)


def processor_time(pid: int) -> float:
    """Of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident(pid: int) -> int:
    """Memory of a process [MiB]."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) // 1024
    return 0


def measure(folder: Path, runs: int, duration: float, workers: int) -> float:
    """Prints and returns runs per second."""
    one = campaign(folder, runs, duration)
    executor = LocalExecutor(one, workers)
    watch = Watch(executor.workers)
    output = folder / f"out_{runs}_{duration:g}_{workers}"
    outcome = run_campaign(one, output, executor=executor, uses_cache=False, observer=watch)
    assert outcome.summary["rows"] == runs
    size = outcome.table.stat().st_size / runs
    memory = ", ".join(f"{mib} and {own} after {done}" for done, mib, own in watch.memory)
    here, there = watch.costs(runs)
    print(
        f"{runs} runs of {duration:g} s, {workers} workers: {watch.rate(runs):.1f} runs/s, {size:.0f} bytes each in "
        f"the table; processor time of a run: {there:.2f} ms in its worker, {here:.2f} ms in the main process; memory "
        f"of the workers and of the main process [MiB]: {memory}; load of the machine: {os.getloadavg()[0]:.1f}"
    )
    return watch.rate(runs)


def with_ray(folder: Path, runs: int) -> None:
    """Prints what Ray adds to a run in this process."""
    one, watch = campaign(folder, runs, 0.05), Watch()
    run_campaign(one, folder / "ray", executor=RayExecutor(one, "local", 2), uses_cache=False, observer=watch)
    here, _ = watch.costs(runs)
    print(f"{runs} runs of 0.05 s with Ray, 2 actors: {watch.rate(runs):.1f} runs/s, {here:.2f} ms in the main process")


def many_rows(folder: Path, count: int) -> None:
    """Prints time and memory of a table of that many rows, with its summary and its report."""
    one = campaign(folder, count, 1.0)
    numbers = np.random.default_rng(0).random((count, 3))
    assert one.design[0]  # all samples are drawn before memory is measured
    start, before = time.process_time(), resident(os.getpid())
    table, keys = Table(folder / "rows", one), RunKeys(CampaignFiles.of(one))
    table.start()
    for number, (distance, collides, speed) in enumerate(numbers.tolist()):
        run = one.run(number)
        metrics = {"distance": distance, "collisions": round(collides), "max_speed": speed}
        table.add(run, keys.of(run), RunResult(number, metrics, "time", 1.0, hash(distance)))
        if table.is_due:
            table.write_part()
    added, most = time.process_time(), resident(os.getpid())
    columns = table.finish()
    finished = time.process_time()
    text = report(one, columns, summary(one, columns))
    end, peak = time.process_time(), peak_memory()
    print(
        f"{count} rows: {1e6 * (added - start) / count:.0f} us of CPU time each until they are in parts, memory "
        f"{before} -> {most} MiB; sorted in {finished - added:.1f} s, {table.path.stat().st_size / count:.0f} bytes "
        f"each; summary and report of {len(text) / 1e6:.1f} MB in {end - finished:.1f} s; largest memory {peak} MiB"
    )


def peak_memory() -> int:
    """The most memory that this process has had [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def main() -> None:
    """Prints all figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--ray", action="store_true", help="also a cluster of this machine alone")
    parser.add_argument("--rows", type=int, default=1_000_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        many_rows(folder, options.rows)
        overhead(folder)
        one, many = (measure(folder, 400, 2.0, workers) for workers in (1, options.workers))
        print(f"{options.workers} workers: {many / one:.2f} times one worker")
        measure(folder, options.runs, 0.05, 1)
        if options.ray:
            with_ray(folder, 4000)


if __name__ == "__main__":
    main()
