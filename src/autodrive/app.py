"""Puts a World, its Simulation, the page's server and the devkit bridge together, and runs them until the end."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from autodrive.bridge.devkit import DevkitBridge
from autodrive.errors import AutodriveError
from autodrive.jit import compiling
from autodrive.protocol.ports import DEVKIT_PORT
from autodrive.run_options import RunOptions
from autodrive.run_summary import Odometer, bridge_summary, run_summary
from autodrive.simulation import Simulation
from autodrive.stage import Stage

if TYPE_CHECKING:
    from autodrive.bridge.server import Server
    from autodrive.jpeg import JpegEncoder
    from autodrive.scene_process import SceneProcess
    from autodrive.world import World

REFRESH = 0.2
"""Wall time between two status lines [s]."""

PAGE = Path(__file__).parent / "page"
"""Where the built page is."""


@dataclass
class Run:
    """A run under way, for the status line."""

    simulation: Simulation
    stage: Stage
    odometer: Odometer
    bridge: DevkitBridge
    server: Server | None

    @property
    def link(self) -> str:
        """To the page; empty where none is served."""
        return self.server.url if self.server else ""

    def status(self) -> str:
        """One line: time, real-time factor, each vehicle, the bridge, the page."""
        parts = [f"{self.simulation.simulated_time:8.1f} s", f"x{self.simulation.real_time_factor:.2f}"]
        for name, vehicle in self.simulation.frame.vehicles.items():
            x, y, _ = vehicle.pose.position
            parts.append(f"{name} {vehicle.speed:+.2f} m/s at ({x:+.2f}, {y:+.2f})")
        if self.stage.cameras is not None:
            parts.append(self.stage.cameras.status())
        if (status := self.bridge.status) != "closed":
            parts.append(f"devkit {status}, {self.bridge.counters.commands_received} commands")
        if self.server is not None:
            viewers = self.server.viewers
            parts.append(f"{self.link} {viewers} viewer{'' if viewers == 1 else 's'}")
        return "  ".join(parts)


class Screen(Protocol):
    """Where a run shows itself."""

    def compiled(self, function: str) -> None:
        """A function was compiled: on the first start there are some dozens, in about half a minute."""
        ...

    def prepared(self, run: Run) -> None:
        """The world and its page are there, and the clock starts."""
        ...

    def show(self, run: Run) -> None:
        """What the run does now; called each `REFRESH` seconds."""
        ...


def run(options: RunOptions, screen: Screen) -> dict[str, Any]:
    """Run until the duration is over or a signal (SIGINT, SIGTERM) ends it; the summary, also written if asked for.

    Raises `AutodriveError`.
    """
    _check_writable(options.summary)
    stage = Stage(options)
    with compiling(screen.compiled):
        world = stage.load(options.scenario)
    simulation = Simulation(world, speed=options.speed, load=stage.load)
    odometer = Odometer(simulation)
    simulation.add_sink(odometer)
    simulation.add_sink(stage)
    with ExitStack() as stack:
        stack.callback(lambda: simulation.world.close())  # noqa: PLW0108  of the world that is there at the end
        if stage.cameras is not None and options.pictures == "always":
            stage.cameras.wait()
        encoder = _encoder(options)
        bridge = _bridge(simulation, options, encoder)
        stack.callback(bridge.close)
        stage.watch(bridge)
        server = _server(simulation, stage, options, bridge, encoder) if options.has_page else None
        under_way = Run(simulation, stage, odometer, bridge, server)
        stack.callback(simulation.stop)
        if server is not None:
            stack.enter_context(server)
        screen.prepared(under_way)
        if options.devkit is not None:
            bridge.start()
        signals = stack.enter_context(_signals())
        simulation.start(options.duration)
        while not signals and not simulation.wait(REFRESH):
            screen.show(under_way)
        simulation.stop()
        summary = {
            **run_summary(simulation, odometer, stage.scenario, signals[0] if signals else "duration"),
            "cameras": stage.cameras_summary(),
            "bridge": bridge_summary(bridge),
            "page": server and {"link": server.url},
        }
    if options.summary is not None:
        options.summary.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary


def _encoder(options: RunOptions) -> JpegEncoder | None:
    if options.pictures == "never":
        return None
    from autodrive.jpeg import JpegEncoder

    return JpegEncoder(options.image_size, options.image_quality)


def _bridge(simulation: Simulation, options: RunOptions, encoder: JpegEncoder | None) -> DevkitBridge:
    """Not started: it is when asked for, on the command line or from the page."""
    host, port = options.devkit or ("127.0.0.1", DEVKIT_PORT)
    if encoder is None:
        return DevkitBridge(simulation, host, port, options.devkit_profile)
    from autodrive.jpeg import images_of

    images = partial(images_of, encoder=encoder)
    return DevkitBridge(simulation, host, port, options.devkit_profile, images=images)


def _server(
    simulation: Simulation, stage: Stage, options: RunOptions, bridge: DevkitBridge, encoder: JpegEncoder | None
) -> Server:
    from autodrive.bridge.server import Server

    return Server(
        simulation,
        scenery=stage.scenery,
        page=PAGE if (PAGE / "index.html").is_file() else None,
        bridge=bridge,
        scenarios=stage.scenarios,
        host=options.host,
        port=options.port,
        token=options.token,
        allowed_origins=options.allowed_origins,
        pictures=encoder,
        cameras_fault=lambda: stage.cameras_fault,
        wants_pictures=stage.look,
        crew=partial(_crew, quality=options.camera_quality),
    )


def _crew(world: World, quality: str) -> SceneProcess:
    from autodrive.scene_process import SceneProcess

    return SceneProcess.of(world, quality)


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
