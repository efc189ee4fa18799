"""Runs a race of one or several devkit scripts, in real time or in lock-step, and writes its results."""

from __future__ import annotations

import hashlib
import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

from autodrive.base.cache import check_writable, make_folder
from autodrive.base.code_snapshot import Code, CodeSnapshot
from autodrive.base.errors import AutodriveError
from autodrive.base.pace import MAX_SPEED, MIN_SPEED, TickPace
from autodrive.base.python_files import script_files
from autodrive.base.suggest import suggesting
from autodrive.base.tcp import address_text
from autodrive.base.version import __version__
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.bridge.flow_control import RESEND_DELAY
from autodrive.connect.bridge.one_vehicle import OWN
from autodrive.connect.bridge.script_process import ScriptProcess
from autodrive.connect.server.served import PageOptions
from autodrive.protocol.messages import (
    Pause,
    RaceStatus,
    Resume,
    Retire,
    SaveScenario,
    SetSceneLight,
    SetTimeOfDay,
    SetWeather,
    Step,
)
from autodrive.protocol.native import DescribeVehicle, DescribeWeather, Drive, SetCamera, ViewSensor
from autodrive.protocol.replay import (
    FilmRecording,
    PlotRecording,
    ReplayRecording,
    SaveRecording,
    StartRecording,
    StopRecording,
)
from autodrive.run.options import RunOptions
from autodrive.run.race_seat import Seat
from autodrive.run.runner import Refusal, Run, RunObserver, StopRequest, images_by, opened
from autodrive.scenario import RaceSpec, ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.files import scenario_text
from autodrive.scenario.kinds import find
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.race_rules import RaceRules, load_rules
from autodrive.world.compile import on_grid
from autodrive.world.racing.results import RESULT_FILES, RaceRecorder, RaceResult, write_results
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
OPAQUE = "The script may run code that its digest does not contain ({})"
ALLOWED = (
    *(Pause, Resume, Retire, SetSceneLight, SetTimeOfDay, SetWeather, SaveScenario),
    *(SetCamera, ViewSensor, DescribeVehicle, DescribeWeather),
    *(StartRecording, StopRecording, SaveRecording, FilmRecording, ReplayRecording, PlotRecording),
)
"""Operations of viewers that a race takes: those of a marshal, and what only changes the view."""


@suggesting
@dataclass(frozen=True)
class RaceOptions:
    """Options of `autodrive.run.race` and of the command `autodrive race`."""

    track: str
    """Name or file of a track."""
    devkits: tuple[tuple[str, int], ...] = ()
    """Host and port of each script; the first one drives V1."""
    scripts: tuple[str, ...] = ()
    """Command lines of scripts that the race starts, with '{port}'; they drive the vehicles after those."""
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
    record: Path | None = None
    """File in which the race is recorded (MCAP)."""
    cameras: bool = False
    """Whether camera images are rendered; otherwise scripts receive black images."""
    has_page: bool = True
    """Whether the page is served."""
    page: PageOptions = PageOptions()  # noqa: RUF009  it is frozen
    """Where the page is served, and to whom."""

    @property
    def names(self) -> list[str]:
        """The vehicles: V1, V2 ..."""
        return [f"V{i}" for i in range(1, len(self.devkits) + len(self.scripts) + 1)]

    @property
    def team_names(self) -> list[str]:
        """Names of the teams, one for each vehicle."""
        own = [*(address_text(host, port) for host, port in self.devkits), *self.scripts]
        return [*self.teams, *own[len(self.teams) :]]

    @property
    def outputs(self) -> list[Path]:
        """The files that the race writes."""
        logs = [f"{name}.log" for name in self.names[len(self.devkits) :]]
        results = [] if self.output is None else [self.output / name for name in (*RESULT_FILES, *logs)]
        return results if self.record is None else [*results, self.record]

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
class RaceScripts:
    """The scripts of a race in progress."""

    simulation: Simulation
    rules: RaceRules
    seats: list[Seat]
    is_lockstep: bool
    bridges: list[DevkitBridge]
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
            return f"a race in lock-step waits for its scripts: {name} is not accepted"
        if isinstance(message, Pause | Resume) and not self.is_started:
            return f"the race waits for the first command of each script: {name} is not accepted before that"
        if not isinstance(message, ALLOWED):
            return f"a race is in progress: {name} would change the race and is not accepted; end the race first"
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
            while not (seat.answers or seat.end or stop.is_set()) and time.monotonic() < deadline:
                seat.wait_for_answer(0, CHECK_INTERVAL)
        for seat, bridge in zip(self.seats, self.bridges, strict=True):
            if not seat.answers and not stop.is_set():
                error = bridge.error.removesuffix("; trying again")
                self.retire(seat, seat.end or error or f"no command within {limit:g} s")

    def step(self, stop: StopRequest) -> Frame:
        """Run one tick, and wait for the answer of each script to its Frame; one that does not answer retires."""
        asked = [(seat, seat.answers) for seat in self.seats if self.is_racing(seat)]
        frame = self.simulation.request(Step(), here=True).result()
        start = time.monotonic()
        for seat in self.seats:
            seat.publish(frame)
        for seat, before in asked:
            while seat.answers == before and self.is_racing(seat) and not stop.is_set():
                if not seat.wait_for_answer(before, CHECK_INTERVAL):
                    self._retire_if_silent(seat, start)
        return frame

    def _retire_if_silent(self, seat: Seat, since: float) -> None:
        """Take a script out that has ended, or has sent no command for too long since a wall time [s]."""
        is_silent = time.monotonic() - since > self.rules.silence_limit
        if reason := seat.end or (f"no command for {self.rules.silence_limit:g} s" if is_silent else ""):
            self.retire(seat, reason)

    def retire_the_silent(self) -> None:
        """Take the scripts out that have sent no command for too long, in real time."""
        if self.simulation.is_paused:  # by a marshal: the scripts have nothing to answer
            for seat in self.seats:
                seat.answered_at = time.monotonic()
        for seat in self.seats:
            if self.is_racing(seat):
                self._retire_if_silent(seat, seat.answered_at)


