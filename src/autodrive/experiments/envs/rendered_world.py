"""A World of an environment with its render mode: images of a scene camera, or the page."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from autodrive.base.errors import CommandError, EngineError, SpecError
from autodrive.experiments.envs.settings import IMAGE_HEIGHT, IMAGE_WIDTH, EnvSettings
from autodrive.protocol.messages import Command, Weather
from autodrive.world.factory import compile_scenario, world_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from autodrive.base.arrays import Integers
    from autodrive.experiments.envs.task import Ground
    from autodrive.graphics.cameras.backend import CameraBackend
    from autodrive.graphics.render.renderer import Renderer
    from autodrive.protocol.native import Drive, Episode, ServerOperation
    from autodrive.scenario import ScenarioSpec
    from autodrive.world.compile import CompiledScenario
    from autodrive.world.readings import Readings
    from autodrive.world.simulation import Simulation
    from autodrive.world.views.batch_camera import BatchCamera
    from autodrive.world.world import World

WIDTH, HEIGHT = 640, 360
"""Width and height of the images of 'rgb_array' [pixels]."""
CAMERA = "front"
"""The camera of the observation 'camera'."""


QUALITY = "small"
"""Quality of the images of the observation 'camera'."""


def check_cameras(compiled: CompiledScenario, vehicles: Sequence[str], *, must_be_ideal: bool = False) -> None:
    """Raises `SpecError` if a camera of the observation 'camera' is missing, or not ideal although it must be."""
    errors: list[str] = []
    for vehicle in vehicles:
        camera = compiled.cameras[vehicle].get(CAMERA)
        if camera is None:
            errors.append(f"observation: 'camera' needs a camera '{CAMERA}' that is on; vehicle '{vehicle}' has none")
        elif must_be_ideal and not camera.imperfections.is_none:
            errors.append(
                f"observation: a vector environment draws ideal images only; let camera '{CAMERA}' of vehicle "
                f"'{vehicle}' have noise 'ideal', or use gymnasium.make"
            )
    if errors:
        raise SpecError(errors)


def batch_camera(compiled: CompiledScenario, vehicle: str) -> BatchCamera:
    """The cameras of the observation 'camera', of that car of many worlds."""
    from autodrive.world.views.batch_camera import BatchCamera  # noqa: PLC0415

    return BatchCamera(compiled, vehicle, CAMERA, size=(IMAGE_WIDTH, IMAGE_HEIGHT), quality=QUALITY)


class RenderedWorld:
    """The World of an environment in the place of a batch of one world; with 'human', in real time and in the page."""

    n = 1

    def __init__(
        self,
        scenario: ScenarioSpec,
        settings: EnvSettings,
        *,
        has_camera: bool,
        task: str = "",
        port: int | None = None,
        is_real_time: bool = True,
    ) -> None:
        """`task`: its name, if it is not in the settings. `port`: of the page, see `PageOptions`.

        `is_real_time`: whether a step with the page lasts its time.

        Raises `SpecError`.
        """
        self._settings, self._has_camera = settings, has_camera
        self._task = task or settings.task or ""
        self._port, self._is_real_time = port, is_real_time
        self._compiled = compile_scenario(scenario)
        self.map = self._compiled.map
        self.tick_duration = scenario.tick
        self.step_duration = scenario.tick * settings.frame_skip
        """Duration of a step [s]."""
        traffic = self._compiled.fleet.names
        self.commanded_names = [name for name in self._compiled.vehicles if name not in traffic]
        """The vehicles that obey commands."""
        self._is_closed = False
        if has_camera:
            check_cameras(self._compiled, self.commanded_names)
        self._renderer: Renderer | None = None
        self._simulation: Simulation | None = None
        self._episode: Episode | None = None
        """What the page is told; set in the thread of the environment."""
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

    @property
    def readings(self) -> Readings:
        """States and sensor readings at the present instant."""
        return self.world.row.readings

    @property
    def images(self) -> NDArray[np.uint8]:
        """The image of the front camera of each car that obeys commands, RGB, shape (v, height, width, 3)."""
        cars = self.world.frame.vehicles
        return np.stack([cars[name].cameras[CAMERA].rgb for name in self.commanded_names])

    def reset(
        self,
        worlds: ArrayLike,
        seeds: Sequence[int] | Integers,
        *,
        poses: Mapping[str, ArrayLike],
        weather: Sequence[Weather] | None = None,
    ) -> Readings:
        """Start an episode; the arguments are those of `BatchWorld.reset`, with one world."""
        self._check_open()
        self._due = time.monotonic()
        self._begin_episode()
        starts: dict[str, Ground] = {name: np.asarray(pose)[0].tolist() for name, pose in poses.items()}
        self.world.reset(int(seeds[0]), poses=starts, weather=weather[0] if weather else None)
        return self.readings

    def _begin_episode(self) -> None:
        from autodrive.protocol.native import CarState, Episode  # noqa: PLC0415

        before = self._episode
        task = self._task or self._compiled.spec.title or self._compiled.spec.map_name
        cars: dict[str, CarState] = dict.fromkeys(self.commanded_names, "drives")
        if before is None:
            self._episode = Episode(task, 1, cars)
        else:
            succeeded = before.succeeded + sum(state == "succeeded" for state in before.cars.values())
            ended = before.ended + len(before.cars)
            self._episode = Episode(task, before.number + 1, cars, succeeded=succeeded, ended=ended)

    def tell(self, has_ended: ArrayLike, is_success: ArrayLike, gap: float | None = None) -> None:
        """Tell the page whether the episode of each car that obeys commands has ended, and with success, shape (v,).

        `gap`: see `protocol.native.Episode`.
        """
        if self._simulation is None or self._episode is None:
            return  # nobody looks
        states = np.where(is_success, "succeeded", np.where(has_ended, "failed", "drives")).tolist()
        cars = dict(zip(self.commanded_names, states, strict=True))
        self._episode = structs.replace(self._episode, cars=cars, gap=gap)

    def step(self, commands: NDArray[Any], ticks: int, worlds: NDArray[np.bool_] | None = None) -> Readings:
        """Run the ticks of one action; the arguments are those of `BatchWorld.step`, with one world."""
        self._check_open()
        if worlds is not None and not worlds[0]:
            return self.readings
        by_vehicle = {name: Command(*row) for name, row in zip(self.commanded_names, commands[0].tolist(), strict=True)}
        with contextlib.suppress(EngineError):  # `readings.is_unstable` says it
            self._run(by_vehicle, ticks)
        return self.readings

    def _run(self, commands: Mapping[str, Command], ticks: int) -> None:
        if self._simulation is None:
            for _ in range(ticks):
                self.world.step(commands)
            return
        for vehicle, command in commands.items():
            self._simulation.submit(vehicle, command)
        self._simulation.run(self.step_duration)
        if self._is_real_time:
            self._due = max(self._due + self.step_duration, time.monotonic() - self.step_duration)
            time.sleep(max(self._due - time.monotonic(), 0.0))

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

    def _check_open(self) -> None:
        if self._is_closed:
            raise CommandError("this environment is closed: make a new one")

    def _cameras(self, compiled: CompiledScenario) -> CameraBackend:
        """The front cameras, with small images: one for each step."""
        from autodrive.graphics.cameras.tick_cameras import TickCameras  # noqa: PLC0415
        from autodrive.world.views.cameras import camera_rig  # noqa: PLC0415

        rate = (1.0 + 1e-9) / self.step_duration  # a little more: rounded down, it would be a tick too late
        changed = {"width": IMAGE_WIDTH, "height": IMAGE_HEIGHT, "rate": rate}
        cameras = {
            vehicle: {CAMERA: specs[CAMERA].model_copy(update=changed)} if vehicle in self.commanded_names else {}
            for vehicle, specs in compiled.cameras.items()
        }
        return TickCameras(camera_rig(replace(compiled, cameras=cameras), QUALITY))

    def _started_renderer(self) -> Renderer:
        if self._renderer is None:
            from autodrive.graphics.render.renderer import Renderer  # noqa: PLC0415
            from autodrive.world.views.cameras import scene_rig  # noqa: PLC0415

            self._renderer = self._open.enter_context(Renderer(scene_rig(self.world).scene))
        return self._renderer

    def _serve(self) -> None:
        from autodrive.connect.server.files import built_page  # noqa: PLC0415
        from autodrive.connect.server.served import PageOptions, Served  # noqa: PLC0415
        from autodrive.connect.server.server import SimulationServer  # noqa: PLC0415
        from autodrive.world.simulation import Simulation  # noqa: PLC0415
        from autodrive.world.views.scene_files import SceneFiles  # noqa: PLC0415

        self._simulation = Simulation(self.world, speed=None)
        scene_files = partial(SceneFiles.of, scenario=self._task)
        served = Served(self._simulation, scene_files, refusal=_refusal, episode=lambda: self._episode)
        server = SimulationServer(served, PageOptions(port=self._port), page=built_page())
        self._open.enter_context(server)
        print(f"The page of this environment: {server.url}", flush=True)


def _refusal(message: ServerOperation | Drive) -> str:
    """Why viewers may not have that operation or Drive; empty if they may."""
    from autodrive.protocol import messages, native  # noqa: PLC0415

    if isinstance(message, native.Drive):
        return "the program of the environment drives its vehicles"
    allowed = (
        *(messages.Pause, messages.Resume, messages.SetSpeed, messages.SetSceneLight, messages.SetTimeOfDay),
        *(messages.Draw, messages.SaveScenario, messages.SaveMap, native.DescribeVehicle, native.DescribeWeather),
        *(native.SetCamera, native.ViewSensor),
    )
    if isinstance(message, allowed):
        return ""
    return f"this is an environment, whose program sets the scene of each episode: {type(message).__name__} is refused"
