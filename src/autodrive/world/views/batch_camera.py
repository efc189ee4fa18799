"""Small images of one camera in many worlds of a scenario, drawn in one call: observations for learning."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from autodrive.base.errors import AutodriveError
from autodrive.base.suggest import suggest
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.batch_renderer import BatchRenderer
from autodrive.graphics.render.look import DAY, NIGHT, air_of, in_air
from autodrive.graphics.render.render_state import OBJECT, VEHICLE
from autodrive.physics.actuators.lights import lamp_levels, lit_lamps
from autodrive.physics.sensors.camera.camera import MAX_PIXELS, CameraSpec, world_from_camera
from autodrive.physics.sensors.camera.imperfections import CameraImperfections
from autodrive.physics.sensors.camera.view import View
from autodrive.physics.weather import ChangingWeather
from autodrive.protocol.messages import CameraIntrinsics, Headlights, Indicators, Weather
from autodrive.world.compile import CompiledScenario
from autodrive.world.factory import compile_scenario
from autodrive.world.frames import REVERSE_SPEED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.scenario import ScenarioSpec


class BatchState(Protocol):
    """What is drawn of n worlds with v vehicles and o boxes: `autodrive.world.batch.Readings` has these arrays."""

    @property
    def position(self) -> Floats:
        """Centre of the rear axle in the map [m], shape (n, v, 3)."""
        ...

    @property
    def orientation(self) -> Floats:
        """Orientation of the vehicle, quaternion wxyz, map from vehicle, shape (n, v, 4)."""
        ...

    @property
    def throttle(self) -> Floats:
        """Throttle [-1, 1], shape (n, v): zero lights the brake lights, a negative one the reverse lights."""
        ...

    @property
    def wheel_steering_angle(self) -> Floats:
        """Steering angle of each wheel, left positive [rad], shape (n, v, 4)."""
        ...

    @property
    def wheel_rotation_angle(self) -> Floats:
        """Rotation of each wheel since the reset [rad], shape (n, v, 4)."""
        ...

    @property
    def wheel_angular_velocity(self) -> Floats:
        """Spin of each wheel [rad/s], shape (n, v, 4); if it is negative, the reverse lights are on."""
        ...

    @property
    def wheel_compression(self) -> Floats:
        """Compression of the suspension of each wheel [m], shape (n, v, 4)."""
        ...

    @property
    def object_pose(self) -> Floats:
        """Position [m] and quaternion wxyz of each movable box, shape (n, o, 7)."""
        ...


class BatchCamera:
    """One camera of one vehicle in n worlds of a scenario: `render(batch.readings)` returns n small images.

    The images are those of an ideal camera with the mount and the vertical field of view (or focal length and sensor)
    of that camera: without lens distortion, vignetting, exposure, motion blur, rolling shutter and noise. There is no
    depth, no label, no schedule and no time of day other than day and night. Lamps are those of the state; indicators
    are off. An image shows the shadows of at most four vehicles, and eight lamps besides headlights.

    The same state gives the same bits, whichever worlds are drawn with it. The images equal those of an ideal camera in
    `autodrive.make(..., cameras=quality)` at the same size that is drawn alone, but for rounding, and where more than
    two vehicles or four lamps affect one mesh. One thread may use it at a time.
    """

    def __init__(
        self,
        scenario: ScenarioSpec | CompiledScenario,
        vehicle: str,
        camera: str,
        *,
        size: tuple[int, int] = (84, 84),
        quality: str = "small",
    ) -> None:
        """`size`: width and height [pixels]; `quality`: one of `autodrive.graphics.render.quality.NAMES`.

        Raises `AutodriveError` if there is no such camera, and `GlUnavailable` without OpenGL.
        """
        compiled = scenario if isinstance(scenario, CompiledScenario) else compile_scenario(scenario)
        spec = _ideal(compiled, vehicle, camera, size)
        origin, upright = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
        view = View(*world_from_camera(origin, upright, spec.mount), spec.intrinsics, spec.near, spec.far)
        row = list(compiled.vehicles).index(vehicle)
        self._renderer = BatchRenderer(scene_of(compiled), quality, vehicle=row, view=view)
        self._release = weakref.finalize(self, self._renderer.release)
        self._shape = len(compiled.vehicles), len(compiled.boxes)
        self._is_day = compiled.spec.scene_light
        self._weather = ChangingWeather.settled(compiled.spec.weather.message).at(0.0)
        self.intrinsics: CameraIntrinsics = spec.intrinsics
        """Pinhole parameters in pixels."""

    def render(
        self,
        states: BatchState,
        *,
        is_day: bool | None = None,
        headlights: Headlights = Headlights.OFF,
        weather: Sequence[Weather] | None = None,
    ) -> NDArray[np.uint8]:
        """One image of each world, RGB, shape (n, height, width, 3).

        `is_day`: None is the light of the scenario; `headlights`: of all vehicles; `weather`: of each world, as
        `BatchWorld.weathers` has it, None: that of the scenario.
        """
        n, (v, o) = len(states.position), self._shape
        vehicles, objects = np.zeros((n, v), VEHICLE), np.zeros((n, o), OBJECT)
        for row, field, column in (
            (vehicles, "position", states.position),
            (vehicles, "orientation", states.orientation),
            (vehicles, "steering", states.wheel_steering_angle),
            (vehicles, "spin", states.wheel_rotation_angle),
            (vehicles, "compression", states.wheel_compression),
            (objects, "position", states.object_pose[..., :3]),
            (objects, "orientation", states.object_pose[..., 3:]),
        ):
            # a world whose physics has diverged must not disturb the others
            row[field] = np.nan_to_num(column, posinf=0.0, neginf=0.0)
        is_reversing = states.wheel_angular_velocity[..., 2:].mean(-1) < REVERSE_SPEED
        throttle = states.throttle
        vehicles["lamps"] = _levels(headlights)[(throttle == 0.0) * 1, ((throttle < 0.0) | is_reversing) * 1]
        is_light = self._is_day if is_day is None else is_day
        weathers = [self._weather] * n if weather is None else weather
        looks = [in_air(DAY if is_light else NIGHT, air_of(world_weather)) for world_weather in weathers]
        return self._renderer.draw_batch(looks, vehicles, objects, is_day=is_light)

    def close(self) -> None:
        """Free all graphics memory; `render` cannot be called any more."""
        self._release()


def _ideal(compiled: CompiledScenario, vehicle: str, camera: str, size: tuple[int, int]) -> CameraSpec:
    """The Spec of that camera without imperfections, for images of that size."""
    if vehicle not in compiled.vehicles:
        raise AutodriveError(
            f"vehicle '{vehicle}' is not in this scenario. {suggest(vehicle, list(compiled.vehicles))}"
        )
    cameras = compiled.vehicles[vehicle].cameras
    if camera not in cameras:
        raise AutodriveError(f"vehicle '{vehicle}' has no camera '{camera}'. {suggest(camera, list(cameras))}")
    width, height = size
    if min(size) < 1 or width * height > MAX_PIXELS:
        raise AutodriveError(f"images of {width} x {height} pixels are not possible: from 1 x 1 to {MAX_PIXELS} pixels")
    changes = {"width": width, "height": height, "imperfections": CameraImperfections()}
    return cameras[camera].model_copy(update=changes)


def _levels(headlights: Headlights) -> Floats:
    """Brightness of each lamp, by whether a vehicle brakes and whether it reverses, shape (2, 2, lamps)."""
    return np.array(
        [
            [
                lamp_levels(lit_lamps(headlights, Indicators.OFF, 0.0, is_braking, is_reversing))
                for is_reversing in (False, True)
            ]
            for is_braking in (False, True)
        ]
    )
