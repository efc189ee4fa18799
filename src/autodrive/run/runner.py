"""Runs a scenario with its page server and devkit bridge until the duration is over or a stop is requested."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache, partial
from itertools import count
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from msgspec.structs import replace

from autodrive.base.cache import check_writable, write_file
from autodrive.base.errors import CommandError
from autodrive.base.jit import compiling
from autodrive.base.suggest import with_suggestions
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.client.last_run import NotedRun
from autodrive.connect.server.files import built_page
from autodrive.protocol.native import Starting
from autodrive.protocol.ports import DEVKIT_PORT
from autodrive.run.compile_later import compile_later
from autodrive.run.first_picture import FirstPicture
from autodrive.run.included_driver import IncludedDriver
from autodrive.run.options import RunOptions
from autodrive.run.recordings import ClientRecordings
from autodrive.run.summary import Odometer, Summary, run_summary
from autodrive.run.world_loader import WorldLoader
from autodrive.world.simulation import Simulation

if TYPE_CHECKING:
    from pathlib import Path

    from autodrive.connect.server.served import Served
    from autodrive.connect.server.server import SimulationServer
    from autodrive.graphics.cameras.jpeg import JpegEncoder
    from autodrive.protocol.devkit import Images, ImageSizes
    from autodrive.protocol.messages import Frame
    from autodrive.protocol.native import Drive, ServerOperation
    from autodrive.recording import Recorder
    from autodrive.world.racing.results import RaceResult

Refusal: TypeAlias = "Callable[[ServerOperation | Drive], str]"
"""Why clients may not have an operation or Drive now; empty if they may."""

COMPILING = "preparing the physics, only at the first start"
COMPILED_FUNCTIONS, COMPILED_FOR_TRAFFIC = 247, 48
"""Number of functions that the first start compiles, and how many more it compiles for a scenario with traffic."""
COMPILED_SHARE = (0.0, 0.5, 0.85, 0.95, 1.0), (0.0, 0.45, 0.63, 0.77, 0.97)
"""Share of them that is compiled, and share of the time that has passed by then: large functions come last."""
MIN_ELAPSED = 3.0
"""Time after which the remaining time is estimated [s]."""
REFRESH_INTERVAL = 0.2
"""Wall time between two calls of `RunObserver.running` [s]; a stop request takes effect within that time."""


class StopRequest:
    """Ends a run early. `set` may be called from any thread or from a signal handler."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self._reason = ""

    @property
    def reason(self) -> str:
        """Reason of the first request; empty before it."""
        return self._reason

    def set(self, reason: str = "request") -> None:
        """Request the end of the run; the summary reports the reason as `ended_by`."""
        self._reason = self._reason or reason
        self._event.set()

    def is_set(self) -> bool:
        """Whether the end of the run was requested."""
        return self._event.is_set()


@dataclass
class Run:
    """A run in progress."""

    options: RunOptions
    simulation: Simulation
    loader: WorldLoader
    odometer: Odometer
    bridge: DevkitBridge
    encoder: JpegEncoder | None
    server: SimulationServer | None = None
    recorder: Recorder | None = None

    @property
    def link(self) -> str:
        """Link to the page; empty if no page is served."""
        return self.server.url if self.server else ""

    def summary(self, ended_by: str) -> Summary:
        """The figures of the run up to now; may be called from any thread."""
        return run_summary(
            self.simulation,
            self.odometer,
            scenario=self.loader.scenario,
            ended_by=ended_by,
            cameras=self.loader.cameras_summary(),
            bridge=self.bridge,
            page_link=self.link,
            recorder=self.recorder,
        )

    def status(self) -> str:
        """Status line: time, real-time factor, vehicles, cameras, devkit bridge, page."""
        parts = [f"{self.simulation.simulated_time:8.1f} s"]
        if factor := self.simulation.real_time_factor:  # it was measured
            parts.append(f"x{factor:.2f}" if factor >= 0.1 else f"x{factor:.2g}")
        for name, vehicle in self.simulation.frame.vehicles.items():
            if vehicle.is_traffic:
                continue
            x, y, _ = vehicle.pose.position
            parts.append(f"{name} {vehicle.speed:+.2f} m/s at ({x:+.2f}, {y:+.2f})")
            if vehicle.race is not None and vehicle.race.lap_total:
                parts.append(f"lap {vehicle.race.lap_count}/{vehicle.race.lap_total}")
        if self.loader.cameras is not None:
            parts.append(self.loader.cameras.status())
        if (status := self.bridge.status) != "closed":
            parts.append(f"devkit {status}, {self.bridge.counters.commands_received} commands")
        if self.recorder is not None:
            parts.append(self.recorder.status())
        if self.server is not None:
            clients = self.server.clients
            parts.append(f"{self.link} {clients} client{'' if clients == 1 else 's'}")
        return "  ".join(parts)


