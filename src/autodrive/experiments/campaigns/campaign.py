"""The file of a campaign: what is run, with which parameters and seeds, and what is measured."""

from __future__ import annotations

import contextlib
import re
import signal
import threading
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from pydantic import Field, field_validator

from autodrive.base import yaml_files
from autodrive.base.errors import AutodriveError, SpecError
from autodrive.base.python_files import FUNCTION, load
from autodrive.base.specs import Spec, is_yaml
from autodrive.base.suggest import suggest
from autodrive.base.yaml_files import Source
from autodrive.experiments.campaigns import parameters
from autodrive.experiments.campaigns.expression import Expression
from autodrive.experiments.campaigns.metrics import METRICS
from autodrive.experiments.campaigns.sampling import Design, ParameterRange, Sampling, Value
from autodrive.experiments.policies.policy import DATA as POLICIES
from autodrive.experiments.policies.policy import Policy
from autodrive.protocol.messages import Event
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.descriptions import Descriptions
from autodrive.scenario.files import read_scenario
from autodrive.world.factory import compile_scenario

Recorded: TypeAlias = Literal["none", "failures", "all"]
EVENTS = sorted(kind.__name__ for kind in get_args(Event))
"""Names of the events that can end a run."""
POLICY = re.compile(r"[^\s:{}]+\.npz")
"""A file with a policy, or an included policy: 'race.npz'."""
MAX_RUNS = 10**7
"""Runs of a campaign: the table of so many has about 1 GB."""


class Stop(Spec):
    """When a run ends."""

    time: float = Field(default=60.0, gt=0.0, le=1e6)
    """[s of simulated time]."""
    events: tuple[str, ...] = ()
    """Events of the vehicle that end it, such as Collision or LapCompleted."""


class CampaignSpec(Spec):
    """The file of a campaign."""

    title: str = ""
    scenario: str
    """Name or file of the scenario."""
    driver: str
    """'my_driver.py:Driver', 'policy.npz', or the command line of a devkit script with '{port}' for its port."""
    vehicle: str = ""
    """Vehicle that metrics and events are about; left out: the first one."""
    parameters: dict[str, ParameterRange] = Field(default_factory=dict)
    """Values by path, such as 'vehicles.V1.grip_factor', 'driver.lookahead' or 'latency'."""
    samples: Sampling = Sampling()
    seeds: int | tuple[int, ...] = 1
    """Runs of each sample, with the seeds 0, 1, ...; or a list of seeds."""
    stop: Stop = Stop()
    metrics: tuple[str, ...] = ("distance", "collisions")
    """Names of metrics, or functions of the Frames: 'my_metrics.py:name'."""
    pass_: str = Field(default="", alias="pass")
    """Condition on the metrics, such as 'collisions == 0'; left out: runs have no verdict."""
    record: Recorded = "none"
    """Which runs are recorded."""
    files: tuple[str, ...] = ()
    """Other files that the driver reads: a run is repeated if one has changed."""
    cameras: bool = False
    """Whether camera images are rendered, in the tick."""
    time_limit: float = Field(default=300.0, gt=0.0, le=1e6)
    """Wall time of a run [s]; a longer one is an error."""

    @field_validator("parameters", mode="before")
    @classmethod
    def _short_forms(cls, parameters: Any) -> Any:
        """A list is a choice, and a value the only one."""
        if not isinstance(parameters, dict):
            return parameters
        return {
            path: values if isinstance(values, dict) else {"choice": values if isinstance(values, list) else [values]}
            for path, values in parameters.items()
        }

    @property
    def seed_list(self) -> Sequence[int]:
        """The seeds of each sample."""
        return range(self.seeds) if isinstance(self.seeds, int) else self.seeds


