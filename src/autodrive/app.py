"""Puts a World, its Simulation, the devkit bridge and a live status line together, and sums up what happened."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

import autodrive
from autodrive.bridge.devkit import DevkitBridge
from autodrive.errors import AutodriveError
from autodrive.jit import compiling
from autodrive.protocol.messages import Collision, Frame, Pose
from autodrive.scenario import ScenarioSpec, load_scenario
from autodrive.simulation import Simulation
from autodrive.transforms import euler_from_quaternion

if TYPE_CHECKING:
    from autodrive.camera_watch import CameraWatch
    from autodrive.world import World

DrivingMode: TypeAlias = Literal["manual", "autonomous"]

REFRESH = 0.2
"""Wall time between two status lines [s]."""

WARM_UP = 0.5
"""Simulated time after which every sensor has sampled [s]."""


@dataclass(frozen=True)
class RunOptions:
    """What `autodrive run` is asked for."""

    scenario: str = "mini_map"
    """Name or file."""
    mode: DrivingMode | None = None
    """Who drives: a person or a script. None: a script if there is a devkit to connect to, else a person."""
    duration: float | None = None
    """Simulated time [s]; None: until interrupted."""
    speed: float | None = 1.0
    """Simulated seconds per wall second; None: as fast as possible."""
    seed: int | None = None
    """Of all noise; None: the scenario's."""
    devkit: tuple[str, int] | None = None
    """Host and port of the script's server."""
    devkit_profile: str | None = None
    """Era of the devkit; None: recognised."""
    summary: Path | None = None
    """File to write the summary to, as JSON."""
    cameras: bool | None = None
    """Whether the cameras' pictures are drawn; None: if there is a script to send them to."""
    is_lockstep: bool | None = None
    """Whether a picture is drawn in its tick, which waits for it; else in a process of its own, as fast as that can.
    None: in the tick if time runs as fast as possible."""
    camera_quality: str = "auto"
    """One of `autodrive.render.quality.NAMES`."""
    image_size: tuple[int, int] | None = None
    """Width and height of the pictures that a script gets [pixels]; None: the camera's."""
    image_quality: int = 75
    """JPEG quality of the pictures that a script gets, 1 to 100."""

    @property
    def has_cameras(self) -> bool:
        """What was asked for, or what follows from the rest."""
        return self.devkit is not None if self.cameras is None else self.cameras

    @property
    def draws_in_tick(self) -> bool:
        """What was asked for, or what follows from the rest."""
        return self.speed is None if self.is_lockstep is None else self.is_lockstep

    @property
    def driving_mode(self) -> DrivingMode:
        """The mode asked for, or what follows from the rest."""
        return self.mode or ("autonomous" if self.devkit else "manual")


@dataclass
class Run:
    """A run under way, for the status line."""

    simulation: Simulation
    bridge: DevkitBridge | None
    odometer: Odometer
    cameras: CameraWatch | None

    def status(self) -> str:
        """One line: time, real-time factor, each vehicle, the bridge."""
        parts = [f"{self.simulation.simulated_time:8.1f} s", f"x{self.simulation.real_time_factor:.2f}"]
        for name, vehicle in self.simulation.frame.vehicles.items():
            x, y, _ = vehicle.pose.position
            parts.append(f"{name} {vehicle.speed:+.2f} m/s at ({x:+.2f}, {y:+.2f})")
        if self.cameras is not None:
            parts.append(self.cameras.status())
        if self.bridge is not None:
            counters = self.bridge.counters
            parts.append(f"devkit {self.bridge.status}, {counters.commands_received} commands")
        return "  ".join(parts)


class Screen(Protocol):
    """Where a run shows itself."""

    def compiled(self, function: str) -> None:
        """A function was compiled: on the first start there are some dozens, in about half a minute."""
        ...

    def prepared(self) -> None:
        """The world is there and its clock starts."""
        ...

    def show(self, run: Run) -> None:
        """What the run does now; called each `REFRESH` seconds."""
        ...


def run(options: RunOptions, screen: Screen) -> dict[str, Any]:
    """Run until the duration is over or a signal (SIGINT, SIGTERM) ends it; the summary, also written if asked for.

    Raises `AutodriveError`.
    """
    _check_writable(options.summary)
    with compiling(screen.compiled):
        world, cameras = _world(options)
        _compile(world)
    simulation = Simulation(world, speed=options.speed)
    odometer = Odometer(world.tick_duration)
    simulation.add_sink(odometer)
    with ExitStack() as stack:
        stack.callback(world.close)
        if cameras is not None:
            cameras.wait()
            simulation.add_sink(cameras)
        bridge = _bridge(simulation, options)
        screen.prepared()
        if bridge is not None:
            stack.enter_context(bridge)
        signals = stack.enter_context(_signals())
        stack.callback(simulation.stop)
        under_way = Run(simulation, bridge, odometer, cameras)
        simulation.start(options.duration)
        while not signals and not simulation.wait(REFRESH):
            screen.show(under_way)
        simulation.stop()
        counters = _bridge_summary(bridge)
        pictures = cameras and cameras.summary(simulation.simulated_time)
    summary = {**_run_summary(options, world, under_way, signals), "cameras": pictures, "bridge": counters}
    if options.summary is not None:
        options.summary.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary


