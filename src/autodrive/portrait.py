"""Pictures of vehicles, modules, maps and scenarios as they look, for people: `autodrive show NAME --3d FILE.png`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from autodrive import assets
from autodrive.compile import Compiled, compile_scenario
from autodrive.descriptions import Kind
from autodrive.maps.draw import module_alone
from autodrive.maps.map import Map, load_map
from autodrive.maps.solids import BoxPlacement
from autodrive.protocol.messages import CameraIntrinsics
from autodrive.render.asset import Asset, Label, Material, Node, Surface
from autodrive.render.moment import Moment
from autodrive.render.png import write_png
from autodrive.render.renderer import Renderer
from autodrive.render.scene import Scene
from autodrive.render.view import View
from autodrive.scenario import load_scenario
from autodrive.sensors.camera import OPTICAL
from autodrive.transforms import compose, quaternion_from_euler, quaternion_from_yaw, rotate
from autodrive.units import DEGREE
from autodrive.vehicles.spec import VehicleSpec, load_vehicle

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE = 1600, 1000
"""Of a picture [pixels]; it is drawn at twice the size and made smaller, so that edges are smooth."""
FIELD_OF_VIEW = 28 * DEGREE
"""Vertical; a long lens shows proportions as they are."""


def portrait(kind: Kind, name: str, path: Path, *, is_day: bool = True) -> None:
    """Draw it as PNG. Raises `SpecError`, and `GlUnavailable` where nothing can be drawn."""
    if kind == "vehicle":
        spec = load_vehicle(name)
        scene, moment = _standing(spec)
        view = framed(_vehicle_box(spec), 32.0 * DEGREE, 22.0 * DEGREE, 2 * SIZE[0], 2 * SIZE[1])
    else:
        if kind == "scenario":
            compiled = compile_scenario(load_scenario(name))
            map_, scene, moment = compiled.map, assets.scene_of(compiled), _start(compiled)
        else:
            map_ = module_alone(name) if kind == "module" else load_map(name)
            scene, moment = _empty(map_)
        view = framed(_map_box(map_), -62.0 * DEGREE, 38.0 * DEGREE, 2 * SIZE[0], 2 * SIZE[1])
    moment.header["is_day"] = is_day
    with Renderer(scene, "gpu") as renderer:
        write_png(path, _halved(renderer.draw(moment, [view])[0].rgba[..., :3]))


def framed(box: NDArray[np.float64], azimuth: float, elevation: float, width: int, height: int) -> View:
    """From that direction, as near as shows all of a box: its least and greatest corner [m], shape (2, 3)."""
    turn = quaternion_from_euler(0.0, elevation, azimuth + math.pi)
    forward, left, up = (np.array(rotate(turn, axis)) for axis in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)))
    tan_y = math.tan(0.5 * FIELD_OF_VIEW)
    tan_x = tan_y * width / height
    middle = box.mean(axis=0)
    corners = np.array([(x, y, z) for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]]) - middle
    across = np.maximum(np.abs(corners @ left) / tan_x, np.abs(corners @ up) / tan_y)
    distance = 1.04 * float(np.max(across - corners @ forward))
    x, y, z = (middle - distance * forward).tolist()
    f = 0.5 * height / tan_y
    intrinsics = CameraIntrinsics(width, height, f, f, 0.5 * width, 0.5 * height)
    return View((x, y, z), compose(turn, OPTICAL), intrinsics, near=0.02 * distance)


# -- what is in the picture -------------------------------------------------------------------------------------


def _standing(spec: VehicleSpec) -> tuple[Scene, Moment]:
    """A vehicle on a plain light floor."""
    n, edge = 48, 12.0  # many small squares: a triangle that reaches behind the camera shows its edges
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-edge, edge, n + 1), np.linspace(-edge, edge, n + 1)))
    corner = (np.arange(n) + (n + 1) * np.arange(n)[:, None]).ravel()[:, None]
    floor = Surface(
        Material("studio", (0.62, 0.63, 0.65), roughness=0.9),
        np.column_stack([x, y, np.zeros_like(x)]).astype(np.float32),
        np.tile(np.array([0, 0, 1], np.float32), (len(x), 1)),
        np.concatenate([corner + np.array(of) for of in ((0, 1, n + 2), (0, n + 2, n + 1))]).astype(np.uint32),
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
