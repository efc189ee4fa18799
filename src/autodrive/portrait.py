"""Pictures of vehicles, modules, maps and scenarios as they look, for people: `autodrive show NAME --3d FILE.png`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from autodrive import assets
from autodrive.compile import Compiled, compile_scenario
from autodrive.descriptions import Kind
from autodrive.maps.draw import module_alone
from autodrive.maps.map import Map, load_map
from autodrive.maps.solids import BoxPlacement
from autodrive.render.asset import Asset, Label, Material, Node, Surface
from autodrive.render.moment import Moment
from autodrive.render.png import write_png
from autodrive.render.renderer import Renderer
from autodrive.render.scene import Scene
from autodrive.render.view import View
from autodrive.render.viewpoints import orbit
from autodrive.scenario import load_scenario
from autodrive.transforms import quaternion_from_yaw, rotation_from_quaternion
from autodrive.vehicles.spec import VehicleSpec, load_vehicle

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE = 1600, 1000
"""Of a picture [pixels]; it is drawn at twice the size and made smaller, so that edges are smooth."""
FIELD_OF_VIEW_DEG = 28.0
"""Vertical [degree]; a long lens shows proportions as they are."""


def portrait(kind: Kind, name: str, path: Path, *, is_day: bool = True) -> None:
    """Draw it as PNG. Raises `SpecError`, and `GlUnavailable` where nothing can be drawn."""
    if kind == "vehicle":
        spec = load_vehicle(name)
        scene, moment = _standing(spec)
        view = framed(_vehicle_box(spec), 32.0, 22.0, 2 * SIZE[0], 2 * SIZE[1])
    else:
        if kind == "scenario":
            compiled = compile_scenario(load_scenario(name))
            map_, scene, moment = compiled.map, assets.scene_of(compiled), _start(compiled)
        else:
            map_ = module_alone(name) if kind == "module" else load_map(name)
            scene, moment = _empty(map_)
        view = framed(_map_box(map_), -62.0, 38.0, 2 * SIZE[0], 2 * SIZE[1])
    moment.header["is_day"] = is_day
    with Renderer(scene, "gpu") as renderer:
        write_png(path, _halved(renderer.draw(moment, [view])[0].rgba[..., :3]))


def framed(box: NDArray[np.float64], azimuth_deg: float, elevation_deg: float, width: int, height: int) -> View:
    """From that direction, as near as shows all of a box: its least and greatest corner [m], shape (2, 3)."""
    x, y, z = middle = box.mean(axis=0).tolist()
    ahead = orbit((x, y, z), 1.0, azimuth_deg, elevation_deg, FIELD_OF_VIEW_DEG).view(width, height)
    right, down, forward = np.reshape(rotation_from_quaternion(ahead.orientation), (3, 3)).T
    k = ahead.intrinsics
    corners = np.array([(x, y, z) for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]]) - middle
    across = np.maximum(np.abs(corners @ right) * k.fx / k.cx, np.abs(corners @ down) * k.fy / k.cy)
    distance = 1.04 * float(np.max(across - corners @ forward))
    far = orbit((x, y, z), distance, azimuth_deg, elevation_deg, FIELD_OF_VIEW_DEG)
    return replace(far, near=0.02 * distance).view(width, height)


# -- what is in the picture -------------------------------------------------------------------------------------


def _standing(spec: VehicleSpec) -> tuple[Scene, Moment]:
    """A vehicle on a plain light floor."""
    edge = 12.0
    floor = Surface(
        Material("studio", (0.62, 0.63, 0.65), roughness=0.9),
        np.array([(-edge, -edge, 0), (edge, -edge, 0), (edge, edge, 0), (-edge, edge, 0)], np.float32),
        np.tile(np.array([0, 0, 1], np.float32), (4, 1)),
        np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        Label.GROUND,
    )
    studio = Asset("studio", (Node("floor", surfaces={"full": (floor,)}),))
    moment = Moment.empty(1, 0)
    moment.vehicles["position"][0] = 0.0, 0.0, spec.ride_height
    moment.vehicles["orientation"][0, 0] = 1.0
    return Scene(studio, [assets.vehicle(spec)], [], [spec.lights]), moment


def _empty(map_: Map) -> tuple[Scene, Moment]:
    """A map and its boxes, without vehicles."""
    moment = Moment.empty(0, len(map_.boxes))
    _place_boxes(moment, map_.boxes)
    return Scene(assets.ground(map_), [], [assets.box(box.size) for box in map_.boxes], []), moment


def _start(compiled: Compiled) -> Moment:
    """A scenario at its start."""
    moment = Moment.empty(len(compiled.vehicles), len(compiled.boxes))
    places = compiled.spec.vehicles
    for row, (name, spec) in zip(moment.vehicles, compiled.vehicles.items(), strict=True):
        row["position"] = places[name].x, places[name].y, spec.ride_height
        row["orientation"] = quaternion_from_yaw(places[name].yaw)
    _place_boxes(moment, compiled.boxes)
    return moment


def _place_boxes(moment: Moment, boxes: Sequence[BoxPlacement]) -> None:
    for row, box in zip(moment.objects, boxes, strict=True):
        row["position"], row["orientation"] = box.position, quaternion_from_yaw(box.yaw)


def _vehicle_box(spec: VehicleSpec) -> NDArray[np.float64]:
    """Around the vehicle as it stands, with a little floor [m]."""
    length, width, _ = spec.size
    middle, top = 0.5 * spec.wheelbase, 0.21
    return np.array([(middle - 0.5 * length, -0.5 * width, 0.0), (middle + 0.5 * length, 0.5 * width, top)])


def _map_box(map_: Map) -> NDArray[np.float64]:
    x0, y0, x1, y1 = map_.bounds
    return np.array([(x0, y0, 0.0), (x1, y1, 0.1)])


def _halved(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Each pixel the mean of four."""
    height, width, _ = picture.shape
    parts = picture.reshape(height // 2, 2, width // 2, 2, 3)
    return np.round(parts.mean(axis=(1, 3))).astype(np.uint8)
