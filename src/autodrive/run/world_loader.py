"""Loads the worlds of a run in sequence, with their cameras and scene files."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from autodrive.base.cache import PACKAGE
from autodrive.base.readable import Refusal, reading_only
from autodrive.base.specs import joined
from autodrive.scenario import ScenarioSpec, load_scenario
from autodrive.scenario.descriptions import Descriptions
from autodrive.scenario.kinds import titles
from autodrive.world.factory import compile_scenario, world_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from autodrive.connect.bridge.devkit import DevkitBridge
    from autodrive.protocol.messages import Frame
    from autodrive.run.camera_monitor import CameraMonitor
    from autodrive.run.options import RunOptions
    from autodrive.run.summary import CamerasSummary
    from autodrive.world import World
    from autodrive.world.compile import CompiledScenario
    from autodrive.world.simulation import Simulation
    from autodrive.world.views.scene_files import SceneFiles

log = logging.getLogger(__name__)

WARM_UP = 0.5
"""Simulated time after which every sensor has sampled at least once [s]."""


class WorldLoader:
    """Makes worlds with the options of the run; as a sink, it pauses and resumes the cameras of the current world.

    `cameras` monitors the cameras of the current world; None if they are disabled or the world has none. `scenario` is
    the name of the current scenario.
    """

    def __init__(self, options: RunOptions) -> None:
        self.scenario = options.scenario
        self.cameras: CameraMonitor | None = None
        self.has_start_screen = options.has_start_screen
        """Whether nobody has loaded a scenario since the start without one."""
        self._options = options
        self._made: WeakKeyDictionary[World, tuple[str, CameraMonitor | None, bool]] = WeakKeyDictionary()
        """Scenario and cameras of each world, and whether an edit made it."""
        self._simulation: Simulation | None = None
        self._world: World | None = None
        self._bridge: DevkitBridge | None = None
        self._is_viewed = False
        self._read_at_start: set[str] = set()
        """Real paths."""
        self._tick_duration = 0.0
        self._tick = self._ticks = 0

    def load(self, scenario: str | Descriptions, when_read: Callable[[], None] = lambda: None) -> World:
        """Make the world of a scenario and compile all that it runs. Raises `AutodriveError`.

        A name is loaded with the options of the run; Descriptions are those of the current scenario after an edit. The
        first world is the current one at once, others with their first Frame. `when_read` is called when all files have
        been found to be right.
        """
        is_edited = isinstance(scenario, Descriptions)
        name = self.scenario if is_edited else scenario
        with reading_only(self._refusal(name)):
            compiled = compile_scenario(scenario if is_edited else self.spec(scenario))
        self._check_quality()
        when_read()
        world, cameras = self._make(compiled)
        while world.time < WARM_UP:  # every function and sensor runs once, so that nothing compiles during the run
            world.step()
        world.reset()
        if not is_edited:  # the answer to an edit has them
            for text in joined(world.warnings, {}):
                log.warning("warning: %s", text)
        self._made[world] = name, cameras, is_edited
        if self._world is None:
            self._begin(world)
        return world

    def _refusal(self, name: str) -> Refusal:
        """What may be read for that scenario: at the start all; later what a client cannot have chosen.

        That is what this package contains, what is in the folder of the user, and what was read at the start.
        """
        folder = self._options.folder

        def note(path: Path) -> str:
            self._read_at_start.add(os.path.realpath(path))
            return ""

        def refusal(path: Path) -> str:
            real = Path(os.path.realpath(path))
            is_inside = any(real.is_relative_to(os.path.realpath(allowed)) for allowed in (PACKAGE, folder) if allowed)
            if is_inside or str(real) in self._read_at_start or path == Path(name):
                return ""
            problem = f"'{path.name}' is not a file of the scenario that the simulator was started with"
            return problem + (f", and not in the folder '{folder.resolve().name}': copy it there" if folder else "")

        is_of_user = self._world is None or (folder is None and name == self._options.scenario)
        return note if is_of_user else refusal

    def follow(self, simulation: Simulation) -> None:
        """The current world is that of this simulation, from its next Frame on."""
        self._simulation = simulation
        simulation.add_sink(self)

    def _begin(self, world: World) -> None:
        """Make a world the current one; the count of ticks and images goes on after an edit."""
        self.scenario, self.cameras, is_edited = self._made[world]
        self.has_start_screen &= self._world is None
        self._world = world
        if not is_edited:
            self._tick_duration, self._ticks = world.tick_duration, 0

    def scenery(self, world: World) -> SceneFiles:
        """The scene files of a world that this loader made."""
        from autodrive.world.views.scene_files import SceneFiles

        return SceneFiles.of(world, self._made[world][0])

    @property
    def scenarios(self) -> dict[str, str]:
        """Scenarios that can be loaded, name -> title: those of the package and the one of the options."""
        requested = self._options.scenario
        return {**titles("scenario", ScenarioSpec), requested: load_scenario(requested).title}

    def set_viewed(self, is_viewed: bool) -> None:
        """Whether any client shows camera images; rendering on demand depends on it."""
        self._is_viewed = is_viewed
        self._update_cameras()

    def render_while_connected(self, bridge: DevkitBridge) -> None:
        """Render camera images also while that bridge is connected."""
        self._bridge = bridge

    def publish(self, frame: Frame) -> None:
        """Count ticks and images of the current world."""
        assert self._simulation is not None
        if (world := self._simulation.world) is not self._world:
            self._begin(world)
        self._ticks += frame.tick != self._tick
        self._tick = frame.tick
        self._update_cameras()
        if self.cameras is not None:
            self.cameras.publish(frame)

    def cameras_summary(self) -> CamerasSummary | None:
        """Summary of the cameras of the current world; None if there are none."""
        return self.cameras and self.cameras.summary(self._ticks * self._tick_duration)

    @property
    def cameras_error(self) -> str:
        """Why the cameras failed; empty if they did not."""
        return "" if self.cameras is None else self.cameras.error

    @property
    def cameras_note(self) -> str:
        """Why there are no camera images although nothing failed; empty if there are."""
        return (
            "the camera images are off; the option --cameras turns them on" if self._options.pictures == "never" else ""
        )

    @property
    def _is_wanted(self) -> bool:
        is_connected = self._bridge is not None and self._bridge.status == "connected"
        return self._is_viewed or is_connected or self._options.pictures == "always"

    def _update_cameras(self) -> None:
        if self.cameras is not None:
            self.cameras.set_wanted(self._is_wanted)

    def spec(self, name: str) -> ScenarioSpec:
        """The scenario with driving mode, seed, weather and time of day of the options, so that a reset keeps them."""
        options = self._options
        spec = load_scenario(name)
        is_autonomous = options.driving_mode == "autonomous"
        vehicles = {
            name: placement.model_copy(update={"is_autonomous": is_autonomous})
            for name, placement in spec.vehicles.items()
        }
        seed = spec.seed if options.seed is None else options.seed
        return spec.model_copy(update={"vehicles": vehicles, "seed": seed, **options.environment})

    def _check_quality(self) -> None:
        """Raises `AutodriveError` for an unknown quality of the cameras."""
        if self._options.pictures != "never":
            from autodrive.graphics.render.quality import quality

            quality(self._options.camera_quality, "")

    def _make(self, compiled: CompiledScenario) -> tuple[World, CameraMonitor | None]:
        options = self._options
        if options.pictures == "never":
            return world_of(compiled), None
        from autodrive.run.camera_monitor import world_with_cameras

        return world_with_cameras(
            compiled, quality=options.camera_quality, draws_in_tick=options.draws_in_tick, is_wanted=self._is_wanted
        )