class RunObserver:
    """Called during a run, in the thread of `simulate`; a subclass overrides what it needs."""

    def compiled(self, function: str) -> None:
        """A function was compiled; the first start on a machine compiles more than a hundred."""

    def serving(self, link: str) -> None:
        """The page is served, and shows how far the start is."""

    def started(self, run: Run) -> None:
        """The world is loaded; time starts after this call."""

    def running(self, run: Run) -> None:
        """Called every `REFRESH_INTERVAL`."""

    def decided(self, result: RaceResult) -> None:
        """A race is over, and its results are written; its connections are still open."""


@with_suggestions
def simulate(
    options: RunOptions | None = None, *, stop: StopRequest | None = None, observer: RunObserver | None = None
) -> Summary:
    """Run a scenario until its duration is over or `stop` is set; the summary is also written to `options.summary`.

    Needs neither the main thread nor a terminal, and installs no signal handlers: without a duration, `stop.set()` from
    another thread ends the run. Several runs in one process may follow each other. Raises `AutodriveError`, for example
    for an unknown scenario or a port that is in use.
    """
    if not isinstance(options, RunOptions | None):
        raise CommandError(f"simulate() needs RunOptions, such as RunOptions('plane'), not {options!r}")
    options, stop, observer = options or RunOptions(), stop or StopRequest(), observer or RunObserver()
    if options.summary is not None:
        check_writable(options.summary)  # before a long run, not after it
    with ExitStack() as stack:
        run = opened(stack, options, observer)
        simulation = run.simulation
        observer.started(run)
        if options.devkit is not None:
            run.bridge.start()
        simulation.start(options.duration)
        while not stop.is_set() and not simulation.wait(REFRESH_INTERVAL):
            observer.running(run)
        simulation.stop()
        if run.recorder is not None:
            run.recorder.close()
        summary = run.summary(stop.reason or "duration")
        if options.summary is not None:
            write_file(options.summary, summary.to_json())
    return summary


def opened(
    stack: ExitStack,
    options: RunOptions,
    observer: RunObserver,
    make_grid: Callable[[Simulation, JpegEncoder | None], tuple[Sequence[DevkitBridge], Refusal]] | None = None,
) -> Run:
    """A run whose time and bridges have not started yet; `stack` closes it. The page is served.

    `make_grid` makes a race of it, whose time is paused: it returns the bridges of the scripts, and what clients may
    not have. None: the bridge of the options, and clients may have everything.
    """
    loader = WorldLoader(options)
    server = _page_server(options) if options.has_page else None
    note = stack.enter_context(NotedRun(server.origin)) if server is not None else None

    def begin_to_serve() -> None:
        if server is not None and note is not None:
            stack.enter_context(server)
            note.write(server.address)
            observer.serving(server.url)

    with FirstPicture(server, options) as picture, compiling(_told(observer, server, picture, loader)):
        world = loader.load(options.scenario, begin_to_serve)
    if picture.has_begun and (process := compile_later()):
        stack.callback(process.wait)
        stack.callback(process.kill)
    simulation = Simulation(
        world,
        speed=options.speed,
        load=loader.load,
        is_paused=make_grid is not None,
        pause_on_error=options.has_page and make_grid is None,
    )
    stack.callback(lambda: simulation.world.close())  # noqa: PLW0108  the current world may be another by then
    odometer = Odometer(simulation)
    simulation.add_sink(odometer)
    loader.follow(simulation)
    if loader.cameras is not None and options.pictures == "always":
        loader.cameras.wait()
    encoder = _image_encoder(options)
    make_bridges = make_grid or (lambda *_: ([_bridge(simulation, options, encoder)], lambda _: ""))
    bridges, refusal = make_bridges(simulation, encoder)
    run = Run(options, simulation, loader, odometer, bridges[0], encoder)
    loader.render_while_connected(run.bridge)
    recordings = ClientRecordings(
        simulation,
        options.recordings,
        scenario=lambda: loader.scenario,
        encoder=encoder,
        bridge=lambda: run.bridge.status,
        page=options.page,
    )
    stack.callback(recordings.close)
    if options.record is not None:
        run.recorder = stack.enter_context(_recorder(run, options.record))
    stack.callback(simulation.stop)
    if server is not None:
        server.serve(_served(run, recordings, refusal))
        run.server = server
        stack.callback(server.close)  # before the simulation ends
    for bridge in bridges:
        stack.callback(bridge.close)
    return run


