"""Serves the page with a recording in the place of a simulation."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import structs

from autodrive import recording as recordings
from autodrive.connect.devkit.server import SIGNAL_DELAY
from autodrive.connect.server.files import built_page
from autodrive.connect.server.served import PageOptions, Served, scene_renderer_factory
from autodrive.connect.server.server import SimulationServer
from autodrive.graphics.cameras.jpeg import JpegEncoder
from autodrive.graphics.cameras.process_cameras import ProcessCameras
from autodrive.protocol.messages import Place, Reset, UseMap
from autodrive.protocol.native import Drive
from autodrive.protocol.replay import Curve, PlotRecording
from autodrive.recording.replay.forces import ForcesAgain
from autodrive.recording.replay.overview import Overview
from autodrive.recording.replay.player import Player, Stage
from autodrive.recording.replay.tape import Tape
from autodrive.world.factory import new_world
from autodrive.world.views.cameras import process_cameras
from autodrive.world.views.scene_files import SceneFiles

if TYPE_CHECKING:
    from autodrive.scenario import ScenarioSpec
    from autodrive.world import World
    from autodrive.world.compile import CompiledScenario

CHANGES = (Drive, Reset, Place, UseMap)
"""What a page offers and a replay refuses; the Player refuses all other changes."""


@dataclass(frozen=True)
class ReplayOptions:
    """Options of `replay` and of the command `autodrive replay`."""

    speed: float = 1.0
    """Recorded seconds per second."""
    is_paused: bool = False
    """Whether it waits for a viewer to play."""
    camera_quality: str = "auto"
    """Quality of images that were not recorded: one of `autodrive.graphics.render.quality.NAMES`."""
    page: PageOptions = PageOptions()  # noqa: RUF009  it is frozen
    """Where the page is served, and to whom."""


class Replay:
    """A recording with its page, which is served in a `with` block: `with Replay("lap.mcap") as it: it.server.url`."""

    def __init__(self, path: str | Path, options: ReplayOptions | None = None) -> None:
        """Raises `AutodriveError` if the file cannot be read."""
        options = options or ReplayOptions()
        self._stack = ExitStack()
        try:
            self.tape = self._stack.enter_context(Tape(Path(path)))
            stages = _Stages(self.tape, options.camera_quality)
            self._stack.callback(stages.close)
            forces = ForcesAgain(Path(path))
            self._stack.callback(forces.close)
            self.player = Player(
                self.tape, stages.at, speed=options.speed, is_paused=options.is_paused, forces=forces.at
            )
            self._overview = Overview(recordings.open(path))
            self._stack.callback(self._overview.close)
        except BaseException:
            self._stack.close()
            raise
        self.server = SimulationServer(
            Served(
                self.player,
                stages.scene_files,
                replay=self,
                refusal=lambda message: self.player.refusal if isinstance(message, CHANGES) else "",
                jpeg_encoder=JpegEncoder(),
                cameras_error=stages.cameras_error,
                want_pictures=self.player.want_images,
                renderer_factory=scene_renderer_factory(options.camera_quality),
            ),
            options.page,
            page=built_page(),
        )

    @property
    def position(self) -> float:
        """Time of the recording that is shown [s]."""
        return self.player.position

    def curves(self, request: PlotRecording) -> tuple[dict[str, Curve], str]:
        """Curves of the recording, and what is still missing."""
        curves = self._overview.curves(request)
        share = self._overview.share
        return curves, f"{share:.0%} of the recording were read" if share < 1.0 else ""

    def __enter__(self) -> Replay:
        self._stack.enter_context(self.player)
        self._stack.enter_context(self.server)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()


def replay(
    path: str | Path,
    options: ReplayOptions | None = None,
    *,
    stop: threading.Event | None = None,
    on_start: Callable[[Replay], None] = lambda replay: None,
) -> None:
    """Serve the page with a recording until `stop` is set. Raises `AutodriveError`."""
    with Replay(path, options) as running:
        on_start(running)
        stop = stop or threading.Event()
        while not stop.wait(SIGNAL_DELAY):
            pass


class _Stages:
    """The Worlds of a recording, one for each of its scenarios."""

    def __init__(self, tape: Tape, quality: str) -> None:
        self._tape = tape
        self._quality = quality
        self._stages: dict[int, tuple[str, ScenarioSpec, Stage]] = {}
        self._latest: Stage | None = None

    def at(self, time: float) -> Stage:
        """The World at a time of the recording [s], made when it is needed first."""
        name, spec = self._tape.scenario_at(time)
        if id(spec) not in self._stages:
            self._stages[id(spec)] = name, spec, self._made(spec)
        self._latest = self._stages[id(spec)][2]
        return self._latest

    def scene_files(self, world: World) -> SceneFiles:
        """The scene of a World, with the timeline."""
        name = next(name for name, _, stage in self._stages.values() if stage.world is world)
        files = SceneFiles.of(world, name)
        return replace(files, scene=structs.replace(files.scene, timeline=self._tape.timeline))

    def cameras_error(self) -> str:
        """Why there are no images of the sensor cameras."""
        cameras = self._latest and self._latest.cameras
        return cameras.statistics.error if cameras is not None else ""

    def close(self) -> None:
        """Close all Worlds, and with them what draws images."""
        for _, _, stage in self._stages.values():
            stage.world.close()

    def _made(self, spec: ScenarioSpec) -> Stage:
        if self._tape.contains_images:
            return Stage(new_world(spec))
        drawn: list[ProcessCameras] = []

        def start(compiled: CompiledScenario) -> ProcessCameras:
            drawn.append(process_cameras(compiled, self._quality, is_wanted=False))
            return drawn[0]

        return Stage(new_world(spec, cameras=start), drawn[0] if drawn else None)
