"""Random maps and tracks, and how far what cameras, LIDARs and contacts find in them is apart."""

# mujoco has no type information
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import yaml

import autodrive
from autodrive.base.arrays import Floats
from autodrive.base.png import encode_png
from autodrive.base.transforms import quaternion_from_yaw, rotation_from_quaternion
from autodrive.graphics.assets.asset import Asset
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.model import BOX
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.rays import cast_rays
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.ground import floor_extent
from autodrive.scenario.maps.props import SIGNS
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.importer import ImportOptions, import_track
from autodrive.scenario.tracks.track import BarrierSpec, Track
from autodrive.world.compile import CompiledScenario
from tests.support.one_sensor import OneSensor
from tests.support.scenes import pinhole, view
from tests.support.sensor_scenes import SensorScene, state_of

TOLERANCE = 0.005
"""Largest distance of a surface that is drawn from the one that LIDARs and vehicles hit [m]."""
REACH = 8.0
"""Hits farther than this are ignored [m]."""
PROBE = 2.0 * TOLERANCE
"""Edge of the cube that looks for contacts [m]."""
FAR_AWAY = (300.0, 300.0, 50.0)
"""Where the car is, so that nothing sees it [m]."""


# -- random maps ------------------------------------------------------------------------------------------------

CELL = 2.0
"""Each object of a random map has a square of its own, of this edge length [m]."""
MODULES = ("straight_road", "curved_road", "dead_end", "three_way_intersection", "four_way_intersection", "parking_lot")