@dataclass(frozen=True)
class Campaign:
    """A checked campaign. `folder` is where its files are: paths in it are relative to that folder."""

    spec: CampaignSpec
    descriptions: Descriptions
    """The scenario with its files."""
    folder: Path
    name: str = "campaign"
    path: Path | None = field(default=None, compare=False)

    @classmethod
    def load(cls, path: str | Path) -> Campaign:
        """Read a file and everything that it names. Raises `SpecError` with all errors."""
        path = Path(path)
        source = yaml_files.source(path)
        spec, errors = yaml_files.readable(source, CampaignSpec)
        if isinstance(spec, CampaignSpec) and not errors:
            return cls._checked(spec, source, path)
        raise SpecError([error.replace("pass_", "pass") for error in errors], str(path))

    @classmethod
    def _checked(cls, spec: CampaignSpec, source: Source, path: Path) -> Campaign:
        folder = path.parent
        problems = [*_problems(spec, folder)]
        campaign = None
        try:
            is_file = is_yaml(spec.scenario)
            descriptions = read_scenario(str(folder / spec.scenario) if is_file else spec.scenario)
            campaign = cls(spec, descriptions, folder, path.stem, path)
            if spec.vehicle and spec.vehicle not in campaign.scenario.vehicles:
                problems.append((("vehicle",), suggest(spec.vehicle, list(campaign.scenario.vehicles))))
            for name, values in spec.parameters.items():
                problems += [(("parameters", name), text) for text in parameters.errors(descriptions, name, values)]
            if not problems:
                compile_scenario(parameters.structural(descriptions, campaign.design[0]))
        except SpecError as error:
            problems += [(("scenario",), text) for text in error.errors]
        if problems or campaign is None:
            raise SpecError([f"{source.at(*place)}: {text}" for place, text in problems], str(path))
        return campaign

    @cached_property
    def design(self) -> Design:
        """The samples."""
        return Design(self.spec.parameters, self.spec.samples)

    @property
    def scenario(self) -> ScenarioSpec:
        """The scenario of all runs, before their parameters."""
        return self.descriptions.specs.scenario

    @property
    def vehicle(self) -> str:
        """The vehicle that metrics and events are about."""
        return self.spec.vehicle or next(iter(self.scenario.vehicles))

    @property
    def policy(self) -> Path | None:
        """The file of the policy that drives, beside the campaign or included; None for another driver."""
        return policy_file(self.spec.driver, self.folder)

    @property
    def metric_names(self) -> list[str]:
        """The columns of the metrics."""
        return [name.rpartition(":")[2] for name in self.spec.metrics]

    @cached_property
    def criterion(self) -> Expression | None:
        """The pass criterion; None if there is none."""
        return Expression(self.spec.pass_, self.metric_names) if self.spec.pass_ else None

    def keeps_recording(self, metrics: Mapping[str, float], error: str = "") -> bool:
        """Whether the recording of a run with that result is kept."""
        has_failed = bool(error) or (self.criterion is not None and not self.criterion.holds(metrics))
        return self.spec.record == "all" or (self.spec.record == "failures" and has_failed)

    def __len__(self) -> int:
        """Number of runs."""
        return len(self.design) * len(self.spec.seed_list)

    def run(self, number: int) -> CampaignRun:
        """The run of that number, from 0."""
        seeds = self.spec.seed_list
        sample, k = divmod(number, len(seeds))
        return CampaignRun(number, sample, seeds[k], self.design[sample])


@dataclass(frozen=True)
class CampaignRun:
    """One run of a campaign."""

    number: int
    sample: int
    seed: int
    values: dict[str, Value]
    """Values of the parameters, by path."""
    recording: str = ""
    """Recording file that is written, as `record` says; empty: none."""


def policy_file(driver: str, folder: Path) -> Path | None:
    """The file of the policy that drives, beside the campaign or included; None for another driver."""
    if not POLICY.fullmatch(driver):
        return None
    own, included = folder / driver, POLICIES / driver
    return included if included.is_file() and not own.is_file() else own


def _loading_problem(folder: Path, file: str, name: str, limit: float) -> str:
    """Why a class or function of the user's file cannot be loaded within a time [s]; empty if it can."""
    if not (folder / file).is_file():
        return f"file '{file}' does not exist"
    try:
        with _limited(limit, f"'{file}' was not loaded within {limit:g} s (the key 'time_limit')"):
            load(folder / file, name)
    except (Exception, SystemExit) as error:
        return error_text(error, folder)
    return ""


