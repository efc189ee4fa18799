"""Runs a race of one or several devkit scripts, in real time or in lock-step, and writes its results."""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import autodrive
from autodrive.base.cache import check_writable, make_folder
from autodrive.base.errors import AutodriveError
from autodrive.base.jit import compiling
from autodrive.base.pace import MAX_SPEED, MIN_SPEED, Pace
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.bridge.flow_control import RESEND_DELAY
from autodrive.connect.bridge.one_vehicle import OWN
from autodrive.connect.server.served import PageOptions
from autodrive.protocol.messages import (
    Pause,
    RaceStatus,
    Resume,
    Retire,
    SaveScenario,
    SetSceneLight,
    SetTimeOfDay,
    Step,
)
from autodrive.protocol.native import Drive, SetCamera
from autodrive.protocol.replay import PlotRecording, SaveRecording, StartRecording, StopRecording
from autodrive.run.options import RunOptions
from autodrive.run.race_seat import Seat
from autodrive.run.recordings import Recordings
from autodrive.run.runner import Run, RunObserver, StopRequest, image_encoder, page_server
from autodrive.run.summary import Odometer
from autodrive.run.world_loader import WorldLoader
from autodrive.scenario import RaceSpec, ScenarioSpec, SensorSettings, VehiclePlacement, scenario_text
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.race_rules import RaceRules, load_rules
from autodrive.world.compile import on_grid
from autodrive.world.racing.results import RaceRecorder, RaceResult, write_results
from autodrive.world.simulation import Simulation

if TYPE_CHECKING:
    from autodrive.graphics.cameras.jpeg import JpegEncoder
    from autodrive.protocol.messages import Frame
    from autodrive.protocol.native import ServerOperation

MAX_VEHICLES = 8
TICK = 0.025
"""Time between Frames [s]: the period of a LIDAR of 40 Hz."""
CHECK_INTERVAL = 0.2
"""Wall time between two looks at the scripts [s]."""
ALLOWED = (
    *(Pause, Resume, Retire, SetSceneLight, SetTimeOfDay, SaveScenario),
    *(SetCamera, StartRecording, StopRecording, SaveRecording, PlotRecording),
)
"""Operations of viewers that a race takes: those of a marshal, and what only changes the view."""


@dataclass(frozen=True)
class RaceOptions(PageOptions):
    """Options of `autodrive.run.race` and of the command `autodrive race`."""

    track: str
    """Name or file of a track."""
    devkits: tuple[tuple[str, int], ...]
    """Host and port of each script; the first one drives V1."""
    teams: tuple[str, ...] = ()
    """Name of each team in the results; left out: the addresses of the scripts."""
    rules: str = "league_2026"
    """Name or file of the rules."""
    laps: int | None = None
    """Laps that count, instead of those of the rules."""
    vehicle: str = "roboracer"
    """Name or file of the vehicles."""
    has_realistic_sensors: bool = False
    """Whether LIDAR and IMU have the noise of their data sheets; otherwise that of the vehicle's file."""
    is_lockstep: bool = False
    """Whether each tick waits for the command of each script; otherwise in real time."""
    pace: float | None = None
    """Greatest simulated time per wall time of a race in lock-step; None: no limit, but 1 once a script seems to answer
    before its driver has a new command."""
    seed: int = 0
    """Seed of all noise."""
    start_limit: float = 60.0
    """Wall time in which each script must send its first command [s]."""
    output: Path | None = None
    """Folder of the results; None: they are not written."""
    cameras: bool = False
    """Whether camera images are rendered; otherwise scripts receive black images."""
    has_page: bool = True
    """Whether the page is served."""

    @property
    def names(self) -> list[str]:
        """The vehicles: V1, V2 ..."""
        return [f"V{i}" for i in range(1, len(self.devkits) + 1)]

    @property
    def team_names(self) -> list[str]:
        """One for each vehicle."""
        own = [f"{host}:{port}" for host, port in self.devkits]
        return [*self.teams, *own[len(self.teams) :]]

    def scenario(self) -> ScenarioSpec:
        """The scenario of the race; vehicles start on the grid of the track. Raises `SpecError`."""
        realistic = SensorSettings(noise="realistic")
        noise = {"lidar": realistic, "imu": realistic} if self.has_realistic_sensors else {}
        spec = ScenarioSpec(
            title=f"Race on {self.track}",
            map=self.track,
            vehicles={name: VehiclePlacement(type=self.vehicle, sensors=noise) for name in self.names},
            race=RaceSpec(rules=self.rules, laps=self.laps),
            tick=TICK,
            seed=self.seed,
        )
        return on_grid(spec, load_map(self.track))


