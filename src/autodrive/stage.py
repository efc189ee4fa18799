"""The worlds of a run, one after the other, each with its cameras and its scenery."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import autodrive
from autodrive.browse import titles
from autodrive.scenario import ScenarioSpec, load_scenario

if TYPE_CHECKING:
    from autodrive.bridge.devkit import DevkitBridge
    from autodrive.camera_watch import CameraWatch
    from autodrive.protocol.messages import Frame
    from autodrive.run_options import RunOptions
    from autodrive.scenery import Scenery
    from autodrive.world import World

WARM_UP = 0.5
"""Simulated time after which every sensor has sampled [s]."""


class Stage:
    """Makes worlds as the options say, and is the sink that minds the pictures of the present one.

    `cameras` is their count, None where the world has none; `scenario` is the present one's name.
    """

    def __init__(self, options: RunOptions) -> None:
        self.scenario = options.scenario
        self.cameras: CameraWatch | None = None
        self._options = options
        self._names: WeakKeyDictionary[World, str] = WeakKeyDictionary()
        self._bridge: DevkitBridge | None = None
        self._is_looked_at = False
        self._tick_duration = 0.0
        self._tick = self._ticks = 0

    def load(self, name: str) -> World:
        """The world of a scenario, with the options of the run, all of it warm. Raises `AutodriveError`."""
        world, cameras = self._made(self._spec(name))
        while world.time < WARM_UP:  # every stage and sensor works once, so that all is compiled before the clock runs
            world.step()
        world.reset()
        self._names[world] = name
        self.scenario, self.cameras = name, cameras
        self._tick_duration, self._ticks = world.tick_duration, 0
        return world

    def scenery(self, world: World) -> Scenery:
        """What there is to draw of a world that was made here."""
        from autodrive.scenery import Scenery

        return Scenery.of(world, self._names[world])

    @property
    def scenarios(self) -> dict[str, str]:
        """Name -> title of what can be loaded: all that come with the simulator, and the one asked for."""
        asked = self._options.scenario
        return {**titles("scenario"), asked: load_scenario(asked).title}

    def look(self, is_looked_at: bool) -> None:
        """Some viewer, or none, wants pictures; it counts where they are drawn only while wanted."""
        self._is_looked_at = is_looked_at
        self._tell_wish()

    def watch(self, bridge: DevkitBridge) -> None:
        """Let the cameras draw while that bridge is connected, too."""
        self._bridge = bridge

    def publish(self, frame: Frame) -> None:
        """A new Frame of the present world."""
        self._ticks += frame.tick != self._tick
        self._tick = frame.tick
        self._tell_wish()
        if self.cameras is not None:
            self.cameras.publish(frame)

    def cameras_summary(self) -> dict[str, Any] | None:
        """What the cameras of the present world took; None if there are none."""
        return self.cameras and self.cameras.summary(self._ticks * self._tick_duration)

    @property
    def cameras_fault(self) -> str:
        """Why there are no pictures; empty if there are."""
        if self.cameras is not None:
            return self.cameras.fault
        return "the cameras were switched off with --no-cameras" if self._options.pictures == "never" else ""

    @property
    def _is_wanted(self) -> bool:
        """Whether pictures are to be drawn now."""
        is_connected = self._bridge is not None and self._bridge.status == "connected"
        return self._is_looked_at or is_connected or self._options.pictures == "always"

    def _tell_wish(self) -> None:
        """Let the cameras draw or rest."""
        if self.cameras is not None:
            self.cameras.want(self._is_wanted)

    def _spec(self, name: str) -> ScenarioSpec:
        """The scenario with the mode and seed asked for, so that a reset keeps them."""
        options = self._options
        spec = load_scenario(name)
        is_autonomous = options.driving_mode == "autonomous"
        vehicles = {
            name: placement.model_copy(update={"is_autonomous": is_autonomous})
            for name, placement in spec.vehicles.items()
        }
        seed = spec.seed if options.seed is None else options.seed
        return spec.model_copy(update={"vehicles": vehicles, "seed": seed})

    def _made(self, spec: ScenarioSpec) -> tuple[World, CameraWatch | None]:
        """The world, and who watches its cameras where they may be wanted and there are some."""
        options = self._options
        if options.pictures == "never":
            return autodrive.make(spec), None
        from autodrive.camera_watch import watched_world

        return watched_world(
            spec, quality=options.camera_quality, draws_in_tick=options.draws_in_tick, is_wanted=self._is_wanted
        )
