"""Runs: (scenario, parameters, seed, driver) -> result. Compiled worlds are kept, because a reset takes less time."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from autodrive.base.errors import AutodriveError
from autodrive.base.python_files import FUNCTION, load
from autodrive.experiments.campaigns import parameters
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun, error_text
from autodrive.experiments.campaigns.drivers import Commands, DevkitScript, Driver, DriverError, PolicyDriver
from autodrive.experiments.campaigns.metrics import METRICS, PERIOD, FunctionMetric, Metric
from autodrive.experiments.campaigns.sampling import Value
from autodrive.experiments.campaigns.scene import RunScene
from autodrive.protocol.messages import Command, Frame
from autodrive.world import World
from autodrive.world.factory import new_world

KEPT = 8
"""Compiled worlds that a process keeps."""


@dataclass(frozen=True)
class RunResult:
    """What a run gave."""

    number: int
    metrics: dict[str, float] = field(default_factory=dict)
    """Values of the metrics by name; nan: there is none."""
    end: str = ""
    """'time', or the name of the event that ended it."""
    time: float = 0.0
    """Simulated time [s]."""
    digest: int = 0
    """Digest of end, metrics and last poses: whether two runs differ."""
    error: str = ""
    """Why there is no result; empty if there is one."""
    recording: str = ""
    """File of its recording, if it was recorded."""


class Runner:
    """Runs of one campaign in this process. A run gives the same bits whatever ran before it."""

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        self._worlds: OrderedDict[str, World] = OrderedDict()

    def run(self, run: CampaignRun, *, started: Callable[[], object] = lambda: None) -> RunResult:
        """The result; an error of the driver is a result, too. `started` is called when the world is ready."""
        try:
            world = self.world(run.values)
            started()
            result = self._drive(run, world)
            if run.recording and self.campaign.keeps_recording(result.metrics, result.error):
                result = self._drive(run, world, Path(run.recording))
        except AutodriveError as error:
            return RunResult(run.number, error=str(error).replace("\n", " "))
        return result

    def close(self) -> None:
        """Release the worlds."""
        for world in self._worlds.values():
            world.close()
        self._worlds.clear()

    def world(self, values: Mapping[str, Value]) -> World:
        """The compiled world for these values; poses and factors are set by `_drive`."""
        key = json.dumps({path: value for path, value in values.items() if parameters.is_compiled(path)})
        if key in self._worlds:
            self._worlds.move_to_end(key)
        else:
            descriptions = parameters.structural(self.campaign.descriptions, values)
            self._worlds[key] = new_world(descriptions, cameras=self.campaign.spec.cameras)
            if len(self._worlds) > KEPT:
                self._worlds.popitem(last=False)[1].close()
        return self._worlds[key]

    def _drive(self, run: CampaignRun, world: World, recording: Path | None = None) -> RunResult:
        factors: dict[str, dict[str, float]] = {}
        poses: dict[str, dict[str, float]] = {}
        for path, value in run.values.items():
            if parameters.WARM.fullmatch(path):
                _, name, key = path.split(".")
                if key in parameters.FACTORS:
                    factors.setdefault(name, {})[parameters.FACTORS[key]] = float(value)
                else:
                    poses.setdefault(name, {})[key] = float(value)
        world.set_factors(factors)
        placed = {**world.spec.vehicles, **world.spec.boxes}
        starts = {name: _pose(placed[name], pose) for name, pose in poses.items()}
        moved = {
            kind: {
                name: placement.model_copy(update=poses.get(name, {}))
                for name, placement in getattr(world.spec, kind).items()
            }
            for kind in ("vehicles", "boxes")
        }
        scenario = world.spec.model_copy(update={**moved, "seed": run.seed})
        scene = RunScene(scenario, world.map, world.vehicle_specs, self.campaign.vehicle)
        with contextlib.ExitStack() as stack:
            if recording is not None:
                from autodrive.recording import Recorder  # noqa: PLC0415  an extra

                world.reset(run.seed)  # a recording must begin at the start of its scenario
                recording.parent.mkdir(parents=True, exist_ok=True)
                stack.enter_context(Recorder(recording, world, name=self.campaign.name))
            frame = world.reset(run.seed, poses=starts)
            try:
                result = self._frames(run, world, scene, frame, stack)
            except AutodriveError as error:
                result = RunResult(run.number, time=world.time, error=f"{type(error).__name__}: {error}")
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # a driver must not end the campaign, whatever it raises
                reason = str(error) if isinstance(error, DriverError) else error_text(error, self.campaign.folder)
                result = RunResult(run.number, time=world.time, error=reason)
        return replace(result, recording=str(recording)) if recording else result

    def _frames(
        self, run: CampaignRun, world: World, scene: RunScene, frame: Frame, stack: contextlib.ExitStack
    ) -> RunResult:
        spec = self.campaign.spec
        arguments = {
            match[1]: value for path, value in run.values.items() if (match := parameters.DRIVER.fullmatch(path))
        }
        driver = self._driver(arguments)
        if isinstance(driver, DevkitScript):
            stack.callback(driver.close)
        driver.reset(scene)
        metrics = {
            name: self._metric(metric_name, scene)
            for name, metric_name in zip(self.campaign.metric_names, spec.metrics)  # noqa: B905
        }
        in_each = [metric for metric in metrics.values() if metric.every_tick]
        sampled = [metric for metric in metrics.values() if not metric.every_tick]
        period = max(1, round(PERIOD / scene.scenario.tick))
        delay = round(float(run.values.get(parameters.LATENCY, 0.0)) / scene.scenario.tick)
        sent: deque[Commands] = deque()
        end = "time"
        for metric in metrics.values():
            metric.observe(frame)
        for _ in range(round(spec.stop.time / scene.scenario.tick)):
            sent.append(driver.act(frame))
            commands = sent.popleft() if len(sent) > delay else None
            frame = world.step({scene.vehicle: commands} if isinstance(commands, Command) else commands)
            for metric in in_each:
                metric.observe(frame)
            if frame.tick % period == 0:
                for metric in sampled:
                    metric.observe(frame)
            if frame.events and (ended := self._ended(frame)):
                end = ended
                break
        values = {name: float(metric.value()) for name, metric in metrics.items()}
        return RunResult(run.number, values, end, world.time, _digest(frame, end, values))

    def _ended(self, frame: Frame) -> str:
        """The event that ends the run, if any."""
        own = (type(event).__name__ for event in frame.events if event.vehicle == self.campaign.vehicle)
        return next((name for name in own if name in self.campaign.spec.stop.events), "")

    def _driver(self, arguments: dict[str, Value]) -> Driver:
        if policy := self.campaign.policy:
            return PolicyDriver(policy)
        match = FUNCTION.fullmatch(self.campaign.spec.driver)
        if not match:
            return DevkitScript(self.campaign.spec.driver, self.campaign.folder)
        return load(self.campaign.folder / match["file"], match["name"])(**arguments)

    def _metric(self, name: str, scene: RunScene) -> Metric:
        match = FUNCTION.fullmatch(name)
        if not match:
            return METRICS[name](scene)
        return FunctionMetric(scene, load(self.campaign.folder / match["file"], match["name"]))


def _pose(placed: Any, changes: Mapping[str, float]) -> tuple[float, float, float]:
    """x, y [m] and yaw [rad] of a vehicle or a box, with the values that are given."""
    x, y, yaw_deg = (changes.get(key, getattr(placed, key)) for key in ("x", "y", "yaw_deg"))
    return x, y, math.radians(yaw_deg)


def _digest(frame: Frame, *results: object) -> int:
    """A digest of the last poses and of other results, in 8 bytes."""
    poses = [body.pose for body in (*frame.vehicles.values(), *frame.objects.values())]
    data = b"".join(part.tobytes() for pose in poses for part in (pose.position, pose.orientation))
    data += repr((frame.time, *results)).encode()
    return int.from_bytes(hashlib.blake2b(data, digest_size=8).digest(), signed=True)
