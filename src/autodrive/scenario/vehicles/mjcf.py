"""MJCF of a vehicle: one free body with colliders. The wheel colliders do not touch the floor."""

from __future__ import annotations

from autodrive.protocol.messages import WHEEL_NAMES
from autodrive.scenario.maps.mjcf import friction, text
from autodrive.scenario.vehicles.spec import ColliderSpec, VehicleSpec


def vehicle_mjcf(name: str, spec: VehicleSpec, x: float, y: float, yaw: float) -> str:
    """MJCF of a vehicle that stands at x, y [m] with heading yaw [rad]."""
    body = spec.body
    side_friction = body.friction if spec.wheels.side_friction is None else spec.wheels.side_friction
    geoms = [_box(f"{name}/{part}", box, body.friction) for part, box in spec.colliders.items()]
    # The suspension ray supports the wheel; this collider is for contacts with walls.
    radius = spec.wheels.collider_radius or spec.wheels.radius - spec.wheels.suspension.compression_max
    geoms += [
        f'<geom name="{name}/wheel_{side}" class="wheel" size="{radius:.17g} {spec.wheels.width / 2:.17g}" '
        f'pos="{text(hub)}" {friction(side_friction)}/>'
        for side, hub in zip(WHEEL_NAMES, spec.hubs, strict=True)
    ]
    pose = spec.standing(x, y, yaw)
    return (
        f'<body name="{name}" pos="{text(pose[:3])}" quat="{text(pose[3:])}">'
        f'<freejoint name="{name}"/>'
        f'<inertial pos="{text(body.center_of_mass)}" mass="{body.mass:.17g}" diaginertia="{text(body.inertia)}"/>'
        f"{''.join(geoms)}</body>"
    )


def _box(name: str, box: ColliderSpec, coefficient: float) -> str:
    half = tuple(length / 2 for length in box.size)
    return (
        f'<geom name="{name}" class="chassis" type="box" size="{text(half)}" pos="{text(box.position)}" '
        f"{friction(coefficient)}/>"
    )
