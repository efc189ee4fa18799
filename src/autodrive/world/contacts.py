"""Collision shapes and contact forces of a world, for those who look at them; no result depends on them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive.base.arrays import read_only_copy
from autodrive.base.transforms import Quaternion, Vector, inverse, rotate
from autodrive.protocol.messages import WHEEL_NAMES, Pose
from autodrive.protocol.native import CollisionShapes, ContactForces, Shapes

if TYPE_CHECKING:
    from autodrive.physics.model import Model
    from autodrive.physics.state import State
    from autodrive.world.compile import CompiledScenario


def shapes_of(compiled: CompiledScenario) -> Shapes:
    """The collision shapes and sensors of a world."""
    c = compiled
    shapes = c.model.shapes

    def chosen(rows: Any) -> CollisionShapes:
        return CollisionShapes(
            kind=np.ascontiguousarray(shapes.kind[rows]),
            size=np.ascontiguousarray(shapes.size[rows]),
            position=np.ascontiguousarray(shapes.position[rows]),
            rotation=np.ascontiguousarray(shapes.rotation[rows]),
        )

    owners = np.array(c.owners[1:])  # solid 0 is the floor
    moving = np.arange(len(owners)) >= shapes.n_fixed
    return Shapes(
        bodies={name: chosen(moving & (owners == name)) for name in (*c.vehicles, *c.objects)},
        fixed=chosen(slice(shapes.n_fixed)),
        sensors={
            vehicle: {
                name: Pose(np.array(sensor.spec.mount.position), np.array(sensor.spec.mount.orientation))
                for name, sensor in sensors.items()
                if sensor.is_on and hasattr(sensor.spec, "mount")
            }
            for vehicle, sensors in c.configured.items()
        },
    )


def contact_forces(compiled: CompiledScenario, duration: float) -> dict[str, ContactForces]:
    """What pushes each vehicle, after a tick of that `duration` [s] and before the rules have judged its contacts."""
    c = compiled
    pairs = c.contacts.pairs[: c.contacts.pair_count[0]].tolist()
    forces: dict[str, ContactForces] = {}
    for i, name in enumerate(c.vehicles):
        orientation = c.state.vehicle_orientation[i].tolist()
        parts, position, force = _wheels(i, orientation, c.model, c.state)
        for vehicle, solid in pairs:
            if vehicle == i:
                impulse, weighted = np.split(c.contacts.push[i, solid], 2)
                place = weighted / c.contacts.impulse[i, solid] - c.state.vehicle_position[i]
                parts.append(c.owners[solid])
                position.append(rotate(inverse(orientation), place))
                force.append(rotate(inverse(orientation), impulse / duration))
        arrays = (read_only_copy(np.array(rows).reshape(-1, 3)) for rows in (position, force))
        forces[name] = ContactForces(tuple(parts), *arrays)
    return forces


def _wheels(
    i: int, orientation: Quaternion, model: Model, state: State
) -> tuple[list[str], list[Vector], list[Vector]]:
    """Parts, positions [m] and forces [N] of the wheels that the ground carries, in the frame of vehicle i."""
    rows = slice(4 * i, 4 * i + 4)  # the vehicle's wheels in the Model and in the State
    # the normal of the ground, which is flat: the z axis of the map in the axes of the vehicle
    ux, uy, uz = rotate(inverse(orientation), (0.0, 0.0, 1.0))
    parts: list[str] = []
    position: list[Vector] = []
    force: list[Vector] = []
    for name, (x, y, z), radius, load, (along, aside), angle, compression in zip(
        WHEEL_NAMES,
        model.wheels["hub"][rows].tolist(),
        model.wheels["radius"][rows].tolist(),
        state.wheel_normal_load[rows].tolist(),
        state.wheel_force[rows].tolist(),
        state.wheel_steering_angle[rows].tolist(),
        state.wheel_compression[rows].tolist(),
        strict=True,
    ):
        if load <= 0.0:
            continue
        # the direction in which the wheel points, without its part along the normal: l lies in the ground
        ahead, left = math.cos(angle), math.sin(angle)
        up = ahead * ux + left * uy
        length = math.sqrt(1.0 - up * up)
        lx, ly, lz = (ahead - up * ux) / length, (left - up * uy) / length, -up * uz / length
        sx, sy, sz = (
            uy * lz - uz * ly,
            uz * lx - ux * lz,
            ux * ly - uy * lx,
        )  # s = u x l: in the ground, to the left of the wheel
        # where the tyre touches: a radius below the hub, which the suspension has raised
        parts.append(name)
        position.append((x - radius * ux, y - radius * uy, z + compression - radius * uz))
        force.append(
            (
                load * ux + along * lx + aside * sx,
                load * uy + along * ly + aside * sy,
                load * uz + along * lz + aside * sz,
            )
        )
    return parts, position, force