@dataclass
class Grid:
    """The scripts of a race in progress."""

    simulation: Simulation
    rules: RaceRules
    seats: list[Seat]
    is_lockstep: bool
    bridges: list[DevkitBridge] = field(default_factory=list)
    is_started: bool = False

    @property
    def notes(self) -> dict[str, str]:
        """What is to be known about the scripts in lock-step, by vehicle."""
        return {seat.vehicle: text for seat in self.seats if self.is_lockstep and (text := seat.repeats)}

    def refusal(self, message: ServerOperation | Drive) -> str:
        """Why viewers of the race may not have that operation or Drive now; empty if they may."""
        if isinstance(message, Drive):
            return "the scripts of the race drive its vehicles"
        name = type(message).__name__
        if isinstance(message, Pause | Resume) and self.is_lockstep:
            return f"a race in lock-step waits for its scripts: it takes no {name}"
        if isinstance(message, Pause | Resume) and not self.is_started:
            return f"the race waits for the first command of each script: it takes no {name} before that"
        if not isinstance(message, ALLOWED):
            return f"a race is in progress: it takes no {name}, which would change it; end the race first"
        return ""

    def is_racing(self, seat: Seat) -> bool:
        """Whether the vehicle of the seat waits or races."""
        state = self.simulation.frame.vehicles[seat.vehicle].race
        return state is not None and state.status in (RaceStatus.WAITING, RaceStatus.RACING)

    def retire(self, seat: Seat, reason: str) -> None:
        """Take a vehicle out of the race."""
        self.simulation.request(Retire(seat.vehicle, reason)).result()

    def wait_for_scripts(self, limit: float, stop: StopRequest) -> None:
        """Wait for the first command of each script; a script that sends none within `limit` [s] retires."""
        deadline = time.monotonic() + limit
        for seat in self.seats:
            while not seat.answers and not stop.is_set() and time.monotonic() < deadline:
                seat.wait_for_answer(0, CHECK_INTERVAL)
        for seat, bridge in zip(self.seats, self.bridges, strict=True):
            if not seat.answers and not stop.is_set():
                self.retire(seat, bridge.error or f"no command within {limit:g} s")

    def step(self, stop: StopRequest) -> Frame:
        """Run one tick, and wait for the answer of each script to its Frame; one that does not answer retires."""
        asked = [(seat, seat.answers) for seat in self.seats if self.is_racing(seat)]
        frame = self.simulation.request(Step(), here=True).result()
        start = time.monotonic()
        for seat in self.seats:
            seat.publish(frame)
        for seat, before in asked:
            while seat.answers == before and self.is_racing(seat) and not stop.is_set():
                if (
                    not seat.wait_for_answer(before, CHECK_INTERVAL)
                    and time.monotonic() - start > self.rules.silence_limit
                ):
                    self.retire(seat, f"no command for {self.rules.silence_limit:g} s")
        return frame

    def retire_the_silent(self) -> None:
        """In real time: take the scripts out that have sent no command for too long."""
        if self.simulation.is_paused:  # by a marshal: the scripts have nothing to answer
            for seat in self.seats:
                seat.answered_at = time.monotonic()
        for seat in self.seats:
            if self.is_racing(seat) and time.monotonic() - seat.answered_at > self.rules.silence_limit:
                self.retire(seat, f"no command for {self.rules.silence_limit:g} s")


def race(options: RaceOptions, *, stop: StopRequest | None = None, observer: RunObserver | None = None) -> RaceResult:
    """Run a race until every vehicle has finished, retired or is disqualified, or `stop` is set.

    Raises `AutodriveError`, for example for an unknown track.
    """
    stop, observer = stop or StopRequest(), observer or RunObserver()
    _check(options)
    if options.output is not None:
        make_folder(options.output)
        check_writable(options.output / "result.json")
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        scenario = folder / f"race_{Path(options.track).stem}.yaml"
        scenario.write_text(scenario_text(options.scenario()), encoding="utf-8")
        run_options = _run_options(options, scenario)
        loader = WorldLoader(run_options)
        with compiling(observer.compiled):
            world = loader.load(str(scenario))
        simulation = Simulation(world, is_paused=True, load=loader.load)
        stack.callback(lambda: simulation.world.close())  # noqa: PLW0108  the current world may be another by then
        assert world.race is not None
        rules, track = world.race.rules, world.race.track
        recorder, odometer = RaceRecorder(), Odometer(simulation)
        for sink in (recorder, odometer, loader):
            simulation.add_sink(sink)
        grid = Grid(simulation, rules, [Seat(simulation, name, rules) for name in options.names], options.is_lockstep)
        encoder = image_encoder(run_options)
        # A script that only is slow must not receive a Frame twice: its second answer would drive the next tick.
        resend_delay = 0.5 * rules.silence_limit if options.is_lockstep else RESEND_DELAY
        for seat, address in zip(grid.seats, options.devkits, strict=True):
            grid.bridges.append(_bridge(seat, address, encoder, simulation, resend_delay))
        first = grid.bridges[0]
        recordings = Recordings(
            simulation,
            run_options.recordings,
            scenario=lambda: loader.scenario,
            encoder=encoder,
            bridge=lambda: first.status,
        )
        stack.callback(recordings.stop_now)
        server = None
        if options.has_page:
            server = page_server(simulation, loader, run_options, first, encoder, recordings, refusal=grid.refusal)
        simulation.start()
        stack.callback(simulation.stop)
        if server is not None:
            stack.enter_context(server)
        run = Run(simulation, loader, grid.bridges[0], server, odometer)
        observer.started(run)
        for bridge in grid.bridges:
            stack.enter_context(bridge)
        started = time.monotonic()
        recorder.publish(simulation.frame)
        grid.wait_for_scripts(options.start_limit, stop)
        _drive(grid, recorder, options, stop, observer, run)
        result = RaceResult(
            version=autodrive.__version__,
            track=track.name,
            length=track.length,
            rules=options.rules,
            title=rules.title or options.rules,
            is_lockstep=options.is_lockstep,
            seed=options.seed,
            simulated_time=simulation.simulated_time,
            wall_time=time.monotonic() - started,
            ended_by=stop.reason or "all vehicles",
            standings=recorder.standings(options.team_names),
            notes=grid.notes,
        )
    if options.output is not None:
        write_results(options.output, result, recorder, track)
    return result