def race(options: RaceOptions, *, stop: StopRequest | None = None, observer: RunObserver | None = None) -> RaceResult:
    """Run a race until every vehicle has finished, retired or is disqualified, or `stop` is set.

    Raises `AutodriveError`, for example for an unknown track.
    """
    stop, observer = stop or StopRequest(), observer or RunObserver()
    _check(options)
    if options.output is not None:
        make_folder(options.output)
        check_writable(options.output / "result.json")
    if options.record is not None:
        check_writable(options.record)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        scenario = folder / f"race_{Path(options.track).stem}.yaml"
        scenario.write_text(scenario_text(options.scenario()), encoding="utf-8")
        scripts = _scripts(options, stack)
        grids: list[RaceScripts] = []

        def make_grid(simulation: Simulation, encoder: JpegEncoder | None) -> tuple[Sequence[DevkitBridge], Refusal]:
            grids.append(_grid(simulation, options, [*scripts.values()], encoder))
            return grids[0].bridges, grids[0].refusal

        run = opened(stack, _run_options(options, scenario), observer, make_grid)
        (grid,), simulation = grids, run.simulation
        assert simulation.world.race is not None
        rules, track = simulation.world.race.rules, simulation.world.race.track
        recorder = RaceRecorder()
        simulation.add_sink(recorder)
        simulation.start()
        observer.started(run)
        for bridge in grid.bridges:
            bridge.start()
        started = time.monotonic()
        recorder.publish(simulation.frame)
        grid.wait_for_scripts(options.start_limit, stop)
        _drive(grid, recorder, options, stop, observer, run)
        result = RaceResult(
            version=__version__,
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
            notes=_notes(grid, scripts),
            recording=str(options.record or ""),
            digests=_digests(simulation, scripts),
        )
        if options.output is not None:
            write_results(options.output, result, recorder, track)
        observer.decided(result)
    return result