def _told(
    observer: RunObserver, server: SimulationServer | None, picture: FirstPicture, loader: WorldLoader
) -> Callable[[str], None]:
    """Tells the observer and the clients that a function is compiled; the picture is made as soon as one is."""
    numbers, begin = count(1), time.monotonic()

    @cache
    def expected() -> int:
        has_traffic = bool(loader.spec(loader.scenario).traffic.names)
        return COMPILED_FUNCTIONS + COMPILED_FOR_TRAFFIC * has_traffic

    def tell(function: str) -> None:
        observer.compiled(function)
        if server is not None:
            share = float(np.interp(next(numbers) / expected(), *COMPILED_SHARE))
            elapsed = time.monotonic() - begin
            remaining = elapsed / share - elapsed if elapsed > MIN_ELAPSED else None
            server.starting = replace(server.starting, stage=COMPILING, share=share, remaining=remaining)
            picture.begin()

    return tell


def _image_encoder(options: RunOptions) -> JpegEncoder | None:
    """The encoder of the images for scripts and clients; None if there are none."""
    if options.pictures == "never":
        return None
    from autodrive.graphics.cameras.jpeg import JpegEncoder

    return JpegEncoder(options.image_size, options.image_quality)


def _bridge(simulation: Simulation, options: RunOptions, encoder: JpegEncoder | None) -> DevkitBridge:
    """A bridge that is not started yet: an option or a client request starts it."""
    host, port = options.devkit or ("127.0.0.1", DEVKIT_PORT)
    return DevkitBridge(
        simulation,
        host,
        port,
        options.devkit_settings,
        images=images_by(encoder),
        image_sizes=partial(_image_sizes, simulation, options),
        vehicle_profile=partial(_vehicle_profile, simulation),
    )


def images_by(encoder: JpegEncoder | None) -> Callable[[Frame, float], Images] | None:
    """The function that a bridge gets for its images."""
    if encoder is None:
        return None
    from autodrive.graphics.cameras.jpeg import images_of

    return partial(images_of, encoder=encoder)


def _recorder(run: Run, path: Path) -> Recorder:
    from autodrive.recording import Recorder

    return Recorder(
        path,
        run.simulation,
        name=lambda: run.loader.scenario,
        last=run.options.record_last,
        encoder=run.encoder,
        image_quality=run.options.image_quality,
        status=lambda: run.bridge.status,
    )


def _image_sizes(simulation: Simulation, options: RunOptions) -> ImageSizes:
    """Sizes of the images that a devkit script receives, of the cameras of the current world."""
    return {
        (vehicle, name): options.image_size or (camera.width, camera.height)
        for vehicle, spec in simulation.world.vehicle_specs.items()
        for name, camera in spec.cameras.items()
    }


def _vehicle_profile(simulation: Simulation) -> str | None:
    """The devkit profile of the first vehicle that has one: a script has one profile for all vehicles."""
    specs = simulation.world.vehicle_specs.values()
    return next((spec.devkit_profile for spec in specs if spec.devkit_profile), None)


def _page_server(options: RunOptions) -> SimulationServer:
    """The server of the page and of the native protocol, which is not started yet and serves no simulation."""
    from autodrive.connect.server.server import SimulationServer

    server = SimulationServer(None, options.page, page=built_page())
    server.starting = Starting(
        "loading the world", scenario=options.scenario, has_start_screen=options.has_start_screen
    )
    return server


def _served(run: Run, recordings: ClientRecordings, refusal: Refusal) -> Served:
    """What the server serves."""
    from autodrive.connect.server.served import Served, scene_renderer_factory
    from autodrive.run.own_files import UserFiles

    loader, driver = run.loader, IncludedDriver(run.simulation)
    run.simulation.add_sink(driver)
    return Served(
        run.simulation,
        loader.scenery,
        bridge=run.bridge,
        scenarios=loader.scenarios,
        let_drive=driver.let_drive,
        has_start_screen=lambda: loader.has_start_screen,
        jpeg_encoder=run.encoder,
        recording=recordings,
        own_files=UserFiles(run.options.folder),
        cameras_error=lambda: loader.cameras_error,
        cameras_note=lambda: loader.cameras_note,
        want_pictures=loader.set_viewed,
        renderer_factory=scene_renderer_factory(run.options.camera_quality),
        refusal=refusal,
    )
