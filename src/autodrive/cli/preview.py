"""Renders an image of a vehicle, module, map or scenario: `autodrive show NAME --3d FILE.png`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from autodrive.base.cache import write_file
from autodrive.base.png import encode_png
from autodrive.base.transforms import quaternion_from_yaw, rotation_from_quaternion
from autodrive.graphics.assets.asset import Asset, AssetNode, Material, MeshSurface
from autodrive.graphics.cameras.viewpoints import Viewpoint, orbit
from autodrive.graphics.meshes import store
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import RenderScene
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import Headlights, Indicators, Lights, TailLights
from autodrive.scenario.kinds import Kind
from autodrive.scenario.maps.draw import module_alone
from autodrive.scenario.maps.map import Map, load_map
from autodrive.scenario.vehicles.spec import VehicleSpec, load_vehicle
from autodrive.world.factory import compile_scenario, world_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE = 1600, 1000
"""Size of the image [pixels]; it is rendered at twice this size and scaled down, for smooth edges."""
NIGHT_LIGHTS = Lights(Headlights.LOW, Indicators.HAZARD, TailLights.BRIGHT, True, True, False)
"""Lamps of all vehicles in an image at night."""
DUSK = 17.8 * 3600.0
"""Time of day of the image of a vehicle at night [s]: its own lamps do not light it."""
FIELD_OF_VIEW_DEG = 28.0
"""Vertical [degree]; narrow, for little perspective distortion."""


def render_preview(kind: Kind, name: str, path: Path, *, is_day: bool = True) -> None:
    """Write an image as PNG. Raises `SpecError`, and `GlUnavailable` if there is no OpenGL."""
    if kind == "vehicle":
        spec = load_vehicle(name)
        scene, state = _vehicle_scene(spec)
        viewpoint = framed(_vehicle_box(spec), 32.0, 22.0)
    else:
        if kind == "scenario":
            compiled = compile_scenario(name)
            map_, scene = compiled.map, store.scene_of(compiled)
            state = RenderState.of(world_of(compiled, cameras=False).frame)
        else:
            map_ = module_alone(name) if kind == "module" else load_map(name)
            scene, state = _map_scene(map_)
        viewpoint = framed(_map_box(map_), -62.0, 38.0)
    if not is_day:
        state.switch_lamps(NIGHT_LIGHTS)
        state.header["is_day"], state.header["time_of_day"] = False, DUSK if kind == "vehicle" else math.nan
    view = viewpoint.view(2 * SIZE[0], 2 * SIZE[1])
    with Renderer(scene, "gpu") as renderer:
        write_file(path, encode_png(_halved(renderer.draw(state, [view])[0].rgba[..., :3])))


def framed(box: NDArray[np.float64], azimuth_deg: float, elevation_deg: float) -> Viewpoint:
    """A viewpoint in a direction that shows a whole box, given by its minimum and maximum corner [m], shape (2, 3)."""
    x, y, z = middle = box.mean(axis=0).tolist()
    ahead = orbit((x, y, z), 1.0, azimuth_deg, elevation_deg, FIELD_OF_VIEW_DEG).view(*SIZE)
    right, down, forward = np.reshape(rotation_from_quaternion(ahead.orientation), (3, 3)).T
    k = ahead.intrinsics
    corners = np.array([(x, y, z) for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]]) - middle
    across = np.maximum(np.abs(corners @ right) * k.fx / k.cx, np.abs(corners @ down) * k.fy / k.cy)
    distance = 1.04 * float(np.max(across - corners @ forward))
    far = orbit((x, y, z), distance, azimuth_deg, elevation_deg, FIELD_OF_VIEW_DEG)
    return replace(far, near=0.02 * distance)


# -- contents of the image -------------------------------------------------------------------------------------


def _vehicle_scene(spec: VehicleSpec) -> tuple[RenderScene, RenderState]:
    """A vehicle on a light floor."""
    edge = 12.0
    floor = MeshSurface(
        Material("studio", (0.62, 0.63, 0.65), roughness=0.9),
        np.array([(-edge, -edge, 0), (edge, -edge, 0), (edge, edge, 0), (-edge, edge, 0)], np.float32),
        np.tile(np.array([0, 0, 1], np.float32), (4, 1)),
        np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        Label.GROUND,
    )
    studio = Asset("studio", (AssetNode("floor", surfaces={"full": (floor,)}),))
    state = RenderState.empty(1, 0)
    state.header["is_day"] = True
    pose = spec.standing(0.0, 0.0, 0.0)
    state.vehicles["position"][0], state.vehicles["orientation"][0] = pose[:3], pose[3:]
    return RenderScene(studio, [store.vehicle(spec)], [], [spec.lights]), state


def _map_scene(map_: Map) -> tuple[RenderScene, RenderState]:
    """A map with its boxes, without vehicles."""
    state = RenderState.empty(0, len(map_.boxes))
    state.header["is_day"] = True
    for row, box in zip(state.objects, map_.boxes, strict=True):
        row["position"], row["orientation"] = box.position, quaternion_from_yaw(box.yaw)
    return RenderScene(store.ground(map_), [], [store.box(box.size) for box in map_.boxes], []), state


def _vehicle_box(spec: VehicleSpec) -> NDArray[np.float64]:
    """Bounding box of a vehicle on the floor [m]."""
    length, width, _ = spec.size
    middle, top = 0.5 * spec.wheelbase, 0.21
    return np.array([(middle - 0.5 * length, -0.5 * width, 0.0), (middle + 0.5 * length, 0.5 * width, top)])


def _map_box(map_: Map) -> NDArray[np.float64]:
    x0, y0, x1, y1 = map_.bounds
    return np.array([(x0, y0, 0.0), (x1, y1, 0.1)])


def _halved(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Half the size: each pixel is the mean of four."""
    height, width, _ = image.shape
    parts = image.reshape(height // 2, 2, width // 2, 2, 3)
    return np.round(parts.mean(axis=(1, 3))).astype(np.uint8)