def _drive(
    grid: RaceScripts,
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
    pace = TickPace(TICK, options.pace)
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
    find("track", options.track)
    count = len(options.names)
    if not 1 <= count <= MAX_VEHICLES:
        raise AutodriveError(
            f"a race has 1 to {MAX_VEHICLES} scripts (--devkit HOST:PORT or --script COMMAND for each), not {count}"
        )
    if len(set(options.devkits)) < len(options.devkits):
        raise AutodriveError("each script of a race needs its own address (--devkit HOST:PORT)")
    if len(options.teams) > count:
        raise AutodriveError(f"there are {len(options.teams)} names of teams, but {count} scripts")
    if options.pace is not None and not (options.is_lockstep and MIN_SPEED <= options.pace <= MAX_SPEED):
        raise AutodriveError(
            f"the pace of a race in lock-step (--lockstep) is from {MIN_SPEED:g} to {MAX_SPEED:g}, not {options.pace}"
        )
    for command in options.scripts:
        if "{port}" not in command:
            raise AutodriveError(f"the command of a script needs {{port}}, the port at which it listens: '{command}'")
    rules = load_rules(options.rules)
    if not rules.race_laps and options.laps is None and rules.time_limit is None:
        raise AutodriveError(f"the rules '{options.rules}' have no number of laps: give --laps N")


def _run_options(options: RaceOptions, scenario: Path) -> RunOptions:
    return RunOptions(
        scenario=str(scenario),
        mode="autonomous",
        cameras=options.cameras,
        record=options.record,
        is_lockstep=options.is_lockstep,
        has_page=options.has_page,
        page=options.page,
    )


class _Script(ScriptProcess):
    """A script that runs copies of its files, as they were at the start; what it prints names the originals."""

    def __init__(self, command: str, output: IO[bytes]) -> None:
        """What it prints goes to `output`. Raises `AutodriveError` if it cannot be started."""
        self.code = Code.read(script_files(command, Path.cwd()), Path.cwd())
        self._snapshot = CodeSnapshot(self.code)
        self._printed = output
        try:
            with self._snapshot.workplace.entered():
                command = self.code.command_with_copies(command, self._snapshot.root)
                super().__init__(command, self._snapshot.folder, output)
        except BaseException:
            self._snapshot.close()
            raise

    @property
    def end(self) -> str:
        """How it has ended; empty while it runs."""
        return self._snapshot.named(super().end)

    def close(self) -> None:
        """End it, and move what it has written beside the copies to the originals."""
        super().close()
        self._printed.seek(0)
        text = os.fsdecode(self._printed.read())
        if (named := self._snapshot.named(text)) != text:
            self._printed.seek(0)
            self._printed.write(os.fsencode(named))
            self._printed.truncate()
            self._printed.flush()
        self._snapshot.close()


def _scripts(options: RaceOptions, stack: ExitStack) -> dict[str, _Script]:
    """Start the scripts, by vehicle; what each prints goes to a file beside the results. Raises `AutodriveError`."""
    scripts = dict[str, _Script]()
    for name, command in zip(options.names[len(options.devkits) :], options.scripts, strict=True):
        log = (options.output / f"{name}.log").open("w+b") if options.output else tempfile.TemporaryFile()  # noqa: SIM115
        scripts[name] = _Script(command, stack.enter_context(log))
        stack.callback(scripts[name].close)
    return scripts


def _grid(
    simulation: Simulation, options: RaceOptions, scripts: Sequence[ScriptProcess], encoder: JpegEncoder | None
) -> RaceScripts:
    """The scripts at their vehicles; their bridges are not started yet."""
    assert simulation.world.race is not None
    rules = simulation.world.race.rules
    processes = [*(None for _ in options.devkits), *scripts]
    addresses = [*options.devkits, *(("127.0.0.1", script.port) for script in scripts)]
    seats = [Seat(simulation, name, rules, process) for name, process in zip(options.names, processes, strict=True)]
    # A script that only is slow must not receive a Frame twice: its second answer would drive the next tick.
    resend_delay = 0.5 * rules.silence_limit if options.is_lockstep else RESEND_DELAY
    bridges = []
    for seat, address in zip(seats, addresses, strict=True):
        spec = simulation.world.vehicle_specs[seat.vehicle]
        sizes = {(OWN, name): (camera.width, camera.height) for name, camera in spec.cameras.items()}
        bridges.append(
            DevkitBridge(
                seat,
                *address,
                images=images_by(encoder),
                image_sizes=lambda sizes=sizes: sizes,
                vehicle_profile=lambda spec=spec: spec.devkit_profile,
                resend_delay=resend_delay,
            )
        )
    return RaceScripts(simulation, rules, seats, options.is_lockstep, bridges)


def _notes(grid: RaceScripts, scripts: Mapping[str, _Script]) -> dict[str, str]:
    """What is to be known about the scripts, by vehicle."""
    unknown = {name: OPAQUE.format(places) for name, script in scripts.items() if (places := script.code.opaque)}
    names = [seat.vehicle for seat in grid.seats]
    notes = {name: ". ".join(text[name] for text in (grid.notes, unknown) if name in text) for name in names}
    return {name: note for name, note in notes.items() if note}


def _digests(simulation: Simulation, scripts: Mapping[str, _Script]) -> dict[str, str]:
    """SHA-256 of track and rules, and by vehicle of the code of the scripts, as the race runs them."""
    specs = simulation.world.specs
    assert specs.rules is not None
    files = {"track": specs.map, "rules": specs.rules}
    digests = {name: hashlib.sha256(file.text.encode()).hexdigest() for name, file in files.items()}
    return {**digests, **{name: script.code.digest for name, script in scripts.items()}}