def _drive(
    grid: Grid,
    recorder: RaceRecorder,
    options: RaceOptions,
    stop: StopRequest,
    observer: RunObserver,
    run: Run,
) -> None:
    """Run until the race is over or stopped."""
    simulation = grid.simulation
    seen = time.monotonic()
    if not options.is_lockstep:
        for seat in grid.seats:
            seat.answered_at = seen
            simulation.add_sink(seat)
        simulation.request(Resume()).result()
    grid.is_started = True
    pace = Pace(TICK, options.pace)
    pace.restart(seen)
    while not recorder.is_over and not stop.is_set():
        if options.is_lockstep:
            grid.step(stop)
            pace.count(time.monotonic())
            if pace.speed is None and grid.notes:
                pace.set_speed(1.0, time.monotonic())
            while (delay := pace.delay(time.monotonic())) > 0.0 and not stop.is_set():
                time.sleep(min(delay, CHECK_INTERVAL))
        elif not simulation.wait(CHECK_INTERVAL):
            grid.retire_the_silent()
        if time.monotonic() - seen > CHECK_INTERVAL:
            seen = time.monotonic()
            observer.running(run)
    simulation.request(Pause()).result()


def _check(options: RaceOptions) -> None:
    """Raises `AutodriveError` for options that are no race."""
    count = len(options.devkits)
    if not 1 <= count <= MAX_VEHICLES:
        raise AutodriveError(f"a race has 1 to {MAX_VEHICLES} scripts (--devkit HOST:PORT for each), not {count}")
    if len(set(options.devkits)) < count:
        raise AutodriveError("each script of a race needs its own address (--devkit HOST:PORT)")
    if len(options.teams) > count:
        raise AutodriveError(f"there are {len(options.teams)} names of teams, but {count} scripts")
    if options.pace is not None and not (options.is_lockstep and MIN_SPEED <= options.pace <= MAX_SPEED):
        raise AutodriveError(
            f"the pace of a race in lock-step (--lockstep) is from {MIN_SPEED:g} to {MAX_SPEED:g}, not {options.pace}"
        )
    rules = load_rules(options.rules)
    if not rules.race_laps and options.laps is None and rules.time_limit is None:
        raise AutodriveError(f"the rules '{options.rules}' have no number of laps: give --laps N")


def _run_options(options: RaceOptions, scenario: Path) -> RunOptions:
    return RunOptions(
        scenario=str(scenario),
        mode="autonomous",
        cameras=options.cameras,
        is_lockstep=options.is_lockstep,
        has_page=options.has_page,
        host=options.host,
        port=options.port,
        token=options.token,
        allowed_origins=options.allowed_origins,
    )


def _bridge(
    seat: Seat,
    address: tuple[str, int],
    encoder: JpegEncoder | None,
    simulation: Simulation,
    resend_delay: float,
) -> DevkitBridge:
    spec = simulation.world.vehicle_specs[seat.vehicle]
    images = None
    if encoder is not None:
        from autodrive.graphics.cameras.jpeg import images_of

        images = partial(images_of, encoder=encoder)
    sizes = {(OWN, name): (camera.width, camera.height) for name, camera in spec.cameras.items()}
    return DevkitBridge(
        seat,
        *address,
        images=images,
        image_sizes=lambda: sizes,
        vehicle_profile=lambda: spec.devkit_profile,
        resend_delay=resend_delay,
    )