def random_scenario(seed: int, folder: Path) -> ScenarioSpec:
    """A car and a small cube in a random map (even seeds) or on a random track, whose file is in the folder."""
    file = folder / f"shapes_{seed}.yaml"
    rng = np.random.default_rng(seed)
    if seed % 2:
        file.write_text(random_track(rng, seed // 2, folder).text(), encoding="utf-8")
    else:
        file.write_text(yaml.safe_dump(random_map(rng)), encoding="utf-8")
    probe = BoxSpec(x=40.0, y=40.0, size=(PROBE, PROBE, PROBE))
    return ScenarioSpec(map=str(file), vehicles={"V1": VehiclePlacement()}, boxes={"probe": probe})


def random_map(rng: np.random.Generator) -> dict[str, Any]:
    """Walls, blocks, signs, traffic lights, boxes and roads at random poses; the car starts in the middle."""
    tree: dict[str, Any] = {"title": "Random", "is_draft": True, "ground": {"length": 30.0, "width": 30.0}}
    cells = [(CELL * i, CELL * j) for i in range(-3, 4) for j in range(-3, 4) if (i, j) != (0, 0)]
    kinds = rng.permutation(["walls"] * 12 + ["blocks"] * 6 + ["props"] * 18 + ["boxes"] * 6)
    for (x, y), kind in zip(rng.permutation(cells).tolist(), kinds, strict=False):
        yaw = float(rng.uniform(-180.0, 180.0))
        if kind == "walls":
            tree.setdefault("walls", []).append(_wall(rng, x, y))
        elif kind == "blocks":
            length, width = rng.uniform(0.02, 1.2, 2).tolist()
            block = {"x": x, "y": y, "yaw_deg": yaw, "length": length, "width": width}
            tree.setdefault("blocks", []).append(block | {"height": float(rng.uniform(0.02, 0.8))})
        elif kind == "props":
            sign = str(rng.choice([*SIGNS, "traffic_light"]))
            tree.setdefault("props", []).append({"kind": sign, "x": x, "y": y, "yaw_deg": yaw})
        else:
            size = dict(zip(("length", "width", "height"), rng.uniform(0.03, 0.6, 3).tolist(), strict=True))
            box = {"module": "construction_box", "x": x, "y": y, "yaw_deg": yaw, "z": float(rng.choice([0.0, 0.1]))}
            tree.setdefault("placements", []).append(box | size)
    for k, name in enumerate(rng.choice(MODULES, 3).tolist()):
        place = {"module": name, "x": 9.0 * (k - 1), "y": 11.0, "yaw_deg": float(rng.uniform(-180.0, 180.0))}
        tree.setdefault("placements", []).append(place)
    return tree


def _wall(rng: np.random.Generator, x: float, y: float) -> dict[str, Any]:
    """Up to eight points: far from each other, or a millimetre apart; corners may be sharp, ends open."""
    points = [np.array([x, y]) + rng.uniform(-0.8, 0.8, 2)]
    for _ in range(int(rng.integers(1, 8))):
        if rng.random() < 0.2:
            points.append(points[-1] + rng.uniform(-0.002, 0.002, 2))
        else:
            points.append(np.array([x, y]) + rng.uniform(-0.8, 0.8, 2))
    return {
        "points": [one.tolist() for one in points],
        "is_closed": bool(rng.random() < 0.3),
        "thickness": float(rng.choice([0.001, 0.01, 0.05, 0.1, 0.3])),
        "height": float(rng.uniform(0.05, 0.6)),
        "name": f"wall_{x:g}_{y:g}".replace("-", "m"),
    }


# -- random tracks ----------------------------------------------------------------------------------------------


def random_track(rng: np.random.Generator, number: int, folder: Path) -> Track:
    """A generated track, one with polygons as walls, or one that is imported from a picture, in turn."""
    source = (_generated, _with_islands, _imported)[number % 3]
    return source(rng, _barrier(rng), folder)


def _barrier(rng: np.random.Generator) -> BarrierSpec:
    width, height = rng.uniform(0.02, 0.4), rng.uniform(0.2, 0.5)
    if rng.random() < 0.4:
        return BarrierSpec(kind="wall", width=width, height=height)
    length, gap = (None, 0.0) if rng.random() < 0.3 else (rng.uniform(0.5, 3.0), rng.uniform(0.0, 0.2))
    return BarrierSpec(kind="duct", width=width, height=height, length=length, gap=gap)


def _generated(rng: np.random.Generator, barrier: BarrierSpec, folder: Path) -> Track:
    width = float(rng.uniform(0.9, 1.6))
    seed, radius = int(rng.integers(10_000)), float(rng.uniform(0.6, 1.2) * width)
    return generate_track(seed, length=30.0, width=width, area=(14.0, 10.0), min_radius=radius, barrier=barrier)


def _with_islands(rng: np.random.Generator, barrier: BarrierSpec, folder: Path) -> Track:
    """A ring between rough polygons, with islands: spikes, steps of millimetres, notches."""
    angle = np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False)
    centre = 3.5 * np.column_stack([np.cos(angle), np.sin(angle)])
    line = np.hstack([centre, np.full((60, 2), 0.9)])
    outer = _rough(rng, 4.4, 4.8)
    inner = _rough(rng, 2.2, 2.6)[::-1]
    walls = [outer, inner]
    for k in range(3):
        bearing = 2.0 * math.pi * (k + rng.uniform(0.1, 0.9)) / 3.0
        middle = 3.5 * np.array([math.cos(bearing), math.sin(bearing)])
        walls.append((middle + _rough(rng, 0.08, 0.3, int(rng.integers(3, 9))))[::-1])
    return Track("islands", line, walls=tuple(np.round(wall, 4) for wall in walls), barrier=barrier)


def _rough(rng: np.random.Generator, low: float, high: float, count: int = 40) -> Floats:
    """A star-shaped polygon, counter-clockwise, whose corners have that distance from its centre [m]."""
    angle = 2.0 * math.pi * (np.arange(count) + rng.uniform(-0.4, 0.4, count)) / count
    radius = rng.uniform(low, high, count)
    points = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    close = points[::5] + 0.0015 * np.column_stack([-np.sin(angle), np.cos(angle)])[::5]
    return np.insert(points, np.arange(0, count, 5) + 1, close, axis=0)


def _imported(rng: np.random.Generator, barrier: BarrierSpec, folder: Path) -> Track:
    """Of a picture of a map_server map whose walls are rough, at a random angle."""
    size, resolution = 220, 0.05
    y, x = (np.mgrid[0:size, 0:size] - size / 2.0) * resolution
    bearing, radius = np.arctan2(y, x), np.hypot(x, y)
    waves = sum(rng.uniform(-0.12, 0.12) * np.cos(k * bearing + rng.uniform(0.0, 6.0)) for k in range(2, 7))
    is_free = np.abs(radius - 3.5 - waves) < 0.7
    (folder / "random.png").write_bytes(encode_png(np.where(is_free, 254, 0).astype(np.uint8)))
    yaw = float(rng.uniform(-1.0, 1.0))
    (folder / "random.yaml").write_text(
        f"image: random.png\nresolution: {resolution}\norigin: [-5.5, -5.5, {yaw}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return import_track(folder / "random.yaml", ImportOptions(barrier=barrier))[0]


# -- rays -------------------------------------------------------------------------------------------------------


class Hits(NamedTuple):
    """What rays hit, at most `REACH` far; infinity: nothing."""

    origin: Floats
    """[m], shape (3,)."""
    directions: Floats
    """Unit vectors in the map, shape (n, 3)."""
    camera: Floats
    """Ranges in the image of depths [m], shape (n,); likewise the next two."""
    lidar: Floats
    contact: Floats
    """To the shapes that vehicles hit, by MuJoCo's own rays."""

    def point(self, distance: float, k: int) -> Floats:
        """The point of ray k at that distance [m]."""
        return self.origin + distance * self.directions[k]


class Shapes:
    """A random scenario: its images of depths, rays of its LIDARs, rays of MuJoCo, and contacts of its engine."""

    def __init__(self, spec: ScenarioSpec) -> None:
        self.compiled = autodrive.make(spec).compiled
        self._renderer = Renderer(scene_of(self.compiled), "software")
        self.triangles = drawn_triangles(self.compiled)
        """Corners of all that is drawn but the car [m], shape (n, 3, 3)."""
        self._model, self._data = _all_shapes(self.compiled)

    def release(self) -> None:
        """Free the memory of the images."""
        self._renderer.release()

    def hits(self, x: float, y: float, z: float, yaw_deg: float, pitch_deg: float, rows: int = 25) -> Hits:
        """What a camera there sees, with that many rows of pixels, and the other rays through its pixels."""
        eye = view(x, y, z, yaw_deg, pitch_deg, pinhole(2 * rows - 1, rows, 60.0))
        state = RenderState.empty(1, len(self.compiled.boxes))
        state.vehicles["position"][0], state.vehicles["orientation"][:, 0] = FAR_AWAY, 1.0
        for row, box in zip(state.objects, self.compiled.boxes, strict=True):
            row["position"], row["orientation"] = box.position, quaternion_from_yaw(box.yaw)
        own = eye.intrinsics
        v, u = np.mgrid[0 : own.height, 0 : own.width] + 0.5
        optical = np.stack([(u - own.cx) / own.fx, (v - own.cy) / own.fy, np.ones_like(u)], axis=-1).reshape(-1, 3)
        length = np.linalg.norm(optical, axis=1)
        rotation = np.array(rotation_from_quaternion(eye.orientation)).reshape(3, 3)
        directions = optical @ rotation.T / length[:, None]
        depth = self._renderer.draw(state, [eye], depth=True)[0].depth
        assert depth is not None
        camera = depth.ravel().astype(float) * length
        position = np.array([x, y, z])
        return Hits(
            position, directions, _near(camera), self.lidar(position, directions), self.contact(position, directions)
        )

    def scan(self, position: Floats) -> tuple[Floats, Floats]:
        """Ranges of a level scan of a LIDAR there, and those of MuJoCo's rays [m], shape (n,) each."""
        state = self.compiled.state
        spec = LidarSpec(rays=180, range_min=0.0, range_max=REACH)
        columns: dict[str, Any] = {"shape_position": state.shape_position, "shape_rotation": state.shape_rotation}
        where = SensorScene(self.compiled.model.shapes, state_of(vehicle_position=[position], **columns))
        directions = np.column_stack([np.cos(spec.bearings), np.sin(spec.bearings), np.zeros(spec.rays)])
        return OneSensor(spec, where).sample().ranges, self.contact(position, directions)

    def touched(self, position: Floats, yaw: float) -> list[str]:
        """What the cube touches there, with that yaw, besides vehicles."""
        engine, first = self.compiled.engine, self.compiled.objects["probe"]
        qpos = engine.start
        qpos[first : first + 7] = *position, *quaternion_from_yaw(yaw)
        pairs = [{self.compiled.owners[solid] for solid in pair} for pair in engine.overlapping(qpos, depth=0.0)]
        return sorted(
            name for pair in pairs if "probe" in pair for name in pair - {"probe", *self.compiled.spec.vehicles}
        )

    def lidar(self, position: Floats, directions: Floats) -> Floats:
        """Ranges of the rays of sensors; 0 inside of a shape."""
        shapes, state = self.compiled.model.shapes, self.compiled.state
        ranges = np.full(len(directions), np.nan)
        cast_rays(
            position,
            np.array([1.0, 0.0, 0.0, 0.0]),
            np.zeros((len(directions), 3)),
            np.ascontiguousarray(directions),
            2.0 * REACH,
            0,
            shapes,
            state.shape_position,
            state.shape_rotation,
            np.zeros(len(shapes.kind), np.int64),
            ranges,
        )
        return _near(ranges)

    def contact(self, position: Floats, directions: Floats) -> Floats:
        """Ranges of MuJoCo's rays to all that a vehicle can hit."""
        found = [
            mujoco.mj_ray(self._model, self._data, position, ray, None, 1, -1, np.zeros(1, np.int32))
            for ray in directions
        ]
        ranges = np.array(found)
        return _near(np.where(ranges < 0.0, math.inf, ranges))

    def has_floor(self, point: Floats) -> bool:
        """Whether the floor is drawn there: vehicles and LIDARs hit it without end."""
        x0, y0, x1, y1 = floor_extent(self.compiled.map)
        return bool(x0 < point[0] < x1 and y0 < point[1] < y1)

    def apart(self, hits: Hits) -> Floats:
        """Distance of what the camera sees from what the LIDAR hits [m], for each ray.

        If the two ranges differ, it is the distance of the nearer hit from the nearest surface of the other kind: along
        the rim of a shape one of two rays misses it, and a ray that is nearly parallel to a surface is long.
        """
        distance = np.zeros(len(hits.directions))
        differs = ~np.isclose(hits.camera, hits.lidar, rtol=0.0, atol=TOLERANCE)
        for k in np.flatnonzero(differs).tolist():
            point = hits.point(min(hits.camera[k], hits.lidar[k]), k)
            if hits.camera[k] < hits.lidar[k]:
                distance[k] = distance_to_shapes(self.compiled, point)
            elif point[2] > 1e-6 or self.has_floor(point):
                distance[k] = nearest_triangle(self.triangles, point)[0]
        return distance


def _near(ranges: Floats) -> Floats:
    return np.where(ranges > REACH, math.inf, ranges)


def distance_to_shapes(compiled: CompiledScenario, point: Floats) -> float:
    """Distance of a point outside of all shapes from the nearest one, or from the floor [m]."""
    shapes, state = compiled.model.shapes, compiled.state
    is_fixed_or_box = shapes.vehicle < 0
    rotation = state.shape_rotation.reshape(-1, 3, 3)
    local = np.abs(np.einsum("sji,sj->si", rotation, point - state.shape_position))
    size = shapes.size
    of_box = np.linalg.norm(np.maximum(local - size, 0.0), axis=1)
    aside = np.maximum(np.hypot(local[:, 0], local[:, 1]) - size[:, 0], 0.0)
    of_cylinder = np.hypot(aside, np.maximum(local[:, 2] - size[:, 1], 0.0))
    distance = np.where(shapes.kind == BOX, of_box, of_cylinder)[is_fixed_or_box]
    return float(min(abs(point[2]), distance.min(initial=math.inf)))


def drawn_triangles(compiled: CompiledScenario) -> Floats:
    """Corners of the triangles of the map and of the boxes, as cameras see them [m], shape (n, 3, 3)."""
    scene = scene_of(compiled)
    found = [*_triangles(scene.static, (0.0, 0.0, 0.0), 0.0)]
    for box, asset in zip(compiled.boxes, scene.objects, strict=True):
        found += _triangles(asset, box.position, box.yaw)
    return np.concatenate(found)


def _triangles(asset: Asset, position: Any, yaw: float) -> list[Floats]:
    found = []
    outer = np.array(rotation_from_quaternion(quaternion_from_yaw(yaw))).reshape(3, 3)
    for node in asset.nodes:
        assert not node.parent
        inner = np.array(rotation_from_quaternion(node.orientation)).reshape(3, 3)
        for surface in node.surfaces.get("reduced", ()):
            points = surface.positions.astype(float) @ inner.T + node.position
            found.append((points @ outer.T + position)[surface.triangles])
    return found


def nearest_triangle(triangles: Floats, point: Floats) -> tuple[float, Floats]:
    """Distance of a point from the nearest triangle [m], and the unit normal of that one."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    bound = np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0.0), axis=1)
    first = triangles[np.argsort(bound)[:20]]
    most = min(_distances(first, point))
    near = triangles[bound <= most + 1e-9]
    distances = _distances(near, point)
    k = int(np.argmin(distances))
    normal = np.cross(near[k, 1] - near[k, 0], near[k, 2] - near[k, 0])
    return float(distances[k]), normal / max(float(np.linalg.norm(normal)), 1e-30)


def _distances(triangles: Floats, point: Floats) -> Floats:
    """Distance of a point from each triangle: to the plane if it is above the triangle, else to the nearest edge."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
    above = np.einsum("ij,ij->i", point - a, normal)
    is_above = np.ones(len(triangles), bool)
    edge = np.full(len(triangles), math.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        along = q - p
        is_above &= np.einsum("ij,ij->i", np.cross(along, point - p), normal) >= 0.0
        share = np.einsum("ij,ij->i", point - p, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
        edge = np.minimum(edge, np.linalg.norm(point - p - np.clip(share, 0.0, 1.0)[:, None] * along, axis=1))
    return np.where(is_above, np.minimum(np.abs(above), edge), edge)


def _all_shapes(compiled: CompiledScenario) -> tuple[Any, Any]:
    """MuJoCo's model and data of the floor and of all shapes but those of the car."""
    shapes, state = compiled.model.shapes, compiled.state
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    for s in np.flatnonzero(shapes.vehicle < 0).tolist():
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, state.shape_rotation[s])
        spec.worldbody.add_geom(
            type=int(shapes.kind[s]), size=shapes.size[s], pos=state.shape_position[s], quat=quaternion
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data
