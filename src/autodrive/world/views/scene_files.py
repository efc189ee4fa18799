"""The files that a client needs to draw a world: its Scene, and the .glb files that the Scene names."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive.graphics.cameras.viewpoints import scene_cameras
from autodrive.graphics.meshes import store
from autodrive.graphics.render.look import light_table
from autodrive.physics.actuators.lights import LAMPS, LightsSpec
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.physics.sensors.settings import ConfiguredSensor, noise_presets
from autodrive.protocol.labels import COLOURS
from autodrive.protocol.messages import Pose
from autodrive.protocol.native import Lamp, Plan, Scene, SensorScene, VehicleScene
from autodrive.scenario import MAX_BOXES
from autodrive.scenario.maps.draw import drawn_bounds, to_svg
from autodrive.world.editing.map_scene import map_scene
from autodrive.world.editing.track_edits import track_scene

if TYPE_CHECKING:
    from autodrive.physics.sensors.noise import NoiseSpec
    from autodrive.physics.sensors.sensor import Mount
    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.vehicles.spec import VehicleSpec
    from autodrive.world import World

PLAN_RESOLUTION = 60.0
"""Resolution of the drawing of the map [pixels/m]; browsers scale it."""

FOLDER = "scene"
"""Folder of the files, relative to the page."""


@dataclass(frozen=True)
class SceneFiles:
    """The Scene of a world and the content of its files by name; equal objects share a file."""

    scene: Scene
    files: dict[str, bytes]

    @staticmethod
    def of(world: World, scenario: str) -> SceneFiles:
        """The files of a world made from the scenario of that name. Missing .glb files are built first."""
        files = _Files()
        model, ground = files.map(world.map, is_draft=world.specs.map.is_draft)
        scene = Scene(
            scenario=scenario,
            title=world.spec.title,
            map=world.spec.map_name,
            tick=world.tick_duration,
            model=model,
            plan=files.plan(world.map),
            vehicles={name: _vehicle(name, spec, world, files) for name, spec in world.vehicle_specs.items()},
            objects={name: files.add(*box_file(box.size)) for name, box in world.boxes.items()},
            light_table=light_table(),
            scene_cameras=scene_cameras(),
            label_colours={label.name.lower().replace("_", " "): colour for label, colour in COLOURS.items()},
            object_sizes={name: box.size for name, box in world.boxes.items()},
            warm_up_laps=world.race.rules.warm_up_laps if world.race else 0,
            map_scene=map_scene(world, files.add),
            ground=ground,
            track_scene=track_scene(world),
        )
        return SceneFiles(scene, files.content)


@dataclass
class _Files:
    content: dict[str, bytes] = field(default_factory=dict)

    def url(self, kind: store.Kind, source: Any) -> str:
        """Address of the file, relative to the page."""
        return self.add(*store.file(kind, source))

    def map(self, map_: Map, *, is_draft: bool) -> tuple[str, list[str]]:
        """Address of the file of the map, and those of its ground, which is in several files while it is built."""
        if not is_draft:
            return self.url("map", map_), []
        solids, ground = store.map_files(map_)
        return self.add(*solids), [self.add(*part) for part in ground]

    def add(self, name: str, data: bytes) -> str:
        """Add a file; its address."""
        self.content[name] = data
        return f"{FOLDER}/{name}"

    def plan(self, map_: Map) -> Plan:
        """The drawing of the map."""
        boxless = replace(map_, boxes=())  # boxes can be moved
        svg = to_svg(boxless, pixels_per_metre=PLAN_RESOLUTION, overlays=("lanes",)).encode()
        name = f"plan-{hashlib.sha256(svg).hexdigest()[:16]}.svg"
        self.content[name] = svg
        return Plan(f"{FOLDER}/{name}", drawn_bounds(map_))


def vehicle_urdf(world: World, vehicle: str) -> str:
    """The URDF of a vehicle of the world; its name is that of the vehicle's type."""
    return store.urdf(world.vehicle_specs[vehicle], world.spec.vehicles[vehicle].type)


@lru_cache(2 * MAX_BOXES)
def box_file(size: tuple[float, float, float]) -> tuple[str, bytes]:
    """Name and content of the .glb file of a box, kept in memory: each edit makes a Scene with all the boxes again."""
    return store.file("box", size)


def _vehicle(name: str, spec: VehicleSpec, world: World, files: _Files) -> VehicleScene:
    sensors = world.sensors[name]
    lidar = spec.sensors.lidar if "lidar" in sensors and sensors["lidar"].is_on else None
    return VehicleScene(
        type=world.spec.vehicles[name].type,
        model=files.url("vehicle", spec),
        half_length=0.5 * max(spec.size),
        steering_limit=spec.steering.limit,
        lamps=_lamps(spec.lights),
        cameras=[name for name in spec.cameras if sensors[name].is_on],
        lidar=lidar and _pose(lidar.mount),
        is_lidar_level=lidar is not None and lidar.is_level,
        wheelbase=spec.wheelbase,
        wheel_radius=spec.wheels.radius,
        speed_limit=spec.full_throttle_speed,
        sensor_noise=sensor_noise(sensors),
        size=spec.size,
        sensors={name: _sensor(sensor) for name, sensor in sensors.items()},
        is_traffic=name in world.spec.traffic.names,
        missing_gravity=0.0 if spec.sensors.imu.measures_specific_force else world.spec.gravity,
    )


def _sensor(sensor: ConfiguredSensor) -> SensorScene:
    return SensorScene(
        is_on=sensor.is_on,
        rate=sensor.spec.rate,
        noise=sensor.noise,
        noises=list(noise_presets(sensor.spec)),
        is_camera=isinstance(sensor.spec, CameraSpec),
    )


def sensor_noise(sensors: Mapping[str, ConfiguredSensor]) -> dict[str, float]:
    """Standard deviations of the noise of the readings that the page shows, by name; see `VehicleScene.sensor_noise`.

    Rounding to a step d adds the variance d^2 / 12.
    """
    noises: dict[str, NoiseSpec] = {
        "encoder_angle": sensors["encoders"].spec.noise,
        "ips": sensors["ips"].spec.noise,
        "imu_orientation": sensors["imu"].spec.noise.orientation,
        "imu_angular_velocity": sensors["imu"].spec.noise.angular_velocity,
        "imu_linear_acceleration": sensors["imu"].spec.noise.linear_acceleration,
    }
    return {name: hypot(noise.sigma, noise.offset, noise.step / 12**0.5) for name, noise in noises.items()}


def _lamps(lights: LightsSpec) -> dict[str, Lamp]:
    """The lamps of both sides."""
    lamps = {}
    for name in LAMPS:
        lamp, _, side = name.rpartition("_")
        spec = getattr(lights, lamp)
        x, y, z = spec.position
        lamps[name] = Lamp((x, y if side == "left" else -y, z), spec.color, spec.range)
    return lamps


def _pose(mount: Mount) -> Pose:
    return Pose(np.array(mount.position), np.array(mount.orientation))
