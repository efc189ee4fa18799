"""A World of an environment with its render mode: images of a scene camera, or the page."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from autodrive.base.errors import CommandError
from autodrive.experiments.envs.settings import IMAGE_HEIGHT, IMAGE_WIDTH, Settings
from autodrive.experiments.envs.task import CarReadings
from autodrive.protocol.messages import Command, Frame, Weather
from autodrive.world.factory import compile_scenario, world_of

if TYPE_CHECKING:
    from autodrive.experiments.envs.task import Ground
    from autodrive.graphics.cameras.backend import CameraBackend
    from autodrive.graphics.render.renderer import Renderer
    from autodrive.scenario import ScenarioSpec
    from autodrive.world.batch_camera import BatchCamera
    from autodrive.world.compile import CompiledScenario
    from autodrive.world.simulation import Simulation
    from autodrive.world.world import World

WIDTH, HEIGHT = 640, 360
"""Of the images of 'rgb_array' [pixels]."""
CAMERA = "front"
"""The camera of the observation 'camera'."""


QUALITY = "small"
"""Of its images."""


def batch_camera(scenario: ScenarioSpec) -> BatchCamera:
    """The cameras of the observation 'camera', of the first car of many worlds."""
    from autodrive.world.batch_camera import BatchCamera  # noqa: PLC0415

    vehicle = next(iter(scenario.vehicles))
    return BatchCamera(scenario, vehicle, CAMERA, size=(IMAGE_WIDTH, IMAGE_HEIGHT), quality=QUALITY)


class RenderedWorld:
    """The World of a scenario; with 'human' it runs in real time, and the page shows it."""

    def __init__(
        self,
        scenario: ScenarioSpec,
        settings: Settings,
        *,
        has_camera: bool,
        port: int | None = None,
        is_real_time: bool = True,
    ) -> None:
        """`port`: of the page, see `PageOptions`. `is_real_time`: whether a step with the page lasts its time.

        Raises `SpecError`.
        """
        self._settings, self._has_camera = settings, has_camera
        self._port, self._is_real_time = port, is_real_time
        self.step_duration = scenario.tick * settings.frame_skip
        """[s]."""
        self._compiled = compile_scenario(scenario)
        self._is_closed = False
        self._renderer: Renderer | None = None
        self._simulation: Simulation | None = None
        self._open = ExitStack()
        if settings.render_mode == "human":
            self._serve()

    @cached_property
    def world(self) -> World:
        """The World. Raises `GlUnavailable` for cameras without OpenGL.

        It starts when it is first used: until then OpenGL is not, which cannot be used in processes that are forked
        later, such as those of `gymnasium.vector.AsyncVectorEnv`.
        """
        world = world_of(self._compiled, cameras=self._cameras if self._has_camera else False)
        self._open.callback(world.close)
        return world

    def reset(self, seed: int, poses: Mapping[str, Ground], weather: Weather | None = None) -> Frame:
        """Start an episode; `weather`: None: that of the scenario."""
        self._check_open()
        self._due = time.monotonic()
        return self.world.reset(seed, poses=poses, weather=weather)

    def step(self, commands: Mapping[str, Command]) -> Frame:
        """Run the ticks of one action. Raises `EngineError` if the physics became unstable."""
        self._check_open()
        if self._simulation is None:
            for _ in range(self._settings.frame_skip):
                self.world.step(commands)
            return self.world.frame
        for vehicle, command in commands.items():
            self._simulation.submit(vehicle, command)
        frame = self._simulation.run(self.step_duration)
        if self._is_real_time:
            self._due = max(self._due + self.step_duration, time.monotonic() - self.step_duration)
            time.sleep(max(self._due - time.monotonic(), 0.0))
        return frame

    def render(self) -> NDArray[np.uint8] | None:
        """The image of Driver's Eye behind the first car, shape (360, 640, 3); None for other render modes."""
        if self._settings.render_mode != "rgb_array":
            return None
        from autodrive.graphics.cameras.viewpoints import drivers_eye  # noqa: PLC0415  OpenGL waits until an image is wanted
        from autodrive.graphics.render.render_state import RenderState  # noqa: PLC0415

        frame = self.world.frame
        pose = next(iter(frame.vehicles.values())).pose
        (x, y, z), (qw, qx, qy, qz) = pose.position.tolist(), pose.orientation.tolist()
        viewpoint = drivers_eye((x, y, z), (qw, qx, qy, qz))
        [image] = self._started_renderer().draw(RenderState.of(frame), [viewpoint.view(WIDTH, HEIGHT)])
        return np.ascontiguousarray(image.rgba[..., :3])

    def close(self) -> None:
        """Stop the page, and free the renderers."""
        self._is_closed = True
        self._open.close()

    @property
    def cars(self) -> CarReadings:
        """What the environments read of the cars."""
        own = len(self._compiled.vehicles) - len(self._compiled.fleet.names)
        return CarReadings.of(self.world.row.readings, own)

    def _check_open(self) -> None:
        if self._is_closed:
            raise CommandError("this environment is closed: make a new one")

    def _cameras(self, compiled: CompiledScenario) -> CameraBackend:
        """The front cameras, with small images: one for each step."""
        from autodrive.graphics.cameras.tick_cameras import TickCameras  # noqa: PLC0415
        from autodrive.world.cameras import camera_rig  # noqa: PLC0415

        rate = (1.0 + 1e-9) / self.step_duration  # a little more: rounded down, it would be a tick too late
        changed = {"width": IMAGE_WIDTH, "height": IMAGE_HEIGHT, "rate": rate}
        cameras = {
            vehicle: {CAMERA: specs[CAMERA].model_copy(update=changed)} for vehicle, specs in compiled.cameras.items()
        }
        return TickCameras(camera_rig(replace(compiled, cameras=cameras), QUALITY))

    def _started_renderer(self) -> Renderer:
        if self._renderer is None:
            from autodrive.graphics.render.renderer import Renderer  # noqa: PLC0415
            from autodrive.world.cameras import scene_rig  # noqa: PLC0415

            self._renderer = self._open.enter_context(Renderer(scene_rig(self.world).scene))
        return self._renderer

    def _serve(self) -> None:
        from autodrive.connect.server.files import built_page  # noqa: PLC0415
        from autodrive.connect.server.served import PageOptions, Served  # noqa: PLC0415
        from autodrive.connect.server.server import SimulationServer  # noqa: PLC0415
        from autodrive.world.scene_files import SceneFiles  # noqa: PLC0415
        from autodrive.world.simulation import Simulation  # noqa: PLC0415

        self._simulation = Simulation(self.world, speed=None)
        served = Served(self._simulation, lambda world: SceneFiles.of(world, self._settings.task or ""))
        server = SimulationServer(served, PageOptions(port=self._port), page=built_page())
        self._open.enter_context(server)
        print(f"The page of this environment: {server.url}", flush=True)