@contextlib.contextmanager
def _limited(limit: float, text: str) -> Iterator[None]:
    """Raises `TimeoutError` with that text after the wall time `limit` [s], where the system can interrupt a thread."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def end(*_: object) -> None:
        raise TimeoutError(text)

    handler, timer = signal.signal(signal.SIGALRM, end), signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *timer)
        signal.signal(signal.SIGALRM, handler)


def error_text(error: BaseException, folder: Path) -> str:
    """Type, text and place of an exception, in one line; the place is the last one in a file of the user."""
    text = f"{type(error).__name__}: {error}".replace("\n", " ")[:500]
    places = [
        place
        for place in traceback.extract_tb(error.__traceback__)
        if Path(place.filename).absolute().is_relative_to(folder.absolute())
    ]
    return f"{text}  ({Path(places[-1].filename).name}, line {places[-1].lineno})" if places else text


def _problems(spec: CampaignSpec, folder: Path) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beside the scenario: places and texts."""
    for i, name in enumerate(spec.metrics):
        if match := FUNCTION.fullmatch(name):
            if problem := _loading_problem(folder, match["file"], match["name"], spec.time_limit):
                yield ("metrics", i), problem
        elif name not in METRICS:
            yield ("metrics", i), f"'{name}' is not known. {suggest(name, sorted(METRICS))}"
    columns = [name.rpartition(":")[2] for name in spec.metrics]
    if len(set(columns)) < len(columns):
        yield ("metrics",), "two metrics have the same name"
    if spec.pass_:
        try:
            Expression(spec.pass_, columns)
        except ValueError as error:
            yield ("pass",), str(error)
    if match := FUNCTION.fullmatch(spec.driver):
        if problem := _loading_problem(folder, match["file"], match["name"], spec.time_limit):
            yield ("driver",), problem
    elif policy := policy_file(spec.driver, folder):
        try:
            Policy.load(policy)
        except AutodriveError as error:
            yield ("driver",), str(error)
    elif "{port}" not in spec.driver:
        yield (
            ("driver",),
            "must be 'FILE.py:CLASS', a policy 'FILE.npz', or a command line with '{port}' in the place of the port "
            "that the script serves",
        )
    for i, name in enumerate(spec.stop.events):
        if name not in EVENTS:
            yield ("stop", "events", i), f"'{name}' is not an event. {suggest(name, EVENTS)}"
    for i, name in enumerate(spec.files):
        if not (folder / name).is_file():
            yield ("files", i), f"file '{name}' does not exist"
    seeds, count = spec.seeds, spec.seeds if isinstance(spec.seeds, int) else len(spec.seeds)
    is_list = not isinstance(seeds, int)
    if count < 1 or (is_list and (min(seeds) < 0 or max(seeds) >= 2**63 or len(set(seeds)) < count)):
        yield ("seeds",), "must be a number of seeds from 1 on, or a list of different seeds from 0 on"
    method, ranges = spec.samples.method, spec.parameters
    for name in ranges:
        if parameters.DRIVER.fullmatch(name) and not FUNCTION.fullmatch(spec.driver):
            yield (
                ("parameters", name),
                "only a class 'FILE.py:CLASS' has arguments; another driver would ignore this parameter",
            )
    if method == "grid":
        for name, range_ in ranges.items():
            if range_.is_continuous:
                yield ("parameters", name), "a range needs samples: {method: sobol, count: ...}, or another method"
    if method in ("grid", "list") and spec.samples.count is not None:
        yield ("samples", "count"), f"the method '{method}' has no count"
    if method in ("random", "latin_hypercube", "sobol") and spec.samples.count is None:
        yield ("samples",), f"the method '{method}' needs a count"
    if method == "list":
        crossed = {name for name, range_ in ranges.items() if range_.grid}
        for i, point in enumerate(spec.samples.points):
            if wrong := sorted(set(point) ^ (set(ranges) - crossed)):
                yield (
                    ("samples", "points", i),
                    f"must have each parameter without a grid exactly once: {', '.join(wrong)}",
                )
            for name, value in point.items():
                if name in ranges and not ranges[name].is_continuous and value not in ranges[name].values:
                    yield ("samples", "points", i, name), f"{value!r} is not one of the values of the parameter"
        if not spec.samples.points:
            yield ("samples", "points"), "the method 'list' needs points"
    elif spec.samples.points:
        yield ("samples", "points"), "only the method 'list' has points"
    samples = Design(spec.parameters, spec.samples).size
    if samples * count > MAX_RUNS:
        text = f"{samples} samples with {count} seeds are {samples * count} runs; a campaign has at most {MAX_RUNS}"
        yield ("seeds" if count > samples else "samples",), text
