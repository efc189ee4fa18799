"""What a viewer needs to draw a world: its Scene, and the .glb files that the Scene names."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive import assets
from autodrive.actuators.lights import LAMPS, LightsSpec
from autodrive.protocol.messages import Pose
from autodrive.protocol.native import Lamp, Scene, VehicleScene
from autodrive.render.look import light_table
from autodrive.render.viewpoints import scene_cameras

if TYPE_CHECKING:
    from autodrive.sensors.catalog import SensorSuiteSpec
    from autodrive.sensors.sensor import Mount
    from autodrive.vehicles.spec import VehicleSpec
    from autodrive.world import World

FOLDER = "scene"
"""Of the files, relative to the page."""


@dataclass(frozen=True)
class Scenery:
    """A world's Scene and the content of its files by name; equal things share a file."""

    scene: Scene
    files: dict[str, bytes]

    @staticmethod
    def of(world: World, scenario: str) -> Scenery:
        """For that world, made of the scenario of that name. What was never drawn on this machine is built first."""
        files = _Files()
        scene = Scene(
            scenario=scenario,
            title=world.spec.title,
            map=world.spec.map,
            tick=world.tick_duration,
            model=files.url("map", world.map),
            vehicles={
                name: _vehicle(spec, world.spec.vehicles[name].type, files)
                for name, spec in world.vehicle_specs.items()
            },
            objects={name: files.url("box", box.size) for name, box in world.boxes.items()},
            light_table=light_table(),
            scene_cameras=scene_cameras(),
        )
        return Scenery(scene, files.content)


@dataclass
class _Files:
    content: dict[str, bytes] = field(default_factory=dict)

    def url(self, kind: assets.Kind, of: Any) -> str:
        """Relative to the page."""
        name, data = assets.file(kind, of)
        self.content[name] = data
        return f"{FOLDER}/{name}"


def _vehicle(spec: VehicleSpec, type_: str, files: _Files) -> VehicleScene:
    lidar = spec.sensors.lidar
    return VehicleScene(
        type=type_,
        model=files.url("vehicle", spec),
        half_length=0.5 * max(spec.size),
        steering_limit=spec.steering.limit,
        lamps=_lamps(spec.lights),
        cameras=list(spec.cameras),
        lidar=lidar and _pose(lidar.mount),
        wheelbase=spec.wheelbase,
        wheel_radius=spec.wheels.radius,
        speed_limit=spec.drivetrain.speed_limit * spec.wheels.radius,
        sensor_noise=_noise(spec.sensors),
    )


def _noise(sensors: SensorSuiteSpec) -> dict[str, float]:
    """Of what is noisy by itself; a step of `d` adds its rounding, d^2 / 12."""
    noises = {
        "encoder_angle": sensors.encoders.noise,
        "ips": sensors.ips.noise,
        "imu_orientation": sensors.imu.noise.orientation,
        "imu_angular_velocity": sensors.imu.noise.angular_velocity,
        "imu_linear_acceleration": sensors.imu.noise.linear_acceleration,
    }
    return {name: hypot(noise.sigma, noise.offset, noise.step / 12**0.5) for name, noise in noises.items()}


def _lamps(lights: LightsSpec) -> dict[str, Lamp]:
    """Each lamp of each side."""
    lamps = {}
    for name in LAMPS:
        lamp, _, side = name.rpartition("_")
        spec = getattr(lights, lamp)
        x, y, z = spec.position
        lamps[name] = Lamp((x, y if side == "left" else -y, z), spec.color, spec.range)
    return lamps


def _pose(mount: Mount) -> Pose:
    return Pose(np.array(mount.position), np.array(mount.orientation))