class Odometer:
    """A sink: how far each vehicle has gone, and how often it collided, over resets and teleports."""

    def __init__(self, tick_duration: float) -> None:
        self._tick_duration = tick_duration
        self._tick = 0
        self.distance: dict[str, float] = {}
        """Path length of the rear axle centre [m], by vehicle."""
        self.collisions: dict[str, int] = {}

    def publish(self, frame: Frame) -> None:
        """Add the way of a tick; a Frame that shows a request's result is none."""
        if frame.tick != self._tick:
            for name, vehicle in frame.vehicles.items():
                way = math.hypot(*vehicle.velocity[:2]) * self._tick_duration
                self.distance[name] = self.distance.get(name, 0.0) + way
            for event in frame.events:
                if isinstance(event, Collision):
                    self.collisions[event.vehicle] = self.collisions.get(event.vehicle, 0) + 1
        self._tick = frame.tick


def _scenario(options: RunOptions) -> ScenarioSpec:
    """The scenario with the mode and seed asked for, so that a reset keeps them."""
    spec = load_scenario(options.scenario)
    is_autonomous = options.driving_mode == "autonomous"
    vehicles = {
        name: placement.model_copy(update={"is_autonomous": is_autonomous}) for name, placement in spec.vehicles.items()
    }
    seed = spec.seed if options.seed is None else options.seed
    return spec.model_copy(update={"vehicles": vehicles, "seed": seed})


def _world(options: RunOptions) -> tuple[World, CameraWatch | None]:
    """The world, and who watches its cameras where they are wanted and there are some."""
    scenario = _scenario(options)
    if not options.has_cameras:
        return autodrive.make(scenario), None
    from autodrive.camera_watch import watched_world

    return watched_world(scenario, quality=options.camera_quality, draws_in_tick=options.draws_in_tick)


def _compile(world: World) -> None:
    """Let every stage of the tick and every sensor work once, so that all is compiled before the clock runs."""
    while world.time < WARM_UP:
        world.step()
    world.reset()


def _bridge(simulation: Simulation, options: RunOptions) -> DevkitBridge | None:
    if options.devkit is None:
        return None
    host, port = options.devkit
    if not options.has_cameras:
        return DevkitBridge(simulation, host, port, options.devkit_profile)
    from autodrive.jpeg import JpegEncoder, images_of

    encoder = JpegEncoder(options.image_size, options.image_quality)
    images = partial(images_of, encoder=encoder)
    return DevkitBridge(simulation, host, port, options.devkit_profile, images=images)


@contextmanager
def _signals() -> Iterator[list[str]]:
    """Names of the signals that asked for an end. The second of a kind does what it always does."""
    caught: list[str] = []
    before: dict[signal.Signals, Any] = {}

    def catch(number: int, _: object) -> None:
        caught.append(signal.Signals(number).name)
        signal.signal(number, before[signal.Signals(number)])

    for one in (signal.SIGINT, signal.SIGTERM):
        before[one] = signal.signal(one, catch)
    try:
        yield caught
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


def _check_writable(path: Path | None) -> None:
    """Say before a long run that its summary could not be written, not after."""
    if path is None:
        return
    try:
        path.open("a").close()
    except OSError as error:
        raise AutodriveError(f"the summary cannot be written: {error.strerror}  ({path})") from None


# -- the summary ------------------------------------------------------------------------------------------------


def _run_summary(options: RunOptions, world: World, run: Run, signals: list[str]) -> dict[str, Any]:
    simulation = run.simulation
    wall = simulation.running_time
    return {
        "version": autodrive.__version__,
        "scenario": options.scenario,
        "map": world.spec.map,
        "seed": world.spec.seed,
        "speed": "max" if simulation.speed is None else simulation.speed,
        "ended_by": signals[0] if signals else "duration",
        "simulated_time": simulation.simulated_time,
        "wall_time": wall,
        "real_time_factor": simulation.simulated_time / wall if wall else 0.0,
        "ticks": simulation.ticks,
        "late_ticks": simulation.late_ticks,
        "vehicles": {
            name: {
                "mode": "autonomous" if vehicle.is_autonomous else "manual",
                "distance": run.odometer.distance.get(name, 0.0),
                "collisions": run.odometer.collisions.get(name, 0),
                "pose": _pose_summary(vehicle.pose),
            }
            for name, vehicle in simulation.frame.vehicles.items()
        },
    }


def _pose_summary(pose: Pose) -> dict[str, Any]:
    return {
        "position": [float(value) for value in pose.position],
        "orientation": [float(value) for value in pose.orientation],
        "yaw": float(euler_from_quaternion(pose.orientation)[2]),
    }


def _bridge_summary(bridge: DevkitBridge | None) -> dict[str, Any] | None:
    """Counters of the bridge; numbers that are not there yet are null."""
    if bridge is None:
        return None
    counters = bridge.counters
    return {
        "address": bridge.address,
        "dialect": counters.dialect and str(getattr(counters.dialect, "value", counters.dialect)),
        "profile": counters.profile,
        "connections": counters.connections,
        "reconnects": counters.reconnects,
        "telemetry_sent": counters.telemetry_sent,
        "commands_received": counters.commands_received,
        "resends": counters.resends,
        "refused_values": counters.refused_values,
        "round_trip": None if math.isnan(counters.round_trip) else counters.round_trip,
    }
