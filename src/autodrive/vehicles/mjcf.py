"""A vehicle as MuJoCo knows it: one free body with the colliders. Wheels make no contact with the floor here."""

from __future__ import annotations

from autodrive.physics.engine import text
from autodrive.transforms import quaternion_from_yaw
from autodrive.vehicles.spec import BoxSpec, VehicleSpec

WHEEL_NAMES = ("front_left", "front_right", "rear_left", "rear_right")


def vehicle_mjcf(name: str, spec: VehicleSpec, x: float, y: float, yaw: float) -> str:
    """MJCF of a vehicle standing at x, y [m] with heading yaw [rad]."""
    body = spec.body
    geoms = [_box(f"{name}/platform_{i}", box) for i, box in enumerate(spec.platforms, start=1)]
    geoms.append(_box(f"{name}/lidar", spec.lidar_collider))
    # The suspension ray carries the wheel on what is below it; this collider, smaller by the travel, meets walls.
    radius = spec.wheels.radius - spec.wheels.suspension.compression_max
    geoms += [
        f'<geom name="{name}/wheel_{side}" class="wheel" size="{radius:.17g} {spec.wheels.width / 2:.17g}" '
        f'pos="{text(hub)}"/>'
        for side, hub in zip(WHEEL_NAMES, spec.hubs, strict=True)
    ]
    return (
        f'<body name="{name}" pos="{text((x, y, spec.ride_height))}" quat="{text(quaternion_from_yaw(yaw))}">'
        f'<freejoint name="{name}"/>'
        f'<inertial pos="{text(body.center_of_mass)}" mass="{body.mass:.17g}" diaginertia="{text(body.inertia)}"/>'
        f"{''.join(geoms)}</body>"
    ).replace('class="chassis"', f'class="chassis" friction="{body.friction:.17g} 0.005 0.0001"')


def _box(name: str, box: BoxSpec) -> str:
    half = tuple(length / 2 for length in box.size)
    return f'<geom name="{name}" class="chassis" type="box" size="{text(half)}" pos="{text(box.position)}"/>'
